"""Verdicts: probabilities, boundaries, risks in the long run, whole vehicles, the commands."""

from __future__ import annotations

import contextlib
import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from scipy import stats

from tests.support.printed import says_angle, says_width, seconds_of, step, two_digits
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.cli import main
from wheelplane.commands import measure as measure_command
from wheelplane.config import config_folder
from wheelplane.errors import ConfigError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.conformity import (
    Conformity,
    Quantity,
    Verdict,
    assess,
    conforms,
    decide,
    guard_band,
    probabilities,
)
from wheelplane.measurement.quantities import by_name
from wheelplane.measurement.records import Measurement, WheelResult
from wheelplane.measurement.tolerance.find import load_tolerance
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.measurement.tolerance.values import ToleranceInterval
from wheelplane.report.format.view import View
from wheelplane.report.json.conformity import conformity_tree
from wheelplane.report.json.measurement import to_tree
from wheelplane.report.text.conformity import conformity_text
from wheelplane.uncertainty.components import UncertaintyComponent
from wheelplane.uncertainty.distributions import box_probability, normal_scores
from wheelplane.uncertainty.propagation import propagate

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
ANYTHING = {"rear": {"toe": {"upper_deg": 1.0}}}  # a tolerance needs some limit
GUARDED = Tolerance.model_validate(ANYTHING)
SIMPLE = Tolerance.model_validate({"rule": "simple", **ANYTHING})
K = float(stats.norm.ppf(0.95))
K_TWO_SIDED = float(stats.norm.ppf(0.975))
INTERVALS = {
    "upper": ToleranceInterval(-math.inf, 3.0),
    "lower": ToleranceInterval(-1.0, math.inf),
    "wide": ToleranceInterval(-20.0, 30.0),
    "narrow": ToleranceInterval(-2.1, 2.1),  # the guard bands leave 0.6 u
}


def quantity(value: float | None, u: float | None = 1.0) -> Quantity:
    return Quantity("toe", "RR", "RR", "rad", value, u, "" if value is not None else "no-plane")


def decision_of(
    value: float, interval: ToleranceInterval, u: float = 1.0, tolerance: Tolerance = GUARDED
) -> str:
    return decide(quantity(value, u), interval, tolerance).decision


# --- the probability ----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_probability_against_scipy(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        u, lower = 10.0 ** rng.uniform(-6, 2), rng.normal()
        upper = lower + u * 10.0 ** rng.uniform(-2, 2)
        y = rng.uniform(lower - 12 * u, upper + 12 * u)
        for interval in (
            ToleranceInterval(lower, upper),
            ToleranceInterval(lower, math.inf),
            ToleranceInterval(-math.inf, upper),
        ):
            inside, outside = probabilities(y, u, interval)
            below, above = stats.norm.cdf(interval.lower, y, u), stats.norm.sf(interval.upper, y, u)
            assert outside == pytest.approx(below + above, rel=1e-9, abs=1e-300)
            # from the side where the difference of two small numbers keeps its digits
            tails = (
                (below, stats.norm.cdf(interval.upper, y, u))
                if y > (lower + upper) / 2 and math.isfinite(interval.width)
                else (stats.norm.sf(interval.upper, y, u), stats.norm.sf(interval.lower, y, u))
                if math.isfinite(interval.lower)
                else (0.0, stats.norm.cdf(interval.upper, y, u))
            )
            assert inside == pytest.approx(tails[1] - tails[0], rel=1e-7, abs=1e-300)
            assert inside + outside == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("interval", INTERVALS.values(), ids=INTERVALS)
@pytest.mark.parametrize("y", [-1.5, 0.3, 2.9])
def test_probability_against_draws(y, interval):
    draws, u = 40_000, 1.3
    true = np.random.default_rng(8).normal(y, u, draws)
    share = np.mean((true >= interval.lower) & (true <= interval.upper))
    p = probabilities(y, u, interval)[0]
    assert abs(share - p) <= 4.5 * math.sqrt(p * (1 - p) / draws) + 1 / draws
    wrong = probabilities(y, 2 * u, interval)[0]
    if interval.width < 10:
        assert abs(share - wrong) > 4.5 * math.sqrt(p * (1 - p) / draws)


def test_a_tiny_risk_keeps_its_digits():
    inside, outside = probabilities(0.0, 1.0, ToleranceInterval(-30.0, math.inf))
    assert inside == 1.0
    assert outside == pytest.approx(stats.norm.sf(30.0), rel=1e-9, abs=0.0)
    inside, outside = probabilities(31.0, 1.0, ToleranceInterval(0.0, 1.0))
    assert outside == 1.0
    assert inside == pytest.approx(stats.norm.sf(30.0), rel=1e-9, abs=0.0)


# --- the boundaries -----------------------------------------------------------------------------


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("u", [1e-5, 1.0])
@pytest.mark.parametrize(
    "interval", [ToleranceInterval(-math.inf, 3.0), ToleranceInterval(-40.0, 3.0)]
)
def test_boundaries_stand_a_guard_band_from_the_limit(interval, u, confidence):
    tolerance = Tolerance.model_validate({"confidence": confidence, **ANYTHING})
    g = guard_band(u, interval, tolerance)
    assert g == pytest.approx(stats.norm.ppf(confidence) * u, rel=1e-9, abs=0.0)
    step = 1e-9 * u
    for y, decision in (
        (interval.upper - g, "conform"),
        (interval.upper - g + step, "undecided"),
        (interval.upper, "undecided"),
        (interval.upper + g - step, "undecided"),
        (interval.upper + g + step, "not conform"),
    ):
        assert decision_of(y, interval, u, tolerance) == decision
        mirrored = ToleranceInterval(-interval.upper, -interval.lower)
        assert decision_of(-y, mirrored, u, tolerance) == decision


