"""Edges of a target that no crop of the scan can have cut.

Where a scan, or its crop, ends across a plate, the points end in a straight line as they do at an
edge, but nothing lies beyond. An edge is held for one where a background lies beyond it, or where
it and the opposite one end alike: a crop hardly ever leaves just the stated size. A round crop,
drawn along the plane's normal about a disc, ends target and background at one place, whereas beams
that pass an edge meet the background elsewhere.
"""

from __future__ import annotations

import numpy as np

from ..targets import Outline, sector
from ..vectors import Array, Mask, turned
from .edge.beams import CENTRE, ROTATION, carry
from .outline_fit import EROSION_M, SECTORS, ends_m

BEYOND_M = 0.005  # outside the edge, where points show a background
ALIKE = 0.98  # cosine between edges that face alike
# Of a round edge; points beyond one that show it whole; that a crop cuts; share that is all of it.
ARCS, LEAST_BEYOND, LEAST_ARCS, NEARLY_ALL = 24, 2, 3, 0.9
LEAST_ALONG = 1.0 / 3.0  # of the sectors of edges that face alike, in which points have to show it


def uncut_sectors(
    near: Array, face: Array, outline: Outline, state: Array, band_m: float, spacing_m: float
) -> Mask | None:
    """Return the sectors (SECTORS,) of edges that no crop can have cut; None: all, or unknown.

    Unknown where no edge has a background. near: points (N, 3) about the outline, in the plane's
    coordinates; face: those on the target (M, 2). state: (16,) of the edge, as in beams.py; the
    target's points lie within band_m of its plane, spacing_m apart.
    """
    if not outline.shows_rotation:
        return None
    facing = (normals := outline.normals((np.arange(SECTORS) + 0.5) / SECTORS)) @ normals.T
    along, opposite = facing > ALIKE, facing < -ALIKE

    behind = near[near[:, 2] < -band_m]
    beams = carry(behind[:, :2], -behind[:, 2], state, outline)
    beyond = sector(beams.share[beams.clear & (beams.x_m > BEYOND_M)], SECTORS)
    backed = _mostly(along, np.bincount(beyond, minlength=SECTORS) > 0)
    if backed.all() or not backed.any():
        return None

    closest = outline.closest(turned(face - state[CENTRE], -state[ROTATION]))
    ends = ends_m(closest.x_m[closest.clear], sector(closest.share[closest.clear], SECTORS))
    of_side = np.array([np.median(ends[side]) for side in along])
    of_backed = np.median(ends[backed])
    if not np.isfinite(of_backed):
        return backed  # most of them are hidden, so that no other edge ends as they do
    alike = np.abs(of_side - of_backed) < EROSION_M + 0.5 * spacing_m
    held: Mask = backed | (alike & _mostly(opposite, alike))
    return None if held.all() else held


def uncut_arcs(
    near: Array, outline: Outline, centre: Array, band_m: float, spacing_m: float
) -> Mask | None:
    """Return the sectors (SECTORS,) of a round edge that no crop can have cut; None: all.

    Arcs with nothing beyond them, at any depth, are cut where in most of them, of those that have a
    background, this ends where the target does; in some, where nothing is beyond any arc.
    As of `uncut_sectors`; centre: (2,) of the outline.
    """
    empty = empty_arcs(near, outline, centre)
    if np.count_nonzero(empty) < LEAST_ARCS:
        return None
    closest = outline.closest(near[:, :2] - centre)
    arc, x_m = sector(closest.share, ARCS), closest.x_m
    target, behind = np.abs(near[:, 2]) < band_m, near[:, 2] < -2.0 * band_m
    ends = np.stack([ends_m(x_m[rows], arc[rows], ARCS) for rows in (target, behind)])
    shown = empty & np.isfinite(ends).all(axis=0)
    apart_m = np.abs(ends[0, shown] - ends[1, shown])
    together = np.count_nonzero(apart_m < EROSION_M + 0.5 * spacing_m)
    most = together > np.count_nonzero(shown) / 2.0 or float(np.mean(empty)) > NEARLY_ALL
    if together < LEAST_ARCS or not most:
        return None
    return np.repeat(~empty, SECTORS // ARCS)


def empty_arcs(near: Array, outline: Outline, centre: Array) -> Mask:
    """Return the arcs (ARCS,) of a round edge beyond which no points lie, at any depth."""
    closest = outline.closest(near[:, :2] - centre)
    beyond = sector(closest.share[closest.x_m > BEYOND_M], ARCS)
    return np.asarray(np.bincount(beyond, minlength=ARCS) < LEAST_BEYOND)


def in_sectors(kept: Mask, plane: Array, depth: Array, outline: Outline, state: Array) -> Mask:
    """Return which points, plane (N, 2) and depth (N,), have their foot in the kept sectors."""
    return np.asarray(kept[sector(carry(plane, depth, state, outline).share, SECTORS)])


def _mostly(side: Mask, shown: Mask) -> Mask:
    """Return for each sector whether enough of those of its `side` (S, S) are shown."""
    return np.asarray(np.sum(side & shown, axis=1) > LEAST_ALONG * np.sum(side, axis=1))
