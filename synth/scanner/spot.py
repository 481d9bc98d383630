"""Echoes of beams with a footprint: the range is averaged where the spot straddles an edge."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..parameters.parameters import Beam
from ..scene.scene import Scene
from .echoes import Echoes, trace
from .footprint import extent_m
from .raycast import RayCaster
from .spot_average import average

# Largest distance, along a beam, from the plane under it to what its neighbour meets.
BEND_M = 0.0001


def spot_echoes(
    scene: Scene, caster: RayCaster, directions: Array, step_rad: float, beam: Beam
) -> Echoes:
    """Return the echoes of a grid of beams, directions (H, W, 3), with their footprint.

    On a plane the range is linear across the beam, so its average over a symmetric spot is that
    of the centre; only beams near an edge need sub-rays.
    """
    beams = directions.reshape(-1, 3)
    centres = trace(scene, caster, 0.0, beams)
    if beam.is_thin or not np.any(centres.facet >= 0):
        return centres
    edge = near_edges(scene, centres, directions, step_rad, beam)
    return with_spots(scene, caster, centres, beams, edge.ravel(), beam)


def with_spots(
    scene: Scene,
    caster: RayCaster,
    thin: Echoes,
    directions: Array,
    edge: Mask,
    beam: Beam,
    numbers: npt.NDArray[np.int64] | None = None,
) -> Echoes:
    """Average the echoes of beams, directions (N, 3), at an `edge` (N,) over their spots.

    The reflectance of beams on a print likewise, and all else if it weights the spot. thin:
    echoes of the centres, changed in place; numbers: see average().
    """
    printed = np.array([target.pattern is not None for target in scene.targets] + [False])
    on_print = printed[thin.target] & ~edge
    of_print = tuple(vars(thin)) if beam.power_weighted else ("reflectance",)
    for chosen, names in ((edge, tuple(vars(thin))), (on_print, of_print)):
        if np.any(chosen):
            own = None if numbers is None else numbers[chosen]
            better = average(scene, caster, directions[chosen], beam, own)
            for name in names:
                getattr(thin, name)[chosen] = getattr(better, name)
    return thin


def near_edges(
    scene: Scene,
    centres: Echoes,
    directions: Array,
    step_rad: float,
    beam: Beam,
    reach: int | None = None,
) -> Mask:
    """Return the beams (H, W) of a grid whose spot may reach an edge, or past the window.

    reach: steps within a spot radius, by default where the beams are closest.

    There is an edge between two neighbours when they meet different surfaces, or when the plane of
    the facet that one meets misses what the other meets by BEND_M along the beam. Elsewhere a
    range bends by at most b = BEND_M over a step s, and its average over a spot of radius r is
    off by r^2 / 8 * (d2/dx2 + d2/dy2) <= r^2 b / (2 s^2).
    """
    shape = directions.shape[:2]
    if reach is None:
        reach = spot_reach(float(np.nanmin(centres.range_m)), directions, step_rad, beam)
    facet, range_m = centres.facet.reshape(shape), centres.range_m.reshape(shape)
    surface = np.where(facet < 0, -1, scene.surface[facet])
    normals, offsets_m = scene.normals[facet], scene.offsets_m[facet]
    edge = np.zeros(shape, dtype=bool)
    low_rows, high_rows = np.s_[:-1, :], np.s_[1:, :]
    low_columns, high_columns = np.s_[:, :-1], np.s_[:, 1:]
    for a, b in ((low_rows, high_rows), (low_columns, high_columns)):
        change = surface[a] != surface[b]
        for p, q in ((a, b), (b, a)):
            cosine = np.einsum("ijk,ijk->ij", normals[p], directions[q])
            miss_m = np.abs(offsets_m[p] - range_m[q] * cosine)
            change |= miss_m > BEND_M * np.abs(cosine)
        edge[a] |= change
        edge[b] |= change
    edge[[0, -1]] = edge[:, [0, -1]] = True
    return _dilated(_dilated(edge, reach).T, reach).T


def spot_reach(nearest_m: float, directions: Array, step_rad: float, beam: Beam) -> int:
    """Return the steps of a grid, directions (..., 3), within a spot radius at their closest."""
    level = float(np.sqrt(1 - np.max(directions[..., 2] ** 2)))
    return int(np.ceil(extent_m(beam, nearest_m) / (nearest_m * step_rad * level)))


def _dilated(mask: Mask, reach: int) -> Mask:
    """Dilate by `reach` rows: a moving sum, by differences of the running sum."""
    padded = np.pad(mask, ((reach + 1, reach), (0, 0))).astype(np.int32)
    running = np.cumsum(padded, axis=0)
    grown: Mask = running[2 * reach + 1 :] > running[: -2 * reach - 1]
    return grown
