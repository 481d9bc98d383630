"""Tests of a machine's drift over its calibrations, and of the interval that it proposes."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from tests.support.calibration_bay import (
    ORIGIN,
    TOE,
    Bay,
    as_readings,
    changed,
    item_of,
    machine,
)
from wheelplane.batch.results.calibrations import LONGEST_DAYS, history_text, machine_history
from wheelplane.batch.results.series import Series
from wheelplane.batch.results.trends import drift
from wheelplane.calibration import Reference, calibrate
from wheelplane.commands.results import results as command
from wheelplane.errors import InputError
from wheelplane.report.json.calibration import calibration_json


def write(folder, months, drift=0.0, start=0.0, seed=0, **changes):
    """Calibrations 30 days apart of a machine whose zero error drifts, minutes a month."""
    for month in range(months):
        bay = Bay(seed=(seed, month))
        toe = changed(TOE, gain=0.0, zero=start + drift * month, **changes)
        tested = machine(toe=toe)
        reference = bay.reference()
        date = np.datetime64("2026-01-01") + 30 * month
        origin = replace(ORIGIN, date=str(date))
        dated = Reference(replace(reference.measurement, provenance=origin))
        found = calibrate([dated], item_of(tested), bay.readings(tested))
        place = folder / f"{month}"
        place.mkdir(parents=True)
        (place / "calibration.json").write_text(calibration_json(found), encoding="utf-8")
    return folder


def test_a_planted_drift_is_found_and_limits_the_interval(tmp_path):
    found = machine_history(write(tmp_path, 8, drift=0.2), "7")
    zero = next(one for one in found.drifts if one.quantity == "toe zero error")
    assert abs(zero.slope * 30.0 * 60.0 - 0.2) < 1.5 * zero.expanded * 30.0 * 60.0
    assert zero.significant
    (interval,) = found.intervals
    # 6' less what points scatter about the line, from 1.4' at 0.2' a month: 20 months at most.
    assert 0.0 < interval.days < 30.0 * (6.0 - 1.4) / 0.2
    assert [name.split("/")[-2] for name in found.files] == [str(k) for k in range(8)]


def test_copies_of_calibrations_count_once(tmp_path):
    """A backup, or a renamed capture whose earlier result is kept, is no further evidence."""
    write(tmp_path / "kept", 5, drift=0.05)
    for number, path in enumerate(sorted(tmp_path.glob("kept/*/calibration.json"))):
        tree = json.loads(path.read_text(encoding="utf-8"))
        tree["readings"]["sha256"] = f"{number % 4}"  # the last indicates what the first did
        path.write_text(json.dumps(tree), encoding="utf-8")
    before = machine_history(tmp_path, "7")
    assert len(before.files) == 5
    renamed = [("renamed", json.loads(path.read_text(encoding="utf-8")))
               for path in tmp_path.glob("kept/2/calibration.json")]  # fmt: skip
    shutil.copytree(tmp_path / "kept", tmp_path / "backup")
    found = machine_history(tmp_path, "7", [*renamed, *renamed])
    assert found.drifts == before.drifts
    assert found.intervals == before.intervals
    assert found.files[2] == "renamed"


def test_a_machine_that_does_not_drift_has_a_long_interval_and_a_bad_one_none(tmp_path):
    steady = machine_history(write(tmp_path / "steady", 12), "7")
    assert not any(one.significant for one in steady.drifts)
    assert steady.intervals[0].days is None or steady.intervals[0].days > LONGEST_DAYS / 10.0
    assert "toe: next calibration within" in history_text(steady)
    bad = machine_history(write(tmp_path / "bad", 4, start=8.0), "7")
    assert bad.intervals[0].days == 0.0
    assert "toe: no interval: at 95 % confidence an error may have" in history_text(bad)


def adjusted(folder, months, zeros, seed=0, left_points=None, **changes):
    """Calibrations 30 days apart of a machine that is found at a zero error and put right."""
    for month in range(months):
        bay = Bay(seed=(seed, month))
        found, left = (
            changed(TOE, **({"gain": 0.0} | changes | {"zero": zero}))
            for zero in (zeros[month], 0.0)
        )
        reference = bay.reference()
        origin = replace(ORIGIN, date=str(np.datetime64("2026-01-01") + 30 * month))
        dated = Reference(replace(reference.measurement, provenance=origin))
        rows = [
            row
            for toe, state in ((found, "as found"), (left, "as left"))
            for row in as_readings(bay.truth, machine(toe=toe), bay.car.rng, state)
            if state == "as found" or left_points is None or row.point in left_points
        ]
        readings = replace(bay.readings(machine(toe=found)), rows=tuple(rows))
        done = calibrate([dated], item_of(machine(toe=left)), readings)
        place = folder / f"{month}"
        place.mkdir(parents=True)
        (place / "calibration.json").write_text(calibration_json(done), encoding="utf-8")
    return machine_history(folder, "7")


def zero_error(history):
    return next(one for one in history.drifts if one.quantity == "toe zero error")


def test_adjustments_are_taken_out_of_the_drift(tmp_path):
    """A machine that drifts by 5' a month and is put right each time is no steady machine."""
    history = adjusted(tmp_path, 6, [0.0] + 5 * [5.0], seed=1)
    zero = zero_error(history)
    assert abs(zero.slope * 30.0 * 60.0 - 5.0) < 1.5 * zero.expanded * 30.0 * 60.0
    assert zero.significant
    assert 0.0 < history.intervals[0].days < 35.0  # 6' less what points scatter, from 0' on
    assert history.adjusted == 6
    text = history_text(history)
    assert "Adjusted in 6 of them: the drift is from each as left to the next as found" in text


