"""Voxel lattice of thinned points: found where there is one, with its edge and boundary."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.thinned import face, means, nearest
from wheelplane.cloud.lattice import find_lattice


@pytest.mark.parametrize(("thin", "edge_m"), [(means, 3e-3), (means, 5e-3), (nearest, 5e-3)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_lattice_is_found_with_its_edge_and_boundary(thin, edge_m, axis):
    points, normal = face(np.random.default_rng(7))
    points, normal = np.roll(points, axis, axis=1), np.roll(normal, axis)
    lattice = find_lattice(thin(points, edge_m), np.eye(3), normal)
    assert lattice is not None
    assert lattice.edge_m == pytest.approx(edge_m, rel=0.005)
    assert abs(lattice.axis @ np.roll([0.0, 1.0, 0.0], axis)) == 1.0
    # Lattices start at the origin; the nearest boundary counts, so far as the edge is known.
    off = np.angle(np.exp(2j * np.pi * lattice.boundary_m / edge_m)) / (2.0 * np.pi)
    assert abs(off) * edge_m < 4.0 * lattice.boundary_u_m + 0.02 * edge_m


@pytest.mark.parametrize("edge_m", [3.7e-3, 5.3e-3])
def test_lattice_is_found_where_a_face_lies_in_one_layer(edge_m):
    """The face's depths are those of one layer, whose boundaries are uncertain by what is left."""
    square = {"sigma_m": 3e-4, "toe_deg": (-0.1, 0.1), "camber_deg": (-0.1, 0.1)}
    for seed in range(4):
        points, normal = face(np.random.default_rng(seed), **square)
        points[:, 1] += 0.5 * edge_m - np.median(points[:, 1])
        thinned = nearest(points, edge_m)
        assert np.ptp(np.floor(thinned[:, 1] / edge_m)) == 0.0
        lattice = find_lattice(thinned, np.eye(3), normal)
        assert lattice.edge_m == pytest.approx(edge_m, rel=0.005)
        slack_m = edge_m - np.ptp(thinned[:, 1])
        assert abs(lattice.boundary_m) < slack_m
        assert 0.999 * slack_m < np.sqrt(12.0) * lattice.boundary_u_m < edge_m
        assert 0.02 < lattice.to_middle < 0.6


def test_lattice_along_a_rotated_pose_is_found_by_its_axes():
    points, normal = face(np.random.default_rng(7))
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    thinned = means(points, 4e-3) @ turn
    lattice = find_lattice(thinned, turn, normal @ turn)
    assert lattice is not None
    assert lattice.edge_m == pytest.approx(4e-3, rel=0.005)
    assert find_lattice(thinned, np.eye(3), normal @ turn) is None


def on_raster(points, normal):
    """Exact positions along x and z, the height of the points measured."""
    number = np.unique(np.rint(points[:, [0, 2]] / 2e-3), axis=0) * 2e-3
    height = number @ (-normal[[0, 2]] / normal[1])
    noise = np.random.default_rng(1).normal(0.0, 8e-4, len(number))
    return np.column_stack([number[:, 0], height + noise, number[:, 1]])


def beside_raster(points, normal):
    """The same, where the beams jitter by less than the noise."""
    points = on_raster(points, normal)
    return points + np.random.default_rng(2).normal(0.0, 2e-4, points.shape) * [1.0, 0.0, 1.0]


UNTHINNED = {
    "as scanned": lambda points, _: points,
    "at random": lambda points, _: points[np.random.default_rng(1).random(len(points)) < 0.1],
    "twice": lambda points, _: np.concatenate([points, points]),
    "two stations": lambda points, _: np.concatenate(
        [points, points + np.array([7e-4, 4e-3, 3e-4])]
    ),
    "a raster": on_raster,
    "a raster that jitters": beside_raster,
}


@pytest.mark.parametrize("kind", UNTHINNED)
@pytest.mark.parametrize("scan", [{}, {"incidence_deg": 0.01}, {"spacing_m": 1e-3}])
def test_no_lattice_where_none_was_used(kind, scan):
    for seed in range(4):
        points, normal = face(np.random.default_rng(seed), **scan)
        assert find_lattice(UNTHINNED[kind](points, normal), np.eye(3), normal) is None
