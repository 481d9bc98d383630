"""The Monte Carlo check: an independent model agrees; a wrong formula is detected."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.support.given import components
from tests.uncertainty.test_propagation import WHEELS, car, values
from wheelplane.uncertainty.components import UncertaintyComponent
from wheelplane.uncertainty.monte_carlo import BLOCK, TOLERANCE, _moved, monte_carlo
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
