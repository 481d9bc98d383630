"""Pull of a voxel lattice on a plane along its layers, fitted with the plane and removed.

Of a thinned face each cell holds one point, that of few and that of many alike. Where the face lies
within its noise of the boundary of two layers, each layer holds the part of the noise on its side,
and the mean of both lies between the face and that boundary. The mean height of points where the
face has the depth d is so d + b(d): b has the period of the lattice, and is odd about a boundary,
by the symmetry of noise and cells. With p_k the share of the noise in layer k, m_k its mean there
and n points a column before thinning, b = sum w_k m_k / sum w_k - d, w_k = 1 - (1 - p_k)^n. Of the
points nearest to the middles of their cells those near the middle of the layer are kept more often:
m_k lies nearer to it by a part q of its distance. Of Gaussian noise s and N points per square metre
q = k / (1 + k), k = 2 pi N s^2, and N follows from how far the kept points lie from the middles
along the face (lattice.py). Neither n nor how a program chose is known: b is the sum of this form
for few and for many points, in shares near a half, of the pull to the middle by none to all of q,
and of a smooth odd rest, each with its prior. Where the face lies in one layer nothing separates b
from a tilt: none is removed, and k times the tilt is in the covariance.
"""

from __future__ import annotations

import numpy as np

from ...cloud import VoxelLattice
from ...system import frozen
from ...vectors import Array
from ..correlated_noise import erf

TABLE = 200  # depths in a layer
LAYERS = np.arange(-4, 5)
POINTS = (2.0, 6.0)  # a column before thinning: forms between which others lie
SHARE, SHARE_U = 0.5, 0.3  # prior of each form
NEAREST, NEAREST_U = 0.5, 0.6  # prior of the pull to the middle: 0 of means, 1 of nearest points
REST_TO_MIDDLE = 0.1  # what that pull leaves to the longest wave of the rest
REST, REST_LENGTH = 0.2, 0.7  # prior of the rest: its size and length, of the noise
LEAST_REST = 1e-3  # prior variance of a wave of the rest, of the longest
WAVES = 15
STEPS, SETTLED = 60, 1e-3  # of Gauss-Newton; the size of the last, by its u
LEAST_SLOPE = 0.05  # of the mean height by the plane's


@frozen(eq=False)
class Thinning:
    """Effect of a voxel lattice on a plane.

    edge_m: of a cell. covariance: (3, 3) what fitting its pull adds to that of the height (m) at
    the centroid and of the slopes along u and v.
    """

    edge_m: float
    covariance: Array


@frozen(eq=False)
class LatticePull:
    """Pull of a lattice, fitted together with a plane z = h + slopes . (xy - middle).

    z: along the lattice's axis; xy: along the other two of the axes (3, 3). plane: (3,) h and
    slopes. table_m: (TABLE,) pull by the depth in a layer, of which one starts at boundary_m.
    added: (3, 3) what fitting the pull adds to the covariance of the plane.
    """

    lattice: VoxelLattice
    axes: Array
    middle_m: Array
    plane: Array
    boundary_m: float
    table_m: Array
    added: Array

    def levelled(self, points_m: Array) -> Array:
        """Return points_m (N, 3) without the pull."""
        terms = _terms(points_m @ self.axes[1:].T - self.middle_m)
        pull_m = _between(self.table_m, terms @ self.plane - self.boundary_m, self.lattice.edge_m)
        return np.asarray(points_m - pull_m[:, None] * self.axes[0])

    def thinning(self, centroid_m: Array, basis: Array) -> Thinning:
        """Return the effect on the plane through centroid_m (3,) with that basis (3, 3)."""
        carried = np.zeros((3, 3))
        carried[0, 0] = 1.0
        carried[0, 1:] = self.axes[1:] @ centroid_m - self.middle_m
        carried[1:, 1:] = basis[:2] @ self.axes[1:].T
        carried *= abs(float(basis[2] @ self.axes[0]))
        return Thinning(self.lattice.edge_m, carried @ self.added @ carried.T)


def fit_pull(points_m: Array, lattice: VoxelLattice, axes: Array) -> LatticePull:
    """Fit plane and pull together to the points_m (N, 3) of a face thinned on a lattice.

    Least squares with the priors of the pull, by Gauss-Newton; a step that leads back is
    halved. The depth at which each point is pulled follows the plane. In one layer nothing shows
    whether there is one: the plane is that of the points, and what they would be off counts. axes:
    (3, 3) rows, of which one is the lattice's.
    """
    own = int(np.argmax(np.abs(axes @ lattice.axis)))
    axes = np.roll(axes, -own, axis=0)
    depth_m, xy = points_m @ axes[0], points_m @ axes[1:].T
    middle = xy.mean(axis=0)
    terms = _terms(xy - middle)
    plane = np.linalg.lstsq(terms, depth_m, rcond=None)[0]
    if lattice.layers == 1:
        added, none = _unseen(lattice, plane), np.zeros(TABLE)
        return LatticePull(lattice, axes, middle, plane, lattice.boundary_m, none, added)
    columns, mean, variance = _forms(lattice)
    by_depth = (np.roll(columns, -1, axis=0) - np.roll(columns, 1, axis=0)) * TABLE / 2.0
    by_depth /= lattice.edge_m
    pull, last = mean.copy(), np.zeros(3 + len(mean))
    for _ in range(STEPS):
        height_m = terms @ plane
        above_m = height_m - lattice.boundary_m - pull[-1]
        here = _between(columns, above_m, lattice.edge_m)
        rest = depth_m - height_m - here @ pull[:-1]
        steep = _between(by_depth @ pull[:-1], above_m, lattice.edge_m)
        slope = (1.0 + steep).clip(min=LEAST_SLOPE)
        by_all = np.column_stack([terms * slope[:, None], here, -steep])
        white = float(rest @ rest) / (len(rest) - 3)
        information = by_all.T @ by_all / white
        information[3:, 3:] += np.diag(1.0 / variance)
        gradient = by_all.T @ rest / white
        gradient[3:] -= (pull - mean) / variance
        step = np.linalg.solve(information, gradient)
        if step @ gradient < SETTLED**2:
            break
        if last @ information @ step < 0.0:
            step /= 2.0
        last = step
        plane, pull = plane + step[:3], pull + step[3:]
    added = np.linalg.inv(information)[:3, :3] - white * np.linalg.inv(terms.T @ terms)
    boundary = lattice.boundary_m + float(pull[-1])
    table = columns @ pull[:-1]
    return LatticePull(lattice, axes, middle, plane, boundary, table, _positive(added))


