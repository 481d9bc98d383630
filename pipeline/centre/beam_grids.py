"""Grids of beams on a target, by which points of merged scans show their stations in any order.

A scanner numbers its beams along two ways, by steps of two angles. Both numbers are smooth
functions of where a beam meets the plane of a target: whole numbers at the points of that scan, and
any number at those of another. So each grid is found by two waves of the points near the middle,
and followed outwards by polynomials. A point p at height w over the plane lies on the beam that
meets the plane at (p - w b) / (1 - w h), with b the slope of the beam through the origin and h the
inverse distance of the scanner, which points farther and farther off the plane show.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from ..cloud import scattered
from ..plane import nearest, strong_waves
from ..system import frozen
from ..vectors import Array, Mask, Rows
from .layers import alike

MOST = 4  # grids
ON = 0.25  # of a step: how far off a grid its points may lie, along either way
# Share of the points left that lie on a grid, four stations: 0.45, of 700 by chance: 0.33; how much
# more than CHANCE it is at least, times the root of their number.
HELD, BY_FEW = 0.4, 3.0
REST = 0.05  # of the points: fewer are of no further grid
CHANCE = 4.0 * ON**2  # share of points on no grid that seem to lie on one
ONCE = 0.8  # of its points, of a beam of their own; on steps of rounding, several share a number
PARTS, PARALLEL = 6.0, 0.003  # of a step: halves and thirds; how exactly
BESIDE = 0.03  # how far neighbours are of one grid: points of grids keep apart, each from its own
ALL = 0.85  # of the points that the other grids leave: on the last
LEAST_POINTS, FEW = 100, 30  # of a grid; around the target, to be a proof
CLEAR = 0.03  # least power of a wave
BOTH = 0.01  # the same of the weakest of two waves, their sum and difference, squared, by the most
# Points near the middle and the shortest wave, in their mean distances, that are tried. Far apart,
# fewer points are as on a grid of one spacing; thinned ones are far apart on their grid.
LOOKS = ((350, 0.6), (350, 0.35), (120, 0.35))
SQUARE = 0.5  # least sine of the angle between both waves
DEGREE = 3  # of the polynomials: angles over a target have no more
WIDER, DEEPER = 1.3, 1.6  # steps by which a grid is followed outwards, and off the plane
FITTED, STEPS = 3000, 3  # points that are enough; steps of Gauss and Newton
FLAT_M, DEEP_M, BESIDE_M = 0.005, 0.8, 0.03  # heights; farthest beyond the target
PRIOR, PRIOR_U = 0.5, 0.5  # inverse distance of a scanner, 1/m
LEAST_SD = 0.01  # of a step
OWN, LEAST_WITHIN = 4.5, 0.03  # of their median; steps: how far off a grid its own points lie


@frozen(eq=False)
class BeamGrid:
    """Grid of a scanner's beams on a plane.

    numbers: (K, 2) coefficients of both numbers, of the powers of u and v in `unit_m`. beam: (2,)
    slope b; inverse_distance: h, 1/m.
    """

    numbers: Array
    unit_m: float
    beam: Array
    inverse_distance: float

    def feet(self, uvw_m: Array) -> Array:
        """Return where the beams of points uvw_m (N, 3) meet the plane (N, 2), in units."""
        w = uvw_m[:, 2]
        narrow = self.unit_m * (1.0 - self.inverse_distance * w)
        return np.asarray((uvw_m[:, :2] - np.outer(w, self.beam)) / narrow[:, None])

    def of_beams(self, uvw_m: Array) -> Array:
        """Return both numbers (N, 2) of the beams of points uvw_m (N, 3), whole on the grid."""
        return np.asarray(_powers(self.feet(uvw_m), len(self.numbers)) @ self.numbers)

    def off(self, uvw_m: Array) -> Array:
        """Return how far points uvw_m (N, 3) lie off the grid (N, 2), in steps: within 1/2."""
        numbers = self.of_beams(uvw_m)
        return np.asarray(numbers - np.rint(numbers))

    @property
    def steps(self) -> Array:
        """Steps (2, 2) of both numbers by one metre along u and v, at the middle."""
        return np.asarray(self.numbers[1:3].T / self.unit_m)

    def is_seen_once(self, uvw_m: Array) -> bool:
        """Return whether nearly all points uvw_m (N, 3) are of beams of their own."""
        beams = np.unique(np.rint(self.of_beams(uvw_m)), axis=0)
        return len(beams) > ONCE * len(uvw_m)

    def meets_within(self, uvw_m: Array, reach_m: float) -> Mask:
        """Return which beams of points uvw_m (N, 3) meet the plane so near to the middle."""
        return np.asarray(np.hypot(*self.feet(uvw_m).T) * self.unit_m < reach_m)

    def holds(self, uvw_m: Array) -> Mask:
        """Return which of points uvw_m (N, 3) lie on the grid."""
        return np.asarray((np.abs(self.off(uvw_m)) < ON).all(axis=1))


def beam_grids(face_m: Array, around_m: Array) -> list[BeamGrid]:
    """Return the grids on which nearly all points lie, where they are several; else none.

    face_m: (N, 3) points on the target, in its axes about its middle; around_m: (M, 3) others.
    The last must hold nearly all that the others leave, on the target and around: parts of one scan
    thinned on voxels may pass for grids, but less closely, and not off the plane.
    """
    found: list[BeamGrid] = []
    left, share = face_m, 0.0
    while len(found) < MOST and len(left) > max(REST * len(face_m), LEAST_POINTS):
        grid = _found(left)
        on = np.zeros(len(left), bool) if grid is None else grid.holds(left)
        share = float(np.mean(on))
        if grid is None or share < max(HELD, CHANCE + BY_FEW / math.sqrt(len(left))):
            break
        found.append(grid)
        left = left[~on]
    if len(found) < 2 or share < ALL:
        return []
    of = nearest_grid(found, face_m)
    once = all(grid.is_seen_once(face_m[of == k]) for k, grid in enumerate(found))
    if not once or alike(face_m[:, :2], of) > BESIDE or of_one_scanner(found):
        return []
    reach_m = float(np.hypot(*face_m[:, :2].T).max()) + BESIDE_M
    grids, near = [], np.zeros(0, bool)
    for grid in found:
        on = grid.holds(face_m)
        grid = _off_plane(grid, face_m[on], around_m, reach_m)
        face_m = face_m[~on]
        on = grid.holds(around_m)
        near = on[grid.meets_within(around_m, reach_m)]
        around_m = around_m[~on]
        grids.append(grid)
    return grids if len(near) < FEW or np.mean(near) > ALL else []


def of_one_scanner(grids: list[BeamGrid]) -> bool:
    """Return whether two of the grids are parts of one: their steps are whole parts of each other.

    So are those of every other beam, or line, as voxels or a drive with some play leave them.
    """
    for one, other in combinations(grids, 2):
        parts = PARTS * other.steps @ np.linalg.inv(one.steps)
        if (np.abs(parts - np.rint(parts)) < PARTS * PARALLEL).all():
            return True
    return False


def nearest_grid(grids: list[BeamGrid], uvw_m: Array) -> Rows:
    """Return the index of the grid that each of points uvw_m (N, 3) is least off."""
    off = np.stack([np.sum(grid.off(uvw_m) ** 2, axis=1) for grid in grids])
    return np.asarray(np.argmin(off, axis=0))


def _found(face_m: Array) -> BeamGrid | None:
    """Return the clearest grid of points face_m (N, 3), or None."""
    start = face_m[np.argmin(np.sum(face_m[:, :2] ** 2, axis=1))] * [1.0, 1.0, 0.0]
    for count, shortest in LOOKS:
        some = nearest(face_m - start, count)
        waves = _clearest(some, shortest)
        if waves is not None:
            break
    else:
        return None
    reach = np.hypot(*(face_m - start)[:, :2].T)
    unit_m = float(reach.max())
    along = waves[:, :2] / math.tau
    phase = np.exp(1j * (some @ (waves * [1.0, 1.0, -1.0]).T)).mean(axis=0)
    at_start = -np.angle(phase) / math.tau - along @ start[:2]
    numbers = np.vstack([at_start, along.T * unit_m])
    beam = np.asarray(np.linalg.solve(waves[:, :2], waves[:, 2]))
    grid = BeamGrid(numbers, unit_m, beam, PRIOR)
    radius = float(np.hypot(*some[:, :2].T).max())
    for degree in range(1, DEGREE + 1):
        grid = _fitted(grid, face_m[reach < radius], degree)
        radius = min(WIDER * radius, unit_m)
    while radius < unit_m:
        grid = _fitted(grid, face_m[reach < radius], DEGREE)
        radius *= WIDER
    return _fitted(grid, face_m, DEGREE)


def _clearest(some_m: Array, shortest: float) -> Array | None:
    """Return the two waves (2, 3) of the clearest grid of some points (N, 3), or None.

    shortest: wave, in mean distances of the points. Of two waves of one grid, the sum and the
    difference are clear as well; a wave much stronger than those is shared by several grids.
    """
    waves = strong_waves(some_m, CLEAR, shortest)
    best, found = BOTH, None
    for i, one in enumerate(waves):
        for other in waves[:i]:
            sine = abs(one[0] * other[1] - one[1] * other[0])
            if sine < SQUARE * np.hypot(*one[:2]) * np.hypot(*other[:2]):
                continue
            four = np.stack([one, other, one + other, one - other]) * [1.0, 1.0, -1.0]
            power = np.abs(np.exp(1j * (some_m @ four.T)).mean(axis=0)) ** 2
            score = float(power.min() ** 2 / power.max())
            if score > best:
                best, found = score, np.stack([one, other])
    return found


def _off_plane(grid: BeamGrid, face_m: Array, around_m: Array, reach_m: float) -> BeamGrid:
    """Fit a grid of the plane to points around the target as well, ever farther off the plane."""
    depth = np.abs(around_m[:, 2])
    height = FLAT_M
    while height < DEEP_M:
        near = around_m[depth < height]
        near = near[grid.meets_within(near, reach_m)]
        grid = _fitted(grid, np.concatenate([_few(face_m), _few(near)]), DEGREE)
        height *= DEEPER
    return grid


def _few(points_m: Array) -> Array:
    return np.asarray(points_m[scattered(len(points_m), FITTED)])


def _fitted(grid: BeamGrid, uvw_m: Array, degree: int) -> BeamGrid:
    """Fit a grid, with polynomials of that degree, to those of points uvw_m (N, 3) that lie on it.

    Least squares by Gauss and Newton; the beam and the distance have priors.
    """
    uvw_m, count = _few(uvw_m), (degree + 1) * (degree + 2) // 2
    numbers = np.zeros((count, 2))
    numbers[: len(grid.numbers)] = grid.numbers[:count]
    grid = BeamGrid(numbers, grid.unit_m, grid.beam, grid.inverse_distance)
    within: Array | float = ON
    for _ in range(STEPS):
        off = grid.off(uvw_m)
        held = (np.abs(off) < within).all(axis=1)
        if not held.any():
            break
        on, off = uvw_m[held], off[held]
        # What lies on it by chance would pull it: of the points as near as its own, it is little.
        within = np.clip(OWN * np.median(np.abs(off), axis=0), LEAST_WITHIN, ON)
        feet = grid.feet(on)
        w = on[:, 2] / grid.unit_m
        powers = _powers(feet, count)
        by_feet = np.stack([s @ grid.numbers for s in _slopes(feet, count)], axis=2)  # (N, 2, 2)
        shared = [-by_feet[:, :, 0] * w[:, None], -by_feet[:, :, 1] * w[:, None]]
        shared += [np.einsum("nij,nj->ni", by_feet, feet) * on[:, 2:]]
        by_shared = np.stack(shared, axis=2)  # (N, 2, 3): the slope of the beam, and h
        variance = max(float(np.mean(off**2)), LEAST_SD**2)
        size = 2 * count + 3
        information, gradient = 1e-9 * np.eye(size), np.zeros(size)
        information[-1, -1] += 1.0 / PRIOR_U**2
        gradient[-1] = (PRIOR - grid.inverse_distance) / PRIOR_U**2
        for way in range(2):
            rows = [*range(way * count, (way + 1) * count), *range(2 * count, size)]
            by_all = np.hstack([powers, by_shared[:, way]])
            information[np.ix_(rows, rows)] += by_all.T @ by_all / variance
            gradient[rows] -= by_all.T @ off[:, way] / variance
        step = np.linalg.solve(information, gradient)
        grid = BeamGrid(
            grid.numbers + step[: 2 * count].reshape(2, count).T,
            grid.unit_m,
            grid.beam + step[-3:-1],
            max(grid.inverse_distance + float(step[-1]), 0.0),
        )
    return grid


def _exponents(count: int) -> list[tuple[int, int]]:
    """Return the exponents of u and v in the first `count` terms of a polynomial."""
    terms = [(n - j, j) for n in range(DEGREE + 1) for j in range(n + 1)]
    return terms[:count]


def _powers(feet: Array, count: int) -> Array:
    """Return the terms (N, count) of a polynomial at feet (N, 2)."""
    u, v = _to_degree(feet)
    return np.stack([u[i] * v[j] for i, j in _exponents(count)], axis=1)


def _slopes(feet: Array, count: int) -> tuple[Array, Array]:
    """Return the derivatives (N, count) of these terms by u and by v."""
    u, v = _to_degree(feet)
    terms = _exponents(count)
    by_u = np.stack([i * u[max(i - 1, 0)] * v[j] for i, j in terms], axis=1)
    by_v = np.stack([j * u[i] * v[max(j - 1, 0)] for i, j in terms], axis=1)
    return by_u, by_v


def _to_degree(feet: Array) -> tuple[list[Array], list[Array]]:
    """Return the powers (N,) of u and of v at feet (N, 2), from 0 to the degree."""
    u, v = ([np.ones(len(feet)), x] for x in feet.T)
    for one in (u, v):
        for _ in range(DEGREE - 1):
            one.append(one[-1] * one[1])
    return u, v
