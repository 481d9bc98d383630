"""Notes on what the angles are of, and on what counts as zero in their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..centre import MOST_M, lies_on_wheel, unlike_wheels
from ..config import InstrumentConfig
from ..errors import Wording
from ..targets import PatternTarget, Target, WheelTarget
from ..vehicle import build_reference_frame
from .estimates import vertical_tilts
from .records import Estimate, Measurement, VerticalKind, WheelResult
from .repeatability import pool_repeats

SHOWN_M = 0.05  # stand-off by which the effect of unlike targets is shown

MEASURED_FROM = "Camber, caster and SAI are measured from {vertical} ({by})."
AGAINST_WHEELS = (
    "From {vertical} ({by}) against {other}: camber {left} on the left and {right} on the right, "
    "SAI the other way, caster {caster}."
)
OF_AXLES = "The angles of {names} are those of the axle, compensated for run-out."
MOUNTING_SHOWN = (
    "The angles of {names} are those of the targets as mounted: their mounting is in the "
    "uncertainty as far as the run-outs of the other wheels show it."
)
MOUNTING_UNKNOWN = (
    "The angles of {names} are those of the targets as mounted: no run-out compensates them, and "
    "the target file states no clamp_tilt_deg, so that their mounting is not in the uncertainty."
)
OF_RIMS = (
    "The axes of {names} are those of the rims, and their centres lie level with the edge of the "
    "rim's flange."
)
OF_TYRES = (
    "No flange of a rim stands out in the scans of {names}: their axes are those of the tyres, "
    "with more uncertainty, and their centres lie level with the tyre's widest ring."
)
OFF_TYRES = (
    "No flange of a rim stands out in the scan of {name}: its axis is that of the tyre, with more "
    "uncertainty, and its centre is carried {bulge} mm inwards from the tyre's widest ring to the "
    "flange of the other wheels (u {u} mm)."
)
RIM_RUN_OUT = (
    "The run-out of {names} against the spin axis is not in the uncertainty: no turned scans show "
    "it, and [target] states no rim_runout."
)
CARRIED = (
    "The centres of {names} are those of the wheels, level with the edge of the rim's flange, from "
    "which the targets stand {stand_off} mm outwards as stated (u {u} mm)."
)
OF_TARGETS = (
    "The centres of {names} are those of the targets, the others those of the wheels: tracks and "
    "wheelbases are between these points."
)
UNLIKE = (
    "{names}: unlike the other side of the axle, at a distance from the rim that is not stated, "
    "which skews the frame: every {every} mm turn the normal of the rear axle by {toe}' (toe), up "
    "by {camber}' (camber), and the line through the middles of both axles by {middles}'. {most} "
    "mm are in the uncertainty: state stand_off and stand_off_u of the target to be rid of this."
)
SCATTERED = (
    "Repeat scans of {name} scatter more than their uncertainty says: beyond it, {sizes} (one "
    "standard deviation of a scan). This is in the uncertainty of their pooled values, not in that "
    "of each scan: check whether something moved between them."
)
NOT_UPRIGHT = (
    "The stated errors of the scanner's axes count about z of the scans, which lies {off}° from "
    "{vertical}: if the scanner stood upright, their uncertainty is wrong: export the scans with z "
    "up."
)
UPRIGHT_DEG = 20.0  # from z to the vertical: more is no ramp and no scanner set up by hand
ZEROS = "Counted as zero, as no file states them: {parts}."

# Terms of [instrument] by their names in the notes.
RANGE = {
    "range bias": "range_bias_m",
    "range scale": "range_scale_ppm",
    "range by incidence": "incidence_bias_m",
}
AXES = {
    "collimation": "collimation_arcsec",
    "trunnion axis": "trunnion_arcsec",
    "vertical index": "vertical_index_arcsec",
    "azimuth eccentricity": "azimuth_eccentricity_arcsec",
    "elevation eccentricity": "elevation_eccentricity_arcsec",
    "beam offset": "beam_offset_m",
}
STATION = {"pointing": "pointing_urad", "registration": "registration_m"}


def notes_of_assumptions(
    measurement: Measurement, target: Target, instrument: InstrumentConfig
) -> tuple[str, ...]:
    """Return what a reader of the first page has to know of axles, mounting and stated errors.

    target: of the scans whose own is not known.
    """
    return (
        *_notes_of_verticals(measurement),
        *_note_of_axles(measurement),
        *_note_of_bare_wheels(measurement, target),
        *_note_of_centres(measurement),
        *_note_of_repeats(measurement),
        *_note_of_mounting(measurement, target),
        *_note_of_z(measurement, instrument),
        *_note_of_zeros(measurement, target, instrument),
    )


VERTICALS: dict[VerticalKind, str] = {
    "wheels": "the normal to the plane of the wheel centres",
    "floor": "the floor's normal",
    "gravity": "gravity",
}


def _notes_of_verticals(measurement: Measurement) -> Iterator[str]:
    """Yield a note on the vertical in use, unless it is the default, and on others that differ."""
    used = measurement.vertical
    if used is not None:
        named = VERTICALS[used.kind]
        yield Wording(MEASURED_FROM, vertical=named, by=used.by)
    for vertical in measurement.verticals:
        aside, ahead = vertical_tilts(measurement, vertical)
        in_use = vertical is used or (used is not None and used.kind == vertical.kind)
        if (
            not in_use
            and max(abs(aside.value) - aside.expanded, abs(ahead.value) - ahead.expanded) < 0
        ):
            continue
        yield Wording(
            AGAINST_WHEELS,
            vertical=VERTICALS[vertical.kind],
            by=vertical.by,
            other=VERTICALS["wheels"],
            left=_arc(-aside.value, aside),
            right=_arc(aside.value, aside),
            caster=_arc(ahead.value, ahead),
        )
        yield from vertical.notes


def _arc(value: float, known: Estimate) -> str:
    """Write a difference of angles with its U, minutes of arc."""
    return f"{math.degrees(value) * 60:+.1f}' (U {math.degrees(known.expanded) * 60:.1f}')"


def _note_of_axles(measurement: Measurement) -> Iterator[str]:
    axles = [w.observation.name for w in measurement.wheels if w.compensated]
    if axles:
        yield Wording(OF_AXLES, names=_and(axles))


def _note_of_repeats(measurement: Measurement) -> Iterator[str]:
    """Yield a note on each wheel whose repeat scans contradict each other."""
    for group in pool_repeats(measurement):
        sizes = [
            f"{a.kind} {math.degrees(a.scatter) * 60:.1f}'" for a in group.angles if a.scatter > 0.0
        ]
        if sizes:
            yield Wording(SCATTERED, name=group.of, sizes=_and(sizes))


def _note_of_mounting(measurement: Measurement, target: Target) -> Iterator[str]:
    """Yield a note on wheels, and on trials, whose targets may be mounted off their axles."""
    shown = {"reference": "the wheels", "trial": "the trials"}
    for role, scatter in (("reference", measurement.plates is not None), ("trial", False)):
        of_role = [w for w in measurement.wheels if w.observation.role == role and w.pose]
        mounted = [
            wheel.observation.name
            for wheel in of_role
            if not wheel.compensated
            and not _is_bare(wheel, target)
            and _shown(wheel, target).clamp_tilt_deg == 0.0
        ]
        if not mounted:
            continue
        names = shown[role] if len(mounted) == len(of_role) else _and(mounted)
        yield Wording(MOUNTING_SHOWN if scatter else MOUNTING_UNKNOWN, names=names)


def _note_of_bare_wheels(measurement: Measurement, target: Target) -> Iterator[str]:
    """Yield notes on what wheels without targets were measured by, and on the rims' run-out."""
    shown = ("reference", "trial")
    posed = [w for w in measurement.wheels if w.pose and w.observation.role in shown]
    seen = [wheel for wheel in posed if _is_bare(wheel, target)]
    carried = [w.observation for w in seen if w.observation.on_wheel is not None]
    by = {
        method: [w.observation.name for w in seen if w.observation.fitted.method == method]
        for method in ("flange", "tyre")
    }
    by["tyre"] = [name for name in by["tyre"] if name not in [one.name for one in carried]]
    if by["flange"]:
        yield Wording(OF_RIMS, names=_and(by["flange"]))
    if by["tyre"]:
        yield Wording(OF_TYRES, names=_and(by["tyre"]))
    for one in carried:
        assert one.evidence is not None
        bulge_m = np.linalg.norm(one.fitted.centre_m - one.evidence.target.centre_m)
        u_m = np.linalg.norm(one.fitted.components[-1].factor)
        yield Wording(OFF_TYRES, name=one.name, bulge=f"{bulge_m * 1e3:.1f}", u=f"{u_m * 1e3:.1f}")
    unstated = [w for w in seen if _shown(w, target).clamp_tilt_deg == 0.0]
    own = [w.observation.name for w in unstated if not w.compensated]
    if own:
        yield Wording(RIM_RUN_OUT, names=_and(own))


