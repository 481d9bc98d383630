"""Uncertainty components of a target's normal and centre: one record, one builder for each kind.

A component moves the normal by a small vector (rad) and the centre by another (m), both in scanner
coordinates; six numbers, the normal's first. Type A components are estimated from the scatter of
the points, type B components are stated in the target's and the scanner's files.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from ..system import frozen
from ..vectors import Array


@frozen
class UncertaintyComponent:
    """One line of the uncertainty budget, for one target.

    factor: (6, k); k independent unit variables act through its columns, so that its covariance is
    factor @ factor.T. dof: degrees of freedom; infinite for type B. shared: components of several
    targets with the same name and key are fully correlated, column by column; None: independent of
    other targets. pooled: its size was estimated once, from all targets together. turn: (k,)
    in-plane rotation of the target, rad, where it is observed.
    """

    name: str
    factor: Array
    dof: float = math.inf
    shared: str | None = None
    pooled: bool = False
    turn: Array | None = None

    @property
    def covariance(self) -> Array:
        """Covariance (6, 6) of the normal (rad), then the centre (m)."""
        return np.asarray(self.factor @ self.factor.T)


class UncertainTarget(Protocol):
    """A plane and a centre whose uncertainty is propagated; scanner coordinates.

    centre_m: (3,). normal: (3,) unit. components: of their uncertainty.
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
    """Return the component of a fitted plane.

    covariance: (3, 3) of its height (m) at the centroid and its slopes along basis[0], basis[1].
    lever_m: (3,) from the centroid to the centre, which moves along the normal with the plane.
    by_plane: (2, 3) derivatives of the centre in the plane by the height at the centre and the
    slopes (see EdgeFit); turn_by_plane: (3,) those of the target's in-plane rotation.
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
    """Return the component of a centre's position in its plane.

    covariance: (2, 2) along basis[0] and basis[1], m^2; or (3, 3) of position and in-plane rotation
    (rad) where the target shows its rotation.
    """
    root = _root(covariance)
    factor = np.vstack([np.zeros((3, len(root))), basis[:2].T @ root[:2]])
    return UncertaintyComponent(name, factor, dof, turn=root[2] if len(root) > 2 else None)


def flatness_component(flatness_m: float, half_m: float, normal: Array) -> UncertaintyComponent:
    """Return the component of a target's form: it lies between two planes flatness_m apart.

    The tilt of its least-squares plane is distributed uniformly up to flatness/diameter, whose
    standard uncertainty per axis is half of that; the mean of a smooth form is within a tenth.
    half_m: radius; of a face that is w wide and h high, sqrt(w h)/2, by which smooth forms of
    boards of up to 3:1 tilt by 0.7 to 1.1 of it along either side.
    """
    tilt, height = flatness_m / (4.0 * half_m), flatness_m / 10.0
    factor = np.zeros((6, 4))
    factor[:3, :3] = tilt * _across(normal)
    factor[3:, 3] = height * normal
    return UncertaintyComponent("flatness", factor)


def mounting_component(tilt_rad: float, shift_m: float, normal: Array) -> UncertaintyComponent:
    """Return the component of mounting repeatability; standard deviations per axis."""
    factor = np.zeros((6, 6))
    factor[:3, :3] = tilt_rad * _across(normal)
    factor[3:, 3:] = shift_m * _across(normal)
    return UncertaintyComponent("clamp", factor)


def range_bias_component(bias_m: float, sight_m: Array, normal: Array) -> UncertaintyComponent:
    """Return the component of a range bias that is the same for all points of all scans.

    sight_m: (3,) from the scanner to the centre. Points move along their beams d; these diverge, so
    that the height b n.d has the slope -b (n.d) d_across / distance.
    """
    distance = float(np.linalg.norm(sight_m))
    d = sight_m / distance
    tilt = (normal @ d) * (_across(normal) @ d) / distance
    return UncertaintyComponent(
        "range bias", bias_m * np.concatenate([tilt, d])[:, None], shared="scanner"
    )


def brightness_component(level_m: float, sight_m: Array, normal: Array) -> UncertaintyComponent:
    """Return the component of ranges that are all off by level_m, as their steps by brightness are.

    level_m: signed; of the same sign, scans share it, since the scanner is the same.
    """
    found = range_bias_component(level_m, sight_m, normal)
    return replace(found, name="brightness", shared="brightness")


def distance_component(pull_m: float, normal: Array) -> UncertaintyComponent:
    """Return the component of a plane that a least distance between points may pull by pull_m.

    pull_m: signed, towards the scanner; scans share it, since what thinned them is the same.
    """
    factor = np.concatenate([np.zeros(3), pull_m * normal])[:, None]
    return UncertaintyComponent("thinning", factor, shared="thinning")


def pointing_component(
    angle_rad: float, sight_m: Array, normal: Array, station: str | None = None
) -> UncertaintyComponent:
    """Return the component of a station rotated about its scanner, by angle_rad per axis (k = 1).

    station: shared by the scans of that name; None: one scan alone.
    """
    rotations = angle_rad * np.eye(3)
    moved = np.vstack([np.cross(rotations, normal).T, np.cross(rotations, sight_m).T])
    return UncertaintyComponent("pointing", moved, shared=station, turn=rotations @ normal)


def registration_component(shift_m: float, station: str | None = None) -> UncertaintyComponent:
    """Return the component of a station shifted against the others, by shift_m per axis (k = 1)."""
    factor = np.vstack([np.zeros((3, 3)), shift_m * np.eye(3)])
    return UncertaintyComponent("registration", factor, shared=station)


def vertical_component(name: str, normal: Array, tilt: Array, dof: float) -> UncertaintyComponent:
    """Return the component of a vertical, whose unit vector moves by the columns of tilt (3, k)."""
    across = _across(normal) @ tilt
    return UncertaintyComponent(name, np.vstack([across, np.zeros_like(across)]), dof)


def _across(normal: Array) -> Array:
    """Return the projection (3, 3) onto the plane across the normal."""
    return np.asarray(np.eye(3) - np.outer(normal, normal))


def _root(covariance: Array) -> Array:
    """Return a matrix F with F F^T = covariance, which may be singular."""
    scale = np.sqrt(np.diag(covariance).clip(min=1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(values.clip(min=0.0)))
