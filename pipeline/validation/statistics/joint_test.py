"""Tests of differences with their uncertainty: each on its own, and all jointly."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...system import frozen
from ...uncertainty import Effect, coverage_factor, f_beyond
from ...vectors import Array
from .power import CONFIDENCE, detectable_alone, detectable_jointly

RANK = 1e-9  # of the largest eigenvalue, below which a direction has no uncertainty of its own


@frozen
class ErrorSource:
    """Source of uncertainty common to several inputs, with `dof` degrees of freedom.

    factor: (k inputs, m); its covariance is factor @ factor.T.
    """

    factor: Array
    dof: float


def sources_of(effects: Sequence[Effect]) -> list[ErrorSource]:
    """Merge effects that were estimated together, and those of infinite degrees of freedom."""
    groups: dict[object, list[Effect]] = {}
    for index, effect in enumerate(effects):
        key: object = effect.name if effect.pooled else index
        groups.setdefault(None if math.isinf(effect.dof) else key, []).append(effect)
    return [
        ErrorSource(np.hstack([effect.factor for effect in group]), group[0].dof)
        for group in groups.values()
    ]


@frozen
class JointTest:
    """Joint test of all differences: d' V^-1 d against its distribution.

    count: number of directions compared. dof: effective degrees of freedom of V.
    probability: p-value, where both methods are correct.
    """

    chi_square: float
    count: int
    dof: float
    probability: float

    @property
    def agrees(self) -> bool:
        """Whether the differences agree at 95 % confidence."""
        return self.probability >= 1.0 - CONFIDENCE


@frozen
class Spread:
    """Covariance (q, q) of q differences, its parts by source and their degrees of freedom."""

    parts: tuple[Array, ...]
    dofs: tuple[float, ...]

    @classmethod
    def of(cls, slopes: Array, sources: Sequence[ErrorSource]) -> Spread:
        """Propagate the sources, with the derivatives `slopes` (q, k) by their inputs."""
        moved = [slopes @ source.factor for source in sources]
        parts = tuple(m @ m.T for m in moved) or (np.zeros((len(slopes), len(slopes))),)
        return cls(parts, tuple(source.dof for source in sources) or (math.inf,))

    @property
    def covariance(self) -> Array:
        """(q, q) sum of the parts."""
        return np.asarray(sum(self.parts[1:], self.parts[0]))

    @property
    def u(self) -> Array:
        """(q,) standard uncertainties."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def dof(self) -> Array:
        """(q,) effective degrees of freedom: Welch and Satterthwaite (JCGM 100, G.4)."""
        fourths = sum(
            (np.diag(part) ** 2 / f for part, f in zip(self.parts, self.dofs, strict=True)),
            np.zeros(len(self.parts[0])),
        )
        total = np.diag(self.covariance) ** 2
        return np.where(fourths > 0.0, total / np.where(fourths > 0.0, fourths, 1.0), math.inf)

    @property
    def expanded(self) -> Array:
        """(q,) half widths of the 95 % intervals."""
        return coverage_factor(CONFIDENCE, self.dof) * self.u

    @property
    def detectable(self) -> Array:
        """(q,) smallest error of each detectable by its own test."""
        return np.array([detectable_alone(u, f) for u, f in zip(self.u, self.dof, strict=True)])

    def test(self, difference: Array) -> JointTest:
        """Test all q differences jointly.

        With one scale of V estimated, d' V^-1 d / p has Fisher's distribution exactly; with several
        it is approximated with nu = (p + p^2) / sum (tr P_i^2 + (tr P_i)^2) / nu_i, P_i the share
        of a source in V. Source: Krishnamoorthy and Yu, Statistics & Probability Letters 66 (2004)
        161, for a scale in place of a covariance matrix.
        """
        whiten = self._whiten()
        count = len(whiten)
        square = float(np.sum((whiten @ difference) ** 2))
        dof = self._joint_dof(whiten)
        beyond = f_beyond(square / count, count, dof) if count else 1.0
        return JointTest(square, count, dof, beyond)

    def detectable_jointly(self, patterns: Array) -> float:
        """Return the smallest detectable size of an error of any of the patterns (q, r)."""
        whiten = self._whiten()
        gain = float(np.sum((whiten @ patterns) ** 2, axis=0).min())
        return detectable_jointly(gain, len(whiten), self._joint_dof(whiten))

    def _whiten(self) -> Array:
        """Return the map (p, q) from the differences to unit covariance, where they have any."""
        scale = np.where(self.u > 0.0, self.u, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        positive = values > RANK * max(float(values.max(initial=0.0)), 1e-300)
        return np.asarray((vectors[:, positive] / np.sqrt(values[positive])).T / scale)

    def _joint_dof(self, whiten: Array) -> float:
        count, total = len(whiten), 0.0
        for part, dof in zip(self.parts, self.dofs, strict=True):
            share = whiten @ part @ whiten.T
            total += (float(np.sum(share**2)) + float(np.trace(share)) ** 2) / dof
        return (count + count**2) / total if total > 0.0 else math.inf
