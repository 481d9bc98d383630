"""Observations from five points: plane and centre of each block, with the pooled noise of all."""

from __future__ import annotations

import numpy as np

from ..centre import TargetFit
from ..measurement import Evidence, Observation
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .components import PooledNoise, Station, point_components, unexplained_noise
from .file import FivePointFile
from .fit_block import fit_block


def pooled_noise(blocks_m: Array, station: Station | None) -> PooledNoise:
    """Return the noise across the planes of all blocks (M, 5, 3), less the station's stated one."""
    fits = [fit_block(block) for block in blocks_m]
    dof = 2 * len(fits)
    square = sum(5.0 * fit.rms_m**2 for fit in fits) / dof
    noise = PooledNoise(float(np.sqrt(square)), dof)
    return noise if station is None else unexplained_noise(noise, blocks_m, fits, station)


def observe_block(
    file: FivePointFile, index: int, noise: PooledNoise, station: Station | None
) -> Observation:
    """Return the observation of block `index` of the paper's file."""
    fit = fit_block(file.blocks_m[index])
    target = TargetFit(
        centre_m=fit.centre_m,
        normal=fit.normal,
        components=point_components(file.blocks_m[index], fit, noise, station),
        plane_rms_m=fit.rms_m,
        points_on_target=5,
        method="points",
    )
    reference = index < len(REFERENCE_WHEELS)
    name = REFERENCE_WHEELS[index] if reference else str(index - len(REFERENCE_WHEELS) + 1)
    return Observation(
        name=name,
        role="reference" if reference else "trial",
        wheel=name if reference else None,
        source=file.source,
        sha256=file.sha256,
        points_total=5,
        invalid_points=0,
        evidence=Evidence(target),
    )
