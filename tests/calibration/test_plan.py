"""Tests of the plan: what it predicts is what calibrations state; what it asks for is enough."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from tests.support.calibration_bay import (
    CAMBER,
    TOE,
    Bay,
    Protocol,
    changed,
    item_of,
    machine,
    minutes,
)
from tests.support.paths import CONFIGS
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.forms.plan_file import PLAN_FORM, Plan, PlannedQuantity, load_plan
from wheelplane.calibration.plan import plan_calibration, planned_set, power
from wheelplane.calibration.planned_bay import planned_reference
from wheelplane.config import Config, InstrumentConfig, load_config, with_scanner
from wheelplane.errors import ConfigError
from wheelplane.measurement import Estimate
from wheelplane.report.json.calibration import plan_json
from wheelplane.report.text.calibration_plan import plan_text
from wheelplane.targets import load_target

ITEM = item_of(machine(camber=CAMBER)).item
TABLE = PlannedQuantity(
    repeatability="0.3'", lower="-1°", upper="1°", zero="1'", gain=0.02, hysteresis="1'"
)
PLAN = Plan(trials=8, repeats=3, directions=True, spacing="1.5 mm", toe=TABLE)
CONFIG = Config(instrument=InstrumentConfig(range_sigma_m=8e-4))
DISC = load_target("disc-250")


def planned(plan=PLAN, trials=None, config=CONFIG):
    return planned_reference(plan, ITEM, plan.trials if trials is None else trials, DISC, config)


@pytest.mark.slow
@pytest.mark.parametrize("series", [1, 4])
def test_the_planned_uncertainties_are_those_of_calibrations(series):
    tested = machine(
        toe=changed(TOE, reproducibility=0.5 * (series > 1)), protocol=Protocol(series=series)
    )
    table = TABLE.model_copy(update={"reproducibility": "0.5'"})
    plan = PLAN.model_copy(update={"series": series, "toe": table})
    squares = []
    for seed in range(60):
        bay = Bay(seed=(9, seed))
        (result,) = calibrate([bay.reference()], item_of(tested), bay.readings(tested)).results
        known = planned_set("toe", plan, ITEM, bay.reference(noisy=False))
        line = result.characteristic
        pairs = [(result.points[0].error, known.errors[0]), (line.zero, known.zero),
                 (line.sensitivity, known.sensitivity),
                 (result.hysteresis, known.hysteresis)]  # fmt: skip
        squares.append([(one.u / other.u) ** 2 for one, other in pairs])
        if series == 1:
            assert result.hysteresis.dof == known.hysteresis.dof == 48.0
    mean = np.mean(squares, axis=0)
    np.testing.assert_allclose(mean, 1.0, atol=4.0 * math.sqrt(2.0 / 3.0 / 60.0))


@pytest.mark.parametrize("repeats", [1, 3])
def test_a_hysteresis_of_several_series_is_planned_from_their_scatter(repeats):
    """Single readings too: u is that of the readings, degrees of freedom those of the series."""
    plan = PLAN.model_copy(update={"series": 3, "repeats": repeats})
    reference = Bay(seed=1).reference()
    set_ = planned_set("toe", plan, ITEM, reference)
    readings = len(set_.points) * plan.series * repeats
    assert minutes(set_.hysteresis.u) == pytest.approx(0.3 * math.sqrt(2.0 / readings), rel=0.05)
    assert set_.hysteresis.dof == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("series", "shift"), [(1, 0.0), (4, 0.5)])
def test_the_planned_rounding_of_coarse_readings_is_that_of_calibrations(series, shift):
    """Directions half a step apart, and series some part of one: whole, u^2 would be 1.6 of it."""
    toe = changed(TOE, resolution=1.0, repeatability=0.5, hysteresis=0.5, reproducibility=shift)
    tested = machine(toe=toe, protocol=Protocol(series=series))
    table = PlannedQuantity(
        repeatability="0.5774'", reproducibility=f"{shift}'", hysteresis="0.5'"
    )  # sqrt(0.5^2 + 1/12)
    plan = PLAN.model_copy(update={"series": series, "toe": table})
    item, ratios = item_of(tested), []
    for seed in range(40):
        bay = Bay(seed=(10, seed))
        (result,) = calibrate([bay.reference()], item, bay.readings(tested)).results
        known = planned_set("toe", plan, item.item, bay.reference(noisy=False))
        squares = [sum(e.u**2 for e in each) for each in
                   ([p.error for p in result.points], known.errors)]  # fmt: skip
        ratios.append(squares[0] / squares[1])
    assert abs(np.mean(ratios) - 1.0) < 0.05 + 4.0 * np.std(ratios, ddof=1) / math.sqrt(40)


def test_directions_half_a_step_apart_are_planned_with_a_quarter_of_the_rounding():
    tested = machine(toe=changed(TOE, resolution=1.0))
    item, reference = item_of(tested).item, Bay().reference(noisy=False)
    apart = {}
    for hysteresis in ("0.5'", "1'"):
        table = PlannedQuantity(repeatability="0'", hysteresis=hysteresis)
        plan = PLAN.model_copy(update={"toe": table})
        set_ = planned_set("toe", plan, item, reference)
        apart[hysteresis] = set_.errors[0].u ** 2 - set_.references[0].u ** 2
    whole = math.radians(1.0 / 60.0) ** 2 / 12.0
    assert apart["1'"] == pytest.approx(whole)
    assert apart["0.5'"] == pytest.approx(whole / 4.0)


def test_power_is_that_of_the_t_test_and_grows_with_the_error():
    known = Estimate(0.0, 2.0, 10.0)
    assert power(0.0, known) == pytest.approx(0.025, abs=1e-6)
    assert power(known.expanded, known) == pytest.approx(0.5, abs=0.03)
    assert power(-50.0, known) == pytest.approx(1.0)
    assert power(1.0, Estimate(0.0, 0.0)) == 1.0


def test_the_planned_reference_has_the_textbook_u_of_a_disc():
    """2 sigma/(r sqrt N) of each tilt; camber of a trial has little else."""
    sigma, spacing, radius = 8e-4, 1.5e-3, 0.125
    config = CONFIG.model_copy(update={"instrument": InstrumentConfig(range_sigma_m=sigma)})
    bare = DISC.model_copy(update={"flatness": 0.0, "clamp_tilt_deg": 0.0, "clamp_shift": 0.0})
    found = planned_reference(PLAN, ITEM, 4, bare, config).value("camber", "1", ITEM)
    number = math.pi * radius**2 / spacing**2
    assert found.u == pytest.approx(2.0 * sigma / (radius * math.sqrt(number)), rel=0.1)


def test_trials_are_spread_over_the_range_of_toe_and_camber():
    plan = PLAN.model_copy(update={"camber": TABLE.model_copy(update={"lower": "-3°"})})
    reference = planned(plan)
    toes = [math.degrees(reference.value("toe", str(k), ITEM).value) for k in range(1, 9)]
    cambers = [math.degrees(reference.value("camber", str(k), ITEM).value) for k in range(1, 9)]
    np.testing.assert_allclose(toes, np.linspace(-1.0, 1.0, 8), atol=0.02)
    np.testing.assert_allclose(cambers, np.linspace(1.0, -3.0, 8), atol=0.02)


def test_the_repeats_and_the_reference_asked_for_are_just_enough():
    table = PlannedQuantity(repeatability="2'", wanted="1.5'")
    plan = Plan(trials=4, repeats=3, toe=table, spacing="1.5 mm")
    reference = planned(plan)
    (one,) = plan_calibration(plan, ITEM, reference, None).quantities
    assert one.repeats is not None
    assert one.error.expanded > one.wanted
    for repeats, enough in ((one.repeats, True), (one.repeats - 1, False)):
        errors = planned_set(
            "toe", plan.model_copy(update={"repeats": repeats}), ITEM, reference
        ).errors
        assert (max(e.expanded for e in errors) <= one.wanted) == enough
    fine = plan.model_copy(update={"toe": table.model_copy(update={"repeatability": "0.1'"})})
    coarse = CONFIG.model_copy(update={"instrument": InstrumentConfig(range_sigma_m=1e-2)})
    (far,) = plan_calibration(fine, ITEM, planned(plan, config=coarse), None).quantities
    assert far.repeats is None  # no readings make up for a reference that coarse
    assert far.u_reference < far.reference


@pytest.mark.slow
def test_the_trials_asked_for_detect_the_gain_and_no_fewer_do():
    table = PlannedQuantity(repeatability="1'", lower="-1°", upper="1°", gain=0.02)
    plan = Plan(trials=2, repeats=3, toe=table, spacing="1.5 mm")
    found = plan_calibration(plan, ITEM, planned(plan), lambda n: planned(plan, n))
    (gain,) = found.quantities[0].detections
    assert gain.trials is not None
    assert gain.power < 0.95
    powers = [
        power(0.02, planned_set("toe", plan, ITEM, planned(plan, n)).sensitivity)
        for n in range(1, gain.trials + 1)
    ]
    assert max(powers[:-1]) < 0.95 <= powers[-1]


def test_the_trials_asked_for_are_the_first_that_do_even_where_more_do_not():
    """Every fifth number fails: 20, 10 and 5 among them, which halving 0 to 40 would ask for."""
    coarse = CONFIG.model_copy(update={"instrument": InstrumentConfig(range_sigma_m=0.1)})
    table = PlannedQuantity(repeatability="0.3'", lower="-1°", upper="1°", gain=0.02)
    plan = Plan(trials=4, repeats=3, toe=table, spacing="1.5 mm")

    def new(trials):
        return planned(plan, trials, coarse if trials < 3 or trials % 5 == 0 else CONFIG)

    (gain,) = plan_calibration(plan, ITEM, new(4), new).quantities[0].detections
    assert gain.trials == 3
    never = plan_calibration(plan, ITEM, new(4), lambda n: planned(plan, 0, coarse))
    assert [one.trials for one in never.quantities[0].detections] == [None]


@pytest.mark.parametrize("trials", range(1, 25))
def test_trials_are_placed_so_that_an_error_of_the_frame_is_no_gain_and_no_zero_error(trials):
    """Its sign is that of the side: sums of it, and of it times the angle, are none or small."""
    seen = planned(PLAN, trials).measurement.wheels[4:]
    sides = np.array([1.0 if one.wheel.endswith("R") else -1.0 for one in seen])
    steps = np.arange(trials) - (trials - 1) / 2.0
    unpaired = trials % 4 == 2
    assert abs(sides.sum()) == trials % 2
    assert abs(sides @ steps) <= (trials // 2) * unpaired
    assert unpaired or sides @ steps == 0.0


def test_the_gain_of_a_scanner_whose_scans_are_registered_shows_in_few_trials():
    """One wheel after the other, left and right in turn, 8 trials show 2 % with a power of 38 %."""
    config = with_scanner(load_config(None), "phase-shift")
    for trials in (3, 4, 8):
        set_ = planned_set("toe", PLAN, ITEM, planned(PLAN, trials, config))
        assert power(0.02, set_.sensitivity) > 0.99
        assert power(math.radians(1.0 / 60.0), set_.zero) > 0.8


@pytest.mark.parametrize(("series", "resolution"), [(1, 0.1), (1, 2.0), (3, 1.0)])
def test_u_falls_with_every_repeat(series, resolution):
    """The search of the repeats rests on this."""
    item = item_of(machine(toe=changed(TOE, resolution=resolution))).item
    table = TABLE.model_copy(update={"repeatability": "0.8'", "reproducibility": "0.2'"})
    reference = planned(PLAN, 2)
    plans = [
        PLAN.model_copy(update={"series": series, "repeats": n, "toe": table}) for n in range(2, 12)
    ]
    sizes = [planned_set("toe", plan, item, reference).errors[4].expanded for plan in plans]
    assert np.all(np.diff(sizes) < 0.0)


def test_the_form_is_a_plan_and_its_text_and_json_hold_every_part(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN_FORM, encoding="utf-8")
    plan = load_plan(path)
    config = with_scanner(load_config(None), "phase-shift")
    new = planned_reference(plan, ITEM, plan.trials, DISC, config)
    found = plan_calibration(plan, ITEM, new, None)
    assert [one.quantity for one in found.quantities] == ["toe", "camber"]
    tree = json.loads(plan_json(found))
    assert len(tree["trials"]) == 8
    assert "Errors to be detected" in plan_text(found)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("repeats = 3 ", "repeats = 1 ", "shows no repeatability"),
        ('track = "1.5 m"', 'track = "1.5°"', "track: a length above zero is needed"),
        ("trials = 8", "trails = 8", "did you mean 'trials'?"),
        ('repeatability = "0.5\'"  #', "# ", "'plan.toe.repeatability' is missing"),
    ],
)
def test_a_wrong_plan_is_refused_with_what_to_write(tmp_path, old, new, fault):
    path = tmp_path / "plan.toml"
    text = PLAN_FORM.replace(old, new).replace("series = 1", "series = 1")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_plan(path)
    assert fault in str(error.value)


def test_a_quantity_that_is_zero_by_definition_of_its_axis_is_named():
    """The thrust angle counted from the thrust line has no point."""
    toe = changed(TOE, positive="right", axis="thrust-line")
    item = item_of(machine(thrust_angle=toe)).item
    plan = PLAN.model_copy(update={"toe": None, "thrust_angle": TABLE})
    with pytest.raises(ValueError, match=r"plan.thrust_angle: .* no point of it; .*thrust-line"):
        plan_calibration(plan, item, planned(), None)


@pytest.mark.parametrize("spacing", ["100 mm", "200 mm", "400 mm"])
def test_points_too_far_apart_for_the_target_show_no_plane(spacing):
    plan = PLAN.model_copy(update={"spacing": spacing})
    if spacing == "100 mm":
        assert planned(plan).measurement.wheels[0].observation.fitted is not None
        return
    fault = rf"plan.spacing: of points {spacing} apart \d lie on the target \(250 mm\)"
    with pytest.raises(ValueError, match=fault):
        planned(plan)


@pytest.mark.parametrize(
    ("part", "text", "fault"),
    [
        ("wanted", "-1'", "above zero"),
        ("wanted", "0'", "above zero"),
        ("repeatability", "-0.5'", "zero or more"),
        ("reproducibility", "-0.5'", "zero or more"),
        ("repeatability", "0'", ""),
        ("zero", "-1'", ""),
    ],
)
def test_an_uncertainty_below_zero_is_refused(part, text, fault):
    """The sign of an error that shall be detected is free: its size alone counts."""
    plan = PLAN.model_copy(update={"toe": TABLE.model_copy(update={part: text})})
    if fault:
        with pytest.raises(ValueError, match=rf"plan.toe.{part}: {text} is no size .*{fault}"):
            plan_calibration(plan, ITEM, planned(), None)
    else:
        assert plan_calibration(plan, ITEM, planned(), None).quantities[0].error.u > 0.0


def test_what_the_files_do_not_state_is_named():
    with pytest.raises(ValueError, match="states no range_sigma_m"):
        planned(config=Config())
    with pytest.raises(ValueError, match=r"plan\.spacing is missing"):
        planned(PLAN.model_copy(update={"spacing": None}))
    total = Plan(trials=0, repeats=2, total_toe=TABLE)
    with pytest.raises(ValueError, match=r"the item file has no \[item\.total_toe\]"):
        plan_calibration(total, ITEM, planned(), None)
    assert (CONFIGS / "machines" / "example.toml").is_file()
