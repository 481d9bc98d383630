"""The first page of a report: the verdict, the table of the wheels, the axles, the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...measurement import (
    Conformity,
    Measurement,
    Stated,
    Verdict,
    WheelResult,
    against,
    stated,
)
from ..format.language import Translations
from ..format.writer import NONE, Table, Writer

SIGNS = {"conform": "✓", "not conform": "✗", "undecided": "?"}
AXLES = (("front", "FL", "FR"), ("rear", "RL", "RR"))


@dataclass(frozen=True)
class Headline:
    """What is said first: kind is `conform`, `not-conform`, `undecided` or `none`."""

    kind: str
    sign: str
    title: str
    says: tuple[str, ...]


def headline(
    measurement: Measurement, conformity: Conformity | None, words: Translations
) -> Headline:
    """The verdict in words, with its rule, and what was not measured."""
    missing = [w.observation.name for w in measurement.wheels if w.angles is None]
    left = (words("verdict.incomplete", names=", ".join(missing)),) if missing else ()
    if conformity is None:
        return Headline("none", NONE, words("verdict.none"), (words("verdict.none_says"), *left))
    tolerance, decision = conformity.tolerance, conformity.decision
    key = decision.replace(" ", "_")
    simple = "_simple" if decision == "conform" and tolerance.rule == "simple" else ""
    parts = {
        "confidence": words.number(f"{tolerance.confidence:.12g}"),
        "factor": words.number(f"{tolerance.coverage_factor:.3f}"),
    }
    rule = words(f"verdict.rule_{tolerance.rule}", **parts)
    says = [words(f"verdict.{key}_says{simple}"), *left]
    title = " ".join(tolerance.title.split())
    if title:
        says.append(f"{words('verdict.against')}: {title}")
    says.append(f"{words('verdict.rule')}: {rule}")
    return Headline(key.replace("_", "-"), SIGNS[decision], words(f"verdict.{key}"), tuple(says))


def wheels_table(measurement: Measurement, writer: Writer) -> Table:
    """Wheel by wheel: toe, camber and ISO camber with their uncertainty, or why there is none."""
    words = writer.words
    chosen = against(stated(measurement), writer.view.axis)
    known = {(q.subject, q.kind): q for q in chosen}
    toe = writer.quantity("toe")
    head = (
        words("results.name"), words("results.wheel"), words("results.role"),
        words("status.status"), toe, "u", "U", writer.quantity("camber"), "u", "U",
        writer.quantity("camber_iso"),
    )  # fmt: skip
    rows = [_wheel_row(result, known, writer) for result in measurement.wheels]
    bad = ["bad" if result.angles is None else "" for result in measurement.wheels]
    return Table(head, rows, 4, words("results.wheels"), bad)


def _wheel_row(
    result: WheelResult, known: dict[tuple[str, str], Stated], writer: Writer
) -> list[str]:
    seen = result.observation
    role = writer.words.known("role", seen.role)
    row = [seen.name, result.wheel or NONE, role, writer.status(seen.status)]
    if result.angles is None:
        return [*row, *[NONE] * 7]
    toe, camber, iso = (known[seen.name, kind] for kind in ("toe", "camber", "camber_iso"))
    return [
        *row, writer.value(toe), *writer.spread(toe), writer.value(camber),
        *writer.spread(camber), writer.value(iso),
    ]  # fmt: skip


def axles_table(measurement: Measurement, writer: Writer) -> Table:
    """Toe with its total and camber with its cross value, left and right, axle by axle."""
    words = writer.words
    known = {(q.subject, q.kind): q for q in against(stated(measurement), writer.view.axis)}
    rows = []
    for axle, left, right in AXLES:
        toes = [known[wheel, "toe"] for wheel in (left, right)]
        total = known["vehicle", f"{axle}_total_toe"]
        text = words.number(writer.view.total_toe(*(toe.value for toe in toes)))
        called = words(f"vehicle.{axle}_axle")
        told = words("results.total", value=text)
        values = (writer.value(toe) for toe in toes)
        rows.append([called, writer.quantity("toe"), *values, told, *writer.spread(total)])
        cambers = (writer.value(known[wheel, "camber"]) for wheel in (left, right))
        cross = known["vehicle", f"{axle}_cross_camber"]
        told = words("results.cross", value=writer.value(cross))
        rows.append(["", writer.quantity("camber"), *cambers, told, *writer.spread(cross)])
    head = (words("vehicle.axle"), words("vehicle.quantity"), words("vehicle.left"),
            words("vehicle.right"), words("results.together"), "u", "U")  # fmt: skip
    return Table(head, rows, 2, words("results.axles"))


def limits_table(conformity: Conformity, writer: Writer) -> Table:
    """A row a quantity that has limits: what is decided, and why where it is undecided."""
    words = writer.words
    head = (
        words("verdict.decision"), words("results.name"), words("vehicle.quantity"),
        words("vehicle.value"), words("verdict.limits"), "u", words("verdict.guard"),
        words("verdict.probability"), words("verdict.reason"),
    )  # fmt: skip
    rows, kinds = [], []
    for verdict in conformity.verdicts:
        what, interval = verdict.quantity, verdict.interval
        key = verdict.decision.replace(" ", "_")
        limits = (
            [writer.limit(x, what.unit) for x in (interval.lower, interval.upper)]
            if interval
            else [NONE]
        )
        name = "" if what.subject == "vehicle" else what.subject
        if what.wheel not in (None, what.subject):
            name += f" ({what.wheel})"
        kinds.append(key.replace("_", "-"))
        rows.append([
            f"{SIGNS[verdict.decision]} {words(f'verdict.{key}')}",
            name or words.known("role", "vehicle"), writer.quantity(what.name),
            writer.plain(what.value, what.unit), " … ".join(limits),
            writer.size(what.u, what.unit), writer.size(verdict.guard_band, what.unit),
            writer.share(verdict.probability), _why(verdict, writer),
        ])  # fmt: skip
    if not any(row[-1] for row in rows):  # nothing is undecided
        return Table(head[:-1], [r[:-1] for r in rows], 3, words("verdict.table"), kinds)
    return Table(head, rows, 3, words("verdict.table"), kinds)


def joint(conformity: Conformity, writer: Writer) -> str:
    """The least probability that all conform."""
    at_least = math.floor(conformity.joint_probability[0] * 1000) / 10
    text = writer.words.number(f"{at_least:.1f} %")
    return writer.words("verdict.joint", probability=text)


def _why(verdict: Verdict, writer: Writer) -> str:
    """Why a quantity is undecided, in the report's language."""
    what, interval, words = verdict.quantity, verdict.interval, writer.words
    if verdict.decision != "undecided":
        return ""
    if what.reason:
        return words("verdict.not_measured")
    if interval is None or what.value is None or what.u is None:
        return words("verdict.unknown")
    if verdict.guard_band is None:
        return words("verdict.undecidable")
    lower = what.value - interval.lower < interval.upper - what.value
    return words("verdict.near_lower" if lower else "verdict.near_upper")


def factor_words(measurement: Measurement, words: Translations) -> str:
    """The coverage factor of what is reported, or from where to where it goes."""
    factors = [q.coverage_factor for q in stated(measurement)]
    low, high = (words.number(f"{k:.2f}") for k in (min(factors), max(factors)))
    if low == high:
        return words("results.factor_one", k=low)
    return words("results.factor_range", low=low, high=high)
