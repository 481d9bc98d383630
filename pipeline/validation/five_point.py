"""Five-point file as the second method: blocks in the order of the scans, measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError, Wording
from ..five_point import (
    FivePointFile,
    Station,
    fit_block,
    fit_pentagon,
    measure_five_point,
    read_five_point,
)
from ..measurement import Measurement, WheelPose, WheelResult
from ..system import frozen
from ..uncertainty import UncertainTarget, UncertaintyComponent
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS

Estimator = Literal["tls", "tcgc-2013"]

AIMING_UNKNOWN = (
    "The mean of five points is taken as the wheel's centre, with the uncertainty of their noise "
    "only. In the target's plane they scatter by {scatter} mm (each axis) about regular pentagons: "
    "if regular ones were aimed at by eye, add --aiming {scatter}."
)


@frozen
class FivePointOptions:
    """Conventions of the five-point files, and what is known of the instrument.

    blocks: name of the scan of each block, by commas; None: in the order of the scans. aiming_m:
    standard uncertainty of aiming at a point, along each axis of the target. radius_m: of the
    circle that the five points of every block lie on.
    """

    length_unit: LengthUnit = "m"
    coordinates: Coordinates = "cartesian"
    angle_unit: AngleUnit | None = None
    azimuth: Azimuth = "auto"
    blocks: str | None = None
    station: Station | None = None
    aiming_m: float | None = None
    radius_m: float | None = None
    method: Estimator = "tls"

    @property
    def units(self) -> str:
        """Advice on what to check where the centres of the file are not those of the vehicle."""
        if self.coordinates == "spherical":
            return f"the angle unit (--angle-unit {self.angle_unit}), the length units"
        return (
            "the length units, that the rows are x y z (range azimuth zenith: --coordinates "
            "spherical)"
        )


@frozen
class FivePoints:
    """Five-point file with blocks in the order of `scans`, and its measurement."""

    file: FivePointFile
    scans: tuple[str, ...]
    measurement: Measurement

    def name_of(self, result: WheelResult) -> str:
        """Return the scan that belongs to `result`, one of the measurement's."""
        index = next(i for i, wheel in enumerate(self.measurement.wheels) if wheel is result)
        return self.scans[index]


def measure_points(
    path: Path, name: str, scans: Sequence[str], options: FivePointOptions
) -> FivePoints:
    """Read and measure the file at `path`, which messages call `name`. Raises InputError."""
    matched: dict[str, int] = {}

    def arrange(count: int) -> list[int]:
        matched.update(match_blocks(scans, count, options.blocks, name))
        return list(matched.values())

    file = read_five_point(
        path,
        name=name,
        length_unit=options.length_unit,
        coordinates=options.coordinates,
        angle_unit=options.angle_unit,
        azimuth=options.azimuth,
        arrange=arrange,
    )
    measurement = measure_five_point(file, _aiming_station(options), options.radius_m)
    return FivePoints(file, tuple(matched), measurement)


def points_of(file: FivePointFile, scans: Sequence[str]) -> FivePoints:
    """Measure a file that was read, its blocks in the order of `scans`. Raises InputError."""
    matched = match_blocks(scans, len(file.blocks_m), None, file.source)
    return FivePoints(file, tuple(matched), measure_five_point(file))


def _aiming_station(options: FivePointOptions) -> Station | None:
    """Return the total station, with the stated aiming in place of its file's."""
    if options.station is None or options.aiming_m is None:
        return options.station
    stated = options.station.stated.model_copy(update={"aiming_sigma_m": options.aiming_m})
    return replace(options.station, stated=stated)


def with_aiming(target: UncertainTarget, options: FivePointOptions) -> UncertainTarget:
    """Add the aiming's component to a target, where no total station states it."""
    if options.station is not None or not options.aiming_m:
        return target
    across = np.eye(3) - np.outer(target.normal, target.normal)
    factor = np.vstack([np.zeros((3, 3)), options.aiming_m / math.sqrt(5.0) * across])
    components = (*target.components, UncertaintyComponent("aiming", factor))
    return WheelPose(target.centre_m, target.normal, components)


def note_of_aiming(blocks_m: Array, options: FivePointOptions) -> tuple[str, ...]:
    """Return a note where nothing is known of how well the points were aimed at."""
    stated = options.station.stated.aiming_sigma_m if options.station else 0.0
    if options.aiming_m is not None or stated > 0.0:
        return ()
    scatter = pentagon_scatter_m(blocks_m)
    return (Wording(AIMING_UNKNOWN, scatter=f"{scatter * 1e3:.2g}"),)


def pentagon_scatter_m(blocks_m: Array) -> float:
    """Return the scatter (each axis) of blocks (M, 5, 3) about regular pentagons, metres.

    A pentagon has a centre, a size and a rotation, so 6 of 10 coordinates are left.
    """
    fits = [fit_block(block) for block in blocks_m]
    flat = (
        (block - fit.centre_m) @ fit.axes[1:].T for block, fit in zip(blocks_m, fits, strict=True)
    )
    left = sum(fit_pentagon(uv_m).square_m2 for uv_m in flat)
    return math.sqrt(left / (6.0 * len(blocks_m)))


NONE = "-"  # block without a scan


def match_blocks(
    scans: Sequence[str], blocks: int, mapping: str | None, source: str
) -> dict[str, int]:
    """Return the block (from 0) of each scan that has one, in the order of `scans`.

    scans: names of a capture's scans. blocks: their number in the file. mapping: name of the scan
    of each block, by commas, `-` for none; None: in the order of the scans, if the counts are
    equal. Raises InputError, which lists the contents of both.
    """
    held = f"{source} holds {blocks} blocks, the capture {len(scans)} scans ({','.join(scans)})"
    if mapping is None:
        if blocks != len(scans):
            raise InputError(f"{held}: name the scan of each block with --blocks, {NONE} for none")
        return {scan: index for index, scan in enumerate(scans)}
    named = [name.strip() for name in mapping.split(",")]
    if len(named) != blocks:
        raise InputError(f"--blocks names {len(named)}, but {held}: name one scan a block")
    found: dict[str, int] = {}
    for index, name in enumerate(named):
        if name == NONE:
            continue
        if name not in scans:
            raise InputError(f"--blocks names {name!r} for block {index + 1}, but {held}")
        if name in found:
            raise InputError(f"--blocks names {name!r} twice: name another, or {NONE}")
        found[name] = index
    lacking = [wheel for wheel in REFERENCE_WHEELS if wheel not in found]
    if lacking:
        raise InputError(f"--blocks lacks {lacking[0]}: the frame needs all four reference wheels")
    return {scan: found[scan] for scan in scans if scan in found}