def _unseen(lattice: VoxelLattice, plane: Array) -> Array:
    """Return the covariance (3, 3) of what a plane in one layer is off, if its points were chosen.

    The layer may lie higher or lower than its middle shows by the uncertainty of its boundary.
    """
    part = lattice.to_middle / (1.0 - lattice.to_middle)
    off = np.zeros((3, 3))
    off[0, 0] = lattice.boundary_u_m**2
    off[1:, 1:] = np.outer(plane[1:], plane[1:])
    return np.asarray(part**2 * off)


def _forms(lattice: VoxelLattice) -> tuple[Array, Array, Array]:
    """Return columns (TABLE, K) of a pull by depth, and means and variances (K + 1,) of the priors.

    The last prior is that of the boundary's position.
    """
    noise = lattice.noise_m / lattice.edge_m
    depth = np.arange(TABLE) / TABLE
    wave = np.arange(1, WAVES + 1)
    size = np.exp(-((2.0 * np.pi * REST_LENGTH * noise * wave) ** 2) / 2.0)
    wave = wave[size > LEAST_REST * size[0]]
    size = size[: len(wave)] / size[: len(wave)].sum()
    forms = [_form(depth, noise, points) for points in POINTS]
    forms.append(_form(depth, noise, POINTS[-1], lattice.to_middle) - forms[-1])
    columns = [form * lattice.edge_m for form in forms]
    columns += [np.sin(2.0 * np.pi * number * depth) for number in wave]
    mean = np.zeros(len(columns) + 1)
    mean[: len(forms)] = *([SHARE] * len(POINTS)), NEAREST
    rest = 2.0 * (REST * noise * lattice.edge_m) ** 2 * size
    rest[0] += (REST_TO_MIDDLE * lattice.to_middle * lattice.edge_m) ** 2
    boundary = lattice.boundary_u_m**2
    of_forms = [*([SHARE_U**2] * len(POINTS)), NEAREST_U**2]
    variance = np.concatenate([of_forms, rest, [boundary]])
    return np.column_stack(columns), mean, variance


def _form(depth: Array, noise: float, points: float, to_middle: float = 0.0) -> Array:
    """Return the pull (D,) at depths (D,) in a layer, for that many points a column, in cells.

    to_middle: part of its distance by which the mean in a layer lies nearer to the layer's middle.
    """
    low = (LAYERS - depth[:, None]) / noise
    high = low + 1.0 / noise
    share = (_cumulative(high) - _cumulative(low)).clip(min=0.0)
    moment = noise * (_density(low) - _density(high))
    weight = 1.0 - (1.0 - share) ** points
    seen = share > 1e-12
    off = np.divide(moment, share, out=np.zeros_like(share), where=seen)
    off -= to_middle * (depth[:, None] + off - LAYERS - 0.5)
    return np.asarray((weight * seen * off).sum(axis=1) / weight.sum(axis=1))


def _cumulative(x: Array) -> Array:
    return 0.5 + 0.5 * erf(x.ravel() / np.sqrt(2.0)).reshape(x.shape)


def _density(x: Array) -> Array:
    return np.asarray(np.exp(-x * x / 2.0) / np.sqrt(2.0 * np.pi))


def _terms(xy_m: Array) -> Array:
    return np.column_stack([np.ones(len(xy_m)), xy_m])


def _between(table: Array, depth_m: Array, edge_m: float) -> Array:
    """Return a table (TABLE, ...) at depths (N,) from a boundary, linear between its rows."""
    place = depth_m / edge_m * TABLE
    below = np.floor(place)
    row = below.astype(np.int64) % TABLE
    rise = (np.roll(table, -1, axis=0) - table)[row]
    return np.asarray(table[row] + ((place - below) * rise.T).T)


def _positive(covariance: Array) -> Array:
    """Return a covariance (3, 3) without what is negative of it, at heights scaled to slopes."""
    scale = np.sqrt(np.abs(np.diag(covariance)).clip(min=1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(values.clip(min=0.0))
    return np.asarray(root @ root.T)
