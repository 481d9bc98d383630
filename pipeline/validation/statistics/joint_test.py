"""Differences with the causes of their uncertainty: one by one, and all together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...uncertainty import Effect, coverage_factor, f_beyond
from ...vectors import Array
from .power import CONFIDENCE, visible_alone, visible_jointly

RANK = 1e-9  # of the largest eigenvalue, below which a direction has no uncertainty of its own


@dataclass(frozen=True)
class Source:
    """What makes several values uncertain at once, its size known to `freedom` degrees.

    factor: (k inputs, m); its covariance is factor @ factor.T.
    """

    factor: Array
    dof: float


def sources_of(effects: Sequence[Effect]) -> list[Source]:
    """Effects whose size was estimated together, or is known, brought together."""
    groups: dict[object, list[Effect]] = {}
    for index, effect in enumerate(effects):
        key: object = effect.name if effect.pooled else index
        groups.setdefault(None if math.isinf(effect.dof) else key, []).append(effect)
    return [
        Source(np.hstack([effect.factor for effect in group]), group[0].dof)
        for group in groups.values()
    ]


@dataclass(frozen=True)
class JointTest:
    """Whether all differences are within their uncertainty: d' V^-1 d against its distribution.

    count: of directions compared. freedom: effective degrees of freedom of V.
    probability: of as much or more, where both methods are right.
    """

    chi_square: float
    count: int
    dof: float
    probability: float

    @property
    def agrees(self) -> bool:
        """At 95 % confidence."""
        return self.probability >= 1.0 - CONFIDENCE


@dataclass(frozen=True)
class Spread:
    """Covariance (q, q) of q differences, and its parts by source with their freedom."""

    parts: tuple[Array, ...]
    dofs: tuple[float, ...]

    @classmethod
    def of(cls, slopes: Array, sources: Sequence[Source]) -> Spread:
        """Of what has the derivatives `slopes` (q, k) by the inputs that the sources move."""
        moved = [slopes @ source.factor for source in sources]
        parts = tuple(m @ m.T for m in moved) or (np.zeros((len(slopes), len(slopes))),)
        return cls(parts, tuple(source.dof for source in sources) or (math.inf,))

    @property
    def covariance(self) -> Array:
        """(q, q)."""
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
    def visible(self) -> Array:
        """(q,) smallest error of each that its own test would see."""
        return np.array([visible_alone(u, f) for u, f in zip(self.u, self.dof, strict=True)])

    def test(self, difference: Array) -> JointTest:
        """Of all q differences together.

        With one scale of V estimated, d' V^-1 d / p has Fisher's distribution exactly; with several
        it is matched by tr: nu = (p + p^2) / sum (tr P_i^2 + (tr P_i)^2) / nu_i, P_i the share of a
        source in V. Source: Krishnamoorthy and Yu, Statistics & Probability Letters 66 (2004) 161,
        for a scale in the place of a covariance matrix.
        """
        whiten = self._whiten()
        count = len(whiten)
        square = float(np.sum((whiten @ difference) ** 2))
        dof = self._joint_dof(whiten)
        beyond = f_beyond(square / count, count, dof) if count else 1.0
        return JointTest(square, count, dof, beyond)

    def visible_jointly(self, patterns: Array) -> float:
        """Smallest size at which the joint test sees an error of any of the patterns (q, r)."""
        whiten = self._whiten()
        gain = float(np.sum((whiten @ patterns) ** 2, axis=0).min())
        return visible_jointly(gain, len(whiten), self._joint_dof(whiten))

    def _whiten(self) -> Array:
        """(p, q): brings the differences to unit covariance, where they have any."""
        scale = np.where(self.u > 0.0, self.u, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        there = values > RANK * max(float(values.max(initial=0.0)), 1e-300)
        return np.asarray((vectors[:, there] / np.sqrt(values[there])).T / scale)

    def _joint_dof(self, whiten: Array) -> float:
        count, total = len(whiten), 0.0
        for part, dof in zip(self.parts, self.dofs, strict=True):
            share = whiten @ part @ whiten.T
            total += (float(np.sum(share**2)) + float(np.trace(share)) ** 2) / dof
        return (count + count**2) / total if total > 0.0 else math.inf
