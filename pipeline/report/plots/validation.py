"""Plots of a method comparison: differences, Bland-Altman, fitted line; angles in degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...measurement import Estimate
from ...validation import KINDS, Agreement, Comparison, Limit
from ..format.digits import decimal
from ..format.language import Translations
from ..tables.comparison import agreed, labels
from .drawing import INK, CircleMark, Drawing, Mark, Path, Text, cut, rectangle

WIDTH, HEIGHT = 760.0, 520.0
LEFT, RIGHT, TOP, BOTTOM = 84.0, 190.0, 64.0, 60.0
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#555555"  # Okabe and Ito
AxisRange = tuple[float, float]


@dataclass
class Chart:
    """Two linear axes over x_range and y_range; marks drawn in them gather in `marks`.

    x_names: labels instead of numbers; name i lies between i and i + 1.
    """

    title: str
    subtitle: str
    x_label: str
    y_label: str
    x_range: AxisRange
    y_range: AxisRange
    words: Translations
    x_names: tuple[str, ...] = ()
    marks: list[Mark] = field(default_factory=list)

    @property
    def drawing(self) -> Drawing:
        """The chart with its axes."""
        middle = ((LEFT + WIDTH - RIGHT) / 2.0, (TOP + HEIGHT - BOTTOM) / 2.0)
        marks = [
            Text(LEFT, 24, self.title, bold=True),
            Text(LEFT, 44, self.subtitle),
            Text(middle[0], HEIGHT - 14, self.x_label, anchor="middle"),
            Text(20, middle[1], self.y_label, anchor="middle", turn_deg=-90.0),
            *self._axes(),
            *self.marks,
        ]
        return Drawing(WIDTH, HEIGHT, self.title, marks)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a point."""
        across = (x - self.x_range[0]) / (self.x_range[1] - self.x_range[0])
        up = (y - self.y_range[0]) / (self.y_range[1] - self.y_range[0])
        return (
            LEFT + across * (WIDTH - LEFT - RIGHT),
            HEIGHT - BOTTOM - up * (HEIGHT - BOTTOM - TOP),
        )

    def point(self, x: float, y: float, colour: str = BLUE, radius: float = 3.0) -> None:
        """Add a translucent dot."""
        self.marks.append(CircleMark(*self.at(x, y), radius, colour, opacity=0.55))

    def line(
        self, start: AxisRange, end: AxisRange, colour: str, dash: AxisRange | None = None
    ) -> None:
        """Add the part of a straight line between two points that lies within the axes."""
        shares = _within(start[0], end[0], *self.x_range), _within(start[1], end[1], *self.y_range)
        first, last = max(s[0] for s in shares), min(s[1] for s in shares)
        if first < last:
            ends = [
                tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))
                for share in (first, last)
            ]
            self.marks.append(Path([self.at(*point) for point in ends], colour, 1.6, dash=dash))

    def level(self, limit: Limit, name: str, colour: str) -> None:
        """Add a horizontal line with its confidence band, labelled at the right; radians."""
        value, low, high = (math.degrees(x) for x in (limit.value, limit.low, limit.high))
        (left, top), (_, bottom) = (self.at(self.x_range[0], y) for y in (high, low))
        height = max(bottom - top, 0.5)
        self.marks.append(rectangle(left, top, WIDTH - LEFT - RIGHT, height, colour, opacity=0.15))
        self.line((self.x_range[0], value), (self.x_range[1], value), colour, (6.0, 4.0))
        number = decimal(value, (high - low) / 2.0, 4)
        for row, text in enumerate((name, self.words.number(f"{number}°"))):
            y = self.at(0.0, value)[1] + 4 + 16 * row
            self.marks.append(Text(WIDTH - RIGHT + 8, y, text, colour=colour))

    def legend(self, entries: Sequence[tuple[str, str]]) -> None:
        """Add texts in their colours at the upper right."""
        for row, (text, colour) in enumerate(entries):
            self.marks.append(Text(WIDTH - RIGHT + 10, TOP + 14 + 20 * row, text, colour=colour))

    def _axes(self) -> list[Mark]:
        marks: list[Mark] = []
        right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
        for value in () if self.x_names else ticks(*self.x_range):
            x = self.at(value, 0.0)[0]
            marks.append(Path([(x, TOP), (x, bottom)], INK, opacity=0.12))
            marks.append(Text(x, bottom + 18, self._number(value), anchor="middle"))
        for index, name in enumerate(self.x_names):
            x = self.at(index + 0.5, 0.0)[0]
            marks.append(Text(x, bottom + 18, cut(name, 12), anchor="middle"))
        for value in ticks(*self.y_range):
            y = self.at(0.0, value)[1]
            marks.append(Path([(LEFT, y), (right, y)], INK, opacity=0.12))
            marks.append(Text(LEFT - 8, y + 4, self._number(value), anchor="end"))
        return [*marks, rectangle(LEFT, TOP, right - LEFT, bottom - TOP, stroke=INK)]

    def _number(self, value: float) -> str:
        return self.words.number(f"{value + 0.0:.6g}")


def _within(start: float, end: float, low: float, high: float) -> tuple[float, float]:
    """Return the shares of the way from start to end, 0 to 1, between which it is in [low, high].

    Source: Liang and Barsky, ACM Transactions on Graphics 3 (1984) 1.
    """
    if start == end:
        return (0.0, 1.0) if low <= start <= high else (1.0, 0.0)
    shares = sorted(((low - start) / (end - start), (high - start) / (end - start)))
    return max(0.0, shares[0]), min(1.0, shares[1])


