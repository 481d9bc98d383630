"""Points of a disc as scanned, and thinned on a voxel grid or to a least distance."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

CENTRE_M = np.array([0.1, 0.75, 0.3])


def face(
    rng,
    sigma_m=8e-4,
    spacing_m=2e-3,
    yaw_deg=0.0,
    incidence_deg=15.0,
    toe_deg=(-0.5, 0.5),
    camber_deg=(-1.8, 1.5),
):
    """Points (N, 3) of a disc near CENTRE_M that faces y, of a grid of beams; its normal (3,)."""
    toe, camber = np.radians([yaw_deg + rng.uniform(*toe_deg), rng.uniform(*camber_deg)])
    normal = np.array([np.sin(toe), np.cos(toe), -np.tan(camber)])
    normal /= np.linalg.norm(normal)
    first = np.cross([0.0, 0.0, 1.0], normal)
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    way, tilt = rng.uniform(0.0, 2.0 * np.pi), np.radians(incidence_deg)
    beam = np.cos(tilt) * normal + np.sin(tilt) * np.array([np.cos(way), np.sin(way)]) @ axes
    side = np.cross(beam, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    grid = np.arange(-0.15, 0.15, spacing_m) + rng.uniform(0.0, spacing_m)
    a, b = (each.reshape(-1, 1) for each in np.meshgrid(grid, grid))
    points = a * side + b * np.cross(side, beam)
    points -= (points @ normal / (beam @ normal))[:, None] * beam
    points = points[np.hypot(*(axes @ points.T)) < 0.125]
    points += rng.normal(0.0, sigma_m, (len(points), 1)) * beam
    return points + CENTRE_M + rng.uniform(-0.01, 0.01, 3), normal


def means(points, edge_m):
    """One point a cell: the mean of its points, as of Open3D and PCL."""
    cell = np.floor(points / edge_m).astype(int)
    _, own, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(own.ravel(), axis) / count for axis in points.T], axis=1)


def nearest(points, edge_m):
    """One point a cell: the one nearest to its middle, as of the octree of CloudCompare."""
    cell = np.floor(points / edge_m).astype(int)
    order = np.argsort(np.linalg.norm(points - (cell + 0.5) * edge_m, axis=1))
    return points[order[np.unique(cell[order], axis=0, return_index=True)[1]]]


def least_distance(points, distance_m):
    """Rows of points (N, 3) that are left where each takes those within the distance away."""
    kept = np.ones(len(points), bool)
    for k, others in enumerate(KDTree(points).query_ball_point(points, distance_m)):
        if kept[k]:
            kept[others] = False
            kept[k] = True
    return np.flatnonzero(kept)
