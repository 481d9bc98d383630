"""The Monte Carlo check: an independent model agrees; a wrong formula is detected."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.support.given import components
from tests.uncertainty.test_propagation import WHEELS, car, values
from wheelplane.uncertainty.components import UncertaintyComponent
from wheelplane.uncertainty.monte_carlo import BLOCK, TOLERANCE, _ends, _moved, _status, monte_carlo
from wheelplane.uncertainty.monte_carlo_model import independent_quantities
from wheelplane.uncertainty.propagation import Effect, propagate


def drawn(targets, draws=30_000, seed=0, known=None):
    return monte_carlo(targets, WHEELS, known or propagate(targets, WHEELS), draws, seed)


@pytest.mark.parametrize("seed", range(4))
def test_without_uncertainty_it_gives_the_angles_themselves(seed):
    targets = [replace(t, components=()) for t in car(seed)]
    still = [
        replace(t, components=(UncertaintyComponent("none", np.zeros((6, 1))),)) for t in targets
    ]
    result = drawn(still, 20_000)
    np.testing.assert_allclose(result.mean, values(targets), rtol=0, atol=1e-14)
    assert result.status == "not-converged" or not result.standard.any()


SCENES = 50


@pytest.mark.slow
def test_formula_and_draws_agree_within_five_percent():
    worst = 0.0
    for seed in range(SCENES):
        targets = car(seed, 10 ** np.random.default_rng(seed).uniform(-5, -3.3))
        result = drawn(targets, 60_000, seed)
        worst = max(worst, float(np.abs(result.standard / result.formula - 1.0).max()))
    # Both are right to 1/sqrt(2 * 60,000) = 0.3 %; 4.5 of it over 1,200 quantities is 1.3 %.
    assert worst < 0.05
    assert worst < 4.8 / np.sqrt(2 * 60_000)


@pytest.mark.slow
def test_it_stops_when_the_ends_have_converged():
    result = drawn(car(1), 2_000_000)
    assert result.status == "agree"
    assert 5 * BLOCK < result.draws < 1_000_000
    assert np.all(result.end_difference <= result.tolerance)
    half = (result.high - result.low) / 2
    np.testing.assert_allclose(half, 1.96 * result.formula, rtol=2 * TOLERANCE / 1.96)
    assert drawn(car(1), 20_000).status == "not-converged"
    assert drawn(car(1), 20_000).draws == 2 * BLOCK


def test_the_same_seed_gives_the_same_draws_and_another_does_not():
    first, again, other = (drawn(car(2), 20_000, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.standard, again.standard)
    assert np.all(first.standard != other.standard)


@pytest.mark.parametrize("factor", [0.5, 1.1, 2.0])
def test_a_wrong_formula_is_detected(factor):
    targets = car(3)
    known = propagate(targets, WHEELS)
    wrong = replace(known, covariance=known.covariance * factor**2)
    assert drawn(targets, 1_000_000, known=wrong).status == "disagree"


def test_nonlinearity_is_detected():
    """Centres wrong by a tenth of the track: the frame's axes are not linear in them."""
    targets = car(4)
    wild = [
        replace(t, components=components(0.2**2 * np.eye(3), np.zeros((3, 3)))) for t in targets
    ]
    assert drawn(wild, 1_000_000).status == "disagree"


def few(targets, dof, pooled):
    return [
        replace(t, components=tuple(replace(c, dof=dof, pooled=pooled) for c in t.components))
        for t in targets
    ]


@pytest.mark.parametrize("dof", [3, 8])
def test_few_degrees_of_freedom_are_drawn_from_student(dof):
    """One estimate of all noise: every quantity is Student's t of its degrees of freedom."""
    targets = [replace(t, components=t.components[:1]) for t in few(car(6), dof, pooled=True)]
    known, draws = propagate(targets, WHEELS), 60_000
    angles = known.standard > 0.0  # lengths depend on the centres alone, which are exact here
    np.testing.assert_allclose(known.dof[angles], dof)
    result = drawn(targets, draws)
    k = stats.t.ppf(0.975, dof)
    spread = np.sqrt(0.025 * 0.975 / result.draws) / stats.t.pdf(k, dof)  # of an end, over u
    off = result.end_difference[angles] / result.formula[angles]
    assert np.all(off < 5.0 * spread)
    np.testing.assert_allclose(result.expanded[angles], k * result.formula[angles])
    # normal draws end 1.96 u from the value, far outside
    normal = drawn(few(targets, np.inf, pooled=True), draws, known=known)
    assert normal.status == "disagree"
    off = normal.end_difference[angles] / normal.formula[angles]
    assert np.all(off > 5.0 * spread)


def test_each_estimate_is_drawn_with_a_scale_of_its_own():
    """Squares of two estimates are independent; pooled, they rise and fall together."""
    pair = [Effect(name, np.eye(2)[:, [i]], 8.0, False) for i, name in enumerate("ab")]
    pooled = [replace(effect, name="a", pooled=True) for effect in pair]
    for effects, together in ((pair, False), (pooled, True)):
        moved = _moved(effects, 2, np.random.default_rng(1))
        assert moved.std(axis=0) == pytest.approx(np.sqrt(8.0 / 6.0), rel=0.05)
        alike = stats.spearmanr(*np.abs(moved.T)).statistic
        assert (alike > 0.05) == together
        assert alike > -4.5 / np.sqrt(BLOCK)
        assert together or alike < 4.5 / np.sqrt(BLOCK)


