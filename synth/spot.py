"""What comes back along a beam that is not a line: the spot averages where it straddles an edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from synth.raycast import RayCaster
from synth.scene import Scene

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

# How far, along a beam, the plane under one beam may miss what its neighbour meets.
BEND_M = 0.0001
GOLDEN_RAD = np.pi * (3 - np.sqrt(5))
# Beams whose sub-rays are traced together.
CHUNK = 16_000


@dataclass(frozen=True)
class Echoes:
    """What N beams met.

    range_m (N,), NaN where nothing came back; cosine (N,) of the incidence; reflectance (N,);
    facet (N,) under the centre, -1 for none; on_front (N,) the whole spot lies on the measured
    face.
    """

    range_m: Array
    cosine: Array
    reflectance: Array
    facet: npt.NDArray[np.int64]
    on_front: Mask


def trace(scene: Scene, caster: RayCaster, origins_m: Array | float, directions: Array) -> Echoes:
    """Echoes of thin rays: origins (N, 3) or 0, directions (N, 3).

    The range is recomputed in double precision from the facet's plane, on the target's face from
    its form; a facet seen so edge-on that its plane leaves the coarse range by 1 mm keeps the
    coarse one.
    """
    facet, coarse = caster.cast(origins_m, directions)
    missed = facet < 0
    normals = scene.normals[facet]
    cosine = np.einsum("ij,ij->i", normals, directions)
    height = scene.offsets_m[facet]
    on_front = scene.front[facet] & ~missed
    if len(scene.form.wave):
        origins = np.broadcast_to(origins_m, directions.shape)[on_front]
        foot = origins + coarse[on_front, None] * directions[on_front]
        uv = (foot - scene.T_station_plate[:3, 3]) @ scene.T_station_plate[:3, :2]
        height[on_front] += scene.form.height_m(uv)
    if np.ndim(origins_m) > 0:
        height = height - np.einsum("ij,ij->i", normals, np.asarray(origins_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = height / cosine
        range_m = np.where(np.abs(range_m - coarse) < 1e-3, range_m, coarse)
    range_m[missed] = np.nan
    return Echoes(range_m, np.abs(cosine), scene.reflectance[facet], facet, on_front)


def spot_echoes(
    scene: Scene, caster: RayCaster, directions: Array, step_rad: float, radius_m: float
) -> Echoes:
    """Echoes of a grid of beams, directions (H, W, 3), whose spot has this radius.

    A range is linear in the place across the beam on a plane, so the average over a symmetric
    spot is the range of its centre; only beams near an edge need their sub-rays.
    """
    beams = directions.reshape(-1, 3)
    centres = trace(scene, caster, 0.0, beams)
    if radius_m == 0.0 or not np.any(centres.facet >= 0):
        return centres
    chosen = np.flatnonzero(near_edges(scene, centres, directions, step_rad, radius_m))
    return _replaced(centres, chosen, average(scene, caster, beams[chosen], radius_m))


def near_edges(
    scene: Scene, centres: Echoes, directions: Array, step_rad: float, radius_m: float
) -> Mask:
    """Beams (H, W) of a grid whose spot may reach an edge, or past the window.

    Between two neighbours lies an edge when they meet different surfaces, or when the plane of
    the facet that one meets misses what the other meets by BEND_M along the beam. Elsewhere a
    range bends by at most b = BEND_M over a step s, and its average over a spot of radius r is
    off by r^2 / 8 * (d2/dx2 + d2/dy2) <= r^2 b / (2 s^2).
    """
    shape = directions.shape[:2]
    level = float(np.sqrt(1 - np.max(directions[:, :, 2] ** 2)))
    narrowest_m = float(np.nanmin(centres.range_m)) * step_rad * level
    reach = int(np.ceil(radius_m / narrowest_m))
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


def average(scene: Scene, caster: RayCaster, beams: Array, radius_m: float) -> Echoes:
    """Echoes of beams (N, 3) averaged over their spots; less than half a spot returns nothing."""
    parts = [
        _average_chunk(scene, caster, beams[k : k + CHUNK], radius_m)
        for k in range(0, max(len(beams), 1), CHUNK)
    ]
    names = ("range_m", "cosine", "reflectance", "facet", "on_front")
    return Echoes(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def spot_pattern() -> Array:
    """Places (19, 2) in the unit disc: two rings of a hexagonal lattice about its centre.

    The lattice has the second moment of the uniform disc, mean(x^2 + y^2) = 1/2.
    """
    i, j = (k.ravel() for k in np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)))
    near = np.abs(i + j) <= 2
    lattice = np.column_stack([i + j / 2, j * np.sqrt(3) / 2])[near]
    scale = np.sqrt(2 * np.mean(np.sum(lattice**2, axis=1)))
    return np.asarray(lattice / scale, dtype=np.float64)


def _average_chunk(scene: Scene, caster: RayCaster, beams: Array, radius_m: float) -> Echoes:
    origins, count = _sub_rays(beams, radius_m), len(spot_pattern())
    rays = trace(scene, caster, origins, np.repeat(beams, count, axis=0))
    hit = (rays.facet >= 0).reshape(-1, count)
    hits = np.sum(hit, axis=1)
    enough = 2 * hits >= count

    def mean(values: Array) -> Array:
        met = np.where(hit, values.reshape(-1, count), 0.0)
        return np.asarray(np.sum(met, axis=1) / np.maximum(hits, 1), dtype=np.float64)

    return Echoes(
        np.where(enough, mean(rays.range_m), np.nan),
        mean(rays.cosine),
        mean(rays.reflectance),
        np.where(enough, rays.facet.reshape(-1, count)[:, count // 2], -1),
        np.all(rays.on_front.reshape(-1, count), axis=1),
    )


def _sub_rays(beams: Array, radius_m: float) -> Array:
    """Where the sub-rays of N beams start: (N * 19, 3), across the beam, round the origin.

    Each beam turns the pattern by the golden angle, lest its corners leave a mark on outlines.
    """
    level = np.cross([0.0, 0.0, 1.0], beams)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upward = np.cross(beams, level)
    turn = GOLDEN_RAD * np.arange(len(beams))[:, None]
    one = radius_m * (np.cos(turn) * level + np.sin(turn) * upward)
    other = radius_m * (np.cos(turn) * upward - np.sin(turn) * level)
    places = spot_pattern()
    origins = places[:, 0, None] * one[:, None, :] + places[:, 1, None] * other[:, None, :]
    return np.asarray(origins.reshape(-1, 3), dtype=np.float64)


def _replaced(echoes: Echoes, chosen: npt.NDArray[np.int64], better: Echoes) -> Echoes:
    for name in ("range_m", "cosine", "reflectance", "facet", "on_front"):
        getattr(echoes, name)[chosen] = getattr(better, name)
    return echoes


def _dilated(mask: Mask, reach: int) -> Mask:
    """True within `reach` rows of a True: a moving sum by differences of the running sum."""
    padded = np.pad(mask, ((reach + 1, reach), (0, 0))).astype(np.int32)
    running = np.cumsum(padded, axis=0)
    grown: Mask = running[2 * reach + 1 :] > running[: -2 * reach - 1]
    return grown
