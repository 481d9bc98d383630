"""PNG of a drawing, for papers and slides that take no SVG."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from ...cloud import load_opencv
from ...vectors import Array
from .drawing import CircleMark, Dots, Drawing, Mark, Path, Raster, Text

Pixels = npt.NDArray[np.uint8]
ZOOM = 2.0  # pixels of the image per unit of the drawing
SHIFT = 4  # fractional bits of OpenCV's fixed-point coordinates


def drawing_png(drawing: Drawing) -> bytes:
    """Return a PNG with ZOOM pixels per unit of the drawing."""
    cv2 = load_opencv()
    size = (round(drawing.height * ZOOM), round(drawing.width * ZOOM), 3)
    canvas = np.full(size, 255, np.uint8)
    for mark in drawing.marks:
        over = canvas if getattr(mark, "opacity", 1.0) == 1.0 else canvas.copy()
        _draw(over, mark)
        if over is not canvas:
            share = getattr(mark, "opacity", 1.0)
            canvas = np.asarray(cv2.addWeighted(over, share, canvas, 1.0 - share, 0.0), np.uint8)
    return bytes(cv2.imencode(".png", canvas)[1])


def _draw(canvas: Pixels, mark: Mark) -> None:
    if isinstance(mark, Path):
        _path(canvas, mark)
    elif isinstance(mark, CircleMark):
        _circle(canvas, mark)
    elif isinstance(mark, Text):
        _text(canvas, mark)
    elif isinstance(mark, Raster):
        _raster(canvas, mark)
    else:
        _dots(canvas, mark)


def _path(canvas: Pixels, mark: Path) -> None:
    cv2 = load_opencv()
    points = np.asarray(mark.points, float) * ZOOM
    fixed = np.rint(points * 2.0**SHIFT).astype(np.int32)
    if mark.fill != "none":
        edge = cv2.LINE_8 if mark.crisp else cv2.LINE_AA
        cv2.fillPoly(canvas, [fixed], _bgr(mark.fill), edge, SHIFT)
    if mark.stroke == "none":
        return
    width = max(1, round(mark.width * ZOOM))
    pieces = [fixed] if mark.dash is None else _dashes(points, mark.dash)
    closed = mark.closed and mark.dash is None
    cv2.polylines(canvas, pieces, closed, _bgr(mark.stroke), width, cv2.LINE_AA, SHIFT)


def _dashes(points: Array, dash: tuple[float, float]) -> list[npt.NDArray[np.int32]]:
    """Return the drawn pieces of a dashed line."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    starts = np.arange(0.0, way[-1], sum(dash) * ZOOM)
    ends = np.minimum(starts + dash[0] * ZOOM, way[-1])
    corners = [np.column_stack([np.interp(w, way, points[:, k]) for k in (0, 1)]) for w in
               (starts, ends)]  # fmt: skip
    pieces = np.stack(corners, axis=1) * 2.0**SHIFT
    return list(np.rint(pieces).astype(np.int32))


def _circle(canvas: Pixels, mark: CircleMark) -> None:
    width = max(1, round(mark.width * ZOOM))
    for colour, thickness in ((mark.fill, -1), (mark.stroke, width)):
        if colour != "none":
            _disc(canvas, (mark.x, mark.y), mark.radius, colour, thickness)


def _dots(canvas: Pixels, mark: Dots) -> None:
    for x, y in np.asarray(mark.points, float):
        _disc(canvas, (x, y), mark.size / 2.0, mark.colour, -1)


def _disc(
    canvas: Pixels, centre: tuple[float, float], radius: float, colour: str, thickness: int
) -> None:
    cv2 = load_opencv()
    x, y = np.rint(np.array(centre) * ZOOM * 2.0**SHIFT).astype(int).tolist()
    fixed = max(1, round(radius * ZOOM * 2.0**SHIFT))
    cv2.circle(canvas, (x, y), fixed, _bgr(colour), thickness, cv2.LINE_AA, SHIFT)


def _text(canvas: Pixels, mark: Text) -> None:
    """Draw text in OpenCV's own font, so that every machine gives the same image."""
    cv2 = load_opencv()
    font, size = cv2.FontFace("sans"), round(mark.size * ZOOM * 0.95)
    weight = 700 if mark.bold else 400
    _, _, width, _ = cv2.getTextSize((0, 0), mark.text, (0, 0), font, size, weight)
    back = {"start": 0.0, "middle": 0.5, "end": 1.0}[mark.anchor] * width
    if not mark.turn_deg:
        x, y = round(mark.x * ZOOM - back), round(mark.y * ZOOM)
        reach = math.ceil(mark.halo / 2.0 * ZOOM)
        for dx, dy in product((-reach, 0, reach), repeat=2) if reach else ():
            cv2.putText(canvas, mark.text, (x + dx, y + dy), (255, 255, 255), font, size, weight)
        cv2.putText(canvas, mark.text, (x, y), _bgr(mark.colour), font, size, weight)
        return
    flat = np.full((3 * size, width + 8, 3), 255, np.uint8)
    cv2.putText(flat, mark.text, (4, 2 * size), _bgr(mark.colour), font, size, weight)
    _lay(canvas, flat, (4.0 + back, 2.0 * size), (mark.x, mark.y), 1.0, mark.turn_deg)


def _raster(canvas: Pixels, mark: Raster) -> None:
    image = np.ascontiguousarray(mark.palette[mark.pixels][:, :, ::-1])
    middle = (image.shape[1] / 2.0 - 0.5, image.shape[0] / 2.0 - 0.5)
    scale = mark.width * ZOOM / image.shape[1]
    _lay(canvas, image, middle, (mark.x, mark.y), scale, mark.turn_deg)


def _lay(
    canvas: Pixels,
    image: Pixels,
    pivot: tuple[float, float],
    position: tuple[float, float],
    scale: float,
    turn_deg: float,
) -> None:
    """Rotate `image` clockwise about its pivot, move the pivot to `position`; darker pixels win."""
    cv2 = load_opencv()
    M = cv2.getRotationMatrix2D(pivot, -turn_deg, scale)
    M[:, 2] += np.array(position) * ZOOM - pivot
    size = (canvas.shape[1], canvas.shape[0])
    white = (255, 255, 255)
    flags = cv2.INTER_NEAREST if scale > 1.0 else cv2.INTER_LINEAR
    laid = cv2.warpAffine(
        image, M, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=white
    )
    np.minimum(canvas, laid, out=canvas)


def _bgr(colour: str) -> tuple[int, int, int]:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return blue, green, red
