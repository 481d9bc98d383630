"""A plot's frame (SVG): two axes in degrees with round ticks, points, lines, bands and words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

import numpy as np

from ...validation import KINDS, Agreement, Comparison, Limit

WIDTH, HEIGHT = 760, 520
LEFT, RIGHT, TOP, BOTTOM = 84, 190, 64, 60
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#555555"  # Okabe and Ito


@dataclass
class Plot:
    """Axes over [x_low, x_high] and [y_low, y_high]; what is drawn gathers in `parts`.

    x_names: in the place of numbers, name i between i and i + 1.
    """

    title: str
    subtitle: str
    x_label: str
    y_label: str
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    x_names: tuple[str, ...] = ()
    parts: list[str] = field(default_factory=list)

    def svg(self) -> str:
        """The whole, with axes."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            f'width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="13">'
        )
        ground = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>'
        middle = (TOP + HEIGHT - BOTTOM) / 2
        words = [
            words_at(LEFT, 24, self.title, weight="bold"),
            words_at(LEFT, 44, self.subtitle),
            words_at((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, self.x_label, anchor="middle"),
            f'<g transform="translate(20 {middle:.1f}) rotate(-90)">'
            f"{words_at(0, 0, self.y_label, anchor='middle')}</g>",
        ]
        return "\n".join([head, ground, *words, *self._axes(), *self.parts, "</svg>\n"])

    def x(self, value: float) -> float:
        """Pixel of a value."""
        share = (value - self.x_low) / (self.x_high - self.x_low)
        return LEFT + share * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        """Pixel of a value."""
        share = (value - self.y_low) / (self.y_high - self.y_low)
        return HEIGHT - BOTTOM - share * (HEIGHT - BOTTOM - TOP)

    def point(self, x: float, y: float, colour: str = BLUE, radius: float = 3.0) -> None:
        """A dot."""
        self.parts.append(
            f'<circle cx="{self.x(x):.2f}" cy="{self.y(y):.2f}" r="{radius}" fill="{colour}" '
            'fill-opacity="0.55"/>'
        )

    def line(
        self, start: tuple[float, float], end: tuple[float, float], colour: str, dash: str = ""
    ) -> None:
        """A straight line between two points of the plot."""
        (x1, y1), (x2, y2) = start, end
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<line x1="{self.x(x1):.2f}" y1="{self.y(y1):.2f}" x2="{self.x(x2):.2f}" '
            f'y2="{self.y(y2):.2f}" stroke="{colour}" stroke-width="1.6"{dashed}/>'
        )

    def level(self, value: float, low: float, high: float, colour: str, text: str) -> None:
        """A horizontal line with the band of its confidence limits, named at the right."""
        top, bottom = self.y(high), self.y(low)
        self.parts.append(
            f'<rect x="{LEFT}" y="{top:.2f}" width="{WIDTH - LEFT - RIGHT}" '
            f'height="{max(bottom - top, 0.5):.2f}" fill="{colour}" fill-opacity="0.15"/>'
        )
        self.line((self.x_low, value), (self.x_high, value), colour, "6 4")
        for row, part in enumerate(text.split("\n")):
            place = self.y(value) + 4 + 16 * row
            self.parts.append(words_at(WIDTH - RIGHT + 8, place, part, colour=colour))

    def _axes(self) -> list[str]:
        parts = []
        right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
        for value in () if self.x_names else ticks(self.x_low, self.x_high):
            x = self.x(value)
            parts.append(_grid(x, TOP, x, bottom))
            parts.append(words_at(x, bottom + 18, _number(value), anchor="middle"))
        for index, name in enumerate(self.x_names):
            parts.append(words_at(self.x(index + 0.5), bottom + 18, name[:12], anchor="middle"))
        for value in ticks(self.y_low, self.y_high):
            y = self.y(value)
            parts.append(_grid(LEFT, y, right, y))
            parts.append(words_at(LEFT - 8, y + 4, _number(value), anchor="end"))
        parts.append(
            f'<rect x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{bottom - TOP}" '
            'fill="none" stroke="#000000"/>'
        )
        return parts


def ticks(low: float, high: float) -> list[float]:
    """Round numbers within [low, high], four to ten of them."""
    raw = (high - low) / 8.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * power >= raw)
    first, last = math.ceil(low / step), math.floor(high / step)
    return [index * step for index in range(first, last + 1)]


def bounds(values: list[float], margin: float = 0.06) -> tuple[float, float]:
    """Lowest and highest, with a margin; never empty."""
    low, high = min(values), max(values)
    room = max(margin * (high - low), 1e-9 + 1e-3 * max(abs(low), abs(high)))
    return low - room, high + room


