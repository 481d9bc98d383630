"""Residual map of a target: residuals in colour, with the fitted outline and centre."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ...measurement import CELLS, ResidualMap, WheelResult
from ...plane import PlaneFit
from ...vectors import Array, turned
from ...vehicle import VehicleFrame
from ..format.language import Translations
from .drawing import (
    GRID,
    MINUS,
    PALE,
    Drawing,
    Mark,
    Path,
    Raster,
    Text,
    arrow,
    cut,
)
from .drawing_png import drawing_png

FULL_SIGMAS = 3.0
SHADES = 16  # from white to either full colour
WHITE, BEHIND = 2 * SHADES + 1, 2 * SHADES + 2  # indices into the palette
COARSER = (1, 2, 3, 4, 6, 8, 12)  # cells per pixel
MOST_CELLS = 40 * CELLS**2  # in all pictures of a report together
SIDE, HEAD, FOOT, LEFT = 300.0, 44.0, 54.0, 30.0
OUTLINE, BAR, BAR_HEIGHT = "#006400", 165.0, 15.0


def face_png(result: WheelResult, frame: VehicleFrame, words: Translations) -> bytes | None:
    """Return the PNG of one wheel's target, or None where no scan was fitted."""
    drawing = face_drawing(result, frame, words)
    return None if drawing is None else drawing_png(drawing)


def face_drawing(
    result: WheelResult, frame: VehicleFrame, words: Translations, coarser: int = 1
) -> Drawing | None:
    """Draw the target as the scanner sees it, up upwards; None where no scan was fitted.

    coarser: cells of the map per pixel, along either side.
    """
    evidence = result.observation.evidence
    if evidence is None or evidence.face is None or evidence.plane is None:
        return None
    face, plane = evidence.face, evidence.plane
    rotation = to_upright(plane.basis, frame.up)
    title = words("plot.face_title", name=cut(words.wheel(result.observation.name), 18))
    marks: list[Mark] = [
        *face_marks(face, plane.sigma_m, rotation, words, coarser),
        Text(LEFT, 20, title, 15, bold=True),
        *_directions(plane, frame, rotation, words),
    ]
    return Drawing(SIDE + 2 * LEFT, HEAD + SIDE + FOOT, title, marks)


def face_marks(
    face: ResidualMap, sigma_m: float, rotation: float, words: Translations, coarser: int = 1
) -> list[Mark]:
    """Draw the map, rotated by `rotation` from u towards v, its outline, a scale bar, the colours.

    sigma_m: noise across the plane; three times as much has the full colour.
    """
    middle = (LEFT + SIDE / 2.0, HEAD + SIDE / 2.0)
    pixels = _pixels(face, FULL_SIGMAS * sigma_m, coarser)
    return [
        Raster(*middle, SIDE, pixels, _palette(), -math.degrees(rotation)),
        *_outline(face, rotation, middle),
        *_scale(face, words),
        *_legend(FULL_SIGMAS * sigma_m, words),
    ]


def coarseness(pictures: int) -> int:
    """Return the cells per pixel, along either side, that keep so many pictures small together."""
    return next((k for k in COARSER if pictures * (CELLS / k) ** 2 <= MOST_CELLS), COARSER[-1])


def to_upright(basis: Array, up: Array) -> float:
    """Return the rotation of a map along basis (3, 3), from u towards v, that brings `up` up."""
    along, across = basis[:2] @ up
    return math.pi / 2.0 - math.atan2(across, along)


def _pixels(face: ResidualMap, full_m: float, coarser: int) -> npt.NDArray[np.uint8]:
    """Return indices into the palette: from blue (behind the plane) over white to red (in front).

    Coarser than asked for where the target has fewer points than the map has cells on it.
    """
    known = ~np.isnan(face.residual_m)
    on_face = face.region.area_m2 * (CELLS / (2.0 * face.half_width_m)) ** 2
    enough = (k for k in COARSER if face.counts.sum() * k * k >= on_face)
    k = max(coarser, next(enough, COARSER[-1]))
    count, behind = _blocks(known, k), _blocks(face.behind, k)
    mean = _blocks(np.where(known, face.residual_m, 0.0), k) / np.maximum(count, 1)
    shade = np.rint(np.clip(mean / max(full_m, 1e-9), -1.0, 1.0) * SHADES) + SHADES
    pixels = np.where(count > 0, shade, np.where(behind > 0, BEHIND, WHITE)).astype(np.uint8)
    row, column = np.indices(pixels.shape) - (len(pixels) - 1) / 2.0
    pixels[np.hypot(row, column) > len(pixels) / 2.0] = WHITE
    return pixels


