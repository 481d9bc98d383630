"""Readings of one quantity in one state to errors of indication, their U and the verdicts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from ..errors import Doubt, Wording
from ..measurement import (
    Estimate,
    Quantity,
    ToleranceInterval,
    Verdict,
    VerticalKind,
    decide,
    estimate,
)
from ..uncertainty import Effect, effective_dof
from ..vectors import Array
from .forms.item import UPRIGHT, DecisionRule, Item
from .forms.quantities import QUANTITIES, as_shown
from .forms.readings import Reading
from .forms.table_file import Faults
from .gauge_rr import GaugeRR, gauge_rr
from .line import characteristic
from .records import (
    Adjustment,
    CalibrationPoint,
    Contribution,
    DirectionMean,
    Origin,
    QuantityResult,
)
from .reference import Reference, joint_effects, reference_of
from .scatter import RESOLUTION, Scatter, scatter_of
from .slips import copying_doubts

UNREAD = (
    "{kind}, {state}: point {point} has no reading in {where}: enter it, or leave out the other "
    "readings of {where}"
)
NOT_REPEATED = (
    "{kind}, {state}: no reading is repeated, so that its repeatability is not known: read each "
    "point twice or more"
)
OTHER_VERTICAL = (
    "{kind}: the item counts it from {stated}, the reference is measured from {found}: measure the "
    "reference with --vertical {stated}, or correct vertical in the item file"
)
UNLIKE_VERTICALS = (
    "{kind}: the references are measured from unlike verticals ({each}): measure all of them with "
    "the same --vertical"
)
UNLIKE: Final = "unlike"
ENOUGH, COARSER = 5, 1.5  # unlike readings that show a step, and times the declared one
BY_CHANCE = 1e-4
PARTS_OF = {"dms": (3600.0, 60.0, 1.0)}  # seconds in what a unit is written in
FIGURES, SMALL = 7, 1e-9
BELOW = "MPE/U is {value}, below the ratio of {ratio} agreed on"
SCATTERED = (
    "{kind}, {state}: the readings at {point} scatter by {own}, those of the other points by "
    "{others}, which chance does not explain: look at row {row}, {value}, the farthest from the "
    "others there, and correct it, or read the point again."
)
# Effects of noise in one scan, or of one survey by a total station, however well known.
OF_A_SCAN = (
    "plane noise", "centre noise", "surface noise", "range noise", "angle noise", "aiming",
)  # fmt: skip
SAME = 1e-14  # between mean values of the same references, by rounding
NEGLIGIBLE = 1e-9  # share of a variance that a budget leaves out
Level = tuple[str, str]  # series and operator
Budget = Sequence[tuple[Origin, Effect]]


def evaluate_quantity(
    readings: Sequence[Reading],
    references: Sequence[Reference],
    item: Item,
    rule: DecisionRule | None,
    faults: Faults,
) -> QuantityResult | None:
    """Evaluate the readings of one quantity in one state; None where a fault is noted."""
    kind, state = readings[0].quantity, readings[0].state
    points = list(dict.fromkeys(one.point for one in readings))
    levels = list(dict.fromkeys((one.series, one.operator) for one in readings))
    ways = sorted({one.direction for one in readings}, reverse=True)  # up before down
    cells = _cells(readings, points, levels, ways)
    vertical = _vertical(kind, levels, references, item, faults)
    if _incomplete(cells, readings, points, levels, ways, faults) or vertical == UNLIKE:
        return None
    values = _reference_values(points, levels, references, item, kind)
    of_levels = np.array([[one.value for one in level] for level in values]).T
    resolution = item.resolution(kind)
    coarser, finer = _steps(readings, resolution, item.rim_m)
    resolution = resolution if coarser is None else coarser
    scatter = scatter_of(cells, of_levels, resolution, factors_of(levels))
    known, budget = _references(values, levels, scatter, resolution)
    effects = [effect for _, effect in budget]
    used = [reference_of(references, series) for series, _ in levels]

    scattered = {
        points[i]: _scattered(points[i], readings, cells[i], scatter, i)
        for i in np.flatnonzero(~scatter.alike).tolist()
    }

    of_means = scatter.errors
    estimates = [
        estimate(float(error), row, effects)
        for error, row in zip(of_means, np.eye(len(points)), strict=True)
    ]
    values_of = np.array([one.value for one in known])
    copied = copying_doubts(points, estimates, values_of, kind, state)

    def doubts(point: str) -> tuple[Doubt, ...]:
        found = dict.fromkeys(d for one in used if one for d in one.doubts_about(point))
        return (*found, *(of[point] for of in (scattered, copied) if point in of))

    found = tuple(
        _point(
            i,
            name,
            readings,
            ways,
            cells[i],
            known[i],
            estimates[i],
            budget,
            scatter,
            resolution,
            item,
            rule,
            doubts(name),
        )
        for i, name in enumerate(points)
    )
    sound = [i for i, one in enumerate(found) if not one.doubts] or list(range(len(found)))
    study, why_not = _gauge_rr(
        [cells[i] for i in sound], [[level[i] for i in sound] for level in values], levels
    )
    labels = tuple(_label(level, levels) for level in levels)
    hysteresis = None
    if len(ways) == 2:
        chosen = scatter.alike & np.isin(np.arange(len(points)), sound)
        shown_by = replace(scatter, alike=chosen) if chosen.any() else scatter
        differences, of_difference = shown_by.hysteresis(resolution)
        mean = np.full(len(differences), 1.0 / len(differences))
        hysteresis = estimate(float(differences.mean()), mean, of_difference)
    return QuantityResult(
        quantity=kind,
        state=state,
        unit=QUANTITIES[kind].unit,
        declared=item.declared()[kind],
        points=found,
        levels=labels,
        characteristic=characteristic(
            [points[i] for i in sound],
            [known[i] for i in sound],
            of_means[sound],
            [(origin, replace(effect, factor=effect.factor[sound])) for origin, effect in budget],
        ),
        repeatability=scatter.deviation,
        dof_repeatability=int(scatter.dof),
        reproducibility=_between(scatter),
        hysteresis=hysteresis,
        gauge_rr=study,
        no_gauge_rr=why_not,
        vertical=vertical,
        in_place=tuple(
            p for p in points if any(one and one.in_place(kind, p, item) for one in used)
        ),
        coarser=coarser,
        finer=finer,
        left_out=tuple(name for i, name in enumerate(points) if i not in sound),
    )


def _steps(
    readings: Sequence[Reading], resolution: float, rim_m: float | None
) -> tuple[float | None, float | None]:
    """Return the step of readings where it contradicts the resolution: coarser, and finer.

    The longest of which all are multiples: 1, 2 or 5 of a decimal place of their unit, of degrees,
    minutes or seconds where it is written in these; radians or metres. A reading in steps of the
    resolution is one of a step that is n times longer once in n, so that a coarser one is where
    chance does not explain it; the same value again says nothing.
    """
    units = {one.unit for one in readings}
    if len(units) > 1:
        return None, None
    unit, quantity = units.pop(), QUANTITIES[readings[0].quantity]
    shown = [as_shown(one.value, unit, quantity, rim_m) for one in readings]
    values = np.unique(np.round(np.array(shown), FIGURES))
    scale = SMALL / as_shown(SMALL, unit, quantity, rim_m)
    sizes = itertools.product(PARTS_OF.get(unit, (1.0,)), range(2, -7, -1), (5.0, 2.0, 1.0))
    steps = sorted((part * first * 10.0**place for part, place, first in sizes), reverse=True)
    step = scale * next((one for one in steps if _are_multiples(values, one)), 0.0)
    if step > COARSER * resolution:
        chance = (resolution / step) ** len(values)
        return (step if chance < BY_CHANCE and len(values) >= ENOUGH else None), None
    is_finer = 0.0 < step < resolution and not _are_multiples(values, resolution / scale)
    return None, step if is_finer else None


def _are_multiples(values: Array, step: float) -> bool:
    steps = values / step
    off = float(np.abs(steps - np.rint(steps)).max())
    return off < 1e-6 + 1e-9 * float(np.abs(steps).max())


def _vertical(
    kind: str, levels: list[Level], references: Sequence[Reference], item: Item, faults: Faults
) -> VerticalKind | Literal["unlike"] | None:
    """Return the vertical of the references; UNLIKE, a fault, where they or the item disagree."""
    if kind not in UPRIGHT:
        return None
    used = [reference_of(references, series) for series, _ in levels]
    found = list(dict.fromkeys(one.measurement.vertical_kind for one in used if one is not None))
    stated = item.declared()[kind].vertical
    if len(found) == 1 and stated in (None, found[0]):
        return found[0]
    faults.add(
        None,
        None,
        Wording(UNLIKE_VERTICALS, kind=kind, each=", ".join(found))
        if len(found) > 1
        else Wording(OTHER_VERTICAL, kind=kind, stated=stated, found=found[0]),
    )
    return UNLIKE


def complete_points(readings: Sequence[Reading]) -> list[Reading]:
    """Return the readings of points that were read in each series, by each operator and way."""
    points = list(dict.fromkeys(one.point for one in readings))
    levels = list(dict.fromkeys((one.series, one.operator) for one in readings))
    ways = sorted({one.direction for one in readings})
    cells = _cells(readings, points, levels, ways)
    whole = {
        point
        for point, row in zip(points, cells, strict=True)
        if all(cell for level in row for cell in level)
    }
    return [one for one in readings if one.point in whole]


def _scattered(
    point: str,
    readings: Sequence[Reading],
    cells: Sequence[Sequence[Sequence[float]]],
    scatter: Scatter,
    index: int,
) -> Doubt:
    """Return the note on a point whose readings scatter unlike those of the others."""
    centre = float(np.median([value for level in cells for cell in level for value in cell]))
    rows = [one for one in readings if one.point == point]
    farthest = max(rows, key=lambda one: abs(one.value - centre))
    unit = farthest.unit
    if scatter.dofs[index] and scatter.dof:
        own = math.sqrt(scatter.squares[index] / scatter.dofs[index])
        others = scatter.deviation
    else:  # single readings: their scatter between levels
        own = math.sqrt(scatter.variances[index])
        others = math.sqrt(float(scatter.variances[scatter.alike].mean()))
    return Doubt(
        SCATTERED,
        kind=farthest.quantity,
        state=farthest.state,
        point=point,
        trial=point,
        own=_text(own, unit),
        others=_text(others, unit),
        row=farthest.row,
        value=_text(farthest.value, unit),
    )


def _text(size: float, unit: str) -> str:
    """Write a size in the unit of a reading."""
    scale, mark = (1e3, " mm") if unit in ("m", "mm") else (math.degrees(60.0), "'")
    if unit == "deg":
        scale, mark = math.degrees(1.0), "°"
    return f"{size * scale:.4g}{mark}" if abs(size * scale) < 1e4 else f"{size * scale:.0f}{mark}"


Cells = list[list[list[list[float]]]]  # by point, level and direction


def _cells(
    readings: Sequence[Reading], points: list[str], levels: list[Level], ways: list[str]
) -> Cells:
    cells: Cells = [[[[] for _ in ways] for _ in levels] for _ in points]
    for one in readings:
        level = levels.index((one.series, one.operator))
        cells[points.index(one.point)][level][ways.index(one.direction)].append(one.value)
    return cells


def _incomplete(
    cells: Cells,
    readings: Sequence[Reading],
    points: list[str],
    levels: list[Level],
    ways: list[str],
    faults: Faults,
) -> bool:
    """Note what a quantity lacks; return whether it lacks anything."""
    kind, state = readings[0].quantity, readings[0].state
    before = len(faults.found)
    for i, point in enumerate(points):
        for k, level in enumerate(levels):
            for d, way in enumerate(ways):
                if not cells[i][k][d]:
                    fact = Wording(
                        UNREAD,
                        kind=kind,
                        state=state,
                        point=point,
                        where=_where(*level, way),
                    )
                    faults.add(None, None, fact)
    alone = all(len(cell) == 1 for row in cells for level in row for cell in level)
    if alone and len(levels) == 1:
        faults.add(None, None, Wording(NOT_REPEATED, kind=kind, state=state))
    return len(faults.found) > before


def _where(series: str, operator: str, way: str) -> Wording:
    """Return a series, its operator and a direction in words."""
    return Wording(
        "series {series}{operator}{way}",
        series=series,
        operator=f", {operator}" if operator else "",
        way=Wording(f", {way}") if way else "",
    )


def factors_of(levels: Sequence[Level]) -> tuple[tuple[int, ...], ...]:
    """Return what levels share: the number of the series, and of the operator, of each level.

    None where each level has its own of one of them, and of the other its own or the only one.
    Where each series has one operator, or the reverse, the one alone that is common to several.
    """
    numbers = []
    for names in zip(*levels, strict=True):
        known = list(dict.fromkeys(names))
        if 1 < len(known) < len(levels):
            numbers.append(tuple(known.index(name) for name in names))
    return tuple(numbers)


def _label(level: Level, levels: Sequence[Level]) -> str:
    """Return the name of a level; with its operator where one is stated."""
    series, operator = level
    return f"series {series}" + (f", {operator}" if operator else "")


def _reference_values(
    points: list[str], levels: list[Level], references: Sequence[Reference], item: Item, kind: str
) -> list[list[Estimate]]:
    """Return the reference value of every point, by level."""
    found = []
    for series, _ in levels:
        reference = reference_of(references, series)
        assert reference is not None  # checked with the readings
        values = [reference.value(kind, point, item) for point in points]
        found.append([one for one in values if isinstance(one, Estimate)])
    return found


def _references(
    values: list[list[Estimate]], levels: list[Level], scatter: Scatter, resolution: float
) -> tuple[list[Estimate], list[tuple[Origin, Effect]]]:
    """Return the mean reference value of every point, and the budget of the errors.

    Several references, one a series: what is stated (type B) counts as common to all of them, so
    that their mean has no less of it; what scatters from one to the other, as the noise of a scan,
    is in the scatter of the errors between series, and in that budget only there. Where series
    share a reference, theirs does not show all of it: it is in the budget, too.
    """
    distinct = [v for k, v in enumerate(values) if v[0] not in [w[0] for w in values[:k]]]
    count = len(distinct)
    mean = np.mean([[one.value for one in level] for level in values], axis=0)
    of_readings: list[tuple[Origin, Effect]] = [
        ("readings", effect) for effect in scatter.effects(resolution)
    ]
    if count == 1:
        shared = joint_effects(distinct[0])
        return distinct[0], [*(("reference", effect) for effect in shared), *of_readings]
    effects = [effect for level in distinct for effect in joint_effects(level)]
    stated, drawn = (
        [replace(e, factor=e.factor / share) for e in effects if _is_of_a_scan(e) == own]
        for own, share in ((False, math.sqrt(count)), (True, count))
    )
    rows = zip(mean.tolist(), np.eye(len(mean)), strict=True)
    known = [estimate(value, row, [*stated, *drawn]) for value, row in rows]
    if count < len({series for series, _ in levels}):
        stated += drawn
    return known, [*(("reference", effect) for effect in stated), *of_readings]


def _is_of_a_scan(effect: Effect) -> bool:
    """Return whether an effect scatters from one reference to the next."""
    return math.isfinite(effect.dof) or effect.name in OF_A_SCAN


def _point(
    index: int,
    name: str,
    readings: Sequence[Reading],
    ways: Sequence[str],
    cells: Sequence[Sequence[Sequence[float]]],
    reference: Estimate,
    error: Estimate,
    budget: Budget,
    scatter: Scatter,
    resolution: float,
    item: Item,
    rule: DecisionRule | None,
    doubts: tuple[Doubt, ...],
) -> CalibrationPoint:
    own = [one for one in readings if one.point == name]
    kind, unit = own[0].quantity, QUANTITIES[own[0].quantity].unit
    dof = int(scatter.dofs[index])
    mpe, stated = item.value(kind, "mpe"), item.value(kind, "uncertainty")
    return CalibrationPoint(
        point=name,
        quantity=kind,
        unit=unit,
        state=own[0].state,
        reference=reference,
        reading=reference.value + error.value,
        directions=tuple(
            DirectionMean(
                way, float(np.mean([np.mean(cell) for cell in each])), sum(map(len, each))
            )
            for way, each in zip(ways, zip(*cells, strict=True), strict=True)
        ),
        n=len(own),
        repeatability=math.sqrt(scatter.squares[index] / dof) if dof else math.nan,
        dof_repeatability=dof,
        error=error,
        budget=_contributions(budget, index),
        resolution=resolution,
        en=None if stated is None else abs(error.value) / math.hypot(error.expanded, stated),
        mpe=mpe,
        doubts=doubts,
        verdict=None
        if mpe is None or rule is None
        else _verdict(kind, name, error, mpe, rule, doubts),
    )


def _contributions(budget: Budget, index: int) -> tuple[Contribution, ...]:
    """Return the lines of one error's budget, one for each name and origin."""
    names = dict.fromkeys((origin, effect.name) for origin, effect in budget)
    whole = sum(float(np.sum(effect.factor[index] ** 2)) for _, effect in budget)
    found = []
    for origin, name in names:
        effects = [e for o, e in budget if (o, e.name) == (origin, name)]
        shares = [np.atleast_1d(np.sum(effect.factor[index] ** 2)) for effect in effects]
        total = np.sum(shares, axis=0)
        if total[0] > NEGLIGIBLE * whole:
            dof = float(effective_dof(effects, shares, total)[0])
            found.append(Contribution(name, origin, math.sqrt(float(total[0])), dof))
    return tuple(found)


