"""Course of an edge fit with equations and steps put in: looks, damping, ends, what is tried."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.centre.test_edge_rows import DISC, PLATE, SIGMA_M, scene, state_of
from wheelplane.centre.edge import clean_fit, mixed_fit, solution
from wheelplane.centre.edge.beams import (
    BEAM,
    CENTRE,
    GROWTH,
    HELD_SIZE_M,
    INVERSE,
    RATIO,
    ROTATION,
    SIZE_M,
    STATE,
    WALL,
    WRONG_SIZE_M,
    Prior,
)
from wheelplane.centre.edge.clean_fit import ALONE, AS_NEAR, CONTRADICTED, LEAST_CLEAN, UNDAMPED
from wheelplane.centre.edge.edge_residuals import (
    ALIKE_LOG,
    GAMMA_SIGMA,
    SECTORS,
    UNEVEN_SECTORS,
    ZONE_LOG,
    EdgeProblem,
    Zones,
    _inverse,
    equations,
    spread,
)
from wheelplane.centre.edge.fit_edge import EdgeToFit, aimed, fit_edge
from wheelplane.centre.edge.mixed_fit import (
    BY_ZONES,
    DIFFERENT,
    LEAST,
    LOOKS,
    MOST_ROUGH,
    MOST_UNEVEN,
    MOVED_M,
    NOTICED_GROWTH_M,
    OTHER_SIZE_M,
    ROUGH_M,
    SHORTER,
    SHORTEST,
    STEEP,
    STEEPEST,
    SURELY,
)
from wheelplane.centre.edge.solution import AS_MUCH, BY_CHANCE, STEP_M, Solution
from wheelplane.config import CentreConfig
from wheelplane.vectors import turned

CONFIG, BEHIND_M = CentreConfig(), 0.1
NONE_UNEVEN = np.zeros(UNEVEN_SECTORS, bool)


def put_in(monkeypatch, moves):
    """Steps of the centre along u in their order, the last again and again; what was called."""
    called = SimpleNamespace(flags=[], looks=[], newton=[], ahead=[], compared=[])

    def move(linear, state, prior, newton=False, ahead=None):
        called.newton.append(newton)
        called.ahead.append(ahead)
        moved = np.zeros(STATE)
        moved[0] = moves[min(len(called.flags), len(moves)) - 1]
        return moved, Zones.alike()

    def linear(*args, **kwargs):
        called.flags.append(args[-2:] if len(args) > 5 else args[2:])

    def look(*args):
        called.looks.append(len(called.flags) + 1)

    for module in (mixed_fit, clean_fit):
        monkeypatch.setattr(module, "step", move)

    def compared(*args):
        called.compared.append(len(called.flags) + 1)

    monkeypatch.setattr(EdgeProblem, "background", look)
    monkeypatch.setattr(EdgeProblem, "compared", compared)
    monkeypatch.setattr(mixed_fit, "equations", linear)
    monkeypatch.setattr(clean_fit, "clean_equations", lambda *a: called.flags.append(a[2:]) or ZERO)
    return called


ZERO = SimpleNamespace(zones=None)


def problem_of(few=False):
    problem = scene(DISC, state_of(), 50)
    return EdgeProblem(problem.plane, problem.depth, problem.prior, DISC, SIGMA_M, few)


@pytest.mark.parametrize("few", [False, True])
def test_a_first_fit_looks_up_the_background_again_and_takes_nine_steps(monkeypatch, few):
    called = put_in(monkeypatch, [0.5 * ROUGH_M])
    found = mixed_fit._converge(problem_of(few), state_of(), Zones.alike(), 40, consistent=False)
    assert called.looks == [1, *LOOKS]
    assert found.iterations == len(called.flags) == 9
    robust = [flags[0] for flags in called.flags]
    assert robust == called.newton == [not few and iteration > 6 for iteration in range(1, 10)]
    assert not any(flags[1] for flags in called.flags)
    assert found.state[0] == pytest.approx(state_of()[0] + 9 * 0.5 * ROUGH_M, abs=1e-15)
    assert found.last_m == pytest.approx(0.5 * ROUGH_M)


@pytest.mark.parametrize("few", [False, True])
def test_a_consistent_fit_ends_with_its_first_small_step(monkeypatch, few):
    called = put_in(monkeypatch, [1e-4, 1e-5, 1e-6, 0.5 * STEP_M, 1.0])
    found = mixed_fit._converge(problem_of(few), state_of(), Zones.alike(), 40, consistent=True)
    assert called.looks == [1]
    assert found.iterations == 4
    assert all(flags == (not few, True) for flags in called.flags)
    assert called.newton == [not few] * 4
    assert called.ahead == [True] * 4
    assert called.compared == ([2, 3, 4] if few else [])  # few points follow the edge
    sought = state_of()[0] + 1.11e-4 + 0.5 * STEP_M
    assert found.state[0] == pytest.approx(sought, abs=1e-12)


def test_steps_that_go_back_are_shortened_to_a_least(monkeypatch):
    moves = [1e-4, -1e-4, -1e-4] + [1e-4 * (-1) ** k for k in range(20)]
    lengths, before = [1.0], moves[0]
    for move in moves[1:]:
        back = move * before < 0.0
        lengths.append(max(lengths[-1] * SHORTER, SHORTEST) if back else lengths[-1])
        before = move
    for consistent, expected in ((True, lengths), (False, np.ones(MOST_ROUGH))):
        put_in(monkeypatch, moves)
        args = problem_of(), state_of(), Zones.alike(), len(moves)
        found = mixed_fit._converge(*args, consistent=consistent)
        assert found.iterations == len(expected)  # a first fit ends sooner
        sought = state_of()[0] + np.dot(expected, moves[: len(expected)])
        assert found.state[0] == pytest.approx(sought, abs=1e-12)
    assert min(lengths) == SHORTEST


def test_a_clean_fit_is_rough_at_first_robust_later_and_damped_then(monkeypatch):
    called = put_in(monkeypatch, [-1e-4] * 14 + [-0.5 * STEP_M])
    found = clean_fit._converge_clean(problem_of(), state_of(), 40, True, by_background=False)
    flags = [(k > 9, k <= 6, True, False) for k in range(1, found.iterations + 1)]
    assert called.flags == flags
    moved = sum(1e-4 * min(1.0, UNDAMPED / k) for k in range(1, 15))
    assert found.state[0] == pytest.approx(state_of()[0] - moved, abs=2.0 * STEP_M)
    assert found.iterations == 15
    put_in(monkeypatch, [0.5 * STEP_M])
    found = clean_fit._converge_clean(problem_of(), state_of(), 40, True, by_background=True)
    assert found.iterations == UNDAMPED + 1
    put_in(monkeypatch, [1e-3])
    found = clean_fit._converge_clean(problem_of(), state_of(), 13, True, by_background=True)
    assert found.iterations == 13
    assert found.last_m == pytest.approx(1e-3 * UNDAMPED / 13)


@pytest.mark.parametrize(("most", "first"), [(40, 7), (4, 4)])
def test_a_clean_fit_that_begins_near_its_solution_has_no_rough_steps(monkeypatch, most, first):
    called = put_in(monkeypatch, [1e-3] * 5 + [0.5 * STEP_M])
    clean_fit._converge_clean(problem_of(), state_of(), most, True, True, near=True)
    last = min(most, first + 5)
    assert called.flags == [(k > 9, k <= 6, True, True) for k in range(first, last + 1)]


def recorded(last_m=1e-8, few=False):
    """Record of a solution, with its equations and the problem."""
    state = state_of()
    problem = scene(PLATE, state, 4000)
    problem = EdgeProblem(problem.plane, problem.depth, problem.prior, PLATE, SIGMA_M, few)
    background = problem.background(state)
    linear = equations(problem, background, state, Zones.alike(), True, True)
    found = Solution(state, Zones.alike(), background, linear, 7, last_m)
    return solution.record(found, problem, 0.8), linear, problem


RECORD = recorded()[0]


def ended(weight=(1.0,) * 40, behind=0, share=None, depths=0, ratio=0.0, state=None):
    """A solution with equations of those weights."""
    state = state_of() if state is None else state.copy()
    state[RATIO] = ratio
    share = np.arange(len(weight)) / len(weight) if share is None else share
    linear = SimpleNamespace(
        weight=np.array(weight), behind=behind, share=share, depths=depths,
        residual_m=np.zeros(len(weight)), rows=None,
    )  # fmt: skip
    behind = SimpleNamespace(usable=np.ones(9, dtype=bool), depth_m=np.full(9, BEHIND_M))
    return Solution(state, Zones.alike(), behind, linear, 12, 1e-8)


@pytest.mark.parametrize(
    ("front", "back", "taken"),
    [
        ([0.0] * 60, [], "with"),
        ([1.0] * 60, [0.0], "alone"),
        ([0.0] * 60, [0.3] * 20, "with"),
        ([1.0] * 60, [0.0] * 6 + [0.2] * 14, "with"),
        ([1.0] * 60, [0.0] * 8 + [0.2] * 12, "alone"),
    ],
)
def test_a_background_of_outliers_is_left_out(monkeypatch, front, back, taken):
    assert 6 / 20 < CONTRADICTED < 8 / 20
    calls, solution = [], ended(front + back, len(back))
    alone = ended(front)
    contradicted = len(back) > 0 and back.count(0.0) > CONTRADICTED * len(back)

    def converge(problem, state, most, by_power, by_background, near=False):
        assert near == (not by_background and not contradicted)
        calls.append((state is solution.state, by_background))
        return solution if by_background else alone

    monkeypatch.setattr(clean_fit, "_converge_clean", converge)
    monkeypatch.setattr(clean_fit, "spread", lambda *args: (np.eye(STATE),))
    found = clean_fit._explained(problem_of(), state_of(), 40, by_power=True)
    assert calls == [(False, True), (True, False)][: 1 + bool(back)]
    assert found is (solution if taken == "with" else alone)


@pytest.mark.parametrize(
    ("outliers", "apart", "last_m", "taken"),
    [
        (0, 3.0, 1e-8, "with"),
        (0, 3.1, 1e-8, "alone"),
        (0, 3.1, 1e-3, "with"),
        (8, 0.0, 1e-8, "alone"),
    ],
)
def test_a_background_that_moves_the_centre_too_far_is_left_out(
    monkeypatch, outliers, apart, last_m, taken
):
    """More than three standard deviations of the centre without it: 0.01 by chance.

    A fit that did not settle without it shows nothing.
    """
    rng = np.random.default_rng(0)
    covariance = np.eye(STATE) * 1e-8
    covariance[:2, :2] += 3e-9 * rng.normal() ** 2
    way = np.linalg.cholesky(covariance[:2, :2]) @ [0.6, -0.8]
    weight = [1.0] * 60 + [0.0] * outliers + [0.2] * (20 - outliers)
    solutions = {True: ended(weight, 20)}
    state = solutions[True].state.copy()
    state[:2] += apart * way
    solutions[False] = replace(ended(weight[:60], state=state), last_m=last_m)
    monkeypatch.setattr(
        clean_fit, "_converge_clean", lambda *args, by_background, near=0: solutions[by_background]
    )
    seen = []
    monkeypatch.setattr(clean_fit, "spread", lambda *args: seen.append(args) or (covariance,))
    found = clean_fit._explained(problem_of(), state_of(), 40, by_power=True)
    assert found is solutions[taken == "with"]
    assert all(args[0] is solutions[False].equations for args in seen)


@pytest.mark.parametrize("beyond", [-0.1, 0.1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_first_and_last_returns_are_those_of_ratios_far_from_one(monkeypatch, beyond, sign):
    """And the wall of a scanner that parts returns by power begins as Lambert's."""
    problem, calls, ratio = problem_of(), [], sign * (ALONE + beyond)

    def explained(problem, state, most, by_power):
        calls.append((state[WALL], by_power))
        return ended(ratio=ratio)

    monkeypatch.setattr(clean_fit, "has_background", lambda *args: True)
    monkeypatch.setattr(clean_fit, "_explained", explained)
    monkeypatch.setattr(clean_fit, "ERODED", 2.0)
    monkeypatch.setattr(clean_fit, "_shows_form", lambda *args: False)
    monkeypatch.setattr(clean_fit, "record", lambda *args: RECORD)
    monkeypatch.setattr(clean_fit, "settled", lambda fitted, found: fitted)
    state = state_of()
    found = clean_fit.fit_clean(problem, state, CONFIG)
    assert found.clean_shift_m == pytest.approx(clean_fit.shift_m(ended(ratio=ratio).state))
    assert calls[0] == (1.0, True)
    assert [by_power for _, by_power in calls] == [True, False][: 1 + (beyond > 0.0)] * 2
    assert state[WALL] == state_of()[WALL]


