"""List of all quantities of a measurement, in the order of its covariance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..vectors import Array
from ..vehicle import VEHICLE, WHEEL, Axis, Unit
from .records import Measurement

RADIAN: Unit = "rad"


@dataclass(frozen=True)
class Stated:
    """Quantity with its uncertainty, radians or metres.

    subject: name of the wheel, or "vehicle". kind: such as "toe" or "wheelbase". axis: longitudinal
    axis to which it refers, None where that does not matter. name: such as "RR.toe" or
    "front_setback_to_centreline". coverage_factor: for 95 %. contributions: (K,) shares of the
    variance by uncertainty component. through_frame: share that arises through the centres, which
    define the frame.
    """

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
    """Return every quantity of the measured wheels, then of the vehicle, with its budget."""
    known = measurement.uncertainty
    total = np.diag(known.covariance)
    whole = np.where(total > 0.0, total, math.inf)
    contributions = known.contributions / whole[:, None]
    through_frame = (known.through_frame / whole).tolist()
    values, dof = known.values.tolist(), known.dof.tolist()
    standard, factor = known.standard.tolist(), known.coverage_factor.tolist()
    wheels = [w.observation.name for w in measurement.wheels if w.angles is not None]
    of_wheels = [
        (wheel, entry.kind, entry.axis, f"{wheel}.{entry.name}", RADIAN)
        for entry in WHEEL
        for wheel in wheels
    ]
    of_vehicle = [("vehicle", entry.kind, entry.axis, entry.name, entry.unit) for entry in VEHICLE]
    return [
        Stated(
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


def against(quantities: Sequence[Stated], axis: Axis) -> list[Stated]:
    """Select the quantities that refer to `axis`, or to none, kind by kind."""
    order = list(dict.fromkeys(quantity.kind for quantity in quantities))
    chosen = [quantity for quantity in quantities if quantity.axis in (None, axis)]
    return sorted(chosen, key=lambda quantity: order.index(quantity.kind))
