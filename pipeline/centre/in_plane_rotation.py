"""How a target lies turned about its own normal, as its edges or its print show it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..vectors import Array

Mark = Literal["edges", "print"]


@dataclass(frozen=True)
class PlaneTurn:
    """The turn of a target's axes against those of a plane, by one way to it.

    mark: what shows it. period_rad: by which a turn leaves the mark as it is. noise: (3,)
    covariances of its noise with that of the centre along u and v (m rad), and with itself (rad^2).
    model_rad2: variance by what its model leaves out. by_plane: (3,) how it goes with the plane's
    height at the centre, and with its slopes.
    """

    mark: Mark
    angle_rad: float
    period_rad: float
    noise: Array
    model_rad2: float
    by_plane: Array

    def with_noise(self, centre_m2: Array) -> Array:
        """Covariance (3, 3) of the centre's noise (2, 2) and the turn's."""
        beside = self.noise[:2]
        return np.block([[centre_m2, beside[:, None]], [beside[None], self.noise[2:, None]]])

    def with_model(self, centre_m2: Array) -> Array:
        """Covariance (3, 3) of what the models of centre (2, 2) and turn leave out."""
        none = np.zeros((2, 1))
        return np.block([[centre_m2, none], [none.T, np.array([[self.model_rad2]])]])

    def in_scan(self, basis: Array) -> InPlaneRotation:
        """The axis as it lies in the scan, by the plane's axes (3, 3)."""
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return InPlaneRotation(self.mark, c * basis[0] + s * basis[1], self.period_rad)


@dataclass(frozen=True)
class InPlaneRotation:
    """A target's axis u in the scan (3,), unit, as good as any that a turn by period_rad makes.

    mark: what shows it; the print's axis may lie turned on a board against the edges'.
    """

    mark: Mark
    axis: Array
    period_rad: float


def combined_rotation(
    turns: Sequence[PlaneTurn | None], weights: Sequence[Array]
) -> PlaneTurn | None:
    """Of the print where it is seen, else of all edges, weighted by their inverse variances.

    weights: (2, 2) that the centre of each way has in the common centre.
    """
    told = [(t, W) for t, W in zip(turns, weights, strict=True) if t is not None]
    printed = [(t, W) for t, W in told if t.mark == "print"]
    told = printed or told
    if not told:
        return None
    inverse = np.array([1.0 / (t.noise[2] + t.model_rad2) for t, _ in told])
    share = inverse / inverse.sum()
    first = told[0][0]
    parts = list(zip(share, told, strict=True))
    with_centre = sum((s * (W @ t.noise[:2]) for s, (t, W) in parts), np.zeros(2))
    variance = sum(s * s * float(t.noise[2]) for s, (t, _) in parts)
    return PlaneTurn(
        mark=first.mark,
        angle_rad=sum(s * t.angle_rad for s, (t, _) in parts),
        period_rad=max(t.period_rad for t, _ in told),
        noise=np.array([*with_centre, variance]),
        model_rad2=sum(s * s * t.model_rad2 for s, (t, _) in parts),
        by_plane=np.asarray(sum((s * t.by_plane for s, (t, _) in parts), np.zeros(3))),
    )