def of_points(count, state):
    """A solution of so many clean points; its state stands for itself."""
    equations = SimpleNamespace(residual_m=np.ones(count), rows=None)
    return SimpleNamespace(state=state, equations=equations)


@pytest.mark.parametrize(
    ("stated", "grown", "alone", "count", "taken"),
    [
        (1.0, 0.99, 0.5, 400, "stated"),
        (1.0, 0.9, 0.99, 400, "stated"),
        (1.0, 0.9, 0.9, 400, "alone"),
        (1.0, 0.9, 0.9, 91, "alone"),
        (1.0, 0.9, 0.9, 89, "stated"),
    ],
)
def test_first_returns_may_explain_what_seems_another_size(
    monkeypatch, stated, grown, alone, count, taken
):
    """They are tried where the stated size explains less than another, and not by chance."""
    left = {"stated": stated, "grown": grown, "alone": alone}
    solutions = {name: of_points(count, state=name) for name in left}
    alone = {False: solutions["alone"], True: solutions["stated"]}
    monkeypatch.setattr(clean_fit, "_explained", lambda *args, by_power: alone[by_power])
    monkeypatch.setattr(clean_fit, "_grown", lambda problem, state, most: solutions["grown"])
    monkeypatch.setattr(clean_fit, "_likelier", lambda problem, found, state, most: found)
    monkeypatch.setattr(solution, "unexplained", lambda found: left[found.state])
    found = clean_fit._by_size(None, None, None, solutions["stated"], 40)
    assert found == (solutions[taken], solutions["grown"])


