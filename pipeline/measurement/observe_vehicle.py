"""The faces in the cloud of a whole vehicle: read, searched, and the cloud let go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..capture import Capture, ScanEntry
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
from ..errors import InputError, NotMeasuredError
from ..files import sha256
from ..plane import Patch
from ..readers import Part, read_scan
from ..targets import PatternTarget, Target
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .observe import Fit
from .records import Evidence, Naming, Observation

SAMPLE = 400_000  # points kept of the cloud, by which its floor is found


@dataclass(frozen=True)
class Found:
    """What a cloud showed, its points but a sample let go.

    scans: of each patch, the name of the file's scan that it was taken from; '' of one alone.
    """

    patches: tuple[Patch, ...]
    scans: tuple[str, ...]
    sample_m: Array
    points: int
    invalid_points: int

    @property
    def faces(self) -> tuple[FoundTarget, ...]:
        """The patches as the naming of wheels sees them."""
        return tuple(FoundTarget(p.origin_m, p.basis[2], p.match) for p in self.patches)


def targets_of_cloud(
    cloud: ScanEntry,
    source: str,
    capture: Capture,
    config: Config,
    progress: Callable[[str], None],
) -> Found:
    """The faces of the target; messages call the file `source`.

    Raises InputError when it is unreadable, or cannot be the cloud of a vehicle.
    """
    progress(f"{cloud.file}: reading")
    scan = read_scan(cloud.path, capture.length_unit, source)
    target, unit = capture.target, capture.length_unit
    check_vehicle_cloud(scan.points_m, 2.0 * target.radius_m, unit, source)
    progress(f"{cloud.file}: searching")
    parts = scan.parts or (Part("", 0, len(scan.points_m), None),)
    rows, stations = [(p.start, p.stop) for p in parts], [p.station_m for p in parts]
    try:
        patches = find_targets(
            scan.points_m, target, config.segment, scan.intensity, rows, stations
        )
    except NotMeasuredError as error:
        raise InputError(f"{source}: {error}: check the file, and --target") from error
    return Found(
        patches=patches,
        scans=tuple(parts[patch.part].name if len(parts) > 1 else "" for patch in patches),
        sample_m=sample(scan.points_m, SAMPLE),
        points=len(scan.points_m),
        invalid_points=scan.invalid_points,
    )


MOST_TOLD = 4


def observe_cloud(
    cloud: ScanEntry, capture: Capture, config: Config, fit: Fit, progress: Callable[[str], None]
) -> tuple[list[Observation], Naming]:
    """Find, name and measure the targets of all four wheels.

    Raises InputError when the file is unreadable, when its faces cannot be named, and when one of
    the four cannot be measured.
    """
    source = capture.called(cloud)
    with ThreadPoolExecutor(1) as beside:
        digest = beside.submit(sha256, cloud.path)
        found = targets_of_cloud(cloud, source, capture, config, progress)
    try:
        ways, naming = _ways(found, capture)
        evidence: dict[int, Evidence] = {}
        for wheel, index in ways[0].items():
            label = wheel if len(ways) == 1 else f"face {index + 1}"
            progress(f"{cloud.file}: {label}")
            evidence[index] = _fitted(found, index, label, capture.target, config, fit)
        told = {index: seen.target.wheel for index, seen in evidence.items() if seen.target.wheel}
        named = wheels_by_markers(ways, told, found.faces)
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
        )
        for wheel, shown in zip(REFERENCE_WHEELS, by_wheel(found.sample_m, centres_m), strict=True)
    ]
    return observations, naming


def _ways(found: Found, capture: Capture) -> tuple[list[Mapping[str, int]], Naming]:
    """The face of each wheel; both ways round where only markers can tell the front."""
    faces = found.faces
    stand = None if capture.up == "z" else partial(stand_on_a_floor, found.sample_m)
    axles = find_axles(faces, capture.target.radius_m, stand)
    centres_m = axles.centres_m(faces)
    up = find_up(found.sample_m, centres_m, capture.up)
    first_m, second_m = centres_m.mean(axis=1)
    notes = _left_out([faces[i] for i in axles.left_out])
    if capture.front is not None:
        ahead = capture.front.is_ahead(first_m, second_m)
        naming = Naming(capture.front.note, up.by, found.points, notes)
        return [axles.named(faces, up.direction, ahead)], naming
    if not names_wheels(capture.target):
        along = (second_m - first_m) / np.linalg.norm(second_m - first_m)
        one, other = (",".join(f"{x:.2f}" for x in way + 0.0) for way in (along, -along))
        raise InputError(
            f"which end is the front is not told: add --front {one} or --front {other}, whichever "
            "points forward, or --front-point X,Y,Z near the front"
        )
    both: list[Mapping[str, int]] = [
        axles.named(faces, up.direction, ahead) for ahead in (True, False)
    ]
    return both, Naming("the markers of the boards", up.by, found.points, notes)


def _left_out(faces: Sequence[FoundTarget]) -> tuple[str, ...]:
    """A sentence on the faces that are no wheel's."""
    if not faces:
        return ()
    told = "; ".join(placed(face) for face in faces[:MOST_TOLD])
    more = f"; {len(faces) - MOST_TOLD} more" if len(faces) > MOST_TOLD else ""
    return (f"Like the target, but none of the vehicle's wheels: {told}{more}.",)


def names_wheels(target: Target) -> bool:
    """Whether the target's boards have markers that tell their wheels."""
    return isinstance(target, PatternTarget) and target.wheels is not None


def _fitted(
    found: Found, index: int, label: str, target: Target, config: Config, fit: Fit
) -> Evidence:
    try:
        return fit(found.patches[index], target, config)
    except NotMeasuredError as error:
        scan = f" of {found.scans[index]}" if found.scans[index] else ""
        raise InputError(
            f"the target of {label}, {placed(found.faces[index])}{scan}, was not measured "
            f"({error.status}): {error}: scan the vehicle again, or check --target"
        ) from error