@pytest.mark.parametrize("width", [2.0 * K_TWO_SIDED + 1e-6, 4.0, 4.2, 5.0, 8.0])
def test_near_limits_need_a_wider_guard_band(width):
    """Both tails count: at the edge of acceptance p is the confidence, by scipy."""
    interval = ToleranceInterval(0.0, width)
    g = guard_band(1.0, interval, GUARDED)
    assert K < g < K_TWO_SIDED
    p = stats.norm.cdf(width, g) - stats.norm.cdf(0.0, g)
    assert p == pytest.approx(0.95, abs=1e-9)
    if width < 5.0:  # where the band of a single limit would accept at a risk above 5 %
        assert stats.norm.cdf(width, K) - stats.norm.cdf(0.0, K) < 0.9495
    assert decision_of(g, interval) == decision_of(width - g, interval) == "conform"
    assert decision_of(g - 1e-9, interval) == decision_of(width - g + 1e-9, interval) == "undecided"


def test_a_tolerance_that_the_uncertainty_eats_says_what_u_it_takes():
    width = math.radians(0.1)
    interval, u = ToleranceInterval(0.0, width), width / (2.0 * K_TWO_SIDED) * (1 + 1e-6)
    for y in np.linspace(-K * u, width + K * u, 41)[1:-1]:
        verdict = decide(quantity(float(y), u), interval, GUARDED)
        assert verdict.decision == "undecided"
        assert verdict.guard_band is None
        needed = re.fullmatch(r"u is too large .* it must be (\S+)\" or less", verdict.reason)[1]
        assert float(needed) == pytest.approx(360.0 / (2.0 * K_TWO_SIDED), rel=5e-3)
    assert decision_of(width / 2, interval, u * (1 - 2e-6)) == "conform"
    assert (
        decision_of(width + 1.001 * K * u, interval, u) == "not conform"
    )  # that it can still tell


@pytest.mark.parametrize(
    ("y", "decision"), [(2.5, "conform"), (3.5, "not conform"), (-19.0, "conform")]
)
def test_half_the_uncertainty_decides(y, decision):
    interval = ToleranceInterval(-20.0, 3.0)
    u = 1.5 * min(abs(y - interval.lower), abs(y - interval.upper)) / K
    assert decision_of(y, interval, u) == "undecided"
    assert decision_of(y, interval, u / 2) == decision


@pytest.mark.parametrize("scale", [2.0**-12, 2.0**7])
@pytest.mark.parametrize("interval", INTERVALS.values(), ids=INTERVALS)
def test_unit_and_sense_of_the_scale_do_not_matter(interval, scale):
    for y in np.random.default_rng(2).uniform(-6, 6, 60).tolist():
        verdict = decide(quantity(y), interval, GUARDED)
        scaled = ToleranceInterval(interval.lower * scale, interval.upper * scale)
        other = decide(quantity(y * scale, scale), scaled, GUARDED)
        turned = decide(quantity(-y), ToleranceInterval(-interval.upper, -interval.lower), GUARDED)
        for same in (other, turned):
            assert same.decision == verdict.decision
            assert same.probability == pytest.approx(verdict.probability, rel=1e-9, abs=0.0)
            assert same.risk == (verdict.risk and pytest.approx(verdict.risk, rel=1e-9, abs=0.0))
        assert other.guard_band == pytest.approx(verdict.guard_band * scale, rel=1e-12)
        assert turned.guard_band == verdict.guard_band


def test_conform_is_what_reaches_the_confidence():
    """The decision by guard bands and the decision by probability are one."""
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(3000):
        interval = ToleranceInterval(0.0, rng.uniform(0.1, 12.0))
        verdict = decide(quantity(rng.uniform(-4.0, interval.upper + 4.0)), interval, GUARDED)
        assert (verdict.decision == "conform") == (verdict.probability >= 0.95)
        if verdict.decision == "not conform":
            assert verdict.probability <= 0.05
        seen.add(verdict.decision)
    assert seen == {"conform", "undecided", "not conform"}


# --- in the long run ----------------------------------------------------------------------------

ITEMS = 20_000
AT_MOST = int(stats.binom.ppf(1 - 1e-6, ITEMS, 0.05))


def decisions(
    true: float, interval: ToleranceInterval, tolerance: Tolerance, seed: int = 5
) -> dict[str, int]:
    values = true + np.random.default_rng(seed).standard_normal(ITEMS)
    shown = [decision_of(y, interval, 1.0, tolerance) for y in values.tolist()]
    return {name: shown.count(name) for name in ("conform", "undecided", "not conform")}


@pytest.mark.parametrize("name", INTERVALS)
def test_at_a_limit_no_more_than_one_in_twenty_is_decided_wrongly(name):
    """True values just beyond, and just within: the worst case. It fails without guard band."""
    interval = INTERVALS[name]
    limit = interval.upper if math.isfinite(interval.upper) else interval.lower
    shown = decisions(limit, interval, GUARDED)
    assert shown["conform"] <= AT_MOST
    assert shown["not conform"] <= AT_MOST
    if name != "narrow":  # and the bands are no wider than that takes
        least = int(stats.binom.ppf(1e-6, ITEMS, 0.05))
        assert shown["conform"] >= least
        assert shown["not conform"] >= least
    without = decisions(limit, interval, SIMPLE)
    assert without["conform"] > 5 * AT_MOST
    assert without["not conform"] > 5 * AT_MOST
    assert without["undecided"] == 0


@pytest.mark.parametrize("width", [0.2, 1.0, 3.0])
def test_where_nothing_can_conform_wrong_rejection_stays_rare(width):
    """Two limits nearer than u are each judged alone: 5 % and what lies beyond the other one."""
    shown = decisions(width, ToleranceInterval(0.0, width), GUARDED)
    share = 0.05 + float(stats.norm.sf(K + width))
    assert shown["conform"] == 0
    assert stats.binom.ppf(1e-6, ITEMS, share) <= shown["not conform"]
    assert shown["not conform"] <= stats.binom.ppf(1 - 1e-6, ITEMS, share)


