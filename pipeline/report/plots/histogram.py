"""Histogram of a target's residuals, with the normal distribution of its noise."""

from __future__ import annotations

import math

import numpy as np

from ...measurement import WheelResult
from ..format.language import Translations
from .drawing import INK, PALE, SIGMA, Drawing, Mark, Path, Text

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
