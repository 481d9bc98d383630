"""A measurement against a tolerance: conform, not conform or undecided, and at what risk.

A result y with standard uncertainty u stands for a true value distributed as N(y, u^2): normal, and
nothing known of the vehicle beforehand. Where u has few degrees of freedom, Student's t takes the
place of the normal.
- probability of conformity p = Phi((upper - y)/u) - Phi((lower - y)/u);
- conform: p >= confidence, so y keeps a guard band g from each limit; g = k u with
  k = Phi^-1(confidence) where the other limit is far, more where it is within some 6 u, and no y
  is conform where the limits are nearer than 2 Phi^-1((1 + confidence)/2) u;
- not conform: y is beyond one limit by k u or more, so that limit is exceeded with at least this
  confidence; else undecided. The simple rule: k = g = 0, so nothing that was measured is undecided.
- specific consumer's risk, of a conform verdict: 1 - p; producer's, of a not conform one: p.
Source: JCGM 106:2012, clauses 7 to 9; ISO 14253-1:2017, whose default confidence is 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from ..uncertainty import quantile, tail
from ..vehicle import REFERENCE_WHEELS
from .quantities import Stated, by_name
from .records import Measurement, WheelResult
from .tolerance import Tolerance, ToleranceInterval

Decision = Literal["conform", "undecided", "not conform"]
Unit = Literal["rad", "m"]
BISECTIONS = 60  # of an interval of 0.3 u: below the rounding of float64


@dataclass(frozen=True)
class Quantity:
    """One measured quantity: value and standard uncertainty in its unit, None where unmeasured.

    subject: name of the wheel or trial, or "vehicle". reason: why it was not measured. freedom:
    degrees of freedom of u.
    """

    name: str
    subject: str
    wheel: str | None
    unit: Unit
    value: float | None
    u: float | None
    reason: str = ""
    dof: float = math.inf


@dataclass(frozen=True)
class Verdict:
    """What is decided of one quantity; None where that does not apply or cannot be said.

    zone: of its limits; None of a trial that was not measured and belongs to no wheel.
    guard_band: inwards from each limit, in the quantity's unit; None where no value is conform.
    probability: of conformity. risk: of this verdict being wrong: the specific consumer's of a
    conform, the specific producer's of a not conform one. reason: of an undecided one.
    """

    quantity: Quantity
    interval: ToleranceInterval | None
    decision: Decision
    guard_band: float | None = None
    probability: float | None = None
    risk: float | None = None
    reason: str = ""


Limited = tuple[Quantity, ToleranceInterval | None]


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
    return Conformity(
        tolerance, tuple(decide(what, interval, tolerance) for what, interval in limited)
    )


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
        intervals = anywhere if result.wheel is None else tolerance.of_wheel(result.wheel)
        for name, interval in intervals.items():
            yield _of_wheel(result, name, known), interval


def _of_wheel(result: WheelResult, name: str, known: Mapping[str, Stated]) -> Quantity:
    seen = result.observation
    if result.angles is None:
        reason = f"not measured, {seen.status}: {seen.reason}"
        return Quantity(name, seen.name, result.wheel, "rad", None, None, reason)
    what = known[f"{seen.name}.{name}"]
    return Quantity(name, seen.name, result.wheel, "rad", what.value, what.u, dof=what.dof)


def _of_vehicle(tolerance: Tolerance, known: Mapping[str, Stated]) -> Iterator[Limited]:
    for name, interval in tolerance.of_vehicle().items():
        what = known[name]
        unit, value, u, dof = what.unit, what.value, what.u, what.dof
        yield Quantity(name, "vehicle", None, unit, value, u, dof=dof), interval


def decide(quantity: Quantity, interval: ToleranceInterval | None, tolerance: Tolerance) -> Verdict:
    """Decide on one quantity by the tolerance's rule; what has no finite value is undecided."""
    y, u = quantity.value, quantity.u
    if interval is None or y is None or u is None or not (math.isfinite(y) and math.isfinite(u)):
        reason = quantity.reason or "its value or its uncertainty is not known"
        return Verdict(quantity, interval, "undecided", reason=reason)
    dof = quantity.dof
    g, reach = guard_band(u, interval, tolerance, dof), _one_sided(tolerance, dof) * u
    inside, outside = probabilities(y, u, interval, dof)
    if g is not None and interval.lower + g <= y <= interval.upper - g:
        return Verdict(quantity, interval, "conform", g, inside, outside)
    if y <= interval.lower - reach or y >= interval.upper + reach:
        return Verdict(quantity, interval, "not conform", g, inside, inside)
    side = "lower" if y - interval.lower < interval.upper - y else "upper"
    reason = f"nearer to the {side} limit than its uncertainty allows"
    if g is None:
        needed = _text(interval.width / (2.0 * _two_sided(tolerance, dof)), quantity.unit)
        reason = f"undecidable, u is too large for this tolerance: it takes u of {needed} or less"
    return Verdict(quantity, interval, "undecided", g, inside, reason=reason)


def probabilities(
    y: float, u: float, interval: ToleranceInterval, dof: float = math.inf
) -> tuple[float, float]:
    """Give p that the true value lies in the zone, and 1 - p, each precise where it is tiny."""
    if u == 0.0:
        inside = float(interval.lower <= y <= interval.upper)
        return inside, 1.0 - inside
    below, above = (interval.lower - y) / u, (y - interval.upper) / u
    inside = tail(max(below, above), dof) - tail(-min(below, above), dof)
    return inside, tail(-below, dof) + tail(-above, dof)


def guard_band(
    u: float, interval: ToleranceInterval, tolerance: Tolerance, dof: float = math.inf
) -> float | None:
    """Least distance from both limits at which p >= confidence; None where none suffices.

    Between k u, for the tail beyond the near limit, and the two-sided k u, reached in the middle.
    """
    if u == 0.0 or tolerance.rule == "simple" or math.isinf(interval.width):
        return _one_sided(tolerance, dof) * u
    low, high = _one_sided(tolerance, dof), _two_sided(tolerance, dof)
    width = interval.width / u
    if width < 2.0 * high:
        return None
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        if tail(middle, dof) + tail(width - middle, dof) > 1.0 - tolerance.confidence:
            low = middle
        else:
            high = middle
    return high * u


def _one_sided(tolerance: Tolerance, dof: float) -> float:
    return quantile(tolerance.confidence, dof) if tolerance.rule == "guarded" else 0.0


def _two_sided(tolerance: Tolerance, dof: float) -> float:
    return quantile((1.0 + tolerance.confidence) / 2.0, dof)


def _text(value: float, unit: Unit) -> str:
    return f"{value * 1e3:.3g} mm" if unit == "m" else f'{math.degrees(value) * 3600:.3g}"'
