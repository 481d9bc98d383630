"""A stated thickness: when an edge's fit doubts it, and when the data contradict it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.centre.test_edge_iterations import BEHIND_M, RECORD, ended, problem_of
from tests.centre.test_edge_rows import state_of
from wheelplane.centre.edge import mixed_fit
from wheelplane.centre.edge.beams import (
    BEAM,
    GROWTH,
    RATIO,
    SHAPE,
    SPOT,
    STATED_THICKNESS,
    THICKNESS,
    WALL,
    Prior,
)
from wheelplane.centre.edge.mixed_fit import CONTRADICTED_THICKNESS, TENSE, THICKNESS_MODEL
from wheelplane.config import CentreConfig

CONFIG, THICK_M = CentreConfig(), 0.01
FITTED = replace(RECORD, centre_m=np.array([1e-4, 2e-4]))


def free(thickness_m=THICK_M, slope=0.3, spot_m=0.0015, u=1e-6, converged=True):
    """A fit without the stated thickness, of beams that run in by that slope."""
    return replace(
        RECORD,
        thickness_m=thickness_m,
        beam=slope * np.array([0.6, -0.8]),
        spot_m=spot_m,
        thickness_u=u,
        converged=converged,
        centre_m=np.array([4e-4, 0.0]),
    )


def contradicts(fit, stated_m, worse=False):
    """Whether the fit without the stated thickness is taken; the other notes what that moves."""
    found = mixed_fit._by_thickness(FITTED, fit, stated_m, worse)
    if found.stated_thickness_m is None:
        np.testing.assert_allclose(found.by_thickness_m, [3e-4, -2e-4])
        assert replace(found, by_thickness_m=None) == FITTED
        return False
    assert replace(found, stated_thickness_m=None) == fit
    assert found.stated_thickness_m == stated_m
    return True


def uncertainty(footprints, u=1e-6):
    """Relative u of a thickness by the data, the footprint so many walls' widths as seen.

    By the largest one that is not contradicted, which is stated thinner.
    """
    slope = 0.3
    fit = free(slope=slope, spot_m=footprints * slope * THICK_M, u=u)
    low, high = 0.0, 50.0
    for _ in range(60):
        off = (low + high) / 2.0
        low, high = (low, off) if contradicts(fit, THICK_M * math.exp(-off)) else (off, high)
    return low / CONTRADICTED_THICKNESS


def test_thin_and_thick_are_contradicted_by_as_many_standard_deviations():
    assert uncertainty(0.0) == pytest.approx(math.hypot(STATED_THICKNESS, THICKNESS_MODEL))
    three = math.hypot(STATED_THICKNESS, THICKNESS_MODEL, 0.2)
    assert uncertainty(0.0, u=0.2) == pytest.approx(three)
    fit = free(spot_m=1e-9, u=0.2)
    for sign in (-1.0, 1.0):
        within, beyond = (
            THICK_M * math.exp(sign * k * CONTRADICTED_THICKNESS * three) for k in (0.99, 1.01)
        )
        assert not contradicts(fit, within)
        assert contradicts(fit, beyond)


def test_the_model_s_share_grows_with_the_square_of_footprint_over_wall():
    """As many widths of a wall that is seen under an angle, from next to nothing on."""
    shares = [math.sqrt(uncertainty(k) ** 2 - STATED_THICKNESS**2) for k in (0.0, 1.0, 2.0, 3.0)]
    np.testing.assert_allclose(np.diff(shares, 3), 0.0, atol=1e-6)
    assert shares[1] - shares[0] == pytest.approx((shares[2] - shares[0]) / 4.0)
    assert shares[1] > 3.0 * shares[0]


@pytest.mark.parametrize(("slope", "shown"), [(0.3, True), (0.01, False), (0.0, False)])
def test_a_wall_that_beams_run_along_shows_no_thickness(slope, shown):
    assert contradicts(free(slope=slope), THICK_M / 2.0) == shown


def test_a_foil_is_no_plate_and_a_plate_no_foil():
    """The thicker of both is the wall that would be seen."""
    assert contradicts(free(THICK_M), 1e-4)
    assert contradicts(free(1e-4), THICK_M)


def test_a_fit_that_did_not_converge_contradicts_nothing():
    for stated_m in (THICK_M, 0.1 * THICK_M):
        assert not contradicts(free(converged=False), stated_m)


PRIOR = Prior.of(THICK_M, CONFIG)
SIGMA = PRIOR.weight**-0.5


def tension(off, noise):
    """Tension of an edge whose data lie off the prior by so many standard deviations of both.

    off, noise: of some parameters, by their index; noise in standard deviations of the prior, 0 of
    data that show a parameter exactly. The fit is the mean weighted by the inverse variances.
    """
    state, u = PRIOR.mean.copy(), dict.fromkeys((THICKNESS, GROWTH), 0.0)
    for k, count in off.items():
        data = PRIOR.mean[k] + count * SIGMA[k] * math.hypot(1.0, noise[k])
        weight = noise[k] ** 2
        state[k] = (data + weight * PRIOR.mean[k]) / (1.0 + weight)
        u[k] = SIGMA[k] * noise[k] / math.hypot(1.0, noise[k])
    fitted = SimpleNamespace(state=state, thickness_u=u[THICKNESS], growth_u_m=u[GROWTH])
    return mixed_fit._tension(fitted, PRIOR)


def test_a_tension_of_one_is_data_one_standard_deviation_off():
    for noise in (0.0, 0.5, 2.0):
        for k in (THICKNESS, GROWTH):
            assert tension({k: -1.0}, {k: noise}) == pytest.approx(1.0)
        both = tension({THICKNESS: 3.0, GROWTH: 4.0}, {THICKNESS: noise, GROWTH: 1.0})
        assert both == pytest.approx(5.0)
    for k in (SPOT, RATIO, WALL, SHAPE):
        assert tension({k: 1.5}, {k: 0.0}) == pytest.approx(1.5)
    assert tension({0: 3.0, 2: 1.0}, {0: 0.0, 2: 0.0}) == 0.0  # no matter of the edge
    assert tension({GROWTH: 1.0}, {GROWTH: 1e6}) < 1e-4  # data that show nothing


@pytest.mark.parametrize("few", [False, True])
@pytest.mark.parametrize("off", [0.9 * TENSE, 1.1 * TENSE])
def test_a_thickness_is_doubted_where_few_points_or_the_prior_may_hide_a_wrong_one(
    monkeypatch, few, off
):
    priors, state = [], state_of()
    state[BEAM] = 0.0, 0.3

    def best(problem, state, most):
        priors.append(problem.prior)
        return problem, ended(state=state)

    def again(problem, found, most):
        assert few
        return best(problem, found.state, most)[1]

    monkeypatch.setattr(mixed_fit, "_best", best)
    monkeypatch.setattr(mixed_fit, "_again", again)
    monkeypatch.setattr(mixed_fit, "_freed", lambda problem, found, _: (problem, found))
    monkeypatch.setattr(mixed_fit, "_as_ellipse", lambda *_: None)
    monkeypatch.setattr(mixed_fit, "_with_curves", lambda fitted, *_: fitted)
    monkeypatch.setattr(mixed_fit, "pointing_m", lambda problem, *_: problem.pointing_m)
    monkeypatch.setattr(mixed_fit, "_tension", lambda *args: off)
    monkeypatch.setattr(mixed_fit, "record", lambda *args: RECORD)
    monkeypatch.setattr(mixed_fit, "settled", lambda fitted, found: fitted)
    problem = problem_of(few)
    found = mixed_fit.fit_mixed(problem, state, THICK_M, CONFIG)
    doubted = few or off > TENSE
    weights = [problem.prior.weight, problem.prior.doubted().weight]
    np.testing.assert_array_equal([one.weight for one in priors], weights[: 1 + doubted])
    assert (replace(found, thickness_pull=None) == RECORD) != doubted


def test_another_minimum_that_explains_less_contradicts_nothing():
    assert contradicts(free(3.0 * THICK_M), THICK_M)
    assert not contradicts(free(3.0 * THICK_M), THICK_M, worse=True)


@pytest.mark.parametrize(
    ("left", "off", "taken"),
    [(0.0, 2.2, "free"), (8.9, 2.2, "free"), (9.1, 2.2, "stated"), (9.1, 6.1, "in doubt")],
)
def test_a_thickness_that_explains_less_contradicts_no_stated_one(monkeypatch, left, off, taken):
    """Whatever it is: rectangles of 10 mm once ended at 27 and 110 mm, 0.3 mm off.

    It does count where the stated one is far off, too.
    """
    state = state_of()
    state[BEAM] = 0.0, 0.3
    solutions = [ended(state=state), ended(state=state)]
    solutions[1].equations.residual_m[0] = math.sqrt(left)
    remaining = iter(solutions)
    monkeypatch.setattr(mixed_fit, "_best", lambda problem, *args: (problem, next(remaining)))
    monkeypatch.setattr(mixed_fit, "_freed", lambda problem, found, _: (problem, found))
    monkeypatch.setattr(mixed_fit, "_as_ellipse", lambda *_: None)
    monkeypatch.setattr(mixed_fit, "_with_curves", lambda fitted, *_: fitted)
    monkeypatch.setattr(mixed_fit, "pointing_m", lambda problem, *_: problem.pointing_m)
    monkeypatch.setattr(mixed_fit, "_tension", lambda *args: off)
    fits = iter((FITTED, free(3.0 * THICK_M)))
    monkeypatch.setattr(mixed_fit, "record", lambda *args: next(fits))
    found = mixed_fit.fit_mixed(problem_of(), state, THICK_M, CONFIG)
    assert (found.stated_thickness_m == THICK_M) == (taken == "free")
    plain = found.centre_m is FITTED.centre_m and found.by_thickness_m is None
    assert plain == (taken == "stated")
    assert (found.by_thickness_m is not None) == (taken == "in doubt")


@pytest.mark.parametrize(
    ("wall", "nearest", "again"), [(0.99, 9, 0), (1.01, 9, 1), (1.01, 0, 0), (1.01, None, 0)]
)
def test_a_wall_as_deep_as_what_lies_beyond_it_is_none(monkeypatch, wall, nearest, again):
    """There the thickness is sought from the stated one on: a ring was "0.89 mm inside" at 172 mm.

    As deep as the nearest of it, but for a tenth of the edge; None: nothing is seen of it.
    """
    stated, free = state_of(), state_of()
    stated[BEAM] = free[BEAM] = 0.0, 0.3
    free[THICKNESS] = math.log(wall * BEHIND_M)
    solutions = [ended(state=stated), ended(state=free)]
    solutions[1].background.depth_m[: 9 - (nearest or 0)] *= 2.0
    solutions[1].background.usable[:] = nearest is not None
    remaining, starts = iter(solutions), []
    monkeypatch.setattr(mixed_fit, "_best", lambda problem, *args: (problem, next(remaining)))
    monkeypatch.setattr(mixed_fit, "_again", lambda *args: starts.append(args) or solutions[0])
    monkeypatch.setattr(mixed_fit, "_freed", lambda problem, found, _: (problem, found))
    monkeypatch.setattr(mixed_fit, "_as_ellipse", lambda *_: None)
    monkeypatch.setattr(mixed_fit, "_with_curves", lambda fitted, *_: fitted)
    shares = []
    monkeypatch.setattr(mixed_fit, "_as_if_sharp", lambda _, one: shares.append(one) or one)
    monkeypatch.setattr(mixed_fit, "pointing_m", lambda problem, *_: problem.pointing_m)
    monkeypatch.setattr(mixed_fit, "_tension", lambda *args: 2.2)
    monkeypatch.setattr(mixed_fit, "record", lambda *args: RECORD)
    problem = problem_of()
    mixed_fit.fit_mixed(problem, stated, THICK_M, CONFIG)
    assert len(starts) == len(shares) == again  # with what its unstated chamfer may move
    for doubted, solution, _ in starts:
        np.testing.assert_array_equal(doubted.prior.weight, problem.prior.doubted().weight)
        assert solution is solutions[0]
