"""Repeat scans, and the Monte Carlo check beside the formula."""

from __future__ import annotations

import math
from functools import partial

from ...measurement import Estimate, Measurement, PooledAngle, Stated, pool_repeats, stated
from ...uncertainty import TOLERANCE, MonteCarlo
from ..format.writer import Column, Table, Writer


def repeats_table(measurement: Measurement, writer: Writer) -> Table | None:
    """Return pooled angles of repeat scans, their scatter against the prediction, and drift."""
    words = writer.words
    rows = [
        [writer.wheel(group.of), str(len(group.scans)), *_pooled(angle, writer)]
        for group in pool_repeats(measurement)
        for angle in group.angles
    ]
    columns = (
        words("results.name"), words("turned.scans"), words("vehicle.quantity"),
        words("checks.pooled"), "u", writer.chi, words("checks.chance"), words("checks.drift"),
        "u", Column(words("status.status"), quiet=True),
    )  # fmt: skip
    return writer.table(columns, rows, 1, words("checks.repeats")) if rows else None


def _pooled(angle: PooledAngle, writer: Writer) -> list[str]:
    words, small = writer.words, partial(writer.angle_width, kind=angle.kind, at=angle.pooled)
    drifts = writer.none, writer.none
    if angle.drift is not None and angle.u_drift is not None:
        drift = Estimate(angle.drift, angle.u_drift)
        drifts = small(drift.value, expanded=drift.expanded, sign="+"), small(drift.u)
    pooled = Estimate(angle.pooled, angle.u)
    return [
        writer.from_rear_axle(angle.kind),
        writer.angle(angle.pooled, angle.kind, pooled.expanded),
        small(angle.u), writer.reduced_chi_square(angle.chi_square, angle.dof),
        writer.share(angle.probability), *drifts, words.known("checks", angle.status),
    ]  # fmt: skip


def monte_carlo_table(measurement: Measurement, drawn: MonteCarlo, writer: Writer) -> Table:
    """Return both U of each quantity against the axis in use, and their difference.

    Both to the place to which so many draws determine the second, half of an interval.
    """
    words, rows = writer.words, []
    for i, quantity in enumerate(stated(measurement)):
        if quantity.axis not in (None, writer.view.axis):
            continue
        u, formula, draws = (float(x[i]) for x in (drawn.formula, drawn.expanded, drawn.half))
        fine = Estimate(draws, draws / math.sqrt(drawn.draws)).expanded
        apart = f"{100.0 * float(drawn.end_difference[i]) / u:.1f} %" if u > 0.0 else writer.none
        name = writer.quantity(quantity.name.removeprefix(f"{quantity.subject}."))
        wheel = "" if quantity.subject == "vehicle" else f"{writer.wheel(quantity.subject)} "
        sizes = (_half(quantity, size, fine, writer) for size in (formula, draws))
        rows.append([wheel + name, *sizes, words.number(apart)])
    columns = (Column(words("vehicle.quantity"), quiet=True), words("checks.formula"),
               words("checks.draws"), words("checks.apart"))  # fmt: skip
    return writer.table(columns, rows, 1, words("checks.monte_carlo"))


def _half(quantity: Stated, size: float, fine: float, writer: Writer) -> str:
    """Write half of an interval of a quantity, to the place of `fine`."""
    if quantity.unit == "m":
        return writer.millimetres(size, fine)
    return writer.angle_width(size, quantity.kind, quantity.value, fine)


def monte_carlo_words(drawn: MonteCarlo, writer: Writer) -> tuple[str, str]:
    """Return what is compared and the verdict."""
    words = writer.words
    tolerance = f"{TOLERANCE:.0%}".replace("%", " %")
    verdict = words.known("checks", drawn.status, tolerance=tolerance)
    return (
        words("checks.monte_carlo_note", tolerance=tolerance),
        f"{words('checks.trials', trials=str(drawn.draws))} {verdict}",
    )
