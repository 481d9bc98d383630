"""Records of a measurement, which `measure` and `five-point` return and reports read."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..capture import Role, Turn
from ..centre import RotationMark, TargetFit
from ..cloud import CloudSample
from ..errors import Doubt, Wording
from ..plane import PlaneFit
from ..system import frozen
from ..targets import Target
from ..uncertainty import (
    LEVEL,
    AngleUncertainty,
    Effect,
    MonteCarlo,
    UncertainTarget,
    UncertaintyComponent,
    quantile,
)
from ..vectors import Array
from ..vehicle import VehicleFrame, WheelAngles
from .residual_map import ResidualMap

if TYPE_CHECKING:
    from ..wheel import WheelProfile

NAMED = "Wheels named by the geometry; front: {front}; up: {up}."

SweepStatus = Literal["ok", "too-few-positions", "range-too-small", "no-axis", "not-one-axis"]
AxleStatus = Literal["ok", "too-few-positions", "turn-too-small", "no-axis", "moved"]
ToeOutStatus = Literal["ok", "not-one-axis", "too-few-pairs", "not-together", "not-reached"]
VerticalKind = Literal["wheels", "floor", "gravity"]
FrameThrough = Literal["axle centres", "axle and plate centres", "plate centres"]
LEAST_UNIFORM = 0.1  # share of a rectangle in u, below which k changes by less than 5e-6


@frozen
class Evidence:
    """Fitted target; of a scan also the plane's fit and a map of its residuals.

    profile: of a bare wheel, instead of these two.
    """

    target: TargetFit
    plane: PlaneFit | None = None
    face: ResidualMap | None = None
    profile: WheelProfile | None = None


@frozen
class SuspectPoint:
    """Point of a five-point block that contradicts the other four.

    number: in the block, from 1. line: in the file. off_m: (3,) from where the other four place it.
    """

    number: int
    line: int
    off_m: Array


@frozen
class Observation:
    """Target observed in one scan, or in one block of five points.

    repeats: name of the scan that it repeats. turn: of a scan of a sweep or a run-out. evidence is
    None where nothing could be measured; `status` then is the kind of cause and `reason` explains
    it. cloud: a sample of the points; None for five points. notes: findings about the scan.
    suspect: of a block that is not plausible, whose evidence is then that of the other four points.
    target: that the scan shows. on_wheel: the fitted target carried to the wheel's centre, where
    its stand-off is stated. is_mesh: whether the points are the corners of a mesh.
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
    notes: tuple[str, ...] = ()
    suspect: SuspectPoint | None = None
    target: Target | None = None
    on_wheel: TargetFit | None = None
    is_mesh: bool = False

    @property
    def rolled(self) -> str | None:
        """Position of a vehicle that rolled, of which the scan is; None of others."""
        return self.turn.position if self.role == "runout" and self.turn is not None else None

    @property
    def fitted(self) -> TargetFit:
        """Fitted target, on its wheel where it is carried there. Raises ValueError without."""
        if self.evidence is None:
            raise ValueError(f"{self.name} was not measured ({self.status})")
        return self.on_wheel or self.evidence.target


@frozen
class WheelPose:
    """Normal (3,) and centre (3,) of a wheel, scanner coordinates, with their uncertainty."""

    centre_m: Array
    normal: Array
    components: tuple[UncertaintyComponent, ...]

    @property
    def covariance(self) -> Array:
        """Covariance (6, 6) of the normal (rad), then the centre (m), by all components."""
        return np.asarray(sum((part.covariance for part in self.components), np.zeros((6, 6))))


@frozen
class Vertical:
    """Direction from which camber, caster and SAI can be measured, with its uncertainty.

    normal: (3,) unit, upwards, scanner coordinates. by: its source, in words. notes: on it.
    """

    kind: VerticalKind
    normal: Array
    components: tuple[UncertaintyComponent, ...]
    by: str
    notes: tuple[str, ...] = ()

    @property
    def centre_m(self) -> Array:
        """Zero: a direction has no place."""
        return np.zeros(3)