def words_at(
    x: float,
    y: float,
    text: str,
    anchor: str = "start",
    weight: str = "normal",
    colour: str = "#000000",
) -> str:
    """Text at a pixel."""
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" font-weight="{weight}" '
        f'fill="{colour}">{escape(text)}</text>'
    )


def _grid(x1: float, y1: float, x2: float, y2: float) -> str:
    return (
        f'<line x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}" stroke="#000000" '
        'stroke-opacity="0.12"/>'
    )


def _number(value: float) -> str:
    return f"{value + 0.0:.6g}"


SIGN = {"toe": "toe-in positive", "camber": "top-out positive"}


def differences_svg(found: Comparison) -> str:
    """Every difference with its expanded uncertainty; the same comparison gives the same bytes."""
    difference = np.degrees(found.difference_rad)
    reach = np.degrees(found.spread.expanded)
    low, high = bounds([*(difference - reach), *(difference + reach), 0.0])
    count = len(found.names)
    plot = Plot(
        f"{found.first.label} less {found.second.label}: {found.verdict}",
        f"bars: 95 %; all together p = {found.joint.probability:.3g}; toe-in, top-out positive",
        "wheel or trial",
        "difference / °",
        0.0,
        float(count),
        low,
        high,
        found.names,
    )
    plot.line((0.0, 0.0), (float(count), 0.0), GREY)
    for kind, colour in enumerate((BLUE, ORANGE)):
        for index in range(count):
            x, i = index + 0.36 + 0.28 * kind, index + count * kind
            y, U = float(difference[i]), float(reach[i])
            plot.line((x, y - U), (x, y + U), colour)
            plot.point(x, y, colour, 4.0)
        label = f"{KINDS[kind]} ({SIGN[KINDS[kind]]})"
        plot.parts.append(words_at(WIDTH - RIGHT + 10, TOP + 14 + 20 * kind, label, colour=colour))
    return plot.svg()


def bland_altman_svg(one: Agreement, first: str, second: str) -> str:
    """Difference over mean, with bias and limits of agreement."""
    mean = np.degrees((one.first + one.second) / 2.0)
    difference = np.degrees(one.first - one.second)
    levels = (one.lower, one.bias, one.upper)
    ends = [math.degrees(x) for limit in levels for x in (limit.low, limit.high)]
    plot = Plot(
        f"Bland-Altman, {one.kind}: {first} less {second}",
        f"{len(difference)} differences, {one.subjects} wheels, {one.units} captures or vehicles; "
        "bands: 95 % confidence",
        f"mean of both / ° ({SIGN[one.kind]})",
        "difference / °",
        *bounds([*mean]),
        *bounds([*difference, *ends]),
    )
    plot.line((plot.x_low, 0.0), (plot.x_high, 0.0), GREY)
    for x, y in zip(mean, difference, strict=True):
        plot.point(float(x), float(y))
    names = ("lower limit", "bias", "upper limit")
    for limit, name, colour in zip(levels, names, (ORANGE, GREEN, ORANGE), strict=True):
        _level(plot, limit, name, colour)
    return plot.svg()


def line_svg(one: Agreement, first: str, second: str) -> str:
    """Second over first method, with the fitted line and that of equality."""
    x, y = np.degrees(one.first), np.degrees(one.second)
    low, high = bounds([*x, *y])
    fitted = one.line
    said = "no line: it takes three points with uncertainties"
    if fitted is not None:
        said = (
            f"York: slope {fitted.slope:.4f} (u {fitted.u_slope:.4f}), intercept "
            f"{math.degrees(fitted.intercept):+.4f}° (u {math.degrees(fitted.u_intercept):.4f}°)"
        )
    plot = Plot(
        f"{one.kind.capitalize()}: {second} over {first}",
        said,
        f"{first} / ° ({SIGN[one.kind]})",
        f"{second} / °",
        low,
        high,
        low,
        high,
    )
    plot.line((low, low), (high, high), GREY, "4 4")
    for a, b in zip(x, y, strict=True):
        plot.point(float(a), float(b))
    legend = [("equal", GREY)]
    if fitted is not None:
        ends = [(v, math.degrees(fitted.intercept) + fitted.slope * v) for v in (low, high)]
        plot.line(ends[0], ends[1], ORANGE)
        legend.append(("fitted line", ORANGE))
    for row, (text, colour) in enumerate(legend):
        plot.parts.append(words_at(WIDTH - RIGHT + 10, TOP + 14 + 20 * row, text, colour=colour))
    return plot.svg()


def _level(plot: Plot, limit: Limit, name: str, colour: str) -> None:
    value, low, high = (math.degrees(x) for x in (limit.value, limit.low, limit.high))
    plot.level(value, low, high, colour, f"{name}\n{value:+.4f}°")
