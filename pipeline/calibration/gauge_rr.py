"""Gauge repeatability and reproducibility (GRR) by analysis of variance.

Source: AIAG, Measurement Systems Analysis, 4th edition (2010), chapter III-B and appendix A.
"""

from __future__ import annotations

import math

import numpy as np

from ..system import frozen
from ..uncertainty import f_beyond
from ..vectors import Array

ALPHA = 0.05  # below which the interaction is kept apart from the equipment
ROUNDING = 1e-15  # of readings and their means, in parts of the largest
DISTINCT = 1.41  # sqrt(2): half width of a 97 % interval of GRR, in parts' deviations


@frozen
class AnovaRow:
    """One source of variation: degrees of freedom, sum and mean of squares, F over equipment."""

    source: str
    dof: int
    sum_of_squares: float
    mean_square: float
    f: float | None = None
    p: float | None = None


@frozen
class GaugeRR:
    """Variance components, as standard deviations, of parts, appraisers and equipment.

    Parts are the points of a calibration, appraisers its operators or series. ev: equipment
    variation (repeatability); av: appraiser variation (reproducibility); interaction: appraiser by
    part, 0 where it is pooled with the equipment since it is not significant; pv: part variation.
    """

    parts: int
    appraisers: tuple[str, ...]
    trials: int
    rows: tuple[AnovaRow, ...]
    ev: float
    av: float
    interaction: float
    pv: float
    pooled: bool

    @property
    def grr(self) -> float:
        """Standard deviation of repeatability and reproducibility."""
        return math.hypot(self.ev, self.av, self.interaction)

    @property
    def tv(self) -> float:
        """Total variation, as a standard deviation."""
        return math.hypot(self.grr, self.pv)

    @property
    def distinct_categories(self) -> int | None:
        """Number of distinct categories (ndc), at least 1.

        None, no limit, where parts differ and readings of a part do not.
        """
        if self.grr > 0.0:
            return max(1, math.floor(DISTINCT * self.pv / self.grr))
        return None if self.pv > 0.0 else 1


def gauge_rr(readings: Array, appraisers: tuple[str, ...], directions: int = 1) -> GaugeRR:
    """Analyse readings (P parts, K appraisers, R trials), each of them 2 or more.

    directions: of approach, whose means at a part are the same: their differences, the hysteresis,
    are taken from the readings, and their degrees of freedom from the equipment. Squares by the
    rounding of the numbers alone are none.
    """
    parts, count, trials = readings.shape
    mean, cells = readings.mean(), readings.mean(axis=2)
    of_parts, of_appraisers = cells.mean(axis=1), cells.mean(axis=0)
    inner = cells - of_parts[:, None] - of_appraisers + mean
    of_equipment = parts * count * (trials - 1) - parts * (directions - 1)
    squares = [
        ("appraiser", count - 1, parts * trials * np.sum((of_appraisers - mean) ** 2)),
        ("part", parts - 1, count * trials * np.sum((of_parts - mean) ** 2)),
        ("appraiser by part", (parts - 1) * (count - 1), trials * np.sum(inner**2)),
        ("equipment", of_equipment, np.sum((readings - cells[..., None]) ** 2)),
    ]
    least = readings.size * (ROUNDING * float(np.abs(readings).max())) ** 2
    rows = [_row(name, dof, size if size > least else 0.0) for name, dof, size in squares]
    dof_total = sum(row.dof for row in rows)
    total = AnovaRow("total", dof_total, sum(r.sum_of_squares for r in rows), math.nan)
    error = rows[3]
    tested = [_tested(row, error) for row in rows[:3]]
    by_appraisers, by_parts, by_both = (row.mean_square for row in tested)
    p = tested[2].p
    pooled = p is None or p >= ALPHA
    repeatability, left = error.mean_square, by_both
    if pooled:
        dof = rows[2].dof + error.dof
        repeatability = left = (rows[2].sum_of_squares + error.sum_of_squares) / dof
    return GaugeRR(
        parts=parts,
        appraisers=appraisers,
        trials=trials,
        rows=(*tested, error, total),
        ev=math.sqrt(repeatability),
        av=_deviation(by_appraisers - left, parts * trials),
        interaction=0.0 if pooled else _deviation(by_both - repeatability, trials),
        pv=_deviation(by_parts - left, count * trials),
        pooled=pooled,
    )


def _row(source: str, dof: int, squares: float) -> AnovaRow:
    return AnovaRow(source, dof, float(squares), float(squares) / dof)


def _tested(row: AnovaRow, error: AnovaRow) -> AnovaRow:
    """Return the row with its F over equipment; none where the equipment does not scatter."""
    if not error.mean_square > 0.0:
        return row
    f = row.mean_square / error.mean_square
    p = f_beyond(f, row.dof, error.dof)
    return AnovaRow(row.source, row.dof, row.sum_of_squares, row.mean_square, f, p)


def _deviation(difference: float, count: int) -> float:
    """Return the standard deviation of a component; 0 where its estimate is negative."""
    return math.sqrt(max(0.0, difference) / count)
