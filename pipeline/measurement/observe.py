"""Observation of the target in the scan of a single wheel, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..capture import Capture, Hint, ScanEntry, Searched, searched
from ..cloud import cloud_sample, over_items
from ..config import Config, InstrumentConfig
from ..diagnostics import check_poses, check_wheel_scan, lone_points
from ..errors import InputError, NotMeasuredError, Wording
from ..plane import Patch, PlaneFit
from ..system import stage
from ..targets import Target
from ..vectors import Array
from ..wheel import find_patch
from .records import Evidence, Observation

NOISY = 1.5  # times the stated range noise
CHOSEN = (
    "{name}: {choice}; the match of its outline is {match} ({least} needed where nobody chooses)."
)
ROUNDED = (
    "The coordinates of {names} lie in steps of {step}, which is not fine against their noise: "
    "rounding adds to the uncertainty, as a component of its own; export more decimals to avoid it."
)
THINNED = (
    "The points of {names} were thinned on a voxel grid of about {edge}, along whose cells the "
    "targets lie: the cells pull the planes. The pull is fitted with the planes, and what it hides "
    "is in the uncertainty, as a component of its own; export without voxel thinning, or thin at "
    "random."
)
SPACED = (
    "The points of {names} lie at least {distance} apart, as of a scan thinned so: in the order of "
    "the file this keeps more of the noise on one side of a plane. By how much it may pull the "
    "planes along their normals is in the uncertainty, as a component of its own; export without "
    "thinning, or thin at random."
)
COPIES = (
    "{share} of the points on the target of {name} are in the places of others, as of a cloud that "
    "was merged with itself: each place was counted once; export every point once."
)
MESHED = (
    "The points of {names} are the corners of a mesh: where it joins several views, it is smoother "
    "than they are, and by how much they were registered wrongly does not show in it, so u is too "
    "small; export the scanner's points."
)
OUTERMOST = (
    "The centres of {names} are by the outermost points of their targets, with u of up to {u} mm: "
    "no fit explains the edges, as where a crop cuts them, or nothing lies behind. Keep 20 mm "
    "around each target in the scan, and what is behind it."
)
BROKEN = {
    "step": (
        "The target's face has a step along a line, by {sizes}: its plane is that of all points, "
        "and what the step tilts it by is in the uncertainty (flatness). Look for a label, dirt or "
        "damage on it, or for another surface that adjoins it."
    ),
    "bend": (
        "The target's face is bent along a line, so that its edge is lifted by {sizes}: its plane "
        "is that of all points, and what the bend tilts it by is in the uncertainty (flatness). "
        "Straighten or replace it."
    ),
    "area": (
        "A part of the target's face is raised, or sunk, by {sizes}: its plane is that of all "
        "points, and what this part tilts it by is in the uncertainty (flatness). Look for a "
        "label, a thin plate, dirt or damage on it, and remove it."
    ),
}
SHADED = (
    "Ranges follow brightness: bright parts of the target lie nearer to the scanner than its dark "
    "ones, across its plane, by {sizes}. This is fitted with the plane and removed; a target of "
    "one brightness avoids it."
)
STATIONS = (
    "The targets of {names} were seen by several stations, merged into one cloud, that disagree "
    "there, by up to {sizes}. The results are means of the stations, and what they "
    "disagree by is in the uncertainty, as a component of its own; register the stations better, "
    "give the scan of one, or state registration_m and pointing_urad in the scanner file."
)
NOT_PRINTED = {
    "no-intensity": (
        "The scans of {names} hold no intensities, so the print on their targets is not seen: "
        "centre and in-plane rotation are by the edges alone; export the scans with intensities."
    ),
    "not-found": (
        "The print on the targets of {names} was not found: centre and in-plane rotation are by "
        "the edges alone; check the target's file against the board, and the scans' intensities."
    ),
}
NOISE = (
    "The noise of {name} across its plane, {sigma} mm, is {ratio} times the range noise in the "
    "scanner file: check the target's surface, and the file."
)

Fit = Callable[[Patch, Target, Config], Evidence]


def observe_entries(
    capture: Capture,
    config: Config,
    fit_target: Fit,
    progress: Callable[[str], None],
    several: bool = True,
) -> list[Observation]:
    """Read the scans of a capture and measure their targets.

    several: whether fit_target may be called for several scans at once.

    Raises InputError when a file is unreadable, or when the target of a reference wheel, which
    the frame needs, was not measured.
    """

    def begins(entry: ScanEntry) -> None:
        progress(entry.file)

    def observe(entry: ScanEntry) -> Observation:
        return observe_entry(entry, capture, config, fit_target)

    return over_items(observe, capture.entries, begins, several)


def observe_entry(
    entry: ScanEntry, capture: Capture, config: Config, fit_target: Fit
) -> Observation:
    """Read a scan and measure the target in it.

    Raises InputError when the file is unreadable, or when the target of a reference wheel was not
    measured.
    """
    source = f"{capture.source}: {entry.file}"
    observation, patch = _find(entry, source, capture, config)
    try:
        if isinstance(patch, NotMeasuredError):
            raise patch
        evidence = fit_target(patch, capture.target_of(entry), config)
        return replace(observation, evidence=evidence, wheel=_wheel_of(entry, evidence, source))
    except NotMeasuredError as error:
        if entry.role == "reference":
            raise InputError(
                f"{source}: the target of reference wheel {entry.name} was not measured "
                f"({error.status}): {error}: {_advice(error)}"
            ) from error
        return replace(observation, status=error.status, reason=str(error))


def _advice(error: NotMeasuredError) -> str:
    """Return what to do where the target of a reference wheel was not measured."""
    if error.status == "steps-too-coarse":
        return "export this scan again with more decimals, or as double"
    if error.status in ("ambiguous-target", "no-target", "no-outline"):
        return (
            "see what was found with --explain DIR and choose with --hint, scan this wheel again, "
            "or check --target and length_unit"
        )
    return "scan this wheel again, or check --target and length_unit"


def _wheel_of(entry: ScanEntry, evidence: Evidence, source: str) -> str | None:
    """Return the wheel that the scan is named for, or else that of its board's markers.

    Raises InputError where the two contradict each other.
    """
    marked = evidence.target.wheel
    if marked is not None and entry.wheel not in (None, marked):
        raise InputError(
            f"{source}: it is named for {entry.wheel}, but the markers of its board are those of "
            f"{marked}: correct the scan's name, or the markers in the target's file"
        )
    return entry.wheel or marked


@stage("segment")
def _find(
    entry: ScanEntry, source: str, capture: Capture, config: Config
) -> tuple[Observation, Patch | NotMeasuredError]:
    """Find the patch with its target in the scan, which is read, and freed on return."""
    scan = entry.read(capture.length_unit, source, capture.reading)
    target = capture.target_of(entry)
    check_poses(scan.parts, source)
    check_wheel_scan(scan.points_m, 2.0 * target.radius_m, capture.length_unit, source)
    observation = Observation(
        name=entry.name,
        role=entry.role,
        wheel=entry.wheel,
        source=entry.file,
        sha256=entry.sha256,
        points_total=len(scan.points_m),
        invalid_points=scan.invalid_points,
        repeats=entry.repeats,
        turn=entry.turn,
        notes=notes_on_lone_points(scan.points_m, entry.file),
        target=target,
        is_mesh=scan.is_mesh,
    )
    part = scan.parts[0] if len(scan.parts) == 1 else None
    axes = None if part is None else part.axes
    hint = capture.hints.get(entry.name)
    within = searched(scan, hint, source)
    try:
        patch = find_searched(within, target, config, axes)
    except NotMeasuredError as error:
        unplaced = replace(observation, cloud=cloud_sample(scan.points_m))
        return unplaced, error.with_traceback(None)
    shown = cloud_sample(scan.points_m, target_m=patch.origin_m)
    notes = (*observation.notes, *notes_on_copies(patch, entry.name))
    observation = replace(observation, cloud=shown, notes=notes)
    if hint is not None:
        chosen = note_on_hint(hint, entry.name, patch, config)
        observation = replace(observation, notes=(*observation.notes, chosen))
    return observation, replace(patch, station_m=None if part is None else part.station_m)


def find_searched(within: Searched, target: Target, config: Config, axes: Array | None) -> Patch:
    """Find the target among the points that are searched, and cut it out of all that are used.

    So a region chooses a target as a point on it does: its border cuts nothing off.
    axes: as in `find_target`. Raises NotMeasuredError.
    """
    used, near_m = within.used, within.near_m
    try:
        if not within.by_region:
            return find_patch(used.points_m, target, config, used.intensity, axes, near_m)
        place_m = find_patch(within.points.points_m, target, config, None, axes, near_m).origin_m
        patch = find_patch(used.points_m, target, config, used.intensity, axes, place_m)
    except NotMeasuredError as error:
        there = within.hint.there if within.hint else ""
        raise NotMeasuredError(error.status, f"{there}{error}") from error
    if not within.shows(patch.origin_m):
        place = ", ".join(f"{x:.3f}" for x in patch.origin_m + 0.0)
        note = within.hint.note if within.hint else ""
        reason = f"{note}: the target there has its centre ({place}) m outside of it"
        raise NotMeasuredError("no-target", reason)
    return patch


def note_on_hint(hint: Hint, name: str, patch: Patch, config: Config) -> str:
    """Return the note on a target that the operator chose."""
    return Wording(
        CHOSEN,
        name=name,
        choice=hint.note,
        match=f"{patch.match:.2f}",
        least=f"{config.segment.min_match:.2f}",
    )


def notes_on_copies(patch: Patch, name: str) -> tuple[str, ...]:
    """Return a note on points that a scan holds more than once; none without."""
    if not patch.copies:
        return ()
    share = patch.copies / (patch.copies + len(patch.face_m))
    return (Wording(COPIES, name=name, share=f"{share * 100:.0f} %"),)


def rounded(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note for scans in which rounded coordinates add to the uncertainty, one a step."""

    def step(plane: PlaneFit) -> str:
        found = plane.rounding
        return "" if found is None else f"{float(found.steps.step_m.max()) * 1e3:.3g} mm"

    for size, names in _names_by(observations, step):
        yield Wording(ROUNDED, names=names, step=size)


