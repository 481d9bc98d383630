"""Toe and camber on a scale of characters, for terminals."""

from __future__ import annotations

import math

from ...measurement import Conformity, Measurement, Stated, Verdict, against, stated
from ..format.language import Translations
from ..format.view import View
from .angles import angles_title, judged_by, measured_names, names_shown, range_of, tick_text
from .drawing import MINUS, cut

WIDTH, MOST_NAME = 61, 16


def angles_text(
    measurement: Measurement, conformity: Conformity | None, words: Translations, view: View
) -> str:
    """Return a line per wheel and angle: value, U as a bar, [ and ] for limits, | for zero."""
    found = against(stated(measurement), view.axis)
    names = names_shown(measurement)
    wide = max(len(cut(words.wheel(name), MOST_NAME)) for name in names)
    parts = []
    for kind in ("toe", "camber"):
        rows = {q.subject: q for q in found if q.kind == kind and q.subject in names}
        verdicts = judged_by(conformity, rows)
        low, high, step = range_of([*rows.values()], [*verdicts.values()])
        texts = {n: words.number(view.angle(rows[n].value, kind, rows[n].expanded)) for n in names}
        numbers = max(map(len, texts.values()))
        ends = [words(f"plot.{kind}_{end}") for end in ("low", "high")]
        parts.append(f"{words.known('quantity', kind)}  ({MINUS} {ends[0]}, + {ends[1]})")
        for name in names:
            bar = _line(rows[name], verdicts.get(name), low, high)
            called, value = (
                f"{cut(words.wheel(name), MOST_NAME):<{wide}}",
                f"{texts[name]:>{numbers}}",
            )
            parts.append(f"  {called}  {value}  {bar}".rstrip())
        parts.append(" " * (wide + numbers + 6) + words.number(_scale(low, high, step)))
    some = len(names) < len(measured_names(measurement))
    first = [angles_title(measurement, words)] * some
    return "\n".join([*first, *parts, words("plot.text_note"), ""])


def _line(quantity: Stated, verdict: Verdict | None, low: float, high: float) -> str:
    line = [" "] * WIDTH

    def put(value: float, mark: str) -> None:
        if math.isfinite(value):
            line[_column(value, low, high)] = mark

    put(0.0, "|")
    ends = (quantity.value - quantity.expanded, quantity.value + quantity.expanded)
    first, last = (_column(end, low, high) for end in ends)
    line[first : last + 1] = "─" * (last + 1 - first)
    if verdict is not None and verdict.interval is not None:
        put(verdict.interval.lower, "[")
        put(verdict.interval.upper, "]")
    put(quantity.value, "●")
    return "".join(line)


def _scale(low: float, high: float, step: float) -> str:
    line = [" "] * (WIDTH + 8)
    for tick in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        text = tick_text(tick * step)
        start = max(0, _column(tick * step, low, high) - len(text) // 2)
        if "".join(line[max(0, start - 1) : start + len(text)]).strip():
            continue
        line[start : start + len(text)] = text
    return "".join(line).rstrip()


def _column(value: float, low: float, high: float) -> int:
    share = (min(max(value, low), high) - low) / (high - low)
    return round(share * (WIDTH - 1))
