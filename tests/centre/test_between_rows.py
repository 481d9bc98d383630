"""Straight edges that rows of a grid run along: such an edge lies anywhere between two rows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.centre.edge.beams import BEAM, CENTRE, ROTATION, Prior
from wheelplane.centre.edge.clean_edge import between_rows_m
from wheelplane.centre.edge.edge_residuals import EdgeProblem
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.vectors import turned

HALF_M = np.array([0.14, 0.1])
PLATE = rectangle(*(2.0 * HALF_M))
ROW_M, TURN_RAD, SIGMA_M = 0.001, 0.3, 0.0004
PRIOR = Prior.of(0.01, CentreConfig())


def between_m(q_m, depth_m=0.0, outline=PLATE, sigma_m=SIGMA_M):
    """Uncertainty by rows of points (N, 2) in the plate's own axes, of a plate that is turned."""
    state = PRIOR.mean.copy()
    state[CENTRE], state[ROTATION], state[BEAM] = (0.02, -0.01), TURN_RAD, 0.0
    plane = np.asfortranarray(state[CENTRE] + turned(np.asarray(q_m), TURN_RAD))
    depth = np.broadcast_to(depth_m, len(plane)).astype(float)
    return between_rows_m(EdgeProblem(plane, depth, PRIOR, outline, sigma_m), state)


def in_rows(count=60_000, seed=0):
    """Points of the plate in rows along its longer sides, anywhere along a row."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-1.0, 1.0, (2, count)) * HALF_M[:, None]
    return np.stack([u, ROW_M * (np.floor(v / ROW_M) + 0.5)], axis=1)


def test_an_edge_along_rows_lies_anywhere_between_two_of_them():
    """Two of four sides are uniform within a row's width; one side seen alone is as uncertain."""
    uniform_m = ROW_M / math.sqrt(12.0)
    q_m = in_rows()
    assert between_m(q_m) == pytest.approx(uniform_m / math.sqrt(2.0), rel=0.1)
    upper = q_m[q_m[:, 1] > 0.08]
    assert between_m(upper[np.abs(upper[:, 0]) < 0.1]) == pytest.approx(uniform_m, rel=0.1)


def test_a_grid_along_all_sides_leaves_each_between_two_of_its_rows():
    u, v = (ROW_M * (np.arange(-h / ROW_M, h / ROW_M) + 0.5) for h in HALF_M)
    q_m = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    assert between_m(q_m) == pytest.approx(ROW_M / math.sqrt(12.0), rel=0.1)


def test_rows_far_apart_are_seen_however_close_their_points():
    """Ten times as far as the points of a row: half a million on the plate, rows of 4 mm."""
    rng, q_m = np.random.default_rng(5), in_rows(500_000)
    q_m[:, 1] = 0.004 * (rng.integers(-25, 25, len(q_m)) + 0.5)
    assert between_m(q_m) == pytest.approx(0.004 / math.sqrt(24.0), rel=0.1)


def test_few_points_without_rows_leave_nothing_between_them():
    """Chance alone does not make rows: of 300 to 3,000 points in 40 plates each."""
    rng = np.random.default_rng(6)
    counts = np.repeat([300, 1000, 3000], 40)
    scenes = (rng.uniform(-1.0, 1.0, (count, 2)) * HALF_M for count in counts)
    assert np.count_nonzero([between_m(q_m) for q_m in scenes]) <= 3


def test_rows_of_unlike_spacing_add_by_their_squares():
    u = 1.5 * ROW_M * (np.arange(-HALF_M[0] / ROW_M / 1.5, HALF_M[0] / ROW_M / 1.5) + 0.5)
    v = ROW_M * (np.arange(-HALF_M[1] / ROW_M, HALF_M[1] / ROW_M) + 0.5)
    q_m = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    expected = ROW_M * math.sqrt((1.0 + 1.5**2) / 2.0 / 12.0)
    assert between_m(q_m) == pytest.approx(expected, rel=0.12)


@pytest.mark.parametrize("count", [60_000, 1_000_000, 3_000_000])
def test_points_without_rows_leave_nothing_between_them(count):
    rng = np.random.default_rng(1)
    assert between_m(rng.uniform(-1.0, 1.0, (count, 2)) * HALF_M) == 0.0


@pytest.mark.parametrize("count", [20_000, 200_000])
@pytest.mark.parametrize("gap_m", [(0.005, 0.009), (0.005, 0.02), (0.002, 0.005)])
def test_a_strip_that_is_not_seen_is_no_row(count, gap_m):
    """Beside one side, by a cable, an arm or a filter: it leaves its edge as certain as before."""
    q_m = np.random.default_rng(7).uniform(-1.0, 1.0, (count, 2)) * HALF_M
    inside_m = HALF_M[1] - q_m[:, 1]
    assert between_m(q_m[(inside_m < gap_m[0]) | (inside_m > gap_m[1])]) < 5e-5


def test_rows_across_a_side_leave_it_certain():
    """Rows at 30 degrees cross every side at another place each."""
    rng = np.random.default_rng(2)
    u, v = rng.uniform(-0.2, 0.2, (2, 120_000))
    q_m = turned(np.stack([u, ROW_M * np.round(v / ROW_M)], axis=1), np.radians(30.0))
    assert between_m(q_m[(np.abs(q_m) < HALF_M).all(axis=1)]) < 0.1 * ROW_M


def test_only_the_target_s_points_beside_its_edge_count():
    """Points beside the plate, before it and in its middle change nothing of what its rows show."""
    rng = np.random.default_rng(3)
    q_m, more = in_rows(), rng.uniform(-1.0, 1.0, (60_000, 2)) * HALF_M
    off = np.full(len(more), 0.05)
    alone = between_m(q_m)
    both = np.concatenate([q_m, more])
    assert between_m(both, np.concatenate([np.zeros(len(q_m)), off])) == alone
    assert between_m(both, np.concatenate([np.zeros(len(q_m)), -off])) == alone
    middle = more[(np.abs(more) < HALF_M - 0.02).all(axis=1)]
    assert between_m(np.concatenate([q_m, middle])) == alone


def test_a_plane_without_noise_shows_its_rows():
    assert between_m(in_rows(), sigma_m=1e-6) == between_m(in_rows()) > 0.0


def test_noise_within_the_target_s_leaves_its_points_in_their_rows():
    depth = np.random.default_rng(4).choice([-2.0, 2.0], 60_000) * SIGMA_M
    assert between_m(in_rows(), depth) == pytest.approx(between_m(in_rows()), rel=0.05)


def test_without_straight_edges_or_points_there_is_nothing_between_rows():
    disc = Circle(0.1)
    assert between_m(in_rows(), outline=disc) == 0.0
    assert between_m(in_rows()[:0]) == 0.0
    assert between_m([[0.0, 0.0]]) == 0.0