@pytest.mark.parametrize(
    ("begin", "ended", "left", "taken"),
    [
        (1.0, 1.0, 1.0, "other"),
        (1.0, 1.0, 1.02, "other"),
        (1.0, 1.0, 1.03, "found"),
        (1.0, 1.0, 0.5, "other"),
        (1.0, 3.0, 0.5, "found"),
        (3.0, 1.0, 0.5, "found"),
    ],
)
def test_a_likelier_state_may_lead_to_a_likelier_solution(monkeypatch, begin, ended, left, taken):
    """It is sought from there alone, and counts unless it explains less, not by chance."""
    found, other = (of_points(400, state=off) for off in (2.0, ended))
    problem = SimpleNamespace(prior=SimpleNamespace(off=lambda state: state))
    monkeypatch.setattr(clean_fit, "_by_returns", lambda *args: other)
    monkeypatch.setattr(solution, "unexplained", lambda one: 1.0 if one is found else left)
    assert clean_fit._likelier(problem, found, begin, 40) is {"found": found, "other": other}[taken]


@pytest.mark.parametrize("ratio", [0.1, 1.0, 3.0])
def test_a_fit_of_another_size_begins_with_the_edge_where_it_was_seen(monkeypatch, ratio):
    """Its place is explained by the size in place of the ratio of powers, of which it has none."""
    starts = []
    monkeypatch.setattr(clean_fit, "_by_returns", lambda problem, state, most: starts.append(state))
    state = state_of()
    state[RATIO], state[GROWTH] = math.log(ratio), 2e-4
    before = state.copy()
    clean_fit._grown(None, state, 40)
    there_m = starts[0][GROWTH] + clean_fit.shift_m(starts[0])
    assert there_m == pytest.approx(state[GROWTH] + clean_fit.shift_m(state), abs=1e-8)
    assert starts[0][RATIO] == 0.0
    others = np.delete(np.arange(STATE), [RATIO, GROWTH])
    np.testing.assert_array_equal(starts[0][others], state[others])
    np.testing.assert_array_equal(state, before)


@pytest.mark.parametrize("converged", [False, True])
@pytest.mark.parametrize("chance", [0.0, 0.4, 0.6, 1.0])
def test_the_size_shown_is_that_of_the_likelier_solution(monkeypatch, chance, converged):
    """If that converged; the centre stays that of the stated size."""
    found, other = ended(ratio=0.1), ended(ratio=0.2)
    moved = RECORD.centre_m + np.array([3e-5, -4e-5])
    sizes = {"growth_m": 2e-4, "growth_u_m": 5e-5, "centre_m": moved, "converged": converged}
    records = {id(found): RECORD, id(other): replace(RECORD, **sizes)}
    monkeypatch.setattr(clean_fit, "has_background", lambda *args: True)
    monkeypatch.setattr(clean_fit, "_by_size", lambda *args: (found, other))
    monkeypatch.setattr(clean_fit, "_shows_form", lambda *args: False)
    monkeypatch.setattr(clean_fit, "_chance", lambda *args: chance)
    monkeypatch.setattr(clean_fit, "record", lambda found, *args: records[id(found)])
    monkeypatch.setattr(clean_fit, "settled", lambda fitted, found: fitted)
    fit = clean_fit.fit_clean(problem_of(), state_of(), CONFIG)
    shown = records[id(other if converged and chance > 0.5 else found)]
    assert (fit.growth_m, fit.growth_u_m) == (shown.growth_m, shown.growth_u_m)
    assert fit.size_chance == chance
    np.testing.assert_array_equal(fit.centre_m, RECORD.centre_m)
    np.testing.assert_allclose(fit.by_size_m, [3e-5, -4e-5])


