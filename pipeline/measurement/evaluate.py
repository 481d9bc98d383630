"""Angles from observations: four centres define the frame, normals in it the angles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..capture import StatedVertical
from ..centre import lies_on_wheel, off_tyre, on_wheel, unlike_wheels, with_unstated
from ..diagnostics import TRACKS_M, WHEELBASES_M, check_wheels, is_usual
from ..errors import InputError, Wording
from ..system import stage
from ..uncertainty import (
    AngleUncertainty,
    UncertainTarget,
    monte_carlo,
    propagate,
    vertical_component,
)
from ..vectors import Array
from ..vehicle import (
    REFERENCE_WHEELS,
    Floor,
    VehicleFrame,
    build_reference_frame,
    deg_min_sec,
    nearest_wheel,
    outward_normal,
    wheel_angles,
)
from .doubts import check_positions, doubts_of, floor_below
from .records import Measurement, Observation, Provenance, Vertical, VerticalKind, WheelResult
from .repeatability import share_components

MOST_OFF_RAD = math.radians(30.0)  # no car leans as far: of a stated vertical from the wheels' up
MISSING = {
    "floor": "the scans show no floor beside all four wheels, and capture.toml states none: scan "
    "the floor too, or add floor = [x, y, z], its normal upwards, with floor_u_deg",
    "gravity": "add gravity = [x, y, z], the way in which things fall in the coordinates of the "
    "scans, with gravity_u_deg, to capture.toml",
}
Verticals = Callable[
    [VehicleFrame, Sequence[Observation]], tuple[Vertical | None, tuple[Vertical, ...]]
]

WITHOUT_POINT = (
    "{name} stands in the frame and in the vehicle's quantities without its suspect point, line "
    "{line} of the file."
)
UNUSUAL_SIZE = (
    "Tracks of {rear} m (rear) and {front} m (front) and wheelbases of {right} m (right) and "
    "{left} m (left) are not those of usual vehicles: unless this vehicle is built so, check the "
    "unit of the coordinates: angles do not show it, lengths do."
)
FLOOR_OF_SCANS = "the floor in the scans, {depth} m below the wheel centres"
PADS = (
    "Wheels stand on other heights than the floor beside them ({sizes}), as on turn plates or "
    "shims: the floor's normal is that of the plane nearest to what the wheels stand on."
)
TWISTED_FLOOR = (
    "What the wheels stand on is no plane: each stands {twist} mm off the plane of the other "
    "three. The angles from the floor hold this in their uncertainty: level it with shims, state "
    "the floor's normal in capture.toml, or measure from the wheel centres or gravity."
)

UNLIKE_HEIGHTS_M = 0.05  # of wheel centres above what the wheels stand on; tyres differ by less
UNLIKE_HEIGHTS = (
    "The wheel centres stand {low} to {high} mm above the floor, as the scans show it: where the "
    "tyres are alike, a wheel is on a block or ramp whose top is not seen, and the angles from the "
    "floor are wrong: state the floor's normal in capture.toml, or measure from the wheel centres "
    "or gravity."
)


@stage("angles")
def align(
    observations: Sequence[Observation],
    provenance: Provenance,
    notes: Iterable[str] = (),
    verticals: Verticals | None = None,
) -> Measurement:
    """Evaluate all observations; the first four are RR, RL, FR, FL and were measured.

    verticals: finds those that are known, and the one in use. A trial that belongs to no wheel, or
    faces along the car, gets a status. Raises InputError where the four centres define no frame,
    where a position of a sweep or a run-out is a copy of another, and where the vertical in use is
    not known.
    """
    centres, frame = _frame_of(observations, provenance)
    observations = [_on_a_wheel(one, centres) for one in observations]
    observations = share_components([_on_a_side(one, frame, provenance) for one in observations])
    check_positions(observations, provenance.source)
    observations = _with_wheel_centres(observations, frame)
    centres, frame = _frame_of(observations, provenance)
    measured = [one for one in observations if one.evidence is not None]
    used, known = verticals(frame, observations) if verticals else (None, ())
    doubts = doubts_of(frame, centres, measured, known)
    sizes = [] if doubts else _note_of_size(frame, centres)  # of wrong wheels they mean nothing
    notes = (*notes, *doubts, *sizes, *_without_a_point(measured))
    found = evaluate(observations, [one.fitted for one in measured], provenance, notes, used)
    return replace(found, verticals=known)


def _frame_of(
    observations: Sequence[Observation], provenance: Provenance
) -> tuple[Array, VehicleFrame]:
    """Return the centres (4, 3) of the reference wheels and their frame. Raises InputError."""
    centres = np.stack([observation.fitted.centre_m for observation in observations[:4]])
    try:
        frame = build_reference_frame(centres)
    except InputError as error:
        raise InputError(f"{provenance.source}: {error}") from error
    check_wheels(centres, REFERENCE_WHEELS, provenance.source)
    return centres, frame


def _on_a_side(
    observation: Observation, frame: VehicleFrame, provenance: Provenance
) -> Observation:
    """Return the observation; no-wheel if its target faces along the car: it has no outer side.

    Raises InputError for that of a reference wheel.
    """
    if observation.evidence is None or observation.wheel is None:
        return observation
    try:
        outward_normal(frame, observation.fitted.normal, observation.wheel)
    except InputError as error:
        if observation.role == "reference":
            raise InputError(f"{provenance.source}: {error}") from error
        fact = str(error).rpartition(": ")[0]
        return replace(observation, evidence=None, status="no-wheel", reason=fact)
    return observation


def _note_of_size(frame: VehicleFrame, centres: Array) -> list[Wording]:
    """Return a note where the tracks or wheelbases (4 centres) are not those of usual vehicles."""
    tracks = (frame.rear_track_m, frame.front_track_m)
    wheelbases = np.linalg.norm(centres[2:] - centres[:2], axis=1).tolist()
    if is_usual(tracks, TRACKS_M) and is_usual(wheelbases, WHEELBASES_M):
        return []
    sizes = {"rear": tracks[0], "front": tracks[1], "right": wheelbases[0], "left": wheelbases[1]}
    return [Wording(UNUSUAL_SIZE, **{name: f"{size:.3f}" for name, size in sizes.items()})]


def _with_wheel_centres(
    observations: Sequence[Observation], frame: VehicleFrame
) -> list[Observation]:
    """Return the observations with targets carried to their wheels' centres, where that is stated.

    Where it is not, and the other side of the axle is unlike, it counts in the uncertainty. Wheels
    by their tyres are carried to the flange where other scans of their axle show one.
    """
    unlike = unlike_wheels([observation.target for observation in observations[:4]])
    bulges = tyre_bulges(observations)
    found = []
    for one in observations:
        if one.evidence is not None and one.target is not None and one.wheel is not None:
            outward = outward_normal(frame, one.fitted.normal, one.wheel)
            carried = on_wheel(one.fitted, one.target, outward)
            own = one.role != "trial" and not lies_on_wheel(one.target)
            if own and one.wheel in unlike:
                carried = with_unstated(one.fitted, one.target, outward)
            if one.fitted.method == "tyre" and one.wheel[0] in bulges:
                carried = off_tyre(one.fitted, bulges[one.wheel[0]], outward, one.wheel)
            one = replace(one, on_wheel=carried)
        found.append(one)
    return found


def tyre_bulges(observations: Sequence[Observation]) -> dict[str, float | None]:
    """Return the bulge of the tyres over the flange's edge by axle, R and F, where it matters.

    That is where centres of an axle lie level with the flange; None where none shows the bulge.
    """
    seen: dict[str, list[float]] = {}
    for one in observations:
        if one.evidence is None or one.wheel is None:
            continue
        stated = one.target is not None and one.target.stand_off is not None
        if stated or one.fitted.method == "flange":
            known = seen.setdefault(one.wheel[0], [])
            known += [] if one.fitted.bulge_m is None else [one.fitted.bulge_m]
    return {axle: float(np.mean(known)) if known else None for axle, known in seen.items()}


def evaluate(
    observations: Sequence[Observation],
    poses: Sequence[UncertainTarget],
    provenance: Provenance,
    notes: tuple[str, ...],
    vertical: Vertical | None = None,
) -> Measurement:
    """Evaluate the angles of observations from the pose of each measured one, in their order.

    The first four observations are RR, RL, FR, FL; the centres of their poses define the frame.
    """
    frame = build_reference_frame(np.stack([pose.centre_m for pose in poses[:4]]))
    measured = [one for one in observations if one.evidence is not None]
    wheels = [one.wheel for one in measured if one.wheel is not None]
    uncertainty = propagate(poses, wheels, vertical)
    above = None if vertical is None else vertical.normal
    results = {
        observation.name: _result(observation, pose, frame, uncertainty, index, above)
        for index, (observation, pose) in enumerate(zip(measured, poses, strict=True))
    }
    return Measurement(
        wheels=tuple(results.get(o.name) or WheelResult(o, o.wheel) for o in observations),
        frame=frame,
        uncertainty=uncertainty,
        provenance=provenance,
        notes=notes,
        vertical=vertical,
    )


def find_verticals(
    stated: Sequence[StatedVertical], wanted: VerticalKind, source: str
) -> Verticals:
    """Return how the verticals of a capture are found: those stated, and the floor in its scans.

    wanted: the one in use. A floor that is stated replaces that of the scans. The function raises
    InputError where the one in use is not known, or a stated one is far from the wheels' up.
    """

    def find(
        frame: VehicleFrame, observations: Sequence[Observation]
    ) -> tuple[Vertical | None, tuple[Vertical, ...]]:
        known = [_stated_vertical(one, frame, source) for one in stated]
        if not any(one.kind == "floor" for one in known):
            known += _floor_of_scans(frame, observations[:4])
        used = next((one for one in known if one.kind == wanted), None)
        if used is None and wanted != "wheels":
            raise InputError(f"{source}: --vertical {wanted}: {MISSING[wanted]}")
        return used, tuple(known)

    return find


def _stated_vertical(stated: StatedVertical, frame: VehicleFrame, source: str) -> Vertical:
    up = np.array(stated.up)
    off = math.atan2(float(np.linalg.norm(np.cross(up, frame.up))), float(up @ frame.up))
    if off > MOST_OFF_RAD:
        raise InputError(
            f"{source}: {stated.note}: it is {math.degrees(off):.0f}° off the wheels' upright: "
            f"give {stated.meaning}, in the coordinates of the scans"
        )
    tilt = stated.u_rad * np.eye(3)
    component = vertical_component("vertical", up, tilt, math.inf)
    return Vertical(stated.kind, up, (component,), stated.note)


def _floor_of_scans(frame: VehicleFrame, references: Sequence[Observation]) -> list[Vertical]:
    """Return the floor beside the four wheels, if their scans show it."""
    floor = floor_below(frame, references)
    if floor is None:
        return []
    aside, ahead = floor.slopes
    up = frame.up - aside * frame.left - ahead * frame.forward
    up = up / np.linalg.norm(up)
    axes = np.column_stack([frame.left, frame.forward])
    components = [
        vertical_component(name, up, axes @ _root(covariance), dof)
        for name, covariance, dof in (
            ("vertical", floor.covariance, float(floor.dof)),
            ("floor twist", floor.twist_covariance, math.inf),
        )
        if covariance.any()
    ]
    by = Wording(FLOOR_OF_SCANS, depth=f"{floor.depth_m:.2f}")
    return [Vertical("floor", up, tuple(components), by, tuple(_notes_of_floor(floor)))]


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(values.clip(min=0.0)))


def _notes_of_floor(floor: Floor) -> Iterator[str]:
    """Yield notes on what the wheels stand on, where the floor beside them does not say all."""
    pads = [
        f"{wheel} {height_m * 1e3:+.1f} mm"
        for wheel, height_m in zip(REFERENCE_WHEELS, floor.pads_m, strict=True)
        if height_m != 0.0
    ]
    if pads:
        yield Wording(PADS, sizes=", ".join(pads))
    if np.ptp(floor.above_m) > UNLIKE_HEIGHTS_M:
        low, high = (f"{height_m * 1e3:.0f}" for height_m in np.sort(floor.above_m)[[0, -1]])
        yield Wording(UNLIKE_HEIGHTS, low=low, high=high)
    if floor.twist_m:
        yield Wording(TWISTED_FLOOR, twist=f"{floor.twist_m * 1e3:.1f}")


def check_by_monte_carlo(measurement: Measurement, max_draws: int, seed: int) -> Measurement:
    """Return the measurement with a check of its uncertainties by at most `max_draws` draws."""
    measured = [wheel for wheel in measurement.wheels if wheel.evaluated is not None]
    drawn = monte_carlo(
        [wheel.pose for wheel in measured if wheel.pose is not None],
        [wheel.wheel for wheel in measured if wheel.wheel is not None],
        measurement.uncertainty,
        max_draws,
        seed,
        measurement.vertical,
    )
    return replace(measurement, monte_carlo=drawn)


def _result(
    observation: Observation,
    pose: UncertainTarget,
    frame: VehicleFrame,
    uncertainty: AngleUncertainty,
    index: int,
    vertical: Array | None,
) -> WheelResult:
    wheel, dof = str(observation.wheel), uncertainty.wheel_dof(index)
    angles = wheel_angles(frame, pose.normal, wheel, vertical)
    if observation.suspect is not None:
        without = f"toe {deg_min_sec(angles.toe_rad)}, camber {deg_min_sec(angles.camber_rad)}"
        observation = replace(observation, reason=f"{observation.reason}; without it {without}")
        return WheelResult(observation, wheel, pose, provisional=angles)
    return WheelResult(
        observation=observation,
        wheel=wheel,
        pose=pose,
        angles=angles,
        normal=outward_normal(frame, pose.normal, wheel),
        u_toe_rad=float(uncertainty.toe_rad[index]),
        u_camber_rad=float(uncertainty.camber_rad[index]),
        u_camber_iso_rad=float(uncertainty.camber_iso_rad[index]),
        dof_toe=dof["dof_toe"],
        dof_camber=dof["dof_camber"],
        dof_camber_iso=dof["dof_camber_iso"],
    )


def _without_a_point(measured: Sequence[Observation]) -> list[str]:
    """Return a note for every reference wheel whose block is not plausible."""
    return [
        Wording(WITHOUT_POINT, name=observation.name, line=observation.suspect.line)
        for observation in measured[:4]
        if observation.suspect is not None
    ]


def _on_a_wheel(observation: Observation, centres: Array) -> Observation:
    """Return the observation with its wheel: as named, else the nearest; no-wheel if near none."""
    if observation.wheel is not None or observation.evidence is None:
        return observation
    try:
        return replace(observation, wheel=nearest_wheel(centres, observation.fitted.centre_m))
    except InputError as error:
        return replace(observation, evidence=None, status="no-wheel", reason=str(error))
