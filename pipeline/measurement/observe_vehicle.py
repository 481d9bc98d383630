"""Observation of all four targets in a whole-vehicle scan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..capture import Capture, Hint, ScanEntry, Searched, boxed
from ..cloud import by_wheel, sample
from ..config import Config
from ..detection import (
    FoundTarget,
    find_axles,
    find_targets,
    find_up,
    placed,
    stand_on_a_floor,
    wheels_by_markers,
)
from ..diagnostics import check_vehicle_cloud
from ..errors import InputError, NotMeasuredError, Wording
from ..plane import Patch
from ..readers import Part, Scan
from ..system import stage
from ..targets import PatternTarget, Target, WheelTarget
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from ..wheel import find_wheels
from .observe import Fit, note_on_hint, notes_on_lone_points
from .records import Evidence, Naming, Observation

SAMPLE = 400_000  # points of the cloud that are kept, to find its floor


@dataclass(frozen=True)
class Found:
    """Targets found in a whole-vehicle scan, with a sample of its points.

    scans: name of the file's scan that each patch is from; '' if the file holds one only. notes:
    findings about the points.
    """

    patches: tuple[Patch, ...]
    scans: tuple[str, ...]
    sample_m: Array
    points: int
    invalid_points: int
    notes: tuple[str, ...] = ()

    @property
    def targets(self) -> tuple[FoundTarget, ...]:
        """Position, normal and match of each patch, by which wheels are named."""
        return tuple(FoundTarget(p.origin_m, p.basis[2], p.match) for p in self.patches)


@stage("segment")
def targets_of_cloud(
    cloud: ScanEntry,
    source: str,
    capture: Capture,
    config: Config,
    progress: Callable[[str], None],
) -> Found:
    """Find the targets in a whole-vehicle scan; messages call the file `source`.

    Raises InputError when it is unreadable, or cannot be the scan of a vehicle.
    """
    progress(f"{cloud.file}: reading")
    scan = cloud.read(capture.length_unit, source, capture.reading)
    hint = capture.hints.get("vehicle")
    within = boxed(scan, hint, source)
    scan, target, unit = within.used, capture.target, capture.length_unit
    check_vehicle_cloud(scan.points_m, 2.0 * target.radius_m, unit, source)
    progress(f"{cloud.file}: searching")
    chosen = [one.near for wheel in REFERENCE_WHEELS if (one := capture.hints.get(wheel))]
    near_m = [one for one in chosen if one is not None]
    try:
        patches = _find(scan, near_m, target, config)
    except NotMeasuredError as error:
        raise InputError(f"{source}: {error}: check the file, and --target") from error
    if not near_m:
        patches = _in_region(patches, within, source)
    parts = scan.parts
    return Found(
        patches=patches,
        scans=tuple(parts[patch.part].name if len(parts) > 1 else "" for patch in patches),
        sample_m=sample(scan.points_m, SAMPLE),
        points=len(scan.points_m),
        invalid_points=scan.invalid_points,
        notes=(*notes_on_lone_points(scan.points_m, cloud.file), *_notes(hint)),
    )


def _find(scan: Scan, near_m: Sequence[Array], target: Target, config: Config) -> tuple[Patch, ...]:
    """Find all targets of a cloud, or those at points (3,) each. Raises NotMeasuredError."""
    parts = scan.parts or (Part("", 0, len(scan.points_m), None),)
    rows, stations = [(p.start, p.stop) for p in parts], [p.station_m for p in parts]
    if isinstance(target, WheelTarget):
        return find_wheels(scan.points_m, target.rim_inch, rows, stations, near_m)
    seen = (scan.points_m, target, config.segment, scan.intensity)
    return find_targets(*seen, rows, stations, [p.axes for p in parts], near_m, config.seed)


def _in_region(patches: tuple[Patch, ...], within: Searched, source: str) -> tuple[Patch, ...]:
    """Return the targets in the operator's region. Raises InputError where it has none of them."""
    inside = tuple(patch for patch in patches if within.shows(patch.origin_m))
    if patches and not inside:
        raise InputError(
            f"{source}: {within.hint.note if within.hint else ''}, which holds none of the "
            f"{len(patches)} targets that are found: draw it about all four"
        )
    return inside


def _notes(hint: Hint | None) -> tuple[str, ...]:
    """Return a note on where the operator had the targets searched; none without."""
    return () if hint is None else (Wording(SEARCHED, choice=hint.note),)


MOST_SHOWN = 4
SEARCHED = "vehicle: {choice}."
LEFT_OUT = "Like the target, but at none of the vehicle's wheels: {parts}."
BY_OPERATOR = "the wheels that the operator named"
BY_MARKERS = "the markers of the boards"