def _verdict(
    kind: str,
    name: str,
    error: Estimate,
    mpe: float,
    rule: DecisionRule,
    doubts: tuple[Doubt, ...],
) -> Verdict:
    """Decide whether an error is within the maximum permissible one; undecided in doubt."""
    what = Quantity(
        kind,
        name,
        None,
        QUANTITIES[kind].unit,
        error.value,
        error.u,
        dof=error.dof,
        uniform=error.uniform,
        doubts=doubts,
    )
    interval = ToleranceInterval(-mpe, mpe)
    alone = rule.model_copy(update={"rule": "simple"}) if rule.rule == "shared" else rule
    found = decide(what, interval, alone)
    if rule.rule == "shared" and not doubts and error.expanded > mpe / rule.ratio:
        below = math.floor(100.0 * mpe / error.expanded) / 100.0  # rounded, it might be the ratio
        reason = Wording(BELOW, value=f"{below:g}", ratio=f"{rule.ratio:g}")
        return replace(found, decision="undecided", risk=None, reason=reason)
    return found


def _between(scatter: Scatter) -> float | None:
    """Return the standard deviation of level means beyond that of their interaction."""
    points, levels, _ = scatter.means.shape
    if levels == 1:
        return None
    common, rest = scatter.between_levels()
    return math.sqrt(max(0.0, common - rest) / points)


