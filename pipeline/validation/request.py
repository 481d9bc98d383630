"""Request of a comparison, and the part of a measurement that can be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path, PurePath
from typing import Literal

import numpy as np

from ..capture import Capture
from ..errors import InputError, Wording
from ..measurement import MEASURED_FROM, Measurement, WheelResult, evaluate
from ..system import frozen
from ..vehicle import build_reference_frame, wheel_angles
from .comparison import ComparedMethod
from .five_point import FivePointOptions

Against = Literal["five-point", "virtual", "truth", "wheel"]
DENSE = "dense scans"
COMPARED = ("reference", "trial")
AS_MOUNTED = (
    "Compared are the targets as mounted, which both methods measure: the run-outs of the capture "
    "are not compensated here."
)


@frozen
class Request:
    """Method to compare with, and its options.

    file: of the five points, relative to the capture's folder; with truth, None compares the dense
    scans. radius_m: of the virtual pentagons. to_detect_rad: size of error that must be detectable.
    """

    against: Against
    file: Path | None = None
    points: FivePointOptions = field(default_factory=FivePointOptions)
    radius_m: float | None = None
    to_detect_rad: float | None = None


@frozen
class RequestPart:
    """Wheels and trials that can be compared, and name and reason of those not measured.

    A reference wheel with provisional angles is among both, since the frame needs it.
    """

    results: tuple[WheelResult, ...]
    missing: tuple[tuple[str, str], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the compared ones."""
        return tuple(result.observation.name for result in self.results)

    @property
    def wheels(self) -> tuple[str, ...]:
        """Wheel of each: RR, RL, FR or FL."""
        return tuple(str(result.wheel) for result in self.results)


def measured(measurement: Measurement) -> RequestPart:
    """Select reference wheels and trials, which can be compared."""
    wheels = [w for w in measurement.wheels if w.observation.role in COMPARED]
    missing = [w for w in wheels if w.angles is None]
    return RequestPart(
        tuple(w for w in wheels if comparable(w)),
        tuple((w.observation.name, why_missing(w)) for w in missing),
    )


def of_faces(dense: Measurement) -> Measurement:
    """Return a measurement of the targets' faces, on which five points lie, not of the wheels.

    As it is where no target is carried to its wheel. Raises InputError for one that was read from
    its measurement.json, where that holds the carried centres alone.
    """
    mounted = dense.plates or dense
    if all(wheel.observation.on_wheel is None for wheel in mounted.wheels):
        if _was_carried(mounted):
            raise InputError(
                f"{mounted.provenance.source}: its measurement.json holds the centres of the "
                "wheels, its targets stand off these, and five points lie on the targets: compare "
                "the capture itself"
            )
        return mounted
    seen = [replace(wheel.observation, on_wheel=None) for wheel in mounted.wheels]
    faces = [one.fitted for one in seen if one.evidence is not None]
    return evaluate(seen, faces, mounted.provenance, mounted.notes, mounted.vertical)


def _was_carried(read: Measurement) -> bool:
    """Return whether targets that a measurement.json states were carried to their wheels."""
    if any(wheel.observation.target is not None for wheel in read.wheels):
        return False
    stated = read.provenance.config
    targets = [stated.get("target"), *(stated.get("targets") or {}).values()]
    return any(one is not None and one.get("stand_off") is not None for one in targets)


def note_of_plates(dense: Measurement) -> tuple[str, ...]:
    """Return a note where axles were measured, but targets are compared."""
    if dense.plates is None:
        return ()
    return (Wording(AS_MOUNTED),)


def comparable(result: WheelResult) -> bool:
    """Return whether it was measured, or provisionally and the frame needs it."""
    needed = result.observation.role == "reference" and result.evaluated is not None
    return needed or result.angles is not None


def why_missing(result: WheelResult) -> str:
    """Return the status of a wheel or trial that was not measured, and its reason."""
    seen = result.observation
    shown = "; its row below is without that point" if comparable(result) else ""
    return f"{seen.status}: {seen.reason}{shown}"


def as_method(label: str, results: Sequence[WheelResult]) -> ComparedMethod:
    """Return a method with these results, all of them comparable."""
    angles = [result.evaluated for result in results if result.evaluated is not None]
    return ComparedMethod(
        label,
        tuple(result.pose for result in results if result.pose is not None),
        np.array([a.toe_rad for a in angles] + [a.camber_rad for a in angles]),
    )


def from_wheel_centres(method: ComparedMethod, wheels: Sequence[str]) -> ComparedMethod:
    """Return a method with its cambers from the plane of the wheel centres, which all know.

    wheels: of its targets; the first four: RR, RL, FR, FL.
    """
    frame = build_reference_frame(np.stack([one.centre_m for one in method.targets[:4]]))
    angles = [
        wheel_angles(frame, target.normal, wheel)
        for target, wheel in zip(method.targets, wheels, strict=True)
    ]
    found = [a.toe_rad for a in angles] + [a.camber_rad for a in angles]
    return replace(method, angles_rad=np.array(found))


def without_vertical(notes: Sequence[str]) -> tuple[str, ...]:
    """Return notes but that on another vertical, which is not used in a comparison of methods."""
    return tuple(
        note for note in notes if not str(note).startswith(MEASURED_FROM.partition("{")[0])
    )


def folder_of(capture: Capture) -> Path:
    """Return the folder of the capture's files; of an archive, where it is unpacked."""
    first = capture.cloud or capture.entries[0]
    return first.path.parents[len(PurePath(first.file).parts) - 1]
