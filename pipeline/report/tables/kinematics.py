"""Steering axes, toe-out on turns and run-outs, each table with its note."""

from __future__ import annotations

from collections.abc import Sequence

from ...measurement import (
    CROSS,
    Estimate,
    Measurement,
    Runout,
    SteeringAxis,
    ToeOut,
    WheelResult,
    steering_quantity,
    turned_quantity,
)
from ..format.writer import Column, Table, Writer

Noted = list[tuple[Table, str]]
OF_PLATE = ("toe", "camber", "camber_iso")
UNDETERMINED_RAD = 1.0  # U of a clock angle where that of its run-out is as large as the run-out


def steering_tables(measurement: Measurement, writer: Writer) -> Noted:
    """Return steering axes, their offsets and toe-out on turns; none without a sweep."""
    words, axes, turns = writer.words, measurement.steering_axes, measurement.toe_out
    if not axes:
        return []
    frame = words.known("frame_note", axes[0].frame)
    note = " ".join([words("turned.kingpin_note"), frame, *_rotations(axes, writer)])
    tables = [(_axes_table(axes, writer), note)]
    sums = _sums_table(measurement, writer)
    if sums.rows:
        tables.append((sums, words("turned.sums_note")))
    offset = [axis for axis in axes if axis.lateral_offset is not None]
    if offset:
        tables.append((_offsets_table(offset, writer), words("turned.offsets_note")))
    if turns:
        of = words.known("turns_of", turns[0].of)
        tables.append((_turns_table(turns, writer), words("turned.turns_note", of=of)))
    return tables


def runout_tables(measurement: Measurement, writer: Writer) -> Noted:
    """Return angles without compensation, and the run-outs themselves; none without run-outs."""
    words, runouts = writer.words, measurement.runouts
    if not runouts:
        return []
    frame = words.known("through", runouts[0].frame)
    shown = words(f"turned.shown_{_shown(measurement)}")
    note = words("turned.runout_note", frame=frame, shown=shown)
    tables = [(_plates_table(measurement, shown, writer), note)]
    known = [runout for runout in runouts if runout.axial_runout is not None]
    if known:
        tables.append((_mounting_table(known, shown, writer), words("turned.mounting_note")))
    return tables


def _shown(measurement: Measurement) -> str:
    """Return what the scans of the run-outs show: targets, bare wheels or both."""
    wheels = {wheel.observation.name: wheel.observation for wheel in measurement.wheels}
    bare = {wheels[one.wheel].fitted.is_bare_wheel for one in measurement.runouts}
    return "both" if len(bare) > 1 else "bare" if True in bare else "targets"


def _rotations(axes: Sequence[SteeringAxis], writer: Writer) -> list[str]:
    """Return a sentence for each mark that shows the targets' in-plane rotation; none for discs."""
    words = writer.words
    shown = [axis for axis in axes if axis.with_rotation]
    return [
        words("turned.rotation_note", mark=words(f"turned.mark_{mark}"), wheels=", ".join(
            words("turned.rotation_of", wheel=writer.wheel(a.wheel), shown=a.with_rotation,
                  scans=len(a.scans)) for a in shown if a.mark == mark
        ))
        for mark in dict.fromkeys(axis.mark for axis in shown)
    ]  # fmt: skip


def _axes_table(axes: Sequence[SteeringAxis], writer: Writer) -> Table:
    words = writer.words
    columns = (
        words("results.wheel"), Column(words("status.status"), "page", minor=True),
        Column(words("turned.scans"), minor=True),
        words("turned.swept"), writer.upright(words("turned.caster")), "u", "U",
        writer.upright(words("turned.inclination")),
        "u", "U", words("turned.by_camber"), writer.chi, Column("", "text"),
    )  # fmt: skip
    rows = [
        [writer.wheel(found.wheel), writer.status(found.status), str(len(found.scans)),
         writer.degrees(found.sweep_rad, 1, sign=""), *writer.estimate(found.caster, "caster"),
         *writer.estimate(found.inclination, "sai"),
         writer.estimate(found.caster_by_camber, "caster")[0],
         writer.reduced_chi_square(found.chi_square, found.dof), _reason(found)]
        for found in axes
    ]  # fmt: skip
    return writer.table(columns, rows, 2, words("turned.kingpins"))


def _sums_table(measurement: Measurement, writer: Writer) -> Table:
    """Return included angles, cross caster and cross SAI, where they are known."""
    words = writer.words
    named = [
        (f"{writer.quantity('included_angle')} {writer.wheel(axis.wheel)}",
         turned_quantity(measurement, "included_angle", axis.wheel).source, "included_angle")
        for axis in measurement.steering_axes
    ]  # fmt: skip
    named += [
        (writer.quantity(kind), steering_quantity(measurement, kind, 0.0).source, kind)
        for kind in CROSS
    ]
    rows = [
        [name, *writer.estimate(found, kind)]
        for name, found, kind in named
        if isinstance(found, Estimate)
    ]
    columns = (words("vehicle.quantity"), words("vehicle.value"), "u", "U")
    return writer.table(columns, rows, 1, words("turned.sums"))