def test_a_settled_clean_edge_has_the_width_in_its_uncertainty(monkeypatch):
    """Where its last step is small against its u, if not against a solution's end."""
    of_size = []
    monkeypatch.setattr(clean_fit, "has_background", lambda *args: True)
    monkeypatch.setattr(clean_fit, "_by_size", lambda *args: (ended(), ended()))
    monkeypatch.setattr(clean_fit, "_shows_form", lambda *args: False)
    monkeypatch.setattr(clean_fit, "_chance", lambda *args: 0.0)
    monkeypatch.setattr(clean_fit, "record", lambda *args: replace(RECORD, converged=False))
    monkeypatch.setattr(clean_fit, "settled", lambda one, found: replace(one, converged=True))
    monkeypatch.setattr(clean_fit, "as_stretched", lambda one, *args: of_size.append(one) or one)
    assert clean_fit.fit_clean(problem_of(), state_of(), CONFIG).converged
    assert [one.converged for one in of_size] == [True]


@pytest.mark.parametrize(
    ("sectors", "rows", "shown"),
    [
        (SECTORS, LEAST_CLEAN - 1, False),
        (5, 200, False),
        (7, 200, True),
        (SECTORS, 200, True),
        (SECTORS, max(SECTORS, LEAST_CLEAN), True),  # one point of a sector shows it
    ],
)
def test_few_rows_or_sectors_give_no_clean_fit(monkeypatch, sectors, rows, shown):
    share = (np.arange(rows) % sectors + 0.5) / SECTORS
    monkeypatch.setattr(clean_fit, "has_background", lambda *args: True)
    monkeypatch.setattr(clean_fit, "_explained", lambda *a, **k: ended([1.0] * rows, 0, share))
    monkeypatch.setattr(clean_fit, "record", lambda *args: RECORD)
    monkeypatch.setattr(clean_fit, "settled", lambda *args: RECORD)
    monkeypatch.setattr(clean_fit, "_shows_form", lambda *args: False)
    assert (clean_fit.fit_clean(problem_of(), state_of(), CONFIG) is not None) == shown


@pytest.mark.parametrize("strange", [False, True])
@pytest.mark.parametrize("thickness_m", [None, 0.01])
@pytest.mark.parametrize("steep", [False, True])
def test_a_steep_fit_of_another_thickness_is_held(monkeypatch, steep, thickness_m, strange):
    state, priors = state_of(), []
    state[BEAM] = 0.0, 1.1 * STEEP if steep else 0.9 * STEEP
    problem = problem_of()

    def best(problem, state, most):
        priors.append(problem.prior)
        return problem, ended()

    monkeypatch.setattr(mixed_fit, "_best", best)
    monkeypatch.setattr(mixed_fit, "_freed", lambda problem, found, _: (problem, found))
    monkeypatch.setattr(mixed_fit, "_with_curves", lambda fitted, *_: fitted)
    monkeypatch.setattr(mixed_fit, "pointing_m", lambda problem, *_: problem.pointing_m)
    monkeypatch.setattr(mixed_fit, "_is_strange", lambda *args: strange)
    monkeypatch.setattr(mixed_fit, "_tension", lambda *args: 0.0)
    monkeypatch.setattr(mixed_fit, "record", lambda *args: RECORD)
    found = mixed_fit.fit_mixed(problem, state, thickness_m, CONFIG)
    assert replace(found, thickness_pull=None) == RECORD
    first = problem.prior.plain() if steep else problem.prior
    expected = [first.weight, first.held(state).weight]
    held = steep and strange and thickness_m is not None
    expected = expected[: 1 + held] + steep * [problem.prior.weight]  # then with a wall of its own
    np.testing.assert_array_equal([one.weight for one in priors], expected)
    np.testing.assert_array_equal(priors[0].mean, first.mean)


@pytest.mark.parametrize("slope", [1.1 * STEEP, 0.9 * STEEPEST, 1.1 * STEEPEST])
@pytest.mark.parametrize("free", ["more", "less", "diverged", None])
def test_steep_beams_show_a_wall_where_that_explains_as_much(monkeypatch, slope, free):
    """The plain fit stands where the other diverged, explains less, or is not tried."""
    state, tried = state_of(), []
    state[BEAM] = 0.0, slope
    plain, own = replace(RECORD, converged=True), replace(RECORD, converged=free != "diverged")

    def fit(problem, *rest):
        tried.append(problem.prior.is_plain)
        if problem.prior.is_plain:
            return plain, problem, "plain"
        return None if free is None else (own, problem, "own")

    monkeypatch.setattr(mixed_fit, "_fit_straight", fit)
    monkeypatch.setattr(mixed_fit, "_as_ellipse", lambda *args: None)
    monkeypatch.setattr(mixed_fit, "_with_curves", lambda fitted, *_: fitted)
    monkeypatch.setattr(mixed_fit, "explains_less", lambda found, other: free == "less")
    found = mixed_fit.fit_mixed(problem_of(), state, 0.01, CONFIG)
    assert tried == [True, False][: 1 + (slope < STEEPEST)]
    assert found is (own if free == "more" and slope < STEEPEST else plain)


