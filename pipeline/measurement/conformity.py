"""Conformity with a tolerance: conforming, nonconforming or undecided, and the risk of error.

Given a result y with standard uncertainty u, the true value is distributed as N(y, u^2): a normal
distribution, without prior knowledge of the vehicle. Where u has few degrees of freedom, Student's
t distribution replaces the normal; where a part of u is rectangular, its convolution with that.
- probability of conformity p = Phi((upper - y)/u) - Phi((lower - y)/u);
- conforming: p >= confidence, so y keeps a guard band g from each limit; g = k u with
  k = Phi^-1(confidence) where the other limit is far, more where it is within some 6 u; no y is
  conforming where the limits are closer than 2 Phi^-1((1 + confidence)/2) u;
- nonconforming: y is beyond one limit by k u or more, so that limit is exceeded with at least this
  confidence; else undecided. Simple rule: k = g = 0, so nothing that was measured is undecided,
  unless notes put in doubt of which wheel it is;
- specific consumer's risk of a conforming verdict: 1 - p; producer's of a nonconforming one: p;
- probability that all conform: each distributed as above, jointly by the covariance (a normal
  copula), by draws.
Source: JCGM 106:2012, clauses 7 to 9; ISO 14253-1:2017, whose default confidence is 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from ..errors import Doubt
from ..system import frozen
from ..uncertainty import box_probability, normal_scores, quantile, tail
from ..vehicle import REFERENCE_WHEELS, Unit
from .estimates import joint_covariance
from .quantities import (
    VEHICLE_BY_SWEEP,
    WHEEL_BY_RUNOUT,
    WHEEL_BY_SWEEP,
    Quantity,
    Stated,
    by_name,
    steering_quantity,
    turned_quantity,
)
from .records import Measurement, WheelResult
from .tolerance import ToleranceInterval

if TYPE_CHECKING:
    from .tolerance.model import Tolerance

Decision = Literal["conform", "undecided", "not conform"]
BISECTIONS = 60  # of an interval of 0.3 u: below the rounding of float64


class Deciding(Protocol):
    """Decision rule, and the confidence of a guarded one: a tolerance's, or a calibration's."""

    @property
    def rule(self) -> str: ...  # noqa: D102
    @property
    def confidence(self) -> float: ...  # noqa: D102


@frozen
class Verdict:
    """Decision on one quantity; fields that do not apply or cannot be computed are None.

    interval: of its limits; None for a trial that was not measured and belongs to no wheel.
    guard_band: inwards from each limit, in the quantity's unit; None where no value is conforming.
    probability: of conformity. risk: of a wrong verdict: the specific consumer's of a conforming,
    the specific producer's of a nonconforming one. reason: of an undecided one. factor: k
    of the guard at a single limit.
    """

    quantity: Quantity
    interval: ToleranceInterval | None
    decision: Decision
    guard_band: float | None = None
    probability: float | None = None
    risk: float | None = None
    reason: str = ""
    factor: float | None = None


Limited = tuple[Quantity, ToleranceInterval | None]


@frozen
class Conformity:
    """Verdicts by one tolerance, wheels in the measurement's order, then the vehicle.

    probability: that all conform, by their covariance; None where one was not measured.
    """

    tolerance: Tolerance
    verdicts: tuple[Verdict, ...]
    probability: float | None = None

    @property
    def decision(self) -> Decision:
        """Worst of all verdicts: "not conform", "undecided", "conform" in this order."""
        found = {verdict.decision for verdict in self.verdicts}
        worst: tuple[Decision, ...] = ("not conform", "undecided")
        return next((decision for decision in worst if decision in found), "conform")

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Notes that leave quantities undecided, each once."""
        return tuple(dict.fromkeys(one for v in self.verdicts for one in v.quantity.doubts))

    @property
    def factors(self) -> tuple[float, float]:
        """Least and largest k by which a single limit is guarded."""
        used = [verdict.factor for verdict in self.verdicts if verdict.factor is not None]
        used = used or [self.tolerance.coverage_factor]
        return min(used), max(used)

    @property
    def joint_bounds(self) -> tuple[float, float]:
        """Bounds of the probability that all are conforming, for any correlation (Bonferroni)."""
        each = [verdict.probability for verdict in self.verdicts]
        missed = math.fsum(1.0 if p is None else 1.0 - p for p in each)
        return max(0.0, 1.0 - missed), min((p for p in each if p is not None), default=1.0)


def assess(measurement: Measurement, tolerance: Tolerance) -> Conformity:
    """Assess every quantity that the tolerance limits, each on its own."""
    limited = [*_of_wheels(measurement, tolerance), *_of_vehicle(measurement, tolerance)]
    verdicts = tuple(
        decide(_in_doubt(what, measurement), interval, tolerance) for what, interval in limited
    )
    found = Conformity(tolerance, verdicts)
    return replace(found, probability=_joint_probability(measurement, found))


def conforms(conformity: Conformity | None) -> bool:
    """Return whether every limited quantity is conforming; True without a tolerance."""
    return conformity is None or conformity.decision == "conform"


def _joint_probability(measurement: Measurement, found: Conformity) -> float | None:
    """Return the probability that all conform, within its bounds for any correlation."""
    items, sources = [], []
    for verdict in found.verdicts:
        what, interval = verdict.quantity, verdict.interval
        if verdict.probability is None or interval is None or what.source is None:
            return None
        if what.u:
            items.append((what.value, what.u, what.dof, interval.lower, interval.upper))
            sources.append(what.source)
    low, high = found.joint_bounds
    if not items:
        return high
    y, u, dof, lower, upper = np.array(items).T
    correlation = joint_covariance(measurement, sources) / np.outer(u, u)
    least, most = (normal_scores((limit - y) / u, dof) for limit in (lower, upper))
    return min(max(box_probability(least, most, correlation), low), high)


