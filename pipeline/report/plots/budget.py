"""Uncertainty budget as stacked bars: a bar for each angle and length."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...measurement import Measurement, Stated, against, stated
from ...vehicle import REFERENCE_WHEELS, Axis
from ..format.digits import size
from ..format.language import Translations
from .drawing import GRID, PALE, Drawing, Mark, Path, Text, cut, rectangle

# Okabe and Ito's palette for the colour-blind, in the order of first use.
COLOURS = {
    "plane noise": "#0072B2",
    "correlated noise": "#56B4E9",
    "surface noise": "#0072B2",
    "surface form": "#56B4E9",
    "tyre run-out": "#009E73",
    "flatness": "#009E73",
    "rounding": "#882255",
    "thinning": "#44AA99",
    "stations": "#888855",
    "brightness": "#AA4499",
    "clamp": "#F0E442",
    "stand-off": "#F0E442",
    "centre noise": "#D55E00",
    "centre model": "#E69F00",
    "range bias": "#CC79A7",
    "incidence": "#117733",
    "range scale": "#661100",
    "axes": "#332288",
    "pointing": "#999999",
    "registration": "#555555",
    "point noise": "#0072B2",
    "unexplained scatter": "#56B4E9",
    "range noise": "#009E73",
    "angle noise": "#F0E442",
    "aiming": "#D55E00",
}
OTHER = "#222222"
LABEL, BAR, VALUE, ROW, HEAD = 204.0, 404.0, 164.0, 24.0, 62.0  # pixels
LEGEND, SWATCH, CHARACTER = 186.0, 18.0, 5.8  # least width of a column; before and of its text


def budget_drawing(
    measurement: Measurement, words: Translations, axis: Axis = "rear-axle"
) -> Drawing:
    """Draw all quantities relative to an axis, without ISO camber."""
    found = [q for q in against(stated(measurement), axis) if q.kind != "camber_iso"]
    return bars_drawing(
        found, measurement.uncertainty.components, words, words("plot.budget_title")
    )


def vehicle_budget(measurement: Measurement, words: Translations, axis: Axis) -> Drawing:
    """Draw the quantities of the reference wheels and the vehicle alone."""
    found = [q for q in against(stated(measurement), axis) if q.kind != "camber_iso"]
    found = [q for q in found if q.subject in (*REFERENCE_WHEELS, "vehicle")]
    return bars_drawing(
        found, measurement.uncertainty.components, words, words("plot.budget_title")
    )


def wheel_budget(
    angles: Sequence[Stated], components: tuple[str, ...], words: Translations
) -> Drawing:
    """Draw toe and camber of one wheel."""
    title = words("plot.budget_of", name=cut(words.wheel(angles[0].subject), 40))
    return bars_drawing(angles, components, words, title, alone=True)


def bars_drawing(
    found: Sequence[Stated],
    components: tuple[str, ...],
    words: Translations,
    title: str,
    alone: bool = False,
) -> Drawing:
    """Draw one bar per quantity; alone: all are of one wheel, which the title names."""
    legend, legend_rows = _legend(components, words)
    top = HEAD + 20 * legend_rows + 14
    foot = top + ROW * len(found)
    marks: list[Mark] = [
        Text(12, 22, title, 15, bold=True),
        Text(12, 42, words("plot.budget_note"), 12, colour=PALE),
        *legend,
    ]
    for percent in (0, 25, 50, 75, 100):
        x = LABEL + BAR * percent / 100
        marks.append(Path([(x, top - 4), (x, foot)], GRID))
        marks.append(Text(x, foot + 17, f"{percent} %", 12, "middle"))
    for index, quantity in enumerate(found):
        marks += _bar(quantity, components, top + ROW * index, words, alone)
    marks.append(Text(LABEL + BAR + 12, top - 8, "u;  U (95 %)", 12, colour=PALE))
    return Drawing(LABEL + BAR + VALUE, foot + 30, title, marks)


def _legend(components: tuple[str, ...], words: Translations) -> tuple[list[Mark], int]:
    """Draw the legend in columns as wide as its longest text, and return its number of rows."""
    texts = [words.known("cause", component) for component in components]
    wide = max(LEGEND, SWATCH + CHARACTER * (max(map(len, texts), default=0) + 2))
    columns = int((LABEL + BAR + VALUE - 12) // wide)
    marks: list[Mark] = []
    for index, (component, text) in enumerate(zip(components, texts, strict=True)):
        x, y = 12 + wide * (index % columns), HEAD + 20 * (index // columns)
        marks.append(rectangle(x, y - 10, 12, 12, COLOURS.get(component, OTHER)))
        marks.append(Text(x + SWATCH, y, text, 12))
    return marks, math.ceil(len(components) / columns)


def _bar(
    quantity: Stated, components: tuple[str, ...], y: float, words: Translations, alone: bool
) -> list[Mark]:
    of = (
        ""
        if alone or quantity.subject == "vehicle"
        else f"{cut(words.wheel(quantity.subject), 14)}  "
    )
    label = of + words.known("quantity", quantity.kind)
    marks: list[Mark] = [Text(LABEL - 8, y + 15, label, 12, "end")]
    x = LABEL
    for component, share in zip(components, quantity.contributions.tolist(), strict=True):
        if share > 0.0:
            marks.append(rectangle(x, y + 3, BAR * share, ROW - 8, COLOURS.get(component, OTHER)))
        x += BAR * share
    framed = LABEL + BAR * (1.0 - quantity.through_frame)
    if framed < x:
        marks.append(Path([(framed, y + ROW - 6), (x, y + ROW - 6)], "#ffffff", 4.0))
        marks.append(Path([(framed, y + ROW - 6), (x, y + ROW - 6)], "#000000", 2.5, dash=(3, 3)))
    sizes = (size(value, quantity.unit) for value in (quantity.u, quantity.expanded))
    marks.append(Text(LABEL + BAR + 12, y + 15, words.number(";  ".join(sizes)), 12))
    return marks