@pytest.mark.parametrize("zones", [Zones.alike(), Zones.free()], ids=["alike", "free"])
def test_a_first_fit_shows_the_power_of_light_as_well(zones):
    """Its background is looked up without: before it nothing would show a power, 0 at u 3."""
    problem = scene(DISC, state_of(), 4000)
    around = np.arctan2(*(problem.plane - state_of()[CENTRE]).T)
    problem = replace(problem, light=0.5 + 0.3 * np.sin(3.0 * around))
    first = mixed_fit._converge(problem, state_of(), zones, 40, consistent=False)
    assert first.background.log_light is None
    lit = problem.background(first.state)
    assert np.ptp(lit.log_light) > 0.5
    seen = mixed_fit._power_of_light(problem, replace(first, background=lit))
    found = mixed_fit._power_of_light(problem, first)
    assert max(found[1], seen[1]) < 0.5 * GAMMA_SIGMA
    assert abs(found[0] - seen[0]) < 2.0 * seen[1]


@pytest.mark.parametrize("worse", [False, True])
@pytest.mark.parametrize(("gamma", "sure"), [(1.0, True), (0.2, False)])
def test_what_a_light_that_is_not_used_would_move_is_kept(monkeypatch, gamma, sure, worse):
    """Where its power is surely not 0: it may be right where its background is not."""
    state, shift = state_of(), np.array([3e-4, -1e-4])
    problem = replace(problem_of(), light=np.ones(len(problem_of().depth)))
    found, moved = ended(), state_of()
    found = replace(found, state=state, zones=Zones.free())
    moved[CENTRE] = state[CENTRE] + shift
    lit = replace(found, state=moved)
    monkeypatch.setattr(mixed_fit, "_power_of_light", lambda *args: (gamma, 0.1))
    monkeypatch.setattr(mixed_fit, "_best", lambda problem, *_: (problem, lit))
    monkeypatch.setattr(mixed_fit, "_freed", lambda problem, found, _: (problem, found))
    monkeypatch.setattr(
        mixed_fit, "_is_worse", lambda one, other: worse if other is found else False
    )
    own, kept = mixed_fit._with_light(problem, found, problem, state, CONFIG)
    if worse:
        assert own is problem
        np.testing.assert_array_equal(kept.state, state)
        assert (kept.by_light_m is not None) == sure
        if sure:
            np.testing.assert_allclose(kept.by_light_m, shift)
    else:
        assert own.gamma != 0.0
        assert kept.by_light_m is None


@pytest.mark.parametrize("scatter", [0.9 * DIFFERENT, 1.1 * DIFFERENT, 1.1 * SURELY])
@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("few", [False, True])
@pytest.mark.parametrize("steep", [False, True])
def test_zones_are_free_where_beams_are_steep_or_backgrounds_differ(
    monkeypatch, steep, few, many, scatter
):
    state, calls = state_of(), []
    state[BEAM] = 0.0, 1.1 * STEEP if steep else 0.9 * STEEP

    def converge(problem, state, zones, most, consistent):
        calls.append((zones.sigma, consistent))
        return Solution(state, zones, None, None, 5, 0.0)

    monkeypatch.setattr(mixed_fit, "_converge", converge)
    monkeypatch.setattr(mixed_fit, "zone_scatter", lambda *args: scatter)
    monkeypatch.setattr(mixed_fit, "CLEARLY", 10 if many else 10**6)
    mixed_fit._by_backgrounds(problem_of(few), state, 40)
    first = ZONE_LOG if steep and not few else ALIKE_LOG
    expected = [(first, False), (first, True)]
    if not steep and not few and scatter > DIFFERENT:
        expected[1 if many and scatter > SURELY else 2 :] = [(ZONE_LOG, False), (ZONE_LOG, True)]
    assert calls == expected


@pytest.mark.parametrize(
    ("first", "again", "inverse", "left", "freed", "taken"),
    [
        (0.9, 0.0, 0.4, 1.0, False, "first"),
        (1.1, 0.0, 0.4, 1.0, False, "again"),
        (5.0, 4.9, 0.4, 1.0, False, "again"),
        (5.3, 5.1, 0.4, 1.0, False, "again"),
        (-1.1, -0.9, 0.4, 0.999 * AS_MUCH, False, "again"),
        (1.1, 0.9, 0.4, 1.001 * AS_MUCH, False, "first"),  # explains less
        (1.1, 1.2, 0.4, 1.0, False, "first"),  # of another size
        (1.1, 1.2, 0.4, 0.24, False, "again"),  # that explains more
        (1.1, 1.2, 0.4, 0.26, False, "first"),  # by chance
        (1.1, 1.2, 0.0, 0.24, False, "first"),
        (1.1, 0.9, 0.4, 0.09, True, "first"),  # what zones explain by chance
        (1.1, 0.9, 0.4, 0.07, True, "again"),
        (-1.1, -0.1, 0.0, 1.0, False, "first"),  # no such scanner
    ],
)
def test_a_strange_growth_gives_way_to_the_stated_size(
    monkeypatch, first, again, inverse, left, freed, taken
):
    states, weights = {}, []
    for name, growth in (("first", first), ("stated", 0.0), ("again", again)):
        states[name] = state_of()
        states[name][GROWTH] = growth * NOTICED_GROWTH_M
    states["again"][INVERSE] = inverse

    def by_backgrounds(problem, state, most):
        weights.append(problem.prior.weight[GROWTH])
        name = "first" if len(weights) == 1 else "stated"
        linear = SimpleNamespace(
            weight=np.array([0.0, 4.0, 4.0]),
            residual_m=np.ones(3),
            uneven=lambda *_: NONE_UNEVEN,
            rows=None,
        )
        zones = Zones.free() if freed and name == "stated" else Zones.alike()
        return Solution(states[name], zones, None, linear, 5, 0.0)

    def converge(problem, state, zones, most, consistent):
        assert consistent
        assert state is states["stated" if len(weights) == 2 else "again"]
        weights.append(problem.prior.weight[GROWTH])
        linear = SimpleNamespace(
            weight=np.full(3, 4.0), residual_m=np.full(3, left**0.5), rows=None
        )
        return Solution(states["again"], zones, None, linear, 5, 0.0)

    monkeypatch.setattr(mixed_fit, "_by_backgrounds", by_backgrounds)
    monkeypatch.setattr(mixed_fit, "BY_ZONES", 11.0)
    monkeypatch.setattr(mixed_fit, "_converge", converge)
    monkeypatch.setattr(mixed_fit, "_where_stated", lambda problem, _, found, __: (problem, found))
    _, found = mixed_fit._best(problem_of(False), state_of(), 40)
    np.testing.assert_array_equal(found.state, states[taken])
    strange = abs(first) > 1.0
    expected = [SIZE_M**-2, HELD_SIZE_M**-2, SIZE_M**-2]
    again_m = abs(again) * NOTICED_GROWTH_M  # before the background of the size it found
    expected += [SIZE_M**-2] * (again_m > OTHER_SIZE_M)
    np.testing.assert_allclose(weights, expected if strange else expected[:1])


