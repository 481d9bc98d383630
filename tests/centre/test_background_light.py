"""Backgrounds of unlike brightness behind mixed pixels, as their intensities show them."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from tests.centre.test_edge_intensity import fitted, relative
from tests.centre.test_edge_rows import DISC as OUTLINE
from tests.centre.test_edge_rows import scene, state_of
from tests.support.parted_returns import PartedDisc
from wheelplane.centre.edge.beams import CHAMFER, RATIO, WALL, look_up
from wheelplane.centre.edge.edge_residuals import Zones, equations

DISC = PartedDisc(returned="mean", parts=9, spacing_m=0.0013, spot_m=0.0025, noise_m=2e-4)
SEEDS = range(3)


@functools.cache
def scanned(setup, seed):
    return setup.scan(seed)


def located(setup, seed, law=lambda power: power, lit=True):
    """Fit to one scan; law: what the scanner reports of a return's power; lit: of all points."""
    points, power = scanned(setup, seed)
    light = relative(setup, points, law(power))
    of_target = np.where(np.abs(points[:, 2]) < 3.0 * setup.noise_m, light, np.nan)
    return fitted(setup, np.column_stack([points, of_target, *([light] if lit else [])]))


@functools.cache
def errors(setup, law, lit):
    """Rms error of a centre (m), and mean square of the errors by their covariance."""
    found = [located(setup, seed, law, lit) for seed in SEEDS]
    off = np.array([fit.centre_m - setup.centre_m for fit in found])
    squares = [
        o @ np.linalg.solve(fit.covariance_m2, o) / 2.0 for o, fit in zip(off, found, strict=True)
    ]
    return float(np.sqrt(np.mean(off**2))), float(np.mean(squares))


def as_it_is(power):
    return power


def amplitude(power):
    return np.sqrt(power)


@pytest.mark.slow
@pytest.mark.parametrize("law", [as_it_is, amplitude])
def test_intensities_show_how_bright_each_part_of_the_background_is(law):
    """Bright parts return 7.5 times the power of dark ones; their mean depths differ by as much."""
    blind_m, _ = errors(DISC, as_it_is, False)
    error_m, square = errors(DISC, law, True)
    assert error_m < 0.035e-3 < 0.4 * blind_m
    assert square < 2.0


@pytest.mark.slow
def test_a_scanner_that_does_not_weigh_by_power_is_not_taken_for_one_that_does():
    """Ranges that are means over the footprint alone keep every digit without intensities."""
    setup = replace(DISC, returned="unweighted")
    for seed in SEEDS:
        lit, blind = (located(setup, seed, lit=on) for on in (True, False))
        np.testing.assert_array_equal(lit.state, blind.state)
        np.testing.assert_array_equal(lit.covariance_m2, blind.covariance_m2)


@pytest.mark.slow
def test_the_unit_of_intensities_does_not_matter():
    one, other = (located(DISC, 1, law) for law in (as_it_is, lambda power: 256.0 * power))
    np.testing.assert_allclose(one.centre_m, other.centre_m, atol=1e-12)


def test_light_is_the_median_of_each_sector_over_that_of_the_middle_one():
    state = state_of()
    problem = scene(OUTLINE, state, 40_000)
    beams, depth = problem.beams(state), problem.depth
    dark = look_up(beams, depth, state)
    assert dark.log_light is None
    np.testing.assert_array_equal(dark.lighter(np.arange(3)), np.zeros(3))
    count, part = len(dark.usable), dark.sector(beams)
    level = np.linspace(-1.0, 1.0, count)
    light = np.where(beams.x_m > 0.0, np.exp(level)[part], 1.0)
    light[np.arange(len(light)) % 7 == 0] *= 50.0  # strays
    light[part == 3] = np.nan
    light[part == 4] = -1.0
    light[part == 5] = np.inf
    found = look_up(beams, depth, state, light)
    np.testing.assert_array_equal(found.usable, dark.usable)
    unknown = np.isin(np.arange(count), [3, 4, 5])
    known = dark.usable & ~unknown
    assert np.count_nonzero(known) > 70
    expected = np.where(known, level - np.median(level[known]), 0.0)
    np.testing.assert_allclose(found.log_light, expected, atol=1e-12)
    np.testing.assert_array_equal(found.lighter(part), found.log_light[part])


HALF = replace(DISC, parts=0, side_rad=0.7, bright=0.5, dark=0.5, printed=0.12, speckle=0.02)


def beside_print(setup, seed, lit):
    """Fit to one scan of a face that is not of one brightness."""
    points, power = scanned(setup, seed)
    light = [np.full(len(points), np.nan), power] if lit else []
    return fitted(setup, np.column_stack([points, *light]), chamfer_m=0.0)


@pytest.mark.slow
def test_beside_a_dark_half_of_the_face_all_else_is_brighter():
    """Wall and background return 8 times as much beside it: the edge seems to lie farther in."""
    error_m = {}
    for lit in (False, True):
        off = [beside_print(HALF, seed, lit).centre_m - HALF.centre_m for seed in SEEDS]
        error_m[lit] = float(np.sqrt(np.mean(np.square(off))))
    assert error_m[True] < 0.03e-3 < 0.25 * error_m[False]


@pytest.mark.slow
def test_a_print_moves_no_ranges_that_brightness_does_not_weigh():
    setup = replace(HALF, returned="unweighted")
    for seed in SEEDS:
        lit, blind = (beside_print(setup, seed, on) for on in (True, False))
        np.testing.assert_array_equal(lit.state, blind.state)


def lit_scene(face):
    """Problem whose light is 0.5 behind the edge, and face(share) on it (N,); and its state."""
    state = state_of()
    problem = scene(OUTLINE, state, 40_000)
    beams = problem.beams(state)
    light = np.where(beams.x_m > 0.0, 0.5, face(beams.share))
    return replace(problem, light=light, gamma=0.7), state


def test_the_face_is_as_bright_as_its_bright_sectors_but_where_it_is_printed():
    problem, state = lit_scene(lambda share: np.where(share < 0.5, 0.2, 3.0))
    found = problem.background(state)
    middle = (np.arange(len(found.usable)) + 0.5) / len(found.usable)
    np.testing.assert_allclose(
        found.log_face, np.where(middle < 0.5, np.log(0.2 / 3.0), 0.0), atol=1e-12
    )
    part = np.arange(len(found.usable))
    np.testing.assert_array_equal(found.lighter(part), found.log_light - found.log_face)


def test_a_face_whose_intensities_only_scatter_is_even():
    rng = np.random.default_rng(0)
    problem, state = lit_scene(lambda share: np.exp(0.3 * rng.normal(size=len(share))))
    assert problem.background(state).log_face is None


def test_slopes_beside_a_print_are_derivatives_of_the_residuals():
    problem, state = lit_scene(lambda share: np.where(share < 0.5, 0.2, 1.0))
    state[WALL], state[CHAMFER] = 0.3, 4e-4
    problem = replace(problem, prior=problem.prior.bevelled())
    background = problem.background(state)

    def linear(state):
        return equations(problem, background, state, Zones.alike(), False, True)

    here = linear(state)
    for which in (RATIO, WALL):
        step = np.zeros(len(state))
        step[which] = 1e-5
        change = linear(state - step).residual_m - linear(state + step).residual_m
        expected, found = change / 2e-5, here.slopes[:, which]
        np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(found).max())