@frozen
class WheelResult:
    """Observation with its angles; all None where it was not measured.

    The angles are those of `pose`: of the wheel's axle where its run-out is compensated, else of
    the target as mounted. normal: (3,) of the pose, outward, scanner coordinates. u_: standard
    uncertainties (k = 1), radians, and dof_: their degrees of freedom. plate: result of the target
    as mounted, in the frame through the targets' centres; None where no run-out of the vehicle is
    compensated. provisional: angles without the suspect point of a block that is not plausible,
    which stand for the wheel in the frame and in the vehicle's quantities.
    """

    observation: Observation
    wheel: str | None
    pose: UncertainTarget | None = None
    compensated: bool = False
    plate: WheelResult | None = None
    angles: WheelAngles | None = None
    provisional: WheelAngles | None = None
    normal: Array | None = None
    u_toe_rad: float | None = None
    u_camber_rad: float | None = None
    u_camber_iso_rad: float | None = None
    dof_toe: float = math.inf
    dof_camber: float = math.inf
    dof_camber_iso: float = math.inf

    @property
    def evaluated(self) -> WheelAngles | None:
        """Angles that the measurement's uncertainty covers, provisional ones among them."""
        return self.angles or self.provisional


@frozen
class Naming:
    """Sources of the front and up directions by which a cloud's wheels were named.

    notes: sentences on what was left out.
    """

    front: str
    up: str
    notes: tuple[str, ...] = ()


@frozen
class Provenance:
    """Origin of a result: version, sha256 of each input, effective config, seed.

    naming: of the wheels of a whole-vehicle scan. date: of the capture (ISO 8601), if known.
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
    def checksums(self) -> frozenset[str]:
        """Checksums of the inputs, by which results are known to be of the same files."""
        return frozenset(self.inputs.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the wheels were named."""
        if self.naming is None:
            return ()
        front, up = self.naming.front, self.naming.up
        return (Wording(NAMED, front=front, up=up), *self.naming.notes)


@frozen
class Estimate:
    """A value with its standard uncertainty and degrees of freedom; radians or metres.

    slope: (K,) derivatives by the inputs on which `effects` act, so that estimates of one vehicle
    add up with their covariance (estimates.py). u_own: part of u that no input causes. u_uniform:
    standard uncertainty of its largest rectangular part; the others count as normal.
    """

    value: float
    u: float
    dof: float = math.inf
    slope: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    effects: tuple[Effect, ...] = field(default=(), repr=False, compare=False)
    u_own: float = field(default=0.0, repr=False, compare=False)
    u_uniform: float = field(default=0.0, repr=False, compare=False)

    @property
    def expanded(self) -> float:
        """Expanded uncertainty k u, half the 95 % interval.

        k by Student's t; by its convolution with a rectangle where one is a part of u.
        """
        return quantile(0.5 + LEVEL / 2.0, self.dof, self.uniform) * self.u

    @property
    def uniform(self) -> float:
        """Share of its rectangular part in u; 0 below which it does not change k."""
        share = self.u_uniform / self.u if self.u > 0.0 else 0.0
        return min(share, 1.0) if share > LEAST_UNIFORM else 0.0


@frozen
class SteeringAxis:
    """The steering axis of one front wheel, by its sweep; None where the scans show too little.

    scans: names of the measured ones. sweep_rad: largest less smallest toe. frame: the centres that
    define the frame of all values. inclination: steering axis inclination (SAI). caster_by_camber:
    from the camber of the two outermost scans alone, for comparison. included_angle: inclination
    plus the camber of the wheel straight ahead, of its axle where a run-out shows it. axis: (3,)
    unit, upwards, and point_m: (3,) on it at the height of the wheel's reference centre, scanner
    coordinates. lateral_offset, longitudinal_offset: of that point from this centre, metres, > 0
    inwards and forwards. chi_square: of the residuals, with `dof` degrees of freedom; probability:
    of as much or more. with_rotation: the number of scans that show the target's in-plane rotation,
    by `mark`.
    """

    wheel: str
    scans: tuple[str, ...]
    sweep_rad: float
    frame: FrameThrough
    status: SweepStatus = "ok"
    reason: str = ""
    caster: Estimate | None = None
    inclination: Estimate | None = None
    caster_by_camber: Estimate | None = None
    lateral_offset: Estimate | None = None
    longitudinal_offset: Estimate | None = None
    included_angle: Estimate | None = None
    axis: Array | None = None
    point_m: Array | None = None
    chi_square: float = 0.0
    dof: int = 0
    probability: float = 1.0
    with_rotation: int = 0
    mark: RotationMark | None = None


@frozen
class AxleAngles:
    """Toe, camber and ISO camber of an axle."""

    toe: Estimate
    camber: Estimate
    camber_iso: Estimate