def spaced(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note for scans thinned to a least distance between points, one a distance."""

    def distance(plane: PlaneFit) -> str:
        return f"{plane.spaced_m * 1e3:.2g} mm" if plane.spaced_m else ""

    for size, names in _names_by(observations, distance):
        yield Wording(SPACED, names=names, distance=size)


def by_outermost(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note on targets whose edges no fit explains, with the largest u of their centres."""
    fitted = {one.name: one.evidence.target for one in observations if one.evidence is not None}
    found = {name: target for name, target in fitted.items() if target.method == "outline"}
    if found:
        covariances = np.stack([target.centre_covariance_m2 for target in found.values()])
        u_mm = 1e3 * math.sqrt(float(np.linalg.eigvalsh(covariances).max()))
        yield Wording(OUTERMOST, names=", ".join(found), u=f"{u_mm:.2g}")


def meshed(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note for scans whose points are the corners of a mesh."""
    names = [one.name for one in observations if one.is_mesh and one.evidence is not None]
    if names:
        yield Wording(MESHED, names=", ".join(names))


def thinned(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note for scans thinned on a voxel grid that pulls their planes, one an edge."""

    def edge(plane: PlaneFit) -> str:
        found = plane.thinning
        return "" if found is None else f"{found.edge_m * 1e3:.2g} mm"

    for size, names in _names_by(observations, edge):
        yield Wording(THINNED, names=names, edge=size)


def _names_by(
    observations: Sequence[Observation], size_of: Callable[[PlaneFit], str]
) -> list[tuple[str, str]]:
    """Return each size that planes show, and the names of their scans; "" shows none."""
    names: dict[str, list[str]] = {}
    for observation in observations:
        plane = observation.evidence.plane if observation.evidence else None
        if plane is not None and (size := size_of(plane)):
            names.setdefault(size, []).append(observation.name)
    return [(size, ", ".join(scans)) for size, scans in names.items()]


def shaded(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note where ranges follow the brightness of a target beyond doubt, with the size."""

    def step(plane: PlaneFit) -> tuple[str, float] | None:
        found = plane.brightness
        return ("", found.step_m) if found is not None and found.significant else None

    for sizes in _sizes_by(observations, step).values():
        yield Wording(SHADED, sizes=sizes)


def broken(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note each on targets whose face has a step, a bend or a raised part, with sizes."""

    def height(plane: PlaneFit) -> tuple[str, float] | None:
        found = plane.broken
        return (found.kind, found.height_m) if found is not None and found.is_noted else None

    for kind, sizes in _sizes_by(observations, height).items():
        yield Wording(BROKEN[kind], sizes=sizes)


def _sizes_by(
    observations: Sequence[Observation], found_in: Callable[[PlaneFit], tuple[str, float] | None]
) -> dict[str, str]:
    """Return of each kind that planes show, by kind and metres, the sizes with their scans."""
    sizes: dict[str, list[str]] = {}
    for observation in observations:
        plane = observation.evidence.plane if observation.evidence else None
        found = found_in(plane) if plane is not None else None
        if found is not None:
            kind, size_m = found
            size = Wording("{size} mm ({name})", size=f"{size_m * 1e3:+.2f}", name=observation.name)
            sizes.setdefault(kind, []).append(size)
    return {kind: ", ".join(several) for kind, several in sizes.items()}


def not_as_registered(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note on targets at which merged stations differ beyond their noise, with sizes."""
    names, sizes = [], []
    for observation in observations:
        found = observation.evidence.target.stations if observation.evidence else None
        if found is not None and found.significant:
            names.append(observation.name)
            size = f"{found.shift_m * 1e3:.2f} mm, {math.degrees(found.tilt_rad):.3f}°"
            sizes.append(Wording("{size} at {name}", size=size, name=names[-1]))
    if names:
        yield Wording(STATIONS, names=", ".join(names), sizes=", ".join(sizes))


def not_printed(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note for targets whose print was not used, one for each reason."""
    names: dict[str, list[str]] = {}
    for observation in observations:
        missed = observation.evidence.target.print_missed if observation.evidence else None
        if missed is not None:
            names.setdefault(missed, []).append(observation.name)
    for reason, scans in names.items():
        yield Wording(NOT_PRINTED[reason], names=", ".join(scans))


def notes_on_lone_points(points_m: Array, name: str) -> tuple[str, ...]:
    """Return a note on the few points of a scan far from all others; none without."""
    lone = lone_points(points_m)
    return (Wording("{file}: {fact}: check its export.", file=name, fact=lone),) if lone else ()


def noisy(observations: Sequence[Observation], instrument: InstrumentConfig) -> Iterator[str]:
    """Yield a note for every scan whose noise is well above the scanner's stated range noise."""
    if instrument.range_sigma_m is None:
        return
    for observation in observations:
        plane = observation.evidence.plane if observation.evidence else None
        if plane is not None and plane.sigma_m > NOISY * instrument.range_sigma_m:
            yield Wording(
                NOISE,
                name=observation.name,
                sigma=f"{plane.sigma_m * 1e3:.2f}",
                ratio=f"{plane.sigma_m / instrument.range_sigma_m:.1f}",
            )
