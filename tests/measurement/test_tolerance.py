"""Tolerance files: every quantity has its key, wrong keys name the right one, a model its file."""

from __future__ import annotations

import math
import re
import tomllib

import pytest

from wheelplane.config import config_folder
from wheelplane.errors import ConfigError, InputError
from wheelplane.measurement.quantities import VEHICLE_BY_SWEEP, WHEEL_BY_RUNOUT, WHEEL_BY_SWEEP
from wheelplane.measurement.tolerance.find import load_tolerance, tolerance_for
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.measurement.tolerance.values import ToleranceInterval
from wheelplane.vehicle import VEHICLE, WHEEL

LENGTHS = {"lateral_offset", "longitudinal_offset", "radial_runout"}
LENGTHS |= {entry.name for entry in VEHICLE if entry.unit == "m"}
TURNS = ("toe_out_left", "toe_out_right", "toe_out_difference")


def limits(name: str) -> dict:
    form = {"upper": "1 mm" if name in LENGTHS else "3'"}
    return form | ({"inner_deg": 17.5} if name in TURNS else {})


def written(tmp_path, text, name="mine.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_every_quantity_can_be_limited():
    of_wheel = [*(entry.name for entry in WHEEL), *WHEEL_BY_SWEEP, *WHEEL_BY_RUNOUT]
    of_vehicle = [*(entry.name for entry in VEHICLE), *VEHICLE_BY_SWEEP]
    made = Tolerance.model_validate(
        {
            "front": {name: limits(name) for name in of_wheel},
            "rear": {name: limits(name) for name in of_wheel if name not in WHEEL_BY_SWEEP},
            "vehicle": {name: limits(name) for name in of_vehicle},
        }
    )
    assert set(made.of_wheel("FL")) == set(of_wheel)
    assert set(made.of_wheel("RR")) == set(of_wheel) - set(WHEEL_BY_SWEEP)
    assert set(made.of_vehicle()) == set(of_vehicle)
    for name, interval in (made.of_wheel("FL") | made.of_vehicle()).items():
        upper = 1e-3 if name in LENGTHS else math.radians(0.05)
        assert interval.upper == pytest.approx(upper, rel=1e-14), name
    assert made.inner_rad("toe_out_difference") == pytest.approx(math.radians(17.5))


def test_kpi_is_sai():
    made = Tolerance.model_validate(
        {
            "front": {"sai": {"upper_deg": 13.0}},
            "FR": {"kpi": {"upper_deg": 12.0}},
            "vehicle": {"cross_kpi": {"upper_deg": 0.5}},
        }
    )
    assert made.of_wheel("FL") == {"sai": ToleranceInterval(-math.inf, math.radians(13.0))}
    assert made.of_wheel("FR") == {"sai": ToleranceInterval(-math.inf, math.radians(12.0))}
    assert set(made.of_vehicle()) == {"cross_sai"}


def test_toe_is_given_at_the_rim_of_the_file():
    made = Tolerance.model_validate(
        {
            "rim": "16in",
            "front": {"toe": {"lower": "-1 mm", "upper": "2 mm"}, "toe_to_thrust_line":
                      {"upper": "2 mm"}},
            "vehicle": {"front_total_toe": {"upper": "4 mm"}, "rear_cross_toe": {"upper": "4 mm"}},
        }
    )  # fmt: skip
    each = math.asin(0.002 / 0.4064)
    assert made.of_wheel("FR")["toe"].upper == pytest.approx(each, rel=1e-14)
    assert made.of_wheel("FR")["toe_to_thrust_line"].upper == pytest.approx(each, rel=1e-14)
    for interval in made.of_vehicle().values():
        assert interval.upper == pytest.approx(2.0 * each, rel=1e-14)


BAD = {
    "nearest": ("[front.casterr]\nlower_deg = 1", ["'front.casterr'", "did you mean 'caster'?"]),
    "nearest of the vehicle": (
        "[vehicle.cros_sai]\nlower_deg = 1",
        ["'vehicle.cros_sai'", "did you mean 'cross_sai'?"],
    ),
    "nearest limit": (
        "[front.sai]\nlower_deviaton = '1°'",
        ["'front.sai.lower_deviaton'", "did you mean 'lower_deviation'?"],
    ),
    "of the vehicle": (
        "[front.cross_camber]\nlower_deg = 1\n[front.thrust_angle]\nlower_deg = 1",
        ["front.thrust_angle", "[vehicle.thrust_angle]"],
    ),
    "of a wheel": ("[vehicle.caster]\nlower_deg = 1", ["vehicle.caster", "[front.caster]"]),
    "of nothing": ("[sai]\nlower_deg = 1", ["[sai]", "[front.sai]"]),
    "rear wheels": ("[RL.caster]\nlower_deg = 1", ["RL.caster", "[front.caster]"]),
    "rear kpi": ("[rear.kpi]\nlower_deg = 1", ["rear.kpi", "[front.kpi]"]),
    "twice": (
        "[front.sai]\nlower_deg = 1\n[front.kpi]\nlower_deg = 1",
        ["front: sai and kpi are one quantity"],
    ),
    "angle of a turn": (
        "[vehicle.toe_out_left]\nlower_deg = 1",
        ["'vehicle.toe_out_left.inner_deg' is missing"],
    ),
    "no rim": ("[front.toe]\nlower = '1 mm'", ["front.toe", "1 mm is at the rim", 'rim = "16in"']),
    "no toe": ("rim = '16in'\n[front.camber]\nlower = '1 mm'", ["front.camber", "only toe"]),
    "a large rim": ("rim = '3 m'\n[front.toe]\nlower = '1 mm'", ["rim = '3 m'", "16in"]),
    "no unit": ("rim = '16'\n[front.toe]\nlower = '1 mm'", ["rim = '16'", "16in"]),
    "no model": ("vehicle_model = ''\n[front.toe]\nlower_deg = 1", ["vehicle_model"]),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_wrong_key_is_named_with_what_to_write(kind, tmp_path):
    text, says = BAD[kind]
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as refused:
        load_tolerance(str(path))
    assert "\n" not in str(refused.value)
    for part in (f"{path}: ", *says):
        assert part in str(refused.value)


# --- by the vehicle model -------------------------------------------------------------------------

SMALL = "[front.toe]\nupper_deg = {}\n"


@pytest.fixture
def folder(tmp_path):
    for i, model in enumerate(("Saloon 1.6", "Estate", "Van")):
        written(tmp_path, f"vehicle_model = {model!r}\n{SMALL.format(i + 1)}", f"{i}.toml")
    written(tmp_path, SMALL.format(9), "of-no-model.toml")
    return tmp_path


@pytest.mark.parametrize("model", ["Estate", "ESTATE", " estate "])
def test_a_folder_gives_the_limits_of_the_capture_s_model(folder, model):
    found = tolerance_for(str(folder), model, "car")
    assert found.of_wheel("FR")["toe"].upper == pytest.approx(math.radians(2.0))


@pytest.mark.parametrize("model", ["saloon  1.6", "Saloon 1.6"])
def test_a_model_of_two_words_is_one_model(folder, model):
    found = tolerance_for(str(folder), model, "car")
    assert found.of_wheel("FR")["toe"].upper == pytest.approx(math.radians(1.0))


def test_auto_finds_the_shipped_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = tolerance_for("auto", "example saloon", "car")
    assert found == load_tolerance("example-saloon")
    assert "EXAMPLE, invented" in found.title
    assert {"caster", "sai"} <= set(found.of_wheel("FL"))
    text = (config_folder() / "tolerances" / "example-saloon.toml").read_text(encoding="utf-8")
    assert text.startswith("# AN EXAMPLE")
    (tmp_path / "example").mkdir()  # a shipped name goes before a folder
    assert tolerance_for("example", None, "car") == load_tolerance("example")


def test_the_tables_that_the_example_shows_as_comments_are_valid():
    text = (config_folder() / "tolerances" / "example.toml").read_text(encoding="utf-8")
    lines = [line.removeprefix("# ") for line in text.splitlines()
             if re.match(r"# (\[|(lower|upper|nominal|tolerance|inner_deg) =)", line)]  # fmt: skip
    shown = Tolerance.model_validate(tomllib.loads("\n".join(lines)))
    assert set(shown.of_wheel("FR")) == {"caster", "sai", "lateral_offset"}
    assert set(shown.of_wheel("RL")) == {"axial_runout", "radial_runout"}
    assert set(shown.of_vehicle()) == {"cross_caster", "toe_out_left"}


def test_what_finds_no_limits_names_those_that_there_are(folder):
    with pytest.raises(ConfigError) as refused:
        tolerance_for(str(folder), "Coupé", "car")
    for part in (str(folder), "'Estate', 'Saloon 1.6', 'Van'", "car is of", "'Coupé'"):
        assert part in str(refused.value)
    with pytest.raises(InputError, match=r"^car: it names no vehicle_model"):
        tolerance_for(str(folder), None, "car")
    written(folder, f"vehicle_model = 'van'\n{SMALL.format(4)}", "again.toml")
    with pytest.raises(ConfigError, match=r"2\.toml and again\.toml|again\.toml and 2\.toml"):
        tolerance_for(str(folder), "Van", "car")
    (folder / "empty").mkdir()
    with pytest.raises(ConfigError, match="it has the limits of no model"):
        tolerance_for(str(folder / "empty"), "Van", "car")


def test_a_file_of_another_model_is_refused_and_one_of_none_is_not(folder):
    with pytest.raises(InputError, match=r"of vehicle model 'Estate', but car is of model 'Van'"):
        tolerance_for(str(folder / "1.toml"), "Van", "car")
    for name, model in (("1.toml", "estate"), ("1.toml", None), ("of-no-model.toml", "Van")):
        assert tolerance_for(str(folder / name), model, "car") == load_tolerance(str(folder / name))
