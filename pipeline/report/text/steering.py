"""A steering sweep as tables: kingpins, and toe-out on turns."""

from __future__ import annotations

import math

from ...measurement import Estimate, Measurement, SteeringAxis, ToeOut
from ...vehicle import deg_min_sec
from ..format.layout import aligned

EXPLAINED = """\
Steering sweep: the kingpin axis, about which each wheel turned. Caster is + where its top leans
backwards, on the side plane; inclination + where it leans inwards, on the plane across. u: standard
uncertainty (k = 1); U: half width of the 95 % interval. By camber: caster from the camber of the
outermost scans alone, which leaves the inclination out. chi2/nu of what one axis leaves."""
TURN = """\
The plates' turns about their own normals, seen by their {mark}, count on {wheels}."""
FRAMES = {
    "axle centres": "The frame stands on the centres of the axles, by the run-outs.",
    "axle and plate centres": """\
The frame stands on the centres of the axles of some wheels, by their run-outs, on those of the
others' plates as clamped: reference plates 1 mm off their axles turn caster and inclination by some
3'. Scan every wheel turned about its axle.""",
    "plate centres": """\
The frame stands on the centres of the plates as clamped: reference plates 1 mm off their axles turn
caster and inclination by some 3'. Scan each wheel turned about its axle as well ([[runout]], its
reference scan among them), and the frame stands on the axles.""",
}
PLACE = """\
Where the axis passes the height of the wheel's reference centre: inwards of it, + ahead of it."""
TURNS = """\
Toe-out on turns: by how much the inner wheel steers further, itself at 20° of toe-out against the
forward axis of the frame; of the {of}."""
OF = {
    "axles": "axles, by the run-outs",
    "plates": "plates as they are clamped, whose lean no run-out shows",
}


def steering_text(measurement: Measurement) -> str:
    """The sweep's tables; empty without a sweep."""
    kingpins = measurement.steering_axes
    if not kingpins:
        return ""
    frame = FRAMES[kingpins[0].frame]
    parts = [EXPLAINED, frame, *_turns_seen(kingpins), _angles(kingpins)]
    placed = [kingpin for kingpin in kingpins if kingpin.lateral_offset is not None]
    if placed:
        parts += [PLACE, _places(placed)]
    turns = measurement.toe_out
    if turns:
        parts += [TURNS.format(of=OF[turns[0].of]), _turns(turns)]
    return "\n".join(parts)


def _turns_seen(kingpins: tuple[SteeringAxis, ...]) -> list[str]:
    """One line a mark by which turns were seen; none for discs."""
    seen = [kingpin for kingpin in kingpins if kingpin.with_rotation]
    return [
        TURN.format(mark=mark, wheels=", ".join(
            f"{k.wheel} ({k.with_rotation} of {len(k.scans)} scans)" for k in seen if k.mark == mark
        ))
        for mark in dict.fromkeys(kingpin.mark for kingpin in seen)
    ]  # fmt: skip


def _angles(kingpins: tuple[SteeringAxis, ...]) -> str:
    header = ("wheel", "scans", "swept", "caster", "u", "U", "inclination", "u", "U", "by camber",
              "chi2/nu", "")  # fmt: skip
    rows: list[tuple[str, ...]] = [header]
    for found in kingpins:
        left = f"{found.chi_square / found.dof:.2f}" if found.dof else "-"
        rows.append(
            (
                found.wheel,
                str(len(found.scans)),
                f"{math.degrees(found.sweep_rad):.1f}°",
                *angle(found.caster),
                *angle(found.inclination),
                angle(found.caster_by_camber)[0],
                left,
                verdict(found.status, found.reason),
            )
        )
    return aligned(rows, left=1)


def _places(kingpins: list[SteeringAxis]) -> str:
    rows: list[tuple[str, ...]] = [("wheel", "inwards", "u", "ahead", "u")]
    rows += [
        (found.wheel, *length(found.lateral_offset), *length(found.longitudinal_offset))
        for found in kingpins
    ]
    return aligned(rows, left=1)


def _turns(turns: tuple[ToeOut, ...]) -> str:
    rows: list[tuple[str, ...]] = [("turn", "inner less outer", "u", "U", "u of the curve", "")]
    for found in turns:
        curve = "-" if found.difference is None else seconds(found.u_interpolation_rad)
        rows.append(
            (found.turn, *angle(found.difference), curve, verdict(found.status, found.reason))
        )
    return aligned(rows, left=1)


def angle(known: Estimate | None) -> tuple[str, str, str]:
    """Value, u and U; dashes for what is not known."""
    if known is None:
        return "-", "-", "-"
    return deg_min_sec(known.value), seconds(known.u), seconds(known.expanded)


def length(known: Estimate | None) -> tuple[str, str]:
    """Value and u in millimetres."""
    return ("-", "-") if known is None else (
        f"{known.value * 1e3:+.2f} mm", f"{known.u * 1e3:.2f} mm"
    )  # fmt: skip


def seconds(angle_rad: float) -> str:
    """Seconds of arc."""
    return f'{math.degrees(angle_rad) * 3600:.1f}"'


def verdict(status: str, reason: str) -> str:
    """Nothing where all is well."""
    return "" if status == "ok" else f"{status}: {reason}"
