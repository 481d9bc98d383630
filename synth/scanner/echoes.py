"""Echoes of thin rays: range, incidence, reflectance, facet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..scene.scene import PlacedTarget, Scene
from .raycast import RayCaster

FARTHEST_M = 0.02


@dataclass(frozen=True)
class Echoes:
    """Echoes of N beams.

    range_m (N,), NaN without return; cosine (N,) of the incidence; reflectance (N,); facet (N,)
    under the centre, -1 for none; target (N,) number of the target on whose measured face the whole
    spot lies, or -1.
    """

    range_m: Array
    cosine: Array
    reflectance: Array
    facet: npt.NDArray[np.int64]
    target: npt.NDArray[np.int64]


def trace(scene: Scene, caster: RayCaster, origins_m: Array | float, directions: Array) -> Echoes:
    """Trace thin rays: origins (N, 3) or 0, directions (N, 3).

    The range is recomputed in double precision from the facet's plane, on a target's face with its
    form; the reflectance of a print likewise. The coarse range is kept where the two differ by
    1 mm, as on facets seen edge-on, and the plane's where a form would be FARTHEST_M off along the
    beam.
    """
    facet, coarse = caster.cast(origins_m, directions)
    missed = facet < 0
    normals = scene.normals[facet]
    cosine = np.einsum("ij,ij->i", normals, directions)
    height = scene.offsets_m[facet]
    number = np.where(missed, -1, scene.target[facet])
    if np.ndim(origins_m) > 0:
        height = height - np.einsum("ij,ij->i", normals, np.asarray(origins_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = height / cosine
        range_m = np.where(np.abs(range_m - coarse) < 1e-3, range_m, coarse)
    for k, target in enumerate(scene.targets):
        if len(target.form.wave):
            met = number == k
            form_m = target.form.height_m(_hits(target, origins_m, directions, range_m, met))
            edge_on = np.abs(form_m) > FARTHEST_M * np.abs(cosine[met])
            range_m[met] += np.where(edge_on, 0.0, form_m) / cosine[met]
    range_m[missed] = np.nan
    reflectance = scene.reflectance[facet]
    for k, target in enumerate(scene.targets):
        if target.pattern is not None:
            met = number == k
            uv = _hits(target, origins_m, directions, range_m, met)
            reflectance[met] = target.pattern.reflectance(uv)
    return Echoes(range_m, np.abs(cosine), reflectance, facet, number)


def _hits(
    target: PlacedTarget,
    origins_m: Array | float,
    directions: Array,
    range_m: npt.NDArray[Any],
    met: Mask,
) -> Array:
    """Return the points (K, 2) of the target's face that the rays `met` hit."""
    origins = np.broadcast_to(origins_m, directions.shape)[met]
    return target.uv_m(origins + range_m[met, None] * directions[met])
