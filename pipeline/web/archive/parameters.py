"""Parameters of a request for a view of batch results."""

from __future__ import annotations

from collections.abc import Mapping

from ...batch.catalogue.rows import STATUSES
from ...batch.results.query import Filter
from ...measurement import VERTICALS
from ..security import RefusedError

Parameters = Mapping[str, str]


def filter_of(parameters: Parameters) -> Filter:
    """Return the filter of captures."""
    status, vertical = parameters.get("status", ""), parameters.get("vertical", "")
    return Filter(
        text=parameters.get("text", "")[:200],
        vehicle=parameters.get("vehicle") or None,
        status=(status,) if status in STATUSES else (),
        vertical=vertical if vertical in VERTICALS else None,
    )


def offset_of(text: str) -> int:
    """Return the number of the first row of a page. Raises RefusedError."""
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise RefusedError(400, f"offset: {text[:40]!r} is not a whole number from 0")
    return int(text)