def _offsets_table(axes: Sequence[SteeringAxis], writer: Writer) -> Table:
    words = writer.words
    rows = [
        [writer.wheel(found.wheel), *writer.length(found.lateral_offset),
         *writer.length(found.longitudinal_offset)] for found in axes
    ]  # fmt: skip
    columns = (words("results.wheel"), words("turned.lateral"), "u",
               words("turned.longitudinal"), "u")  # fmt: skip
    return writer.table(columns, rows, 1, words("turned.offsets"))


def _turns_table(turns: Sequence[ToeOut], writer: Writer) -> Table:
    words = writer.words
    columns = (
        words("turned.turn"), Column(words("status.status"), "page", minor=True),
        words("turned.difference"),
        "u", "U", words("turned.u_curve"), Column("", "text"),
    )  # fmt: skip
    rows = [
        [words(f"turned.turn_{found.turn}"), writer.status(found.status),
         *writer.estimate(found.difference, f"toe_out_{found.turn}"),
         writer.angle_width(found.u_interpolation_rad, f"toe_out_{found.turn}", 0.0)
         if found.difference else writer.none,
         _reason(found)]
        for found in turns
    ]  # fmt: skip
    return writer.table(columns, rows, 2, words("turned.toe_out"))


def _plates_table(measurement: Measurement, shown: str, writer: Writer) -> Table:
    words = writer.words
    plates = {wheel.observation.name: wheel.plate or wheel for wheel in measurement.wheels}
    columns = (
        words("results.wheel"), Column(words("status.status"), "page", minor=True),
        Column(words("turned.scans"), minor=True),
        writer.from_rear_axle("toe"), "u", Column("U", "page"), writer.quantity("camber"), "u",
        Column("U", "page"), writer.from_rear_axle("camber_iso"), writer.chi,
        Column("", "text"),
    )  # fmt: skip
    rows = []
    for found in measurement.runouts:
        toe, camber, iso = map(writer.estimate, _plate_estimates(plates[found.wheel]), OF_PLATE)
        rows.append([
            writer.wheel(found.wheel), writer.status(found.status), str(len(found.scans)), *toe,
            *camber, iso[0],
            writer.reduced_chi_square(found.chi_square, found.dof), _reason(found),
        ])  # fmt: skip
    return writer.table(columns, rows, 2, words("turned.runouts", shown=shown))


def _plate_estimates(plate: WheelResult) -> tuple[Estimate, Estimate, Estimate]:
    """Return toe, camber and ISO camber of a measured target as mounted."""
    angles = plate.angles
    assert angles is not None
    return (
        Estimate(angles.toe_rad, plate.u_toe_rad or 0.0, plate.dof_toe),
        Estimate(angles.camber_rad, plate.u_camber_rad or 0.0, plate.dof_camber),
        Estimate(angles.camber_iso_rad, plate.u_camber_iso_rad or 0.0, plate.dof_camber_iso),
    )


def _mounting_table(runouts: Sequence[Runout], shown: str, writer: Writer) -> Table:
    words, clock = writer.words, writer.words("turned.clock")
    rows = [
        [writer.wheel(found.wheel), *_axial(found.axial_runout, writer),
         *_clock(found.axial_clock, writer), *writer.length(found.radial_runout),
         *_clock(found.radial_clock, writer)]
        for found in runouts if found.axial_runout is not None
    ]  # fmt: skip
    columns = (words("results.wheel"), words("turned.axial"), "u", clock, "u",
               words("turned.radial"), "u", clock, "u")  # fmt: skip
    return writer.table(columns, rows, 1, words("turned.mounting", shown=shown))


def _axial(known: Estimate, writer: Writer) -> tuple[str, str]:
    """Write an axial run-out, which has no sign, and its u."""
    value, u, _ = writer.estimate(known, "axial_runout")
    return value.removeprefix("+"), u


def _clock(known: Estimate | None, writer: Writer) -> tuple[str, str]:
    """Write the direction of a run-out and its u; dashes where it is not determined."""
    if known is None or known.expanded >= UNDETERMINED_RAD:
        return writer.none, writer.none
    size = writer.degrees(known.u, 1, known.u, sign="")
    return writer.degrees(known.value, 1, known.expanded), size


def _reason(found: SteeringAxis | Runout | ToeOut) -> str:
    return "" if found.status == "ok" else f"{found.status}: {found.reason}"