@pytest.mark.parametrize("tolerance", [GUARDED, SIMPLE], ids=["guarded", "simple"])
def test_the_risks_that_are_reported_are_those_that_come_true(tolerance):
    """Nothing is known beforehand: true values are as likely anywhere, far beyond the zone."""
    rng, interval = np.random.default_rng(6), ToleranceInterval(0.0, 5.0)
    true = rng.uniform(-12.0, 17.0, ITEMS)
    verdicts = [
        decide(quantity(y), interval, tolerance)
        for y in (true + rng.standard_normal(ITEMS)).tolist()
    ]
    good = (true >= interval.lower) & (true <= interval.upper)
    for decision, wrong in (("conform", ~good), ("not conform", good)):
        chosen = np.array([verdict.decision == decision for verdict in verdicts])
        risks = np.array([v.risk for v in verdicts if v.decision == decision])
        spread = math.sqrt(np.sum(risks * (1 - risks)))
        assert np.count_nonzero(chosen) > ITEMS / 30
        assert abs(np.count_nonzero(wrong[chosen]) - risks.sum()) < 4.5 * spread
        assert abs(np.count_nonzero(~wrong[chosen]) - risks.sum()) > 4.5 * spread
        assert risks.max() <= (0.05 + 1e-12 if tolerance is GUARDED else 0.5 + 1e-12)


@pytest.mark.parametrize("dof", [4, 16])
def test_few_degrees_of_freedom_widen_the_guard_band(dof):
    """True values at the limit, u estimated from `freedom` residuals: 5 % are accepted wrongly."""
    rng, interval = np.random.default_rng(7), ToleranceInterval(-math.inf, 0.0)
    y = rng.standard_normal(ITEMS)
    u = np.sqrt(rng.chisquare(dof, ITEMS) / dof)
    most = stats.binom.ppf(1 - 1e-6, ITEMS, 0.05)
    accepted = {}
    for shown in (dof, math.inf):
        seen = [replace(quantity(*pair), dof=shown) for pair in zip(y, u, strict=True)]
        accepted[shown] = sum(decide(q, interval, GUARDED).decision == "conform" for q in seen)
    assert stats.binom.ppf(1e-6, ITEMS, 0.05) <= accepted[dof] <= most
    assert accepted[math.inf] > most
    verdict = decide(replace(quantity(-1.3), dof=dof), interval, GUARDED)
    assert verdict.probability == pytest.approx(stats.t.cdf(1.3, dof), rel=1e-12)


@pytest.mark.parametrize("share", [0.5, 0.95, 1.0])
def test_a_rectangle_in_u_narrows_the_guard_band_to_the_stated_risk(share):
    """True values at the limit, errors of a rectangle and a normal part: 5 % are accepted."""
    rng, interval = np.random.default_rng(8), ToleranceInterval(-30.0, 0.0)
    count = 100_000
    errors = math.sqrt(3.0) * share * rng.uniform(-1.0, 1.0, count)
    errors += math.sqrt(1.0 - share**2) * rng.standard_normal(count)
    g = guard_band(1.0, interval, GUARDED, uniform=share)
    assert np.mean(errors <= -g) == pytest.approx(0.05, abs=0.0025)
    verdict = decide(replace(quantity(-1.3), uniform=share), interval, GUARDED)
    assert verdict.probability == pytest.approx(np.mean(errors < 1.3), abs=0.005)
    assert verdict.factor == pytest.approx(g, rel=1e-6)


# --- what is degenerate -------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [GUARDED, SIMPLE], ids=["guarded", "simple"])
def test_without_uncertainty_the_value_decides(tolerance):
    interval = ToleranceInterval(-1.0, 2.0)
    for y, decision, p in (
        (-1.0, "conform", 1.0),
        (2.0, "conform", 1.0),
        (math.nextafter(2.0, 3.0), "not conform", 0.0),
        (-9.0, "not conform", 0.0),
    ):
        verdict = decide(quantity(y, 0.0), interval, tolerance)
        assert (verdict.decision, verdict.probability, verdict.risk) == (decision, p, 0.0)
    for u in (5e-324, 1e-300, 1e300):  # no overflow, no nan
        assert 0.0 <= decide(quantity(0.5, u), interval, tolerance).probability <= 1.0


@pytest.mark.parametrize(
    ("value", "u"), [(None, 1.0), (0.5, None), (math.nan, 1.0), (0.5, math.inf), (0.5, math.nan)]
)
@pytest.mark.parametrize("tolerance", [GUARDED, SIMPLE], ids=["guarded", "simple"])
def test_what_is_not_known_is_undecided_and_says_why(value, u, tolerance):
    verdict = decide(quantity(value, u), ToleranceInterval(0.0, 1.0), tolerance)
    assert verdict.decision == "undecided"
    assert verdict.probability is verdict.risk is verdict.guard_band is None
    assert verdict.reason == ("no-plane" if value is None else verdict.reason) != ""


def test_the_simple_rule_states_the_risk_that_it_shares():
    verdict = decide(quantity(3.0), INTERVALS["upper"], SIMPLE)
    assert (verdict.decision, verdict.guard_band) == ("conform", 0.0)
    assert verdict.risk == pytest.approx(0.5)
    assert (
        decision_of(math.nextafter(3.0, 4.0), INTERVALS["upper"], tolerance=SIMPLE) == "not conform"
    )


# --- several quantities -------------------------------------------------------------------------


def verdict(decision: str, probability: float | None) -> Verdict:
    return Verdict(quantity(0.0), INTERVALS["wide"], decision, 0.0, probability)


def test_the_worst_decides_and_only_conform_conforms():
    bad, doubt, good = (verdict(d, 0.5) for d in ("not conform", "undecided", "conform"))
    for verdicts, worst in (
        ((good, good), "conform"),
        ((good, doubt, good), "undecided"),
        ((doubt, bad, good), "not conform"),
        ((good, bad), "not conform"),
    ):
        whole = Conformity(GUARDED, verdicts)
        assert whole.decision == worst
        assert conforms(whole) == (worst == "conform")
    assert conforms(None)


