"""A comparison of two methods on one capture, as text."""

from __future__ import annotations

import math

import numpy as np

from ...validation import KINDS, SHAPE, Comparison, JointTest
from ...vehicle import deg_min_sec
from ..format.layout import aligned

SIGNS = (
    "Toe-in and camber with the top outward are positive; camber is the elevation, as in the\n"
    "paper. u: standard uncertainty (k = 1). U: expanded uncertainty of the difference (95 %).\n"
    "En = difference/U. detectable: smallest error that this row reveals at 95 % confidence and\n"
    "99 % power."
)


SHAPE_DOUBT = 1e-3  # probability of the centres' shape below which an agreement is qualified


def validation_text(found: Comparison) -> str:
    """Differences and verdicts, what was seen, and why the methods differ."""
    first, second = found.first.label, found.second.label
    parts = [
        f"{found.source}: {first} against {second}; difference = {first} less {second}",
        *found.notes,
        *missing_lines(found),
        "",
        _table(found),
        "",
        SIGNS,
        "",
        *_whole(found),
        "",
        *_why(found),
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


def seconds(angle_rad: float) -> str:
    """Seconds of arc, unsigned quantities."""
    return f'{math.degrees(angle_rad) * 3600:.1f}"'


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


def _table(found: Comparison) -> str:
    head = ("name", "wheel", "angle", found.first.label, "u", found.second.label, "u")
    rows = [(*head, "difference", "u", "U", "En", "detectable", "verdict")]
    difference, expanded = found.difference_rad, found.spread.expanded
    for i, name, wheel, kind in _rows(found):
        rows.append(
            (
                name,
                wheel,
                kind,
                deg_min_sec(found.first.angles_rad[i]),
                seconds(found.u_first[i]),
                deg_min_sec(found.second.angles_rad[i]),
                seconds(found.u_second[i]),
                deg_min_sec(difference[i]),
                seconds(found.spread.u[i]),
                seconds(expanded[i]),
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


def _why(found: Comparison) -> list[str]:
    rows: list[tuple[str, ...]] = [
        ("name", "wheel", "angle", "difference", "by the frame", "by the plane", "u")
    ]
    for i, name, wheel, kind in _rows(found):
        parts = (found.difference_rad[i], found.frame_rad[i], found.planes_rad[i])
        u = seconds(found.planes.u[i])
        rows.append((name, wheel, kind, *(deg_min_sec(float(x)) for x in parts), u))
    return [
        "Why they differ: the frame's part, and the planes' with both in one frame (the four "
        "centres fitted).",
        aligned(rows, left=3),
        f"  Planes together: {said(found.planes.test(found.planes_rad))}.",
        "",
        "The four centres' shape, which no choice of coordinates changes",
        _shape(found),
        f"  Shape together: {said(found.shape_spread.test(found.shape))}.",
    ]


def _shape(found: Comparison) -> str:
    rows: list[tuple[str, ...]] = [("", "difference", "u", "En")]
    spread = found.shape_spread
    for index, (name, unit) in enumerate(SHAPE.items()):
        value, u, expanded = (float(x[index]) for x in (found.shape, spread.u, spread.expanded))
        en = f"{value / expanded:+.2f}" if expanded > 0.0 else "-"
        if unit == "m":
            rows.append((name, f"{value * 1e3:+.3f} mm", f"{u * 1e3:.3f} mm", en))
        else:
            rows.append((name, deg_min_sec(value), seconds(u), en))
    return aligned(rows, left=1)
