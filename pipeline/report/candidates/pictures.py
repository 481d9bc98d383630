"""Pictures of an explained scan: the candidates among its points, the residuals about the best."""

from __future__ import annotations

import numpy as np

from ...explanation import ExplainedCandidate, ExplainedScan
from ...system import frozen
from ...vectors import Array, plane_basis
from ..format.language import Translations
from ..plots.drawing import INK, PALE, Drawing, Mark, Path, Raster, Text, cut, rectangle
from ..plots.target_face import FOOT, HEAD, LEFT, SIDE, face_marks, to_upright

WIDTH, TOP, MARGIN = 640.0, 40.0, 12.0
CELLS = 320  # of the picture, across
TALLEST, LEAST_SPAN_M = 1.0, 0.1  # height in widths; of the points shown
REACH, WIDER_M = 3.0, 2.0  # radii about the candidates shown; more where none has the outline
SHADES = 48
COLOURS = {"chosen": "#1b7f3b", "rival": "#b35900", "refused": "#a01515"}
DRAWN = "#0b57d0"  # the operator's region
CORNERS, LABEL = 48, 44.0
UP, AHEAD = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def candidates_drawing(scan: ExplainedScan, words: Translations) -> Drawing:
    """Draw the scan's points, near ones dark, and the outline and number of each candidate.

    Seen along the normal of the best candidate, or across the flattest side of the points.
    """
    title = words("plot.candidates_title", name=cut(words.wheel(scan.name), 24))
    head: list[Mark] = [Text(MARGIN, 22, title, 15, bold=True)]
    if not len(scan.sample_m):
        text = Text(MARGIN, TOP + 16, words("plot.no_candidate"), 13, colour=PALE)
        return Drawing(WIDTH, TOP + 40, title, [*head, text])
    seen = _Seen.of(scan)
    marks: list[Mark] = [_points(scan.sample_m @ seen.axes.T, seen.low, seen.span, seen.height)]
    for one in reversed(scan.candidates):
        marks += _candidate(one, scan, seen)
    if len(scan.drawn_m):
        drawn = seen.at(np.vstack([scan.drawn_m, scan.drawn_m[:1]]))
        marks += [Path(drawn, "#ffffff", 4.5), Path(drawn, DRAWN, 2.4, dash=(10.0, 5.0))]
    if not scan.candidates and not scan.is_measured:
        marks.append(Text(MARGIN + 8, TOP + 20, words("plot.no_candidate"), 13, colour=INK, halo=3))
    return Drawing(WIDTH, TOP + seen.height + MARGIN, title, [*head, *marks])


def places(scan: ExplainedScan) -> list[tuple[float, float]]:
    """Return where each candidate lies in the picture: shares of its width and height."""
    if not len(scan.sample_m):
        return []
    seen = _Seen.of(scan)
    centres = np.array([one.candidate.centre_m for one in scan.candidates]).reshape(-1, 3)
    shares = seen.at(centres) / [WIDTH, TOP + seen.height + MARGIN]
    return [(round(float(x), 4), round(float(y), 4)) for x, y in shares]


def picture_axes(scan: ExplainedScan) -> list[list[float]]:
    """Return the directions (2, 3) to the right and upwards in the picture of a scan's points."""
    if not len(scan.sample_m):
        return []
    return [[round(float(x), 4) + 0.0 for x in way] for way in _view(scan)[:2]]


def picture_corners_m(scan: ExplainedScan) -> Array:
    """Return where the picture of a scan lies, (3, 3): upper left, upper right, lower left corner.

    In the plane through the best candidate, or the middle of the points; (0, 3) without points.
    """
    if not len(scan.sample_m):
        return np.zeros((0, 3))
    seen, shown = _Seen.of(scan), scan.candidates
    middle = shown[0].candidate.centre_m if shown else scan.sample_m.mean(axis=0)
    size = np.array([WIDTH, TOP + seen.height + MARGIN])
    at = (
        seen.low
        + (np.array([[0, 0], [1, 0], [0, 1]]) * size - [MARGIN, TOP]) * [1, -1] / seen.scale
    )
    at[:, 1] += seen.span[1]
    return np.column_stack([at, np.full(3, middle @ seen.axes[2])]) @ seen.axes


def best_drawing(scan: ExplainedScan, words: Translations) -> Drawing | None:
    """Draw the residuals about the best candidate, None where nothing was cut out."""
    if scan.face is None or not scan.candidates:
        return None
    title = words("plot.best_title", name=cut(words.wheel(scan.name), 18))
    rotation = to_upright(scan.candidates[0].candidate.basis, UP)
    marks = [
        *face_marks(scan.face, scan.sigma_m, rotation, words),
        Text(LEFT, 20, title, 15, bold=True),
    ]
    return Drawing(SIDE + 2 * LEFT, HEAD + SIDE + FOOT, title, marks)


