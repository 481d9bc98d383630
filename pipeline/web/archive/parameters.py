"""Parameters of a request for a view of batch results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ...batch.catalogue.rows import STATUSES
from ...batch.results.query import Filter
from ...measurement import VERTICALS
from ..security import RefusedError

Parameters = Mapping[str, str]


def filter_of(parameters: Parameters) -> Filter:
    """Return the filter of captures. Raises RefusedError."""
    status = _one_of(parameters, "status", STATUSES)
    return Filter(
        text=parameters.get("text", "")[:200],
        vehicle=parameters.get("vehicle") or None,
        status=(status,) if status else (),
        vertical=_one_of(parameters, "vertical", VERTICALS),
    )


def _one_of(parameters: Parameters, name: str, known: Iterable[str]) -> str | None:
    """Return a parameter that is one of the known values, None where it is empty or missing."""
    value = parameters.get(name)
    if value and value not in known:
        raise RefusedError(400, f"{name}: {value[:40]!r} is not one of {', '.join(known)}")
    return value or None


def offset_of(text: str) -> int:
    """Return the number of the first row of a page. Raises RefusedError."""
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise RefusedError(400, f"offset: {text[:40]!r} is not a whole number from 0")
    return int(text)
