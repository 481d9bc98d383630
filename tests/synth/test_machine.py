"""Tests of the machine under test: planted errors, wrong declarations, its files and its truth."""

from __future__ import annotations

import csv
import json
import tomllib

import numpy as np
import pytest

from tests.support.made import DEFAULT, DISC, SALOON, changed
from tests.support.paths import CONFIGS
from wheelplane_synth.errors import SynthError
from wheelplane_synth.machine.forms import item_toml, readings_csv
from wheelplane_synth.machine.indicate import (
    error,
    indicate,
    reading,
    true_values,
    with_points,
)
from wheelplane_synth.machine.read import read_machine
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.machine import Indication

EXAMPLE = CONFIGS / "machines" / "example.toml"
TRUTH = {
    "wheels": [
        {"name": "RR", "role": "reference", "wheel": "RR", "toe_deg": 0.1, "camber_deg": -1.0},
        {"name": "RL", "role": "reference", "wheel": "RL", "toe_deg": 0.3, "camber_deg": 0.5},
        {"name": "swept", "role": "sweep", "wheel": "FL", "toe_deg": 9.0, "camber_deg": 0.0},
    ],
    "frame": {"front_track_m": 1.5, "rear_track_m": 1.6},
    "vehicle": {"rear_total_toe_deg": 0.4, "front_total_toe_deg": 0.0, "thrust_angle_deg": 0.1},
}


def test_true_values_are_in_minutes_and_millimetres_in_the_machine_s_sense():
    plain = Indication(positive="toe-in", resolution=0.1)
    known = true_values(TRUTH, plain, "toe")
    assert known == pytest.approx({"RR": 6.0, "RL": 18.0})
    out = Indication(positive="toe-out", resolution=0.1)
    assert true_values(TRUTH, out, "toe") == pytest.approx({"RR": -6.0, "RL": -18.0})
    thrust = Indication(positive="toe-in", axis="thrust-line", resolution=0.1)
    assert true_values(TRUTH, thrust, "toe") == pytest.approx({"RR": 12.0, "RL": 12.0})
    trials = [("1", "RL", 0.9), ("2", "FL", 0.9), ("3", "FR", 0.9)]
    more = [
        {"name": name, "role": "trial", "wheel": wheel, "toe_deg": toe, "camber_deg": 0.0}
        for name, wheel, toe in trials
    ]
    known = true_values(TRUTH | {"wheels": [*TRUTH["wheels"], *more]}, thrust, "toe")
    # In RL's place 0.9: the line bisects 0.1 and 0.9, and runs 0.4 to the right. FL, FR: 0.1.
    assert known == pytest.approx({"RR": 12.0, "RL": 12.0, "1": 30.0, "2": 48.0, "3": 60.0})
    assert true_values(TRUTH, plain, "track") == {"front": 1500.0, "rear": 1600.0}
    assert true_values(TRUTH, plain, "total_toe")["rear"] == pytest.approx(24.0)
    assert true_values(TRUTH, plain, "thrust_angle") == pytest.approx({"vehicle": 6.0})


def test_readings_have_the_planted_errors_and_are_whole_steps():
    table = Indication(
        positive="toe-in", zero=2.0, gain=0.1, hysteresis=3.0, repeatability=0.5, resolution=0.2
    )
    rng = np.random.default_rng(0)
    up, down = (
        np.array([reading(table, 10.0, w, rng) for _ in range(4000)]) for w in ("up", "down")
    )
    limit = 5.0 * 0.5 / np.sqrt(4000)
    assert up.mean() == pytest.approx(10.0 + error(table, 10.0) + 1.5, abs=limit)
    assert (up - down).mean() == pytest.approx(3.0, abs=limit * np.sqrt(2.0))
    assert up.std() == pytest.approx(np.hypot(0.5, 0.2 / np.sqrt(12.0)), rel=0.05)
    np.testing.assert_allclose(up / 0.2, np.round(up / 0.2), atol=1e-9)
    assert error(table, 10.0) == pytest.approx(3.0)