def _in_doubt(what: Quantity, measurement: Measurement) -> Quantity:
    about = tuple(doubt for doubt in measurement.doubts if doubt.is_about(what.subject))
    return what if what.value is None else replace(what, doubts=about)


def _of_wheels(measurement: Measurement, tolerance: Tolerance) -> Iterator[Limited]:
    known = by_name(measurement)
    anywhere = {name: None for wheel in REFERENCE_WHEELS for name in tolerance.of_wheel(wheel)}
    for result in measurement.wheels:
        role = result.observation.role
        if role in ("sweep", "runout") or (role == "trial" and not tolerance.trials):
            continue
        intervals = anywhere if result.wheel is None else tolerance.of_wheel(result.wheel)
        for name, interval in intervals.items():
            if name not in WHEEL_BY_SWEEP | WHEEL_BY_RUNOUT:
                yield _of_wheel(result, name, known), interval
            elif role == "reference":
                yield turned_quantity(measurement, name, str(result.wheel)), interval


def _of_wheel(result: WheelResult, name: str, known: Mapping[str, Stated]) -> Quantity:
    observation = result.observation
    if result.angles is None:
        reason = f"not measured, {observation.status}: {observation.reason}"
        return Quantity(name, observation.name, result.wheel, "rad", None, None, reason)
    what = known[f"{observation.name}.{name}"]
    return _quantity(what, name, observation.name, result.wheel)


def _quantity(what: Stated, name: str, subject: str, wheel: str | None) -> Quantity:
    return Quantity(
        name, subject, wheel, what.unit, what.value, what.u, dof=what.dof, source=what.row
    )


def _of_vehicle(measurement: Measurement, tolerance: Tolerance) -> Iterator[Limited]:
    known = by_name(measurement)
    for name, interval in tolerance.of_vehicle().items():
        if name in VEHICLE_BY_SWEEP:
            yield steering_quantity(measurement, name, tolerance.inner_rad(name)), interval
        else:
            yield _quantity(known[name], name, "vehicle", None), interval


def decide(quantity: Quantity, interval: ToleranceInterval | None, tolerance: Deciding) -> Verdict:
    """Decide on one quantity by the tolerance's rule; undecided in doubt, or without a value."""
    y, u = quantity.value, quantity.u
    if interval is None or y is None or u is None or not (math.isfinite(y) and math.isfinite(u)):
        reason = quantity.reason or "its value or its uncertainty is not known"
        return Verdict(quantity, interval, "undecided", reason=reason)
    if quantity.doubts:
        return Verdict(quantity, interval, "undecided", reason=" ".join(quantity.doubts))
    shape = quantity.dof, quantity.uniform
    g, k = guard_band(u, interval, tolerance, *shape), _one_sided(tolerance, *shape)
    outer = k * u
    inside, outside = probabilities(y, u, interval, *shape)
    if g is not None and interval.lower + g <= y <= interval.upper - g:
        return Verdict(quantity, interval, "conform", g, inside, outside, factor=k)
    if y <= interval.lower - outer or y >= interval.upper + outer:
        return Verdict(quantity, interval, "not conform", g, inside, inside, factor=k)
    side = "lower" if y - interval.lower < interval.upper - y else "upper"
    reason = f"nearer to the {side} limit than its uncertainty allows"
    if g is None:
        needed = _text(interval.width / (2.0 * _two_sided(tolerance, *shape)), quantity.unit)
        reason = f"u is too large for this tolerance: it must be {needed} or less"
    return Verdict(quantity, interval, "undecided", g, inside, reason=reason, factor=k)


def probabilities(
    y: float, u: float, interval: ToleranceInterval, dof: float = math.inf, uniform: float = 0.0
) -> tuple[float, float]:
    """Return the probability p of conformity, and 1 - p, each precise where it is tiny.

    uniform: share of a rectangular part in u.
    """
    if u == 0.0:
        inside = float(interval.lower <= y <= interval.upper)
        return inside, 1.0 - inside
    below, above = (interval.lower - y) / u, (y - interval.upper) / u
    inside = tail(max(below, above), dof, uniform) - tail(-min(below, above), dof, uniform)
    return inside, tail(-below, dof, uniform) + tail(-above, dof, uniform)


def guard_band(
    u: float,
    interval: ToleranceInterval,
    tolerance: Deciding,
    dof: float = math.inf,
    uniform: float = 0.0,
) -> float | None:
    """Return the least distance from both limits at which p >= confidence; None if there is none.

    Between k u, for the tail beyond the near limit, and the two-sided k u, reached in the middle.
    """
    if u == 0.0 or tolerance.rule == "simple" or math.isinf(interval.width):
        return _one_sided(tolerance, dof, uniform) * u
    low, high = _one_sided(tolerance, dof, uniform), _two_sided(tolerance, dof, uniform)
    width = interval.width / u
    if width < 2.0 * high:
        return None
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        beyond = tail(middle, dof, uniform) + tail(width - middle, dof, uniform)
        if beyond > 1.0 - tolerance.confidence:
            low = middle
        else:
            high = middle
    return high * u


def _one_sided(tolerance: Deciding, dof: float, uniform: float) -> float:
    return quantile(tolerance.confidence, dof, uniform) if tolerance.rule == "guarded" else 0.0


def _two_sided(tolerance: Deciding, dof: float, uniform: float) -> float:
    return quantile((1.0 + tolerance.confidence) / 2.0, dof, uniform)


def _text(value: float, unit: Unit) -> str:
    return f"{value * 1e3:.3g} mm" if unit == "m" else f'{math.degrees(value) * 3600:.3g}"'
