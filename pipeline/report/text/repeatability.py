"""Repeat scans as a table: pooled angles, scatter against prediction, drift."""

from __future__ import annotations

import math

from ...measurement import PooledAngle, Repeats
from ...vehicle import deg_min_sec
from ..format.layout import aligned

EXPLAINED = """\
Repeat scans: pooled angle with its u; chi-square of the scatter about it, per degree of freedom,
which is about 1 where the uncertainty is right; chance of as much scatter or more; drift a scan."""
VERDICTS = {
    "as-predicted": "as predicted",
    "larger": "more scatter than predicted: something moved, or the uncertainty is too small",
    "smaller": "less scatter than predicted: the uncertainty is too large",
}


def repeats_text(groups: tuple[Repeats, ...]) -> str:
    """A line for toe and one for camber of each group of repeat scans."""
    header = ("of", "scans", "angle", "pooled", "u", "chi2/nu", "chance", "drift", "u", "")
    rows: list[tuple[str, ...]] = [header]
    for group in groups:
        for angle in group.angles:
            rows.append((group.of, str(len(group.scans)), *_cells(angle)))
    return f"{EXPLAINED}\n{aligned(rows, left=1)}"


def _cells(angle: PooledAngle) -> tuple[str, ...]:
    return (
        angle.kind,
        deg_min_sec(angle.pooled),
        _seconds(angle.u),
        f"{angle.chi_square / angle.dof:.2f}",
        f"{100.0 * angle.probability:.1f} %",
        "-" if angle.drift is None else _seconds(angle.drift, "+"),
        "-" if angle.u_drift is None else _seconds(angle.u_drift),
        VERDICTS[angle.status],
    )


def _seconds(angle_rad: float, sign: str = "") -> str:
    return f'{math.degrees(angle_rad) * 3600:{sign}.1f}"'
