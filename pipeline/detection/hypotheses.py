"""Candidate positions of the target on the flat surfaces of a cloud."""

from __future__ import annotations

import math

import numpy as np

from ..system import frozen
from ..targets import Target
from ..vectors import Array, Rows, plane_basis
from . import template_match
from .surfels import Surfels

EDGE_OF_RADIUS = 0.25  # of a voxel
MIN_SCORE = 0.12  # an eighth of the target, alone
MIN_SURFELS = 4
TWO_LEVELS = 5.0  # between the means of two levels, over the spread within; of one, 2.6 to 3.5
LEVEL_ROUNDS = 4
MANY_TARGETS = 30.0  # as large as a wall: not searched for two levels
PIECES_REACH = 1.8  # of the radius: how far from one piece of a target the others may lie
ALIGNED, SAME_DEPTH = 0.9, 0.08  # cosine, and of the radius: two positions on one plane


@frozen(eq=False)
class Hypothesis:
    """Candidate position of the target: centre, normal (sign free), and score of the surface."""

    centre_m: Array
    normal: Array
    score: float


def hypotheses(surfels: Surfels, target: Target, floor: float = MIN_SCORE) -> list[Hypothesis]:
    """Find candidate positions on single surfaces with score > floor, best first, no duplicates.

    A surface scores no more than the share of the target that it could fill. At a floor above the
    lowest, surfaces of two levels are not split.
    """
    area_m2 = target.region.area_m2
    whole = area_m2 / surfels.voxels.edge_m**2
    least = max(MIN_SURFELS, int(0.7 * floor * whole))
    order = np.argsort(surfels.surface, kind="stable")
    size = np.bincount(surfels.surface)
    surfaces = [rows for rows in np.split(order, np.cumsum(size)[:-1]) if len(rows) >= least]
    if floor <= MIN_SCORE:
        surfaces = [part for rows in surfaces for part in _levels(surfels, rows, whole)]
    found = [h for rows in surfaces for h in _on_surface(surfels, rows, target, floor)]
    return _apart(sorted(found, key=lambda h: -h.score), target.radius_m)


def joined(
    positions: list[Hypothesis], surfels: Surfels, target: Target, limit_m: float
) -> list[Hypothesis]:
    """Join the positions with all surfels in their planes, such as the other side of a shadow.

    limit_m: distance within which a surfel lies in the plane.
    """
    whole = [_with_other_pieces(at, surfels, target, limit_m) for at in positions]
    return _apart(sorted(whole, key=lambda h: -h.score), target.radius_m)


def _levels(surfels: Surfels, rows: Rows, whole: float) -> list[Rows]:
    """Return the surface, and its upper and lower level where it has two.

    Single links may join surfaces across a step. whole: surfels of a target; surfaces about as
    large, or many times larger, are not split. Two parallel planes are fitted and the surfels
    assigned to them, alternately; two levels lie far apart compared with the spread within.
    """
    if not 1.2 * whole < len(rows) < MANY_TARGETS * whole:
        return [rows]
    local = surfels.centroid_m[rows] - surfels.centroid_m[rows[0]]
    u, v, depth = plane_basis(_mean_direction(surfels.normal[rows])) @ local.T
    flat = np.stack([np.ones_like(u), u, v], axis=1)
    above = np.zeros(len(rows))
    for _ in range(LEVEL_ROUNDS):
        b = np.linalg.lstsq(np.column_stack([flat, above]), depth, rcond=None)[0]
        above, apart, within = _two_groups(depth - b[1] * u - b[2] * v)
    if apart < TWO_LEVELS * within:
        return [rows]
    return [rows, rows[above == 0.0], rows[above == 1.0]]


