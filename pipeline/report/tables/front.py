"""The first page: axle by axle each angle with its limits and verdict, and what it was before."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace

from ...measurement import (
    Conformity,
    Estimate,
    Measurement,
    Stated,
    ToleranceInterval,
    Verdict,
    by_kind,
    stated,
)
from ...system import frozen
from ...vehicle import REFERENCE_WHEELS, named
from ..format.earlier import STEERING, Earlier, Known
from ..format.view import Sort
from ..format.writer import Table, Writer, sort_of
from .conformity import quantity, subject
from .wheels import AXLES

LIMITED_AS = {"inclination": "sai"}  # name of a steering axis's quantity in a tolerance
Verdicts = Mapping[tuple[str, str], Verdict]


@frozen
class FrontRow:
    """A quantity as texts, and as numbers for its bar, radians or metres.

    kind: rows of one kind have one scale. before, change: with U. decision: '' without limits.
    at: value; None where it was not measured. interval: its limits.
    """

    label: str
    kind: str
    value: str
    width: str
    lower: str
    upper: str
    before: tuple[str, str]
    change: tuple[str, str]
    decision: str
    at: Known | None
    interval: ToleranceInterval | None
    at_before: Known | None


@frozen
class FrontGroup:
    """Rows under a heading: an axle, the vehicle, the steering axes."""

    title: str
    rows: tuple[FrontRow, ...]


@frozen
class _Source:
    """A quantity to be written; sort: of an angle, None of a length. text: of its value, if set."""

    label: str
    kind: str
    sort: Sort | None
    at: Known | None
    name: str
    verdict: Verdict | None
    text: str = ""


def front_groups(
    measurement: Measurement,
    conformity: Conformity | None,
    writer: Writer,
    before: Earlier | None = None,
) -> list[FrontGroup]:
    """Return toe and camber of each axle, the thrust angle, caster and SAI where measured.

    Then what else has limits, of trials only what does not conform.
    """
    words = writer.words
    verdicts = {(v.quantity.subject, v.quantity.name): v for v in
                (conformity.verdicts if conformity else ())}  # fmt: skip
    known = by_kind(stated(measurement), writer.view.axis)
    sources = {
        words(f"vehicle.{axle}_axle"): list(
            _axle(axle, wheels, known, verdicts, measurement.provisional, writer)
        )
        for axle, *wheels in AXLES
    }
    sources[words("front.vehicle")] = list(_thrust(known, verdicts, writer))
    sources[words("front.steering")] = list(_steering(measurement, verdicts, writer))
    shown = [source.verdict for of in sources.values() for source in of]
    rest = [verdict for verdict in verdicts.values() if verdict not in shown]
    sources[words("front.others")] = list(_others(rest, writer))
    earlier = before.values_for(measurement) if before else {}
    return [
        FrontGroup(title, tuple(_written(source, earlier, writer) for source in of))
        for title, of in sources.items()
        if of
    ]


def changes_table(measurement: Measurement, before: Earlier, writer: Writer) -> Table:
    """Return what was before, what is now and the change, each with its U."""
    words = writer.words
    rows = [
        [group.title, row.label, *row.before, row.value, row.width, *row.change]
        for group in front_groups(measurement, None, writer, before)
        for row in group.rows
        if row.at_before is not None
    ]
    columns = ("", words("vehicle.quantity"), words("front.before"), "U", words("front.now"), "U",
               words("front.change"), "U")  # fmt: skip
    same = is_of_same_scans(measurement, before)
    caption = words("front.changes_of_same" if same else "front.changes")
    return writer.table(columns, rows, 2, caption)


def is_of_same_scans(measurement: Measurement, before: Earlier) -> bool:
    """Return whether what was before is by the same scans, evaluated otherwise."""
    return bool(before.inputs) and before.inputs == measurement.provenance.checksums


def _axle(
    axle: str,
    wheels: list[str],
    known: Mapping[tuple[str, str], Stated],
    verdicts: Verdicts,
    provisional: AbstractSet[str],
    writer: Writer,
) -> Iterator[_Source]:
    """Yield toe left, right and total, then camber left, right and cross.

    Wheels with provisional angles have none here; the vehicle's quantities have theirs.
    """
    words = writer.words
    for kind, both, together in (
        ("toe", "total_toe", words("results.total")),
        ("camber", "cross_camber", words("results.cross")),
    ):
        called = writer.quantity(kind)
        left, right = (known[wheel, kind] for wheel in wheels)
        for found, side in ((left, "left"), (right, "right")):
            source = _stated(f"{called}, {words(f'vehicle.{side}')}", kind, found, verdicts)
            yield replace(source, at=None) if found.subject in provisional else source
        whole, text = known["vehicle", f"{axle}_{both}"], ""
        if kind == "toe":
            total = writer.view.total_toe(left.value, right.value, whole.expanded)
            text = words.number(total)
        yield _stated(f"{called}, {together}", kind, whole, verdicts, text)


def _thrust(
    known: Mapping[tuple[str, str], Stated], verdicts: Verdicts, writer: Writer
) -> Iterator[_Source]:
    """Yield the thrust angle, but from the thrust line itself."""
    found = known.get(("vehicle", "thrust_angle"))
    if found is not None:
        label = f"{writer.quantity('thrust_angle')}, {writer.sign('thrust_angle')}"
        yield _stated(label, "thrust_angle", found, verdicts)


def _stated(label: str, kind: str, found: Stated, verdicts: Verdicts, text: str = "") -> _Source:
    verdict = verdicts.get((found.subject, named(found.kind, found.axis)))
    at = Known(found.value, found.u, found.expanded)
    return _Source(label, kind, sort_of(found.kind), at, found.name, verdict, text)


def _steering(measurement: Measurement, verdicts: Verdicts, writer: Writer) -> Iterator[_Source]:
    """Yield caster and SAI of each steering axis that is known."""
    words, axes = writer.words, {axis.wheel: axis for axis in measurement.steering_axes}
    for kind in STEERING:
        for wheel, side in (("FL", "left"), ("FR", "right")):
            known: Estimate | None = getattr(axes.get(wheel), kind, None)
            if known is not None:
                called = writer.upright(words(f"turned.{kind}"))
                label = f"{called}, {words(f'vehicle.{side}')}"
                at = Known(known.value, known.u, known.expanded)
                verdict = verdicts.get((wheel, LIMITED_AS.get(kind, kind)))
                yield _Source(label, kind, "camber", at, f"{wheel}.{kind}", verdict)


def _others(verdicts: list[Verdict], writer: Writer) -> Iterator[_Source]:
    """Yield quantities with limits that no other row shows."""
    for verdict in verdicts:
        what = verdict.quantity
        label, name = quantity(what, writer), what.name
        if what.subject not in (*REFERENCE_WHEELS, "vehicle") and verdict.decision == "conform":
            continue
        if what.subject != "vehicle":
            label, name = f"{subject(verdict, writer)}, {label}", f"{what.subject}.{name}"
        at = None
        if what.value is not None and what.u is not None:
            expanded = Estimate(what.value, what.u, what.dof).expanded
            at = Known(what.value, what.u, expanded)
        sort = None if what.unit == "m" else sort_of(what.name)
        yield _Source(label, name, sort, at, name, verdict)


def _written(source: _Source, earlier: Mapping[str, Known], writer: Writer) -> FrontRow:
    verdict, sort, sense = source.verdict, source.sort, writer.view.sense(source.kind)
    at, before = (_times(known, sense) for known in (source.at, earlier.get(source.name)))
    change = at.less(before) if at and before else None
    interval = verdict.interval.times(sense) if verdict and verdict.interval else None
    limits = (interval.lower, interval.upper) if interval else (math.inf, math.inf)
    lower, upper = (_limit(x, sort, writer) for x in limits)
    now = _pair(at, sort, writer)
    return FrontRow(
        label=source.label,
        kind=source.kind,
        value=source.text or now[0],
        width=now[1],
        lower=lower,
        upper=upper,
        before=_pair(before, sort, writer),
        change=_pair(change, sort, writer),
        decision=verdict.decision if verdict else "",
        at=at,
        interval=interval,
        at_before=before,
    )


def _times(known: Known | None, sense: float) -> Known | None:
    return replace(known, value=sense * known.value) if known else None


def _pair(known: Known | None, sort: Sort | None, writer: Writer) -> tuple[str, str]:
    """Write a value and its U."""
    if known is None:
        return writer.none, writer.none
    if sort is None:
        value = writer.millimetres(known.value, known.expanded, "+")
        return value, writer.size(known.expanded, "m")
    view, number = writer.view, writer.words.number
    value, width = (
        view.angle(known.value, sort, known.expanded),
        view.width(known.expanded, sort, known.value),
    )
    return number(value), number(width)


def _limit(value: float, sort: Sort | None, writer: Writer) -> str:
    """Write a limit, which is exact; a dash where there is none."""
    if not math.isfinite(value):
        return writer.none
    text = f"{1e3 * value:+.6g} mm" if sort is None else writer.view.limit(value, sort)
    return writer.words.number(text)