def test_every_point_is_read_by_the_protocol_and_the_files_say_so(tmp_path):
    values = {
        "protocol.series": 2,
        "protocol.operators": ["A", "B"],
        "toe.declared_axis": "thrust-line",
        "toe.declared_positive": "toe-out",
    }
    machine = read_machine(changed(EXAMPLE, tmp_path, values), 0)
    found = indicate(TRUTH, machine, np.random.default_rng(0))
    assert len(found) == (2 + 2 + 2 + 2) * 2 * 2 * 3 * 2
    keys = {(o.point, o.quantity, o.series, o.operator, o.repeat, o.direction) for o in found}
    assert len(keys) == len(found)
    rows = list(csv.DictReader(readings_csv(found).splitlines()))
    assert [float(row["value"]) for row in rows] == pytest.approx([one.value for one in found])
    item = tomllib.loads(item_toml(machine))
    assert item["item"]["toe"]["axis"] == "thrust-line"
    assert item["item"]["toe"]["positive"] == "toe-out"
    assert item["decision"]["rule"] == "guarded"


def test_a_nameplate_of_any_characters_is_declared_as_it_is(tmp_path):
    maker = 'Müller "X" C:\\new'
    machine = read_machine(changed(EXAMPLE, tmp_path, {"identity.maker": maker}), 0)
    assert tomllib.loads(item_toml(machine))["item"]["maker"] == maker


@pytest.mark.slow
def test_a_capture_has_the_machine_s_files_and_the_same_scans_as_without_it(tmp_path):
    files = {"vehicle": SALOON, "scanner": changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.02}),
             "target": DISC}  # fmt: skip
    for name, machine in (("with", EXAMPLE), ("again", EXAMPLE), ("without", None)):
        write_capture(tmp_path / name, seed=1, trials=1, machine=machine, **files)
    names = sorted(path.name for path in (tmp_path / "with").iterdir())
    assert {"item.toml", "readings.csv"} <= set(names)
    for name in names:
        content = (tmp_path / "with" / name).read_bytes()
        assert (tmp_path / "again" / name).read_bytes() == content
        if name.endswith(".ply"):
            assert (tmp_path / "without" / name).read_bytes() == content
    truth = json.loads((tmp_path / "with" / "truth.json").read_text())
    toe = truth["machine"]["quantities"]["toe"]
    assert toe["zero_deg"] == pytest.approx(1.0 / 60.0)
    wheel = truth["wheels"][0]
    point = toe["points"][wheel["name"]]
    assert point["value_deg"] == pytest.approx(wheel["toe_deg"])
    assert point["error_deg"] == pytest.approx(1.0 / 60.0 + 0.02 * wheel["toe_deg"])
    plain = json.loads((tmp_path / "without" / "truth.json").read_text())
    assert "machine" not in plain


SWEPT = TRUTH | {
    "kingpins": [{"wheel": "FR", "caster_deg": 5.0, "inclination_deg": 9.0},
                 {"wheel": "FL", "caster_deg": 5.5, "inclination_deg": 8.0}],
    "toe_out_on_turns": [{"turn": "left", "difference_deg": 2.0},
                         {"turn": "right", "difference_deg": 2.1}],
}  # fmt: skip


def test_caster_sai_and_toe_out_are_read_where_the_vehicle_is_swept():
    machine = read_machine(EXAMPLE, 0)
    assert true_values(SWEPT, machine.caster, "caster") == pytest.approx({"FR": 300.0, "FL": 330.0})
    assert true_values(SWEPT, machine.sai, "sai") == pytest.approx({"FR": 540.0, "FL": 480.0})
    turns = true_values(SWEPT, machine.toe_out_on_turns, "toe_out_on_turns")
    assert turns == pytest.approx({"left": 120.0, "right": 126.0})
    other = {"caster": "top-forwards", "sai": "top-out", "toe_out_on_turns": "toe-in"}
    for kind, sense in other.items():
        table = getattr(machine, kind)
        turned = table.model_copy(update={"positive": sense})
        known = true_values(SWEPT, table, kind)
        assert true_values(SWEPT, turned, kind) == {k: -v for k, v in known.items()}
    kinds = {one.quantity for one in indicate(SWEPT, machine, np.random.default_rng(0))}
    assert kinds == {"toe", "camber", "total_toe", "track", *other}
    assert set(with_points(SWEPT, machine).quantities()) == kinds
    assert set(with_points(TRUTH, machine).quantities()) == kinds - set(other)
    assert tomllib.loads(item_toml(machine))["item"]["toe_out_on_turns"]["inner_deg"] == 20.0


def test_a_wrong_machine_file_is_refused_in_one_line(tmp_path):
    with pytest.raises(SynthError, match=r"unknown key 'toe\.zeroes'"):
        read_machine(changed(EXAMPLE, tmp_path, {"toe.zeroes": 1.0}), 0)