def _note_of_centres(measurement: Measurement) -> Iterator[str]:
    """Yield notes on where the centres lie: carried to their wheels, or at unlike distances."""
    references = measurement.wheels[:4]
    targets = [wheel.observation.target for wheel in references]
    for number, target in enumerate(targets):
        if target is None or target.stand_off is None or target in targets[:number]:
            continue
        assert target.stand_off_u is not None
        names = [w.observation.name for w in references if w.observation.target == target]
        yield Wording(
            CARRIED,
            names=_and(names),
            stand_off=f"{target.stand_off * 1e3:+.1f}",
            u=f"{target.stand_off_u * 1e3:.2f}",
        )
    own = [w.observation.name for w in references if not lies_on_wheel(w.observation.target)]
    if 0 < len(own) < len(references):
        yield Wording(OF_TARGETS, names=_and(own))
    unlike = unlike_wheels(targets)
    if unlike:
        toe, camber, middles = (math.degrees(x) * 60 for x in _skewed(measurement, unlike))
        yield Wording(
            UNLIKE,
            names=_and(unlike),
            every=f"{SHOWN_M * 1e3:.0f}",
            toe=f"{toe:.1f}",
            camber=f"{camber:.1f}",
            middles=f"{middles:.1f}",
            most=f"{MOST_M * 1e3:.0f}",
        )


