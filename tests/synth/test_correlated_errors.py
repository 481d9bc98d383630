"""Errors that beams share: scan lines, and correlation that differs along and across them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.made import chi_square_bounds, of_spot
from tests.synth.test_beam import MODES, NEAR_M, half_planes
from wheelplane_synth.parameters.parameters import Grid
from wheelplane_synth.scanner.scanner import scan
from wheelplane_synth.scene.scene import Scene

CENTRE_M = np.array([2.5, 0.0, 0.0])
SHAPE = (81, 81)
GRID = Grid(spacing_m=0.005, half_width_m=0.2)


def wall() -> Scene:
    """A plane at x = 2.5 m, wider than the window."""
    corners = np.array([[2.5, -1, -1], [2.5, 1, -1], [2.5, 1, 1], [2.5, -1, 1]])
    faces, both = np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, dtype=np.int64)
    plane = np.tile([1.0, 0, 0], (2, 1))
    return Scene(corners, faces, plane, both + 2.5, both, both + 0.5, both - 1, both > 0)


def errors_m(seed=1, **values):
    """Range errors (H, W) of a scan of the wall, over those of range_sigma_m(1, cosine)."""
    seen = scan(wall(), CENTRE_M, GRID, of_spot(0.0, **values), np.random.default_rng(seed))
    points = seen.points_station_m
    range_m = np.linalg.norm(points, axis=1)
    cosine = points[:, 0] / range_m
    error_m = range_m - 2.5 / cosine
    side = int(np.sqrt(len(error_m)))
    assert side**2 == len(error_m)
    return error_m.reshape(side, side), cosine.reshape(side, side)


@pytest.mark.parametrize(("lines", "axis"), [("columns", 0), ("rows", 1)])
def test_a_scan_line_has_one_offset_of_the_stated_deviation(lines, axis):
    offsets = []
    for seed in range(20):
        error_m, _ = errors_m(seed, line_sigma_m=0.00015, scan_lines=lines)
        assert np.ptp(error_m, axis=axis).max() < 1e-12
        offsets.append(error_m.mean(axis=axis) / 0.00015)
    offset = np.concatenate(offsets)
    low, high = chi_square_bounds(len(offset))
    assert low < np.sum(offset**2) < high
    # Neighbouring lines share nothing: 5 sigma of the mean product of independent normals.
    product = np.mean([np.mean(one[1:] * one[:-1]) for one in offsets])
    assert abs(product) < 5 / np.sqrt(len(offset))


@pytest.mark.parametrize("aspect", [0.25, 1.0, 4.0])
def test_correlation_falls_along_either_axis_as_stated(aspect):
    """exp(-d^2 / (2 L^2)) with L along elevation, and L * aspect along azimuth."""
    length_m, values = 0.01, {"correlated_sigma_m": 0.0005, "correlation_length_m": 0.01}
    fields = []
    for seed in range(40):
        error_m, cosine = errors_m(seed, **values, correlation_aspect=aspect)
        fields.append(error_m * cosine / 0.0005)
    field = np.stack(fields)
    lag = 2
    for axis, own_m in ((1, length_m), (2, aspect * length_m)):
        one = np.take(field, range(lag, field.shape[axis]), axis)
        other = np.take(field, range(field.shape[axis] - lag), axis)
        wanted = np.exp(-0.5 * (lag * GRID.spacing_m / own_m) ** 2)
        # A field holds about n s^2 / (pi L^2 aspect) independent values.
        independent = field.size * GRID.spacing_m**2 / (np.pi * length_m**2 * aspect)
        assert np.mean(one * other) == pytest.approx(wanted, abs=5 / np.sqrt(independent))


@pytest.mark.parametrize(
    "shared",
    [
        {"line_sigma_m": 0.001},
        {"correlated_sigma_m": 0.001, "correlation_length_m": 0.02},
    ],
)
def test_two_returns_of_a_beam_share_what_the_beams_beside_it_share(shared):
    """Errors against the same scan without noise: of both returns they are the same."""
    scene = half_planes(deep_m=NEAR_M / 2)
    scene = replace(scene, target=np.full(len(scene.faces), -1))
    centre_m, range_m = np.array([NEAR_M, 0.0, 0.0]), []
    for more in ({}, shared):
        beam = of_spot(0.01, **MODES, return_mode="two", **more)
        seen = scan(scene, centre_m, GRID, beam, np.random.default_rng(3)).points_station_m
        range_m.append(np.linalg.norm(seen, axis=1))
    error_m = range_m[1] - range_m[0]
    beams = np.round(seen / range_m[1][:, None], 9)
    first = {beam: k for k, beam in reversed(list(enumerate(map(tuple, beams))))}
    pairs = [(first[tuple(beam)], k) for k, beam in enumerate(beams)]
    one, other = np.array([pair for pair in pairs if pair[0] != pair[1]]).T
    assert len(one) > 100
    assert error_m[one] == pytest.approx(error_m[other], abs=1e-5)  # unlike cosines
    assert np.std(error_m[one]) > 5e-4
