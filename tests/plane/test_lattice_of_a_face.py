"""Lattice of a thinned face: the points that show it, and steps that only look like one."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest

from tests.support.thinned import face, means
from wheelplane.cloud.steps import Steps
from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch
from wheelplane.plane.clipped_plane import ClipSlab, fit_clipped_plane
from wheelplane.plane.thinned.voxel_pull import fit_pull
from wheelplane.targets.plates import DiscTarget

module = importlib.import_module("wheelplane.plane.fit_plane")
DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
REGION = DISC.region.shrunk(PlaneConfig().edge_margin_m)
EDGE_M = 6e-3


def thinned(seed):
    """Patch of a thinned face 3 mm from its origin, 8 % of its points strays; and its plane."""
    rng = np.random.default_rng(seed)
    points, normal = face(rng)
    points = means(points, EDGE_M)
    strays = rng.choice([-1.0, 0.0, 1.0], len(points), p=[0.04, 0.92, 0.04])
    points = points + 4e-3 * strays[:, None] * normal
    first = np.cross([0.0, 0.0, 1.0], normal)
    first /= np.linalg.norm(first)
    origin = np.median(points, axis=0) - 3e-3 * normal
    basis = np.stack([first, np.cross(normal, first), normal])
    none = np.zeros((0, 3), np.float32)
    patch = Patch(origin, points - origin, none, 1.0, basis, 1e-3)
    slab = ClipSlab(basis, 0.0, 2e-3, 0.0)
    return patch, fit_clipped_plane(patch.face_m, REGION, slab, DISC.radius_m, 12, 20)


def within(limits, patch, fit):
    """Rows of the points over the face that lie within so many limits of the plane."""
    off = np.abs((patch.face_m - fit.centroid_m) @ fit.normal)
    away = np.linalg.norm(patch.face_m @ fit.slab.basis[:2].T, axis=1)
    over = away < DISC.radius_m - PlaneConfig().edge_margin_m
    return np.flatnonzero(over & (off < limits * fit.slab.limit_m))


@pytest.mark.parametrize("seed", range(4))
def test_points_within_some_limits_lie_over_the_face_and_near_its_plane(seed):
    patch, fit = thinned(seed)
    counts = []
    for limits in (0.5, 1.0, 2.0, 4.0):
        wanted = within(limits, patch, fit)
        np.testing.assert_array_equal(module._within(limits, patch, REGION, fit), wanted)
        counts.append(len(wanted))
    assert all(np.diff(counts) > 20)
    assert counts[-1] < len(patch.face_m)


@pytest.mark.parametrize("seed", range(3))
def test_the_pull_is_that_of_the_points_that_are_used(seed):
    """Strays between one limit and two are no points of the face."""
    patch, fit = thinned(seed)
    found = module._by_lattice(patch, REGION, fit)
    assert found is not None
    assert found.lattice.edge_m == pytest.approx(EDGE_M, rel=0.005)
    used = patch.face_m[within(1.0, patch, fit)]
    exact = fit_pull(used, found.lattice, np.eye(3))
    np.testing.assert_allclose(found.plane, exact.plane, rtol=1e-9)
    np.testing.assert_allclose(found.table_m, exact.table_m, rtol=1e-9, atol=1e-12)
    more = fit_pull(patch.face_m[within(1.5, patch, fit)], found.lattice, np.eye(3))
    assert np.abs(more.plane - exact.plane).max() > 1e-6


@pytest.mark.parametrize("axis", range(3))
def test_cells_of_few_steps_along_any_axis_are_no_lattice(axis):
    """The cells' edge would be two steps."""
    patch, fit = thinned(1)
    coarse = Steps(EDGE_M / 2.0 * np.eye(3)[axis] + EDGE_M / 100.0)
    assert module._by_lattice(replace(patch, steps=coarse), REGION, fit) is None


@pytest.mark.parametrize("step_m", [0.0, EDGE_M / 12.0])
def test_cells_of_many_steps_are_a_lattice(step_m):
    patch, fit = thinned(1)
    fine = replace(patch, steps=Steps(np.full(3, step_m)))
    assert module._by_lattice(fine, REGION, fit) is not None
