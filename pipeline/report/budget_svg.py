"""The budget of uncertainty as stacked bars (SVG): a bar for each angle and length."""

from __future__ import annotations

import math
from xml.sax.saxutils import escape

from pipeline.measurement import Measurement
from pipeline.quantities import Stated, against, stated
from pipeline.vehicle import Axis

# Okabe and Ito's colours, which the colour-blind tell apart; in the order of first use.
COLOURS = {
    "plane noise": "#0072B2",
    "correlated noise": "#56B4E9",
    "flatness": "#009E73",
    "clamp": "#F0E442",
    "centre noise": "#D55E00",
    "centre model": "#E69F00",
    "range bias": "#CC79A7",
    "pointing": "#999999",
    "registration": "#555555",
    "point noise": "#0072B2",
    "unexplained scatter": "#56B4E9",
    "range noise": "#009E73",
    "angle noise": "#F0E442",
    "aiming": "#D55E00",
}
LABEL, BAR, VALUE, ROW, HEAD = 165, 480, 190, 24, 58  # pixels


def budget_svg(measurement: Measurement, axis: Axis = "rear-axle") -> str:
    """SVG of all quantities against an axis, without ISO camber; same measurement, same bytes."""
    found = [q for q in against(stated(measurement), axis) if q.kind != "camber_iso"]
    causes = measurement.uncertainty.causes
    legend_rows = math.ceil(len(causes) / 4)
    top = HEAD + 20 * legend_rows + 22
    width, height = LABEL + BAR + VALUE, top + ROW * len(found) + 34
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="sans-serif" font-size="13">',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        _text(12, 22, "Budget of uncertainty: share of the variance by cause", weight="bold"),
        _text(12, 41, f"hatched: what arrives through the four centres; axis: {axis}"),
        HATCH,
        *_legend(causes),
    ]
    for index, quantity in enumerate(found):
        parts += _bar(quantity, causes, top + ROW * index)
    foot = top + ROW * len(found)
    for percent in (0, 25, 50, 75, 100):
        x = LABEL + BAR * percent / 100
        parts.append(
            f'<line x1="{x}" y1="{top - 4}" x2="{x}" y2="{foot}" stroke="#000000" '
            'stroke-opacity="0.2"/>'
        )
        parts.append(_text(x, foot + 18, f"{percent} %", anchor="middle"))
    parts.append(_text(LABEL + BAR + 12, top - 12, "u; U at 95 %"))
    return "\n".join([*parts, "</svg>\n"])


HATCH = (
    '<defs><pattern id="frame" width="6" height="6" patternUnits="userSpaceOnUse" '
    'patternTransform="rotate(45)"><line x1="0" y1="0" x2="0" y2="6" stroke="#000000" '
    'stroke-opacity="0.55" stroke-width="1.6"/></pattern></defs>'
)


def _legend(causes: tuple[str, ...]) -> list[str]:
    parts = []
    for index, cause in enumerate(causes):
        x, y = 12 + 195 * (index % 4), HEAD + 20 * (index // 4)
        parts.append(_rectangle(x, y - 10, 12, 12, _colour(cause)))
        parts.append(_text(x + 18, y, cause))
    return parts


def _bar(quantity: Stated, causes: tuple[str, ...], y: float) -> list[str]:
    of = "" if quantity.subject == "vehicle" else f"{quantity.subject} "
    label = of + quantity.kind.replace("_", " ")
    parts = [_text(LABEL - 8, y + 15, label, anchor="end")]
    x = float(LABEL)
    for cause, share in zip(causes, quantity.shares, strict=True):
        parts.append(_rectangle(x, y + 3, BAR * float(share), ROW - 8, _colour(cause)))
        x += BAR * float(share)
    framed = BAR * quantity.through_frame
    parts.append(_rectangle(LABEL + BAR - framed, y + ROW - 9, framed, 4, "url(#frame)"))
    u, expanded = (_size(value, quantity.unit) for value in (quantity.u, quantity.expanded))
    parts.append(_text(LABEL + BAR + 12, y + 15, f"{u}; {expanded}"))
    return parts


def _colour(cause: str) -> str:
    return COLOURS.get(cause, "#222222")


def _size(value: float, unit: str) -> str:
    return f"{value * 1e3:.3f} mm" if unit == "m" else f"{math.degrees(value) * 3600:.1f}″"


def _rectangle(x: float, y: float, width: float, height: float, fill: str) -> str:
    return (
        f'<rect x="{x:.2f}" y="{y:.2f}" width="{max(width, 0.0):.2f}" height="{height:.2f}" '
        f'fill="{fill}"/>'
    )


def _text(x: float, y: float, text: str, anchor: str = "start", weight: str = "normal") -> str:
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" font-weight="{weight}">'
        f"{escape(text)}</text>"
    )
