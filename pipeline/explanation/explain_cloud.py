"""Explain the cloud of a whole vehicle: every candidate, and the wheel that it was named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ..capture import Capture, boxed
from ..cloud import sample
from ..config import Config
from ..detection import Candidate, candidates_of_cloud
from ..diagnostics import check_vehicle_cloud
from ..errors import InputError, NotMeasuredError
from ..measure import fit_target
from ..measurement import Observation, kinds_of, observe_cloud
from ..readers import Scan
from ..targets import Target, WheelTarget
from ..wheel import VehicleScan, find_places
from .records import NO_POINTS, ExplainedCandidate, ExplainedScan, with_region
from .verdicts import MOST_SHOWN, apart

SAMPLE = 400_000  # points of a scan or a cloud in its picture


def explain_cloud(
    capture: Capture, config: Config, progress: Callable[[str], None]
) -> ExplainedScan:
    """Explain the scan of a whole vehicle: its wheels, and candidates for each kind of target."""
    cloud = capture.cloud
    assert cloud is not None
    source, kinds = capture.called(cloud), kinds_of(capture)
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
    most = MOST_SHOWN // len(kinds)
    shown = [(kind, one) for kind in kinds for one in _candidates(scan, kind, config)[:most]]
    shown = sorted(shown, key=lambda pair: (not within.shows(pair[1].centre_m), -pair[1].match))
    wheels: dict[str, Observation] = {}
    try:
        observations, _ = observe_cloud(cloud, capture, config, fit_target, progress)
        wheels = {one.name: one for one in observations}
    except InputError as error:
        found = replace(found, status="not-named", reason=str(error))
    judged = []
    for number, (kind, one) in enumerate(shown, 1):
        if within.shows(one.centre_m):
            known = _judged(number, one, kind, wheels, config.segment.face_match)
        else:
            known = ExplainedCandidate(number, one, "refused", "outside_region")
        named = kind.description if len(kinds) > 1 else ""
        judged.append(replace(known, target=named, region=kind.region))
    return replace(found, candidates=tuple(judged))


def _candidates(scan: Scan, kind: Target, config: Config) -> list[Candidate]:
    """Return candidates for one kind of target, best match first; of bare wheels, those found."""
    rows, axes = [(p.start, p.stop) for p in scan.parts], [p.axes for p in scan.parts]
    if not isinstance(kind, WheelTarget):
        flat = candidates_of_cloud(scan.points_m, kind, config.segment, axes, rows)
        return apart(flat, kind.radius_m)
    stations_m = [p.station_m for p in scan.parts]
    seen = VehicleScan(scan.points_m, scan.intensity, rows, stations_m, axes)
    try:
        patches = [place.best for place in find_places(seen, (kind,), config)]
    except NotMeasuredError:
        return []
    return [Candidate(p.origin_m, p.basis, p.match, 0.0, 0.0, len(p.face_m)) for p in patches]


def _judged(
    number: int,
    one: Candidate,
    kind: Target,
    wheels: Mapping[str, Observation],
    least_match: float,
) -> ExplainedCandidate:
    """Return a candidate with the wheel whose target it is, or why it is none."""
    for wheel, seen in wheels.items():
        if float(np.linalg.norm(one.centre_m - seen.fitted.centre_m)) < kind.radius_m:
            if seen.target != kind:
                return ExplainedCandidate(number, one, "refused", "other_target", wheel)
            return ExplainedCandidate(number, one, "chosen", "of_wheel", wheel)
    is_bare = isinstance(kind, WheelTarget)
    if not is_bare and one.match < least_match:
        return ExplainedCandidate(number, one, "refused", "no_outline", least_match=least_match)
    if wheels:
        return ExplainedCandidate(number, one, "refused", "at_no_wheel")
    return ExplainedCandidate(number, one, "rival", "stands" if is_bare else "outline")
