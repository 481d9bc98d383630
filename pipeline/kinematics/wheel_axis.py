"""The axles of wheels with run-out scans, and the frame through the axles' centres.

A target is never mounted exactly on its axle, so that a frame through the targets' centres is
skewed by their offsets over the track. Where a wheel's axle is known, the frame stands on its
centre: where the reference scan is one of the wheel's run-out, or its target stands to the axle as
those of the run-out do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import NotMeasuredError
from ..measurement import AxleStatus, Estimate, FrameThrough, Measurement
from ..system import frozen
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS, Dual, length
from .axis_fit import OneAxis
from .sweep import DOUBT, SweepScans

LEAST_TURN = 0.25  # |1 - exp(i turn)|, some 14 degrees, of the two scans that differ most
MOST_ECCENTRIC_M = 0.02  # no target is mounted so far off; the wheel itself moved


@frozen
class Axle:
    """The axle of one wheel; fit: None where the scans show too little.

    members: indices of its measured scans. reference: index of the wheel's reference scan where it
    is one of them. eccentricity: of the target's centre.
    """

    wheel: str
    members: tuple[int, ...]
    reference: int | None
    status: AxleStatus = "ok"
    reason: str = ""
    fit: OneAxis | None = None
    eccentricity: Estimate | None = None

    @property
    def serves(self) -> bool:
        """Whether the axle is known."""
        return self.status == "ok"


@frozen
class Framed:
    """Scans in the best frame; `through`: the centres that define it."""

    scans: SweepScans
    through: FrameThrough
    axles: tuple[Axle, ...]

    def axle_of(self, wheel: str) -> Axle | None:
        """Return the axle of a wheel's reference, where it is known."""
        return next((a for a in self.axles if a.wheel == wheel and a.serves), None)


def fit_axles(scans: SweepScans, measurement: Measurement) -> tuple[Axle, ...]:
    """Fit the axle of each wheel that has a run-out, in the order RR, RL, FR, FL."""
    scanned = {w.wheel for w in measurement.wheels if w.observation.role == "runout"}
    sources = [wheel.observation.source for wheel in measurement.wheels[:4]]
    return tuple(
        _axle(wheel, scans, source)
        for wheel, source in zip(REFERENCE_WHEELS, sources, strict=True)
        if wheel in scanned
    )


def on_axles(scans: SweepScans, axles: Sequence[Axle]) -> Framed:
    """Return the scans in the frame of the known axles' centres, and of the other targets'."""
    serving = [axle for axle in axles if axle.serves]
    if not serving:
        return Framed(scans, "plate centres", tuple(axles))
    centres, moved = scans.reference_centres_m.copy(), scans.d_centres.copy()
    for axle in serving:
        assert axle.fit is not None
        index = REFERENCE_WHEELS.index(axle.wheel)
        centres[index] = axle.fit.point_m
        moved[3 * index : 3 * index + 3] = axle.fit.d_point @ scans.inputs_of(axle.members)
    whole = len(serving) == len(REFERENCE_WHEELS)
    through: FrameThrough = "axle centres" if whole else "axle and plate centres"
    return Framed(scans.on_centres(centres, moved), through, tuple(axles))


def outward_sense(wheel: str) -> float:
    """Return 1 where the frame's left is outward, else -1."""
    return 1.0 if wheel.endswith("L") else -1.0


def size(parts: tuple[Dual, Dual, Dual]) -> Dual:
    """Return the length of a vector; a zero vector has the slope of its first part."""
    return length(*parts) if any(part.value for part in parts) else parts[0]


