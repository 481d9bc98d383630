"""Small versions of tests/bench/calibration.py: coverage, bias, power, risks of each rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from tests.support.calibration_bay import TOE, Bay, Protocol, changed, item_of, machine
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.evaluate import evaluate_quantity
from wheelplane.calibration.forms.item import DecisionRule
from wheelplane.calibration.forms.plan_file import Plan, PlannedQuantity
from wheelplane.calibration.forms.table_file import Faults
from wheelplane.calibration.plan import detections, planned_set
from wheelplane_synth.machine.indicate import error, true_values

MINUTE = math.radians(1.0 / 60.0)
COUNT = 80


@pytest.mark.slow
@pytest.mark.parametrize(("series", "shift"), [(1, 0.0), (4, 0.5)])
def test_u_covers_the_true_errors_and_nothing_is_biased(series, shift):
    toe = changed(TOE, repeatability=0.8, reproducibility=shift)
    tested = machine(toe=toe, protocol=Protocol(series=series))
    shares, found = [], []
    for seed in range(COUNT):
        bay = Bay(seed=(20, seed))
        (result,) = calibrate([bay.reference()], item_of(tested), bay.readings(tested)).results
        true = true_values(bay.truth, toe, "toe")
        off = [(p.error.value - MINUTE * error(toe, true[p.point])) / p.error.expanded
               for p in result.points]  # fmt: skip
        shares.append(np.mean(np.abs(off) <= 1.0))
        line = result.characteristic
        found.append([
            (line.zero.value - MINUTE) / line.zero.expanded,
            (line.sensitivity.value - 1.02) / line.sensitivity.expanded,
            (result.hysteresis.value - MINUTE) / result.hysteresis.expanded,
        ])  # fmt: skip
    bound = 4.0 * np.std(shares, ddof=1) / math.sqrt(COUNT)
    assert abs(np.mean(shares) - 0.95) < bound
    assert bound < 0.6 / math.sqrt(COUNT)
    least, most = stats.binom.ppf([1e-4, 1 - 1e-4], COUNT, 0.95)
    for ratios in np.array(found).T:
        assert abs(ratios.mean()) < 4.0 * ratios.std(ddof=1) / math.sqrt(COUNT)
        assert least <= np.sum(np.abs(ratios) <= 1.0) <= most


@pytest.mark.slow
def test_a_gain_is_detected_as_often_as_the_plan_says():
    tested = machine(toe=changed(TOE, repeatability=1.2))
    table = PlannedQuantity(repeatability="1.2'", gain=0.02)
    plan = Plan(trials=8, repeats=3, directions=True, toe=table)
    hits, planned = [], []
    for seed in range(COUNT):
        bay, item = Bay(seed=(21, seed)), item_of(tested)
        reference = bay.reference()
        group = bay.readings(tested).rows
        result = evaluate_quantity(group, [reference], item.item, item.decision, Faults("r.csv"))
        slope = result.characteristic.sensitivity
        hits.append(slope.value - 1.0 > slope.expanded)
        (one,) = detections("toe", plan, item.item, planned_set("toe", plan, item.item, reference))
        planned.append(one.power)
    u = math.sqrt(np.sum(np.array(planned) * (1.0 - np.array(planned)))) / COUNT
    assert abs(np.mean(hits) - np.mean(planned)) < 4.0 * u
    assert 0.3 < np.mean(planned) < 0.97


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["guarded", "simple", "shared"])
def test_acceptance_and_rejection_are_those_of_jcgm_106_for_every_true_error(rule):
    """From the verdicts of many calibrations of one point, against the normal integral."""
    decided = DecisionRule(rule=rule, ratio=2.0)
    mpe, count = 1.0, 400
    exact = changed(TOE, gain=0.0, hysteresis=0.0, repeatability=1e-6, resolution=1e-6, mpe=mpe)
    for true in (0.7, 1.0, 1.3):
        tested = machine(toe=changed(exact, zero=true), protocol=Protocol(directions=False))
        seen, u = [], []
        for seed in range(count // 12):
            bay = Bay(seed=(22, seed), trials=8)
            item = item_of(tested).model_copy(update={"decision": decided})
            (result,) = calibrate([bay.reference()], item, bay.readings(tested)).results
            seen.append([p.verdict.decision for p in result.points])
            u += [p.error.u / MINUTE for p in result.points]
        guard = stats.norm.ppf(0.95) * np.array(u) if rule == "guarded" else np.zeros(len(u))
        for decision, side, limit in (("conform", 1.0, mpe - guard),
                                      ("not conform", -1.0, mpe + guard)):  # fmt: skip
            known = np.mean(stats.norm.cdf(side * (limit - true) / np.array(u)))
            shares = np.mean([[d == decision for d in row] for row in seen], axis=1)
            bound = 4.0 * max(np.std(shares, ddof=1), 0.02) / math.sqrt(len(shares))
            assert abs(shares.mean() - known) < bound