@pytest.mark.parametrize("correlation", [-1.0, -0.5, 0.0, 0.7, 1.0])
def test_joint_probability_lies_within_its_bounds(correlation):
    """Fully correlated quantities reach the bounds, so none can be narrower."""
    draws, limits = 40_000, np.array([0.5, 0.7])
    shared = np.array([[1.0, correlation], [correlation, 1.0]])
    true = np.random.default_rng(4).multivariate_normal(np.zeros(2), shared, draws)
    joint = np.mean(np.all(true <= limits, axis=1))
    each = [
        probabilities(0.0, 1.0, ToleranceInterval(-math.inf, limit))[0] for limit in limits.tolist()
    ]
    low, high = Conformity(GUARDED, tuple(verdict("conform", p) for p in each)).joint_bounds
    slack = 4.5 * 0.5 / math.sqrt(draws)
    assert low - slack <= joint <= high + slack
    if abs(correlation) == 1.0:
        assert joint == pytest.approx(low if correlation < 0.0 else high, abs=slack)
    assert high - low > 10 * slack


def test_what_was_not_measured_leaves_nothing_sure():
    unmeasured = Conformity(GUARDED, (verdict("conform", 0.99), verdict("undecided", None)))
    assert unmeasured.joint_bounds == (0.0, 0.99)


def test_box_probability_is_that_of_scipy():
    """Also of a singular correlation: a third variable that the first two determine."""
    rng = np.random.default_rng(3)
    for count in (1, 2, 5):
        root = rng.normal(size=(count, count))
        V = root @ root.T
        R = V / np.sqrt(np.outer(np.diag(V), np.diag(V)))
        lower, upper = -rng.uniform(0.2, 2.0, count), rng.uniform(0.2, 3.0, count)
        exact = stats.multivariate_normal(cov=R).cdf(upper, lower_limit=lower)
        assert box_probability(lower, upper, R) == pytest.approx(exact, abs=5e-3)
    half = math.sqrt(0.5)
    together = np.array([[1.0, 0.0, half], [0.0, 1.0, half], [half, half, 1.0]])
    free = np.array([-math.inf, -math.inf, -0.3]), np.array([0.5, 0.8, math.inf])
    one, other = rng.normal(size=(2, 10**6))
    share = np.mean((one <= 0.5) & (other <= 0.8) & ((one + other) * half >= -0.3))
    assert box_probability(*free, together) == pytest.approx(share, abs=7e-3)


@pytest.mark.parametrize("dof", [3.0, 30.0, math.inf])
def test_normal_scores_are_as_probable(dof):
    x = np.array([-math.inf, -40.0, -2.0, 0.0, 1.5, math.inf])
    scores = normal_scores(x, np.full(6, dof))
    t = stats.norm if math.isinf(dof) else stats.t(dof)
    np.testing.assert_allclose(stats.norm.cdf(scores), t.cdf(x), rtol=1e-9)


# --- a whole vehicle ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured() -> Measurement:
    return measure_five_point(read_five_point(FIGURE_4))


WIDE = {"lower_deg": -20.0, "upper_deg": 20.0}
EVERY_ANGLE = {"toe": WIDE, "camber": WIDE, "camber_iso": WIDE}
VEHICLE_ANGLES = ("rear_total_toe", "front_total_toe", "thrust_angle")
CROSS = ("rear_cross_camber", "front_cross_camber")
LENGTHS = ("rear_track", "front_track", "wheelbase")
EVERYTHING = {
    "rear": EVERY_ANGLE,
    "front": EVERY_ANGLE,
    "vehicle": dict.fromkeys((*VEHICLE_ANGLES, *CROSS), WIDE)
    | {name: {"nominal_m": 2.0, "tolerance_m": 1.5} for name in LENGTHS},
}


def tolerance(table: dict) -> Tolerance:
    return Tolerance.model_validate(table)


def test_every_quantity_is_judged_by_its_own_value_uncertainty_and_limits(measured):
    tree = to_tree(measured, assess(measured, tolerance(EVERYTHING)))
    assert tree["verdict"]["decision"] == "conform"
    entries = {(entry["name"], entry["quantity"]): entry for entry in tree["conformity"]}
    assert len(entries) == len(tree["conformity"]) == 3 * len(tree["wheels"]) + 8
    for wheel in tree["wheels"]:
        for angle in ("toe", "camber", "camber_iso"):
            entry = entries[wheel["name"], angle]
            assert entry["wheel"] == wheel["wheel"]
            assert entry["value_deg"] == wheel[f"{angle}_deg"]
            assert entry["u_deg"] == wheel[f"u_{angle}_deg"]
            assert (entry["lower_deg"], entry["upper_deg"]) == (-20.0, 20.0)
    shown = tree["vehicle"] | tree["frame"]
    for name in (*VEHICLE_ANGLES, *LENGTHS):
        unit = "m" if name in LENGTHS else "deg"
        entry = entries["vehicle", name]
        assert entry[f"value_{unit}"] == shown[f"{name}_{unit}"]
        assert entry[f"u_{unit}"] == shown[f"u_{name}_{unit}"]
        assert entry[f"upper_{unit}"] == (3.5 if unit == "m" else 20.0)
    camber = {wheel["name"]: wheel["camber_deg"] for wheel in tree["wheels"]}
    for name, axle in zip(CROSS, "RF", strict=True):
        assert entries["vehicle", name]["value_deg"] == pytest.approx(
            camber[f"{axle}L"] - camber[f"{axle}R"], abs=1e-12
        )


def loose_centre(target: TargetFit) -> TargetFit:
    """The target with its centre known to 5 mm an axis."""
    loose = UncertaintyComponent("loose", np.vstack([np.zeros((3, 3)), 5e-3 * np.eye(3)]))
    return replace(target, components=(*target.components, loose))


