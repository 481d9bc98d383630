"""What comes back along thin rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..scene.scene import Plate, Scene
from .raycast import RayCaster


@dataclass(frozen=True)
class Echoes:
    """What N beams met.

    range_m (N,), NaN where nothing came back; cosine (N,) of the incidence; reflectance (N,);
    facet (N,) under the centre, -1 for none; plate (N,) number of the target on whose measured face
    the whole spot lies, or -1.
    """

    range_m: Array
    cosine: Array
    reflectance: Array
    facet: npt.NDArray[np.int64]
    plate: npt.NDArray[np.int64]


def trace(scene: Scene, caster: RayCaster, origins_m: Array | float, directions: Array) -> Echoes:
    """Echoes of thin rays: origins (N, 3) or 0, directions (N, 3).

    The range is recomputed in double precision from the facet's plane, on the target's face from
    its form; so is the reflectance of what is printed there. A facet seen so edge-on that its plane
    leaves the coarse range by 1 mm keeps the coarse one.
    """
    facet, coarse = caster.cast(origins_m, directions)
    missed = facet < 0
    normals = scene.normals[facet]
    cosine = np.einsum("ij,ij->i", normals, directions)
    height = scene.offsets_m[facet]
    number = np.where(missed, -1, scene.plate[facet])
    for k, plate in enumerate(scene.plates):
        if len(plate.form.wave):
            met = number == k
            height[met] += plate.form.height_m(_seen(plate, origins_m, directions, coarse, met))
    if np.ndim(origins_m) > 0:
        height = height - np.einsum("ij,ij->i", normals, np.asarray(origins_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = height / cosine
        range_m = np.where(np.abs(range_m - coarse) < 1e-3, range_m, coarse)
    range_m[missed] = np.nan
    reflectance = scene.reflectance[facet]
    for k, plate in enumerate(scene.plates):
        if plate.pattern is not None:
            met = number == k
            uv = _seen(plate, origins_m, directions, range_m, met)
            reflectance[met] = plate.pattern.reflectance(uv)
    return Echoes(range_m, np.abs(cosine), reflectance, facet, number)


def _seen(
    plate: Plate, origins_m: Array | float, directions: Array, range_m: npt.NDArray[Any], met: Mask
) -> Array:
    """Where on the plate's face the rays `met` end, (K, 2)."""
    origins = np.broadcast_to(origins_m, directions.shape)[met]
    return plate.uv_m(origins + range_m[met, None] * directions[met])
