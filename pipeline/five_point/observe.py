"""Observations from five points: plane and centre of each block, with their pooled noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..centre import TargetFit
from ..errors import InputError
from ..measurement import Evidence, Observation, SuspectPoint
from ..system import stage
from ..uncertainty import UncertaintyComponent
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .check_blocks import BlockCheck, Remainder
from .components import PooledNoise, Station, point_components, unexplained_noise
from .file import FivePointFile
from .fit_block import BlockFit, fit_block

# Of every point of a copy from its own, for rounding: far below the noise of any total station.
COPIED_M = 2e-5


def pooled_noise(blocks_m: Array, station: Station | None) -> PooledNoise:
    """Return the noise across the planes of all blocks (M, 5, 3), less the station's stated one."""
    fits = [fit_block(block) for block in blocks_m]
    dof = 2 * len(fits)
    square = sum(5.0 * fit.rms_m**2 for fit in fits) / dof
    noise = PooledNoise(float(np.sqrt(square)), dof)
    return noise if station is None else unexplained_noise(noise, blocks_m, fits, station)


def copied_blocks(blocks_m: Array) -> list[int]:
    """Return the indices of blocks (M, 5, 3) with the points of an earlier one, in any order.

    They show no noise of their own.
    """
    found = []
    for index, block in enumerate(blocks_m):
        for earlier in blocks_m[:index]:
            apart_m = np.linalg.norm(block[:, None] - earlier, axis=-1)
            if max(apart_m.min(axis=0).max(), apart_m.min(axis=1).max()) < COPIED_M:
                found.append(index)
                break
    return found


@stage("plane")
def observe_block(
    file: FivePointFile,
    index: int,
    noise: PooledNoise,
    station: Station | None,
    check: BlockCheck | None = None,
) -> Observation:
    """Return the observation of block `index` of the paper's file.

    Of a block that is not plausible it holds the other four points, if they are; else a trial holds
    nothing, and of a reference wheel InputError is raised.
    """
    reference = index < len(REFERENCE_WHEELS)
    name = REFERENCE_WHEELS[index] if reference else str(index - len(REFERENCE_WHEELS) + 1)
    observation = Observation(
        name=name,
        role="reference" if reference else "trial",
        wheel=name if reference else None,
        source=file.source,
        sha256=file.sha256,
        points_total=5,
        invalid_points=0,
    )
    points_m = file.blocks_m[index]
    if check is None or check.status == "ok":
        fit = fit_block(points_m)
        target = _target(points_m, fit, fit.centre_m, noise, station)
        return replace(observation, evidence=Evidence(target))
    observation = replace(observation, status=check.status)
    first, rest = file.first_line(index), check.remainder
    if rest is not None:
        target = _target(rest.points_m, rest.fit, rest.centre_m, noise, station)
        target = replace(target, components=(*target.components, _missing_point(rest)))
        suspect = SuspectPoint(rest.suspect + 1, first + rest.suspect, rest.off_m)
        return replace(
            observation, evidence=Evidence(target), suspect=suspect, reason=_suspicion(suspect)
        )
    reason = _contradiction(check)
    if reference:
        raise InputError(
            f"{file.source}: lines {first}-{first + 4}: {name} was not measured ({check.status}): "
            f"{reason}: check these rows"
        )
    return replace(observation, reason=f"lines {first}-{first + 4}: {reason}")


def _target(
    points_m: Array, fit: BlockFit, centre_m: Array, noise: PooledNoise, station: Station | None
) -> TargetFit:
    return TargetFit(
        centre_m=centre_m,
        normal=fit.normal,
        components=point_components(points_m, fit, noise, station),
        plane_rms_m=fit.rms_m,
        points_on_target=len(points_m),
        method="points",
    )


def _missing_point(rest: Remainder) -> UncertaintyComponent:
    """Return the component of a centre that follows from four points of a pentagon."""
    factor = np.vstack([np.zeros((3, 2)), rest.u_centre_m * rest.fit.axes[1:].T])
    return UncertaintyComponent("missing point", factor, rest.dof, pooled=True)


def _suspicion(suspect: SuspectPoint) -> str:
    off_mm = suspect.off_m * 1e3
    along = ", ".join(f"{axis} {x:+.1f}" for axis, x in zip("xyz", off_mm, strict=True))
    return (
        f"line {suspect.line}: point {suspect.number} of the block is {np.linalg.norm(off_mm):.1f} "
        f"mm from where the other four place it ({along})"
    )


def _contradiction(check: BlockCheck) -> str:
    off_m, form = check.off_plane_m, "their plane"
    if check.status == "block-not-regular":
        off_m, form = check.off_pentagon_m, "a regular pentagon"
    return (
        f"its points lie {off_m * 1e3:.1f} mm rms off {form}, other than those of the other "
        "blocks, and no single one of them accounts for it"
    )
