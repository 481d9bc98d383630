"""Mixed pixels of phase-shift scanners, whose modulations add as vectors.

The scenes' rays are summed as complex numbers: nothing of the estimator's is used.
"""

from functools import lru_cache

import numpy as np
import pytest
from scipy import stats

from tests.support.plates import CENTRE, found
from tests.support.scenes import Setup, make
from wheelplane.centre.edge.mixed_pixel import edge_profile, mean_of, sum_of_phases
from wheelplane.config import CentreConfig
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")
SEEDS = 8
MODULATIONS = [0.011, 27.0, 110.0, 400.0]
STATED = CentreConfig(ambiguity_m=0.6)
OF_MEANS = CentreConfig(ambiguity_m=0.0)


def two_ranges(count=2000):
    """Shares of the farther one, nearer and farther ranges."""
    rng = np.random.default_rng(1)
    near_m, far_m = rng.uniform(0.0, 0.005, count), rng.uniform(0.05, 0.28, count)
    return rng.uniform(0.0, 1.0, count), near_m, far_m


@pytest.mark.parametrize("modulation", MODULATIONS)
def test_vectors_add_as_complex_numbers(modulation):
    """The argument of less than half a turn needs no longer modulation."""
    share, near_m, far_m = two_ranges()
    wave = np.sqrt(modulation)
    vector = (1.0 - share) * np.exp(1j * wave * near_m) + share * np.exp(1j * wave * far_m)
    measured = sum_of_phases(share, near_m, far_m, modulation)
    clear = wave * (far_m - near_m) < 3.0
    assert clear.any()
    np.testing.assert_allclose(measured.range_m[clear], np.angle(vector[clear]) / wave, atol=1e-12)


@pytest.mark.parametrize("modulation", [-15.0, 0.0, 0.005, *MODULATIONS])
def test_derivatives_are_those_of_central_differences(modulation):
    share, near_m, far_m = two_ranges()
    measured = sum_of_phases(share, near_m, far_m, modulation)

    def change(**off):
        at = [share, near_m, far_m, modulation]
        ahead, behind = (
            sum_of_phases(*(v + s * off.get(n, 0.0) for n, v in zip(names, at, strict=True)))
            for s in (1.0, -1.0)
        )
        return (ahead.range_m - behind.range_m) / (2.0 * sum(off.values()))

    names = ("share", "near", "far", "modulation")
    jumps = np.sqrt(max(modulation, 0.0)) * (far_m - near_m) > 3.0  # where vectors nearly cancel
    for shown, off in (
        (measured.by_share, {"share": 1e-6}),
        (measured.by_near * (1.0 - share), {"near": 1e-6}),
        (measured.by_far, {"far": 1e-6}),
        (measured.by_modulation, {"modulation": 1e-4}),
    ):
        seen = change(**off)
        limit = 1e-5 * np.abs(seen[~jumps]).max()
        np.testing.assert_allclose(np.asarray(shown)[~jumps], seen[~jumps], atol=limit)


def test_long_wavelengths_give_the_mean():
    share, near_m, far_m = two_ranges()
    mean, slow = mean_of(share, near_m, far_m), sum_of_phases(share, near_m, far_m, 1e-6)
    for name in ("range_m", "by_share", "by_far", "by_near"):
        np.testing.assert_allclose(getattr(slow, name), getattr(mean, name), atol=1e-8)


def test_third_cumulants_join_the_sum():
    """Both sides of the least modulation that is summed: 0.2 % of what it changes."""
    ends = [sum_of_phases(*two_ranges(), at).range_m for at in (0.00999999, 0.01000001)]
    np.testing.assert_allclose(*ends, atol=2e-8)


def test_a_profile_without_modulation_is_the_mean():
    x_m = np.linspace(-0.003, 0.004, 200)
    rest = 0.2 * np.ones(200), 0.08 * np.ones(200), 0.0015 * np.ones(200), 0.01, 0.6, 0.8
    plain, slow = edge_profile(x_m, *rest), edge_profile(x_m, *rest, modulation=0.0)
    for name, values in vars(plain).items():
        if name != "d_modulation":
            np.testing.assert_array_equal(getattr(slow, name), values, err_msg=name)


@lru_cache
def results(ambiguity_m, background_m, config=CENTRE, noise_m=2e-4):
    setups = [
        Setup(
            ambiguity_m=ambiguity_m,
            background_m=background_m,
            background_tilt_deg=12.0,
            noise_m=noise_m,
            azimuth_deg=37.0 * seed,
            incidence_deg=20.0,
        )
        for seed in range(SEEDS)
    ]
    return [found(make(setup, seed), DISC, seed, config) for seed, setup in enumerate(setups)]


@pytest.mark.parametrize(("ambiguity_m", "background_m"), [(0.6, 0.12), (1.2, 0.2), (0.0, 0.2)])
def test_a_modulation_is_found_and_moves_no_centre(ambiguity_m, background_m):
    modulation = (2.0 * np.pi / ambiguity_m) ** 2 if ambiguity_m else 0.0
    shown = results(ambiguity_m, background_m)
    assert np.mean([one.nees for one in shown]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert np.median([one.u_m for one in shown]) < 4e-5
    for one in shown:
        edge = one.fitted.edge_fit
        assert edge.modulation >= 0.0
        assert abs(edge.modulation - modulation) < 4.0 * edge.modulation_u + 0.1 * modulation


def test_as_means_they_would_move_it():
    """Without the phases, on which the law above rests, centres lie beyond their uncertainty."""
    off = [one.nees for one in results(0.6, 0.12, OF_MEANS)]
    assert np.mean(off) > 2.0 * stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert all(one.fitted.edge_fit.modulation < 1e-9 for one in results(0.6, 0.12, OF_MEANS))


def test_a_stated_modulation_is_used():
    for one in results(0.6, 0.12, STATED, noise_m=8e-4):
        edge = one.fitted.edge_fit
        assert edge.modulation == pytest.approx((2.0 * np.pi / 0.6) ** 2, rel=0.3)
        assert one.nees < stats.chi2.isf(1e-4, 2)
