"""Calibrations of one machine over time: drift of its errors, and the interval that it proposes."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, fact_of
from ...report.format.digits import decimal
from ...system import frozen
from ...uncertainty import quantile
from ...vectors import Array
from ..catalogue.calibration_row import final
from .series import Series
from .trends import LEVEL, MONTH_DAYS, Drift, drift, with_holm

NAME, CERTIFICATE = "calibration.json", "certificate.html"
SCHEMA = "wheelplane/calibration/1"
LONGEST_DAYS = 5.0 * 365.25  # beyond which no interval is proposed


@frozen
class Interval:
    """Interval until the next calibration by one quantity's drift, days from the last one.

    days: until an error may reach the MPE, at 95 % confidence: 0 where it may have done so by now;
    None where that is not within LONGEST_DAYS. margin: MPE less the largest distance of a point's
    error from the zero error at the last calibration, in unit.
    """

    quantity: str
    unit: str
    days: float | None
    margin: float


@frozen
class MachineHistory:
    """Calibrations of a machine by its serial number: files in the order of their dates.

    adjusted: in how many of them it was adjusted.
    """

    serial: str
    files: tuple[str, ...]
    drifts: tuple[Drift, ...]
    intervals: tuple[Interval, ...]
    adjusted: int = 0


def machine_history(
    folder: Path | None,
    serial: str,
    listed: Sequence[tuple[str, dict[str, Any]]] = (),
    others: Collection[str] = (),
) -> MachineHistory:
    """Return drift and interval of a machine, by every calibration.json below a folder.

    folder: None for results elsewhere. listed: its calibrations in a catalogue, by their captures;
    others: serial numbers there. Copies of a calibration count once. Drifts are those of zero error
    and sensitivity of each quantity, from one calibration as left to the next as found: adjustments
    are taken out. Raises InputError.
    """
    below = {} if folder is None else _calibrations(folder)
    own = [(name, tree) for name, tree in below.items() if _serial(tree) == serial]
    found = _without_copies([*own, *listed])
    if not found:
        serials = ", ".join(sorted({*map(_serial, below.values()), *others})) or "none"
        place = folder or "the results"
        raise InputError(
            f"{place}: no calibration of serial {serial!r}: there are those of {serials}"
        )
    for name, tree in found:
        _check(name, tree)
    found.sort(key=lambda one: (_day(one[1]), one[0]))
    trees = [tree for _, tree in found]
    names = dict.fromkeys(name for tree in trees for name in _values(final(tree)))
    histories = [_unadjusted(name, trees) for name in names]
    drifts = with_holm(
        [drift(one.series, one.common if one.common.any() else None) for one in histories]
    )
    intervals = tuple(
        interval
        for one, history in zip(drifts, histories, strict=True)
        if not one.reason
        for interval in _interval(one, history.moved, trees[-1])
    )
    count = sum(bool(tree.get("adjustments")) for tree in trees)
    return MachineHistory(serial, tuple(name for name, _ in found), drifts, intervals, count)


def certificate_of(folder: Path, tree: dict[str, Any]) -> Path | None:
    """Return the certificate below a folder of a calibration in a catalogue: the last by its path.

    It lies beside a calibration.json of the same machine and the same readings.
    """
    found = None
    for path in sorted(_files(folder)):
        with suppress(OSError, ValueError, KeyError, TypeError):
            other = json.loads(path.read_text(encoding="utf-8"))
            same = (_serial(other), _readings(other)) == (_serial(tree), _readings(tree))
            if same and path.with_name(CERTIFICATE).is_file():
                found = path.with_name(CERTIFICATE)
    return found


def _calibrations(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the calibrations below a folder by their paths."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no folder: name one with the results of calibrations")
    found = {}
    for path in sorted(_files(folder)):
        try:
            tree = json.loads(path.read_text(encoding="utf-8"))
            if tree["schema"] == SCHEMA:
                _ = _serial(tree), _readings(tree), tree["date"]
                found[str(path)] = tree
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise _unlike(str(path), error) from error
    return found


def _check(name: str, tree: dict[str, Any]) -> None:
    """Raise InputError for a calibration without a date, or with a value of no history."""
    if tree["date"] is None:
        raise InputError(f"{name}: it has no date: give it as date in the capture.toml")
    try:
        for value in _values(final(tree)):
            history = _unadjusted(value, [tree])
            _margin(value, history.series.unit, tree)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise _unlike(name, error) from error


def _unlike(name: str, error: Exception) -> InputError:
    fact = fact_of(error)
    return InputError(f"{name}: not a calibration of `wheelplane calibrate` ({fact}): remove it")


def _without_copies(
    found: Sequence[tuple[str, dict[str, Any]]],
) -> list[tuple[str, dict[str, Any]]]:
    """Return calibrations by their names, of those of the same readings and date the last.

    One without a date is a copy of any of the same readings. Readings of no file show no copy.
    """
    dated = {_readings(tree) for _, tree in found if tree["date"] is not None}
    kept: dict[Any, tuple[str, dict[str, Any]]] = {}
    for name, tree in found:
        readings, date = _readings(tree), tree["date"]
        if not readings:
            kept[name] = name, tree
        elif date is not None or readings not in dated:
            kept[readings, date] = name, tree
    return list(kept.values())


def _serial(tree: dict[str, Any]) -> str:
    return str(tree["item"]["serial"])


def _readings(tree: dict[str, Any]) -> str:
    return str(tree["readings"]["sha256"])


def _files(folder: Path) -> Iterator[Path]:
    """Yield the calibrations below a folder; of a batch's results not its own files."""
    for place, folders, names in os.walk(folder):
        if "measurements" in folders:
            folders[:] = [name for name in folders if name not in ("measurements", "logs")]
        if NAME in names:
            yield Path(place) / NAME