def _blocks(cells: npt.NDArray[Any], k: int) -> Array:
    """Return the sums over blocks of k by k cells."""
    n = CELLS // k
    return np.asarray(cells.reshape(n, k, n, k).sum(axis=(1, 3), dtype=np.float64))


def _palette() -> npt.NDArray[np.uint8]:
    """Return the palette (2 SHADES + 3, 3) of RGB."""
    share = np.linspace(-1.0, 1.0, 2 * SHADES + 1)
    red = np.where(share > 0, 1.0, 1.0 + share)
    blue = np.where(share < 0, 1.0, 1.0 - share)
    colours = np.column_stack([red, 1.0 - np.abs(share), blue]) * 255.0
    return np.vstack([colours, [[255.0] * 3, [205.0] * 3]]).astype(np.uint8)


def _outline(face: ResidualMap, rotation: float, middle: tuple[float, float]) -> list[Mark]:
    """Draw the edges in their nominal size around the fitted centre, and a cross at the centre."""
    scale = SIDE / (2.0 * face.half_width_m)
    flip = np.array([scale, -scale])
    edges = [middle + turned(edge, rotation) * flip for edge in face.edges_m]
    marks: list[Mark] = [Path(edge, OUTLINE, 1.6, closed=True) for edge in edges]
    x, y = middle
    for dx, dy in ((9.0, 0.0), (0.0, 9.0)):
        ends = [(x - dx, y - dy), (x + dx, y + dy)]
        marks += [Path(ends, "#ffffff", 3.5), Path(ends, "#000000", 1.6)]
    return marks


def _directions(
    plane: PlaneFit, frame: VehicleFrame, rotation: float, words: Translations
) -> list[Mark]:
    """Draw arrows towards the vehicle's up and front."""
    ahead: Array = turned((plane.basis[:2] @ frame.forward)[None], rotation)[0]
    x, y = (LEFT + SIDE - 4, HEAD + 24) if ahead[0] < 0 else (LEFT + 4, HEAD + 24)
    way = -1.0 if ahead[0] < 0 else 1.0
    side = "end" if way < 0 else "start"
    return [
        *arrow((x, y), (x, y - 26), PALE, 1.2),
        *arrow((x, y), (x + way * 26, y), PALE, 1.2),
        Text(x + way * 5, y - 18, words("scene.up"), 11, side, colour=PALE),  # type: ignore[arg-type]
        Text(x + way * 30, y + 4, words("scene.forward"), 11, side, colour=PALE),  # type: ignore[arg-type]
    ]


def _scale(face: ResidualMap, words: Translations) -> list[Mark]:
    """Draw a scale bar."""
    length_m = next(x for x in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.0) if x < face.half_width_m)
    pixels = SIDE * length_m / (2.0 * face.half_width_m)
    y = HEAD + SIDE + 14
    line = [(LEFT, y - 4), (LEFT, y), (LEFT + pixels, y), (LEFT + pixels, y - 4)]
    text = f"{length_m * 1e3:g} mm"
    return [Path(line, PALE, 1.2), Text(LEFT + pixels / 2, y + 15, text, 11, "middle", colour=PALE)]


def _legend(full_m: float, words: Translations) -> list[Mark]:
    """Draw the colour scale with its values."""
    x, y = LEFT + SIDE - BAR, HEAD + SIDE + 8
    shades = np.tile(np.arange(WHITE, dtype=np.uint8), (3, 1))
    bar = Raster(x + BAR / 2, y + BAR_HEIGHT / 2, BAR, shades, _palette())
    marks: list[Mark] = [bar]
    corners = [(x, y), (x + BAR, y), (x + BAR, y + BAR_HEIGHT), (x, y + BAR_HEIGHT)]
    marks.append(Path(corners, GRID, 0.8, closed=True))
    full = words.number(f"{full_m * 1e3:.2f}")
    for tick, text in ((x, f"{MINUS}{full}"), (x + BAR / 2, "0"), (x + BAR, f"+{full} mm")):
        marks.append(Text(tick, y + BAR_HEIGHT + 13, text, 11, "middle", colour=PALE))
    marks.append(
        Text(x + BAR / 2, y + BAR_HEIGHT + 28, words("plot.face_legend"), 11, "middle", colour=PALE)
    )
    return marks
