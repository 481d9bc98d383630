"""Grids of beams by definition: waves, directions and beam of exact lattices, cells by loops."""

import numpy as np
import pytest

from wheelplane.plane.correlated_noise import POINTS_A_CELL
from wheelplane.plane.scan_lines import (
    CLEAR,
    LEAST_NARROW,
    LONG,
    NARROW,
    _power,
    cells_along_lines,
    grid_of,
    nearest,
    strong_waves,
)

PITCH = 0.002


def lattice(seed, radius, first_deg=7.0, between_deg=80.0, aspect=1.0, hole=0.0, jitter=0.0):
    """Points (N, 2) of a ring on an oblique grid, lines of the first kind along first_deg."""
    rng = np.random.default_rng(seed)
    angle = np.radians([first_deg, first_deg + between_deg])
    steps = PITCH * np.column_stack([np.cos(angle), np.sin(angle)]) * [[1.0], [aspect]]
    reach = int(3.0 * radius / PITCH)
    number = np.stack(np.meshgrid(*[np.arange(-reach, reach)] * 2), axis=-1).reshape(-1, 2)
    uv = (number + rng.uniform(-0.5, 0.5, 2)) @ steps
    away = np.hypot(*uv.T)
    uv = uv[(away < radius) & (away >= hole)]
    return uv + jitter * PITCH * rng.normal(size=uv.shape)


def moved(uv, noise_m, beam, seed=0):
    """Points with noise w off the plane, moved along the beams by it."""
    w = noise_m * np.random.default_rng([seed, 5]).standard_normal(len(uv))
    return np.column_stack([uv + w[:, None] * np.array(beam), w])


def off_deg(direction, degrees):
    return abs((np.degrees(np.arctan2(*direction[::-1])) - degrees + 90.0) % 180.0 - 90.0)


def whole(points, extra=None):
    return lambda work: [work(points, extra)]


@pytest.mark.parametrize("count", [5, 6])
def test_the_power_of_waves_is_that_of_the_mean_of_their_factors(count):
    rng = np.random.default_rng(1)
    k = rng.normal() + 0.7 * np.arange(count)
    x, m, c = (rng.normal(size=n) for n in ((40, 3), 4, 3))
    power = _power(x, (k, m, c))
    for (i, a), (j, b), (n, shift) in [
        ((i, k[i]), (j, m[j]), (n, c[n])) for i, j, n in np.ndindex(count, 4, 3)
    ]:
        factors = np.exp(1j * (a * x[:, 0] + b * x[:, 1] - shift * x[:, 2]))
        assert power[i, j, n] == pytest.approx(abs(factors.mean()) ** 2, abs=1e-5)


@pytest.mark.parametrize(
    ("first", "between", "aspect"),
    [
        (0.0, 90.0, 1.0),
        (33.0, 75.0, 1.0),
        (33.0, 75.0, 0.7),
        (120.0, 95.0, 2.0),
        (20.0, 90.0, 3.0),
        (70.0, 90.0, 5.5),
        (-40.0, 90.0, 0.2),
    ],
)
def test_directions_and_beam_of_an_exact_lattice(first, between, aspect):
    """To a hundredth of a degree: 19 lines of 350 points, seen at a hundredth of their distance."""
    uv = lattice(2, 0.06, first, between, aspect)
    grid = grid_of(moved(uv, 1e-5, (0.4, -0.3)))
    wanted = (first, first + between)
    for degrees in wanted:
        assert min(off_deg(direction, degrees) for direction in grid.directions) < 0.05
    assert np.linalg.norm(grid.directions, axis=1) == pytest.approx([1.0, 1.0])


def waves_of(first_deg, between_deg, aspect=1.0):
    """The two shortest steps (2, 2) of a lattice, and waves at which no step changes the phase."""
    angle = np.radians([first_deg, first_deg + between_deg])
    steps = PITCH * np.column_stack([np.cos(angle), np.sin(angle)]) * [[1.0], [aspect]]
    return steps, 2.0 * np.pi * np.linalg.inv(steps).T