def _day(tree: dict[str, Any]) -> float:
    """Return days since 1970-01-01, UTC unless the date names a zone."""
    moment = datetime.fromisoformat(tree["date"])
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() / 86400.0


def _values(quantities: Sequence[dict[str, Any]]) -> dict[str, tuple[str, float, float]]:
    """Return by name unit, value and u of zero errors and sensitivities."""
    found = {}
    for quantity in quantities:
        name, line = quantity["quantity"], quantity["characteristic"]
        unit = "m" if "value_m" in line["zero_error"] else "deg"
        zero = line["zero_error"]
        found[f"{name} zero error"] = (unit, zero[f"value_{unit}"], zero[f"u_{unit}"])
        if line["sensitivity"] is not None:
            slope = line["sensitivity"]
            found[f"{name} sensitivity"] = ("1", slope["value"], slope["u"])
    return found


@frozen
class _History:
    """Values as they would have been without adjustments: common (N, N), their covariance by these.

    moved: by how much adjustments moved the value since the first of them.
    """

    series: Series
    common: Array
    moved: float


def _unadjusted(name: str, trees: Sequence[dict[str, Any]]) -> _History:
    """Return the history of a value, without its adjustments.

    What was only read as left, or is not known after an adjustment, begins anew: nothing says what
    the adjustment moved. A value holds the errors of all changes before it, and with the error of
    its own reading half of that of its change, the other half being of the reading as left.
    """
    quantity = name.partition(" ")[0]
    rows: list[tuple[float, str, float, float]] = []
    changes: list[float] = []  # variances
    moved, anew = 0.0, False
    for tree in trees:
        of_state = {
            state: _values([q for q in tree["quantities"] if q["state"] == state]).get(name)
            for state in ("as found", "as left")
        }
        before, after = of_state["as found"], of_state["as left"]
        known = before or after
        if known is None:
            continue
        if anew or before is None:
            rows, changes, moved = [], [], 0.0
        unit, value, u = known
        rows.append((_day(tree), unit, value - moved, u))
        changed = [one for one in tree.get("adjustments", ()) if one["quantity"] == quantity]
        anew = bool(changed) and (before is None or after is None)
        if before is None or after is None or not changed:
            changes.append(0.0)
            continue
        step, u_step = _change(name, tree, changed, before, after)
        moved += step
        changes.append(u_step**2)
    days, units, values, us = zip(*rows, strict=True)
    numbers = np.arange(len(rows), dtype=np.int64)
    series = Series(name, units[0], numbers, *(np.array(x, float) for x in (days, values, us)))
    variances = np.array(changes)
    first = np.minimum.outer(numbers, numbers)
    before_first = np.concatenate([[0.0], np.cumsum(variances)])[first]
    own = np.where(np.eye(len(rows), dtype=bool), 0.0, variances[first] / 2.0)
    return _History(series, before_first + own, moved)


