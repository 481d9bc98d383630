"""Plots as a few kinds of marks, y down: written as SVG here, as PNG by drawing_png.py.

Coordinates are pixels, or millimetres where the drawing's unit says so.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Sequence
from typing import Literal
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

from ...system import frozen

MINUS, SIGMA = "\N{MINUS SIGN}", "\N{GREEK SMALL LETTER SIGMA}"
INK, PALE, GRID = "#222222", "#555555", "#d0d0d0"
NO_BREAK = "\N{NO-BREAK SPACE}"
FONT = "'Liberation Sans', Arial, Helvetica, sans-serif"
Anchor = Literal["start", "middle", "end"]


@frozen
class Path:
    """A line through points (N, 2), or with `fill` and `closed` an area.

    dash: lengths on and off. crisp: without antialiasing, so that areas side by side have no seam.
    """

    points: npt.ArrayLike
    stroke: str = "none"
    width: float = 1.0
    fill: str = "none"
    closed: bool = False
    dash: tuple[float, float] | None = None
    opacity: float = 1.0
    crisp: bool = False


@frozen
class CircleMark:
    """A circle about (x, y)."""

    x: float
    y: float
    radius: float
    fill: str = "none"
    stroke: str = "none"
    width: float = 1.0
    opacity: float = 1.0


@frozen
class Dots:
    """Points (N, 2), drawn as discs of diameter `size`."""

    points: npt.ArrayLike
    size: float
    colour: str
    opacity: float = 1.0


@frozen
class Text:
    """One line of text that starts, is centred or ends at (x, y) on its baseline.

    halo: width of a white outline. turn_deg: rotation about (x, y), clockwise.
    """

    x: float
    y: float
    text: str
    size: float = 13.0
    anchor: Anchor = "start"
    bold: bool = False
    colour: str = INK
    turn_deg: float = 0.0
    halo: float = 0.0


@frozen
class Raster:
    """Image centred at (x, y), rotated clockwise: pixels (m, n) index a palette (k, 3) of RGB."""

    x: float
    y: float
    width: float
    pixels: npt.NDArray[np.uint8]
    palette: npt.NDArray[np.uint8]
    turn_deg: float = 0.0

    @property
    def height(self) -> float:
        """Height; the pixels are square."""
        rows, columns = self.pixels.shape
        return self.width * float(rows / columns)


Mark = Path | CircleMark | Dots | Text | Raster


@frozen
class Drawing:
    """Marks from back to front.

    title: text alternative for screen readers. unit: of all lengths; "mm" prints to scale. ground:
    colour behind the marks.
    """

    width: float
    height: float
    title: str
    marks: Sequence[Mark]
    unit: Literal["", "mm"] = ""
    ground: str = "#ffffff"

    @property
    def svg(self) -> str:
        """SVG element, for a file or inside a page."""
        width, height = f"{self.width:g}", f"{self.height:g}"
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}{self.unit}" height="{height}{self.unit}" role="img" '
            f'font-family="{FONT}">',
            f"<title>{_plain(self.title)}</title>",
            f'<rect width="{width}" height="{height}" fill="{self.ground}"/>',
            *map(_svg, self.marks),
        ]
        return "\n".join([*parts, "</svg>\n"])


def cut(name: str, most: int) -> str:
    """Return the name, shortened to `most` characters with an ellipsis where it is longer."""
    return name if len(name) <= most else f"{name[: most - 1]}\N{HORIZONTAL ELLIPSIS}"


def rectangle(
    x: float,
    y: float,
    width: float,
    height: float,
    fill: str = "none",
    *,
    stroke: str = "none",
    line_width: float = 1.0,
    opacity: float = 1.0,
) -> Path:
    """Return a rectangle with its top left corner at (x, y)."""
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    return Path(corners, stroke, line_width, fill, closed=True, opacity=opacity)


def arrow(start: npt.ArrayLike, end: npt.ArrayLike, colour: str, width: float = 1.5) -> list[Mark]:
    """Return a line with a filled head at `end`."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    aside = np.array([-along[1], along[0]])
    tip = 3.0 + 2.5 * width
    base = b - tip * along
    head = [b, base + 0.4 * tip * aside, base - 0.4 * tip * aside]
    return [Path([a, base], colour, width), Path(np.stack(head), fill=colour, closed=True)]


