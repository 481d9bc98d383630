"""The common core: four centres make the frame, the normals in it make the angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..uncertainty import monte_carlo, propagate
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
from .repeatability import share_plates


def align(
    observations: Sequence[Observation], provenance: Provenance, notes: Iterable[str] = ()
) -> Measurement:
    """Angles of all observations; the first four are RR, RL, FR, FL and were measured.

    A trial that belongs to no wheel gets a status. Raises InputError where the four centres define
    no frame.
    """
    centres = np.stack([seen.fitted.centre_m for seen in observations[:4]])
    try:
        frame = build_reference_frame(centres)
    except InputError as error:
        raise InputError(f"{provenance.source}: {error}") from error
    observations = share_plates([_on_a_wheel(seen, centres) for seen in observations])
    measured = [seen for seen in observations if seen.evidence is not None]
    wheels = [seen.wheel for seen in measured if seen.wheel is not None]
    angles = [
        wheel_angles(frame, seen.fitted.normal, wheel)
        for seen, wheel in zip(measured, wheels, strict=True)
    ]
    uncertainty = propagate([seen.fitted for seen in measured], wheels)
    results = {
        seen.name: WheelResult(
            observation=seen,
            wheel=wheel,
            angles=angle,
            normal=outward_normal(frame, seen.fitted.normal, wheel),
            u_toe_rad=float(uncertainty.toe_rad[index]),
            u_camber_rad=float(uncertainty.camber_rad[index]),
            u_camber_iso_rad=float(uncertainty.camber_iso_rad[index]),
            **uncertainty.wheel_dof(index),
        )
        for index, (seen, wheel, angle) in enumerate(zip(measured, wheels, angles, strict=True))
    }
    return Measurement(
        wheels=tuple(results.get(s.name) or WheelResult(s, s.wheel) for s in observations),
        frame=frame,
        uncertainty=uncertainty,
        provenance=provenance,
        notes=(*notes, *_upside_down(frame, measured), *_far_from_their_wheel(measured, centres)),
    )


def check_by_monte_carlo(measurement: Measurement, max_trials: int, seed: int) -> Measurement:
    """The measurement with its uncertainties worked out once more, by at most max_trials draws."""
    measured = [wheel for wheel in measurement.wheels if wheel.angles is not None]
    drawn = monte_carlo(
        [wheel.observation.fitted for wheel in measured],
        [wheel.wheel for wheel in measured if wheel.wheel is not None],
        measurement.uncertainty,
        max_trials,
        seed,
    )
    return replace(measurement, monte_carlo=drawn)


def _upside_down(frame: VehicleFrame, measured: Sequence[Observation]) -> list[str]:
    """A sentence where scans show the vehicle's underside up, if z points up there."""
    scanned = measured[0].fitted.method != "points"  # a five-point file has its own note
    if not scanned or frame.up[2] > -0.5:
        return []
    return [
        f"The vehicle's up runs against z ({frame.up[2]:+.2f}): if z points up, left and right are "
        f"exchanged, or front and rear: check the order {', '.join(REFERENCE_WHEELS)}."
    ]


def _far_from_their_wheel(measured: Sequence[Observation], centres: Array) -> list[str]:
    """A sentence on every trial that is named for one wheel but lies at another."""
    notes = []
    for seen in measured[4:]:
        apart_m = np.linalg.norm(centres - seen.fitted.centre_m, axis=1)
        nearest = REFERENCE_WHEELS[int(np.argmin(apart_m))]
        if seen.wheel in REFERENCE_WHEELS and seen.wheel != nearest:
            named_m = apart_m[REFERENCE_WHEELS.index(seen.wheel)]
            notes.append(
                f"Trial {seen.name} is named for {seen.wheel}, {named_m:.3f} m from it, but lies "
                f"{apart_m.min():.3f} m from {nearest}: check its wheel."
            )
    return notes


def _on_a_wheel(seen: Observation, centres: Array) -> Observation:
    """The observation with its wheel: as named, else the nearest; not measured if near none."""
    if seen.wheel is not None or seen.evidence is None:
        return seen
    try:
        return replace(seen, wheel=nearest_wheel(centres, seen.fitted.centre_m))
    except InputError as error:
        return replace(seen, evidence=None, status="no-wheel", reason=str(error))
