"""Observation of all four targets in a whole-vehicle scan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .. import wheel as bare_wheel
from ..capture import Capture, Hint, ScanEntry, Searched, boxed
from ..cloud import by_wheel, over_items, sample
from ..config import Config
from ..detection import (
    Axles,
    FoundTarget,
    find_axles,
    find_up,
    is_bodied,
    listed,
    placed,
    stand_on_a_floor,
    wheels_by_markers,
)
from ..diagnostics import check_poses, check_vehicle_cloud
from ..errors import InputError, NotMeasuredError, Wording
from ..plane import Patch
from ..readers import Part
from ..system import frozen, stage
from ..targets import PatternTarget, Target
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .observe import Fit, note_on_hint, notes_on_copies, notes_on_lone_points
from .records import Evidence, Naming, Observation

if TYPE_CHECKING:
    from ..wheel import WheelPlace

SAMPLE = 400_000  # points of the cloud that are kept, to find its floor


@frozen
class Found:
    """Targets found in a whole-vehicle scan, with a sample of its points.

    kinds: of targets on the vehicle. scans: name of the file's scan that each part is; '' if the
    file holds one only. notes: findings about the points. is_mesh: whether these are the corners of
    a mesh.
    """

    places: tuple[WheelPlace, ...]
    kinds: tuple[Target, ...]
    scans: tuple[str, ...]
    sample_m: Array
    points: int
    invalid_points: int
    notes: tuple[str, ...] = ()
    is_mesh: bool = False

    @property
    def targets(self) -> tuple[FoundTarget, ...]:
        """Position, normal and match of the best patch at each place, by which wheels are named."""
        best = (place.best for place in self.places)
        return tuple(FoundTarget(p.origin_m, p.basis[2], p.match) for p in best)

    def shows(self, index: int, target: Target) -> bool:
        """Return whether such a target was found at a place."""
        return self.kinds.index(target) in self.places[index].patches

    def patch(self, index: int, target: Target) -> Patch:
        """Return the patch of a target at a place that shows it."""
        return self.places[index].patches[self.kinds.index(target)]

    def scan_of(self, index: int, target: Target) -> str:
        """Return the name of the file's scan that such a patch is from."""
        return self.scans[self.patch(index, target).part]


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
    scan = cloud.read(capture.length_unit, source, capture.reading, in_place=True)
    check_poses(scan.parts, source)
    hint = capture.hints.get("vehicle")
    within = boxed(scan, hint, source)
    scan, kinds = within.used, kinds_of(capture)
    smallest_m = 2.0 * min(kind.radius_m for kind in kinds)
    check_vehicle_cloud(scan.points_m, smallest_m, capture.length_unit, source)
    progress(f"{cloud.file}: searching")
    parts = scan.parts or (Part("", 0, len(scan.points_m), None),)
    seen = bare_wheel.VehicleScan(
        points_m=scan.points_m,
        intensity=scan.intensity,
        parts=[(p.start, p.stop) for p in parts],
        stations_m=[p.station_m for p in parts],
        axes=[p.axes for p in parts],
    )
    near_m = [
        (kinds.index(target), chosen.near)
        for wheel, target in capture.of_wheels.items()
        if (chosen := capture.hints.get(wheel)) and chosen.near is not None
    ]
    try:
        places = bare_wheel.find_places(seen, kinds, config, near_m)
    except NotMeasuredError as error:
        there = hint.there if hint else ""
        raise InputError(f"{source}: {there}{error}: check the file, and --target") from error
    if not near_m:
        places = _in_region(places, within, source)
    copies = [notes_on_copies(place.best, cloud.file) for place in places]
    return Found(
        places=places,
        kinds=kinds,
        scans=tuple(part.name if len(parts) > 1 else "" for part in parts),
        sample_m=sample(scan.points_m, SAMPLE),
        points=len(scan.points_m),
        invalid_points=scan.invalid_points,
        notes=(
            *notes_on_lone_points(scan.points_m, cloud.file),
            *_notes(hint),
            *next(filter(None, copies), ()),
        ),
        is_mesh=scan.is_mesh,
    )


def kinds_of(capture: Capture) -> tuple[Target, ...]:
    """Return the unlike targets on the wheels of a vehicle, each once."""
    of_wheels = list(capture.of_wheels.values())
    return tuple(one for i, one in enumerate(of_wheels) if one not in of_wheels[:i])