def _svg(mark: Mark) -> str:
    if isinstance(mark, Text):
        return _text(mark)
    if isinstance(mark, Raster):
        return _raster(mark)
    if isinstance(mark, CircleMark):
        return f'<circle cx="{mark.x:.2f}" cy="{mark.y:.2f}" r="{mark.radius:g}" {_style(mark)}/>'
    if isinstance(mark, Dots):
        points = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in np.asarray(mark.points, float))
        return (
            f'<path d="{points}" fill="none" stroke="{mark.colour}" stroke-width="{mark.size:g}" '
            f'stroke-linecap="round"{_opacity(mark.opacity)}/>'
        )
    return _path(mark)


def _path(mark: Path) -> str:
    points = "L".join(f"{x:.2f} {y:.2f}" for x, y in np.asarray(mark.points, float))
    dash = f' stroke-dasharray="{mark.dash[0]:g} {mark.dash[1]:g}"' if mark.dash else ""
    crisp = ' shape-rendering="crispEdges"' if mark.crisp else ""
    return f'<path d="M{points}{"Z" if mark.closed else ""}" {_style(mark)}{dash}{crisp}/>'


def _style(mark: Path | CircleMark) -> str:
    stroke = f' stroke="{mark.stroke}" stroke-width="{mark.width:g}"'
    return f'fill="{mark.fill}"{stroke if mark.stroke != "none" else ""}{_opacity(mark.opacity)}'


def _text(mark: Text) -> str:
    style = f'font-size="{mark.size:g}" fill="{mark.colour}"'
    if mark.anchor != "start":
        style += f' text-anchor="{mark.anchor}"'
    if mark.bold:
        style += ' font-weight="bold"'
    if mark.halo:
        style += f' stroke="#ffffff" stroke-width="{mark.halo:g}" paint-order="stroke"'
    if mark.turn_deg:
        style += f' transform="rotate({mark.turn_deg:.2f} {mark.x:.2f} {mark.y:.2f})"'
    return f'<text x="{mark.x:.2f}" y="{mark.y:.2f}" {style}>{_plain(mark.text)}</text>'


def _raster(mark: Raster) -> str:
    data = base64.b64encode(png_of(mark.pixels, mark.palette)).decode("ascii")
    turn = f' transform="rotate({mark.turn_deg:.3f} {mark.x:.2f} {mark.y:.2f})"'
    return (
        f'<image x="{mark.x - mark.width / 2:.2f}" y="{mark.y - mark.height / 2:.2f}" '
        f'width="{mark.width:.2f}" height="{mark.height:.2f}"{turn if mark.turn_deg else ""} '
        f'href="data:image/png;base64,{data}"/>'
    )


def _plain(text: str) -> str:
    """Escape text; replace characters that XML cannot hold or that change the reading direction."""
    return escape(
        "".join(
            c if c.isprintable() or c == NO_BREAK else "\N{REPLACEMENT CHARACTER}" for c in text
        )
    )


def _opacity(opacity: float) -> str:
    return "" if opacity == 1.0 else f' opacity="{opacity:g}"'


def png_of(pixels: npt.NDArray[np.uint8], palette: npt.NDArray[np.uint8]) -> bytes:
    """Return a PNG of indexed colours. Source: W3C, Portable Network Graphics, third edition."""
    height, width = pixels.shape
    rows = np.zeros((height, width + 1), np.uint8)
    rows[:, 1:] = pixels
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"PLTE", palette.tobytes())]
    chunks += [(b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
