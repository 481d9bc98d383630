"""Catalogue contents as text tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

from ...measurement import Estimate
from ...report.format.digits import UNKNOWN, millimetres
from ...report.format.layout import aligned
from ...report.format.view import PAPER, View
from ...vehicle import REFERENCE_WHEELS
from ..catalogue.catalogue import Catalogue
from ..catalogue.rows import CaptureRow
from ..catalogue.schema import number_of
from .query import ALL, FailureGroup, Filter, captures, condition
from .trends import MONTH_DAYS, Drift, Outlier, Summary

ANGLES = tuple(f"{wheel} {angle}" for wheel in REFERENCE_WHEELS for angle in ("toe", "camber"))
Angles = dict[str, tuple[float, float | None]]  # by "RR toe": degrees and u
BLOCK = 500
SIGNS = "Toe-in and camber with the top outward are positive."
K1 = "u: standard uncertainty (k = 1)"


def capture_table(
    catalogue: Catalogue, which: Filter = ALL, view: View = PAPER, limit: int | None = None
) -> Iterator[str]:
    """Yield the lines of a table: one capture a line, with wheel angles or the failure's reason."""
    rows = list(captures(catalogue, which, limit=limit))
    widths = [max([len(head), *map(len, map(f, rows))]) for head, f in HEADS.items()]
    angle_width = len(view.angle(math.radians(-10.0), "camber"))  # with all digits, the widest
    heads = [f"{head:<{width}}" for head, width in zip(HEADS, widths, strict=True)]
    yield "  ".join([*heads, *(f"{name:>{angle_width}}" for name in ANGLES), "largest u"])
    for start in range(0, len(rows), BLOCK):
        block = rows[start : start + BLOCK]
        angles = _angles(catalogue, [number_of(row.key) for row in block])
        for row in block:
            cells = [f"{f(row):<{w}}" for f, w in zip(HEADS.values(), widths, strict=True)]
            cells += _angle_cells(angles.get(number_of(row.key), {}), angle_width, view)
            yield "  ".join(cells + _why(row)).rstrip()


def _angle_cells(found: Angles, width: int, view: View) -> list[str]:
    """Return the cells of a capture's angles and of the largest u; empty if it has none."""
    known = [u for _, u in found.values() if u is not None]
    largest = [view.width(math.radians(max(known)), "camber").rjust(9)] if known else []
    return [_angle(found, name, view).rjust(width) for name in ANGLES if found] + largest


HEADS: dict[str, Callable[[CaptureRow], str]] = {
    "capture": lambda row: _shown(row.name or row.key),
    "date": lambda row: row.date or "-",
    "vehicle": lambda row: _shown(row.vehicle or "-"),
    "status": lambda row: row.status,
    "wheels": lambda row: f"{row.wheels_ok}/{row.wheels}",
}


def _angles(catalogue: Catalogue, numbers: list[int]) -> dict[int, Angles]:
    """Load degrees and u of the measured angles of reference wheels, by row number."""
    found: dict[int, Angles] = {}
    for number_, wheel, toe, camber, u_toe, u_camber in catalogue.connection.execute(
        "SELECT id, name, toe_deg, camber_deg, u_toe_deg, u_camber_deg FROM wheel_rows "  # noqa: S608
        "WHERE role = 'reference' AND toe_deg IS NOT NULL "
        f"AND id IN ({', '.join('?' * len(numbers))})",
        numbers,
    ):
        of_capture = found.setdefault(number_, {})
        of_capture[f"{wheel} toe"] = toe, u_toe
        of_capture[f"{wheel} camber"] = camber, u_camber
    return found


def _angle(found: Angles, name: str, view: View) -> str:
    if name not in found:
        return "-"
    sort = "toe" if name.endswith("toe") else "camber"
    value, u = found[name]
    return view.angle(math.radians(value), sort, math.radians(expanded(u)))  # type: ignore[arg-type]


def _why(row: CaptureRow) -> list[str]:
    return [] if row.status == "ok" else [_shown(f"{row.stage}: {row.reason}".strip(": "))]