def _axle(wheel: str, scans: SweepScans, reference: str) -> Axle:
    members = scans.of_wheel(wheel, "runout")
    same = (i for i in members if scans.scans[i].observation.source == reference)
    axle = Axle(wheel, tuple(members), next(same, None))
    if len(members) < 2:
        reason = f"{len(members)} positions were measured, 2 or more are needed"
        return replace(axle, status="too-few-positions", reason=reason)
    turns = _stated_turns(scans, members, wheel)
    places = np.exp(1j * turns)
    if float(np.abs(places[:, None] - places).max()) < LEAST_TURN:
        reason = "the scans show nearly the same rotation: rotate the wheel by 180 degrees"
        return replace(axle, status="turn-too-small", reason=reason)
    try:
        fit = _fit(scans, members, turns)
    except NotMeasuredError as error:
        if error.status == "not-one-axis":
            return replace(axle, status="moved", reason=f"{error}, or an angle_deg is wrong")
        return replace(axle, status="no-axis", reason=str(error))
    moved = (fit.d_centre - fit.d_point) @ scans.inputs_of(members)
    eccentricity = scans.estimate(size(scans.in_frame(fit.centre_m - fit.point_m, moved)))
    status, reason = _assess(scans, members, turns, fit, eccentricity)
    if status == "ok" and axle.reference is None and not _stands_as_reference(scans, axle, fit):
        status, reason = (
            "moved",
            (
                "the target of the reference scan stands to the axle otherwise than those of the "
                "run-out: the wheel was steered, lifted or lowered between, or its target mounted "
                "anew: make the reference scan one of the run-out"
            ),
        )
    return replace(axle, status=status, reason=reason, fit=fit, eccentricity=eccentricity)


def _stated_turns(scans: SweepScans, members: list[int], wheel: str) -> Array:
    """Return rotations about the outward axle, right-handed: on the left, rolling forwards."""
    turns = [scans.scans[i].observation.turn for i in members]
    return np.array([t.angle_rad or 0.0 for t in turns if t is not None]) * outward_sense(wheel)


def _fit(scans: SweepScans, members: list[int], turns: Array) -> OneAxis:
    normals = [scans.scans[i].normal for i in members]
    middle = np.sum([normal for normal in normals if normal is not None], axis=0)
    return scans.fit(members, turns, scans.u_turns_rad[members], middle)


def _assess(
    scans: SweepScans, members: list[int], turns: Array, fit: OneAxis, eccentricity: Estimate
) -> tuple[AxleStatus, str]:
    if fit.probability < DOUBT:
        return "moved", (
            "the scans do not rotate about one axle as stated (chi2/nu = "
            f"{fit.chi_square / fit.dof:.1f}): {_advice(scans, members, turns)}"
        )
    if eccentricity.value > MOST_ECCENTRIC_M:
        return "moved", (
            f"the target's centre runs at {eccentricity.value * 1e3:.1f} mm from the axle: "
            "the vehicle moved, or angle_deg is wrong"
        )
    return "ok", ""


def _stands_as_reference(scans: SweepScans, axle: Axle, fit: OneAxis) -> bool:
    """Return whether the reference's target stands to the axle as those of the run-out do.

    Compared: its tilt, its centre's distance from the axle, and its position along the axle.
    """
    row = REFERENCE_WHEELS.index(axle.wheel)
    result, own = scans.measured[row], scans.inputs_of(axle.members)
    assert result.normal is not None
    normal_by, centre_by = scans.columns_of_target(row)
    arm, moved = result.observation.fitted.centre_m - fit.point_m, centre_by - fit.d_point @ own
    expected, by_fit = fit.centre_m - fit.point_m, (fit.d_centre - fit.d_point) @ own
    d_axis = fit.d_axis @ own
    differences = (
        _off(fit.axis, d_axis, result.normal, normal_by)
        - _off(fit.axis, d_axis, fit.normal, fit.d_normal @ own),
        _off(fit.axis, d_axis, arm, moved) - _off(fit.axis, d_axis, expected, by_fit),
        Dual(float(arm @ fit.axis), fit.axis @ moved + arm @ d_axis),
    )
    return scans.probability(differences) >= DOUBT


def _off(axis: Array, d_axis: Array, vector: Array, moved: Array) -> Dual:
    """Return the length of a vector's part across the unit axis."""
    along = float(vector @ axis)
    across = vector - along * axis
    length_m = float(np.linalg.norm(across))
    unit = across / length_m if length_m else np.zeros(3)
    return Dual(length_m, unit @ (moved - along * d_axis))


def _advice(scans: SweepScans, members: list[int], turns: Array) -> str:
    """Return what to check; reversed rotations are tried and reported, never used."""
    try:
        backwards = _fit(scans, members, -turns).probability >= DOUBT
    except NotMeasuredError:
        backwards = False
    if backwards:
        return "they do if the signs of angle_deg (> 0: rolls forwards) are reversed: change them"
    return "the vehicle moved, the target slipped, or an angle_deg is wrong: check these"