def _in_region(
    places: tuple[WheelPlace, ...], within: Searched, source: str
) -> tuple[WheelPlace, ...]:
    """Return the targets in the operator's region. Raises InputError where it has none of them."""
    inside = tuple(place for place in places if within.shows(place.best.origin_m))
    if places and not inside:
        raise InputError(
            f"{source}: {within.hint.note if within.hint else ''}, which holds none of the "
            f"{len(places)} targets that are found: draw it about all four"
        )
    return inside


def _notes(hint: Hint | None) -> tuple[str, ...]:
    """Return a note on where the operator had the targets searched; none without."""
    return () if hint is None else (Wording(SEARCHED, choice=hint.note),)


MOST_SHOWN = 4
SEARCHED = "vehicle: {choice}."
FURTHER = (
    "The vehicle has more than two axles: of those closer together than a wheelbase, the one "
    "nearest to the other end is measured, and the others are not: {parts}."
)
LEFT_OUT = "Like the target, but at none of the vehicle's wheels: {parts}."
BY_OPERATOR = "the wheels that the operator named"
BY_MARKERS = "the markers of the boards"


def observe_cloud(
    cloud: ScanEntry,
    capture: Capture,
    config: Config,
    fit: Fit,
    progress: Callable[[str], None],
    several: bool = True,
) -> tuple[list[Observation], Naming]:
    """Find, name and measure the targets of all four wheels.

    several: whether `fit` may be called for several targets at once.

    Raises InputError when the file is unreadable, when its targets cannot be assigned to wheels,
    and when one of the four cannot be measured.
    """
    from concurrent.futures import ThreadPoolExecutor

    source, of_wheels = capture.called(cloud), capture.of_wheels
    with ThreadPoolExecutor(1) as beside:
        digest = beside.submit(lambda: cloud.sha256)
        found = targets_of_cloud(cloud, source, capture, config, progress)
    try:
        ways, naming = _chosen(found, capture, config) or _ways(found, capture)
        ways = _with_their_targets(ways, found, of_wheels)
        known = len(ways) == 1

        def begins(wheel: str) -> None:
            progress(f"{cloud.file}: {wheel if known else f'target {ways[0][wheel] + 1}'}")

        def fitted(wheel: str) -> Evidence:
            called = wheel if known else ""
            return _fitted(found, ways[0][wheel], called, of_wheels[wheel], config, fit)

        fits = over_items(fitted, list(ways[0]), begins, several)
        evidence = dict(zip(ways[0].values(), fits, strict=True))
        marked = {index: e.target.wheel for index, e in evidence.items() if e.target.wheel}
        named = wheels_by_markers(ways, marked, found.targets)
    except InputError as error:
        hint = capture.hints.get("vehicle")
        there = hint.there if hint else ""
        raise InputError(f"{source}: {there}{error}") from error
    centres_m = np.stack([evidence[named[wheel]].target.centre_m for wheel in REFERENCE_WHEELS])
    observations = [
        Observation(
            name=wheel,
            role="reference",
            wheel=wheel,
            source=": ".join(
                filter(None, (cloud.file, found.scan_of(named[wheel], of_wheels[wheel])))
            ),
            sha256=digest.result(),
            points_total=found.points,
            invalid_points=found.invalid_points,
            evidence=evidence[named[wheel]],
            cloud=shown,
            notes=found.notes if wheel == REFERENCE_WHEELS[0] else (),
            target=of_wheels[wheel],
            is_mesh=found.is_mesh,
        )
        for wheel, shown in zip(REFERENCE_WHEELS, by_wheel(found.sample_m, centres_m), strict=True)
    ]
    return observations, naming


def observe_rolled(
    cloud: ScanEntry,
    capture: Capture,
    observe: Callable[[ScanEntry, Capture], tuple[list[Observation], Naming]],
) -> list[Observation]:
    """Observe all four wheels of a vehicle that has rolled since its first cloud.

    observe: as `observe_cloud`, with what is not of this cloud given.
    """
    four, _ = observe(cloud, replace(capture, hints={}, cloud=cloud))
    return [
        replace(one, name=f"{one.name} {cloud.name}", role="runout", turn=cloud.turn)
        for one in four
    ]


