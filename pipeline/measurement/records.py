"""The result: what `measure` and `five-point` both return and every report reads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..capture import Role, Turn
from ..centre import TargetFit
from ..cloud import CloudSample
from ..plane import PlaneFit
from ..uncertainty import AngleUncertainty, MonteCarlo
from ..vectors import Array
from ..vehicle import VehicleFrame, WheelAngles
from .residual_map import ResidualMap


@dataclass(frozen=True)
class Evidence:
    """A fitted target; of a scan also its plane's fit and a map of its face."""

    target: TargetFit
    plane: PlaneFit | None = None
    face: ResidualMap | None = None


@dataclass(frozen=True)
class Observation:
    """What one scan, or one block of five points, showed.

    repeats: what it shows once more. turn: of a scan of a sweep or a run-out. evidence is None
    where nothing could be measured; `status` then names why and `reason` says it. cloud: a few of
    the points; None of five.
    """

    name: str
    role: Role
    wheel: str | None
    source: str
    sha256: str
    points_total: int
    invalid_points: int
    repeats: str | None = None
    evidence: Evidence | None = None
    status: str = "ok"
    reason: str = ""
    turn: Turn | None = None
    cloud: CloudSample | None = None

    @property
    def fitted(self) -> TargetFit:
        """The target; only of an observation that was measured."""
        if self.evidence is None:
            raise ValueError(f"{self.name} was not measured ({self.status})")
        return self.evidence.target


@dataclass(frozen=True)
class WheelResult:
    """An observation with its angles; all None where it was not measured.

    normal: (3,) outward, scanner coordinates. u_: standard uncertainties (k = 1), radians, and
    freedom_: their degrees of freedom.
    """

    observation: Observation
    wheel: str | None
    angles: WheelAngles | None = None
    normal: Array | None = None
    u_toe_rad: float | None = None
    u_camber_rad: float | None = None
    u_camber_iso_rad: float | None = None
    dof_toe: float = math.inf
    dof_camber: float = math.inf
    dof_camber_iso: float = math.inf


@dataclass(frozen=True)
class Naming:
    """How the wheels of one cloud got their names: what told the front, and what told up.

    points: of the cloud. notes: sentences on what was left out.
    """

    front: str
    up: str
    points: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Provenance:
    """What the result was made from: version, sha256 of each input, effective config, seed.

    naming: of the wheels, where one cloud shows them all. date: of the capture, as ISO 8601 writes
    it, where it is told.
    """

    source: str
    vehicle: str | None
    version: str
    inputs: dict[str, str]
    config: dict[str, Any]
    seed: int
    naming: Naming | None = None
    date: str | None = None

    @property
    def said(self) -> tuple[str, ...]:
        """Sentences on how the wheels were named."""
        if self.naming is None:
            return ()
        told = f"Wheels named by the geometry; front: {self.naming.front}; up: {self.naming.up}."
        return (told, *self.naming.notes)


@dataclass(frozen=True)
class Measurement:
    """All wheels in the capture's order, the frame, all quantities, and how they came."""

    wheels: tuple[WheelResult, ...]
    frame: VehicleFrame
    uncertainty: AngleUncertainty
    provenance: Provenance
    notes: tuple[str, ...] = ()
    monte_carlo: MonteCarlo | None = None

    @property
    def vehicle(self) -> dict[str, float]:
        """The vehicle's quantities by their names in `definitions.py`, radians and metres."""
        return self.uncertainty.vehicle_values

    @property
    def has_turned(self) -> bool:
        """Whether any of its scans is of a sweep or a run-out."""
        return any(wheel.observation.turn is not None for wheel in self.wheels)

    @property
    def complete(self) -> bool:
        """Whether every wheel and trial was measured."""
        return all(wheel.angles is not None for wheel in self.wheels)
