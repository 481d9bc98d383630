"""A comparison of two methods on one capture, as text."""

from __future__ import annotations

import math

import numpy as np

from ...validation import KINDS, SHAPE, Comparison, JointTest, Spread
from ...vectors import Array
from ..format.layout import aligned
from ..format.view import PAPER, View
from ..format.writer import Writer
from .plain import plain_writer

SIGNS = (
    "Toe-in and camber with the top outward are positive; camber is the elevation, as in the\n"
    "paper. u: standard uncertainty (k = 1). U: expanded uncertainty of the difference (95 %).\n"
    "En = difference/U. detectable: smallest error that this row reveals at 95 % confidence and\n"
    "99 % power."
)


SHAPE_DOUBT = 1e-3  # probability of the centres' shape below which an agreement is qualified


def validation_text(found: Comparison, view: View = PAPER) -> str:
    """Differences and verdicts, what was seen, and why the methods differ."""
    writer = plain_writer(view)
    first, second = found.first.label, found.second.label
    parts = [
        f"{found.source}: {first} against {second}; difference = {first} less {second}",
        *found.notes,
        *missing_lines(found),
        "",
        _table(found, writer),
        "",
        SIGNS,
        "",
        *_whole(found),
        "",
        *_why(found, writer),
    ]
    return "\n".join(parts) + "\n"


def missing_lines(found: Comparison) -> list[str]:
    """Return what could not be compared, and why."""
    return [f"Not compared: {name}: {reason}" for name, reason in found.missing]


def said(test: JointTest) -> str:
    """Return a joint test in a few words."""
    dof = "" if test.dof > 1e4 else f", u known to {test.dof:.0f} degrees of freedom"
    return (
        f"chi-square {test.chi_square:.1f} for {test.count} values, p = {test.probability:.3g}{dof}"
    )


def degrees(angle_rad: float) -> str:
    """Decimal degrees of a size."""
    return f"{math.degrees(angle_rad):.3g}°" if math.isfinite(angle_rad) else "no size"


def _rows(found: Comparison) -> list[tuple[int, str, str, str]]:
    """Index, name, wheel and angle: wheel by wheel, toe before camber."""
    count = len(found.names)
    return [
        (index + count * kind, name, wheel, KINDS[kind])
        for index, (name, wheel) in enumerate(zip(found.names, found.wheels, strict=True))
        for kind in range(2)
    ]


def coverage_factors(spread: Spread) -> Array:
    """(q,) U over u of each difference, for values of which u alone is known; 0 where u is 0."""
    return np.divide(spread.expanded, spread.u, out=np.zeros(len(spread.u)), where=spread.u > 0.0)


def _table(found: Comparison, writer: Writer) -> str:
    head = ("name", "wheel", "angle", found.first.label, "u", found.second.label, "u")
    rows: list[tuple[str, ...]] = [(*head, "difference", "u", "U", "En", "detectable", "verdict")]
    difference, expanded = found.difference_rad, found.spread.expanded
    factors = coverage_factors(found.spread)
    for i, name, wheel, kind in _rows(found):
        methods = (found.first, found.u_first[i]), (found.second, found.u_second[i])
        rows.append(
            (
                name,
                wheel,
                kind,
                *(
                    text
                    for method, u in methods
                    for text in (
                        # a method without uncertainty, such as the truth: to the difference's place
                        writer.number(method.angles_rad[i], "rad", factors[i] * u or expanded[i]),
                        writer.size(u, "rad"),
                    )
                ),
                writer.number(difference[i], "rad", expanded[i]),
                writer.size(found.spread.u[i], "rad"),
                writer.size(expanded[i], "rad"),
                f"{found.en[i]:+.2f}",
                degrees(found.detectable_rad[i]),
                found.verdicts[i],
            )
        )
    return aligned(rows, left=3)


def _whole(found: Comparison) -> list[str]:
    beyond = int(np.count_nonzero(np.abs(found.en) > 1.0))
    lines = [
        f"Verdict: {found.verdict}. All angles together, with what they share: "
        f"{said(found.joint)}.",
        f"Beyond |En| = 1: {beyond} of {len(found.en)} rows; 1 in 20 is by chance, so the verdict "
        "is not theirs.",
        f"Smallest error that this would see: {degrees(found.detectable_in_one_rad)} in any one "
        f"angle, {degrees(found.detectable_in_all_rad('toe'))} in all toes alike, "
        f"{degrees(found.detectable_in_all_rad('camber'))} in all cambers alike.",
    ]
    if found.to_detect_rad is not None and found.detectable_in_one_rad > found.to_detect_rad:
        lines.append(
            f"An error of {degrees(found.to_detect_rad)} in one angle would not be seen: use an "
            "instrument of less noise, or more captures (`wheelplane validate ARCHIVE`)."
        )
    shape = found.shape_spread.test(found.shape)
    if found.joint.agrees and shape.probability < SHAPE_DOUBT:
        lines.append(
            "Yet the wheel centres contradict each other (shape, below: p = "
            f"{shape.probability:.2g}): they are known less well than is stated, or a target "
            "moved; --aiming states how well five points were aimed at."
        )
    return lines


def _why(found: Comparison, writer: Writer) -> list[str]:
    rows: list[tuple[str, ...]] = [
        ("name", "wheel", "angle", "difference", "by the frame", "by the plane", "u")
    ]
    for i, name, wheel, kind in _rows(found):
        parts = (found.difference_rad[i], found.frame_rad[i], found.planes_rad[i])
        whole, planes = found.spread.expanded[i], found.planes.expanded[i]
        expanded = (whole, whole, planes)
        texts = (writer.number(float(x), "rad", U) for x, U in zip(parts, expanded, strict=True))
        rows.append((name, wheel, kind, *texts, writer.size(found.planes.u[i], "rad")))
    return [
        "Why they differ: the frame's part, and the planes' with both in one frame (the four "
        "centres fitted).",
        aligned(rows, left=3),
        f"  Planes together: {said(found.planes.test(found.planes_rad))}.",
        "",
        "The four centres' shape, which no choice of coordinates changes",
        _shape(found, writer),
        f"  Shape together: {said(found.shape_spread.test(found.shape))}.",
    ]


def _shape(found: Comparison, writer: Writer) -> str:
    rows: list[tuple[str, ...]] = [("", "difference", "u", "En")]
    spread = found.shape_spread
    for index, (name, unit) in enumerate(SHAPE.items()):
        value, u, expanded = (float(x[index]) for x in (found.shape, spread.u, spread.expanded))
        en = f"{value / expanded:+.2f}" if expanded > 0.0 else "-"
        if unit == "m":
            text = writer.millimetres(value, expanded, "+")
            rows.append((name, text, writer.size(u, "m"), en))
        else:
            rows.append((name, writer.number(value, "rad", expanded), writer.size(u, "rad"), en))
    return aligned(rows, left=1)