@pytest.mark.parametrize(
    ("first", "between", "aspect"), [(0.0, 90.0, 1.0), (33.0, 75.0, 1.0), (20.0, 90.0, 1.6)]
)
def test_strong_waves_are_those_of_the_lattice_and_each_is_found_once(first, between, aspect):
    """A whole number of periods in each step, moved by the noise as the beams are."""
    beam = np.array([0.4, -0.3])
    uvw = moved(lattice(2, 0.06, first, between, aspect), 0.2 * PITCH, beam)
    steps, both = waves_of(first, between, aspect)
    found = np.array(strong_waves(uvw, 0.3))
    periods = found[:, :2] @ steps.T / (2.0 * np.pi)
    np.testing.assert_allclose(periods, np.rint(periods), atol=0.02)
    numbers = {tuple(number) for number in np.abs(np.rint(periods)).astype(int)}
    assert {(1, 0), (0, 1), (1, 1)} <= numbers
    np.testing.assert_allclose(found[:, 2], found[:, :2] @ beam, atol=0.02 * np.abs(both).max())
    for one, row in enumerate(found):
        for other in found[:one]:
            assert min(np.hypot(*(row + other)[:2]), np.hypot(*(row - other)[:2])) > 500.0
    some = nearest(uvw)
    power = np.abs(np.exp(1j * (some @ (found * [1.0, 1.0, -1.0]).T)).mean(axis=0)) ** 2
    assert np.all(power > 0.3)
    np.testing.assert_allclose(strong_waves(uvw, 0.3, most=2), found[:2])
    assert strong_waves(uvw, 1.01) == []


