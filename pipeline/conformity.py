"""A measurement against a tolerance: a verdict on every quantity that it limits, and the worst."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pipeline.judge import Decision, Quantity, Verdict, judge
from pipeline.measurement import Measurement, WheelResult
from pipeline.quantities import Stated, by_name
from pipeline.reference_frame import REFERENCE_WHEELS
from pipeline.tolerance import Tolerance, Zone

Limited = tuple[Quantity, Zone | None]


@dataclass(frozen=True)
class Conformity:
    """All verdicts by one tolerance, wheels in the measurement's order, then the vehicle."""

    tolerance: Tolerance
    verdicts: tuple[Verdict, ...]

    @property
    def decision(self) -> Decision:
        """The worst of all: not conform, undecided, conform."""
        found = {verdict.decision for verdict in self.verdicts}
        worst: tuple[Decision, ...] = ("not conform", "undecided")
        return next((decision for decision in worst if decision in found), "conform")

    @property
    def joint_probability(self) -> tuple[float, float]:
        """Bounds of the probability that all conform, however they are correlated (Bonferroni)."""
        each = [verdict.probability for verdict in self.verdicts]
        missed = math.fsum(1.0 if p is None else 1.0 - p for p in each)
        return max(0.0, 1.0 - missed), min((p for p in each if p is not None), default=1.0)


def assess(measurement: Measurement, tolerance: Tolerance) -> Conformity:
    """Judge every quantity of the measurement that the tolerance limits, each on its own."""
    known = by_name(measurement)
    limited = [*_of_wheels(measurement, tolerance, known), *_of_vehicle(tolerance, known)]
    return Conformity(tolerance, tuple(judge(what, zone, tolerance) for what, zone in limited))


def conforms(conformity: Conformity | None) -> bool:
    """Whether all was shown to conform, or no tolerance was given."""
    return conformity is None or conformity.decision == "conform"


def _of_wheels(
    measurement: Measurement, tolerance: Tolerance, known: Mapping[str, Stated]
) -> Iterator[Limited]:
    anywhere = {name: None for wheel in REFERENCE_WHEELS for name in tolerance.of_wheel(wheel)}
    for result in measurement.wheels:
        role = result.observation.role
        if role in ("sweep", "runout") or (role == "trial" and not tolerance.trials):
            continue
        zones = anywhere if result.wheel is None else tolerance.of_wheel(result.wheel)
        for name, zone in zones.items():
            yield _of_wheel(result, name, known), zone


def _of_wheel(result: WheelResult, name: str, known: Mapping[str, Stated]) -> Quantity:
    seen = result.observation
    if result.angles is None:
        reason = f"not measured, {seen.status}: {seen.reason}"
        return Quantity(name, seen.name, result.wheel, "rad", None, None, reason)
    what = known[f"{seen.name}.{name}"]
    return Quantity(name, seen.name, result.wheel, "rad", what.value, what.u, freedom=what.freedom)


def _of_vehicle(tolerance: Tolerance, known: Mapping[str, Stated]) -> Iterator[Limited]:
    for name, zone in tolerance.of_vehicle().items():
        what = known[name]
        unit, value, u, freedom = what.unit, what.value, what.u, what.freedom
        yield Quantity(name, "vehicle", None, unit, value, u, freedom=freedom), zone