def _two_groups(depth: Array) -> tuple[Array, float, float]:
    """Split depth (S,) into the two groups with the least spread within (Otsu).

    Return 1 or 0 for each, the distance of the groups' means, and the spread within.
    """
    order = np.argsort(depth, kind="stable")
    ranked = depth[order] - depth.mean()
    total = len(ranked)
    below = np.arange(1.0, total)
    lower = np.cumsum(ranked)[:-1]
    apart = -lower / below - lower / (total - below)  # the total is 0
    within = float(ranked @ ranked) - below * (total - below) / total * apart**2
    cut = int(np.argmin(within[MIN_SURFELS - 1 : total - MIN_SURFELS])) + MIN_SURFELS
    above = np.zeros(total)
    above[order[cut:]] = 1.0
    return above, float(apart[cut - 1]), math.sqrt(max(float(within[cut - 1]), 0.0) / total)


def _mean_direction(normal: Array) -> Array:
    """Return the mean direction of normals (S, 3) of arbitrary signs."""
    mean = (normal * np.where(normal @ normal[0] < 0.0, -1.0, 1.0)[:, None]).mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def _on_surface(
    surfels: Surfels, rows: Rows, target: Target, floor: float = MIN_SCORE
) -> list[Hypothesis]:
    """Find candidate positions on one surface, projected along its mean normal."""
    centroid, count = surfels.centroid_m[rows], surfels.count[rows]
    if float(np.ptp(centroid, axis=0).max()) < 0.35 * target.radius_m:
        return []
    basis = plane_basis(_mean_direction(surfels.normal[rows]))
    normal = surfels.normal[rows]
    normal = normal * np.where(normal @ basis[2] < 0.0, -1.0, 1.0)[:, None]
    middle = np.median(centroid, axis=0)
    uv = (centroid - middle) @ basis[:2].T
    edge = surfels.voxels.edge_m
    found = []
    for position, score in template_match.peaks(
        uv, edge, target.region, target.turn_period_rad, target.radius_m, floor
    ):
        near = np.sum((uv - position) ** 2, axis=1) < target.radius_m**2
        if not near.any():
            continue
        weight = count[near] / count[near].sum()
        axis = weight @ normal[near]
        axis /= np.linalg.norm(axis)
        centre = middle + position @ basis[:2]
        centre = centre + axis * float(weight @ ((centroid[near] - centre) @ axis))
        found.append(Hypothesis(centre, axis, score))
    return found


def _with_other_pieces(
    at: Hypothesis, surfels: Surfels, target: Target, limit_m: float
) -> Hypothesis:
    """Join a position with the other surfels in its plane if that scores better."""
    reach = PIECES_REACH * target.radius_m
    rows = surfels.between(at.centre_m[0] - reach, at.centre_m[0] + reach)
    offset = surfels.centroid_m[rows] - at.centre_m
    near = np.einsum("ij,ij->i", offset, offset) < reach**2
    near &= np.abs(surfels.normal[rows] @ at.normal) > ALIGNED
    near &= np.abs(offset @ at.normal) < limit_m
    pieces = rows.start + np.nonzero(near)[0]
    others = _on_surface(surfels, pieces, target) if len(pieces) >= MIN_SURFELS else []
    close = [h for h in others if _distance(h, at) < 0.7 * target.radius_m]
    return max([at, *close], key=lambda h: h.score)


def _distance(one: Hypothesis, other: Hypothesis) -> float:
    return float(np.linalg.norm(one.centre_m - other.centre_m))


def _apart(found: list[Hypothesis], radius_m: float) -> list[Hypothesis]:
    """Remove duplicates, keeping the best; found: best first."""
    centre = np.array([h.centre_m for h in found]).reshape(-1, 3)
    normal = np.array([h.normal for h in found]).reshape(-1, 3)
    kept: list[int] = []
    for k in range(len(found)):
        offset = centre[kept] - centre[k]
        same = np.abs(normal[kept] @ normal[k]) > ALIGNED
        same &= np.abs(offset @ normal[k]) < SAME_DEPTH * radius_m
        same &= np.einsum("ij,ij->i", offset, offset) < (0.5 * radius_m) ** 2
        if not same.any():
            kept.append(k)
    return [found[k] for k in kept]