def _chosen(
    found: Found, capture: Capture, config: Config
) -> tuple[list[Mapping[str, int]], Naming] | None:
    """Return the wheels as the operator named their targets, None where he did not.

    Raises InputError where left and right contradict the up direction, or front and rear the front
    that is stated.
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
    if capture.front is not None and not capture.front.is_ahead(rear_m, front_m):
        raise InputError(
            f"hints: FR and FL lie behind RR and RL, by {capture.front.note}: name all four anew, "
            "or correct the front"
        )
    notes = [
        note_on_hint(hint, wheel, place.best, config)
        for hint, wheel, place in zip(hints, REFERENCE_WHEELS, found.places, strict=True)
    ]
    return [named], Naming(BY_OPERATOR, up.by, tuple(notes))


def _ways(found: Found, capture: Capture) -> tuple[list[Mapping[str, int]], Naming]:
    """Return the target of each wheel; in both senses where only markers show the front."""
    targets = found.targets
    stand = None if capture.up == "z" else partial(stand_on_a_floor, found.sample_m)
    near = capture.front.point_m if capture.front is not None else None
    near_m = None if near is None else np.array(near)
    smallest_m = min(kind.radius_m for kind in found.kinds)
    bodied = partial(is_bodied, found.sample_m)
    axles = find_axles(targets, smallest_m, stand, near_m, bodied)
    centres_m = axles.centres_m(targets)
    up = find_up(found.sample_m, centres_m, capture.up)
    first_m, second_m = centres_m.mean(axis=1)
    notes = _of_others(targets, axles)
    if capture.front is not None:
        ahead = capture.front.is_ahead(first_m, second_m)
        naming = Naming(capture.front.note, up.by, notes)
        return [axles.named(targets, up.direction, ahead)], naming
    if not all(names_wheels(kind) for kind in found.kinds):
        along = (second_m - first_m) / np.linalg.norm(second_m - first_m)
        one, other = (
            ",".join(f"{x:.2f}" for x in np.round(way, 2) + 0.0) for way in (along, -along)
        )
        raise InputError(
            f"the front of the vehicle is unknown: add --front {one} or --front {other}, whichever "
            "points forward, or --front-point X,Y,Z near the front"
        )
    both: list[Mapping[str, int]] = [
        axles.named(targets, up.direction, ahead) for ahead in (True, False)
    ]
    return both, Naming(BY_MARKERS, up.by, notes)


def _of_others(targets: Sequence[FoundTarget], axles: Axles) -> tuple[str, ...]:
    """Return notes on the targets of further axles, and on those of no vehicle."""
    further = _named(FURTHER, [targets[i] for i in axles.further])
    return further + _named(LEFT_OUT, [targets[i] for i in axles.left_out])


def _named(sentence: str, targets: Sequence[FoundTarget]) -> tuple[str, ...]:
    """Return a note on targets that are at none of the four wheels."""
    if not targets:
        return ()
    shown = [placed(target) for target in targets[:MOST_SHOWN]]
    if len(targets) > MOST_SHOWN:
        shown.append(Wording("{count} more", count=len(targets) - MOST_SHOWN))
    return (Wording(sentence, parts="; ".join(shown)),)


def names_wheels(target: Target) -> bool:
    """Return whether the markers of the target's boards name their wheels."""
    return isinstance(target, PatternTarget) and target.wheels is not None


def _with_their_targets(
    ways: list[Mapping[str, int]], found: Found, of_wheels: Mapping[str, Target]
) -> list[Mapping[str, int]]:
    """Return the ways in which each wheel shows the target that is stated for it.

    Raises InputError where there is none.
    """
    missing = [
        [(wheel, index) for wheel, index in way.items() if not found.shows(index, of_wheels[wheel])]
        for way in ways
    ]
    showing = [way for way, lacks in zip(ways, missing, strict=True) if not lacks]
    if showing:
        return showing
    wheel, index = missing[0][0]
    others = " and ".join(found.kinds[i].description for i in found.places[index].patches)
    raise InputError(
        f"{wheel} shows {others}, and not {of_wheels[wheel].description} as stated, "
        f"{placed(found.targets[index])}: {listed(found.targets)}: check --target, [targets] and "
        "--front"
    )


def _fitted(
    found: Found, index: int, wheel: str, target: Target, config: Config, fit: Fit
) -> Evidence:
    try:
        return fit(found.patch(index, target), target, config)
    except NotMeasuredError as error:
        of_wheel = f" of {wheel}," if wheel else ""
        scan = found.scan_of(index, target)
        of_scan = f" of {scan}" if scan else ""
        raise InputError(
            f"the target{of_wheel} {placed(found.targets[index])}{of_scan}, was not measured "
            f"({error.status}): {error}: scan the vehicle again, or check --target"
        ) from error
