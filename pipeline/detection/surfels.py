"""Surfels: small flat pieces of a cloud, and the surfaces that they form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..cloud import EXACT, Steps, VoxelGrid, over_chunks, voxel_key
from ..system import frozen
from ..vectors import Array, Rows

MIN_IN_VOXEL = 5  # points, the least for a plane
BEND, MOST_BEND = np.radians([5.0, 20.0])  # between neighbours of one surface, and with noise
CACHED = 8192  # voxels whose planes are fitted at once
# From a voxel to the lowest one that touches it in each column, and how many lie above each other.
_NEIGHBOURS = (((0, 0, 1), 1), *(((i, j, -1), 3) for i, j in ((0, 1), (1, -1), (1, 0), (1, 1))))


@frozen(eq=False)
class Surfels:
    """Flat voxels and the surface that each belongs to.

    voxels: all of them. row: (S,) rows of the flat ones. centroid_m, normal: (S, 3), largest
    component of the normal positive. surface: (S,) number of the surface, from 0. count: (S,)
    points.
    """

    voxels: VoxelGrid
    row: Rows
    centroid_m: Array
    normal: Array
    surface: Rows
    count: Array

    def between(self, low_m: float, high_m: float) -> slice:
        """Return the rows of the surfels whose x may lie between; they are sorted by x."""
        return slice(*np.searchsorted(self.row, [*self.voxels.between(low_m, high_m)]).tolist())


def find_surfels(voxels: VoxelGrid, thickness_m: float, steps: Steps = EXACT) -> Surfels:
    """Find the voxels whose points lie within thickness_m (rms) of a plane; join them to surfaces.

    Two neighbours belong to one surface if their normals and their noise are alike and the centroid
    of each lies on the other's plane. A voxel across a step of a few sigma may be as flat, but is
    rougher than its neighbours; across a step of the coordinates, it is not.
    """
    row = np.nonzero(voxels.sums[:, 0] >= MIN_IN_VOXEL)[0]
    centroid, normal, spread = _planes(voxels, row)
    flat = (spread[:, 0] < thickness_m) & (spread[:, 1] > 0.1 * voxels.edge_m)
    flat &= spread[:, 0] < 0.5 * spread[:, 1]
    row, centroid, normal = row[flat], centroid[flat], normal[flat]
    centroid = centroid + voxels.middle_m[row]
    of_step = _neighbours(voxels.key[row])
    dof = voxels.sums[row, 0] - 3.0
    sigma = spread[flat, 0] * np.sqrt((dof + 3.0) / dof)
    noise, across = _local_noise(sigma, of_step), steps.across(normal)
    floor = np.maximum(0.05 * thickness_m, 0.5 * across)
    smooth = sigma < (1.6 + 1.5 / np.sqrt(dof)) * noise + floor
    slope = noise * np.sqrt(12.0 / voxels.sums[row, 0]) / voxels.edge_m
    slope = np.maximum(slope, across / voxels.edge_m)

    def joined(pairs: Rows) -> Rows:
        one, other = pairs[:, smooth[pairs].all(axis=0)]
        limit = 2.5 * np.minimum(noise[one], noise[other])
        limit += 3.0 * np.maximum(floor[one], floor[other])
        bend = np.minimum(BEND + 2.5 * np.hypot(slope[one], slope[other]), MOST_BEND)
        axes, apart = (normal[one], normal[other]), centroid[other] - centroid[one]
        alike = np.abs(np.einsum("ij,ij->i", *axes)) > np.cos(bend)
        for axis in axes:
            alike &= np.abs(np.einsum("ij,ij->i", apart, axis)) < limit
        return np.stack([one[alike], other[alike]], axis=1)

    pairs = np.concatenate([joined(pairs) for pairs in of_step])
    return Surfels(voxels, row, centroid, normal, _surfaces(len(row), pairs), voxels.sums[row, 0])


def _planes(voxels: VoxelGrid, row: Rows) -> tuple[Array, Array, Array]:
    """Return `planes_of` the points in these voxels, so many at once as stay in the cache."""
    parts = over_chunks(lambda part: planes_of(voxels.sums[row[part]]), len(row), CACHED)
    centroid, normal, spread = zip(*(parts or [planes_of(voxels.sums[:0])]), strict=True)
    return np.concatenate(centroid), np.concatenate(normal), np.concatenate(spread)


def _local_noise(sigma_m: Array, of_step: list[Rows]) -> Array:
    """Return the lower third (S,) of the noise of each surfel and its neighbours.

    Not the median, for a step may pass through many neighbours. of_step: as of `_neighbours`.
    """
    own = sigma_m.astype(np.float32)
    about = np.full((len(own), 1 + 2 * len(of_step)), np.inf, np.float32)
    about[:, 0] = own
    for k, (one, other) in enumerate(of_step, start=1):
        about[one, k] = own[other]
        about[other, -k] = own[one]
    size = np.count_nonzero(about < np.inf, axis=1)
    about.sort(axis=1)
    return np.asarray(about[np.arange(len(own)), (size - 1) // 3], dtype=float)


def planes_of(sums: Array) -> tuple[Array, Array, Array]:
    """Fit planes to groups of points by their sums (G, 10).

    Return centroids, normals (G, 3), and the spread (G, 2) across the plane and along its narrower
    direction, standard deviations in metres.

    Eigenvalues in closed form (Smith, CACM 4 (1961) 168), to about 1e-8 of the largest.
    """
    count = sums[:, 0]
    centroid = sums[:, 1:4] / count[:, None]
    x, y, z = centroid.T
    xx, xy, yy, xz, yz, zz = (sums[:, 4:] / count[:, None]).T
    xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
    xz, yz, zz = xz - x * z, yz - y * z, zz - z * z
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    size = np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    size = np.maximum(size, 1e-90)
    half = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = np.arccos(np.clip(half / (2.0 * size**3), -1.0, 1.0)) / 3.0
    most = mean + 2.0 * size * np.cos(angle)
    least = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    middle = 3.0 * mean - most - least
    rows = np.stack(
        [
            np.stack([xx - least, xy, xz], axis=1),
            np.stack([xy, yy - least, yz], axis=1),
            np.stack([xz, yz, zz - least], axis=1),
        ],
        axis=1,
    )
    crosses = np.cross(rows, np.roll(rows, -1, axis=1))
    length = np.linalg.norm(crosses, axis=2)
    best = np.argmax(length, axis=1)
    each = np.arange(len(sums))
    normal = crosses[each, best] / np.maximum(length[each, best], 1e-300)[:, None]
    largest = normal[each, np.argmax(np.abs(normal), axis=1)]
    normal *= np.where(largest < 0.0, -1.0, 1.0)[:, None]
    spread = np.sqrt(np.clip(np.stack([least, middle], axis=1), 0.0, None))
    return centroid, normal, spread


def _neighbours(key: Rows) -> list[Rows]:
    """Return the pairs (2, P) of rows of sorted keys (S,) whose voxels touch, for each step."""
    ended, of_axes = np.append(key, -1), voxel_key(np.eye(3, dtype=np.int64))
    pairs = []
    for lowest, levels in _NEIGHBOURS:
        wanted = key + np.dot(lowest, of_axes)
        found = np.searchsorted(key, wanted)
        for level in range(levels):
            touches = ended[found] == wanted + level
            there = np.nonzero(touches)[0]
            pairs.append(np.stack([there, found[there]]))
            found += touches
    return pairs


def _surfaces(count: int, pairs: npt.NDArray[np.int64]) -> Rows:
    """Return the number (count,) of the connected part that each belongs to."""
    label = np.arange(count)
    while len(pairs):
        one, other = label[pairs].T
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(label, up := label[label]):
            label = up
        one, other = label[pairs].T
        pairs = pairs[one != other]
    return np.asarray(np.unique(label, return_inverse=True)[1])
