"""Control chart of one quantity as plain data, with the texts of each point."""

from __future__ import annotations

import math
from typing import Any

from ...batch.results.control_chart import ControlChart, Point
from ...batch.results.tables import expanded, value, width
from ...errors import printable
from ...report.format.language import Translations
from ...report.format.view import PAPER
from ...report.format.writer import Table, Writer
from ..content.panel import table_tree

SCALES = {"deg": (60.0, "\N{PRIME}"), "m": (1000.0, "mm")}  # minutes of arc, and millimetres


def chart_tree(chart: ControlChart, name: str, words: Translations) -> dict[str, Any]:
    """Return numbers in minutes of arc or mm; points with their texts; those that break a rule."""
    scale, unit = SCALES[chart.unit]
    limits, writer = chart.limits, Writer(words, PAPER)
    wide = expanded(_typical(chart))
    broken = [i for i, point in enumerate(chart.points) if point.rules or point.jumps]
    return {
        "name": name,
        "unit": unit,
        "limits": {
            key: scale * getattr(limits, key)
            for key in ("mean", "lower", "upper", "range_mean", "range_upper")
        },
        "sigma": scale * limits.sigma,
        "facts": [
            [words("page.points_charted"), words.count(len(chart.points))],
            [words("page.chart_mean"), value(limits.mean, chart.unit, writer, wide)],
            [words("page.chart_limits"), words("page.chart_from_to",
                low=value(limits.lower, chart.unit, writer, wide),
                high=value(limits.upper, chart.unit, writer, wide))],
            [words("page.chart_sigma"), width(limits.sigma, chart.unit, writer)],
            *[[words("page.chart_left_out"), words.count(chart.left_out)]] * bool(chart.left_out),
        ],
        "points": [_point(point, chart.unit, scale, writer) for point in chart.points],
        "broken": broken,
        "table": table_tree(_table([chart.points[i] for i in broken], chart.unit, writer)),
    }  # fmt: skip


def _typical(chart: ControlChart) -> float | None:
    """Return a standard uncertainty by which the chart's numbers are rounded."""
    known = [point.u for point in chart.points if math.isfinite(point.u)]
    return min(known, default=None)


def _point(point: Point, unit: str, scale: float, writer: Writer) -> dict[str, Any]:
    moving = point.moving_range
    return {
        "key": point.key,
        "value": scale * point.value,
        "range": None if moving is None else scale * moving,
        "rules": list(point.rules),
        "jumps": point.jumps,
        "name": printable(point.name),
        "date": point.date or "",
        "text": value(point.value, unit, writer, expanded(_u(point))),
        "range_text": "" if moving is None else width(moving, unit, writer),
        "says": _says(point, writer.words),
    }


def _u(point: Point) -> float | None:
    return point.u if math.isfinite(point.u) else None


def _says(point: Point, words: Translations) -> list[str]:
    """Name the rules that a point breaks."""
    jump = [words("page.nelson_range")] if point.jumps else []
    return [words(f"page.nelson_{rule}", number=str(rule)) for rule in point.rules] + jump


def _table(points: list[Point], unit: str, writer: Writer) -> Table:
    words = writer.words
    rows = [
        [printable(point.name), point.vehicle or writer.none, point.date or writer.none,
         value(point.value, unit, writer, expanded(_u(point))), "; ".join(_says(point, words))]
        for point in points
    ]  # fmt: skip
    head = [words(f"page.{name}").lower() for name in ("name", "vehicle", "date")]
    head += [words("vehicle.value"), words("page.rules_broken").lower()]
    return Table(head, rows, 5, words("page.rules_broken"), ["undecided"] * len(rows), [1])