def test_an_adjustment_read_at_some_points_moves_what_these_show(tmp_path):
    """A zero error is that of a line over all points, and of a few their mean: they differ."""
    history = adjusted(tmp_path, 4, 4 * [0.0], gain=0.05, left_points=("RR", "RL"))
    zero = zero_error(history)
    assert abs(zero.slope) < zero.expanded
    assert abs(zero.at_mean) * 60.0 < 0.5


def test_a_line_with_common_errors_is_that_of_many_experiments():
    """Generalised least squares: as many p below 0.05 as there should be; independent: as drift."""
    rng, n = np.random.default_rng(5), 12
    day = np.sort(rng.uniform(0.0, 900.0, n))
    u = rng.uniform(0.5, 1.5, n)
    steps = np.full(n, 1.0)
    numbers = np.arange(n)
    common = np.concatenate([[0.0], np.cumsum(steps**2)])[np.minimum.outer(numbers, numbers)]
    small, slopes, us = 0, [], []
    for _ in range(400):
        walk = np.concatenate([[0.0], np.cumsum(steps[:-1] * rng.normal(size=n - 1))])
        one = Series("x", "deg", numbers, day, walk + u * rng.normal(size=n), u)
        found = drift(one, common)
        small += found.p < 0.05
        slopes.append(found.slope)
        us.append(found.u_slope)
    assert small / 400.0 < 0.075
    assert np.std(slopes) < 1.1 * np.sqrt(np.mean(np.square(us)))
    independent, plain = drift(one, np.zeros((n, n))), drift(one)
    for name in ("slope", "u_slope", "at_mean", "mean_day", "scatter", "p"):
        assert getattr(independent, name) == pytest.approx(getattr(plain, name), rel=1e-6)


@pytest.mark.parametrize("y", [[1.0, -1.0, 1.0], [1.0, -1.0, -1.0, 1.0], [2.0, 0.0, -3.0, 0.5]])
def test_few_values_about_a_level_line_scatter_by_their_residuals(y):
    """Whether the scatter is found by independent errors, or with ones in common that vanish."""
    n = len(y)
    day, u = 100.0 * np.arange(n), np.full(n, 1e-3)
    one = Series("x", "deg", np.arange(n), day, np.array(y), u)
    residuals = one.values - np.polyval(np.polyfit(day, y, 1), day)
    expected = np.sqrt(residuals @ residuals / (n - 2) - u[0] ** 2)
    for found in (drift(one), drift(one, np.full((n, n), 1e-12))):
        assert found.scatter == pytest.approx(expected, rel=1e-6)


def test_two_calibrations_show_no_drift_and_say_so(tmp_path):
    found = machine_history(write(tmp_path, 2), "7")
    assert {one.reason for one in found.drifts} == {"fewer than three dated values"}
    assert found.intervals == ()


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (["date"], "2026/01/01", "Invalid isoformat string: '2026/01/01'"),
        (["date"], 5, "another form"),
        (["quantities"], None, "another form"),
        (["quantities", 0, "characteristic", "zero_error"], None, "another form"),
        (["quantities", 0, "characteristic", "zero_error", "value_deg"], "x", "another form"),
        (["quantities", 0, "points"], [], "another form"),
        (["readings"], None, "another form"),
        (["adjustments"], [{}], "it lacks 'quantity'"),
    ],
)
def test_a_calibration_that_was_changed_is_named_in_one_line(tmp_path, path, value, says):
    write(tmp_path, 3)
    file = tmp_path / "1" / "calibration.json"
    tree = json.loads(file.read_text())
    part = tree
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    file.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=says) as refused:
        machine_history(tmp_path, "7")
    assert str(refused.value).startswith(f"{file}: not a calibration of `wheelplane calibrate`")


def test_the_command_prints_it_and_refuses_what_is_not_there(tmp_path):
    write(tmp_path, 3, drift=1.0)
    run = CliRunner().invoke(command, [str(tmp_path), "--drift", "--item", "7"])
    assert run.exit_code == 0, run.output
    assert "Machine 7: 3 calibrations" in run.output
    assert "next calibration within" in run.output
    run = CliRunner().invoke(command, [str(tmp_path), "--drift", "--item", "7", "--json"])
    assert len(json.loads(run.output)["files"]) == 3
    with pytest.raises(InputError, match="no calibration of serial '8': there are those of 7"):
        machine_history(tmp_path, "8")
    (tmp_path / "0" / "calibration.json").write_text("{}")
    with pytest.raises(InputError, match="not a calibration of `wheelplane calibrate`"):
        machine_history(tmp_path, "7")
    assert CliRunner().invoke(command, [str(tmp_path), "--item", "7"]).exit_code == 2
