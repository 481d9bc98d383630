"""Measurements that were saved are opened again, and five points read, as the program does."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

import wheelplane as wp
from tests.support.made import write_small_capture
from wheelplane.library.files import open_measurement, read_five_point
from wheelplane.measurement import assess, tolerance_of
from wheelplane.report.json.measurement import to_json
from wheelplane.report.json.stored import read_measurement


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    measured = wp.measure(write_small_capture(folder / "capture"))
    measured.save(folder / "results")
    return folder / "results", measured


def test_a_saved_measurement_is_opened_with_the_same_values(saved):
    folder, measured = saved
    for path in (folder, folder / "measurement.json", str(folder)):
        again = open_measurement(path)
        assert list(again) == list(measured)
        for name, value in measured.items():
            assert again[name].value == pytest.approx(value.value, rel=1e-9, abs=1e-12)
            assert again[name].u == pytest.approx(value.u, rel=1e-5)
        assert np.allclose(again.covariance.matrix, measured.covariance.matrix, rtol=1e-4)
        assert again.notes == measured.notes
        assert repr(again) == repr(measured)
    five_points = read_five_point(folder.parent / "capture" / "five-point.txt")
    assert wp.validate(again, five_points).verdict == wp.validate(measured, five_points).verdict


def test_an_opened_measurement_keeps_the_folder_that_it_is_from(saved, tmp_path, monkeypatch):
    """Noise and pictures, which only the points show, would be lost there."""
    folder, _ = saved
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert "target-RR.png" in before
    monkeypatch.chdir(folder.parent)
    again = pickle.loads(pickle.dumps(open_measurement(folder.name)))
    monkeypatch.chdir(folder)
    (tmp_path / "link").symlink_to(folder)
    for place in (".", folder, tmp_path / "link"):
        with pytest.raises(wp.InputError, match=r"measurement\.json: this measurement was"):
            again.save(place, language="pt")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    again.save(tmp_path / "pt", language="pt")
    again.save(tmp_path / "pt", language="en")
    assert open_measurement(tmp_path / "pt") == again


def test_limits_and_verdict_of_a_file_are_those_of_what_is_read_from_it(saved, tmp_path):
    folder, measured = saved
    read, _ = read_measurement(folder / "measurement.json", "measurement.json")
    limits = {"front": {"toe": {"lower_deg": -0.01, "upper_deg": 0.01}}}
    judged = assess(read, tolerance_of(limits, "limits"))
    (tmp_path / "measurement.json").write_text(to_json(read, judged), encoding="utf-8")
    again = open_measurement(tmp_path)
    again.save(tmp_path / "copy")
    trees = [json.loads(text) for text in (
        (tmp_path / "measurement.json").read_text(), again.json(),
        (tmp_path / "copy" / "measurement.json").read_text(),
    )]  # fmt: skip
    for key in ("verdict", "conformity"):
        assert trees[0][key] is not None
        assert trees[0][key] == trees[1][key] == trees[2][key]
    assert trees[1]["provenance"] == trees[0]["provenance"]
    for text in (again.text(), again.html(), (tmp_path / "copy" / "report.txt").read_text()):
        assert "nonconforming" in text
    assert json.loads(measured.json())["verdict"] is None


def test_an_edited_angle_is_refused_with_both_values(saved, tmp_path):
    folder, measured = saved
    tree = json.loads((folder / "measurement.json").read_text())
    tree["wheels"][0]["toe_deg"] = 5.0
    (tmp_path / "measurement.json").write_text(json.dumps(tree))
    own = f"{measured['RR.toe'].deg:.6g}"
    with pytest.raises(wp.InputError, match=f"RR: toe_deg is 5, but {own} by its poses") as caught:
        wp.open_measurement(tmp_path)
    assert str(caught.value).startswith(f"{tmp_path / 'measurement.json'}: ")


@pytest.mark.parametrize(
    ("given", "says"),
    [(3, "a int is no measurement.json"), ("nowhere", "nowhere: cannot be read")],
)
def test_what_is_no_saved_measurement_is_one_line(given, says):
    with pytest.raises(wp.InputError, match=says):
        wp.open_measurement(given)
