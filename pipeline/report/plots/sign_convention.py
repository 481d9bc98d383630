"""Sign convention: sketches of toe and thrust angle from above, camber from behind."""

from __future__ import annotations

import math

import numpy as np

from ..format.language import Translations
from ..format.writer import Writer
from .drawing import INK, PALE, Anchor, Drawing, Mark, Path, Text, arrow

WIDTH, HEIGHT = 760.0, 250.0
EDGE, TYRE, ANGLE, LINE = "#37474f", "#dfe5ea", "#b3261e", "#0072B2"
DRAWN_RAD = math.radians(14.0)


def signs_drawing(writer: Writer) -> Drawing:
    """Draw three sketches with the positive sense of each angle."""
    words, side = writer.words, writer.heading_side
    thrust = writer.view.sense("thrust_angle")
    title = words("plot.signs_title", side=side)
    marks: list[Mark] = []
    for index, name in enumerate(("toe", "camber", "thrust")):
        x = WIDTH * (2 * index + 1) / 6
        marks.append(Text(x, 22, words(f"plot.signs_{name}", side=side), 14, "middle", bold=True))
        marks.append(Text(x, HEIGHT - 12, words(f"plot.signs_{name}_from"), 12, "middle",
                          colour=PALE))  # fmt: skip
    return Drawing(
        WIDTH, HEIGHT, title, [*marks, *_toe(words), *_camber(words), *_thrust(words, thrust)]
    )


def _tyre(x: float, y: float, angle_rad: float, half: tuple[float, float]) -> list[Mark]:
    """Draw a wheel rotated clockwise, and the straight line from which its angle is measured."""
    way = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    aside = np.array([way[1], -way[0]])
    middle = np.array([x, y])
    corners = [middle + a * half[0] * way + b * half[1] * aside
               for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))]  # fmt: skip
    reach = half[0] + 26.0
    arc = [middle + reach * np.array([math.sin(t), -math.cos(t)])
           for t in np.linspace(0.0, angle_rad, 9)]  # fmt: skip
    return [
        Path(corners, EDGE, 1.4, TYRE, closed=True),
        Path([middle, middle - (0, reach + 8)], PALE, 1.0, dash=(4.0, 3.0)),
        Path([middle, middle + (reach + 8) * way], INK, 1.2),
        Path(arc[:-1], ANGLE, 1.6),
        *arrow(arc[-2], arc[-1], ANGLE, 1.6),
    ]


def _toe(words: Translations) -> list[Mark]:
    x, y = WIDTH / 6, 145.0
    marks: list[Mark] = [Path([(x - 62, y), (x + 62, y)], EDGE, 2.0)]
    marks += _tyre(x - 62, y, DRAWN_RAD, (38.0, 11.0)) + _tyre(x + 62, y, -DRAWN_RAD, (38.0, 11.0))
    marks += [
        *arrow((x, y - 14), (x, y - 56), PALE, 1.2),
        Text(x, y - 62, words("scene.forward"), 11, "middle", colour=PALE),
        Text(x - 62, y + 58, words("vehicle.left"), 12, "middle"),
        Text(x + 62, y + 58, words("vehicle.right"), 12, "middle"),
    ]
    return marks


def _camber(words: Translations) -> list[Mark]:
    x, y = WIDTH / 2, 145.0
    marks: list[Mark] = [
        Path([(x - 110, y + 44), (x + 110, y + 44)], PALE, 1.4),
        Path([(x - 58, y), (x + 58, y)], EDGE, 2.0),
    ]
    marks += _tyre(x - 58, y, -DRAWN_RAD, (42.0, 12.0)) + _tyre(x + 58, y, DRAWN_RAD, (42.0, 12.0))
    marks += [
        Text(x - 58, y + 62, words("vehicle.left"), 12, "middle"),
        Text(x + 58, y + 62, words("vehicle.right"), 12, "middle"),
        Text(x, y - 40, words("scene.up"), 11, "middle", colour=PALE),
        *arrow((x, y - 8), (x, y - 34), PALE, 1.2),
    ]
    return marks


def _thrust(words: Translations, sense: float) -> list[Mark]:
    x, y, reach, drawn = WIDTH * 5 / 6, 190.0, 140.0, sense * DRAWN_RAD
    end = (x + reach * math.sin(drawn), y - reach * math.cos(drawn))
    arc = [(x + 105 * math.sin(t), y - 105 * math.cos(t)) for t in np.linspace(0, drawn, 9)]
    ends: tuple[Anchor, Anchor] = ("start", "end") if sense > 0.0 else ("end", "start")
    marks: list[Mark] = [
        Path([(x - 52, y), (x + 52, y)], EDGE, 2.0),
        Path([(x, y), (x, y - reach)], PALE, 1.0, dash=(4.0, 3.0)),
        *arrow((x, y), end, LINE, 1.6),
        Path(arc[:-1], ANGLE, 1.6),
        *arrow(arc[-2], arc[-1], ANGLE, 1.6),
        Text(x + sense * 24, y - 62, words("scene.thrust_line"), 12, ends[0], colour="#00528a"),
        Text(x - sense * 8, y - 90, words("plot.signs_axis"), 12, ends[1], colour=PALE),
    ]
    for side in (-52.0, 52.0):
        way = [(x + side, y + 24), (x + side, y - 24)]
        marks.append(Path(way, EDGE, 9.0))
    return marks
