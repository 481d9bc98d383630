"""Plan of a calibration: what a set of trials and readings shows, and what it takes to show more.

It runs through the functions of the calibration itself, with readings that scatter as planned.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Set
from dataclasses import replace

import numpy as np

from ..measurement import Estimate, estimate
from ..system import frozen
from ..uncertainty import Effect, power_of_t
from ..vehicle import Unit
from .forms.item import Item
from .forms.plan_file import Plan
from .forms.quantities import QUANTITIES
from .line import characteristic
from .records import Origin
from .reference import Reference, joint_effects
from .scatter import (
    Between,
    deviation_with,
    difference_effects,
    mean_effects,
    rounding_by_level,
    rounding_covariance,
)

CONFIDENCE, POWER = 0.95, 0.95
MOST_REPEATS, MOST_TRIALS = 200, 40
NewReference = Callable[[int], Reference]  # by the number of trials


@frozen
class Detection:
    """An error to be detected, its estimate's u, and the power of the test at 95 % confidence.

    name: zero, gain or hysteresis. trials: the fewest, placed as the plan places them, that detect
    it with a power of 95 %; None where none of up to MOST_TRIALS do, or where the set is given.
    """

    name: str
    size: float
    known: Estimate
    power: float
    trials: int | None = None

    @property
    def expanded(self) -> float:
        """Expanded uncertainty of the estimate."""
        return self.known.expanded


@frozen
class QuantityPlan:
    """Expected uncertainties of one quantity; radians or metres.

    error: of the point with the largest u; reference: u of its reference value. ratio: of MPE to U.
    zero, sensitivity, hysteresis: estimates without their values; None where the set shows none.
    wanted: U that is wanted. repeats: by which it is reached with this reference; None: not by up
    to MOST_REPEATS. u_reference: the largest that reaches it with the planned repeats; None: the
    readings alone are too uncertain.
    """

    quantity: str
    unit: Unit
    points: tuple[str, ...]
    reference: float
    error: Estimate
    ratio: float | None
    zero: Estimate
    sensitivity: Estimate | None
    hysteresis: Estimate | None
    detections: tuple[Detection, ...]
    wanted: float | None
    repeats: int | None
    u_reference: float | None


@frozen
class CalibrationPlan:
    """Plan of all quantities; places: wheel, toe and camber of each trial, where it is free."""

    plan: Plan
    source: str
    quantities: tuple[QuantityPlan, ...]
    places: tuple[tuple[str, str, float, float], ...]


def plan_calibration(
    plan: Plan, item: Item, reference: Reference, new_reference: NewReference | None
) -> CalibrationPlan:
    """Return what the planned set shows. Raises ValueError for a table that cannot be used.

    new_reference: makes a reference with another number of trials; None where the set is given.
    """
    found = [_quantity(kind, plan, item, reference, new_reference) for kind in plan.quantities()]
    measured = reference.measurement
    places = tuple(
        (wheel.observation.name, str(wheel.wheel), wheel.angles.toe_rad, wheel.angles.camber_rad)
        for wheel in measured.wheels
        if wheel.observation.role == "trial" and wheel.angles is not None
    )
    return CalibrationPlan(plan, reference.source, tuple(found), places)


def _quantity(
    kind: str, plan: Plan, item: Item, reference: Reference, new_reference: NewReference | None
) -> QuantityPlan:
    if kind not in item.declared():
        raise ValueError(f"plan.{kind}: the item file has no [item.{kind}]: declare it there")
    set_ = planned_set(kind, plan, item, reference)
    mpe = item.value(kind, "mpe")
    table = plan.quantities()[kind]
    wanted = plan.value(kind, "wanted", item)
    if table.ratio is not None:
        if mpe is None:
            raise ValueError(f"plan.{kind}.ratio: the item file states no mpe of {kind}: add it")
        wanted = mpe / table.ratio
    worst = max(range(len(set_.points)), key=lambda i: set_.errors[i].u)
    error, known = set_.errors[worst], set_.references[worst].u
    repeats = u_reference = None
    if wanted is not None:
        repeats = _repeats(kind, plan, item, reference, wanted)
        of_readings = math.sqrt(max(0.0, error.u**2 - known**2))
        left = (wanted * error.u / error.expanded) ** 2 - of_readings**2
        u_reference = math.sqrt(left) if left > 0.0 else None
    found, fewest = detections(kind, plan, item, set_), {}
    if new_reference is not None:
        fewest = _fewest_trials({one.name for one in found}, kind, plan, item, new_reference)
    return QuantityPlan(
        quantity=kind,
        unit=QUANTITIES[kind].unit,
        points=set_.points,
        reference=known,
        error=error,
        ratio=None if mpe is None else mpe / error.expanded,
        zero=set_.zero,
        sensitivity=set_.sensitivity,
        hysteresis=set_.hysteresis,
        detections=tuple(replace(one, trials=fewest.get(one.name)) for one in found),
        wanted=wanted,
        repeats=repeats,
        u_reference=u_reference,
    )


@frozen
class PlannedSet:
    """Estimates, without their values, that a set of points and readings gives."""

    points: tuple[str, ...]
    references: tuple[Estimate, ...]
    errors: tuple[Estimate, ...]
    zero: Estimate
    sensitivity: Estimate | None
    hysteresis: Estimate | None


def planned_set(kind: str, plan: Plan, item: Item, reference: Reference) -> PlannedSet:
    """Return the uncertainties that a calibration at all points of a reference would state.

    Raises ValueError where the reference has no point of the quantity.
    """
    points = reference.points(kind, item)
    if not points:
        axis = item.declared()[kind].axis
        raise ValueError(
            f"plan.{kind}: the reference has no point of it; from axis = {str(axis)!r} of the item "
            f"file it may be zero by definition: declare another axis, or leave out [plan.{kind}]"
        )
    values = [reference.value(kind, point, item) for point in points]
    known = [one for one in values if isinstance(one, Estimate)]
    deviation = plan.value(kind, "repeatability", item) or 0.0
    between = plan.value(kind, "reproducibility", item) or 0.0
    resolution, count = item.resolution(kind), len(points)
    ways = 2 if plan.directions else 1
    in_cell = plan.repeats * ways
    dof = float(count * plan.series * ways * (plan.repeats - 1))
    apart = (plan.value(kind, "hysteresis", item) or 0.0) if plan.directions else 0.0
    whole = deviation_with(deviation, resolution, between if plan.series > 1 else 0.0)
    own, shared = (
        float(rounding_covariance(each, resolution, np.linspace(apart, 0.0, ways)).mean())
        for each in (deviation, whole)
    )
    rest = deviation**2 / in_cell + max(0.0, own - shared)
    each = Between(plan.series, count * between**2 + rest, rest)
    squares = [] if plan.series == 1 else [each]
    spread = np.full(count, 1.0 / (in_cell * plan.series))
    readings = mean_effects(spread, deviation, dof, squares, shared)
    budget: list[tuple[Origin, Effect]] = [("reference", one) for one in joint_effects(known)]
    budget += [("readings", one) for one in readings]
    effects = [effect for _, effect in budget]
    line = characteristic(points, known, np.zeros(count), budget)
    hysteresis = None
    if plan.directions and (dof > 0.0 or plan.series > 1):
        common, alone = rounding_by_level(np.full(count, apart), deviation, whole, resolution)
        of_one = 4.0 * deviation**2 / in_cell + alone
        table = [] if plan.series == 1 else [Between(plan.series, of_one, of_one)]
        of_both = common + (0.0 if table else alone)
        difference = difference_effects(4.0 * spread, deviation, dof, table, of_both)
        hysteresis = estimate(0.0, np.full(count, 1.0 / count), difference)
    errors = tuple(estimate(0.0, row, effects) for row in np.eye(count))
    return PlannedSet(tuple(points), tuple(known), errors, line.zero, line.sensitivity, hysteresis)


def detections(kind: str, plan: Plan, item: Item, set_: PlannedSet) -> list[Detection]:
    """Return the errors that the plan wants detected, with the power of the set."""
    sizes = {
        "zero": (plan.value(kind, "zero", item), set_.zero),
        "gain": (plan.quantities()[kind].gain, set_.sensitivity),
        "hysteresis": (plan.value(kind, "hysteresis", item), set_.hysteresis),
    }
    return [
        Detection(name, size, known, power(size, known))
        for name, (size, known) in sizes.items()
        if size is not None and known is not None
    ]


def power(size: float, known: Estimate) -> float:
    """Return the probability that an estimate of an error of this size exceeds its U."""
    if not known.u > 0.0:
        return 1.0
    return power_of_t(abs(size) / known.u, CONFIDENCE, known.dof, known.uniform)


def _repeats(kind: str, plan: Plan, item: Item, reference: Reference, wanted: float) -> int | None:
    """Return the fewest repeats by which every point reaches the wanted U, which falls with each.

    None where MOST_REPEATS do not.
    """

    def reached(repeats: int) -> bool:
        more = plan.model_copy(update={"repeats": repeats})
        errors = planned_set(kind, more, item, reference).errors
        return max(one.expanded for one in errors) <= wanted

    numbers = range(2 if plan.series == 1 else 1, MOST_REPEATS + 1)
    index = bisect_left(numbers, True, key=reached)
    return numbers[index] if index < len(numbers) else None


def _fewest_trials(
    names: Set[str], kind: str, plan: Plan, item: Item, new_reference: NewReference
) -> dict[str, int]:
    """Return the fewest trials by which each of the named errors is detected with POWER.

    Every number is tried in turn: one trial more moves all others, so that the power may fall.
    """
    fewest: dict[str, int] = {}
    for trials in range(MOST_TRIALS + 1):
        if names <= fewest.keys():
            break
        set_ = planned_set(kind, plan, item, new_reference(trials))
        for one in detections(kind, plan, item, set_):
            if one.power >= POWER:
                fewest.setdefault(one.name, trials)
    return fewest