@pytest.mark.parametrize(
    ("asking", "again_m", "taken"),
    [
        (6, 0.4 * OTHER_SIZE_M, "again"),
        (6, 1.1 * OTHER_SIZE_M, "found"),  # another size without them, too
        (int(MOST_UNEVEN * UNEVEN_SECTORS) + 1, 0.0, "found"),  # all round
    ],
)
def test_a_few_sectors_that_ask_for_another_size_are_left_out(monkeypatch, asking, again_m, taken):
    """As where a step of the background lies along the edge; of a disc of another size, all ask."""
    share = (np.arange(UNEVEN_SECTORS) + 0.5) / UNEVEN_SECTORS

    def of_size(growth_m, square):
        state = state_of()
        state[GROWTH] = growth_m
        linear = SimpleNamespace(weight=np.ones(len(share)), residual_m=square**0.5, share=share)
        return Solution(state, Zones.alike(), None, linear, 5, 0.0)

    left = np.where(np.arange(UNEVEN_SECTORS) < asking, 1.1 * BY_CHANCE, 0.005 * BY_CHANCE)
    stated, found = of_size(0.0, left), of_size(1.2 * OTHER_SIZE_M, 0.0 * left)
    again = of_size(again_m, left)

    def refitted(problem, begin, most):
        assert begin is stated
        np.testing.assert_array_equal(problem.left_out, left > BY_CHANCE)
        return again

    monkeypatch.setattr(mixed_fit, "_again", refitted)
    problem, ended = mixed_fit._where_stated(problem_of(), stated, found, 40)
    assert ended is {"again": again, "found": found}[taken]
    assert problem.left_out.any() == (taken == "again")


@pytest.mark.parametrize(
    ("sectors", "moved_m", "left", "taken"),
    [
        ((), 0.0, 0.5, "first"),
        ((3,), 0.9 * MOVED_M, 0.5, "again"),
        ((3,), 1.1 * MOVED_M, 0.9, "anew"),
        ((3,), 1.1 * MOVED_M, 1.1, "again"),  # what is sought anew explains less
        (range(int(MOST_UNEVEN * UNEVEN_SECTORS) + 1), 1.0, 0.5, "first"),
    ],
)
def test_sectors_that_contradict_their_background_are_left_out(
    monkeypatch, sectors, moved_m, left, taken
):
    """Unless they are many: then something else is wrong."""
    uneven, left_out = NONE_UNEVEN.copy(), []
    uneven[list(sectors)] = True

    def ended(name, u_m=0.0, square=1.0, flagged=NONE_UNEVEN):
        state = state_of()
        state[0] += u_m
        rows = {"weight": np.ones(4), "residual_m": np.full(4, square**0.5)}
        linear = SimpleNamespace(**rows, uneven=lambda *_: flagged, name=name)
        return Solution(state, Zones.alike(), None, linear, 5, 0.0)

    def by_backgrounds(problem, state, most):
        left_out.append(problem.left_out)
        first = not problem.left_out.any()
        return ended("first", flagged=uneven) if first else ended("anew", square=left)

    def again(problem, found, most):
        left_out.append(problem.left_out)
        return ended("again", moved_m)

    monkeypatch.setattr(mixed_fit, "_by_backgrounds", by_backgrounds)
    monkeypatch.setattr(mixed_fit, "_again", again)
    problem, found = mixed_fit._cleared(problem_of(), state_of(), 40)
    assert found.equations.name == taken
    for other in left_out[1:]:
        np.testing.assert_array_equal(other, uneven)
    assert problem.left_out.any() == (taken != "first")
    assert len(left_out) == {"first": 1, "again": 2 + (moved_m > MOVED_M), "anew": 3}[taken]


@pytest.mark.parametrize("points", [0, LEAST - 1])
def test_an_edge_that_hardly_any_point_compares_with_a_background_stays_sharp(points):
    """A few points of a partly hidden disc once ended with a division by zero."""
    behind = SimpleNamespace(rows=np.zeros(points, int))
    problem, found = problem_of(), Solution(state_of(), Zones.alike(), behind, None, 5, 0.0)
    same, kept = mixed_fit._freed(problem, found, CONFIG)
    assert same is problem
    assert kept is found


@pytest.mark.parametrize(
    ("zones", "more", "worse"),
    [
        ((Zones.alike(), Zones.alike()), 0.9 * BY_CHANCE, False),
        ((Zones.alike(), Zones.alike()), 1.1 * BY_CHANCE, True),
        ((Zones.free(), Zones.alike()), 1.1 * BY_CHANCE, True),
        ((Zones.alike(), Zones.free()), 0.9 * BY_ZONES, False),
        ((Zones.alike(), Zones.free()), 1.1 * BY_ZONES, True),
    ],
)
def test_what_zones_explain_by_chance_makes_no_solution_without_them_worse(zones, more, worse):
    """A power of light once gave way to one that was 0.7 off, with 48 zones."""
    found, other = (replace(ended((0.1,) * 200), zones=one) for one in zones)
    found.equations.residual_m[:] = math.sqrt(more / 20.0)
    assert mixed_fit._is_worse(found, other) == worse


