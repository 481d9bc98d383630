"""Run-out compensation as tables: angles of the axles, and how the plates sat on them."""

from __future__ import annotations

import math

from ...measurement import Measurement, Runout
from ..format.layout import aligned
from .steering import angle, length, seconds, verdict

EXPLAINED = """\
Run-out compensation: toe (+ in) and camber (+ top out) of the axle in place of the plate; the table
of the wheels keeps the plates' own. u: standard uncertainty (k = 1). Frame: through the centres of
the axles, where the reference scan is one of the wheel's run-out, else of the plates as clamped.
chi2/nu of what one axle leaves."""
PLATES = """\
How the plates sat: lean against the axle and offset of the centre from it, each with its clock
angle from the top, + forwards, where the told turn is 0."""


def runout_text(measurement: Measurement) -> str:
    """The run-outs' tables; empty without any."""
    runouts = measurement.runouts
    if not runouts:
        return ""
    parts = [EXPLAINED, _axles(runouts)]
    known = [runout for runout in runouts if runout.axial_runout is not None]
    return "\n".join([*parts, PLATES, _plates(known)] if known else parts)


def _axles(runouts: tuple[Runout, ...]) -> str:
    header = ("wheel", "scans", "toe", "u", "camber", "u", "camber ISO", "frame", "chi2/nu", "")
    rows: list[tuple[str, ...]] = [header]
    for found in runouts:
        angles = found.compensated
        kinds = (angles.toe, angles.camber) if angles else (None, None)
        left = f"{found.chi_square / found.dof:.2f}" if found.dof else "-"
        cells = [cell for known in kinds for cell in angle(known)[:2]]
        rows.append(
            (
                found.wheel,
                str(len(found.scans)),
                *cells,
                angle(angles.camber_iso if angles else None)[0],
                found.frame,
                left,
                verdict(found.status, found.reason),
            )
        )
    return aligned(rows, left=1)


def _plates(runouts: list[Runout]) -> str:
    rows: list[tuple[str, ...]] = [("wheel", "wobble", "u", "clock", "eccentricity", "u", "clock")]
    for found in runouts:
        wobble = found.axial_runout
        rows.append(
            (
                found.wheel,
                "-" if wobble is None else f"{math.degrees(wobble.value):.4f}°",
                "-" if wobble is None else seconds(wobble.u),
                f"{math.degrees(found.axial_clock_rad):+.1f}°",
                *length(found.radial_runout),
                f"{math.degrees(found.radial_clock_rad):+.1f}°",
            )
        )
    return aligned(rows, left=1)
