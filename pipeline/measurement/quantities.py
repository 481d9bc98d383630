"""Quantities of a measurement: all in the order of its covariance, and those of turned wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import Doubt
from ..system import frozen
from ..uncertainty import LEVEL, coverage_factor
from ..vectors import Array
from ..vehicle import VEHICLE, WHEEL, Axis, Unit
from .estimates import weighted_sum
from .records import Estimate, Measurement, Runout, SteeringAxis
from .turn_curve import toe_out_at

RADIAN: Unit = "rad"


@frozen
class Stated:
    """Quantity with its uncertainty, radians or metres.

    row: its place in the measurement's covariance. subject: name of the wheel, or "vehicle". kind:
    such as "toe" or "wheelbase". axis: longitudinal axis to which it refers, None where that does
    not matter. name: such as "RR.toe" or "front_setback_to_centreline". coverage_factor: for 95 %.
    contributions: (K,) shares of the variance by uncertainty component. through_frame: share that
    arises through the centres, which define the frame.
    """

    row: int
    subject: str
    kind: str
    axis: Axis | None
    name: str
    unit: Unit
    value: float
    u: float
    dof: float
    coverage_factor: float
    contributions: Array
    through_frame: float

    @property
    def expanded(self) -> float:
        """Half width of the 95 % interval."""
        return self.coverage_factor * self.u


def stated(measurement: Measurement) -> list[Stated]:
    """Return every quantity of the evaluated wheels, then of the vehicle, with its budget."""
    known = measurement.uncertainty
    total = np.diag(known.covariance)
    whole = np.where(total > 0.0, total, math.inf)
    contributions = known.contributions / whole[:, None]
    through_frame = (known.through_frame / whole).tolist()
    values, dof = known.values.tolist(), known.dof.tolist()
    standard, factor = known.standard.tolist(), known.coverage_factor.tolist()
    wheels = [w.observation.name for w in measurement.wheels if w.evaluated is not None]
    of_wheels = [
        (wheel, entry.kind, entry.axis, f"{wheel}.{entry.name}", RADIAN)
        for entry in WHEEL
        for wheel in wheels
    ]
    of_vehicle = [("vehicle", entry.kind, entry.axis, entry.name, entry.unit) for entry in VEHICLE]
    return [
        Stated(
            i,
            *names,
            value=values[i],
            u=standard[i],
            dof=dof[i],
            coverage_factor=factor[i],
            contributions=contributions[i],
            through_frame=through_frame[i],
        )
        for i, names in enumerate([*of_wheels, *of_vehicle])
    ]


def by_name(measurement: Measurement) -> dict[str, Stated]:
    """Return the quantities by name: `RR.toe`, `thrust_angle`."""
    return {quantity.name: quantity for quantity in stated(measurement)}


def workshop_angles(measurement: Measurement) -> list[Stated]:
    """Return Radversatz front and rear, and Radstandsdifferenz, as the angles of German workshops.

    Radversatz: of the line through an axle's wheel centres against the normal of the thrust line,
    positive with the right wheel ahead. Radstandsdifferenz: front less rear, positive with the
    right wheelbase longer.
    """
    known = by_name(measurement)
    values, slopes = {}, {}
    for axle in ("front", "rear"):
        back, track = known[f"{axle}_setback_to_thrust_line"], known[f"{axle}_track"]
        ratio = back.value / track.value
        slope = np.zeros(len(measurement.uncertainty.values))
        slope[[back.row, track.row]] = np.array([-1.0, ratio]) / (
            track.value * math.sqrt(1.0 - ratio**2)
        )
        values[axle], slopes[axle] = -math.asin(ratio), slope
    kinds = {f"{axle}_setback_angle": (values[axle], slopes[axle]) for axle in values}
    kinds["wheelbase_angle"] = values["front"] - values["rear"], slopes["front"] - slopes["rear"]
    return [_combined(measurement, kind, value, slope) for kind, (value, slope) in kinds.items()]


def _combined(measurement: Measurement, kind: str, value: float, slope: Array) -> Stated:
    """Return a function of quantities, by its derivatives (Q,); nu: the least of those it uses."""
    known = measurement.uncertainty
    u = math.sqrt(max(0.0, float(slope @ known.covariance @ slope)))
    dof = float(known.dof[slope != 0.0].min())
    factor = float(coverage_factor(LEVEL, np.array([dof]))[0])
    none = np.zeros(len(known.components))
    return Stated(-1, "vehicle", kind, None, kind, RADIAN, value, u, dof, factor, none, math.nan)


def against(quantities: Sequence[Stated], axis: Axis) -> list[Stated]:
    """Select the quantities that refer to `axis`, or to none, kind by kind."""
    chosen: dict[str, list[Stated]] = {quantity.kind: [] for quantity in quantities}
    for quantity in quantities:
        if quantity.axis in (None, axis):
            chosen[quantity.kind].append(quantity)
    return [quantity for of_kind in chosen.values() for quantity in of_kind]


def by_kind(quantities: Sequence[Stated], axis: Axis) -> dict[tuple[str, str], Stated]:
    """Return the quantities that refer to `axis`, or to none, by subject and kind."""
    return {(quantity.subject, quantity.kind): quantity for quantity in against(quantities, axis)}


# Quantities of wheels in several positions, by name: attributes of SteeringAxis, of Runout.
WHEEL_BY_SWEEP = {
    "caster": "caster",
    "sai": "inclination",
    "included_angle": "included_angle",
    "lateral_offset": "lateral_offset",
    "longitudinal_offset": "longitudinal_offset",
}
WHEEL_BY_RUNOUT = {"axial_runout": "axial_runout", "radial_runout": "radial_runout"}
CROSS = {"cross_caster": "caster", "cross_sai": "sai"}  # left less right
TURNS = ("toe_out_left", "toe_out_right", "toe_out_difference")  # left less right
VEHICLE_BY_SWEEP = (*CROSS, *TURNS)  # of the vehicle
UNITS: dict[str, Unit] = {
    "lateral_offset": "m",
    "longitudinal_offset": "m",
    "radial_runout": "m",
}  # of the others: radians


@frozen
class Quantity:
    """Measured quantity: value and standard uncertainty in its unit, None where unmeasured.

    subject: name of the wheel or trial, or "vehicle". reason: why it was not measured. dof: degrees
    of freedom of u. inner_rad: angle of the inner wheel, of toe-out on turns. source: its row in
    the measurement's covariance, or the estimate that it is, by which it covaries with others.
    uniform: share of a rectangular part in u. doubts: notes by which it may be of another wheel.
    """

    name: str
    subject: str
    wheel: str | None
    unit: Unit
    value: float | None
    u: float | None
    reason: str = ""
    dof: float = math.inf
    inner_rad: float | None = None
    source: int | Estimate | None = None
    uniform: float = 0.0
    doubts: tuple[Doubt, ...] = ()


def turned_quantity(measurement: Measurement, name: str, wheel: str) -> Quantity:
    """Return a quantity of WHEEL_BY_SWEEP or WHEEL_BY_RUNOUT of one wheel."""
    return _quantity(name, wheel, wheel, _of_wheel(measurement, name, wheel))


def steering_quantity(measurement: Measurement, name: str, inner_rad: float) -> Quantity:
    """Return a quantity of CROSS, or of TURNS with the inner wheel at an angle."""
    if name in CROSS:
        sides = (_of_wheel(measurement, CROSS[name], wheel) for wheel in ("FL", "FR"))
        return _quantity(name, "vehicle", None, _difference(*sides))
    left, right = (_toe_out(measurement, turn, inner_rad) for turn in ("left", "right"))
    chosen = {"toe_out_left": left, "toe_out_right": right}
    found = _quantity(name, "vehicle", None, chosen.get(name) or _difference(left, right))
    return replace(found, inner_rad=inner_rad)


def _quantity(name: str, subject: str, wheel: str | None, found: Estimate | str) -> Quantity:
    unit = UNITS.get(name, RADIAN)
    if isinstance(found, str):
        return Quantity(name, subject, wheel, unit, None, None, f"not measured{found}")
    return Quantity(name, subject, wheel, unit, found.value, found.u, dof=found.dof, source=found)


def _of_wheel(measurement: Measurement, name: str, wheel: str) -> Estimate | str:
    """Return an estimate, or why there is none; caster may be known where SAI is not."""
    steered = name in WHEEL_BY_SWEEP
    records: tuple[SteeringAxis | Runout, ...] = (
        measurement.steering_axes if steered else measurement.runouts
    )
    record = next((one for one in records if one.wheel == wheel), None)
    if record is None:
        return f": the capture has no {'steering sweep' if steered else 'run-out scans'} of {wheel}"
    found: Estimate | None = getattr(record, (WHEEL_BY_SWEEP | WHEEL_BY_RUNOUT)[name])
    if found is None or record.status not in ("ok", "range-too-small"):
        return f", {record.status}: {record.reason}"
    return found


def _toe_out(measurement: Measurement, turn: str, inner_rad: float) -> Estimate | str:
    curve = next((found for found in measurement.toe_out if found.turn == turn), None)
    if curve is None:
        return ": the capture has no steering sweep of both front wheels at the same positions"
    found = toe_out_at(curve, inner_rad)
    return found.difference or f", {found.status}: {found.reason}"


def _difference(left: Estimate | str, right: Estimate | str) -> Estimate | str:
    if isinstance(left, str) or isinstance(right, str):
        return left if isinstance(left, str) else right
    return weighted_sum([(1.0, left), (-1.0, right)])