@pytest.mark.parametrize("found", ["again", "other"])
def test_sectors_left_out_before_stay_so(monkeypatch, found):
    """A second time those of the solution without the first ones are left out besides."""
    flags = iter([[3], [7] if found == "other" else [], []])

    def solved(problem, *args):
        uneven = NONE_UNEVEN.copy()
        uneven[next(flags)] = True
        linear = SimpleNamespace(weight=np.ones(4), residual_m=np.ones(4), uneven=lambda *_: uneven)
        return Solution(state_of(), Zones.alike(), None, linear, 5, 0.0)

    monkeypatch.setattr(mixed_fit, "_by_backgrounds", solved)
    monkeypatch.setattr(mixed_fit, "_again", solved)
    problem, _ = mixed_fit._cleared(problem_of(), state_of(), 40)
    assert list(np.flatnonzero(problem.left_out)) == ([3, 7] if found == "other" else [3])


@pytest.mark.parametrize(
    ("weight", "left"), [([], 4.0), ([0.0], 4.0), ([1.0, 0.0], 2.5), ([1.0, 1.0], 1.0)]
)
def test_outliers_are_unexplained_and_so_is_a_solution_without_points(weight, left):
    rows = SimpleNamespace(weight=np.array(weight), residual_m=np.ones(len(weight)))
    found = Solution(state_of(), Zones.alike(), None, rows, 5, 0.0)
    assert solution.unexplained(found) == pytest.approx(left)


@pytest.mark.parametrize(("bad", "misfit"), [(0, 0.1), (3, 0.1), (5, 0.1), (6, 0.145)])
def test_outliers_of_a_few_sectors_are_no_misfit(bad, misfit):
    """One in ten points of each sector, and all of the bad ones, of which five are left out."""
    share = (np.repeat(np.arange(SECTORS), 10) + 0.5) / SECTORS
    weight = np.tile([0.0] + [1.0] * 9, SECTORS)
    weight[: 10 * bad] = 0.0
    found = solution.misfit_of(SimpleNamespace(share=share, weight=weight))
    assert found == pytest.approx(misfit, abs=0.005)


@pytest.mark.parametrize(
    ("counts", "outliers", "misfit"),
    [
        ([4] * 5 + [40] * 19, [4] * 5 + [4] * 19, 0.1),
        ([1] * 5 + [10] * 19, [1] * 5 + [6] + [1] * 18, 24 / 190),
        ([1] * 6 + [0] * 18, [1] * 6 + [0] * 18, 1.0),
        ([0] * 24, [0] * 24, 0.0),
    ],
)
def test_the_sectors_left_out_are_those_of_the_largest_share(counts, outliers, misfit):
    """However few or many points they hold."""
    assert len(counts) == len(outliers) == SECTORS
    share = (np.repeat(np.arange(SECTORS), counts) + 0.5) / SECTORS
    pairs = zip(counts, outliers, strict=True)
    weight = np.concatenate([np.repeat([0.0, 1.0], [out, n - out]) for n, out in pairs])
    found = solution.misfit_of(SimpleNamespace(share=share, weight=weight))
    assert found == pytest.approx(misfit, abs=1e-12)


@pytest.mark.parametrize("few", [False, True])
def test_a_record_is_of_the_last_solution(few):
    state = state_of()
    for last_m in (0.5e-5, 2e-5):
        fit, linear, problem = recorded(last_m, few)
        covariance, by_plane, dof = spread(linear, PLATE, problem.prior, few)
        np.testing.assert_allclose(fit.state, state, rtol=1e-12)
        np.testing.assert_array_equal(fit.covariance_m2, covariance[CENTRE, CENTRE])
        noise = [covariance[ROTATION, 0], covariance[ROTATION, 1], covariance[ROTATION, ROTATION]]
        np.testing.assert_array_equal(fit.rotation_noise, noise)
        np.testing.assert_array_equal(fit.by_plane, by_plane[CENTRE])
        np.testing.assert_array_equal(fit.rotation_by_plane, by_plane[ROTATION])
        assert (fit.dof, fit.covered, fit.iterations) == (dof, 0.8, 7)
        assert fit.points == len(linear.residual_m)
        assert fit.misfit == solution.misfit_of(linear) > 0.0
        assert fit.converged == (last_m < 1e-5)
        assert fit.clean_shift_m is None
        assert fit.size_chance == fit.rows_m == 0.0  # of clean edges alone


def test_another_size_that_explains_no_more_is_as_likely_as_its_prior():
    def solution(growth_m, outliers):
        state = prior.mean.copy()
        state[GROWTH] = growth_m
        return ended(weight=(0.0,) * outliers + (1.0,) * (40 - outliers), state=state)

    prior = Prior.of(0.01, CONFIG).by_power().unsized()
    stated = solution(0.5 * WRONG_SIZE_M, 20)
    for sizes in (0.0, 1.0, 3.0, 100.0):
        odds = math.exp((0.5**2 - sizes**2) / 2.0)
        alike, by_chance, better = (
            clean_fit._chance(prior, stated, solution(sizes * WRONG_SIZE_M, outliers))
            for outliers in (20, 18, 17)
        )
        assert alike == by_chance == pytest.approx(odds / (1.0 + odds), abs=1e-12)
        assert better == 1.0


SIZE_PRIOR = Prior.of(0.01, CONFIG).by_power().unsized()