def _change(
    name: str,
    tree: dict[str, Any],
    changes: Sequence[dict[str, Any]],
    before: tuple[str, float, float],
    after: tuple[str, float, float],
) -> tuple[float, float]:
    """Return by how much an adjustment moved a value, and the u of that.

    Of a zero error the reference cancels: u is the largest of the points' changes. Where not all
    points were read in both states, it is the mean of their changes.
    """
    quantity, _, what = name.partition(" ")
    both = [q for q in tree["quantities"] if q["quantity"] == quantity]
    points = [{point["point"] for point in q["points"]} for q in both]
    lines = {q["characteristic"]["sensitivity"] is None for q in both}
    if what != "zero error":
        return after[1] - before[1], math.hypot(before[2], after[2])
    unit = before[0]
    u = max(float(one["change"][f"u_{unit}"]) for one in changes)
    if all(own == points[0] for own in points) and len(lines) == 1:
        return after[1] - before[1], u
    return float(np.mean([one["change"][f"value_{unit}"] for one in changes])), u


def _margin(name: str, unit: str, tree: dict[str, Any]) -> tuple[float, float] | None:
    """Return MPE less the largest distance of an error from the zero error, and u of the latter.

    None but of a zero error whose quantity has an MPE.
    """
    quantity, _, what = name.partition(" ")
    now = next((q for q in final(tree) if q["quantity"] == quantity), None)
    if what != "zero error" or now is None:
        return None
    mpe = now["points"][0][f"mpe_{unit}"]
    if mpe is None:
        return None
    line = now["characteristic"]["zero_error"]
    zero, u = line[f"value_{unit}"], line[f"u_{unit}"]
    errors = [point["error"][f"value_{unit}"] for point in now["points"]]
    return mpe - max(abs(error - zero) for error in errors), u


def _interval(one: Drift, adjusted: float, last: dict[str, Any]) -> Iterator[Interval]:
    """Yield the interval of a zero error's drift, where its quantity has an MPE.

    adjusted: by how much adjustments moved the error since the first of the drift's calibrations.
    The predicted zero error has a standard deviation from the slope, the scatter between
    calibrations and the last zero error's u; Student's t of n - 2 degrees of freedom.
    """
    known = _margin(one.quantity, one.unit, last)
    if known is None:
        return
    (margin, u), quantity = known, one.quantity.partition(" ")[0]
    t = quantile(LEVEL, one.n - 2)

    def reached(days: float) -> bool:
        ahead = one.last_day + days - one.mean_day
        spread = math.hypot(ahead * one.u_slope, one.scatter, u)
        return bool(abs(one.at_mean + one.slope * ahead + adjusted) + t * spread >= margin)

    low, high = 0.0, LONGEST_DAYS
    if reached(low) or not reached(high):
        yield Interval(quantity, one.unit, 0.0 if reached(low) else None, margin)
        return
    while high - low > 0.5:
        middle = (low + high) / 2.0
        low, high = (low, middle) if reached(middle) else (middle, high)
    yield Interval(quantity, one.unit, low, margin)


def history_text(found: MachineHistory) -> str:
    """Format drifts per 30 days, and the proposed intervals."""
    lines = [f"Machine {found.serial}: {len(found.files)} calibrations"]
    if found.adjusted:
        lines.append(
            f"Adjusted in {found.adjusted} of them: the drift is from each as left to the next as "
            "found"
        )
    lines.append("")
    for one in found.drifts:
        if one.reason:
            lines.append(f"  {one.quantity}: {one.reason}")
            continue
        scale, unit = {"deg": (60.0, "'"), "m": (1e3, " mm"), "1": (1.0, "")}[one.unit]
        slope, spread = (x * MONTH_DAYS * scale for x in (one.slope, one.expanded))
        mark = " (significant)" if one.significant else ""
        lines.append(
            f"  {one.quantity}: {decimal(slope, spread, 3)}{unit} in 30 days "
            f"(U {spread:.2g}{unit}), p = {one.p:.2g}{mark}"
        )
    lines.append("")
    for interval in found.intervals:
        lines.append(f"  {interval.quantity}: {_proposed(interval.days)}")
    return "\n".join(lines).rstrip() + "\n"


def _proposed(days: float | None) -> str:
    if days == 0.0:
        return "no interval: at 95 % confidence an error may have reached the MPE already"
    most = f"more than {LONGEST_DAYS / 365.25:.0f} years"
    return f"next calibration within {most if days is None else f'{days:.0f} days'} of the last"
