"""A measurement read from its measurement.json: the same angles, uncertainties and verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.kinematics.test_runout import ECCENTRIC, HALF, WOBBLE, all_round
from tests.measurement.test_verticals import measured, scene
from tests.support.made import write_small_capture
from tests.support.reported import lost
from tests.support.turning import WHEELS, Scene, mounted, rolled
from wheelplane.capture import open_capture
from wheelplane.config import load_config
from wheelplane.errors import InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measure import measure_capture
from wheelplane.measurement import assess, by_name, check_by_monte_carlo, load_tolerance
from wheelplane.report.format.earlier import read_earlier
from wheelplane.report.json.measurement import to_json
from wheelplane.report.json.stored import is_measurement, read_measurement

PAPER = Path(__file__).resolve().parents[1] / "data" / "paper" / "figure-4.txt"
# What only the points of the scans show.
OF_SCANS = {
    "points_effective", "noise_m", "correlated_noise_m", "correlation_length_m", "u_plane_deg",
    "u_plane_if_independent_deg", "steps_m", "u_rounding_deg", "brightness_step_m",
    "u_brightness_step_m", "u_brightness_deg", "centres", "turn_by",
}  # fmt: skip


def kept(tree):
    """The tree without what only the points show."""
    if isinstance(tree, dict):
        return {key: kept(value) for key, value in tree.items() if key not in OF_SCANS}
    return [kept(value) for value in tree] if isinstance(tree, list) else tree


def check_alike(one, other, at=""):
    """Compare numbers to the six digits that the file keeps of uncertainties."""
    assert type(one) is type(other) or {type(one), type(other)} == {int, float}, at
    if at.endswith(".factor"):  # the sign of a column is free
        one, other = ((np.array(factor) @ np.array(factor).T).tolist() for factor in (one, other))
        at += ".covariance"
    if isinstance(one, dict):
        assert one.keys() == other.keys(), at
        for key, value in one.items():
            check_alike(value, other[key], f"{at}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), at
        for i, (value, again) in enumerate(zip(one, other, strict=True)):
            check_alike(value, again, f"{at}[{i}]")
    elif isinstance(one, float) and at.endswith("degrees_of_freedom"):
        assert 1.0 / other == pytest.approx(1.0 / one, rel=1e-5, abs=1e-12), at
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=2e-6, abs=2e-9), at
    else:
        assert one == other, at


def check(found, tmp_path, conformity=None):
    path = tmp_path / "measurement.json"
    path.write_text(to_json(found, conformity))
    assert is_measurement(path)
    again = read_measurement(path, "measurement.json")
    trees = [json.loads(text) for text in (path.read_text(), to_json(*again))]
    check_alike(*map(kept, trees))
    return again


def test_five_points_with_limits_and_draws(tmp_path):
    found = check_by_monte_carlo(measure_five_point(read_five_point(PAPER)), 20_000, 1)
    _, conformity = check(found, tmp_path, assess(found, load_tolerance("example")))
    assert conformity is not None


def test_scans_of_discs(tmp_path):
    write_small_capture(tmp_path / "capture")
    with open_capture(tmp_path / "capture") as capture:
        found = measure_capture(capture, load_config(None))
    again, _ = check(found, tmp_path)
    points = [[wheel.observation.points_total for wheel in one.wheels] for one in (found, again)]
    assert points[0] == points[1]


def test_a_lost_trial_keeps_its_reason(tmp_path):
    again, _ = check(lost(), tmp_path)
    assert again.wheels[-1].observation.reason == "two planes, none of its size"


@pytest.mark.parametrize("rolls", [(), ("FL",), WHEELS])
def test_camber_from_gravity_with_run_outs(tmp_path, rolls):
    check(measured(scene(6, rolls=rolls)), tmp_path)


def test_run_outs_are_compensated_again(tmp_path):
    check(all_round(10, 1.0, ECCENTRIC).measure(), tmp_path)
    rotating = Scene(5, u_turn=7.5e-5, with_centre=0.6)
    plate = {"wobble": WOBBLE, "eccentric_m": ECCENTRIC[0]}
    found = rolled(mounted(rotating.references(), "FL", **plate), "FL", HALF, **plate).measure()
    again, _ = check(found, tmp_path)
    assert again.plates is not None


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda tree: tree.pop("poses"), "incomplete or was changed (it lacks 'poses')"),
        (lambda tree: tree.update(schema="x"), "no measurement of schema"),
        (lambda tree: tree.update(frame=None), "could not be measured"),
        (lambda tree: tree["poses"]["evaluated"]["wheels"].pop(0), "incomplete or was changed"),
        (
            lambda tree: tree["poses"]["evaluated"]["wheels"][0].update(normal=[1, 2]),
            "not three finite numbers",
        ),
        (lambda tree: tree["wheels"].clear(), "incomplete or was changed"),
    ],
)
def test_what_is_no_measurement_is_refused_in_one_line(tmp_path, change, fact):
    path = tmp_path / "measurement.json"
    tree = json.loads(to_json(measure_five_point(read_five_point(PAPER))))
    change(tree)
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError) as refused:
        read_measurement(path, "mine.json")
    assert str(refused.value).startswith("mine.json: ")
    assert fact in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda tree: tree["wheels"][0].update(toe_deg=5.0), "RR: toe_deg is 5, but -0.32798 by"),
        (lambda tree: tree["vehicle"].update(thrust_angle_deg=0.37), "vehicle: thrust_angle_deg"),
        (lambda tree: tree["uncertainty"][0].update(value=-0.33), "uncertainty of RR.toe: value"),
        (
            lambda tree: tree["poses"]["evaluated"]["wheels"][0].update(centre_m=[95.3, 97.9, 51]),
            "RR: toe_deg is -0.32798, but ",
        ),
    ],
)
def test_a_value_that_contradicts_the_poses_is_refused(tmp_path, change, fact):
    path = tmp_path / "measurement.json"
    tree = json.loads(to_json(measure_five_point(read_five_point(PAPER))))
    read_measurement(write_tree(path, tree), "mine.json")
    change(tree)
    with pytest.raises(InputError) as refused:
        read_measurement(write_tree(path, tree), "mine.json")
    message = str(refused.value)
    assert message.startswith("mine.json: ")
    assert fact in message
    assert message.endswith(" by its poses): measure that capture again")


def write_tree(path: Path, tree: dict) -> Path:
    path.write_text(json.dumps(tree))
    return path


def test_rear_trials_of_an_earlier_version_are_counted_anew(tmp_path):
    """Their toe was from the thrust line of the reference scans; nothing else may contradict."""
    measurement = measure_five_point(read_five_point(PAPER))
    tree = json.loads(to_json(measurement))
    known = {entry["quantity"]: entry for entry in tree["uncertainty"]}
    name = next(w["name"] for w in tree["wheels"] if (w["role"], w["wheel"]) == ("trial", "RR"))
    entry = known[f"{name}.toe_to_thrust_line"]
    entry["value"] = known[f"{name}.toe"]["value"] + known["thrust_angle"]["value"]
    path = write_tree(tmp_path / "measurement.json", tree)
    with pytest.raises(InputError, match=f"{name}.toe_to_thrust_line: value is"):
        read_measurement(path, "mine.json")
    tree["axes"]["thrust-line"]["definition"] = "thrust line, which bisects the rear wheels' toe"
    write_tree(path, tree)
    again, _ = read_measurement(path, "mine.json")
    expected = by_name(measurement)[f"{name}.toe_to_thrust_line"].value
    assert by_name(again)[f"{name}.toe_to_thrust_line"].value == pytest.approx(expected, abs=1e-12)
    assert f"{name}.toe_to_thrust_line" not in read_earlier(path).values
    assert f"{name}.toe" in read_earlier(path).values
