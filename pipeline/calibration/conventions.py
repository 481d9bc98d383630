"""Check of the declared axis, sign and definition: do the readings fit another one far better?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import Wording
from ..measurement import Estimate
from ..vectors import Array
from ..vehicle import AXES
from .forms.item import Item, ItemQuantity
from .forms.quantities import QUANTITIES
from .forms.readings import Reading
from .records import QuantityResult
from .reference import Reference, reference_of

FITS_OTHER = (
    "{kind}, {state}: the readings fit {convention} far better (root mean square error {found} "
    "instead of {declared}): check the item file, and how the values were copied."
)
OTHER_SIGN = 'the opposite sign, positive = "{sense}",'
OTHER_AXIS = 'another axis, axis = "{axis}",'
FAR_BETTER = 3.0  # ratio of root mean squares, and least size of that of the declared one in u


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
        kind, read = result.quantity, _by_reference(result, references, rows)
        declared = _errors(read, result, item)
        assert declared is not None  # the results are of them
        one_of_all = len(read) == 1
        of_points = [p.error.u if one_of_all else p.reference.u for p in result.points]
        typical = float(np.median(of_points))
        best: tuple[float, Wording] | None = None
        for words, other in _others(kind, item.declared()[kind]):
            errors = _errors(read, result, item.model_copy(update={kind: other}))
            if errors is not None and _fits_far_better(errors, declared, typical):
                size = _rms(errors)
                best = (size, words) if best is None else min(best, (size, words))
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
    result: QuantityResult, references: Sequence[Reference], rows: Sequence[Reading]
) -> list[tuple[Reference, Array]]:
    """Return each reference of a result with the mean readings (P,) of the series that it is of.

    Of several references, each series is compared with its own: by a wrong convention, errors
    against unlike ones scatter from series to series, and so does their u, by which a wrong one
    would seem as good as the right one.
    """
    own = [o for o in rows if (o.quantity, o.state) == (result.quantity, result.state)]
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


def _errors(
    read: Sequence[tuple[Reference, Array]], result: QuantityResult, item: Item
) -> Array | None:
    """Return the errors (P, R) by an item's convention; None where it has no reference value."""
    found = []
    for reference, shown in read:
        values = [reference.value(result.quantity, p.point, item) for p in result.points]
        known = [one.value for one in values if isinstance(one, Estimate)]
        if len(known) < len(values):
            return None
        found.append(shown - np.array(known))
    return np.column_stack(found)


def _others(kind: str, stated: ItemQuantity) -> Iterator[tuple[Wording, ItemQuantity]]:
    """Return the other conventions in words, and the table that would declare them."""
    for sense in QUANTITIES[kind].signs:
        if stated.positive is not None and sense != stated.positive:
            yield Wording(OTHER_SIGN, sense=sense), _with(stated, positive=sense)
    for axis in AXES:
        if stated.axis is not None and axis != stated.axis:
            yield Wording(OTHER_AXIS, axis=axis), _with(stated, axis=axis)


def _with(stated: ItemQuantity, **changed: str) -> ItemQuantity:
    return stated.model_copy(update=changed)


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