@frozen
class Runout:
    """The axle of one wheel, by its run-out scans; None where these show too little.

    scans: names of the measured ones. compensates: the axle is that of the reference scan, whose
    wheel therefore has the axle's angles. frame: of `angles` and clock angles. axial_runout: angle
    between the target's normal and the axle; radial_runout: distance of its centre from the axle
    (half the total indicator reading); each with its clock angle, from the top, > 0 forwards, at
    the stated rotation 0; None where there is no run-out. turns_rad: of the wheel as fitted, in the
    order of the scans. axis: (3,) unit, outward, and centre_m: (3,) of the axle, level with the
    target's centre, scanner coordinates. chi_square: of the residuals, with `dof` degrees of
    freedom; probability: of as much or more.
    """

    wheel: str
    scans: tuple[str, ...]
    status: AxleStatus = "ok"
    reason: str = ""
    compensates: bool = False
    angles: AxleAngles | None = None
    frame: FrameThrough = "plate centres"
    axial_runout: Estimate | None = None
    axial_clock: Estimate | None = None
    radial_runout: Estimate | None = None
    radial_clock: Estimate | None = None
    turns_rad: tuple[float, ...] = ()
    axis: Array | None = None
    centre_m: Array | None = None
    chi_square: float = 0.0
    dof: int = 0
    probability: float = 1.0


@frozen
class ToeOut:
    """Toe-out on a left turn, whose inner wheel is FL, or on a right turn, at an inner angle.

    difference: inner less outer angle, None where it was not reached. u_interpolation_rad: the part
    of its u that is due to the curve between the positions. of: whose angles these are. curve:
    inner angle, and inner less outer, at every position that both wheels have.
    """

    turn: Literal["left", "right"]
    status: ToeOutStatus = "ok"
    reason: str = ""
    difference: Estimate | None = None
    u_interpolation_rad: float = 0.0
    of: Literal["axles", "plates"] = "plates"
    inner_rad: float = math.radians(20.0)
    curve: tuple[tuple[Estimate, Estimate], ...] = ()


@frozen
class Measurement:
    """All wheels in the capture's order, the frame, all quantities, and their provenance.

    steering_axes: FR before FL, and toe_out: left turn, then right, of steering sweeps; runouts: in
    the order RR, RL, FR, FL. Empty without such scans; `kinematics.solve` adds them. plates: the
    same measurement of the targets as mounted; None where no run-out is compensated. vertical: from
    which camber, caster and SAI are measured, None for the normal to the plane of the wheel
    centres; verticals: all that are known.
    """

    wheels: tuple[WheelResult, ...]
    frame: VehicleFrame
    uncertainty: AngleUncertainty
    provenance: Provenance
    notes: tuple[str, ...] = ()
    monte_carlo: MonteCarlo | None = None
    steering_axes: tuple[SteeringAxis, ...] = ()
    runouts: tuple[Runout, ...] = ()
    toe_out: tuple[ToeOut, ...] = ()
    plates: Measurement | None = None
    vertical: Vertical | None = None
    verticals: tuple[Vertical, ...] = ()

    @property
    def vertical_kind(self) -> VerticalKind:
        """The vertical from which camber, caster and SAI are measured."""
        return "wheels" if self.vertical is None else self.vertical.kind

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Notes on what contradicts the names of the scans; no verdict rests on such values."""
        return tuple(note for note in self.notes if isinstance(note, Doubt))

    @property
    def provisional(self) -> frozenset[str]:
        """Names of the wheels that stand in the vehicle's quantities without a suspect point."""
        return frozenset(wheel.observation.name for wheel in self.wheels if wheel.provisional)

    @property
    def points_read(self) -> dict[str, int]:
        """Number of points by file: one scan may be that of a wheel and of its run-out.

        Of five points a plane, which all stand in one file, by the names of the planes.
        """
        seen = [wheel.observation for wheel in self.wheels]
        if seen[0].fitted.method == "points":
            return {one.name: one.points_total for one in seen}
        if self.provenance.naming is None:
            return {one.source: one.points_total for one in seen}
        return {one.source.partition(": ")[0]: one.points_total for one in seen}

    @property
    def vehicle(self) -> dict[str, float]:
        """The vehicle's quantities by their names in `definitions.py`, radians and metres."""
        return self.uncertainty.vehicle_values

    @property
    def complete(self) -> bool:
        """Whether every wheel and trial, every steering axis and run-out was measured."""
        statuses: list[str] = [axis.status for axis in self.steering_axes]
        statuses += [axle.status for axle in self.runouts]
        measured = all(wheel.angles is not None for wheel in self.wheels)
        return measured and all(status == "ok" for status in statuses)
