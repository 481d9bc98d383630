"""Toe-out on turns at an angle of the inner wheel, from its curve over the steering positions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .estimates import estimate, weighted_sum
from .records import Estimate, ToeOut

BEYOND_RAD = math.radians(1.0)  # of extrapolation beyond the positions
LEAST_PAIRS = 3
MOST_APART_RAD = math.radians(15.0)  # of the front wheels at one position of the steering
TOGETHER_RAD = math.radians(2.0)  # positions that count as one

Pair = tuple[Estimate, Estimate]  # the inner wheel's angle, and how much less the outer steers


def toe_out_at(found: ToeOut, inner_rad: float) -> ToeOut:
    """Return toe-out on the same turn with the inner wheel at an angle, from `found.curve`.

    None of a wheel whose scans do not turn about one axis, as `found.status` says.
    """
    none = replace(found, inner_rad=inner_rad, difference=None, u_interpolation_rad=0.0)
    if found.status == "not-one-axis":
        return none
    if len(found.curve) < LEAST_PAIRS:
        reason = f"both wheels share {len(found.curve)} positions, {LEAST_PAIRS} or more are needed"
        return replace(none, status="too-few-pairs", reason=reason)
    apart = max(found.curve, key=lambda pair: abs(pair[1].value))
    if abs(apart[1].value) > MOST_APART_RAD:
        inner, outer = (math.degrees(x) for x in (apart[0].value, apart[0].value - apart[1].value))
        reason = (
            f"at one position the inner wheel is steered by {inner:+.1f}° and the outer one by "
            f"{outer:+.1f}°: scans are exchanged, or not of the position that they are named for"
        )
        return replace(none, status="not-together", reason=reason)
    angles = [inner.value for inner, _ in found.curve]
    for farthest, missing_rad in ((max(angles), inner_rad - max(angles)),
                                  (min(angles), min(angles) - inner_rad)):  # fmt: skip
        if missing_rad > BEYOND_RAD:
            reason = (
                f"the inner wheel was steered to {math.degrees(farthest):.1f}°, "
                f"{math.degrees(inner_rad):.6g}° are needed"
            )
            return replace(none, status="not-reached", reason=reason)
    curve = _merged(found.curve)
    if len(curve) < LEAST_PAIRS:
        reason = f"only {len(curve)} of the positions differ, {LEAST_PAIRS} or more are needed"
        return replace(none, status="too-few-pairs", reason=reason)
    nearest = sorted(curve, key=lambda pair: abs(pair[0].value - inner_rad))[:LEAST_PAIRS]
    curved, straight = _at_inner(nearest, inner_rad), _at_inner(nearest[:2], inner_rad)
    u_curve = abs(curved.value - straight.value) / 2.0
    difference = estimate(curved.value, curved.slope, curved.effects, u_curve)
    return replace(none, status="ok", reason="", difference=difference, u_interpolation_rad=u_curve)


def _merged(curve: Sequence[Pair]) -> list[Pair]:
    """Return means of positions that lie together: a curve through noise must not be steep."""
    groups: list[list[Pair]] = []
    for pair in sorted(curve, key=lambda pair: pair[0].value):
        if groups and pair[0].value - groups[-1][0][0].value < TOGETHER_RAD:
            groups[-1].append(pair)
        else:
            groups.append([pair])
    return [(_mean([x for x, _ in group]), _mean([y for _, y in group])) for group in groups]


def _mean(numbers: Sequence[Estimate]) -> Estimate:
    return weighted_sum([(1.0 / len(numbers), number) for number in numbers])


def _at_inner(pairs: Sequence[Pair], inner_rad: float) -> Estimate:
    """Return the polynomial through all pairs at an inner angle, with its slopes by all pairs.

    Source: Lagrange's form; an error of an abscissa acts by the polynomial's own slope there.
    """
    x = np.array([inner.value for inner, _ in pairs])
    y = np.array([difference.value for _, difference in pairs])
    powers = np.arange(len(x))
    at = (inner_rad**powers) @ np.linalg.inv(x[:, None] ** powers)
    coefficients = np.linalg.solve(x[:, None] ** powers, y)
    rises = (x[:, None] ** (powers[1:] - 1) * powers[1:]) @ coefficients[1:]
    terms = [
        (float(weight), term)
        for w, rise, (inner, difference) in zip(at, rises, pairs, strict=True)
        for weight, term in ((w, difference), (-w * rise, inner))
    ]
    return replace(weighted_sum(terms), value=float(at @ y))