@pytest.mark.parametrize(("name", "rows"), [(CROSS[0], (1, 0)), (CROSS[1], (3, 2))])
def test_cross_camber_takes_the_covariance_of_both_sides(measured, name, rows):
    """Against draws of both cambers, of a vehicle whose centres make most of what is not known."""
    wheels = len(measured.wheels)
    rng = np.random.default_rng(11)
    shaken = replace(
        measured,
        uncertainty=propagate(
            [loose_centre(wheel.observation.fitted) for wheel in measured.wheels],
            [wheel.wheel for wheel in measured.wheels],
        ),
    )
    covariance = shaken.uncertainty.covariance
    draws = rng.multivariate_normal(np.zeros(len(covariance)), covariance, 20_000)
    spread = np.std(draws[:, wheels + rows[0]] - draws[:, wheels + rows[1]])
    judged = assess(shaken, tolerance({"vehicle": {name: WIDE}})).verdicts[0].quantity
    assert judged.u == pytest.approx(spread, rel=4.5 / math.sqrt(2 * 20_000))
    assert judged.u != pytest.approx(
        np.sqrt(sum(np.var(draws[:, wheels + row]) for row in rows)), rel=0.03
    )


NEAR = {
    wheel: {"toe": {"lower_deg": lower, "upper_deg": upper}}
    for wheel, lower, upper in (("RR", -0.5, -0.2), ("RL", 0.1, 0.6), ("FR", -0.6, 0.2))
}


def test_joint_probability_is_that_of_draws_by_the_covariance(measured):
    """Toes of both rear wheels, their total and the thrust angle: singular, and far from free."""
    y = measured.uncertainty.values
    known = by_name(measured)

    def near(name: str, side: float, reach: float) -> dict:
        what = known[name]
        end = math.degrees(what.value + side * reach * what.u)
        return {"upper_deg" if side > 0 else "lower_deg": end}

    table = {
        "trials": False,
        "RR": {"toe": near("RR.toe", 1.0, 0.4)},
        "RL": {"toe": near("RL.toe", -1.0, 0.6)},
        "vehicle": {
            "rear_total_toe": near("rear_total_toe", 1.0, 0.5),
            "thrust_angle": near("thrust_angle", -1.0, 0.7),
        },
    }
    whole = assess(measured, tolerance(table))
    rows = [v.quantity.source for v in whole.verdicts]
    draws = 200_000
    # every input moves by one scale: the noise of all blocks is one estimate
    dof = whole.verdicts[0].quantity.dof
    true = np.random.default_rng(5).multivariate_normal(
        np.zeros(len(rows)), measured.uncertainty.covariance[np.ix_(rows, rows)], draws
    )
    limits = np.array([
        [v.interval.lower - y[v.quantity.source], v.interval.upper - y[v.quantity.source]]
        for v in whole.verdicts
    ])  # fmt: skip
    inside = np.mean(np.all((true >= limits[:, 0]) & (true <= limits[:, 1]), axis=1))
    scaled = true * np.sqrt(dof / np.random.default_rng(6).chisquare(dof, (draws, 1)))
    student = np.mean(np.all((scaled >= limits[:, 0]) & (scaled <= limits[:, 1]), axis=1))
    slack = 4.5 * 0.5 * math.sqrt(2.0 / draws)
    # the copula of Student's t differs from the normal one by less than the two differ
    assert whole.probability == pytest.approx(student, abs=slack + abs(student - inside) + 0.01)
    low, high = whole.joint_bounds
    assert low <= whole.probability <= high
    assert high - low > 20 * slack
    apart = math.prod(v.probability for v in whole.verdicts)
    assert abs(whole.probability - apart) > 5 * slack
    text = conformity_text(whole)
    assert f"at once: {100 * whole.probability:.1f} %" in " ".join(text.split())
    assert conformity_tree(whole)["verdict"]["joint_probability_of_conformity"] == whole.probability


def test_a_rear_trial_is_judged_by_the_thrust_line_that_it_turns(measured):
    """Half of the sum of its toe and the other rear wheel's; a front trial counts as before."""
    limits = {axle: {"toe_to_thrust_line": WIDE} for axle in ("rear", "front")}
    judged = {v.quantity.subject: v.quantity for v in assess(measured, tolerance(limits)).verdicts}
    toe = {wheel.observation.name: wheel.angles.toe_rad for wheel in measured.wheels}
    trials = {w.observation.name: w.wheel for w in measured.wheels if w.observation.role == "trial"}
    assert trials
    assert judged.keys() == toe.keys()
    thrust = (toe["RL"] - toe["RR"]) / 2
    moved = 0.0
    for name, wheel in trials.items():
        side = 1.0 if wheel.endswith("L") else -1.0
        expected = before = toe[name] - side * thrust
        if wheel in ("RR", "RL"):
            expected = (toe[name] + toe["RL" if wheel == "RR" else "RR"]) / 2
        assert judged[name].value == pytest.approx(expected, abs=1e-14)
        moved = max(moved, abs(expected - before))
    assert moved > 1e-3


def test_one_quantity_alone_has_its_own_probability(measured):
    whole = assess(measured, tolerance({"trials": False, "RR": NEAR["RR"]}))
    assert whole.probability == whole.verdicts[0].probability


def test_the_guard_factor_that_is_printed_is_the_one_used(measured):
    """Student's, of the degrees of freedom of each quantity; a range where they differ."""
    whole = assess(measured, tolerance({"trials": False, **NEAR}))
    tree = conformity_tree(whole)
    used = []
    for found, entry in zip(whole.verdicts, tree["conformity"], strict=True):
        k = float(stats.t.ppf(0.95, found.quantity.dof))
        assert entry["coverage_factor"] == pytest.approx(k, rel=1e-9)
        assert k > K + 0.01
        one_sided = replace(found.interval, lower=-math.inf)
        beyond = replace(found.quantity, value=one_sided.upper + 1.0001 * k * found.quantity.u)
        assert decide(beyond, one_sided, GUARDED).decision == "not conform"
        before = replace(found.quantity, value=one_sided.upper + 0.9999 * k * found.quantity.u)
        assert decide(before, one_sided, GUARDED).decision == "undecided"
        used.append(k)
    assert tree["verdict"]["coverage_factor"] == pytest.approx(max(used), rel=1e-9)
    assert f"by {used[0]:.3f} u or more" in " ".join(conformity_text(whole).split())
    mixed = replace(
        whole, verdicts=(*whole.verdicts, decide(quantity(0.0), INTERVALS["wide"], GUARDED))
    )
    low, high = K, max(used)
    assert f"by {low:.3f} u to {high:.3f} u, by the degrees" in " ".join(
        conformity_text(mixed).split()
    )