def of_size(growth_m, outliers, off_m):
    """A solution of that growth, with outliers among its 30 depths, and 10 points beside it."""
    state = SIZE_PRIOR.mean.copy()
    state[GROWTH] = growth_m
    weight = (0.0,) * outliers + (1.0,) * (40 - outliers)
    found = ended(weight, depths=30, state=state)
    found.equations.residual_m[30:] = off_m
    return found


@pytest.mark.parametrize(("outliers", "farther"), [(5, 0.4), (5, 0.6), (2, 0.4)])
def test_another_size_counts_where_the_points_beside_the_edge_lie_far_nearer(outliers, farther):
    """A plate 12 mm larger: a footprint of 16 mm explained its depths, and left them 0.9 mm off."""
    stated, grown = of_size(0.0, outliers, 2e-5), of_size(3.0 * WRONG_SIZE_M, 5, farther * 2e-5)
    by_prior = 0.5 - 0.5 * math.tanh(9.0 / 4.0)
    is_nearer = outliers == 5 and farther * AS_NEAR < 1.0
    likely = clean_fit._chance(SIZE_PRIOR, stated, grown)
    assert likely == (1.0 if is_nearer else pytest.approx(by_prior, abs=1e-12))


@pytest.mark.parametrize("farther", [0.5, 1.0, 1.9, 2.1, 5.0])
def test_another_size_is_none_where_the_points_beside_the_edge_lie_far_from_it(farther):
    """Whatever it explains of the depths, as a wide footprint does of a rounded edge."""
    stated, grown = of_size(0.0, 20, 2e-5), of_size(3.0 * WRONG_SIZE_M, 5, farther * 2e-5)
    by_prior = 0.5 - 0.5 * math.tanh(9.0 / 4.0)
    likely = clean_fit._chance(SIZE_PRIOR, stated, grown)
    assert likely == (1.0 if farther < AS_NEAR else pytest.approx(by_prior, abs=1e-12))


def test_points_follow_the_edge_while_it_grows_and_stay_while_a_fit_converges(monkeypatch):
    called, growths = put_in(monkeypatch, [1e-3]), iter([3e-4, -6e-5, 4e-5])

    def step(*args, **kwargs):
        moved = np.zeros(STATE)
        moved[GROWTH] = next(growths, 0.0)
        moved[0] = 0.0 if moved[GROWTH] == 0.0 else 1e-3
        return moved, Zones.alike()

    monkeypatch.setattr(mixed_fit, "step", step)
    mixed_fit._converge(problem_of(), state_of(), Zones.alike(), 40, True)
    assert called.looks == [1]
    assert called.compared == [2, 3]


def test_what_one_solution_alone_compares_with_a_background_counts_for_neither():
    def of(rows, residuals):
        linear = SimpleNamespace(
            rows=np.array(rows), weight=np.ones(len(rows)), residual_m=np.array(residuals)
        )
        return SimpleNamespace(equations=linear)

    good = of(range(150), [1.0] * 100 + [1.9] * 50)
    poor = of(range(100), [1.2] * 100)
    assert solution.explains_less(poor, good)
    assert not solution.explains_less(good, poor)
    apart = of(range(200, 250), [1.9] * 50)  # nothing in common
    assert not solution.explains_less(apart, poor)
    assert not solution.explains_less(poor, apart)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_edge_with_next_to_no_background_is_none(seed):
    """Seen from a known station, with a hundredth of its background: two of three divided by 0."""
    state, rng = state_of(), np.random.default_rng(seed)
    q = rng.uniform(-1.0, 1.0, (8000, 2)) * (1.7 * DISC.size_m)
    x_m = DISC.closest(turned(q, -state[ROTATION])).x_m
    depth = 0.3 * np.clip(0.5 + x_m / 0.003, 0.0, 1.0) + SIGMA_M * rng.normal(size=len(x_m))
    plane = state[CENTRE] + q * (1.0 + state[INVERSE] * depth)[:, None]
    uvw = np.column_stack([plane + depth[:, None] * state[BEAM], -depth])
    uvw = uvw[(x_m < 0.002) | (rng.random(len(x_m)) < 0.01)]
    begin = aimed(uvw, DISC, 0.012, CONFIG, (state[CENTRE], 0.0), np.array([-0.7, 0.4, 1.8]))
    assert fit_edge(uvw, EdgeToFit(DISC, 0.012, SIGMA_M, CONFIG), begin) is None


@pytest.mark.parametrize("scale", [1.0, 1e20])
def test_an_information_that_is_singular_to_rounding_has_a_step(scale):
    """As of beams that come from one point, far from a solution."""
    one = np.array([[1.0, 1.0], [1.0, 1.0 - 2e-16]]) * np.sqrt(np.outer([scale, 1.0], [scale, 1.0]))
    inverse = _inverse(one, one)
    assert np.isfinite(inverse).all()
    np.testing.assert_allclose(inverse, inverse.T, rtol=1e-6)
    regular = one + np.diag(np.diag(one))
    np.testing.assert_allclose(_inverse(regular, regular) @ regular, np.eye(2), atol=1e-6)


def test_a_fit_that_goes_astray_before_its_own_background_keeps_the_others(monkeypatch):
    """It would be that of another edge, or of none."""
    problem = problem_of()
    near = np.zeros(STATE)
    found = Solution(near, Zones.alike(), SimpleNamespace(kept=True), ended(), 3, 1e-9)
    tried = []

    def converge(about, state, zones, most, consistent, background=None, own=False):
        tried.append((own, background))
        return replace(found, last_m=math.inf if own else 1e-9)

    monkeypatch.setattr(mixed_fit, "_converge", converge)
    assert mixed_fit._near(problem, found, 40).converged
    assert tried == [(True, None), (False, found.background)]
    far = near.copy()
    far[1] = -2.0 * mixed_fit.ASTRAY_M
    assert mixed_fit._is_astray(far, near)
    assert not mixed_fit._is_astray(0.4 * far, near)