def observe_cloud(
    cloud: ScanEntry, capture: Capture, config: Config, fit: Fit, progress: Callable[[str], None]
) -> tuple[list[Observation], Naming]:
    """Find, name and measure the targets of all four wheels.

    Raises InputError when the file is unreadable, when its targets cannot be assigned to wheels,
    and when one of the four cannot be measured.
    """
    source = capture.called(cloud)
    with ThreadPoolExecutor(1) as beside:
        digest = beside.submit(lambda: cloud.sha256)
        found = targets_of_cloud(cloud, source, capture, config, progress)
    try:
        ways, naming = _chosen(found, capture, config) or _ways(found, capture)
        evidence: dict[int, Evidence] = {}
        for wheel, index in ways[0].items():
            known = wheel if len(ways) == 1 else ""
            progress(f"{cloud.file}: {known or f'target {index + 1}'}")
            evidence[index] = _fitted(found, index, known, capture.target, config, fit)
        marked = {index: e.target.wheel for index, e in evidence.items() if e.target.wheel}
        named = wheels_by_markers(ways, marked, found.targets)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    centres_m = np.stack([evidence[named[wheel]].target.centre_m for wheel in REFERENCE_WHEELS])
    observations = [
        Observation(
            name=wheel,
            role="reference",
            wheel=wheel,
            source=": ".join(filter(None, (cloud.file, found.scans[named[wheel]]))),
            sha256=digest.result(),
            points_total=found.points,
            invalid_points=found.invalid_points,
            evidence=evidence[named[wheel]],
            cloud=shown,
            notes=found.notes if wheel == REFERENCE_WHEELS[0] else (),
            target=capture.target,
        )
        for wheel, shown in zip(REFERENCE_WHEELS, by_wheel(found.sample_m, centres_m), strict=True)
    ]
    return observations, naming


def _chosen(
    found: Found, capture: Capture, config: Config
) -> tuple[list[Mapping[str, int]], Naming] | None:
    """Return the wheels as the operator named their targets, None where he did not.

    Raises InputError where left and right contradict the up direction.
    """
    if not all(wheel in capture.hints for wheel in REFERENCE_WHEELS):
        return None
    hints = [capture.hints[wheel] for wheel in REFERENCE_WHEELS]
    named = {wheel: index for index, wheel in enumerate(REFERENCE_WHEELS)}
    axles_m = np.array([target.centre_m for target in found.targets]).reshape(2, 2, 3)
    up = find_up(found.sample_m, axles_m, capture.up)
    rear_m, front_m = axles_m.mean(axis=1)
    left = np.cross(up.direction, front_m - rear_m)
    for (right_m, left_m), (right, other) in zip(
        axles_m, (("RR", "RL"), ("FR", "FL")), strict=True
    ):
        if (left_m - right_m) @ left <= 0.0:
            raise InputError(
                f"hints: {other} lies to the right of {right}, with up by {up.by}: exchange the "
                "two, or the front and the rear"
            )
    notes = [
        note_on_hint(hint, wheel, patch, config)
        for hint, wheel, patch in zip(hints, REFERENCE_WHEELS, found.patches, strict=True)
    ]
    return [named], Naming(BY_OPERATOR, up.by, found.points, tuple(notes))


def _ways(found: Found, capture: Capture) -> tuple[list[Mapping[str, int]], Naming]:
    """Return the target of each wheel; in both senses where only markers show the front."""
    targets = found.targets
    stand = None if capture.up == "z" else partial(stand_on_a_floor, found.sample_m)
    axles = find_axles(targets, capture.target.radius_m, stand)
    centres_m = axles.centres_m(targets)
    up = find_up(found.sample_m, centres_m, capture.up)
    first_m, second_m = centres_m.mean(axis=1)
    notes = _left_out([targets[i] for i in axles.left_out])
    if capture.front is not None:
        ahead = capture.front.is_ahead(first_m, second_m)
        naming = Naming(capture.front.note, up.by, found.points, notes)
        return [axles.named(targets, up.direction, ahead)], naming
    if not names_wheels(capture.target):
        along = (second_m - first_m) / np.linalg.norm(second_m - first_m)
        one, other = (",".join(f"{x:.2f}" for x in way + 0.0) for way in (along, -along))
        raise InputError(
            f"the front of the vehicle is unknown: add --front {one} or --front {other}, whichever "
            "points forward, or --front-point X,Y,Z near the front"
        )
    both: list[Mapping[str, int]] = [
        axles.named(targets, up.direction, ahead) for ahead in (True, False)
    ]
    return both, Naming(BY_MARKERS, up.by, found.points, notes)


def _left_out(targets: Sequence[FoundTarget]) -> tuple[str, ...]:
    """Return a note on targets that are at no wheel."""
    if not targets:
        return ()
    shown = [placed(target) for target in targets[:MOST_SHOWN]]
    if len(targets) > MOST_SHOWN:
        shown.append(Wording("{count} more", count=len(targets) - MOST_SHOWN))
    return (Wording(LEFT_OUT, parts="; ".join(shown)),)


def names_wheels(target: Target) -> bool:
    """Return whether the markers of the target's boards name their wheels."""
    return isinstance(target, PatternTarget) and target.wheels is not None


def _fitted(
    found: Found, index: int, wheel: str, target: Target, config: Config, fit: Fit
) -> Evidence:
    try:
        return fit(found.patches[index], target, config)
    except NotMeasuredError as error:
        of_wheel = f" of {wheel}," if wheel else ""
        scan = f" of {found.scans[index]}" if found.scans[index] else ""
        raise InputError(
            f"the target{of_wheel} {placed(found.targets[index])}{scan}, was not measured "
            f"({error.status}): {error}: scan the vehicle again, or check --target"
        ) from error
