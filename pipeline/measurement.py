"""The result: what `measure` and `five-point` both return and every report reads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline import __version__
from pipeline.angles import WheelAngles
from pipeline.capture import Capture
from pipeline.cloud_sample import CloudSample
from pipeline.config import Config
from pipeline.face_map import FaceMap
from pipeline.fit_plane import PlaneFit
from pipeline.five_point_file import FivePointFile
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.monte_carlo import MonteCarlo
from pipeline.point_causes import Station
from pipeline.reference_frame import VehicleFrame
from pipeline.scan_entry import Role, Turn
from pipeline.uncertainty import AngleUncertainty


@dataclass(frozen=True)
class Evidence:
    """A fitted target; of a scan also its plane's fit and a map of its face."""

    target: TargetFit
    plane: PlaneFit | None = None
    face: FaceMap | None = None


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
    missing_returns: int
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
    freedom_toe: float = math.inf
    freedom_camber: float = math.inf
    freedom_camber_iso: float = math.inf


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

    @classmethod
    def of_capture(
        cls,
        capture: Capture,
        config: Config,
        observations: Sequence[Observation],
        naming: Naming | None,
    ) -> Provenance:
        """Of a capture of scans."""
        used = config.model_dump(exclude={"seed", "report"})
        used |= {"target": capture.target.model_dump(), "length_unit": capture.length_unit}
        inputs = {seen.source: seen.sha256 for seen in observations}
        if capture.cloud is not None:  # whose observations name its single scans besides
            inputs = {capture.cloud.file: observations[0].sha256}
        made = (capture.source, capture.vehicle, __version__, inputs, used, config.seed)
        return cls(*made, naming, capture.date)

    @classmethod
    def of_five_point(
        cls, file: FivePointFile, observations: Sequence[Observation], station: Station | None
    ) -> Provenance:
        """Of the paper's file, surveyed by `station` where it is known."""
        inputs = {seen.source: seen.sha256 for seen in observations}
        used: dict[str, Any] = {"method": "total-least-squares"}
        if station is not None:
            used |= {"station": station.stated.model_dump(), "place_m": station.place_m.tolist()}
        return cls(file.source, None, __version__, inputs, used, 0)


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
