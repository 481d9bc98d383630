"""Several ways to one centre: whether they agree, and what they say together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import NotMeasuredError
from ..uncertainty import f_beyond
from ..vectors import Array
from .in_plane_rotation import PlaneTurn, combined_rotation

Method = Literal["rim", "outline", "hole", "holes", "pattern", "combined", "points"]
DISAGREE = 1e-4  # chance of a difference as large, below which two centres disagree


@dataclass(frozen=True)
class Estimate:
    """One way to the centre, in the plane's coordinates.

    centre_m: (2,). noise_m2: (2, 2) by its points, of a plane without error, with its freedom;
    model_m2: (2, 2) by what its model leaves out. by_plane: (2, 3) see rim.RimFit. turn: of the
    target's axes, where this way shows it.
    """

    method: Method
    centre_m: Array
    noise_m2: Array
    model_m2: Array
    by_plane: Array
    dof: float
    turn: PlaneTurn | None = None

    @property
    def covariance_m2(self) -> Array:
        """(2, 2), of a plane without error."""
        return self.noise_m2 + self.model_m2


def check_agreement(estimates: Sequence[Estimate], plane_covariance: Array) -> None:
    """Raise NotMeasuredError 'centres-disagree' where two differ beyond their uncertainties.

    plane_covariance: (3, 3) of the plane's height at the centre and its slopes, which moves both.
    Hotelling's T^2 against Fisher's F of the lesser freedom.
    """
    for index, one in enumerate(estimates):
        for other in estimates[:index]:
            apart = one.centre_m - other.centre_m
            lean = one.by_plane - other.by_plane
            joint = one.covariance_m2 + other.covariance_m2 + lean @ plane_covariance @ lean.T
            square = float(apart @ np.linalg.solve(joint, apart))
            dof = min(one.dof, other.dof)
            if f_beyond(square / 2.0, 2, dof) < DISAGREE:
                u = math.sqrt(float(apart @ joint @ apart)) / max(float(np.hypot(*apart)), 1e-12)
                raise NotMeasuredError(
                    "centres-disagree",
                    f"the centres by {other.method} and by {one.method} lie "
                    f"{float(np.hypot(*apart)) * 1e3:.2f} mm apart, where {u * 1e3:.2f} mm (k = 1) "
                    "can be expected: check the sizes in the target's file, and the plate",
                )


def combined(estimates: Sequence[Estimate]) -> Estimate:
    """Their mean, each weighted by the inverse of its covariance: W_i = (sum C^-1)^-1 C_i^-1."""
    if len(estimates) == 1:
        return estimates[0]
    inverses = [np.linalg.inv(e.covariance_m2) for e in estimates]
    total = np.linalg.inv(sum(inverses, np.zeros((2, 2))))
    weights = [total @ inverse for inverse in inverses]
    parts = list(zip(weights, estimates, strict=True))
    noises = [w @ e.noise_m2 @ w.T for w, e in parts]
    shares = [float(np.trace(noise)) for noise in noises]
    unsure = sum(s * s / e.dof for s, e in zip(shares, estimates, strict=True))
    return Estimate(
        method="combined",
        centre_m=np.asarray(sum((w @ e.centre_m for w, e in parts), np.zeros(2))),
        noise_m2=np.asarray(sum(noises, np.zeros((2, 2)))),
        model_m2=np.asarray(sum((w @ e.model_m2 @ w.T for w, e in parts), np.zeros((2, 2)))),
        by_plane=np.asarray(sum((w @ e.by_plane for w, e in parts), np.zeros((2, 3)))),
        dof=sum(shares) ** 2 / unsure if unsure > 0.0 else math.inf,
        turn=combined_rotation([e.turn for e in estimates], weights),
    )
