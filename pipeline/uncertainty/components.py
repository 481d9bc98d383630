"""What makes a target's normal and centre uncertain: one record a cause, one builder a kind.

A cause moves the normal by a small vector (rad) and the centre by another (m), both in scanner
coordinates; six numbers, the normal's first. Type A causes come from the scatter of the points,
type B from what the target's and the scanner's files state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..vectors import Array


@dataclass(frozen=True)
class UncertaintyComponent:
    """One line of the budget, for one target.

    factor: (6, k); k independent unit variables act through its columns, so that its covariance is
    factor @ factor.T. freedom: degrees of freedom behind it; infinite for type B.
    shared: causes of several targets with the same name and the same key are one and the same
    effect, column by column; None is this target's alone. pooled: its size was estimated once, from
    all targets together. turn: (k,) of the face about its normal, rad, where that is seen.
    """

    name: str
    factor: Array
    dof: float = math.inf
    shared: str | None = None
    pooled: bool = False
    turn: Array | None = None

    @property
    def covariance(self) -> Array:
        """(6, 6) of the normal (rad), then the centre (m)."""
        return np.asarray(self.factor @ self.factor.T)


class UncertainTarget(Protocol):
    """A plane and a centre whose uncertainty is propagated; scanner coordinates.

    centre_m: (3,). normal: (3,) unit. causes: of the uncertainty of both.
    """

    @property
    def centre_m(self) -> Array: ...  # noqa: D102
    @property
    def normal(self) -> Array: ...  # noqa: D102
    @property
    def components(self) -> tuple[UncertaintyComponent, ...]: ...  # noqa: D102


def plane_component(
    name: str,
    covariance: Array,
    basis: Array,
    lever_m: Array,
    by_plane: Array | None = None,
    dof: float = math.inf,
    turn_by_plane: Array | None = None,
) -> UncertaintyComponent:
    """Of a fitted plane.

    covariance: (3, 3) of its height (m) at the centroid and its slopes along basis[0], basis[1].
    lever_m: (3,) from the centroid to the centre, which moves along the normal with the plane;
    by_plane: (2, 3) and within it, by the height at the centre and the slopes (see rim.RimFit);
    turn_by_plane: (3,) how the face's turn goes with the same.
    """
    at_centre = _root(covariance)
    at_centre[0] += (basis[:2] @ lever_m) @ at_centre[1:]
    moved = np.outer(basis[2], at_centre[0])
    if by_plane is not None:
        moved += basis[:2].T @ by_plane @ at_centre
    turn = None if turn_by_plane is None else turn_by_plane @ at_centre
    return UncertaintyComponent(
        name, np.vstack([-basis[:2].T @ at_centre[1:], moved]), dof, turn=turn
    )


def centre_component(
    name: str, covariance: Array, basis: Array, dof: float = math.inf
) -> UncertaintyComponent:
    """Of a centre's place in its plane, along basis[0] and basis[1]: covariance (2, 2), m^2.

    Of place and turn (3, 3) where the face shows its turn about the normal, rad.
    """
    root = _root(covariance)
    factor = np.vstack([np.zeros((3, len(root))), basis[:2].T @ root[:2]])
    return UncertaintyComponent(name, factor, dof, turn=root[2] if len(root) > 2 else None)


def flatness_component(flatness_m: float, radius_m: float, normal: Array) -> UncertaintyComponent:
    """Of a face that lies between two planes flatness_m apart, its form unknown.

    Its least-squares plane may lean by any tilt up to flatness/diameter, all alike, which is half
    of that per axis as a standard uncertainty; the mean of a smooth form stays within a tenth.
    """
    tilt, height = flatness_m / (4.0 * radius_m), flatness_m / 10.0
    factor = np.zeros((6, 4))
    factor[:3, :3] = tilt * _across(normal)
    factor[3:, 3] = height * normal
    return UncertaintyComponent("flatness", factor)


def mounting_component(tilt_rad: float, shift_m: float, normal: Array) -> UncertaintyComponent:
    """Of taking the target off and putting it on again; standard deviations per axis."""
    factor = np.zeros((6, 6))
    factor[:3, :3] = tilt_rad * _across(normal)
    factor[3:, 3:] = shift_m * _across(normal)
    return UncertaintyComponent("clamp", factor)


def range_bias_component(bias_m: float, sight_m: Array, normal: Array) -> UncertaintyComponent:
    """Of a range that is longer by the same for all points of all scans.

    sight_m: (3,) from the scanner to the centre. Points move along their beams d; these fan out, so
    that the height b n.d has the slope -b (n.d) d_across / distance.
    """
    distance = float(np.linalg.norm(sight_m))
    d = sight_m / distance
    tilt = (normal @ d) * (_across(normal) @ d) / distance
    return UncertaintyComponent(
        "range bias", bias_m * np.concatenate([tilt, d])[:, None], shared="scanner"
    )


def pointing_component(angle_rad: float, sight_m: Array, normal: Array) -> UncertaintyComponent:
    """Of a scan that is turned about the scanner, by angle_rad about each axis (k = 1)."""
    turns = angle_rad * np.eye(3)
    moved = np.vstack([np.cross(turns, normal).T, np.cross(turns, sight_m).T])
    return UncertaintyComponent("pointing", moved, turn=turns @ normal)


def registration_component(shift_m: float) -> UncertaintyComponent:
    """Of a scan that is shifted against the others, by shift_m along each axis (k = 1)."""
    return UncertaintyComponent("registration", np.vstack([np.zeros((3, 3)), shift_m * np.eye(3)]))


def _across(normal: Array) -> Array:
    """(3, 3): leaves of a vector what lies in the plane."""
    return np.asarray(np.eye(3) - np.outer(normal, normal))


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance, which may be singular."""
    scale = np.sqrt(np.diag(covariance).clip(min=1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(values.clip(min=0.0)))
