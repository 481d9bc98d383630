"""The plots of a validation: differences of one capture, Bland-Altman and line of many."""

from __future__ import annotations

import math

import numpy as np

from pipeline.agreement import Agreement
from pipeline.limits_of_agreement import Limit
from pipeline.report.validation_plot import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RIGHT,
    TOP,
    WIDTH,
    Plot,
    bounds,
    words_at,
)
from pipeline.validate_compare import KINDS, Comparison

SIGN = {"toe": "toe-in positive", "camber": "top-out positive"}


def differences_svg(found: Comparison) -> str:
    """Every difference with its expanded uncertainty; the same comparison gives the same bytes."""
    difference = np.degrees(found.difference_rad)
    reach = np.degrees(found.spread.expanded)
    low, high = bounds([*(difference - reach), *(difference + reach), 0.0])
    count = len(found.names)
    plot = Plot(
        f"{found.first.label} less {found.second.label}: {found.verdict}",
        f"bars: 95 %; all together p = {found.joint.probability:.3g}; toe-in, top-out positive",
        "wheel or trial",
        "difference / °",
        0.0,
        float(count),
        low,
        high,
        found.names,
    )
    plot.line((0.0, 0.0), (float(count), 0.0), GREY)
    for kind, colour in enumerate((BLUE, ORANGE)):
        for index in range(count):
            x, i = index + 0.36 + 0.28 * kind, index + count * kind
            y, U = float(difference[i]), float(reach[i])
            plot.line((x, y - U), (x, y + U), colour)
            plot.point(x, y, colour, 4.0)
        label = f"{KINDS[kind]} ({SIGN[KINDS[kind]]})"
        plot.parts.append(words_at(WIDTH - RIGHT + 10, TOP + 14 + 20 * kind, label, colour=colour))
    return plot.svg()


def bland_altman_svg(one: Agreement, first: str, second: str) -> str:
    """Difference over mean, with bias and limits of agreement."""
    mean = np.degrees((one.first + one.second) / 2.0)
    difference = np.degrees(one.first - one.second)
    levels = (one.lower, one.bias, one.upper)
    ends = [math.degrees(x) for limit in levels for x in (limit.low, limit.high)]
    plot = Plot(
        f"Bland-Altman, {one.kind}: {first} less {second}",
        f"{len(difference)} differences, {one.subjects} wheels, {one.units} captures or vehicles; "
        "bands: 95 % confidence",
        f"mean of both / ° ({SIGN[one.kind]})",
        "difference / °",
        *bounds([*mean]),
        *bounds([*difference, *ends]),
    )
    plot.line((plot.x_low, 0.0), (plot.x_high, 0.0), GREY)
    for x, y in zip(mean, difference, strict=True):
        plot.point(float(x), float(y))
    names = ("lower limit", "bias", "upper limit")
    for limit, name, colour in zip(levels, names, (ORANGE, GREEN, ORANGE), strict=True):
        _level(plot, limit, name, colour)
    return plot.svg()


def line_svg(one: Agreement, first: str, second: str) -> str:
    """Second over first method, with the fitted line and that of equality."""
    x, y = np.degrees(one.first), np.degrees(one.second)
    low, high = bounds([*x, *y])
    fitted = one.line
    said = "no line: it takes three points with uncertainties"
    if fitted is not None:
        said = (
            f"York: slope {fitted.slope:.4f} (u {fitted.u_slope:.4f}), intercept "
            f"{math.degrees(fitted.intercept):+.4f}° (u {math.degrees(fitted.u_intercept):.4f}°)"
        )
    plot = Plot(
        f"{one.kind.capitalize()}: {second} over {first}",
        said,
        f"{first} / ° ({SIGN[one.kind]})",
        f"{second} / °",
        low,
        high,
        low,
        high,
    )
    plot.line((low, low), (high, high), GREY, "4 4")
    for a, b in zip(x, y, strict=True):
        plot.point(float(a), float(b))
    legend = [("equal", GREY)]
    if fitted is not None:
        ends = [(v, math.degrees(fitted.intercept) + fitted.slope * v) for v in (low, high)]
        plot.line(ends[0], ends[1], ORANGE)
        legend.append(("fitted line", ORANGE))
    for row, (text, colour) in enumerate(legend):
        plot.parts.append(words_at(WIDTH - RIGHT + 10, TOP + 14 + 20 * row, text, colour=colour))
    return plot.svg()


def _level(plot: Plot, limit: Limit, name: str, colour: str) -> None:
    value, low, high = (math.degrees(x) for x in (limit.value, limit.low, limit.high))
    plot.level(value, low, high, colour, f"{name}\n{value:+.4f}°")
