"""Residuals: of a target as a histogram, of a bare wheel along the profile about its axis."""

from __future__ import annotations

import math

import numpy as np

from ...measurement import WheelResult
from ...system import frozen
from ...vectors import Array
from ...wheel import WheelProfile
from ..format.language import Translations
from .drawing import GRID, INK, PALE, SIGMA, Dots, Drawing, Mark, Path, Text, cut, rectangle
from .validation import ticks

WIDE, SPLIT, GAP, MARGIN = 720.0, 236.0, 34.0, 64.0  # of a profile; SPLIT: foot of its upper part
SIGMAS = 4.0  # of the kept residuals: half the range of the lower part
USED, POINTS = "#0072B2", "#8a8a8a"
WIDTH, HEIGHT, HEAD, FOOT, LEFT = 360.0, 398.0, 44.0, 62.0, 24.0
BAR, LIMIT, LIMIT_INK = "#56B4E9", "#D55E00", "#9c4400"


def histogram_drawing(result: WheelResult, words: Translations) -> Drawing | None:
    """Draw the distances of a target's points from its plane, with the normal distribution."""
    evidence = result.observation.evidence
    if evidence is None or evidence.face is None or evidence.plane is None:
        return None
    counts, span = evidence.face.counts, evidence.face.span_m
    sigma, title = evidence.plane.sigma_m, words("plot.histogram_title")
    left, width, base = LEFT, WIDTH - 2 * LEFT, HEIGHT - FOOT
    tall = base - HEAD
    x = np.linspace(-span, span, 201)
    step = 2.0 * span / len(counts)
    normal = counts.sum() * step / (sigma or 1.0) / math.sqrt(2.0 * math.pi)
    curve = normal * np.exp(-0.5 * (x / (sigma or 1.0)) ** 2)
    top = max(float(counts.max()), float(curve.max()), 1.0)

    def at(residual_m: float) -> float:
        return left + width * (residual_m + span) / (2.0 * span)

    marks: list[Mark] = [Text(left, 20, title, 15, bold=True)]
    edges = left + width * np.arange(len(counts) + 1) / len(counts)
    tops = base - tall * counts / top
    steps = np.column_stack([np.repeat(edges, 2)[1:-1], np.repeat(tops, 2)])
    area = np.vstack([[left, base], steps, [left + width, base]])
    marks.append(Path(area, fill=BAR, closed=True))
    heights = base - tall * curve / top
    marks.append(
        Path(np.column_stack([left + width * (x + span) / (2 * span), heights]), "#000000")
    )
    for sigmas in (-3.0, 3.0):
        limit = at(sigmas * sigma)
        marks.append(Path([(limit, HEAD), (limit, base)], LIMIT, 1.2, dash=(5.0, 3.0)))
        marks.append(
            Text(limit, HEAD - 6, f"{sigmas:+.0f} {SIGMA}", 12, "middle", colour=LIMIT_INK)
        )
    marks.append(Path([(left, base), (left + width, base)], INK))
    for share in (-0.8, -0.4, 0.0, 0.4, 0.8):
        text = words.number(f"{share * span * 1e3:+.2f}" if share else "0")
        marks.append(Text(at(share * span), base + 18, text, 12, "middle"))
    label = words("plot.histogram_axis", points=words.count(int(counts.sum())))
    marks.append(Text(left + width / 2, base + 38, label, 12, "middle"))
    sigma_text = words.number(f"{sigma * 1e3:.3f}")
    note = words("plot.histogram_note", sigma=sigma_text)
    marks.append(Text(left + width / 2, base + 55, note, 12, "middle", colour=PALE))
    return Drawing(WIDTH, HEIGHT, title, marks)


