"""A target to scale (SVG): its edges with their sizes, its centre, its axes, what is printed."""

from __future__ import annotations

from xml.sax.saxutils import escape

import numpy as np

from ...centre import marker_modules
from ...targets import PatternTarget, Target
from ...vectors import Array, turned

MARGIN_MM = 48.0  # about the plate, for sizes and the title
INK, SIZE, AXIS, PLATE, HOLE = "#333333", "#0072B2", "#D55E00", "#f2f2f2", "#ffffff"
THIN, LETTERS = 0.6, 7.0  # mm


def target_svg(name: str, target: Target) -> str:
    """SVG in millimetres, as the scanner sees the face: u to the right, v up."""
    half = np.array(target.edge.half_m) * 1e3
    low = -half - MARGIN_MM
    width, height = (2.0 * (half + MARGIN_MM)).tolist()
    title = f"{name}: {target.description}"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="{low[0]:g} {low[1]:g} {width:g} {height:g}" font-family="sans-serif" '
        f'font-size="{LETTERS:g}">',
        f"<title>{escape(title)}</title>",
        f'<rect x="{low[0]:g}" y="{low[1]:g}" width="{width:g}" height="{height:g}" fill="#fff"/>',
        _text(low[0] + 4, low[1] + 10, title, INK, "start"),
        *_plate(target, half),
        *(_printed(target) if isinstance(target, PatternTarget) else []),
        *_axes(half),
        *_sizes(target, half),
    ]
    return "\n".join([*parts, "</svg>\n"])


def _plate(target: Target, half: Array) -> list[str]:
    """The face and its holes."""
    line = f'stroke="{INK}" stroke-width="{2 * THIN:g}"'
    corners = target.edge.corners_m * 1e3
    a, b = half.tolist()
    if len(corners) == 0:
        parts = [f'<circle r="{a:g}" fill="{PLATE}" {line}/>']
    elif not np.array_equal(np.abs(corners), np.tile(half, (len(corners), 1))):
        points = " ".join(f"{u:g},{-v:g}" for u, v in corners)
        parts = [f'<polygon points="{points}" fill="{PLATE}" {line}/>']
    else:
        parts = [
            f'<rect x="{-a:g}" y="{-b:g}" width="{2 * a:g}" height="{2 * b:g}" '
            f'fill="{PLATE}" {line}/>'
        ]
    for u, v, radius in target.region.holes_m * 1e3:
        parts.append(f'<circle cx="{u:g}" cy="{-v:g}" r="{radius:g}" fill="{HOLE}" {line}/>')
    return parts


def _printed(target: PatternTarget) -> list[str]:
    """What is printed: circles, dark squares, or the modules of markers."""
    size = target.feature_size_m
    if target.kind == "circles":
        return [
            f'<circle cx="{u:.6g}" cy="{-v:.6g}" r="{size * 500:g}" fill="{INK}"/>'
            for u, v in target.places_m * 1e3
        ]
    turn = np.radians(target.turn_deg)
    if target.kind == "checkerboard":
        row, column = np.indices((target.rows + 1, target.columns + 1)).reshape(2, -1)
        dark = (row + column) % 2 == 0
        local = np.column_stack([column - target.columns / 2, target.rows / 2 - row])[dark]
        centres = np.array(target.offset) + turned(local * target.pitch, turn)
        return [_square(centre, size, turn) for centre in centres]
    assert target.dictionary is not None
    parts = []
    ids = next(iter(target.id_sets.values()))
    for place, marker in zip(target.places_m, ids, strict=True):
        dark = marker_modules(target.dictionary, marker)
        module = size / len(dark)
        row, column = np.nonzero(dark)
        local = np.column_stack([column, -row]) + np.array([0.5, -0.5]) * (1 - len(dark))
        centres = place + turned(local * module, turn)
        parts += [_square(centre, module, turn) for centre in centres]
    return parts


def _square(centre_m: Array, side_m: float, turn_rad: float) -> str:
    """A dark square, without a seam beside the next."""
    half = 0.5 * side_m * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
    corners = (centre_m + turned(half, turn_rad)) * np.array([1e3, -1e3])
    points = " ".join(f"{x:.6g},{y:.6g}" for x, y in corners)
    return f'<polygon points="{points}" fill="{INK}" shape-rendering="crispEdges"/>'