def ticks(low: float, high: float) -> list[float]:
    """Return the round numbers within [low, high], four to ten of them."""
    raw = (high - low) / 8.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * power >= raw)
    first, last = math.ceil(low / step), math.floor(high / step)
    return [index * step for index in range(first, last + 1)]


def differences_drawing(comparison: Comparison, words: Translations) -> Drawing:
    """Draw every difference with its expanded uncertainty."""
    first, second = labels(comparison, words)
    verdict = agreed(comparison.verdict, words)
    p = words.number(f"{comparison.joint.probability:.3g}")
    difference = np.degrees(comparison.difference_rad)
    expanded = np.degrees(comparison.spread.expanded)
    count = len(comparison.names)
    chart = Chart(
        words("comparison_plot.differences", first=first, second=second, verdict=verdict),
        words("comparison_plot.differences_note", p=p),
        words("comparison_plot.wheel"),
        words("comparison_plot.difference"),
        (0.0, float(count)),
        _range([*(difference - expanded), *(difference + expanded), 0.0]),
        words,
        tuple(map(words.wheel, comparison.names)),
    )
    chart.line((0.0, 0.0), (float(count), 0.0), GREY)
    for kind, colour in enumerate((BLUE, ORANGE)):
        for index in range(count):
            x, i = index + 0.36 + 0.28 * kind, index + count * kind
            y, U = float(difference[i]), float(expanded[i])
            chart.line((x, y - U), (x, y + U), colour)
            chart.point(x, y, colour, 4.0)
    kinds = [f"{words.known('quantity', kind)} ({_sign(kind, words)})" for kind in KINDS]
    chart.legend(list(zip(kinds, (BLUE, ORANGE), strict=True)))
    return chart.drawing


def _sign(kind: str, words: Translations) -> str:
    return words(f"comparison_plot.{kind}")


def bland_altman_drawing(one: Agreement, first: str, second: str, words: Translations) -> Drawing:
    """Draw difference over mean, with bias and limits of agreement."""
    count, subjects, units = len(one.first), one.subjects, one.units
    kind = words.known("quantity", one.kind)
    mean = np.degrees((one.first + one.second) / 2.0)
    difference = np.degrees(one.first - one.second)
    limits = (one.lower, one.bias, one.upper)
    ends = [math.degrees(x) for limit in limits for x in (limit.low, limit.high)]
    chart = Chart(
        words("comparison_plot.bland_altman", kind=kind, first=first, second=second),
        words("comparison_plot.bland_altman_note", count=count, subjects=subjects, units=units),
        words("comparison_plot.mean", sign=_sign(one.kind, words)),
        words("comparison_plot.difference"),
        _range([*mean]),
        _range([*difference, *ends]),
        words,
    )
    chart.line((chart.x_range[0], 0.0), (chart.x_range[1], 0.0), GREY)
    for x, y in zip(mean, difference, strict=True):
        chart.point(float(x), float(y))
    names = [words(f"comparison_plot.{name}") for name in ("lower", "bias", "upper")]
    for limit, name, colour in zip(limits, names, (ORANGE, GREEN, ORANGE), strict=True):
        chart.level(limit, name, colour)
    return chart.drawing


def line_drawing(one: Agreement, first: str, second: str, words: Translations) -> Drawing:
    """Draw second over first method, with the fitted line and the line of equality."""
    x, y = np.degrees(one.first), np.degrees(one.second)
    low, high = _range([*x, *y])
    kind = words.known("quantity", one.kind)
    fitted = one.line
    subtitle = words("comparison_plot.no_line")
    if fitted is not None:
        slope = Estimate(fitted.slope, fitted.u_slope)
        intercept = Estimate(math.degrees(fitted.intercept), math.degrees(fitted.u_intercept))
        subtitle = words(
            "comparison_plot.line_note",
            slope=words.number(decimal(slope.value, slope.expanded, 4, "")),
            u_slope=words.number(decimal(slope.u, slope.u, 4, "")),
            intercept=words.number(decimal(intercept.value, intercept.expanded, 4)),
            u_intercept=words.number(decimal(intercept.u, intercept.u, 4, "")),
        )
    chart = Chart(
        words("comparison_plot.line", kind=kind.capitalize(), first=first, second=second),
        subtitle,
        f"{first} / ° ({_sign(one.kind, words)})",
        f"{second} / °",
        (low, high),
        (low, high),
        words,
    )
    chart.line((low, low), (high, high), GREY, (4.0, 4.0))
    for a, b in zip(x, y, strict=True):
        chart.point(float(a), float(b))
    legend = [(words("comparison_plot.equality"), GREY)]
    if fitted is not None:
        ends = [(v, math.degrees(fitted.intercept) + fitted.slope * v) for v in (low, high)]
        chart.line(ends[0], ends[1], ORANGE)
        legend.append((words("comparison_plot.fitted"), ORANGE))
    chart.legend(legend)
    return chart.drawing


def _range(values: list[float], margin: float = 0.06) -> AxisRange:
    """Return lowest and highest value with a margin; never empty."""
    low, high = min(values), max(values)
    room = max(margin * (high - low), 1e-9 + 1e-3 * max(abs(low), abs(high)))
    return low - room, high + room
