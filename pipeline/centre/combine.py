"""Estimates of one centre by several methods: their agreement and their weighted mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..uncertainty import f_beyond, least_squares, scatter_beyond
from ..vectors import Array
from .in_plane_rotation import PlaneRotation, combined_rotation

CentreMethod = Literal[
    "rim", "outline", "hole", "holes", "pattern", "combined", "points", "flange", "tyre"
]
DISAGREE = 1e-4  # probability of a difference as large, below which two centres disagree
UNLIKELY = 0.05  # the same, below which what they differ by is in their uncertainties


@frozen(eq=False)
class CentreEstimate:
    """Centre by one method, in the plane's coordinates.

    centre_m: (2,). noise_m2: (2, 2) by its points, given the plane, with dof degrees of freedom;
    model_m2: (2, 2) by what its model leaves out. by_plane: (2, 3) see EdgeFit. rotation: of the
    target's axes in the plane, where this method shows it. doubtful: whether something that its
    model leaves out may set it apart from the others.
    """

    method: CentreMethod
    centre_m: Array
    noise_m2: Array
    model_m2: Array
    by_plane: Array
    dof: float
    rotation: PlaneRotation | None = None
    doubtful: bool = False

    @property
    def covariance_m2(self) -> Array:
        """Covariance (2, 2), given the plane."""
        return self.noise_m2 + self.model_m2


def check_agreement(estimates: Sequence[CentreEstimate], plane_covariance: Array) -> None:
    """Raise NotMeasuredError 'centres-disagree' where two differ beyond their uncertainties.

    Not where one is doubtful: then `reconciled` counts what they differ by.
    plane_covariance: (3, 3) of the plane's height at the centre and its slopes, which moves both.
    Hotelling's T^2 against Fisher's F with the lesser degrees of freedom.
    """
    sure = [one for one in estimates if not one.doubtful]
    for index, one in enumerate(sure):
        for other in sure[:index]:
            apart = one.centre_m - other.centre_m
            by_plane = one.by_plane - other.by_plane
            joint = (
                one.covariance_m2 + other.covariance_m2 + by_plane @ plane_covariance @ by_plane.T
            )
            square = float(apart @ np.linalg.solve(joint, apart))
            dof = min(one.dof, other.dof)
            if f_beyond(square / 2.0, 2, dof) < DISAGREE:
                u = math.sqrt(float(apart @ joint @ apart)) / max(float(np.hypot(*apart)), 1e-12)
                raise NotMeasuredError(
                    "centres-disagree",
                    f"the centres by {other.method} and by {one.method} lie "
                    f"{float(np.hypot(*apart)) * 1e3:.2f} mm apart, with a standard uncertainty "
                    f"of {u * 1e3:.2f} mm: check the sizes in the target's file, and the target",
                )


def reconciled(
    estimates: Sequence[CentreEstimate], plane_covariance: Array
) -> Sequence[CentreEstimate]:
    """Return estimates whose models are as uncertain as they differ, where that is more than u.

    By a variance alike for all at which the square of their differences is the expected one, where
    a larger one would come by chance in fewer than 5 %. plane_covariance: see check_agreement.
    """
    if len(estimates) == 1:
        return estimates
    count, by_plane = len(estimates), np.mean([e.by_plane for e in estimates], axis=0)
    covariance = np.zeros((2 * count, 2 * count))
    for k, one in enumerate(estimates):
        aside = one.by_plane - by_plane
        block = slice(2 * k, 2 * k + 2)
        covariance[block, block] = one.covariance_m2 + aside @ plane_covariance @ aside.T
    slopes, values = np.tile(np.eye(2), (count, 1)), np.concatenate([e.centre_m for e in estimates])
    square, dof = least_squares(slopes, values, covariance)[2], 2 * (count - 1)
    if f_beyond(square / dof, dof, min(e.dof for e in estimates)) > UNLIKELY:
        return estimates
    most = float(np.linalg.norm(values - slopes @ slopes.T @ values / count))
    variance_m2 = scatter_beyond(slopes, values, covariance, most) ** 2
    return [replace(e, model_m2=e.model_m2 + variance_m2 * np.eye(2)) for e in estimates]


def combined(
    estimates: Sequence[CentreEstimate], common_m2: tuple[Array, Array] | None = None
) -> CentreEstimate:
    """Return the mean weighted by inverse covariances: W_i = (sum C^-1)^-1 C_i^-1.

    common_m2: covariances (2, 2) of the second estimate with the first, of noise and of model: by
    what they share, the mean is less certain; where their errors oppose each other, as without.
    """
    if len(estimates) == 1:
        return estimates[0]
    inverses = [np.linalg.inv(e.covariance_m2) for e in estimates]
    total = np.linalg.inv(sum(inverses, np.zeros((2, 2))))
    weights = [total @ inverse for inverse in inverses]
    parts = list(zip(weights, estimates, strict=True))
    noises = [w @ e.noise_m2 @ w.T for w, e in parts]
    variances = [float(np.trace(noise)) for noise in noises]
    in_common = [np.zeros((2, 2))] * 2
    if common_m2 is not None:
        crossed = [weights[1] @ of_both @ weights[0].T for of_both in common_m2]
        in_common = [_positive(one + one.T) for one in crossed]
    welch = sum(s * s / e.dof for s, e in zip(variances, estimates, strict=True))
    return CentreEstimate(
        method="combined",
        centre_m=np.asarray(sum((w @ e.centre_m for w, e in parts), np.zeros(2))),
        noise_m2=np.asarray(sum(noises, in_common[0])),
        model_m2=np.asarray(sum((w @ e.model_m2 @ w.T for w, e in parts), in_common[1])),
        by_plane=np.asarray(sum((w @ e.by_plane for w, e in parts), np.zeros((2, 3)))),
        dof=sum(variances) ** 2 / welch if welch > 0.0 else math.inf,
        rotation=combined_rotation([e.rotation for e in estimates], weights),
    )


def _positive(covariance_m2: Array) -> Array:
    """Return a symmetric matrix (2, 2) without what it takes away along its axes."""
    values, axes = np.linalg.eigh(covariance_m2)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)
