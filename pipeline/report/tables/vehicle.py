"""The vehicle's angles and lengths, and its longitudinal axes.

Rows follow `vehicle.VEHICLE`; a quantity's name, its sign and the words of a signed length stand in
the words of each language.
"""

from __future__ import annotations

from collections.abc import Mapping

from ...measurement import Measurement, Stated, against, by_name, stated, workshop_angles
from ...vehicle import AXES, OF_SECOND_ORDER, VEHICLE, named
from ..format.digits import UNKNOWN, millimetres
from ..format.language import Translations
from ..format.writer import Column, Columns, Table, Writer

OF_AXES = dict(zip(AXES[1:], ("centreline_angle", "thrust_angle", "side_bisector_angle"),
                   strict=True))  # fmt: skip
# Angles that the tables of the axles and of the longitudinal axes show.
ELSEWHERE = {"rear_total_toe", "front_total_toe", "rear_cross_toe", "front_cross_toe",
             "rear_cross_camber", "front_cross_camber", "centreline_angle",
             "side_bisector_angle"}  # fmt: skip
ANGLES = [q.kind for q in VEHICLE if q.unit == "rad" and q.kind not in ELSEWHERE]
LENGTHS = [q.kind for q in VEHICLE if q.unit == "m"]
SIGNED = tuple(dict.fromkeys(q.kind for q in VEHICLE if q.unit == "m" and q.signed))
WHEELS = ("FL", "FR", "RL", "RR")


def vehicle_table(measurement: Measurement, writer: Writer) -> Table:
    """Return angles and lengths that join the axles, each with its uncertainty."""
    words, unsure = writer.words, measurement.provisional
    chosen = against(stated(measurement), writer.view.axis)
    known = {q.kind: q for q in chosen if q.subject == "vehicle"}
    rows = [_row(known, kind, writer) for kind in dict.fromkeys(ANGLES)]
    if writer.view.axis != "thrust-line":
        names = by_name(measurement)
        for wheel in ("FL", "FR"):
            toe = names[f"{wheel}.{named('toe', 'thrust-line')}"]
            label = words("vehicle.toe_to_thrust", wheel=words(f"vehicle.{wheel}"))
            cells = [writer.value(toe), *writer.spread(toe)]
            rows.append([label, *([writer.none] * 3 if wheel in unsure else cells)])
    if writer.view.convention == "german-workshop":
        angles = workshop_angles(measurement)
        rows += [_row({a.kind: a for a in angles}, angle.kind, writer) for angle in angles]
    rows += [_row(known, kind, writer) for kind in dict.fromkeys(LENGTHS)]
    columns: Columns = (
        Column(words("vehicle.quantity"), quiet=True), Column(words("vehicle.value"), quiet=True),
        "u", Column("U", "page"),
    )  # fmt: skip
    return writer.table(columns, rows, 1, words("vehicle.quantities"))


def in_words(kind: str, length_m: float, words: Translations, expanded_m: float = UNKNOWN) -> str:
    """Return a signed length in words, since manuals differ in the sign."""
    size = words.number(millimetres(abs(length_m), expanded_m))
    sign = "positive" if length_m > 0.0 else "negative"
    key = f"sided.{kind}_{sign}"
    if key in words.texts:
        return words(key, length=size)
    return words.number(millimetres(length_m, expanded_m, "+"))


def _row(known: Mapping[str, Stated], kind: str, writer: Writer) -> list[str]:
    words, found = writer.words, known.get(kind)
    label = writer.quantity(kind)
    if writer.sign(kind):
        label += f", {writer.sign(kind)}"
    if found is None:
        nearly = (kind, writer.view.axis) in OF_SECOND_ORDER
        text = words("vehicle.nearly" if nearly else "vehicle.by_definition")
        return [label, text, writer.none, writer.none]
    signed = kind in SIGNED
    expanded = writer.view.known(found.expanded)
    text = in_words(kind, found.value, words, expanded) if signed else writer.value(found)
    return [label, text, *writer.spread(found)]


def axes_table(measurement: Measurement, writer: Writer) -> Table:
    """Return the four axes: angle to the rear axle's normal, and toe of each wheel against them.

    Provisional toes are left out, as in the table of the axles.
    """
    words, known = writer.words, by_name(measurement)
    unsure, rows = measurement.provisional, []
    for axis in AXES:
        found = known.get(OF_AXES.get(axis, ""))
        angle = writer.value(found) if found else writer.view.angle(0.0, "heading")
        u = writer.width(found, found.u) if found else writer.none
        toes = (
            writer.none if wheel in unsure else writer.value(known[f"{wheel}.{named('toe', axis)}"])
            for wheel in WHEELS
        )
        rows.append([writer.axis(axis), words.number(angle), u, *toes])
    toe = writer.quantity("toe")
    sign = writer.sign("thrust_angle")
    columns: Columns = (Column(words("vehicle.axis"), quiet=True), sign, "u",
               *(f"{toe} {writer.wheel(wheel)}" for wheel in WHEELS))  # fmt: skip
    return writer.table(columns, rows, 1, words("vehicle.axes"))