def _gauge_rr(
    cells: Cells,
    values: list[list[Estimate]],
    levels: list[Level],
) -> tuple[GaugeRR | None, str]:
    """Analyse by operators where there are several, else by series; or why that is impossible."""
    operators = list(dict.fromkeys(operator for _, operator in levels))
    series = list(dict.fromkeys(name for name, _ in levels))
    column, appraisers = (1, operators) if len(operators) > 1 else (0, series)
    if len(cells) < 2 or len(appraisers) < 2:
        return None, "it takes two points and two operators or series, or more"
    mean = np.mean([[one.value for one in level] for level in values], axis=0)
    ways = len(cells[0][0])
    table = [
        [
            [
                [
                    value - values[k][i].value + mean[i]
                    for k, level in enumerate(levels)
                    if level[column] == appraiser
                    for value in cells[i][k][way]
                ]
                for way in range(ways)
            ]
            for appraiser in appraisers
        ]
        for i in range(len(cells))
    ]
    numbers = {len(cell) for row in table for each in row for cell in each}
    if len(numbers) > 1 or min(numbers) < 2:
        each = ", in each direction" if ways > 1 else ""
        return None, f"it takes as many readings of every point by each, two or more{each}"
    by_way = np.array(table)  # (point, appraiser, way, reading)
    by_way -= by_way.mean(axis=(1, 3), keepdims=True) - by_way.mean(axis=(1, 2, 3), keepdims=True)
    shape = len(cells), len(appraisers), -1
    return gauge_rr(by_way.reshape(shape), tuple(appraisers), ways), ""