def test_a_wheels_own_limits_stand_before_its_axles(measured):
    both = tolerance({"rear": {"toe": WIDE}, "RR": {"toe": {"upper_deg": -5.0}}})
    shown = {v.quantity.subject: v.decision for v in assess(measured, both).verdicts}
    by_wheel = {result.observation.name: result.wheel for result in measured.wheels}
    expected = {"RR": "not conform", "RL": "conform"}
    assert shown == {n: expected[w] for n, w in by_wheel.items() if w in expected}
    assert set(shown) == {"RR", "RL", "1", "2", "3", "4"}
    without = both.model_copy(update={"trials": False})
    assert {v.quantity.subject for v in assess(measured, without).verdicts} == {"RR", "RL"}


def test_a_trial_that_was_not_measured_is_undecided_with_its_reason(measured):
    *others, last = measured.wheels
    lost = replace(last.observation, evidence=None, status="no-plane", reason="only three points")
    for wheel in (last.wheel, None):
        without = replace(measured, wheels=(*others, WheelResult(lost, wheel)))
        whole = assess(without, tolerance({"rear": {"toe": WIDE, "camber": WIDE}}))
        assert whole.decision == "undecided"
        found = [v for v in whole.verdicts if v.quantity.subject == last.observation.name]
        assert [v.quantity.name for v in found] == ["toe", "camber"]
        for lacking in found:
            assert lacking.reason == "not measured, no-plane: only three points"
            assert lacking.probability is None
        assert conformity_text(whole).count("not measured, no-plane: only three points") == 2
        json.dumps(conformity_tree(whole), allow_nan=False)


SWAP = {"RR": "RL", "RL": "RR", "FR": "FL", "FL": "FR"}
ONE_SIDED = {
    "RR": {"toe": {"upper_deg": -0.2}, "camber": {"lower_deg": 1.5, "upper_deg": 2.5}},
    "RL": {"toe": {"lower_deg": 0.2}},
    "FL": {"camber": {"upper_deg": 0.3}},
    "vehicle": {
        "rear_total_toe": {"upper_deg": 0.3},
        "thrust_angle": {"lower_deg": 0.1, "upper_deg": 0.6},
        "front_cross_camber": {"upper_deg": 0.9},
    },
}
SIDED = ("thrust_angle", "front_cross_camber")


def mirrored(table: dict) -> dict:
    """The limits for the vehicle in a mirror: sides exchanged, and signs of what has a side."""

    def turned(limits: dict) -> dict:
        ends = {"lower_deg": "upper_deg", "upper_deg": "lower_deg"}
        return {ends[end]: -value for end, value in limits.items()}

    vehicle = {n: turned(z) if n in SIDED else z for n, z in table["vehicle"].items()}
    return {SWAP.get(name, name): part for name, part in table.items()} | {"vehicle": vehicle}


def test_a_mirrored_vehicle_is_judged_alike(measured):
    file = read_five_point(FIGURE_4)
    order = [1, 0, 3, 2, *range(4, len(file.blocks_m))]
    other = replace(file, blocks_m=(file.blocks_m * [1.0, -1.0, 1.0])[order])

    def shown(measurement: Measurement, table: dict, names: dict) -> tuple[dict, dict]:
        verdicts = {
            (names.get(v.quantity.subject, v.quantity.subject), v.quantity.name): v
            for v in assess(measurement, tolerance(table)).verdicts
        }
        return (
            {key: v.decision for key, v in verdicts.items()},
            {key: v.probability for key, v in verdicts.items()},
        )

    mirror = measure_five_point(other)
    decided, probability = shown(measured, ONE_SIDED, {})
    there = shown(mirror, mirrored(ONE_SIDED), SWAP)
    assert there[0] == decided
    assert there[1] == pytest.approx(probability, rel=1e-6)
    assert shown(mirror, ONE_SIDED, SWAP)[0] != decided
    assert set(decided.values()) == {"conform", "undecided", "not conform"}


# --- the file -----------------------------------------------------------------------------------


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_nominal_and_tolerance_are_lower_and_upper(tmp_path):
    mine = load_tolerance(
        str(
            written(
                tmp_path,
                "[rear.toe]\nnominal_deg = 0.1\ntolerance_deg = 0.3\n"
                "[front.toe]\nlower_deg = -0.2\n[vehicle.wheelbase]\nupper_m = 3\n",
            )
        )
    )
    assert mine.of_wheel("RL")["toe"].lower == pytest.approx(math.radians(-0.2), rel=1e-14)
    assert mine.of_wheel("RL")["toe"].upper == pytest.approx(math.radians(0.4), rel=1e-14)
    assert mine.of_wheel("FR") == {"toe": ToleranceInterval(math.radians(-0.2), math.inf)}
    assert mine.of_vehicle() == {"wheelbase": ToleranceInterval(-math.inf, 3.0)}
    assert (mine.rule, mine.confidence, mine.trials) == ("guarded", 0.95, True)
    assert mine.coverage_factor == pytest.approx(K, rel=1e-12)


