"""Angles from observations: four centres define the frame, normals in it the angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..uncertainty import AngleUncertainty, UncertainTarget, monte_carlo, propagate
from ..vectors import Array
from ..vehicle import (
    REFERENCE_WHEELS,
    VehicleFrame,
    build_reference_frame,
    nearest_wheel,
    outward_normal,
    wheel_angles,
)
from .records import Measurement, Observation, Provenance, WheelResult
from .repeatability import share_components


def align(
    observations: Sequence[Observation], provenance: Provenance, notes: Iterable[str] = ()
) -> Measurement:
    """Evaluate all observations; the first four are RR, RL, FR, FL and were measured.

    A trial that belongs to no wheel gets a status. Raises InputError where the four centres define
    no frame.
    """
    centres = np.stack([observation.fitted.centre_m for observation in observations[:4]])
    try:
        frame = build_reference_frame(centres)
    except InputError as error:
        raise InputError(f"{provenance.source}: {error}") from error
    observations = share_components([_on_a_wheel(one, centres) for one in observations])
    measured = [one for one in observations if one.evidence is not None]
    notes = (*notes, *_upside_down(frame, measured), *_far_from_their_wheel(measured, centres))
    return evaluate(observations, [one.fitted for one in measured], provenance, notes)


def evaluate(
    observations: Sequence[Observation],
    poses: Sequence[UncertainTarget],
    provenance: Provenance,
    notes: tuple[str, ...],
) -> Measurement:
    """Evaluate the angles of observations from the pose of each measured one, in their order.

    The first four observations are RR, RL, FR, FL; the centres of their poses define the frame.
    """
    frame = build_reference_frame(np.stack([pose.centre_m for pose in poses[:4]]))
    measured = [one for one in observations if one.evidence is not None]
    uncertainty = propagate(poses, [one.wheel for one in measured if one.wheel is not None])
    results = {
        observation.name: _result(observation, pose, frame, uncertainty, index)
        for index, (observation, pose) in enumerate(zip(measured, poses, strict=True))
    }
    return Measurement(
        wheels=tuple(results.get(o.name) or WheelResult(o, o.wheel) for o in observations),
        frame=frame,
        uncertainty=uncertainty,
        provenance=provenance,
        notes=notes,
    )


def check_by_monte_carlo(measurement: Measurement, max_draws: int, seed: int) -> Measurement:
    """Return the measurement with a check of its uncertainties by at most `max_draws` draws."""
    measured = [wheel for wheel in measurement.wheels if wheel.angles is not None]
    drawn = monte_carlo(
        [wheel.pose for wheel in measured if wheel.pose is not None],
        [wheel.wheel for wheel in measured if wheel.wheel is not None],
        measurement.uncertainty,
        max_draws,
        seed,
    )
    return replace(measurement, monte_carlo=drawn)


def _result(
    observation: Observation,
    pose: UncertainTarget,
    frame: VehicleFrame,
    uncertainty: AngleUncertainty,
    index: int,
) -> WheelResult:
    wheel, dof = str(observation.wheel), uncertainty.wheel_dof(index)
    return WheelResult(
        observation=observation,
        wheel=wheel,
        pose=pose,
        angles=wheel_angles(frame, pose.normal, wheel),
        normal=outward_normal(frame, pose.normal, wheel),
        u_toe_rad=float(uncertainty.toe_rad[index]),
        u_camber_rad=float(uncertainty.camber_rad[index]),
        u_camber_iso_rad=float(uncertainty.camber_iso_rad[index]),
        dof_toe=dof["dof_toe"],
        dof_camber=dof["dof_camber"],
        dof_camber_iso=dof["dof_camber_iso"],
    )


def _upside_down(frame: VehicleFrame, measured: Sequence[Observation]) -> list[str]:
    """Return a note where the vehicle is upside down, if z points up in the scans."""
    scanned = measured[0].fitted.method != "points"  # a five-point file has its own note
    if not scanned or frame.up[2] > -0.5:
        return []
    return [
        f"The vehicle's up direction is opposite to z ({frame.up[2]:+.2f}): if z points up, left "
        "and right, or front and rear, are exchanged: check the order "
        f"{', '.join(REFERENCE_WHEELS)}."
    ]


def _far_from_their_wheel(measured: Sequence[Observation], centres: Array) -> list[str]:
    """Return a note for every trial that is named for one wheel but lies at another."""
    notes = []
    for observation in measured[4:]:
        distance_m = np.linalg.norm(centres - observation.fitted.centre_m, axis=1)
        nearest = REFERENCE_WHEELS[int(np.argmin(distance_m))]
        if observation.wheel in REFERENCE_WHEELS and observation.wheel != nearest:
            named_m = distance_m[REFERENCE_WHEELS.index(observation.wheel)]
            notes.append(
                f"Trial {observation.name} is named for {observation.wheel}, {named_m:.3f} m from "
                f"it, but lies {distance_m.min():.3f} m from {nearest}: check its wheel."
            )
    return notes


def _on_a_wheel(observation: Observation, centres: Array) -> Observation:
    """Return the observation with its wheel: as named, else the nearest; no-wheel if near none."""
    if observation.wheel is not None or observation.evidence is None:
        return observation
    try:
        return replace(observation, wheel=nearest_wheel(centres, observation.fitted.centre_m))
    except InputError as error:
        return replace(observation, evidence=None, status="no-wheel", reason=str(error))
