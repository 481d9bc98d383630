"""Vehicle from above and axles from behind, with exaggerated angles."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...measurement import Measurement, Stated, by_kind, stated
from ...vectors import Array
from ..format.language import Translations
from ..format.view import Sort, View
from ..format.writer import NONE
from .drawing import GRID, INK, PALE, Anchor, Drawing, Mark, Path, Text, arrow

WIDTH, HEIGHT, SPLIT = 760.0, 470.0, 430.0
TOP, BOTTOM, ASIDE = 80.0, 60.0, 128.0
FACTORS = (200, 100, 50, 20, 10, 5, 2, 1)
MOST_DEG = 14.0  # the largest angle is drawn at no more
TYRE_M = (0.62, 0.2)  # length and width drawn
TYRE, EDGE, THRUST, CENTRE = "#dfe5ea", "#37474f", "#b3261e", "#0072B2"
WHEELS = ("RR", "RL", "FR", "FL")
KINDS: tuple[Sort, ...] = ("toe", "camber")
Known = Mapping[tuple[str, str], Stated]
Texts = Mapping[tuple[str, Sort], str]


def top_drawing(measurement: Measurement, words: Translations, view: View) -> Drawing:
    """Draw the wheels in position, with their toe from above and their camber from behind.

    Provisional angles are drawn without their values.
    """
    known = by_kind(stated(measurement), view.axis)
    texts: Texts = {
        (wheel, kind): NONE
        if wheel in measurement.provisional
        else words.number(view.angle(found.value, kind, found.expanded))
        for wheel in WHEELS
        for kind in KINDS
        for found in [known[wheel, kind]]
    }
    title = words("plot.top_title")
    marks: list[Mark] = [
        Text(12, 22, title, 15, bold=True),
        *_from_above(measurement, known, texts, words, view),
        *_from_behind(known, texts, words),
    ]
    return Drawing(WIDTH, HEIGHT, title, marks)


def factor(angles_rad: list[float]) -> int:
    """Return the round factor by which to exaggerate."""
    largest = math.degrees(max(map(abs, angles_rad)))
    return next((k for k in FACTORS if k * largest <= MOST_DEG), 1)


def _from_above(
    measurement: Measurement, known: Known, texts: Texts, words: Translations, view: View
) -> list[Mark]:
    frame = measurement.frame
    positions = {w.observation.name: frame.to_vehicle(w.observation.fitted.centre_m) for w in
              measurement.wheels[:4]}  # fmt: skip
    toes = {wheel: known[wheel, "toe"].value for wheel in WHEELS}
    thrust = known.get(("vehicle", "thrust_angle"))
    k = factor([*toes.values(), thrust.value if thrust else 0.0])
    wide = max(abs(position[0]) for position in positions.values())
    scale = min(
        (HEIGHT - TOP - BOTTOM) / (frame.wheelbase_m + TYRE_M[0]),
        (SPLIT - 2 * ASIDE) / (2.0 * wide),
    )
    rear = np.array([SPLIT / 2.0, HEIGHT - BOTTOM - scale * TYRE_M[0] / 2.0])

    def at(left_m: float, forward_m: float) -> Array:
        return np.asarray(rear + scale * np.array([-left_m, -forward_m]))

    marks: list[Mark] = [
        Text(12, 42, words("plot.top_above", factor=str(k)), 12, colour=PALE),
        *arrow((SPLIT / 2, TOP - 6), (SPLIT / 2, TOP - 26), PALE, 1.4),
        Text(SPLIT / 2 + 8, TOP - 14, words("scene.forward"), 11, colour=PALE),
    ]
    for one, other in (("RR", "RL"), ("FR", "FL")):
        marks.append(Path([at(*positions[w][:2]) for w in (one, other)], EDGE, 2.0))
    over = frame.wheelbase_m + 0.2
    marks.append(Path([at(0, -0.2), at(0, over)], CENTRE, 1.2, dash=(6.0, 4.0)))
    if thrust is not None:
        angle = k * thrust.value
        end = at(-over * math.sin(angle), over * math.cos(angle))
        marks.append(Path([at(0, 0), end], THRUST, 1.6))
    for wheel in WHEELS:
        left, forward, _ = positions[wheel]
        marks += _tyre(at(left, forward), scale, k * toes[wheel] * _inwards(wheel))
        marks += _label(wheel, at(left, forward), texts[wheel, "toe"], words)
    y = HEIGHT - 30
    marks += [Path([(12, y), (36, y)], CENTRE, 1.2, dash=(6.0, 4.0))]
    marks.append(Text(42, y + 4, words.known("axis", view.axis), 12))
    if thrust is not None:
        value = words.number(
            view.angle(view.sense("thrust_angle") * thrust.value, "heading", thrust.expanded)
        )
        marks += [Path([(12, y + 18), (36, y + 18)], THRUST, 1.6)]
        marks.append(Text(42, y + 22, f"{words('scene.thrust_line')}: {value}", 12))
    return marks


def _inwards(wheel: str) -> float:
    """Return +1 where toe-in is clockwise from above, front upwards; else -1."""
    return 1.0 if wheel.endswith("L") else -1.0


def _tyre(middle: Array, scale: float, angle_rad: float) -> list[Mark]:
    """Draw a wheel from above, rotated clockwise, with the straight-ahead line."""
    length, width = scale * TYRE_M[0], scale * TYRE_M[1]
    straight = [middle + np.array([0.0, way * 0.62 * length]) for way in (-1.0, 1.0)]
    way = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    aside = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    corners = [
        middle + a * way * length / 2.0 + b * aside * width / 2.0
        for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    axis = [middle - 0.62 * length * way, middle + 0.62 * length * way]
    return [
        Path(corners, EDGE, 1.4, TYRE, closed=True),
        Path(straight, GRID, 1.2),
        Path(axis, EDGE, 1.2, dash=(8.0, 3.0)),
    ]


def _label(wheel: str, middle: Array, toe: str, words: Translations) -> list[Mark]:
    side: Anchor = "end" if wheel.endswith("L") else "start"
    x = middle[0] + (-24.0 if side == "end" else 24.0)
    return [
        Text(x, middle[1] - 6, words.wheel(wheel), 14, side, bold=True),
        Text(x, middle[1] + 11, toe, 12, side),
    ]


def _from_behind(known: Known, texts: Texts, words: Translations) -> list[Mark]:
    """Draw both axles from behind, the left wheel on the left."""
    tilts = {wheel: known[wheel, "camber"].value for wheel in WHEELS}
    k = factor([*tilts.values()])
    marks: list[Mark] = [Text(SPLIT + 12, 42, words("plot.top_behind", factor=str(k)), 12,
                              colour=PALE)]  # fmt: skip
    middle = (SPLIT + WIDTH) / 2.0
    for axle, y in (("front", 170.0), ("rear", 370.0)):
        left, right = axle[0].upper() + "L", axle[0].upper() + "R"
        marks.append(Text(middle, y - 78, words(f"vehicle.{axle}_axle"), 13, "middle", bold=True))
        marks.append(Path([(middle - 120, y + 56), (middle + 120, y + 56)], PALE, 1.4))
        marks.append(Path([(middle - 84, y), (middle + 84, y)], EDGE, 2.0))
        for wheel, x, side in ((left, middle - 84, -1.0), (right, middle + 84, 1.0)):
            marks += _upright(np.array([x, y]), side * k * tilts[wheel])
            marks.append(Text(x, y + 74, words.wheel(wheel), 14, "middle", bold=True))
            marks.append(Text(x, y + 90, texts[wheel, "camber"], 12, "middle"))
    return marks


def _upright(middle: Array, angle_rad: float) -> list[Mark]:
    """Draw a wheel from behind, tilted clockwise."""
    way = np.array([math.sin(angle_rad), -math.cos(angle_rad)])
    aside = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    corners = [
        middle + a * 52.0 * way + b * 14.0 * aside for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    return [
        Path(corners, EDGE, 1.4, TYRE, closed=True),
        Path([middle + np.array([0.0, y]) for y in (-64.0, 56.0)], GRID, 1.2),
        Path([middle - 62 * way, middle + 62 * way], INK, 1.2, dash=(8.0, 3.0)),
    ]
