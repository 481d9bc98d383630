"""Average of the echo over a beam's footprint, by sub-rays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..parameters.parameters import Beam
from ..scene.scene import Scene
from .echoes import Echoes, trace
from .footprint import RIM_RAYS, fine_pattern, rim_pattern, spot_pattern, sub_rays
from .raycast import RayCaster
from .returns import reported_return

CYCLE = 16_000  # beams of which each turns the pattern by another angle
RAYS = 2_000_000  # traced together


def average(
    scene: Scene,
    caster: RayCaster,
    directions: Array,
    beam: Beam,
    numbers: npt.NDArray[np.int64] | None = None,
) -> Echoes:
    """Return the echoes of beams (N, 3), N > 0, averaged over their spots; none below half a spot.

    With `beam.power_weighted` every sub-ray counts with the power that it returns, and one is
    enough; of several returns the beam's mode reports one. numbers: (N,), rotate the pattern of
    sub-rays of each beam; by default its index. Beams across an edge of a plate, from which its
    centre is measured, have the fine pattern.
    """
    if numbers is None:
        numbers = np.arange(len(directions)) % CYCLE
    across = np.zeros(len(directions), dtype=bool)
    for part in _chunks(np.arange(len(directions)), RIM_RAYS):
        across[part] = _across_plate(scene, caster, directions[part], numbers[part], beam)
    coarse, fine = spot_pattern(beam), fine_pattern(beam)
    chosen = [(part, fine) for part in _chunks(np.flatnonzero(across), len(fine))]
    chosen += [(part, coarse) for part in _chunks(np.flatnonzero(~across), len(coarse))]
    parts = [
        _of_pattern(scene, caster, directions[part], numbers[part], beam, pattern)
        for part, pattern in chosen
    ]
    back = np.argsort(np.concatenate([part for part, _ in chosen]))
    return Echoes(
        *(np.concatenate([vars(p)[name] for p in parts])[back] for name in vars(parts[0]))
    )


def _chunks(beams: npt.NDArray[np.intp], rays: int) -> list[npt.NDArray[np.intp]]:
    """Split the numbers of beams into parts that are traced together."""
    size = RAYS // rays
    return [beams[k : k + size] for k in range(0, len(beams), size)]


def _across_plate(
    scene: Scene,
    caster: RayCaster,
    directions: Array,
    numbers: npt.NDArray[np.int64],
    beam: Beam,
) -> Mask:
    """Return the beams (N,) whose spots meet a target's plate, and more than one surface."""
    facet, _ = caster.cast(*sub_rays(beam, directions, numbers, rim_pattern(beam)))
    facet = facet.reshape(len(directions), -1)
    met = facet >= 0
    surface = np.where(met, scene.surface[facet], -1)
    on_plate = np.any(met & scene.plate[facet], axis=1)
    return np.asarray(on_plate & np.any(surface != surface[:, :1], axis=1))


def _of_pattern(
    scene: Scene,
    caster: RayCaster,
    directions: Array,
    numbers: npt.NDArray[np.int64],
    beam: Beam,
    pattern: Array,
) -> Echoes:
    """Return the echoes of beams averaged over the points of a pattern (K, 2)."""
    rays = trace(scene, caster, *sub_rays(beam, directions, numbers, pattern))
    count, middle = len(pattern), int(np.argmin(np.hypot(*pattern.T)))
    hit = (rays.facet >= 0).reshape(-1, count)
    power = np.where(hit, (rays.reflectance * rays.cosine).reshape(-1, count), 0.0)
    if beam.return_mode != "average":
        power *= reported_return(rays.range_m.reshape(-1, count), power, beam)
    weight = power if beam.power_weighted else hit.astype(np.float64)
    total = np.sum(weight, axis=1)
    enough = total > 0.0 if beam.power_weighted else 2 * total >= count

    def mean(values: Array) -> Array:
        met = np.where(hit, values.reshape(-1, count), 0.0)
        return np.asarray(np.sum(weight * met, axis=1) / np.where(total > 0.0, total, 1.0))

    cosine = mean(rays.cosine)
    reflectance = mean(rays.reflectance)
    if beam.power_weighted:  # reflectance * cosine is the power returned of the whole beam's
        reflectance = total / count / np.where(cosine > 0.0, cosine, 1.0)
    target = rays.target.reshape(-1, count)
    range_m = mean(rays.range_m)
    if beam.ambiguity_m > 0.0:
        range_m = _by_phase(rays.range_m.reshape(-1, count), weight, range_m, beam.ambiguity_m)
    return Echoes(
        np.where(enough, range_m, np.nan),
        cosine,
        reflectance,
        np.where(enough, rays.facet.reshape(-1, count)[:, middle], -1),
        np.where(np.all(target >= 0, axis=1), target[:, 0], -1),
    )


def _by_phase(range_m: Array, weight: Array, mean_m: Array, ambiguity_m: float) -> Array:
    """Return the ranges (N,) of the sum of the modulations that sub-rays (N, K) return.

    The phase of the shortest one gives the range up to multiples of ambiguity_m; longer ones, whose
    phases add nearly as the ranges' mean (N,), resolve that.
    """
    cycle = 2.0 * np.pi / ambiguity_m
    aside = np.where(weight > 0.0, range_m, mean_m[:, None]) - mean_m[:, None]
    phase = np.angle(np.sum(weight * np.exp(1j * cycle * aside), axis=1))
    return np.asarray(mean_m + phase / cycle)
