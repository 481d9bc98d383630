"""Calibrations whose truth is known: a vehicle with trials, a reference, and a machine's readings.

The reference is the truth with errors drawn as its uncertainty states them; no scan is made.
"""

from __future__ import annotations

import math
import tomllib

import numpy as np

from tests.support.validation_cars import CENTRE, NORMAL, Car
from wheelplane.calibration import ItemFile, Reading, Readings, Reference
from wheelplane.calibration.forms.quantities import QUANTITIES, indicated
from wheelplane.measurement import Evidence, Observation, Provenance, Value, align
from wheelplane.measurement.evaluate import evaluate
from wheelplane.measurement.records import Vertical
from wheelplane.uncertainty import vertical_component
from wheelplane_synth.machine.forms import item_toml
from wheelplane_synth.machine.indicate import indicate
from wheelplane_synth.output.truth import Truth
from wheelplane_synth.parameters.machine import Identity, Indication, MachineFile, Protocol

NAMEPLATE = Identity(maker="Synthetic", model="Bay", serial="7", software="1.0")
TOE = Indication(
    positive="toe-in", axis="rear-axle", zero=1.0, gain=0.02, hysteresis=1.0, repeatability=0.3,
    resolution=0.1, mpe=6.0,
)  # fmt: skip
CAMBER = Indication(positive="top-out", repeatability=0.3, resolution=0.1, mpe=6.0)
ORIGIN = Provenance("bay", None, "0", {}, {}, 0)


def machine(**tables: object) -> MachineFile:
    """A machine file; by default one that indicates toe, in one series of three repeats."""
    tables = {"identity": NAMEPLATE, "protocol": Protocol(), "toe": TOE} | tables
    return MachineFile(**tables)


def changed(table: Indication, **values: object) -> Indication:
    """An indication with other values."""
    return table.model_copy(update=values)


def item_of(tested: MachineFile) -> ItemFile:
    """Its item file."""
    return ItemFile.model_validate(tomllib.loads(item_toml(tested)))


class Bay:
    """A vehicle with trials; normal, centre: standard uncertainties of its reference."""

    def __init__(self, seed=0, trials=8, normal=NORMAL, centre=CENTRE):
        self.car = Car(seed, trials)
        self.normal, self.centre = normal, centre
        self.truth = Truth(0, self.car.vehicle, tuple(self.car.drawn), {}).to_json()

    def reference(self, series=None, noisy=True) -> Reference:
        """A reference, drawn anew; noisy: False for the truth itself."""
        targets = self.car.dense(self.normal, self.centre).targets
        if not noisy:
            rows = zip(targets, self.car.normals, self.car.centres, strict=True)
            targets = [with_pose(target, normal, centre) for target, normal, centre in rows]
        pairs = zip(self.car.drawn, targets, strict=True)
        seen = [
            Observation(w.name, w.role, w.wheel, "f", "", 5, 0, evidence=Evidence(target))
            for w, target in pairs
        ]
        return Reference(align(seen, ORIGIN), series)

    def readings(self, tested: MachineFile, rng=None, state="as found") -> Readings:
        """The machine's readings."""
        rng = rng or self.car.rng
        return Readings("readings.csv", "", tuple(as_readings(self.truth, tested, rng, state)))


def with_pose(target, normal, centre):
    """A target's fit at another pose, its uncertainty as it is."""
    from dataclasses import replace

    return replace(target, normal=normal, centre_m=centre)


def as_readings(truth, tested, rng, state="as found"):
    """Readings as they would be read from the file."""
    for row, one in enumerate(indicate(truth, tested, rng), 2):
        quantity = QUANTITIES[one.quantity]
        length = quantity.unit == "m"
        given = Value(one.value / 1e3, "m") if length else Value(one.value / 60.0, "deg")
        yield Reading(
            one.point,
            one.quantity,
            indicated(given, quantity, None),
            "mm" if length else "min",
            str(one.series),
            one.repeat,
            one.direction,
            state,
            one.operator,
            row,
        )


def minutes(angle_rad) -> np.ndarray:
    """Angles in minutes of arc."""
    return np.degrees(angle_rad) * 60.0


def tilted(reference, kind="gravity", by_deg=0.5):
    """The same measurement, cambers from a vertical off the wheels' up."""
    known = reference.measurement
    up = known.frame.up + np.tan(np.radians(by_deg)) * known.frame.left
    up = up / np.linalg.norm(up)
    components = (vertical_component("vertical", up, 1e-4 * np.eye(3), math.inf),)
    vertical = Vertical(kind, up, components, "a level")
    observations = [wheel.observation for wheel in known.wheels]
    poses = [wheel.pose for wheel in known.wheels]
    return Reference(evaluate(observations, poses, known.provenance, (), vertical))
