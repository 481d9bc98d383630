"""One scan, or one block of five points, to what it shows, or why it shows nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.capture import Capture
from pipeline.cloud_sample import cloud_sample
from pipeline.config import Config
from pipeline.digest import sha256
from pipeline.errors import InputError, NotMeasuredError
from pipeline.five_point import fit_block
from pipeline.five_point_file import FivePointFile
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.measurement import Evidence, Observation
from pipeline.patch import Patch
from pipeline.plausible import check_wheel_scan
from pipeline.point_causes import PooledNoise, Station, point_causes, unexplained_noise
from pipeline.readers import read_scan
from pipeline.reference_frame import REFERENCE_WHEELS
from pipeline.scan_entry import ScanEntry
from pipeline.segment import find_target
from pipeline.targets import Target

Fit = Callable[[Patch, Target, Config], Evidence]


def observe_entry(
    entry: ScanEntry,
    capture: Capture,
    config: Config,
    fit_target: Fit,
    progress: Callable[[str], None],
) -> Observation:
    """Read a scan and measure its target.

    Raises InputError when the file is unreadable, or the target of a reference wheel, on which the
    frame stands, was not measured.
    """
    progress(entry.file)
    source = f"{capture.source}: {entry.file}"
    seen, patch = _find(entry, source, capture, config)
    try:
        if isinstance(patch, NotMeasuredError):
            raise patch
        evidence = fit_target(patch, capture.target, config)
        return replace(seen, evidence=evidence, wheel=_wheel_of(entry, evidence, source))
    except NotMeasuredError as error:
        if entry.role == "reference":
            raise InputError(
                f"{source}: the target of reference wheel {entry.name} was not measured "
                f"({error.status}): {error}: scan this wheel again, or check "
                "--target and length_unit"
            ) from error
        return replace(seen, status=error.status, reason=str(error))


def _wheel_of(entry: ScanEntry, evidence: Evidence, source: str) -> str | None:
    """The scan's wheel as it is named, which its markers must not contradict; else by these."""
    told = evidence.target.wheel
    if told is not None and entry.wheel not in (None, told):
        raise InputError(
            f"{source}: it is named for {entry.wheel}, but the markers of its board are those of "
            f"{told}: mend the scan's name, or the markers in the target's file"
        )
    return entry.wheel or told


def _find(
    entry: ScanEntry, source: str, capture: Capture, config: Config
) -> tuple[Observation, Patch | NotMeasuredError]:
    """What was read, and the target's surroundings; the scan itself is let go here."""
    scan = read_scan(entry.path, capture.length_unit, source)
    check_wheel_scan(scan.points_m, 2.0 * capture.target.radius_m, capture.length_unit, source)
    seen = Observation(
        name=entry.name,
        role=entry.role,
        wheel=entry.wheel,
        source=entry.file,
        sha256=sha256(entry.path),
        points_total=len(scan.points_m),
        missing_returns=scan.missing_returns,
        repeats=entry.repeats,
        turn=entry.turn,
        cloud=cloud_sample(scan.points_m),
    )
    try:
        patch = find_target(
            scan.points_m, capture.target, config.segment, config.seed, scan.intensity
        )
    except NotMeasuredError as error:
        return seen, error.with_traceback(None)
    station_m = scan.parts[0].station_m if len(scan.parts) == 1 else None
    return seen, replace(patch, station_m=station_m)


def pooled_noise(blocks_m: Array, station: Station | None) -> PooledNoise:
    """Noise across the planes from all blocks (M, 5, 3), less what the station states of itself."""
    fits = [fit_block(block) for block in blocks_m]
    freedom = 2 * len(fits)
    square = sum(5.0 * fit.rms_m**2 for fit in fits) / freedom
    noise = PooledNoise(float(np.sqrt(square)), freedom)
    return noise if station is None else unexplained_noise(noise, blocks_m, fits, station)


def observe_block(
    file: FivePointFile, index: int, noise: PooledNoise, station: Station | None
) -> Observation:
    """Block `index` of the paper's file."""
    fit = fit_block(file.blocks_m[index])
    target = TargetFit(
        centre_m=fit.centre_m,
        normal=fit.normal,
        causes=point_causes(file.blocks_m[index], fit, noise, station),
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
        missing_returns=0,
        evidence=Evidence(target),
    )
