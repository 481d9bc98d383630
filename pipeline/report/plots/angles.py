"""Toe and camber of every wheel on a scale, with their uncertainty and their limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from ...measurement import (
    Conformity,
    Measurement,
    Stated,
    ToleranceInterval,
    Verdict,
    against,
    stated,
)
from ...vehicle import Axis
from ..format.language import Translations
from .drawing import (
    GRID,
    INK,
    MINUS,
    PALE,
    CircleMark,
    Drawing,
    Mark,
    Path,
    Text,
    cut,
    rectangle,
)

LABEL, PANEL, GAP, ROW, HEAD, FOOT = 96.0, 300.0, 34.0, 24.0, 66.0, 62.0
MOST_ROWS = 48
BAR_WIDE, BAR_HIGH, BAR_END = 150.0, 16.0, 5.0
STEPS_MIN = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800)  # minutes of arc
COLOURS = {"conform": "#00694d", "undecided": "#8a5a00", "not conform": "#b3261e", "": "#0072B2"}
BAND, LIMIT = "#cfe9de", "#009E73"
DECIDED = ("reference", "trial")


def angles_drawing(
    measurement: Measurement, conformity: Conformity | None, words: Translations, axis: Axis
) -> Drawing:
    """Draw a row per wheel or trial and a panel per angle: value, expanded uncertainty, limits."""
    names = names_shown(measurement)
    height = HEAD + ROW * len(names) + FOOT
    title = angles_title(measurement, words)
    marks: list[Mark] = [Text(12, 22, title, 15, bold=True)]
    found = against(stated(measurement), axis)
    for index, name in enumerate(names):
        marks.append(
            Text(LABEL - 10, HEAD + ROW * index + 16, cut(words.wheel(name), 11), 13, "end")
        )
    for panel, kind in enumerate(("toe", "camber")):
        rows = {q.subject: q for q in found if q.kind == kind and q.subject in names}
        left = LABEL + panel * (PANEL + GAP)
        marks += _panel(left, kind, names, rows, judged_by(conformity, rows), words)
    note = "plot.angles_note" if conformity is None else "plot.angles_note_limits"
    marks.append(Text(12, height - 10, words(note), 12, colour=PALE))
    return Drawing(LABEL + 2 * PANEL + GAP + 30, height, title, marks)


def angles_title(measurement: Measurement, words: Translations) -> str:
    """Return the title of the angles, with the number of rows where some are left out."""
    count = len(measured_names(measurement))
    if count <= MOST_ROWS:
        return words("plot.angles_title")
    return words("plot.angles_first", shown=MOST_ROWS, count=count)


def names_shown(measurement: Measurement) -> list[str]:
    """Return the names of the measured reference wheels and trials, at most MOST_ROWS."""
    return measured_names(measurement)[:MOST_ROWS]


def measured_names(measurement: Measurement) -> list[str]:
    """Return the names of all measured reference wheels and trials."""
    seen = [wheel.observation for wheel in measurement.wheels if wheel.angles is not None]
    return [one.name for one in seen if one.role in DECIDED]


def _panel(
    left: float,
    kind: str,
    names: Sequence[str],
    rows: Mapping[str, Stated],
    judged: Mapping[str, Verdict],
    words: Translations,
) -> list[Mark]:
    low, high, step = range_of([*rows.values()], [*judged.values()])
    foot = HEAD + ROW * len(names)

    def at(value: float) -> float:
        return left + PANEL * (min(max(value, low), high) - low) / (high - low)

    marks: list[Mark] = [Text(left, HEAD - 24, words.known("quantity", kind), 13, bold=True)]
    hints = words(f"plot.{kind}_low"), words(f"plot.{kind}_high")
    marks.append(Text(left, HEAD - 7, f"{MINUS} {hints[0]}", 11, colour=PALE))
    marks.append(Text(left + PANEL, HEAD - 7, f"{hints[1]} +", 11, "end", colour=PALE))
    intervals = {i: judged[name].interval for i, name in enumerate(names) if name in judged}
    for index, interval in intervals.items():
        if interval is not None:
            low_x, high_x = at(interval.lower), at(interval.upper)
            y = HEAD + ROW * index + 2
            marks.append(rectangle(low_x, y, high_x - low_x, ROW - 4, BAND))
    for tick in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        x = at(tick * step)
        marks.append(Path([(x, HEAD), (x, foot)], INK if tick == 0 else GRID, 1.0))
        marks.append(Text(x, foot + 16, words.number(tick_text(tick * step)), 12, "middle"))
    for index, interval in intervals.items():
        marks += _limits(at, interval, HEAD + ROW * index)
    for index, name in enumerate(names):
        verdict = judged.get(name)
        colour = COLOURS[verdict.decision if verdict else ""]
        marks += _value(at, rows[name], HEAD + ROW * index + ROW / 2, colour)
    return marks


def bar_drawing(
    title: str,
    row: tuple[float, float, float | None],
    interval: ToleranceInterval | None,
    scale: tuple[float, float],
    decision: str,
) -> Drawing:
    """Draw one angle on a line: a dot with U, a ring for its earlier value, a band for its limits.

    row: value, U and earlier value. The band takes the middle half; without limits the line spans
    `scale`. What lies beyond is drawn at the end, as an arrowhead.
    """
    value, expanded, before = row
    low, high = scale if interval is None else _around(interval, value, expanded)

    def at(angle: float) -> float:
        share = (min(max(angle, low), high) - low) / (high - low)
        return BAR_END + (BAR_WIDE - 2 * BAR_END) * share

    y, colour = BAR_HIGH / 2.0, COLOURS[decision]
    marks: list[Mark] = []
    if interval is not None:
        left, right = at(interval.lower), at(interval.upper)
        marks.append(rectangle(left, 1.5, right - left, BAR_HIGH - 3.0, BAND))
    marks.append(Path([(BAR_END, y), (BAR_WIDE - BAR_END, y)], GRID, 1.0))
    if low < 0.0 < high:
        marks.append(Path([(at(0.0), 1.5), (at(0.0), BAR_HIGH - 1.5)], PALE, 0.8))
    ends = () if interval is None else (interval.lower, interval.upper)
    marks += [
        Path([(at(x), 0.5), (at(x), BAR_HIGH - 0.5)], LIMIT, 1.8) for x in ends if math.isfinite(x)
    ]
    if before is not None and low <= before <= high:
        marks.append(CircleMark(at(before), y, 3.0, "#ffffff", PALE, 1.2))
    if low <= value <= high:
        U_ends = [(at(value - expanded), y), (at(value + expanded), y)]
        marks += [Path(U_ends, colour, 2.2), CircleMark(at(value), y, 3.2, colour)]
    else:
        way = 1.0 if value > high else -1.0
        tip = at(value) + way * BAR_END
        head = [(tip, y), (tip - way * 8.0, y - 5.0), (tip - way * 8.0, y + 5.0)]
        marks.append(Path(head, fill=colour, closed=True))
    return Drawing(BAR_WIDE, BAR_HIGH, title, marks, ground="none")


def _around(interval: ToleranceInterval, value: float, expanded: float) -> tuple[float, float]:
    """Return a range of which the limits take the middle half; with one limit, one as wide."""
    lower, upper = interval.lower, interval.upper
    if math.isinf(interval.width):
        limit = lower if math.isfinite(lower) else upper
        reach = max(1.5 * abs(value - limit), 4.0 * expanded, 1e-9)
        lower, upper = (limit, limit + reach) if math.isfinite(lower) else (limit - reach, limit)
    return lower - (upper - lower) / 2.0, upper + (upper - lower) / 2.0


def judged_by(conformity: Conformity | None, rows: Mapping[str, Stated]) -> dict[str, Verdict]:
    """Return the verdict on the quantity of each wheel in `rows` that has a tolerance."""
    verdicts = {(v.quantity.subject, v.quantity.name): v for v in
                (conformity.verdicts if conformity else ())}  # fmt: skip
    names = {name: (name, quantity.name.split(".")[-1]) for name, quantity in rows.items()}
    return {name: verdicts[key] for name, key in names.items() if key in verdicts}


def _limits(
    at: Callable[[float], float], interval: ToleranceInterval | None, y: float
) -> list[Mark]:
    ends = [x for x in ((interval.lower, interval.upper) if interval else ()) if math.isfinite(x)]
    return [Path([(at(x), y + 2), (at(x), y + ROW - 2)], LIMIT, 2.0) for x in ends]


def _value(at: Callable[[float], float], quantity: Stated, y: float, colour: str) -> list[Mark]:
    low, high = at(quantity.value - quantity.expanded), at(quantity.value + quantity.expanded)
    ends = [(x, y - 5 * s) for x in (low, high) for s in (1, -1)]
    return [
        Path([(low, y), (high, y)], colour, 1.6),
        Path(ends[:2], colour, 1.6),
        Path(ends[2:], colour, 1.6),
        CircleMark(at(quantity.value), y, 3.2, colour),
    ]


def range_of(found: Sequence[Stated], verdicts: Sequence[Verdict]) -> tuple[float, float, float]:
    """Return the range of a panel and the step of its ticks, radians."""
    ends = [0.0] + [q.value + s * q.expanded for q in found for s in (-1.0, 1.0)]
    intervals = [v.interval for v in verdicts if v.interval is not None]
    ends += [
        x for interval in intervals for x in (interval.lower, interval.upper) if math.isfinite(x)
    ]
    reach = max(max(ends) - min(ends), math.radians(0.2 / 60.0))
    low, high = min(ends) - 0.05 * reach, max(ends) + 0.05 * reach
    minutes = math.degrees(high - low) * 60.0
    step = next((s for s in STEPS_MIN if minutes / s <= 6), STEPS_MIN[-1])
    return low, high, math.radians(step / 60.0)


def tick_text(angle_rad: float) -> str:
    """Format a round angle as briefly as possible: 0, +10', -1°30'."""
    tenths = round(abs(math.degrees(angle_rad)) * 600)
    sign = "" if tenths == 0 else MINUS if angle_rad < 0 else "+"
    degrees, tenths = divmod(tenths, 600)
    minutes = f"{tenths / 10:g}'" if tenths else ""
    return f"{sign}{degrees}°{minutes}" if degrees else f"{sign}{minutes or '0'}"
