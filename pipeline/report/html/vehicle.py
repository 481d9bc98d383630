"""What a report says of the vehicle as a whole, of its steering, and of checks of the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from ...measurement import (
    Measurement,
    Runout,
    Stated,
    SteeringAxis,
    ToeOut,
    against,
    by_name,
    stated,
)
from ...vehicle import AXES, named
from ..format.writer import NONE, Table, Writer

HEADINGS = ("thrust_angle", "steer_ahead", "rear_squareness")
LENGTHS = ("rear_track", "front_track", "wheelbase", "wheelbase_left", "wheelbase_right")
SIDED: dict[str, tuple[str, str]] = {  # words of a positive value, and of a negative one
    "wheelbase_difference": ("longer_left", "longer_right"),
    "front_setback": ("behind_right", "behind_left"),
    "rear_setback": ("behind_right", "behind_left"),
    "axle_offset": ("aside_right", "aside_left"),
}
OF_AXES = dict(zip(AXES[1:], ("centreline_angle", "thrust_angle", "side_bisector_angle"),
                   strict=True))  # fmt: skip
WHEELS = ("FL", "FR", "RL", "RR")


def vehicle_table(measurement: Measurement, writer: Writer) -> Table:
    """Angles and lengths that join the axles, each with its uncertainty."""
    words = writer.words
    chosen = against(stated(measurement), writer.view.axis)
    known = {q.kind: q for q in chosen if q.subject == "vehicle"}
    rows = [_row(known, kind, writer, writer.value) for kind in HEADINGS]
    if writer.view.axis != "thrust-line":
        names = by_name(measurement)
        for wheel in ("FL", "FR"):
            toe = names[f"{wheel}.{named('toe', 'thrust-line')}"]
            label = words("vehicle.toe_to_thrust", wheel=wheel)
            rows.append([label, writer.value(toe), *writer.spread(toe)])
    rows += [_row(known, kind, writer, writer.value) for kind in LENGTHS]
    rows += [_row(known, kind, writer, lambda q: sided(q, writer)) for kind in SIDED]
    head = (words("vehicle.quantity"), words("vehicle.value"), "u", "U")
    return Table(head, rows, 1, words("vehicle.quantities"))


def sided(quantity: Stated, writer: Writer) -> str:
    """A signed length in words, since manuals differ in the sign."""
    over, under = SIDED[quantity.kind]
    key = over if quantity.value > 0.0 else under
    return writer.words(f"vehicle.{key}", length=writer.millimetres(abs(quantity.value)))


def _row(
    known: Mapping[str, Stated], kind: str, writer: Writer, text: Callable[[Stated], str]
) -> list[str]:
    found = known.get(kind)
    if found is None:
        return [writer.quantity(kind), writer.words("vehicle.by_definition"), NONE, NONE]
    return [writer.quantity(kind), text(found), *writer.spread(found)]


def axes_table(measurement: Measurement, writer: Writer) -> Table:
    """The four axes: angle to the paper's, and what each makes of the toe of the four wheels."""
    words, known = writer.words, by_name(measurement)
    rows = []
    for axis in AXES:
        found = known.get(OF_AXES.get(axis, ""))
        angle = writer.view.angle(found.value if found else 0.0, "heading")
        u = writer.width(found, found.u) if found else NONE
        toes = (writer.value(known[f"{wheel}.{named('toe', axis)}"]) for wheel in WHEELS)
        rows.append([writer.axis(axis), words.number(angle), u, *toes])
    head = (words("vehicle.axis"), words("vehicle.angle"), "u", *WHEELS)
    return Table(head, rows, 1, words("vehicle.axes"))


def turned_tables(measurement: Measurement, writer: Writer) -> list[tuple[Table, str]]:
    """Kingpins, toe-out on turns and run-outs, each with its note; none without such scans."""
    words = writer.words
    kingpins, runouts, turns = measurement.steering_axes, measurement.runouts, measurement.toe_out
    tables = []
    if kingpins:
        tables.append((_kingpins_table(kingpins, writer), words("turned.kingpin_note")))
    if turns:
        tables.append((_turns_table(turns, writer), ""))
    if runouts:
        tables.append((_runouts_table(runouts, writer), words("turned.runout_note")))
    return tables


def _kingpins_table(kingpins: Sequence[SteeringAxis], writer: Writer) -> Table:
    words = writer.words
    head = (words("results.wheel"), words("status.status"), words("turned.scans"),
            words("turned.swept"), words("turned.caster"), "u", "U", words("turned.inclination"),
            "u", "U", words("turned.inwards"), "u", words("turned.ahead"), "u")  # fmt: skip
    rows = [_kingpin(found, writer) for found in kingpins]
    return Table(head, rows, 2, words("turned.kingpins"))


def _turns_table(turns: Sequence[ToeOut], writer: Writer) -> Table:
    words = writer.words
    head = (words("turned.turn"), words("status.status"), words("turned.difference"), "u", "U")
    rows = [
        [words(f"turned.turn_{found.turn}"), writer.status(found.status),
         *writer.estimate(found.difference)] for found in turns
    ]  # fmt: skip
    return Table(head, rows, 2, words("turned.toe_out"))


def _runouts_table(runouts: Sequence[Runout], writer: Writer) -> Table:
    words = writer.words
    head = (words("results.wheel"), words("status.status"), words("turned.scans"),
            writer.quantity("toe"), "u", "U", writer.quantity("camber"), "u", "U",
            words("turned.wobble"), "u", words("turned.eccentricity"), "u",
            words("turned.through"))  # fmt: skip
    rows = [_runout(found, writer) for found in runouts]
    return Table(head, rows, 2, words("turned.runouts"))


def _kingpin(found: SteeringAxis, writer: Writer) -> list[str]:
    swept = writer.words.number(f"{math.degrees(found.sweep_rad):.1f}°")
    return [
        found.wheel, writer.status(found.status), str(len(found.scans)), swept,
        *writer.estimate(found.caster), *writer.estimate(found.inclination),
        *writer.length(found.lateral_offset), *writer.length(found.longitudinal_offset),
    ]  # fmt: skip


def _runout(found: Runout, writer: Writer) -> list[str]:
    angles = found.compensated
    return [
        found.wheel, writer.status(found.status), str(len(found.scans)),
        *writer.estimate(angles.toe if angles else None),
        *writer.estimate(angles.camber if angles else None),
        *writer.estimate(found.axial_runout)[:2], *writer.length(found.radial_runout),
        writer.words.known("through", found.frame) if angles else NONE,
    ]  # fmt: skip
