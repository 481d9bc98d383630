"""One target by several stations: the mean of their fits, and by how much these differ.

Stations are registered with errors of their own, so that their fits scatter by more than the noise
of the points: x_i = x + r_i + e_i. For tilt, for the position along the normal and for that in the
plane, r has a variance s^2 of its own, and the weights are 1 / (s^2 + u_i^2). Where the fits hardly
show the position in the plane, it counts as uncertain as that along the normal.
Source: DerSimonian and Laird, Controlled Clinical Trials 7 (1986) 177.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..config import InstrumentConfig
from ..system import frozen
from ..uncertainty import UncertaintyComponent, chi_square_beyond
from ..vectors import Array, plane_basis
from .locate_centre import StationSpread, TargetFit

BY_CHANCE = 1e-4  # probability of differences as large, below which they are noted
SEEN_IN = 2.0  # directions, of tilt or in the plane, by which s^2 is estimated


def joined(fits: Sequence[TargetFit], instrument: InstrumentConfig) -> TargetFit:
    """Return the mean of the fits of several stations, the first being that with the most points.

    instrument: what it states of the stations' registration explains as much of the differences.
    """
    main = fits[0]
    if len(fits) == 1:
        return main
    sides = [float(np.sign(one.normal @ main.normal)) for one in fits]
    poses = np.stack(
        [np.append(side * one.normal, one.centre_m) for side, one in zip(sides, fits, strict=True)]
    )
    turn = (instrument.pointing_urad * 1e-6) ** 2
    shift = instrument.registration_m**2 + turn * instrument.distance_m**2
    along = np.append(np.zeros(3), main.normal)[None]
    tilt, aside = np.hsplit(np.eye(6), 2)
    axes = plane_basis(main.normal)[:2]
    scatters = [
        _Scatter.of(axes @ tilt.T, poses, fits, turn),
        _Scatter.of(along, poses, fits, shift),
        _Scatter.of(axes @ aside.T, poses, fits, shift),
    ]
    scatters[2] = scatters[2].at_least(scatters[1].between)
    parts = np.stack([s.seen.T @ s.seen for s in scatters])
    weight = np.stack([s.weight for s in scatters])
    weights = np.einsum("sn,sij->nij", weight, parts)
    roots = np.einsum("sn,sij->nij", np.sqrt(weight), parts)
    pose = poses[0] + np.einsum("nij,nj->i", weights, poses - poses[0])
    names = dict.fromkeys(part.name for one in fits for part in one.components)
    components = [
        _component(name, fits, roots if name == "flatness" else weights) for name in names
    ]
    factor = np.hstack([s.share * math.sqrt(s.between) * s.seen.T for s in scatters])
    if factor.any():
        components.append(UncertaintyComponent("stations", factor, SEEN_IN * (len(fits) - 1.0)))
    square = sum(s.square for s in scatters)
    chance = chi_square_beyond(square, (len(fits) - 1) * sum(len(s.seen) for s in scatters))
    return replace(
        main,
        normal=pose[:3] / np.linalg.norm(pose[:3]),
        centre_m=pose[3:],
        components=tuple(components),
        points_on_target=sum(one.points_on_target for one in fits),
        stations=StationSpread(
            count=len(fits),
            shift_m=_widest(poses[:, 3:]),
            tilt_rad=_widest(poses[:, :3]),
            significant=chance < BY_CHANCE,
            share=scatters[0].share,
        ),
    )


@frozen(eq=False)
class _Scatter:
    """Scatter of the fits' tilts, or of their positions along the normal or in the plane.

    seen: (d, 6) unit rows by which these are seen in a pose. own: (n,) variances of the fits, per
    row. between: variance s^2 of the stations. square: of their differences by `own`.
    """

    seen: Array
    own: Array
    between: float
    square: float

    @classmethod
    def of(cls, seen: Array, poses: Array, fits: Sequence[TargetFit], stated: float) -> _Scatter:
        """Return that of poses (n, 6), of which a file states a variance for every station."""
        own = np.array([np.trace(seen @ one.covariance @ seen.T) for one in fits]) / len(seen)
        own = (own + stated).clip(min=1e-40)
        weight = 1.0 / own
        values = poses @ seen.T
        off = values - weight @ values / weight.sum()
        square = float(weight @ np.sum(off**2, axis=1))
        excess = square / len(seen) - (len(fits) - 1)
        between = excess / float(weight.sum() - weight @ weight / weight.sum())
        return cls(seen, own, max(between, 0.0), square)

    def at_least(self, other: float) -> _Scatter:
        """Return it with as much of another variance as the fits' own hide."""
        hidden = float(np.mean(self.own))
        return replace(self, between=max(self.between, other * hidden / (other + hidden)))

    @property
    def weight(self) -> Array:
        """Weights (n,) of the fits."""
        weight = 1.0 / (self.own + self.between)
        return np.asarray(weight / weight.sum())

    @property
    def share(self) -> float:
        """Standard deviation of the mean of independent errors, one of each fit, by theirs."""
        return float(np.sqrt(self.weight @ self.weight))


def _component(name: str, fits: Sequence[TargetFit], weights: Array) -> UncertaintyComponent:
    """Return a component of the mean.

    weights: (n, 6, 6) of the fits; of a target's form, which is the same for all, their roots.
    """
    factors, turns, dof = [], [], math.inf
    for one, weight in zip(fits, weights, strict=True):
        for part in one.components:
            if part.name == name:
                factors.append(weight @ part.factor)
                own = part.turn if one is fits[0] else None
                turns.append(np.zeros(part.factor.shape[1]) if own is None else own)
                dof = min(dof, part.dof)
    turn = None if fits[0].turn is None else np.concatenate(turns)
    return UncertaintyComponent(name, np.hstack(factors), dof, turn=turn)


def _widest(vectors: Array) -> float:
    """Return the largest distance between two of vectors (n, 3)."""
    return max(float(np.linalg.norm(one - other)) for one in vectors for other in vectors)