BAD = {
    "nothing": ("", ["no limit", "[rear.toe]"]),
    "unit missing": ("[rear.toe]\nlower = 1", ["rear.toe", "write lower_deg = 1"]),
    "misspelt": ("[rear.tow]\nlower_deg = 1", ["'rear.tow'", "'toe'"]),
    "small letters": ("[rr.toe]\nlower_deg = 1", ["'rr'", "'RR'"]),
    "empty": ("[rear.toe]", ["rear.toe", "lower_deg"]),
    "exchanged": (
        "[rear.toe]\nlower_deg = 1\nupper_deg = 0.5",
        ["rear.toe", "lower_deg = 1 is not below upper_deg = 0.5"],
    ),
    "equal": ("[rear.toe]\nlower_deg = 1\nupper_deg = 1", ["not below"]),
    "mixed": ("[rear.toe]\nlower_deg = 1\nnominal_deg = 0.5", ["nominal_deg with tolerance_deg"]),
    "half": ("[FL.camber]\nnominal_deg = 1", ["FL.camber", "nominal_deg with tolerance_deg"]),
    "negative": ("[rear.toe]\nnominal_deg = 1\ntolerance_deg = -1", ["rear.toe.tolerance_deg"]),
    "no table": ("[rear]\ntoe = 3", ["rear.toe", "a table is needed"]),
    "infinite": ("[rear.toe]\nlower_deg = -inf", ["rear.toe.lower_deg", "finite"]),
    "text": ("[rear.toe]\nlower_deg = '1'", ["rear.toe.lower_deg", "'1'"]),
    "rule": ("rule = 'gaurded'\n[rear.toe]\nupper_deg = 1", ["'guarded' or 'simple'"]),
    "per cent": ("confidence = 95\n[rear.toe]\nupper_deg = 1", ["confidence", "less than 1"]),
    "coin": ("confidence = 0.5\n[rear.toe]\nupper_deg = 1", ["confidence", "greater than 0.5"]),
    "degrees": ("[vehicle.wheelbase]\nupper_deg = 3", ["'vehicle.wheelbase.upper_deg'", "upper_m"]),
    "seconds": ("[rear.toe]\nupper_deg = 400", ["rear.toe.upper_deg", "400"]),
    "no TOML": ("[rear.toe", ["TOML"]),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_wrong_file_is_refused_in_one_line(kind, tmp_path, wheelplane):
    text, says = BAD[kind]
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as refused:
        load_tolerance(str(path))
    for part in (str(path), *says):
        assert part in str(refused.value)
    code, out, err = wheelplane(
        "five-point", FIGURE_4, "--tolerance", path, "-o", tmp_path / "report.txt"
    )
    assert (code, out) == (2, "")
    assert err == f"wheelplane: {refused.value}\n"
    assert not (tmp_path / "report.txt").exists()


def test_the_shipped_example_is_a_tolerance_and_says_that_it_is_one():
    example = load_tolerance("example")
    assert "EXAMPLE" in example.title
    assert "invented" in example.title
    text = (config_folder() / "tolerances" / "example.toml").read_text(encoding="utf-8")
    assert text.startswith("# AN EXAMPLE")
    with pytest.raises(ConfigError, match=r"unknown tolerance 'exampel': did you mean 'example'"):
        load_tolerance("exampel")


# --- the commands -------------------------------------------------------------------------------


@pytest.fixture
def wheelplane(capsys, monkeypatch):
    """Call the command in this process: exit code, standard output, standard error."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["wheelplane", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return call


@pytest.fixture
def command(request, monkeypatch, tmp_path, wheelplane, measured):
    """Call `five-point` on the paper's file, or `measure` as if its scans had shown the same."""
    if request.param == "five-point":
        return lambda *options: wheelplane("five-point", FIGURE_4, *options)

    @contextlib.contextmanager
    def opened(path, target, options):
        yield mock.MagicMock(entries=(), scanner=None, vehicle_model=MODEL)

    monkeypatch.setattr(measure_command, "open_capture", opened, raising=True)
    monkeypatch.setattr(
        measure_command, "measure_capture", lambda *_, **_given: measured, raising=True
    )
    return lambda *options: wheelplane("measure", tmp_path, *options)


MODEL = "Model T"  # of the capture that `measure` opens
both = pytest.mark.parametrize("command", ["five-point", "measure"], indirect=True)
LIMITS = {  # the toe of RL is 0.42 deg, with u = 0.116 deg
    "conform": ("[RL.toe]\nlower_deg = -5.0\nupper_deg = 5.0", 0),
    "undecided": ("[RL.toe]\nupper_deg = 0.5", 1),
    "not conform": ("[RL.toe]\nupper_deg = -1.0", 1),
}
WORDS = {"conform": "conforming", "undecided": "undecided", "not conform": "nonconforming"}


@both
@pytest.mark.parametrize("decision", LIMITS)
def test_exit_code_is_0_only_when_conformity_is_shown(command, decision, tmp_path):
    text, expected = LIMITS[decision]
    path = written(tmp_path, f"trials = false\ntitle = 'of the\ttest'\n{text}")
    code, out, err = command("--tolerance", path)
    assert (code, err) == (expected, "")
    assert f"Verdict: {WORDS[decision].upper()} (of the test)\n" in out
    code, out, err = command("--tolerance", path, "--json")
    tree = json.loads(out)
    assert (code, err) == (expected, "")
    assert tree["verdict"]["decision"] == tree["conformity"][0]["decision"] == decision
    assert len(tree["conformity"]) == 1
    assert command("--tolerance", path, "--json")[1] == out


@both
def test_the_tolerance_is_kept_with_the_result(command, tmp_path):
    path = written(tmp_path, "rule = 'simple'\n" + LIMITS["undecided"][0])
    tree = json.loads(command("--tolerance", path, "--json")[1])
    kept = tree["provenance"]["config"].pop("tolerance")
    assert Tolerance.model_validate(kept) == load_tolerance(str(path))
    assert tree["verdict"]["rule"] == "simple"
    plain = json.loads(command("--json")[1])
    assert (plain["verdict"], plain["conformity"]) == (None, None)
    without = {key: value for key, value in tree.items() if key not in ("verdict", "conformity")}
    assert without == {key: plain[key] for key in without}  # it judges, it does not measure


@both
def test_table_and_report_say_what_the_json_says(command, tmp_path):
    options = ("--tolerance", "example")
    tree = json.loads(command(*options, "--json")[1])
    _, out, _ = command(*options, "-o", tmp_path / "out")
    report = tmp_path / "out" / "report.txt"
    report = (report if report.exists() else tmp_path / "out").read_text(encoding="utf-8")
    section = out[out.index("Verdict: ") : out.index("wrote ")].strip()
    assert section in report
    for sign in ("Toe-in", "top outward", "thrust to the right", "k = 1"):
        assert sign in section
    rows = re.findall(r"^  (conforming|undecided|nonconforming)  (.*)$", section, re.M)
    assert len(rows) == len(tree["conformity"])
    expanded = {entry["quantity"]: entry["expanded_95"] for entry in tree["uncertainty"]}
    for (decision, row), entry in zip(rows, tree["conformity"], strict=True):
        name, quantity, *cells = re.split(r"  +", row.strip())
        assert decision == WORDS[entry["decision"]]
        assert name.split(" ")[0] == entry["name"]
        assert quantity == entry["quantity"].replace("_", " ")
        value, lower, upper, u, guard, p, risk = cells
        if "value_deg" in entry:
            vehicle = entry["name"] == "vehicle"
            named = entry["quantity"] if vehicle else f"{entry['name']}.{entry['quantity']}"
            assert says_angle(value, entry["value_deg"], expanded[named])
            for cell, key in ((lower, "lower_deg"), (upper, "upper_deg")):
                assert seconds_of(cell) == pytest.approx(3600 * entry[key], abs=0.051)
            assert says_width(u, entry["u_deg"])
            assert says_width(guard, entry["guard_band_deg"])
        else:
            decimals = -round(math.log10(step(expanded[entry["quantity"]])))
            if entry["quantity"] in ("front_setback", "wheelbase_difference", "axle_offset"):
                assert value == f"{1e3 * entry['value_m']:+.{decimals - 3}f} mm"
                assert lower == f"{1e3 * entry['lower_m']:+.3f} mm"
            else:
                assert value == f"{entry['value_m']:.{decimals}f} m"
            assert u == f"{two_digits(1000 * entry['u_m']):f} mm"
        assert said(p, entry["probability_of_conformity"])
        risks = entry["consumer_risk"], entry["producer_risk"]
        assert (risk == "-") == (risks == (None, None)) == (decision == "undecided")
        if decision == "conforming":
            assert said(risk, risks[0])
            assert risks[0] == pytest.approx(1 - entry["probability_of_conformity"], abs=1e-12)
        if decision == "nonconforming":
            assert said(risk, risks[1])
            assert risks[1] == entry["probability_of_conformity"]
        assert bool(entry["reason"]) == (decision == "undecided")
        assert entry["reason"] in section
    assert {decision for decision, _ in rows} == set(WORDS.values())


def said(cell: str, probability: float) -> bool:
    if cell == "< 0.1 %":
        return probability < 5e-4
    if cell == "> 99.9 %":
        return probability >= 0.9995
    return float(cell.removesuffix(" %")) == pytest.approx(100 * probability, abs=0.051)


@both
@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("", "unknown tolerance ''"),
        ("exampel", "did you mean 'example'"),
        ("none.toml", "none.toml: no such file"),
    ],
)
def test_a_tolerance_that_is_not_there_is_refused_in_one_line(command, name, says):
    code, out, err = command("--tolerance", name)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert says in err