@pytest.mark.parametrize("noise", [0.3, 0.8, 1.2])
@pytest.mark.parametrize("angle", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("size", [0.3, 1.1])
def test_noise_larger_than_the_lines_distance_is_taken_back_along_the_beams(noise, angle, size):
    beam = size * np.array([np.cos(angle), np.sin(angle)])
    uvw = moved(lattice(3, 0.06), noise * PITCH, beam, 1)
    grid = grid_of(uvw)
    assert grid.beam == pytest.approx(beam, abs=0.02)
    for degrees in (7.0, 87.0):
        assert min(off_deg(direction, degrees) for direction in grid.directions) < 0.1


def test_lines_whose_points_jitter_are_found_while_their_wave_is_clear():
    for seed in range(4):
        uvw = moved(lattice(seed, 0.06, jitter=0.2), 1e-6, (0.0, 0.0))
        clear = np.exp(-((2.0 * np.pi * 0.2) ** 2))  # of |mean exp(i k x)|^2 of a normal jitter
        assert clear > 2.0 * CLEAR
        grid = grid_of(uvw)
        for degrees in (7.0, 87.0):
            assert min(off_deg(direction, degrees) for direction in grid.directions) < 3.0
    for seed in range(3):
        uvw = moved(lattice(seed, 0.06, jitter=0.4), 1e-6, (0.0, 0.0))
        assert grid_of(uvw) is None


def test_lines_of_one_kind_have_the_other_across():
    rng = np.random.default_rng(4)
    line = np.repeat(np.arange(-15.0, 16.0), 31) * PITCH
    along = rng.uniform(-0.03, 0.03, len(line))
    c, s = np.cos(0.3), np.sin(0.3)
    grid = grid_of(moved(np.column_stack([line, along]) @ [[c, s], [-s, c]], 1e-4, (0.2, 0.1)))
    assert grid is not None
    found = sorted(grid.directions, key=lambda one: off_deg(one, np.degrees(0.3) + 90.0))
    assert off_deg(found[0], np.degrees(0.3) + 90.0) < 0.2
    assert abs(found[0] @ found[1]) < 1e-9
    across = np.array([c, s])
    assert grid.beam @ across == pytest.approx([0.2, 0.1] @ across, abs=0.03)
    assert grid.beam @ [-s, c] == pytest.approx(0.0, abs=0.03)


def by_loops(uvw, extra, shape, directions, beam):
    """Cells of the points' places on the undisturbed grid: index, u, v, w, extra, count."""
    places = np.linalg.solve(directions.T, (uvw[:, :2] - uvw[:, 2:] * beam).T)
    reach = np.abs(places).max(axis=1)
    index = [
        np.minimum((at / (2.0 * most / n) + 0.5 * n).astype(int), n - 1)
        for at, most, n in zip(places, reach, shape, strict=True)
    ]
    found = {}
    for row, (one, two) in enumerate(zip(*index, strict=True)):
        found.setdefault((one, two), []).append(row)
    most = max(len(rows) for rows in found.values())
    return {
        key: (*uvw[rows].mean(axis=0), extra[rows].mean(), len(rows))
        for key, rows in found.items()
        if len(rows) > max(2.0, 0.2 * most)
    }


@pytest.mark.parametrize(("radius", "hole"), [(0.06, 0.0), (0.1, 0.05), (0.031, 0.0)])
def test_cells_along_both_kinds_of_lines_are_those_of_loops(radius, hole):
    """Disc, ring, and a small disc, whose cells are fewer and larger."""
    beam = np.array([0.3, -0.5])
    uvw = moved(lattice(5, radius, hole=hole), 1e-3, beam)
    uvw -= uvw.mean(axis=0)
    extra = np.arange(len(uvw)) % 7.0
    asked = []

    def blocks(work):
        asked.append(work)
        return whole(uvw, extra)(work)

    both = list(cells_along_lines(blocks))
    assert len(both) == 2
    narrow = min(NARROW, len(uvw) // (POINTS_A_CELL * LONG))
    assert narrow == NARROW or len(uvw) < NARROW * LONG * POINTS_A_CELL
    if hole:
        some = nearest(uvw)
        edge = some[np.argmin(np.hypot(*some[:, :2].T))] * [1.0, 1.0, 0.0]
        some = nearest(uvw - edge)
        some = some - some.mean(axis=0) * [1.0, 1.0, 0.0]
    else:
        some = nearest(uvw)
    grid = grid_of(some)
    assert grid.beam == pytest.approx(beam, abs=0.02)
    for cells, shape in zip(both, ((narrow, LONG), (LONG, narrow)), strict=True):
        wanted = by_loops(uvw, extra, shape, grid.directions, grid.beam)
        assert [tuple(index) for index in cells.index] == sorted(wanted, key=lambda key: key[::-1])
        for key, uv, mean, column, count in zip(
            cells.index, cells.uv_m, cells.mean_m, cells.extra[:, 0], cells.count, strict=True
        ):
            found = (*uv, mean, column, count)
            np.testing.assert_allclose(found, wanted[tuple(key)], rtol=1e-9, atol=1e-12)
        assert cells.sides_m[np.argmax(shape)] < cells.sides_m[np.argmin(shape)]


@pytest.mark.parametrize(("hole", "kept"), [(0.0, 0.2), (0.05, 0.2), (0.1, 1.0), (0.06, 0.15)])
def test_lines_of_thinned_scans_and_of_narrow_rings_are_found(hole, kept):
    """Few points lie on a line, or all that are near the middle are far from each other."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        uv = lattice(seed, 0.12, hole=hole)
        uvw = moved(uv[rng.random(len(uv)) < kept], 2e-4, (0.1, 0.2))
        uvw -= uvw.mean(axis=0)
        both = list(cells_along_lines(whole(uvw)))
        assert len(both) == 2


def test_cells_along_lines_are_those_of_enough_points_and_narrower_than_squares():
    least = LEAST_NARROW * LONG * POINTS_A_CELL
    uv = lattice(6, 0.06)
    order = np.argsort(np.hypot(*uv.T))
    for count, any_cells in ((least - 1, False), (least, True)):
        uvw = moved(uv[order[:count]], 1e-4, (0.0, 0.0))
        assert bool(list(cells_along_lines(whole(uvw)))) == any_cells