def _shown(text: str) -> str:
    """Escape characters that a terminal would interpret."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def totals(rows: dict[str, int], removed: int = 0) -> str:
    """Format the numbers of captures: all, by status, and no longer in the archive."""
    parts = ", ".join(f"{count:,} {status}" for status, count in rows.items())
    parts += f", {removed:,} no longer in the archive" * (removed > 0)
    return f"{sum(rows.values()):,} captures" + (f": {parts}." if parts else ".")


def by_status(catalogue: Catalogue, which: Filter = ALL) -> dict[str, int]:
    """Count the captures of each status."""
    where, values = condition(catalogue, which)
    rows = catalogue.connection.execute(
        f"SELECT status, count(*) FROM captures AS c {where} GROUP BY status ORDER BY status",  # noqa: S608
        values,
    )
    return dict(rows.fetchall())


def summary_text(found: tuple[Summary, ...], view: View = PAPER) -> str:
    """Format a table of statistics."""
    head = ("quantity", "n", "mean", "sd", "robust sd", "median", "min", "max", "typical u")
    rows = [
        (
            s.quantity,
            f"{s.n:,}",
            _value(s.mean, s.unit, view, expanded(s.u_rms)),
            _width(s.sd, s.unit, view),
            _width(s.robust_sd, s.unit, view),
            *(_value(x, s.unit, view, expanded(s.u_rms)) for x in (s.median, s.low, s.high)),
            _width(s.u_rms, s.unit, view),
        )
        for s in found
    ]
    notes = (
        f"{SIGNS}\n"
        "sd: divisor n - 1; robust sd: 1.4826 times the median absolute deviation from the\n"
        "median; typical u: root mean square of the stated standard uncertainties (k = 1).\n"
        "An sd far above the typical u shows real differences between captures."
    )
    return f"{aligned([head, *rows], 1)}\n\n{notes}"


def drift_text(found: tuple[Drift, ...], view: View = PAPER) -> str:
    """Format a table of drifts, per 30 days."""
    head = ("quantity", "n", "from", "to", "per 30 days", "+-95 %", "scatter", "p", "drift")
    rows = [_drift_row(d, view) for d in found]
    notes = (
        f"{SIGNS}\n"
        "Weighted straight line over the captures' dates; scatter: standard deviation between\n"
        'captures in excess of their u; p: p-value of the slope under no drift; drift: "yes"\n'
        "where significant at 5 % after Holm's correction for all rows of this table."
    )
    return f"{aligned([head, *rows], 1)}\n\n{notes}"


def _drift_row(d: Drift, view: View) -> tuple[str, ...]:
    if d.reason:
        return (d.quantity, f"{d.n:,}", *("-",) * 6, d.reason)
    return (
        d.quantity,
        f"{d.n:,}",
        day_text(d.first_day),
        day_text(d.last_day),
        _value(d.slope * MONTH_DAYS, d.unit, view, d.expanded * MONTH_DAYS),
        _width(d.expanded * MONTH_DAYS, d.unit, view),
        _width(d.scatter, d.unit, view),
        f"{d.p:.2g}",
        "yes" if d.significant else "no",
    )


def worst_text(found: tuple[Outlier, ...], view: View = PAPER) -> str:
    """Format a table of outliers."""
    head = ("capture", "date", "quantity", "value", "u", "median", "deviation")
    rows = [
        (
            _shown(o.name),
            o.date or "-",
            o.quantity,
            _value(o.value, o.unit, view, expanded(o.u)),
            _width(o.u, o.unit, view),
            _value(o.median, o.unit, view, expanded(o.u)),
            f"{o.score:.1f}",
        )
        for o in found
    ]
    notes = "deviation: from the median, in robust sd, or in typical u where that is larger."
    return f"{aligned([head, *rows], 3)}\n\n{SIGNS} {K1}.\n{notes}"


def failures_text(found: tuple[FailureGroup, ...], _view: View = PAPER) -> str:
    """Format the groups of failures, the most frequent first, with examples."""
    lines = []
    for group in found:
        stage = group.stage or "-"
        lines.append(f"{group.count:>7,}  {group.status}  {stage}: {_shown(group.reason)}")
        lines += [f"{'':9}{_shown(name)}" for name in group.examples]
    return "\n".join(lines) or "No failures."


def plain(row: Any) -> dict[str, Any]:
    """Return a record as plain data, with null for nan and infinity."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in vars(row).items()
    }


def day_text(day: float) -> str:
    """Format days since 1970-01-01 as a date."""
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=day)).date().isoformat()


def expanded(u: float | None) -> float:
    """Return U of a value of which the catalogue holds u, as of infinite degrees of freedom."""
    return UNKNOWN if u is None else Estimate(0.0, u).expanded


def _value(x: float, unit: str, view: View, wide: float) -> str:
    """Write a value to the place of its U, `wide`."""
    if not math.isfinite(x):
        return "-"
    if unit == "deg":
        return view.angle(math.radians(x), "camber", math.radians(wide))
    return millimetres(x, view.known(wide), "+")


def _width(x: float, unit: str, view: View) -> str:
    if not math.isfinite(x):
        return "-"
    if unit == "deg":
        return view.width(math.radians(x), "camber")
    return millimetres(x, view.known(x))
