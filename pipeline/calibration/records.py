"""Records of a calibration: everything that a certificate prints. Radians and metres.

Reference values, readings and errors are in the item's own axis and sign, as its file declares
them; an error is reading less reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from ..errors import Doubt
from ..measurement import Estimate, Provenance, Verdict, VerticalKind
from ..system import frozen
from ..vehicle import Unit
from .forms.item import DecisionRule, Item, ItemQuantity
from .forms.readings import Readings, State
from .gauge_rr import GaugeRR

Origin = Literal["reference", "readings"]
Decision = Literal["conform", "undecided", "not conform"]


@frozen
class Contribution:
    """One line of the budget of an error: standard uncertainty and degrees of freedom."""

    name: str
    origin: Origin
    u: float
    dof: float


@frozen
class DirectionMean:
    """Mean reading of one direction of approach, "" where none is stated, and their number.

    Each series and operator counts alike, as in the mean over all.
    """

    direction: str
    mean: float
    n: int


@frozen
class CalibrationPoint:
    """One quantity at one point, as found or as left.

    reading: mean over all readings, each direction counted alike. n: number of readings.
    repeatability: standard deviation of single readings at this point, about the mean of their
    series, operator and direction, with dof_repeatability; nan where none is repeated. error: of
    indication, with the u of reference and readings. budget: of its u. en: |error| over the root of
    the sum of squares of its U and the item's own; None where the item states none. mpe, verdict:
    None where no maximum permissible error is stated. doubts: notes by which its reference or its
    readings are in doubt, so that it is undecided.
    """

    point: str
    quantity: str
    unit: Unit
    state: State
    reference: Estimate
    reading: float
    directions: tuple[DirectionMean, ...]
    n: int
    repeatability: float
    dof_repeatability: int
    error: Estimate
    budget: tuple[Contribution, ...]
    resolution: float
    en: float | None = None
    mpe: float | None = None
    verdict: Verdict | None = None
    doubts: tuple[Doubt, ...] = ()


@frozen
class Characteristic:
    """Straight line reading = zero error + sensitivity * reference, fitted to all points.

    zero: error of indication at reference zero. sensitivity: slope of the line; None below three
    points, or without spread. linearity: the largest distance of a point's reading from the line,
    with its sign, and the name of that point. fits: probability of residuals as large by chance.
    """

    zero: Estimate
    sensitivity: Estimate | None = None
    linearity: Estimate | None = None
    worst_point: str = ""
    fits: float | None = None


@frozen
class QuantityResult:
    """All points of one quantity in one state, and what they show of the machine.

    declared: its table of the item file. levels: series, and operators where there are several, in
    which every point was read. repeatability: pooled standard deviation of a single reading.
    reproducibility: standard deviation between levels, None for one. hysteresis: mean of upward
    less downward readings; None without both. gauge_rr: None, and why, where its scheme does not
    apply. vertical: from which camber, caster or SAI is measured. in_place: trials of rear wheels
    that count from the thrust line, which is that with the trial in its wheel's place. unread:
    wheels and trials of the references without a reading in this state, and points that were read
    as found but not as left. coarser: step of all readings, which counts as their resolution where
    it is coarser than the declared one; finer: where that is coarser, and they no multiples of it.
    left_out: points in doubt, by which characteristic, hysteresis and gauge_rr are not moved; none
    where all are in doubt. notes: sentences.
    """

    quantity: str
    state: State
    unit: Unit
    declared: ItemQuantity
    points: tuple[CalibrationPoint, ...]
    levels: tuple[str, ...]
    characteristic: Characteristic
    repeatability: float
    dof_repeatability: int
    reproducibility: float | None = None
    hysteresis: Estimate | None = None
    gauge_rr: GaugeRR | None = None
    no_gauge_rr: str = ""
    vertical: VerticalKind | None = None
    in_place: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    coarser: float | None = None
    finer: float | None = None
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def decision(self) -> Decision | None:
        """Worst verdict of its points; None where no maximum permissible error is stated."""
        return worst(self.points)


@frozen
class Adjustment:
    """Change of one point by the adjustment: error as left less error as found.

    The reference value cancels from u where it is common to both states; of unlike ones, as of two
    series with references of their own, both are in u.
    """

    point: str
    quantity: str
    unit: Unit
    found: Estimate
    left: Estimate
    change: Estimate


@frozen
class ReferenceRecord:
    """Origin of the reference values of a series; all series where series is None."""

    series: str | None
    provenance: Provenance


@frozen
class Calibration:
    """Calibration of one item: input, results, decision and what was noticed.

    rule: the decision rule, None where no maximum permissible error is stated. warnings: readings
    that fit another convention than the declared one far better. notes: sentences.
    """

    item: Item
    rule: DecisionRule | None
    references: tuple[ReferenceRecord, ...]
    readings: Readings
    results: tuple[QuantityResult, ...]
    adjustments: tuple[Adjustment, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    version: str = ""

    @property
    def final(self) -> tuple[QuantityResult, ...]:
        """Results in the state in which each quantity was left: as left, else as found."""
        left = {result.quantity for result in self.results if result.state == "as left"}
        return tuple(
            one for one in self.results if one.state == "as left" or one.quantity not in left
        )

    @property
    def not_read_again(self) -> tuple[CalibrationPoint, ...]:
        """Points with a verdict as found of a quantity that was read as left, but not there."""
        left = {(p.quantity, p.point) for one in self.final for p in one.points}
        found = [p for one in self.results if one.state == "as found" for p in one.points]
        return tuple(
            p for p in found if p.verdict is not None and (p.quantity, p.point) not in left
        )

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Notes by which references or readings of its points are in doubt, each once."""
        points = [point for result in self.results for point in result.points]
        return tuple(dict.fromkeys(doubt for point in points for doubt in point.doubts))

    @property
    def date(self) -> str | None:
        """Latest date of the references (ISO 8601), if known."""
        dates = [one.provenance.date for one in self.references if one.provenance.date]
        return max(dates, default=None)

    @property
    def decision_as_found(self) -> Decision | None:
        """Worst verdict as found, of all quantities; None where none was read as left."""
        found = [one for one in self.results if one.state == "as found"]
        adjusted = len(found) < len(self.results)
        return worst([point for one in found for point in one.points]) if adjusted else None

    @property
    def decision(self) -> Decision | None:
        """Worst verdict of the final results; None where no MPE is stated.

        A point that was not read again keeps its verdict as found, and says nothing of the item as
        it was left: with one, it is undecided at best.
        """
        points = [point for result in self.final for point in result.points]
        kept = self.not_read_again
        found = worst([*points, *kept])
        return "undecided" if kept and found == "conform" else found


def worst(points: Sequence[CalibrationPoint]) -> Decision | None:
    """Return the worst verdict of points; None where there is none."""
    found = {point.verdict.decision for point in points if point.verdict is not None}
    order: tuple[Decision, ...] = ("not conform", "undecided", "conform")
    return next((decision for decision in order if decision in found), None)
