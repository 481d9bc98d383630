"""Axis from lines of normals."""

import numpy as np
import pytest

from tests.support.round_wheels import angle_between, aside, axis_of
from wheelplane.vectors import plane_basis
from wheelplane.wheel.normal_lines import Axis, axis_of_normals


def torus(rng, centre, direction, count=400):
    """Centroids and normals on a torus about an axis."""
    turn, tube = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    basis = plane_basis(direction)
    radial = np.column_stack([np.cos(turn), np.sin(turn)]) @ basis[:2]
    normal = np.cos(tube)[:, None] * radial + np.sin(tube)[:, None] * direction
    return centre + 0.28 * radial + 0.04 * normal, normal


@pytest.mark.parametrize("seed", range(5))
def test_exact_normals_give_the_axis(seed):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    points, normals = torus(rng, centre, direction)
    tilted = direction + 0.08 * rng.normal(size=3)
    start = Axis(centre + rng.normal(0.0, 0.02, 3), tilted / np.linalg.norm(tilted))
    found = axis_of_normals(points, normals, np.ones(len(points)), start)
    assert angle_between(start.direction, direction) > 0.005
    assert angle_between(found.direction, direction) < 1e-5
    assert aside(found.point_m, centre, direction) < 1e-5


def test_outliers_are_left_out():
    rng = np.random.default_rng(1)
    centre, direction = axis_of(rng)
    points, normals = torus(rng, centre, direction)
    wild = rng.normal(size=(80, 3))
    normals[:80] = wild / np.linalg.norm(wild, axis=1, keepdims=True)
    start = Axis(centre + rng.normal(0.0, 0.01, 3), direction)
    found = axis_of_normals(points, normals, np.ones(len(points)), start)
    assert angle_between(found.direction, direction) < np.radians(0.3)
    assert aside(found.point_m, centre, direction) < 0.001


def test_lines_that_all_count_nothing_leave_the_start():
    rng = np.random.default_rng(2)
    start = Axis(*axis_of(rng))
    level = np.broadcast_to(start.direction, (20, 3))
    points = start.point_m + rng.normal(0.0, 0.1, (20, 3))
    for normals, weights in ((level, np.ones(20)), (rng.normal(size=(20, 3)), np.zeros(20))):
        found = axis_of_normals(points, normals, weights, start)
        assert np.isfinite(found.direction).all()
        assert angle_between(found.direction, start.direction) < 1e-6
