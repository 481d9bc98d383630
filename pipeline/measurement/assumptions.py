"""Notes on what the angles are of, and on what counts as zero in their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ..config import InstrumentConfig
from ..targets import PatternTarget, Target, WheelTarget
from .estimates import vertical_tilts
from .records import Estimate, Measurement, VerticalKind

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
    """Return what a reader of the first page has to know of axles, mounting and stated errors."""
    return (
        *_notes_of_verticals(measurement),
        *_note_of_axles(measurement),
        *_note_of_bare_wheels(measurement, target),
        *_note_of_mounting(measurement, target),
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
        yield f"Camber, caster and SAI are measured from {named} ({used.by})."
    for vertical in measurement.verticals:
        aside, ahead = vertical_tilts(measurement, vertical)
        in_use = vertical is used or (used is not None and used.kind == vertical.kind)
        if (
            not in_use
            and max(abs(aside.value) - aside.expanded, abs(ahead.value) - ahead.expanded) < 0
        ):
            continue
        yield (
            f"From {VERTICALS[vertical.kind]} ({vertical.by}) against {VERTICALS['wheels']}: "
            f"camber {_arc(-aside.value, aside)} on the left and {_arc(aside.value, aside)} on the "
            f"right, SAI the other way, caster {_arc(ahead.value, ahead)}."
        )


def _arc(value: float, known: Estimate) -> str:
    """Write a difference of angles with its U, minutes of arc."""
    return f"{math.degrees(value) * 60:+.1f}' (U {math.degrees(known.expanded) * 60:.1f}')"


def _note_of_axles(measurement: Measurement) -> Iterator[str]:
    axles = [w.observation.name for w in measurement.wheels if w.compensated]
    if axles:
        yield f"The angles of {_and(axles)} are those of the axle, compensated for run-out."


def _note_of_mounting(measurement: Measurement, target: Target) -> Iterator[str]:
    """Yield a note on wheels, and on trials, whose targets may be mounted off their axles."""
    shown = {"reference": "the wheels", "trial": "the trials"}
    for role, scatter in (("reference", measurement.plates is not None), ("trial", False)):
        of_role = [w for w in measurement.wheels if w.observation.role == role and w.pose]
        mounted = [wheel.observation.name for wheel in of_role if not wheel.compensated]
        if not mounted or target.clamp_tilt_deg > 0.0 or isinstance(target, WheelTarget):
            continue
        names = shown[role] if len(mounted) == len(of_role) else _and(mounted)
        start = f"The angles of {names} are those of the targets as mounted"
        if scatter:
            yield (
                f"{start}: their mounting is in the uncertainty as far as the run-outs of the "
                "other wheels show it."
            )
        else:
            yield (
                f"{start}: no run-out compensates them, and the target file states no "
                "clamp_tilt_deg, so that their mounting is not in the uncertainty."
            )


def _note_of_bare_wheels(measurement: Measurement, target: Target) -> Iterator[str]:
    """Yield notes on what wheels without targets were measured by, and on the rims' run-out."""
    if not isinstance(target, WheelTarget):
        return
    shown = ("reference", "trial")
    seen = [w for w in measurement.wheels if w.pose and w.observation.role in shown]
    by = {
        method: [w.observation.name for w in seen if w.observation.fitted.method == method]
        for method in ("flange", "tyre")
    }
    if by["flange"]:
        yield (
            f"The axes of {_and(by['flange'])} are those of the rims, and their centres lie level "
            "with the edge of the rim's flange."
        )
    if by["tyre"]:
        yield (
            f"No flange of a rim stands out in the scans of {_and(by['tyre'])}: their axes are "
            "those of the tyres, with more uncertainty, and their centres lie level with the "
            "tyre's widest ring."
        )
    own = [w.observation.name for w in seen if not w.compensated]
    if own and target.clamp_tilt_deg == 0.0:
        yield (
            f"The run-out of {_and(own)} against the spin axis is not in the uncertainty: no "
            "turned scans show it, and [target] states no rim_runout."
        )


def _note_of_zeros(
    measurement: Measurement, target: Target, instrument: InstrumentConfig
) -> Iterator[str]:
    missing = _missing(instrument, RANGE)
    axes = _missing(instrument, AXES)
    missing += ["axis errors"] if len(axes) == len(AXES) else axes
    missing += _missing(instrument, STATION)
    zeros = [f"{_and(missing)} of the scanner"] if missing else []
    if target.flatness == 0.0 and not isinstance(target, WheelTarget):
        zeros.append("flatness of the target")
    zeros += ["range bias of the print"] if _hides_brightness(measurement, target) else []
    if zeros:
        yield f"Counted as zero, as no file states them: {'; '.join(zeros)}."


def _missing(instrument: InstrumentConfig, terms: dict[str, str]) -> list[str]:
    return [name for name, key in terms.items() if getattr(instrument, key) == 0.0]


def _hides_brightness(measurement: Measurement, target: Target) -> bool:
    """Return whether a print may tilt a plane with which range by brightness was not fitted."""
    found = (wheel.observation.evidence for wheel in measurement.wheels)
    planes = [evidence.plane for evidence in found if evidence and evidence.plane]
    return isinstance(target, PatternTarget) and any(plane.brightness is None for plane in planes)


def _and(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
