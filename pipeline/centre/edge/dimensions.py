"""Dimensions of plates by their edges: thickness, size and chamfer, alike in plates of one drawing.

A single edge shows little of them, and what it does not show moves its centre. So each scan's
dimensions are estimated from all scans; a plate is the same in all scans of it. With the covariance
S beforehand, and the information L of the scans, the covariance is (1 + S L)^-1 S.
Source: Robinson, Statistical Science 6 (1991) 15 (best linear unbiased prediction).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...uncertainty import chi_square_beyond
from ...vectors import Array
from .beams import ALIKE_CHAMFER_M, CENTRE, CHAMFER, GROWTH, SIZE_M, THICKNESS, Prior

DIMENSIONS = [THICKNESS, GROWTH, CHAMFER]  # places in a state
# Of two plates of one drawing: relative thickness, growth and chamfer, m, about their mean (k = 1).
ALIKE = np.array([0.01, SIZE_M * math.sqrt(0.5), ALIKE_CHAMFER_M])
EACH, LAST = 3, 2  # dimensions of a scan, and the place of its chamfer among them
UNLIKE = 1e-3  # probability of a difference as large, below which a plate is not like the others
FAR_BELOW = 30.0  # standard deviations; farther below 0 erfc is 0, too


@dataclass(frozen=True, eq=False)
class Dimensions:
    """Dimensions of a plate by the edge of one scan: log of its thickness, growth, chamfer.

    value: (3,) with covariance (3, 3); mean, weight: (3,) what was known beforehand, one over its
    variance. centre_m: (2,) with these; move: (2, 3) by how much it moves with them. noise_m2:
    (2, 2) of the centre if they were known. by_plane: (3, 3) derivatives by the plane, as of an
    EdgeFit.
    """

    value: Array
    covariance: Array
    mean: Array
    weight: Array
    centre_m: Array
    move: Array
    noise_m2: Array
    by_plane: Array

    @classmethod
    def of(cls, state: Array, covariance: Array, by_plane: Array, prior: Prior) -> Dimensions:
        """Return those of a state (14 or more,), with its covariance and derivatives."""
        own = covariance[np.ix_(DIMENSIONS, DIMENSIONS)]
        move = np.asarray(np.linalg.solve(own, covariance[DIMENSIONS, CENTRE]).T, float)
        return cls(
            value=state[DIMENSIONS],
            covariance=own,
            mean=prior.mean[DIMENSIONS],
            weight=prior.weight[DIMENSIONS],
            centre_m=state[CENTRE],
            move=move,
            noise_m2=covariance[CENTRE, CENTRE] - move @ own @ move.T,
            by_plane=by_plane[DIMENSIONS],
        )


def alike(scans: Sequence[Dimensions], plates: Sequence[str]) -> list[tuple[Array, Array] | None]:
    """Return the dimensions (3,) of each scan by all of one drawing, with their factor (3, K).

    K independent unit variables act on all scans through the columns of their factors. None for
    scans unlike the others, and where fewer than two are left. plates: name of that in each scan.
    The order of scans changes no digit.
    """
    kept = sorted(range(len(scans)), key=lambda k: scans[k].value.tolist())
    while len(kept) > 1:
        off = _least_alike([scans[k] for k in kept], [plates[k] for k in kept])
        if off is None:
            break
        del kept[off]
    found: list[tuple[Array, Array] | None] = [None] * len(scans)
    if len(kept) < 2:
        return found
    chosen = [scans[k] for k in kept]
    joint = _above_zero(_joint(chosen, [plates[k] for k in kept]), chosen)
    values, axes = np.linalg.eigh(joint.covariance)
    factor = axes * np.sqrt(values.clip(min=0.0))
    for place, k in enumerate(kept):
        here = joint.of(place)
        found[k] = joint.value[here], factor[here]
    return found


def square_above(value: float, variance: float, most: float) -> float:
    """Return the mean square of what can only lie above 0, where an estimate lies below it.

    See `_without`; most: variance up to which one that contradicts its own is larger.
    """
    wider = max(variance, min(value**4 / variance, most))
    below = -value / math.sqrt(wider)
    if below > FAR_BELOW:
        return 2.0 * wider / below**2
    tail = math.sqrt(math.pi / 2.0) * math.erfc(below / math.sqrt(2.0))
    return wider * (1.0 + below**2 - below * math.exp(-0.5 * below**2) / tail)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Dimensions of N scans, one after the other: (3 N,), and their covariance."""

    value: Array
    covariance: Array

    def of(self, index: int) -> slice:
        """Return the places of a scan."""
        return slice(EACH * index, EACH * (index + 1))


def _joint(scans: Sequence[Dimensions], plates: Sequence[str]) -> _Joint:
    """Return the dimensions of scans by all of them."""
    weight = np.min([one.weight for one in scans], axis=0)
    mean = scans[int(np.argmin([one.weight[0] for one in scans]))].mean
    own = np.minimum(ALIKE**2, 1.0 / weight)
    same = np.array([[a == b for b in plates] for a in plates], float)
    before = np.kron(np.ones_like(same), np.diag(1.0 / weight - own)) + np.kron(same, np.diag(own))
    information, pull = np.zeros_like(before), np.zeros(len(before))
    for k, one in enumerate(scans):
        here = slice(EACH * k, EACH * (k + 1))
        information[here, here], pull[here] = _shown(one)
        pull[here] += information[here, here] @ (one.mean - mean)
    covariance = np.linalg.solve(np.eye(len(before)) + before @ information, before)
    covariance = (covariance + covariance.T) / 2.0
    return _Joint(np.tile(mean, len(scans)) + covariance @ pull, covariance)


def _shown(one: Dimensions) -> tuple[Array, Array]:
    """Return the information (3, 3) of a scan alone, and its pull (3,) from what was known."""
    known = np.linalg.inv(one.covariance)
    values, axes = np.linalg.eigh(known - np.diag(one.weight))
    return (axes * values.clip(min=0.0)) @ axes.T, known @ (one.value - one.mean)


def _least_alike(scans: Sequence[Dimensions], plates: Sequence[str]) -> int | None:
    """Return which scan is least like what the others show, where that is not by chance."""
    chances = []
    for k, one in enumerate(scans):
        others = [other for other in range(len(scans)) if other != k]
        blind = replace(one, covariance=np.diag(1.0 / one.weight), value=one.mean)
        order = [*(scans[other] for other in others), blind]
        joint = _joint(order, [*(plates[other] for other in others), plates[k]])
        here = joint.of(len(others))
        information, pull = _shown(one)
        off = pull - information @ (joint.value[here] - one.mean)
        scatter = information @ joint.covariance[here, here] @ information + information
        square = float(off @ np.linalg.pinv(scatter, hermitian=True) @ off)
        chances.append(chi_square_beyond(square, EACH))
    worst = int(np.argmin(chances))
    return worst if chances[worst] < UNLIKE else None


def _above_zero(joint: _Joint, scans: Sequence[Dimensions]) -> _Joint:
    """Return the dimensions where no chamfer is below 0: one after the other is held there."""
    value, covariance = joint.value, joint.covariance
    for k, one in enumerate(scans):
        place = EACH * k + LAST
        if value[place] >= 0.0:
            continue
        variance = float(covariance[place, place])
        left = square_above(float(value[place]), variance, 1.0 / float(one.weight[LAST]))
        way = covariance[:, place] / variance
        value = value - value[place] * way
        covariance = covariance + (left - variance) * np.outer(way, way)
    return _Joint(value, covariance)
