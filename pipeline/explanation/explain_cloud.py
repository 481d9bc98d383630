"""Explain the cloud of a whole vehicle: every candidate, and the wheel that it was named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..capture import Capture, ScanEntry, boxed
from ..cloud import sample
from ..config import Config
from ..detection import Candidate, candidates_of_cloud
from ..diagnostics import check_vehicle_cloud
from ..errors import InputError
from ..measure import fit_target
from ..measurement import observe_cloud
from ..targets import WheelTarget
from .records import NO_POINTS, ExplainedCandidate, ExplainedScan, with_region
from .verdicts import MOST_SHOWN, apart

SAMPLE = 400_000  # points of a scan or a cloud in its picture


def explain_cloud(
    cloud: ScanEntry, capture: Capture, config: Config, progress: Callable[[str], None]
) -> ExplainedScan:
    """Explain the scan of a whole vehicle: its wheels, and candidates for the first flat target."""
    source, kinds = capture.called(cloud), tuple(capture.of_wheels.values())
    flat = (kind for kind in kinds if not isinstance(kind, WheelTarget))
    target = next(flat, kinds[0])
    found = ExplainedScan(cloud.name, cloud.role, cloud.file, "ok", "", 0, NO_POINTS, target.region)
    try:
        progress(f"{cloud.file}: reading")
        scan = cloud.read(capture.length_unit, source, capture.reading)
        found = replace(found, points=len(scan.points_m), sample_m=sample(scan.points_m, SAMPLE))
        hint = capture.hints.get("vehicle")
        found = with_region(found, hint)
        within = boxed(scan, hint, source)
        scan = within.used
        check_vehicle_cloud(scan.points_m, 2.0 * target.radius_m, capture.length_unit, source)
    except InputError as error:
        return replace(found, status="not-read", reason=str(error))
    progress(f"{cloud.file}: searching")
    rows, axes = [(p.start, p.stop) for p in scan.parts], [p.axes for p in scan.parts]
    seen = (scan.points_m, target, config.segment, axes, rows)
    candidates = [] if isinstance(target, WheelTarget) else candidates_of_cloud(*seen)
    shown = apart(candidates, target.radius_m)[:MOST_SHOWN]
    shown = sorted(shown, key=lambda one: not within.shows(one.centre_m))
    wheels: dict[str, np.ndarray] = {}
    try:
        observations, _ = observe_cloud(cloud, capture, config, fit_target, progress)
        wheels = {one.name: one.fitted.centre_m for one in observations}
    except InputError as error:
        found = replace(found, status="not-named", reason=str(error))
    judged = tuple(
        _judged(number, one, wheels, target.radius_m, config.segment.face_match)
        if within.shows(one.centre_m)
        else ExplainedCandidate(number, one, "refused", "outside_region")
        for number, one in enumerate(shown, 1)
    )
    return replace(found, candidates=judged)


def _judged(
    number: int,
    one: Candidate,
    wheels: dict[str, np.ndarray],
    radius_m: float,
    least_match: float,
) -> ExplainedCandidate:
    """Return a candidate with the wheel whose target it is, or why it is none."""
    for wheel, centre_m in wheels.items():
        if float(np.linalg.norm(one.centre_m - centre_m)) < radius_m:
            return ExplainedCandidate(number, one, "chosen", "of_wheel", wheel)
    if one.match < least_match:
        return ExplainedCandidate(number, one, "refused", "no_outline", least_match=least_match)
    if wheels:
        return ExplainedCandidate(number, one, "refused", "at_no_wheel")
    return ExplainedCandidate(number, one, "rival", "outline")