@frozen
class _Seen:
    """Area of the picture: axes (3, 3) of `_view`, lower left corner (2,) and size (2,), m."""

    axes: Array
    low: Array
    span: Array

    @classmethod
    def of(cls, scan: ExplainedScan) -> _Seen:
        """Return what is shown of a scan that has points."""
        axes = _view(scan)
        return cls(axes, *_frame(scan, axes))

    @property
    def scale(self) -> float:
        """Units of the drawing per metre."""
        return float((WIDTH - 2 * MARGIN) / self.span[0])

    @property
    def height(self) -> float:
        """Height of the points' part of the drawing."""
        return float(self.span[1] * self.scale)

    def at(self, points_m: Array) -> Array:
        """Return where points (N, 3) lie in the drawing, (N, 2)."""
        right, up = ((points_m @ self.axes[:2].T - self.low) * self.scale).T
        return np.column_stack([MARGIN + right, TOP + self.height - up])


def _view(scan: ExplainedScan) -> Array:
    """Return rows (3, 3): to the right and upwards in the picture, and towards the viewer."""
    towards = scan.best
    if towards is None:
        points = scan.sample_m - scan.sample_m.mean(axis=0)
        towards = np.linalg.eigh(points.T @ points)[1][:, 0]
        towards = towards if towards[2] >= 0.0 else -towards
    up = UP if abs(towards @ UP) < 0.9 else AHEAD
    up = up - (up @ towards) * towards
    if np.linalg.norm(up) < 1e-6:
        up = plane_basis(towards)[0]
    up = up / np.linalg.norm(up)
    return np.stack([np.cross(up, towards), up, towards])


def _frame(scan: ExplainedScan, axes: Array) -> tuple[Array, Array]:
    """Return the lower left corner (2,) and the size (2,) of what is shown, metres."""
    points = scan.sample_m @ axes[:2].T
    low, high = np.quantile(points, (0.01, 0.99), axis=0)
    if scan.candidates:
        shown = np.array([one.candidate.centre_m for one in scan.candidates]) @ axes[:2].T
        reach_m = REACH * scan.region.radius_m
        least, most = shown.min(axis=0) - reach_m, shown.max(axis=0) + reach_m
        if all(one.standing == "refused" for one in scan.candidates):
            around_m = np.maximum(low, least - WIDER_M), np.minimum(high, most + WIDER_M)
            least, most = np.minimum(least, around_m[0]), np.maximum(most, around_m[1])
        low, high = least, most
    if len(scan.drawn_m):
        drawn = scan.drawn_m @ axes[:2].T
        low, high = np.minimum(low, drawn.min(axis=0)), np.maximum(high, drawn.max(axis=0))
    size = np.maximum(high - low, LEAST_SPAN_M)
    wide = max(size[0], size[1] / TALLEST)
    span = np.array([wide, max(size[1], 0.35 * wide)])
    return (low + high - span) / 2.0, span


def _points(seen_m: Array, low: Array, span: Array, height: float) -> Raster:
    """Draw points (N, 3) along the axes of the picture: the nearest in each cell, by its depth."""
    rows = max(1, round(CELLS * span[1] / span[0]))
    column = ((seen_m[:, 0] - low[0]) * (CELLS / span[0])).astype(np.int64)
    row = rows - 1 - ((seen_m[:, 1] - low[1]) * (rows / span[1])).astype(np.int64)
    inside = (column >= 0) & (column < CELLS) & (row >= 0) & (row < rows)
    cell, depth = (row * CELLS + column)[inside], seen_m[inside, 2]
    near = np.full(rows * CELLS, -np.inf)
    np.maximum.at(near, cell, depth)
    seen = np.isfinite(near)
    pixels = np.full(rows * CELLS, SHADES, dtype=np.uint8)
    if seen.any():
        far, close = np.quantile(near[seen], (0.02, 0.98))
        share = np.clip((near[seen] - far) / max(close - far, 1e-6), 0.0, 1.0)
        pixels[seen] = np.rint(share * (SHADES - 1)).astype(np.uint8)
    middle = (WIDTH / 2.0, TOP + height / 2.0)
    return Raster(*middle, WIDTH - 2 * MARGIN, pixels.reshape(rows, CELLS), _palette())


def _palette() -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    """Return shades from far, pale, to near, dark; then white, where no point is."""
    share = np.linspace(0.0, 1.0, SHADES)[:, None]
    pale, dark = np.array([214.0, 226.0, 236.0]), np.array([38.0, 70.0, 96.0])
    shades = pale + share * (dark - pale)
    return np.vstack([shades, [[255.0] * 3]]).astype(np.uint8)


def _candidate(one: ExplainedCandidate, scan: ExplainedScan, seen: _Seen) -> list[Mark]:
    """Draw the target's outline where the candidate lies, with its number and match."""
    found, colour = one.candidate, COLOURS[one.standing]
    region = one.region or scan.region
    outline = region.polygons_m(CORNERS)[0] @ found.basis[:2] + found.centre_m
    edge = seen.at(outline)
    x, y = seen.at(found.centre_m[None])[0]
    dash = None if one.standing == "chosen" else (6.0, 4.0)
    name = f"{one.number}: {one.wheel}" if one.wheel else f"{one.number}"
    return [
        Path(np.vstack([edge, edge[:1]]), "#ffffff", 4.5),
        Path(np.vstack([edge, edge[:1]]), colour, 2.4, dash=dash),
        rectangle(x - LABEL / 2, y - 18, LABEL, 36, "#ffffff", opacity=0.8),
        Text(x, y - 2, name, 15, "middle", bold=True, colour=colour),
        Text(x, y + 14, f"{found.match:.2f}", 12, "middle", colour=colour),
    ]
