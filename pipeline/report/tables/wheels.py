"""Toe and camber wheel by wheel, and axle by axle."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...measurement import Measurement, Observation, Stated, WheelResult, by_kind, stated
from ..format.language import Translations
from ..format.writer import Column, Columns, Table, Writer

AXLES = (("front", "FL", "FR"), ("rear", "RL", "RR"))


def wheels_table(measurement: Measurement, writer: Writer) -> Table:
    """Return toe, camber and ISO camber of each wheel with uncertainty, or why there is none.

    Where run-outs are compensated, a column says whose angles they are.
    """
    words, compensated = writer.words, measurement.plates is not None
    known = by_kind(stated(measurement), writer.view.axis)
    toe, axis = writer.quantity("toe"), writer.view.axis
    if writer.plain and axis != "rear-axle":
        toe = f"{toe} to {axis}"
    columns: Columns = (
        words("results.name"), Column(words("results.wheel"), minor=True),
        Column(words("results.role"), "page", minor=True),
        Column(words("status.status"), "page", minor=True),
        *[Column(words("results.of"), minor=True)] * compensated,
        toe, "u", Column("U", "page"),
        writer.quantity("camber"), "u", Column("U", "page"),
        Column(writer.quantity("camber_iso"), minor=True),
        Column("", "text"),
    )  # fmt: skip
    rows = [_wheel_row(result, known, compensated, writer) for result in measurement.wheels]
    bad = ["bad" if result.angles is None else "" for result in measurement.wheels]
    return writer.table(columns, rows, 4 + compensated, words("results.wheels"), bad)


def _wheel_row(
    result: WheelResult, known: dict[tuple[str, str], Stated], compensated: bool, writer: Writer
) -> list[str]:
    seen = result.observation
    wheel = writer.wheel(result.wheel) if result.wheel else "" if writer.plain else writer.none
    role = writer.words.known("role", seen.role)
    row = [writer.wheel(seen.name), wheel, role, writer.status(seen.status)]
    row += [writer.words(f"results.of_{_measured(result)}")] * compensated
    if result.angles is None:
        return [*row, *[writer.none] * 7, f"{seen.status}: {seen.reason}"]
    toe, camber, iso = (known[seen.name, kind] for kind in ("toe", "camber", "camber_iso"))
    return [
        *row, writer.value(toe), *writer.spread(toe), writer.value(camber),
        *writer.spread(camber), writer.value(iso), "",
    ]  # fmt: skip


def _measured(result: WheelResult) -> str:
    """Return what the angles of a wheel are those of, where others are of their axles."""
    if result.compensated:
        return "axle"
    known = result.observation.evidence
    return known.target.method if known and known.target.is_bare_wheel else "target"


def axles_table(measurement: Measurement, writer: Writer) -> Table:
    """Return toe with its total and camber with its cross value, axle by axle."""
    words, unsure = writer.words, measurement.provisional
    known = by_kind(stated(measurement), writer.view.axis)
    rows = []

    def own(angles: Iterable[Stated]) -> list[str]:
        return [writer.none if a.subject in unsure else writer.value(a) for a in angles]

    for axle, *wheels in AXLES:
        toes, cambers = ([known[wheel, kind] for wheel in wheels] for kind in ("toe", "camber"))
        total = known["vehicle", f"{axle}_total_toe"]
        cross = known["vehicle", f"{axle}_cross_camber"]
        left, right = (toe.value for toe in toes)
        text = words.number(writer.view.total_toe(left, right, total.expanded))
        rows += [
            [words(f"vehicle.{axle}"), writer.quantity("toe"), *own(toes),
             words("results.total"), text, *writer.spread(total)],
            ["", writer.quantity("camber"), *own(cambers),
             words("results.cross"), writer.value(cross), *writer.spread(cross)],
        ]  # fmt: skip
    columns: Columns = (
        Column(words("vehicle.axle"), quiet=True), Column(words("vehicle.quantity"), quiet=True),
        words("vehicle.left"), words("vehicle.right"),
        Column(words("results.together"), quiet=True, minor=True),
        Column(words("vehicle.value"), quiet=True),
        "u", Column("U", "page"),
    )  # fmt: skip
    return writer.table(columns, rows, 2, words("results.axles"))


def found_by(seen: Observation, words: Translations) -> str:
    """Return in words how the centre of a measured wheel was found."""
    method = seen.fitted.method if seen.suspect is None else "four_points"
    return words.known("method", method)


def centres_table(measurement: Measurement, writer: Writer) -> Table:
    """Return centres of all measured wheels in the vehicle frame, metres."""
    words = writer.words
    rows = []
    for result in measurement.wheels:
        if result.pose is not None:
            pose, R = result.pose, measurement.frame.R_vehicle_scanner
            local = measurement.frame.to_vehicle(pose.centre_m)
            covariance = sum((part.covariance for part in pose.components), np.zeros((6, 6)))
            u = np.sqrt(np.diag(R @ covariance[3:, 3:] @ R.T).clip(min=0.0))
            places = map(writer.coordinate, local.tolist(), u.tolist())
            method = found_by(result.observation, words)
            rows.append([writer.wheel(result.observation.name), *places, method])
    ways = (f"{words(f'scene.{way}')} / m" for way in ("left", "forward", "up"))
    columns: Columns = (Column(words("results.name"), quiet=True), *ways,
               Column(words("frame.found_by"), minor=True))  # fmt: skip
    return writer.table(columns, rows, 1, words("frame.numbers"))