@both
def test_the_limits_of_the_capture_s_model_are_found_among_those_of_a_folder(command, tmp_path):
    """A five-point file names no model, so that it finds none."""
    folder = tmp_path / "limits"
    folder.mkdir()
    for decision, (text, _) in LIMITS.items():
        model = MODEL if decision == "undecided" else f"not {decision}"
        text = f"trials = false\nvehicle_model = {model!r}\n{text}"
        (folder / f"{decision}.toml").write_text(text, encoding="utf-8")
    code, out, err = command("--tolerance", folder, "--json")
    if not out:
        assert code == 2
        assert err.startswith(f"wheelplane: {FIGURE_4}: it names no vehicle_model")
        assert err.count("\n") == 1
        return
    tree = json.loads(out)
    assert (code, err, tree["verdict"]["decision"]) == (1, "", "undecided")
    assert tree["provenance"]["config"]["tolerance"]["vehicle_model"] == MODEL
    code, out, err = command("--tolerance", "auto")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "configs/tolerances: it has the limits of 'Example Saloon'" in err
    assert "'Model T'" in err
    code, out, err = command("--tolerance", folder / "conform.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "vehicle model 'not conform'" in err


def test_the_estimator_of_2013_has_no_uncertainty_to_judge_by(wheelplane, tmp_path):
    code, out, err = wheelplane(
        "five-point", FIGURE_4, "--method", "tcgc-2013", "--tolerance", "example"
    )
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "--tolerance with --method tcgc-2013" in err


@pytest.mark.parametrize(
    "view",
    [View(), View("thrust-line"), View("centreline", convention="german-workshop")],
)
def test_limited_values_name_the_axis_that_they_are_from_beside_those_from_another(view):
    measurement = measure_five_point(read_five_point(FIGURE_4))
    wide = {"lower_deg": -20.0, "upper_deg": 20.0}
    limits = {"toe": wide, "camber": wide, "toe_to_thrust_line": wide}
    vehicle = {"thrust_angle": wide, "front_total_toe": wide}
    tolerance = Tolerance.model_validate({"front": limits, "vehicle": vehicle})
    text = conformity_text(assess(measurement, tolerance), view)
    own = view.axis != "rear-axle"
    assert text.count("toe to the normal of the rear axle") == 2 * own  # FR, FL
    assert text.count("thrust angle to the normal of the rear axle") == own
    assert "camber to the" not in text
    assert "total toe to the" not in text
