"""Few points about an edge: the likeliest of several solutions."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.centre.test_edge_iterations import CONFIG
from tests.centre.test_edge_rows import scene, state_of
from tests.support.scenes import Setup, Sheet, make
from wheelplane.centre.edge.beams import BEAM, CENTRE, CHAMFER, INVERSE, STATE, Prior, look_up
from wheelplane.centre.edge.edge_residuals import EdgeProblem, Zones
from wheelplane.centre.edge.few_points import (
    APART,
    STARTS,
    UNKNOWN,
    is_likelier,
    likeliest,
    total_loss,
)
from wheelplane.centre.edge.mixed_fit import _solved
from wheelplane.centre.edge.solution import Solution
from wheelplane.targets.outline import Circle

DISC = Circle(0.125)
FEW = Setup(
    spacing_m=0.0125, half_width_m=0.18, pairs=12, noise_m=0.0003, turned=False, shift_m=(0, 0, 0)
)


SPOKES = tuple(
    Sheet((0.14 * np.cos(angle), 0.14 * np.sin(angle), -0.03), half=(0.02, 0.02), echo=0.8)
    for angle in np.arange(5) * 2.0 * np.pi / 5.0
)


def few_points(seed, extra=()):
    """Problem of 300 points on a disc of 250 mm, and its true state (13,)."""
    cloud = make(FEW.but(extra=extra), seed)
    state, station = Prior.of(0.01, CONFIG).mean, cloud.viewpoint_m
    state[BEAM], state[INVERSE] = -station[:2] / station[2], 1.0 / station[2]
    plane, depth = cloud.points_m[:, :2], -cloud.points_m[:, 2]
    return EdgeProblem(plane, depth, Prior.of(0.01, CONFIG), DISC, 3e-4, True), state


def loss_before_its_own(problem, state):
    background = look_up(problem.beams(state), problem.depth, state)
    return total_loss(problem, state, background)


def solved(problem, state):
    return _solved(problem, state, Zones.alike(), 20)


def test_every_second_start_lies_about_the_likeliest_solution_so_far(monkeypatch):
    starts = []

    def solve(state):
        starts.append(state)
        return Solution(np.full(STATE, float(len(starts))), Zones.alike(), None, None, 1, 0.0)

    losses = [np.inf, 5.0, 7.0, 3.0, *([4.0] * 20)]
    monkeypatch.setattr(
        "wheelplane.centre.edge.few_points.is_likelier",
        lambda problem, state, other: losses[int(state[0])] < losses[int(other[0])],
    )
    found = likeliest(None, np.zeros(STATE), solve)
    assert found.state[0] == 3.0
    assert len(starts) == 1 + STARTS
    np.testing.assert_array_equal(starts[0], 0.0)
    about = [0.0, 1.0] + [3.0 * (number % 2) for number in range(2, STARTS)]
    scattered = APART > 0.0
    for state, middle in zip(starts[1:], about, strict=True):
        off = (state - middle) / np.where(scattered, APART, 1.0)
        np.testing.assert_array_equal(off[~scattered], 0.0)
        assert 0.0 < np.abs(off[scattered]).max() < 4.0


@pytest.mark.slow
def test_where_a_fit_to_few_points_begins_hardly_counts():
    """Before spokes, single fits from the same states end elsewhere, and farther off."""
    apart, off = {"one": [], "several": []}, {"one": [], "several": []}
    for seed in range(6):
        problem, truth = few_points(seed, SPOKES)
        rng = np.random.default_rng(3)
        drawn = np.hstack([rng.standard_normal((4, CHAMFER)), np.zeros((4, STATE - CHAMFER))])
        begins = list(truth + 3.0 * APART * drawn)
        solve = partial(solved, problem)
        for name, fit in (("one", solve), ("several", partial(likeliest, problem, solve=solve))):
            ends = np.array([fit(begin).state[CENTRE] for begin in begins])
            apart[name].append(np.ptp(ends, axis=0).max())
            off[name].append(np.sqrt(np.mean((ends - truth[CENTRE]) ** 2)))
    assert np.median(apart["several"]) < 1e-4 < 2e-4 < np.median(apart["one"])
    assert np.median(off["several"]) < 0.8e-4 < 1e-4 < np.median(off["one"])


def test_the_likeliest_solution_is_the_same_again():
    problem, truth = few_points(5)
    first, again = (likeliest(problem, truth, partial(solved, problem)) for _ in range(2))
    assert first.state.tobytes() == again.state.tobytes()


def test_the_truth_is_likelier_than_states_beside_it():
    problem, truth = few_points(1)
    least = loss_before_its_own(problem, truth)
    for axis in range(2):
        for step in (-2e-3, 2e-3):
            beside = truth + step * np.eye(STATE)[axis]
            assert loss_before_its_own(problem, beside) > least + 10.0
            assert is_likelier(problem, truth, beside)
            assert not is_likelier(problem, beside, truth)
    assert not is_likelier(problem, truth, truth)
    order = np.random.default_rng(0).permutation(len(problem.depth))
    shuffled = replace(problem, plane=problem.plane[order], depth=problem.depth[order])
    assert loss_before_its_own(shuffled, truth) == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize("of_the_other", [1.0, 3.0])
def test_a_likelier_state_is_so_before_the_background_of_either(monkeypatch, of_the_other):
    here, other = np.zeros(STATE), np.ones(STATE)
    losses = {(0.0, 0.0): 1.0, (1.0, 0.0): 2.0, (0.0, 1.0): of_the_other, (1.0, 1.0): 2.0}
    module = "wheelplane.centre.edge.few_points"
    monkeypatch.setattr(EdgeProblem, "background", lambda problem, state: state[0])
    monkeypatch.setattr(
        f"{module}.total_loss", lambda problem, state, background: losses[state[0], background]
    )
    problem, _ = few_points(0)
    assert is_likelier(problem, here, other) == (of_the_other < 2.0)


@pytest.mark.parametrize(("x_m", "loss"), [(0.01, UNKNOWN), (-0.01, None)])
def test_points_before_no_background_count_alike_and_those_on_the_face_by_depth(x_m, loss):
    state = state_of()
    whole = scene(Circle(0.06), state, 2000)
    empty = EdgeProblem(whole.plane[:0], whole.depth[:0], whole.prior, whole.outline, 6e-4, True)
    alone = loss_before_its_own(empty, state)
    q = state[CENTRE] + (0.06 + x_m) * np.array([[0.6, 0.8]])
    depth = np.array([2.5 * 6e-4])
    one = replace(empty, plane=q + depth * state[BEAM], depth=depth)
    sought = loss if loss is not None else 2.0 * np.log1p(2.5**2 / 4.0)
    assert loss_before_its_own(one, state) - alone == pytest.approx(sought)