def _axes(half: Array) -> list[str]:
    """The centre and the axes u, v."""
    reach = 0.32 * float(half.min())
    tip = 3.0
    halo = 'stroke="#ffffff" stroke-width="2.4" stroke-opacity="0.8"'
    line = f'stroke="{AXIS}" stroke-width="{2 * THIN:g}"'
    parts = []
    for style in (halo, line):
        parts += [
            f'<path d="M0 0H{reach:g}m{-tip:g} {-tip / 2:g}l{tip:g} {tip / 2:g}l{-tip:g} '
            f'{tip / 2:g}" fill="none" {style}/>',
            f'<path d="M0 0V{-reach:g}m{-tip / 2:g} {tip:g}l{tip / 2:g} {-tip:g}l{tip / 2:g} '
            f'{tip:g}" fill="none" {style}/>',
            f'<circle r="3" fill="none" {style}/>',
        ]
    return [
        *parts,
        *_haloed(reach + 5, 2.5, "u"),
        *_haloed(0, -reach - 3, "v"),
    ]


def _sizes(target: Target, half: Array) -> list[str]:
    """Arrows with sizes beside the plate, and what else is told, below it."""
    a, b = half.tolist()
    round_one = not target.edge.shows_rotation
    sign = "⌀ " if round_one else ""
    parts = [*_arrow((-a, b + 12), (a, b + 12), f"{sign}{2 * a:g} mm")]
    if not round_one:
        parts += _arrow((-a - 12, b), (-a - 12, -b), f"{2 * b:g} mm")
    holes = target.region.holes_m * 1e3
    told = []
    if len(holes):
        told.append(f"{len(holes)} hole{'s' * (len(holes) > 1)} ⌀ {2 * holes[0, 2]:g} mm")
    if len(holes) > 1:
        told.append(f"{2 * abs(holes[0, 0]):g} mm apart")
    if isinstance(target, PatternTarget):
        told.append(f"{target.rows} x {target.columns} {_what(target)}")
        told.append(f"pitch {target.pitch * 1e3:g} mm")
        told.append(f"offset {target.offset[0] * 1e3:g}, {target.offset[1] * 1e3:g} mm")
    thickness = "not known" if target.thickness is None else f"{target.thickness * 1e3:g} mm"
    second = f"thickness {thickness}"
    parts.append(_text(0, b + 30, ", ".join(told), INK))
    parts.append(_text(0, b + 40, second, INK))
    return parts


def _what(target: PatternTarget) -> str:
    if target.kind == "checkerboard":
        return "inner corners"
    what = "circles" if target.kind == "circles" else "markers"
    return f"{what} of {target.feature_size_m * 1e3:g} mm"


def _arrow(start: tuple[float, float], end: tuple[float, float], label: str) -> list[str]:
    """A size between two places, mm, y down; upright ones carry their label on their left."""
    (x1, y1), (x2, y2) = start, end
    along = np.array([x2 - x1, y2 - y1]) / np.hypot(x2 - x1, y2 - y1)
    aside = np.array([-along[1], along[0]])
    tips = []
    for (x, y), way in ((start, 1.0), (end, -1.0)):
        for side in (1.2, -1.2):
            dx, dy = 3.5 * way * along + side * aside
            tips.append(f"M{x:g} {y:g}l{dx:.4g} {dy:.4g}")
    upright = abs(along[1]) > 0.5
    middle = ((x1 + x2) / 2 - (4 if upright else 0), (y1 + y2) / 2 + (0 if upright else 9))
    turn = f' transform="rotate(-90 {middle[0]:g} {middle[1]:g})"' if upright else ""
    return [
        f'<path d="M{x1:g} {y1:g}L{x2:g} {y2:g}{"".join(tips)}" fill="none" stroke="{SIZE}" '
        f'stroke-width="{THIN:g}"/>',
        _text(*middle, label, SIZE, extra=turn),
    ]


def _haloed(x: float, y: float, text: str) -> list[str]:
    """The name of an axis, to be read on dark print too."""
    halo = ' stroke="#ffffff" stroke-width="2"'
    return [_text(x, y, text, AXIS, extra=halo), _text(x, y, text, AXIS)]


def _text(
    x: float, y: float, text: str, colour: str, anchor: str = "middle", extra: str = ""
) -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}"{extra}>'
        f"{escape(text)}</text>"
    )
