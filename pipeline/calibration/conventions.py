"""Check of declared axis, sign, unit and column: do the readings fit another far better?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import Wording
from ..measurement import Estimate
from ..vectors import Array
from ..vehicle import AXES
from .forms.item import Item
from .forms.quantities import QUANTITIES, as_shown, indicated, value_of
from .forms.readings import Reading
from .records import QuantityResult
from .reference import Reference, reference_of

FITS_OTHER = (
    "{kind}, {state}: the readings fit {convention} far better (root mean square error {found} "
    "instead of {declared}): check the item file, and how the values were copied."
)
OTHER_SIGN = 'the opposite sign, positive = "{sense}",'
OTHER_AXIS = 'another axis, axis = "{axis}",'
OTHER_UNIT = "another unit, {unit} instead of {stated},"
OTHER_QUANTITY = "another quantity, {other},"
SIGN_OF_ONE_SIDE = "the opposite sign at {points}, on one side of the vehicle,"
FAR_BETTER = 3.0  # ratio of root mean squares, and least size of that of the declared one in u
LEAST_OF_SIDE = 2  # points on one side, of which a sign of their own is no slip at one point
PLAIN_UNITS = {"rad": ("deg", "min"), "m": ("mm", "m")}  # that are taken for each other
Read = Sequence[tuple[Reference, Array]]  # references, and mean readings (P,) of their series


def convention_warnings(
    results: Sequence[QuantityResult],
    references: Sequence[Reference],
    item: Item,
    rows: Sequence[Reading],
) -> tuple[str, ...]:
    """Return a sentence for every quantity whose readings fit another convention far better.

    rows: the readings, which say whose references a result has. Errors are compared about their
    mean, and as they are, so that a zero error hides nothing; the one must be far smaller and the
    other not larger.
    """
    found = []
    for result in results:
        kind = result.quantity
        own = [o for o in rows if (o.quantity, o.state) == (kind, result.state)]
        read = _by_reference(result, references, own)
        known = _known(read, result, item, kind)
        assert known is not None  # the results are of them
        shown = np.column_stack([shown for _, shown in read])
        declared = shown - known
        one_of_all = len(read) == 1
        of_points = [p.error.u if one_of_all else p.reference.u for p in result.points]
        typical = float(np.median(of_points))
        best: tuple[float, Wording] | None = None
        for words, errors in _others(shown, known, read, result, item, own):
            if _fits_far_better(errors, declared, typical):
                size = _rms(errors)
                best = (size, words) if best is None or size < best[0] else best
        if best is not None:
            text = Wording(
                FITS_OTHER,
                kind=kind,
                state=result.state,
                convention=best[1],
                found=size_text(best[0], result.unit),
                declared=size_text(_rms(declared), result.unit),
            )
            found.append(text)
    return tuple(dict.fromkeys(found))


def _by_reference(
    result: QuantityResult, references: Sequence[Reference], own: Sequence[Reading]
) -> Read:
    """Return each reference of a result with the mean readings (P,) of the series that it is of.

    Of several references, each series is compared with its own: by a wrong convention, errors
    against unlike ones scatter from series to series, and so does their u, by which a wrong one
    would seem as good as the right one.
    """
    used = {one.series: reference_of(references, one.series) for one in own}
    known = {series: one for series, one in used.items() if one is not None}
    if len({id(one.measurement) for one in known.values()}) == 1:
        shown = np.array([point.reading for point in result.points])
        return [(next(iter(known.values())), shown)]
    cells: dict[tuple[str, str], dict[tuple[str, str], list[float]]] = {}
    for one in own:
        cell = cells.setdefault((one.series, one.point), {})
        cell.setdefault((one.operator, one.direction), []).append(one.value)

    def mean(series: str, point: str) -> float:  # each operator and direction counted alike
        return float(np.mean([np.mean(each) for each in cells[series, point].values()]))

    return [
        (reference, np.array([mean(series, point.point) for point in result.points]))
        for series, reference in known.items()
    ]


def _known(read: Read, result: QuantityResult, item: Item, kind: str) -> Array | None:
    """Return reference values (P, R) of a quantity of an item; None where one is missing."""
    found = []
    for reference, _ in read:
        values = [reference.value(kind, point.point, item) for point in result.points]
        known = [one.value for one in values if isinstance(one, Estimate)]
        if len(known) < len(values):
            return None
        found.append(known)
    return np.array(found).T


def _others(
    shown: Array,
    known: Array,
    read: Read,
    result: QuantityResult,
    item: Item,
    own: Sequence[Reading],
) -> Iterator[tuple[Wording, Array]]:
    """Yield other conventions in words, and the errors (P, R) by them."""
    for words, kind, table in _other_tables(result.quantity, item):
        other = _known(read, result, table, kind)
        if other is not None:
            yield words, shown - other
    for words, otherwise in _other_readings(shown, read, result, item, own):
        yield words, otherwise - known


def _other_tables(kind: str, item: Item) -> Iterator[tuple[Wording, str, Item]]:
    """Yield what else the item file may declare, or the column name, with quantity and item."""
    stated = item.declared()[kind]
    for sense in QUANTITIES[kind].signs:
        if stated.positive is not None and sense != stated.positive:
            other = item.model_copy(update={kind: stated.model_copy(update={"positive": sense})})
            yield Wording(OTHER_SIGN, sense=sense), kind, other
    for axis in AXES:
        if stated.axis is not None and axis != stated.axis:
            other = item.model_copy(update={kind: stated.model_copy(update={"axis": axis})})
            yield Wording(OTHER_AXIS, axis=axis), kind, other
    for name in item.declared():
        if name != kind and QUANTITIES[name].unit == QUANTITIES[kind].unit:
            yield Wording(OTHER_QUANTITY, other=name), name, item


def _other_readings(
    shown: Array, read: Read, result: QuantityResult, item: Item, own: Sequence[Reading]
) -> Iterator[tuple[Wording, Array]]:
    """Yield readings (P, R) as they would be in another unit, or with another sign on one side."""
    quantity = QUANTITIES[result.quantity]
    stated, *unlike = {one.unit for one in own}
    for unit in () if unlike else PLAIN_UNITS[quantity.unit]:
        if unit != stated:
            numbers = [as_shown(value, stated, quantity, item.rim_m) for value in shown.flat]
            values = [value_of(number, unit) for number in numbers]
            found = [indicated(value, quantity, item.rim_m) for value in values]
            yield Wording(OTHER_UNIT, unit=unit, stated=stated), np.reshape(found, shown.shape)
    if quantity.subject == "wheel":
        names = [point.point for point in result.points]
        sides = np.array([str(read[0][0].wheels[name].wheel)[-1] for name in names])
        for side in ("L", "R"):
            on_it = sides == side
            if LEAST_OF_SIDE <= np.count_nonzero(on_it) < len(sides):
                points = ", ".join(np.array(names)[on_it].tolist())
                turned = np.where(on_it[:, None], -shown, shown)
                yield Wording(SIGN_OF_ONE_SIDE, points=points), turned


def _fits_far_better(other: Array, declared: Array, u: float) -> bool:
    about_mean = len(other) > 2 and (
        _far(_rms(other - other.mean(axis=0)), _rms(declared - declared.mean(axis=0)), u)
        and _rms(other) <= _rms(declared)
    )
    return about_mean or _far(_rms(other), _rms(declared), u)


def _far(other: float, declared: float, u: float) -> bool:
    return declared > FAR_BETTER * max(other, u)


def _rms(errors: Array) -> float:
    return math.sqrt(float(np.mean(errors**2)))


def size_text(size: float, unit: str) -> str:
    """Write a size in minutes of arc, or of a length in millimetres, to two digits or whole."""
    scaled, mark = (size * 1e3, " mm") if unit == "m" else (math.degrees(size) * 60.0, "'")
    return f"{scaled:.0f}{mark}" if scaled >= 99.5 else f"{scaled:.2g}{mark}"