def _skewed(measurement: Measurement, unlike: Sequence[str]) -> tuple[float, float, float]:
    """Return the turns of rear-axle normal, up and centreline where targets stand SHOWN_M off.

    Where both of an axle are unlike each other, one of them: it is their difference that skews.
    """
    references = measurement.wheels[:4]
    centres = np.stack([wheel.observation.fitted.centre_m for wheel in references])
    moved = centres.copy()
    one_of_axle = {name[0]: name for name in unlike}.values()
    for row, wheel in enumerate(references):
        if wheel.observation.name in one_of_axle and wheel.normal is not None:
            moved[row] -= SHOWN_M * wheel.normal
    frame, other = build_reference_frame(centres), build_reference_frame(moved)
    along = [each[2:].mean(axis=0) - each[:2].mean(axis=0) for each in (centres, moved)]
    level = [frame.R_vehicle_scanner @ way for way in along]
    middles = math.atan2(level[1][0], level[1][1]) - math.atan2(level[0][0], level[0][1])
    return (
        abs(math.asin(float(other.forward @ frame.left))),
        abs(math.asin(float(other.up @ frame.left))),
        abs(middles),
    )


def _note_of_z(measurement: Measurement, instrument: InstrumentConfig) -> Iterator[str]:
    """Yield a note where axis errors are stated, but z of the scans is far from the vertical.

    The vertical is gravity where it is stated, and the normal to the wheel centres otherwise.
    """
    if len(_missing(instrument, AXES)) == len(AXES):
        return
    kind: VerticalKind = "wheels"
    up = measurement.frame.up
    for vertical in measurement.verticals:
        if vertical.kind == "gravity":
            kind, up = "gravity", vertical.normal
    off_deg = math.degrees(math.atan2(math.hypot(up[0], up[1]), abs(up[2])))
    if off_deg > UPRIGHT_DEG:
        yield Wording(NOT_UPRIGHT, off=f"{off_deg:.0f}", vertical=VERTICALS[kind])


def _note_of_zeros(
    measurement: Measurement, target: Target, instrument: InstrumentConfig
) -> Iterator[str]:
    missing = _missing(instrument, RANGE)
    axes = _missing(instrument, AXES)
    missing += ["axis errors"] if len(axes) == len(AXES) else axes
    missing += _missing(instrument, STATION)
    zeros: list[str] = [Wording("{names} of the scanner", names=_and(missing))] if missing else []
    flat = [_shown(w, target) for w in measurement.wheels if not _is_bare(w, target)]
    if any(one.flatness == 0.0 for one in flat):
        zeros.append("flatness of the target")
    zeros += ["range bias of the print"] if _hides_brightness(measurement, target) else []
    if zeros:
        yield Wording(ZEROS, parts="; ".join(zeros))


def _missing(instrument: InstrumentConfig, terms: dict[str, str]) -> list[str]:
    return [name for name, key in terms.items() if getattr(instrument, key) == 0.0]


def _hides_brightness(measurement: Measurement, target: Target) -> bool:
    """Return whether a print may tilt a plane with which range by brightness was not fitted."""
    printed = [w for w in measurement.wheels if isinstance(_shown(w, target), PatternTarget)]
    found = (wheel.observation.evidence for wheel in printed)
    planes = [evidence.plane for evidence in found if evidence and evidence.plane]
    return any(plane.brightness is None for plane in planes)


def _shown(wheel: WheelResult, target: Target) -> Target:
    """Return the target that a scan shows; `target` where its own is not known."""
    return wheel.observation.target or target


def _is_bare(wheel: WheelResult, target: Target) -> bool:
    return isinstance(_shown(wheel, target), WheelTarget)


def _and(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