def profile_drawing(result: WheelResult, words: Translations) -> Drawing | None:
    """Draw heights by radii about a bare wheel's axis, with the residuals of its rings below."""
    evidence = result.observation.evidence
    if evidence is None or evidence.profile is None:
        return None
    profile = evidence.profile
    title = words("plot.profile_title", name=cut(words.wheel(result.observation.name), 18))
    known = np.isfinite(profile.height_m)
    radii = profile.radius_m[known]
    x_range = (1e3 * float(radii.min()) - 2.0, 1e3 * float(radii.max()) + 2.0)
    spread = 1e3 * (float(np.sqrt(np.mean(profile.kept_m[:, 1] ** 2))) or 1e-4)
    heights = _Panel(x_range, _padded(1e3 * profile.height_m[known]), (HEAD, SPLIT))
    rest = _Panel(x_range, (-SIGMAS * spread, SIGMAS * spread), (SPLIT + GAP, HEIGHT - FOOT + 6.0))
    mark = 1e3 * float(profile.ring_m[0])
    note = words("plot.profile_note", rms=words.number(f"{spread:.3f}"))
    marks: list[Mark] = [
        Text(MARGIN, 20, title, 15, bold=True),
        *heights.axes(words("plot.profile_height"), words),
        *heights.dots(1e3 * profile.points_m, 1.6, POINTS, 0.5),
        *_meridian(profile, heights),
        *rest.axes(words("plot.profile_residual"), words, labelled=True),
        *rest.dots(1e3 * profile.rejected_m, 2.2, LIMIT, 0.8),
        *rest.dots(1e3 * profile.kept_m, 2.2, USED, 0.5),
        Path([rest.at((rest.x[0], 0.0)), rest.at((rest.x[1], 0.0))], INK),
    ]
    for panel in (heights, rest):
        ends = [panel.at((mark, y)) for y in panel.y]
        marks.append(Path(ends, LIMIT, 1.2, dash=(5.0, 3.0)))
    ring = words(f"plot.profile_{profile.method}", radius=words.number(f"{mark:.1f}"))
    marks.append(Text(heights.at((mark, 0.0))[0], HEAD - 6, ring, 12, "middle", colour=LIMIT_INK))
    foot = words("plot.profile_radius")
    marks.append(Text((MARGIN + WIDE - LEFT) / 2, HEIGHT - 22, foot, 12, "middle"))
    marks.append(Text((MARGIN + WIDE - LEFT) / 2, HEIGHT - 5, note, 12, "middle", colour=PALE))
    return Drawing(WIDE, HEIGHT, title, marks)


@frozen
class _Panel:
    """Axes of a profile over x and y, millimetres, between two heights of the drawing."""

    x: tuple[float, float]
    y: tuple[float, float]
    between: tuple[float, float]

    def at(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return the pixel of a point."""
        across, up = self.shares(np.array([point]))[0]
        top, base = self.between
        return MARGIN + across * (WIDE - LEFT - MARGIN), base - up * (base - top)

    def shares(self, points: Array) -> Array:
        """Return where points (N, 2) lie in the panel, from 0 to 1."""
        low, high = np.array([self.x, self.y]).T
        return np.asarray((points - low) / (high - low))

    def dots(self, points: Array, size: float, colour: str, opacity: float) -> list[Mark]:
        """Return the points (N, 2) that lie in the panel."""
        shares = self.shares(points)
        inside = points[np.all((shares >= 0.0) & (shares <= 1.0), axis=1)]
        return [Dots([self.at((x, y)) for x, y in inside], size, colour, opacity)] * bool(
            len(inside)
        )

    def axes(self, label: str, words: Translations, *, labelled: bool = False) -> list[Mark]:
        """Return the frame with its grid; `labelled`: with the numbers of x."""
        top, base = self.between
        marks: list[Mark] = []
        for x in ticks(*self.x):
            at = self.at((x, 0.0))[0]
            marks.append(Path([(at, top), (at, base)], GRID, 0.8))
            if labelled:
                marks.append(Text(at, base + 16, words.number(f"{x:g}"), 12, "middle"))
        wider = max(1.0, 160.0 / (base - top))
        for y in (y for y in ticks(*(wider * y for y in self.y)) if self.y[0] <= y <= self.y[1]):
            at = self.at((self.x[0], y))[1]
            marks.append(Path([(MARGIN, at), (WIDE - LEFT, at)], GRID, 0.8))
            marks.append(Text(MARGIN - 6, at + 4, words.number(f"{y + 0.0:g}"), 12, "end"))
        marks.append(rectangle(MARGIN, top, WIDE - LEFT - MARGIN, base - top, stroke=INK))
        marks.append(Text(16, (top + base) / 2.0, label, 12, "middle", turn_deg=-90.0))
        return marks


def _meridian(profile: WheelProfile, panel: _Panel) -> list[Mark]:
    """Draw the rings' heights: all of them thin, those that the axis rests on thick."""
    lines: list[Mark] = []
    for shown, colour, width in (
        (np.isfinite(profile.height_m), INK, 1.0),
        (profile.used, USED, 3.0),
    ):
        rings = np.flatnonzero(shown & np.isfinite(profile.height_m))
        for run in np.split(rings, np.flatnonzero(np.diff(rings) > 1) + 1):
            points = zip(1e3 * profile.radius_m[run], 1e3 * profile.height_m[run], strict=True)
            lines += [Path([panel.at(point) for point in points], colour, width)] * (len(run) > 1)
    return lines


def _padded(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    room = 0.06 * (high - low) + 0.5
    return low - room, high + room
