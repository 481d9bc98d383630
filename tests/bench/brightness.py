"""Errors of the tilt where ranges follow the brightness of a target, against the stated u.

    python -m tests.bench.brightness [--scans 60]

Two slopes of each scan count; `blind` is the same without intensities.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tests.support.shaded_discs import Disc, checkerboard, gradient, halves, plain
from wheelplane.config import PlaneConfig
from wheelplane.plane import fit_plane
from wheelplane.targets.plates import DiscTarget

TARGET = DiscTarget(shape="disc", diameter=0.25)
ARCSEC = 3600.0 * 180.0 / np.pi


def cases() -> Iterator[tuple[str, str, float, int, float | None]]:
    """Name, shading, bias in mm, points and incidence; None: 0 to 45 degrees."""
    for points in (300, 3000, 30_000):
        for incidence in (0.0, 45.0):
            for bias in (0.1, 0.3, 1.0):
                yield f"half dark, {incidence:.0f} deg", "halves", bias, points, incidence
    for points in (300, 3000, 30_000):
        yield "a third dark", "third", 0.3, points, None
        yield "squares of 25 mm", "fine", 1.0, points, None
        yield "squares of 60 mm", "coarse", 1.0, points, None
        yield "a trend, no bias", "trend", 0.0, points, None
        yield "one brightness", "plain", 0.0, points, None


def shading(kind: str, angle: float):
    """The brightness of one target."""
    return {
        "halves": halves(angle),
        "third": halves(angle, -0.265),
        "fine": checkerboard(0.025),
        "coarse": checkerboard(0.060),
        "trend": gradient(angle),
        "plain": plain,
    }[kind]


def run(scans: int) -> None:
    """Print a line for each case."""
    print('target                points  bias/mm   rms/"     u/"  blind/"  rms/u  in 95 %  fitted')
    for number, (name, kind, bias, points, incidence) in enumerate(cases()):
        errors, ratios, blind, us, fitted = [], [], [], [], 0
        for scan in range(scans):
            seed = 1000 * number + scan
            rng = np.random.default_rng(seed)
            angle, at = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 45.0)
            at = at if incidence is None else incidence
            disc = Disc(shading(kind, angle), points, bias * 1e-3, incidence_deg=at)
            patch, true = disc.scan(seed)
            plane = fit_plane(patch, TARGET, PlaneConfig())
            axes = plane.basis[:2]
            u = np.sqrt(np.diag(axes @ plane.normal_covariance @ axes.T))
            errors += list(axes @ true)
            us += list(u)
            ratios += list(axes @ true / u)
            without = fit_plane(replace(patch, face_intensity=None), TARGET, PlaneConfig())
            blind += list(without.basis[:2] @ true)
            fitted += plane.brightness is not None
        rms, u, other = (ARCSEC * np.sqrt(np.mean(np.square(x))) for x in (errors, us, blind))
        ratio = np.sqrt(np.mean(np.square(ratios)))
        inside = 100.0 * np.mean(np.abs(ratios) < 1.96)
        print(
            f"{name:20s} {points:7d} {bias:8.1f} {rms:7.1f} {u:7.1f} {other:8.1f} {ratio:6.2f}"
            f" {inside:8.1f} {fitted:4d}/{scans}",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=60)
    run(parser.parse_args().scans)
