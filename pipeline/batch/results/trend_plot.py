"""Plot of one quantity of many captures over time, with its drift (Drawing)."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from ...report.format.language import Translations
from ...report.plots.drawing import GRID, PALE, Dots, Drawing, Mark, Path, Text
from ...report.plots.validation import ticks
from .series import Series
from .trends import Drift

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 900.0, 320.0, 90.0, 40.0, 20.0, 40.0
MOST_DOTS = 4000
SCALES = {"deg": (60.0, "'"), "m": (1000.0, "mm")}  # minutes of arc; millimetres


def trend_drawing(one: Series, line: Drift, name: str, words: Translations) -> Drawing:
    """Draw values as dots, 2 u as bars if there are few, and the line of the drift."""
    scale, unit = SCALES[one.unit]
    known = np.flatnonzero(np.isfinite(one.day))
    shown = known[:: max(1, -(-len(known) // MOST_DOTS))]
    day, y = one.day[shown], one.values[shown] * scale
    u = np.nan_to_num(one.u[shown]) * scale
    low, high = _range(y - 2.0 * u, y + 2.0 * u)
    first, last = float(day.min()), float(day.max())

    def at(x: float, value: float) -> tuple[float, float]:
        across = (x - first) / max(last - first, 1e-9)
        return (
            LEFT + 10.0 + across * (WIDTH - LEFT - RIGHT - 20.0),
            HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM),
        )

    positions = np.array([at(*pair) for pair in zip(day.tolist(), y.tolist(), strict=True)])
    ends = [(x, (line.at_mean + line.slope * (x - line.mean_day)) * scale) for x in (first, last)]
    marks: list[Mark] = [Text(LEFT, 20.0, f"{name} ({unit})", 14.0, bold=True)]
    for value in ticks(low, high):
        (_, height), right = at(first, value), WIDTH - RIGHT
        marks.append(Path([(LEFT, height), (right, height)], stroke=GRID))
        text = words.number(f"{value:g}")
        marks.append(Text(LEFT - 8.0, height + 4.0, text, 12.0, "end", colour=PALE))
    for x, anchor in ((first, "start"), (last, "end")):
        date = datetime.fromtimestamp(x * 86400.0, UTC).date().isoformat()
        marks.append(Text(at(x, low)[0], HEIGHT - 12.0, date, 12.0, anchor, colour=PALE))  # type: ignore[arg-type]
    for x, value, half in zip(day.tolist(), y.tolist(), u.tolist(), strict=True):
        if len(day) <= 200 and half:
            bar = [at(x, value - 2.0 * half), at(x, value + 2.0 * half)]
            marks.append(Path(bar, stroke="#8aa9c8", width=1.5))
    marks.append(Dots(positions, 2.2 if len(day) > 400 else 3.2, "#0b5cad", 0.75))
    marks.append(Path([at(*end) for end in ends], stroke="#b35c00", width=2.0))
    return Drawing(WIDTH, HEIGHT, f"{words('page.drift')}: {name}", marks)


def _range(
    low: np.typing.NDArray[np.float64], high: np.typing.NDArray[np.float64]
) -> tuple[float, float]:
    """Return the range of all bars with a margin."""
    bottom, top = float(low.min()), float(high.max())
    margin = 0.08 * max(top - bottom, 1e-6)
    return bottom - margin, top + margin