def test_shared_components_are_drawn_together():
    shift = np.vstack([np.zeros((3, 3)), 1e-3 * np.eye(3)])
    together = [
        replace(t, components=(UncertaintyComponent("shift", shift, shared="s"),)) for t in car(5)
    ]
    assert drawn(together, 20_000).standard.max() < 1e-12
    apart = [replace(t, components=(UncertaintyComponent("shift", shift),)) for t in together]
    assert drawn(apart, 20_000).standard.min() > 1e-6


def test_the_results_are_those_of_the_draws_where_nothing_is_linear():
    """Centres wrong by a tenth of the track with their normals: against draws made here."""
    rng, wild = np.random.default_rng(5), []
    for target in car(7):
        root = np.vstack([0.05 * np.eye(3), 0.15 * np.eye(3) + 0.05 * rng.normal(size=(3, 3))])
        wild.append(replace(target, components=(UncertaintyComponent("wild", root),)))
    found = drawn(wild, 20_000)
    normals = np.stack([target.normal for target in wild])
    centres = np.stack([target.centre_m for target in wild])
    moves = [rng.standard_normal((20_000, 3)) @ target.components[0].factor.T for target in wild]
    moved = np.stack(moves, axis=1)
    values = independent_quantities(normals + moved[..., :3], centres + moved[..., 3:], WHEELS)
    # Of two samples of 20,000: 5 standard deviations of a mean, a spread, and an end.
    u = values.std(axis=0)
    share = 5.0 * np.sqrt(2.0 / 20_000)
    assert np.all(np.abs(found.mean - values.mean(axis=0)) < share * u)
    np.testing.assert_allclose(found.standard, u, rtol=3.0 * share)
    for end, level in ((found.low, 0.025), (found.high, 0.975)):
        spread = np.quantile(
            values, level + np.array([[-5.0], [5.0]]) * np.sqrt(2 * 0.025 / 2e4), axis=0
        )
        assert np.all((spread[0] <= end) & (end <= spread[1]))
    base = independent_quantities(normals[None], centres[None], WHEELS)[0]
    assert np.any(np.abs(values.mean(axis=0) - base) > 3.0 * share * u)  # it is not linear
    ends = np.abs([found.low - base + found.expanded, found.high - base - found.expanded])
    np.testing.assert_allclose(found.end_difference, ends.max(axis=0), atol=1e-12)
    np.testing.assert_allclose(found.half, (found.high - found.low) / 2.0, rtol=1e-15)
    np.testing.assert_allclose(found.tolerance, 0.5 / 10.0 * found.formula, rtol=1e-15)


@pytest.mark.parametrize(("most", "draws"), [(1, 2), (29_999, 2), (30_000, 3), (39_999, 3)])
def test_as_many_whole_blocks_are_drawn_as_are_allowed_but_two(most, draws):
    assert drawn(car(2), most).draws == draws * BLOCK


@pytest.mark.parametrize("draws", [200, 1000])
def test_the_interval_leaves_out_as_many_on_either_side(draws):
    """JCGM 101, 7.7.2: q = 0.95 M between the ends, of order r = (M - q)/2 and r + q."""
    values = np.random.default_rng(1).permutation(np.arange(1.0, draws + 1.0))[:, None]
    assert _ends(values).ravel().tolist() == [0.025 * draws, 0.975 * draws]


def blocks(low, high, doubt):
    """Ends (B, 2, Q) of eight blocks, off the mean by doubt sqrt(8)/2 (one sigma) alternately."""
    signs = np.array([1.0, -1.0] * 4)[:, None, None] * math.sqrt(7 / 8)
    return np.array([low, high]) + signs * np.asarray(doubt) * math.sqrt(8) / 2.0


@pytest.mark.parametrize(
    ("low", "high", "doubt", "status"),
    [
        ([-1.0, -1.0], [1.0, 1.0], [0.0097, 0.0097], "agree"),
        ([-1.0, -1.0], [1.0, 1.0], [0.0097, 0.0103], "not-converged"),  # a fifth of the tolerance
        ([-1.0, -1.0], [1.0, 1.04], [0.0097, 0.0097], "agree"),
        ([-1.0, -1.055], [1.0, 1.0], [0.0097, 0.0097], "not-converged"),  # not beyond doubt
        ([-1.0, -1.0], [1.0, 1.065], [0.0097, 0.0097], "disagree"),
        ([-1.0, -0.935], [1.0, 1.0], [0.0097, 0.0097], "disagree"),
        ([-1.0, -1.0], [0.7, 1.0], [0.2, 0.001], "disagree"),
        ([-1.0, -1.0], [0.7, 1.0], [0.3, 0.001], "not-converged"),
    ],
)
def test_ends_agree_within_the_tolerance_beyond_two_sigma(low, high, doubt, status):
    half = np.ones(2)
    assert _status(blocks(low, high, doubt), half, 0.05 * half) == status


def test_both_ends_count_and_the_larger_doubt_of_the_two():
    one_end = (
        np.array([[[-1.0], [1.2]]] * 8)
        + np.array([0.3, 0.0])[:, None] * (np.array([1.0, -1.0] * 4)[:, None, None])
    )
    assert _status(one_end, np.ones(1), np.array([0.05])) == "not-converged"
