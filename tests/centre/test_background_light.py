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
from wheelplane.centre.edge.beams import look_up

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
    light = np.exp(level)[part]
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
