"""A target drawn to scale, in millimetres: edges with their sizes, print, centre and axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...centre import marker_modules
from ...targets import PatternTarget, Target
from ...vectors import Array, turned
from .drawing import CircleMark, Drawing, Mark, Path, Text

MARGIN_MM = 48.0  # around the target, for its sizes and the title
INK, SIZE, AXIS, FACE, HOLE = "#333333", "#0072B2", "#D55E00", "#f2f2f2", "#ffffff"
THIN, THICK, LETTERS = 0.6, 1.2, 7.0  # mm
Point = tuple[float, float]
ToPage = Callable[[float, float], Point]  # from u, v to the drawing


def target_svg(name: str, target: Target) -> str:
    """Return the drawing as SVG; same target, same bytes."""
    return target_drawing(name, target).svg


def target_drawing(name: str, target: Target) -> Drawing:
    """Draw a target as the scanner sees it: u to the right, v up."""
    half = np.array(target.edge.half_m) * 1e3
    x, y = (half + MARGIN_MM).tolist()
    title = f"{name}: {target.description}"

    def at(u: float, v: float) -> Point:
        return x + u, y - v

    marks: list[Mark] = [
        Text(4.0, 10.0, title, LETTERS, colour=INK),
        *_face(target, half, at),
        *(_print(target, at) if isinstance(target, PatternTarget) else ()),
        *_axes(half, at),
        *_sizes(target, half, at),
    ]
    return Drawing(2.0 * x, 2.0 * y, title, marks, "mm")


def _face(target: Target, half: Array, at: ToPage) -> Iterator[Mark]:
    """Draw the outer edge and the holes."""
    corners = target.edge.corners_m * 1e3
    if len(corners) == 0:
        yield CircleMark(*at(0.0, 0.0), float(half[0]), FACE, INK, THICK)
    else:
        yield Path([at(u, v) for u, v in corners.tolist()], INK, THICK, FACE, closed=True)
    for u, v, radius in (target.region.holes_m * 1e3).tolist():
        yield CircleMark(*at(u, v), radius, HOLE, INK, THICK)


def _print(target: PatternTarget, at: ToPage) -> Iterator[Mark]:
    """Draw circles, dark squares of a checkerboard, or dark modules of markers."""
    size, angle = target.feature_size_m, np.radians(target.turn_deg)
    if target.kind == "circles":
        for u, v in (target.places_m * 1e3).tolist():
            yield CircleMark(*at(u, v), size * 500.0, INK)
    elif target.kind == "checkerboard":
        row, column = np.indices((target.rows + 1, target.columns + 1)).reshape(2, -1)
        dark = (row + column) % 2 == 0
        local = np.column_stack([column - target.columns / 2, target.rows / 2 - row])[dark]
        yield from _squares(np.array(target.offset), local * target.pitch, size, angle, at)
    else:
        assert target.dictionary is not None
        ids = next(iter(target.id_sets.values()))
        for centre, marker in zip(target.places_m, ids, strict=True):
            dark = marker_modules(target.dictionary, marker)
            row, column = np.nonzero(dark)
            local = np.column_stack([column, -row]) + np.array([0.5, -0.5]) * (1 - len(dark))
            side = size / len(dark)
            yield from _squares(centre, local * side, side, angle, at)


def _squares(
    origin_m: Array, local_m: Array, side_m: float, angle_rad: float, at: ToPage
) -> Iterator[Mark]:
    """Draw dark squares centred at local_m (N, 2), rotated about the origin."""
    half = 0.5 * side_m * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
    for centre in local_m:
        corners_m = origin_m + turned(centre + half, angle_rad)
        yield Path([at(*corner) for corner in corners_m * 1e3], fill=INK, closed=True, crisp=True)


def _axes(half: Array, at: ToPage) -> Iterator[Mark]:
    """Draw the centre and the axes u and v, with white halos for dark prints."""
    reach = 0.32 * float(half.min())
    ends = (reach, 0.0), (0.0, reach)
    for colour, width, opacity in (("#ffffff", 2.4, 0.8), (AXIS, THICK, 1.0)):
        for line in (line for end in ends for line in _arrow(end, 3.0, 1.5)):
            yield Path([at(*point) for point in line], colour, width, opacity=opacity)
        yield CircleMark(*at(0.0, 0.0), 3.0, stroke=colour, width=width, opacity=opacity)
    for name, position in (("u", at(reach + 5.0, -2.5)), ("v", at(0.0, reach + 3.0))):
        yield Text(*position, name, LETTERS, "middle", colour=AXIS, halo=2.0)


def _arrow(end: Point, length: float, half_width: float) -> list[Array]:
    """Return shaft and open head (length, half width) of an arrow from the origin along an axis."""
    tip = np.array(end)
    back, aside = -length * np.sign(tip), half_width * np.sign(tip[::-1])
    return [np.array([(0.0, 0.0), tip]), tip + np.array([back + aside, (0.0, 0.0), back - aside])]


def _sizes(target: Target, half: Array, at: ToPage) -> Iterator[Mark]:
    """Draw dimension lines beside the target, and state the remaining sizes below it."""
    a, b = half.tolist()
    is_round = not target.edge.shows_rotation
    yield from _dimension((0.0, -b - 12.0), (a, 0.0), at)
    yield _text(at(0.0, -b - 21.0), f"{'⌀ ' if is_round else ''}{2 * a:g} mm", SIZE)
    if not is_round:
        yield from _dimension((-a - 12.0, 0.0), (0.0, b), at)
        yield _text(at(-a - 16.0, 0.0), f"{2 * b:g} mm", SIZE, turn_deg=-90.0)
    edge, size = "chamfer", target.chamfer
    if target.edge_radius is not None:
        edge, size = "edge radius", target.edge_radius
    thickness, extent = (
        "not stated" if value is None else f"{value * 1e3:g} mm"
        for value in (target.thickness, size)
    )
    yield _text(at(0.0, -b - 30.0), ", ".join(_details(target)), INK)
    yield _text(at(0.0, -b - 40.0), f"thickness {thickness}, {edge} {extent}", INK)


def _dimension(middle: Point, half: Point, at: ToPage) -> Iterator[Mark]:
    """Draw a line from middle - half to middle + half (u, v) with open arrowheads."""
    for end in (half, (-half[0], -half[1])):
        for line in _arrow(end, 3.5, 1.2):
            yield Path([at(*point) for point in line + middle], SIZE, THIN)


def _details(target: Target) -> Iterator[str]:
    """Return the sizes of holes and print."""
    holes = target.region.holes_m * 1e3
    if len(holes):
        yield f"{len(holes)} hole{'s' * (len(holes) > 1)} ⌀ {2 * holes[0, 2]:g} mm"
    if len(holes) > 1:
        yield f"{2 * abs(holes[0, 0]):g} mm apart"
    if isinstance(target, PatternTarget):
        feature = {"checkerboard": "inner corners", "circles": "circles", "aruco": "markers"}
        size = f" of {target.feature_size_m * 1e3:g} mm" if target.kind != "checkerboard" else ""
        yield f"{target.rows} x {target.columns} {feature[target.kind]}{size}"
        yield f"pitch {target.pitch * 1e3:g} mm"
        yield f"offset {target.offset[0] * 1e3:g}, {target.offset[1] * 1e3:g} mm"


def _text(position: Point, text: str, colour: str, turn_deg: float = 0.0) -> Text:
    return Text(*position, text, LETTERS, "middle", colour=colour, turn_deg=turn_deg)