def adjustments(results: Sequence[QuantityResult]) -> tuple[Adjustment, ...]:
    """Compare the points that were read both as found and as left."""
    found = {(p.quantity, p.point): p for r in results if r.state == "as found" for p in r.points}
    left = [p for r in results if r.state == "as left" for p in r.points]
    return tuple(
        Adjustment(
            point.point,
            point.quantity,
            point.unit,
            found[point.quantity, point.point].error,
            point.error,
            _change(found[point.quantity, point.point], point),
        )
        for point in left
        if (point.quantity, point.point) in found
    )


def _change(before: CalibrationPoint, after: CalibrationPoint) -> Estimate:
    """Return the change of an error, with the contributions of both sets of readings.

    Those of the reference cancel where it is the same. Of unlike ones nothing shows what they
    share, so that both count in full.
    """
    one, other = before.reference.value, after.reference.value
    same = math.isclose(one, other, rel_tol=SAME, abs_tol=SAME)
    shares = [
        share
        for point in (before, after)
        for share in point.budget
        if share.origin == "readings" or not same
    ]
    u = math.sqrt(math.fsum(share.u**2 for share in shares))
    fourths = math.fsum(share.u**4 / share.dof for share in shares)
    dof = u**4 / fourths if fourths > 0.0 else math.inf
    rounding = max((share.u for share in shares if share.name == RESOLUTION), default=0.0)
    return Estimate(after.error.value - before.error.value, u, dof, u_uniform=rounding)
