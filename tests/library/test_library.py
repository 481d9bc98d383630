"""The library: what goes in, what comes out, and that it is what the commands give."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import re
import subprocess
import sys
import typing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import wheelplane as wp
from tests.support.made import write_small_capture
from tests.support.paths import FIGURE_4
from wheelplane.capture import open_capture
from wheelplane.cli import main
from wheelplane.config import load_config
from wheelplane.library.alignment import Alignment, Covariance
from wheelplane.library.comparison import validate
from wheelplane.library.measure_vehicle import measure
from wheelplane.library.reporting import report_options
from wheelplane.library.scans import as_config, as_scan, as_target, is_path
from wheelplane.library.single_scan import find_planes, find_target, fit_plane
from wheelplane.library.value import Value
from wheelplane.measurement import Vertical
from wheelplane.readers import read_scan

WHEELS = ("RR", "RL", "FR", "FL")
DISC = {"shape": "disc", "diameter": 0.25}  # as the capture states it
PUBLIC = {
    "Alignment", "Comparison", "ConfigError", "Covariance", "FivePointFile", "FoundTarget",
    "InputError", "MissingDependencyError", "NotMeasuredError", "Plane", "Value", "Wheel",
    "WheelplaneError", "find_planes", "find_target", "fit_plane", "measure", "open_measurement",
    "read_five_point", "validate",
}  # fmt: skip


@pytest.fixture(scope="module")
def capture(tmp_path_factory) -> Path:
    return write_small_capture(tmp_path_factory.mktemp("library") / "capture")


@pytest.fixture(scope="module")
def clouds(capture) -> dict[str, np.ndarray]:
    """Points with intensities, by wheel."""
    found = {}
    for wheel in WHEELS:
        scan = read_scan(capture / f"{wheel.lower()}.ply")
        found[wheel] = np.column_stack([scan.points_m, scan.intensity])
    return found


@pytest.fixture(scope="module")
def measured(capture) -> wp.Alignment:
    return wp.measure(str(capture))


def values(alignment: wp.Alignment) -> dict[str, tuple[float, float]]:
    return {name: (one.value, one.u) for name, one in alignment.items()}


def test_what_is_public_is_listed_and_there():
    assert set(wp.__all__) == PUBLIC
    assert set(dir(wp)) >= PUBLIC
    assert all(getattr(wp, name).__doc__ for name in PUBLIC)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = wp.nothing
    assert wp.measure is measure
    assert (wp.validate, wp.find_target, wp.find_planes) == (validate, find_target, find_planes)
    for function in (wp.measure, wp.validate, wp.fit_plane, wp.find_target, wp.find_planes):
        hints = typing.get_type_hints(function)
        assert "return" in hints


def test_the_function_stands_before_the_module_of_its_name():
    code = (
        "from wheelplane.measure import measure_capture\n"
        "import wheelplane as wp, wheelplane.measure, sys\n"
        "assert wp.measure.__module__ == 'wheelplane.library.measure_vehicle'\n"
        "assert sys.modules['wheelplane.measure'].measure_capture is measure_capture\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_importing_loads_nothing_heavy():
    code = "import wheelplane, sys; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = {name.split(".")[0] for name in run.stdout.split()}
    assert not loaded & {"numpy", "pydantic", "click", "email"}


def test_a_capture_gives_what_the_command_gives(capture, measured, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["wheelplane", "measure", str(capture), "--json"])
    with pytest.raises(SystemExit):
        main()
    assert measured.json() == capsys.readouterr().out
    tree = json.loads(measured.json())
    for wheel in tree["wheels"]:
        own = measured.wheels[wheel["name"]]
        assert (own.toe.deg, own.camber.deg) == (wheel["toe_deg"], wheel["camber_deg"])
        assert own.toe.u_deg == pytest.approx(wheel["u_toe_deg"], rel=1e-12)
        assert own.status == wheel["status"] == "ok"
    assert measured.vehicle["wheelbase"].mm == pytest.approx(1e3 * tree["frame"]["wheelbase_m"])


FORMS = ["array", "rows last", "list", "open3d", "paths", "mm", "masked", "frames"]


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_the_same_points_gives_the_same(form, capture, clouds, measured):
    """Bit for bit; in mm, to what dividing by 1000 costs."""
    given = dict(clouds)
    if form == "rows last":
        given = {wheel: np.asfortranarray(cloud) for wheel, cloud in clouds.items()}
    elif form == "list":
        given["FL"] = clouds["FL"].tolist()
    elif form == "open3d":
        given["FL"] = SimpleNamespace(points=clouds["FL"])
    elif form == "paths":
        given = {wheel: capture / f"{wheel.lower()}.ply" for wheel in WHEELS}
    elif form == "mm":
        given = {wheel: cloud * [1e3, 1e3, 1e3, 1.0] for wheel, cloud in clouds.items()}
    elif form == "masked":
        rows = np.insert(clouds["FL"], 5, 9.0, axis=0)
        mask = np.zeros(rows.shape, dtype=bool)
        mask[5] = True
        given["FL"] = np.ma.MaskedArray(rows, mask)
    elif form == "frames":
        given = {w: pd.DataFrame(a[:, ::-1], columns=list("izyx")) for w, a in clouds.items()}
    before = {wheel: np.array(cloud, copy=True) for wheel, cloud in clouds.items()}
    found = wp.measure(given, DISC, length_unit="mm" if form == "mm" else "m")
    for wheel in WHEELS:
        assert np.array_equal(before[wheel], clouds[wheel])
        own, known = found.wheels[wheel].toe, measured.wheels[wheel].toe
        assert own.value == pytest.approx(known.value, abs=1e-9 if form == "mm" else 0.0)
        assert own.u == pytest.approx(known.u, rel=1e-6 if form == "mm" else 0.0)


def test_trials_are_what_is_no_reference_wheel(capture, clouds, measured):
    given = clouds | {"1": capture / "trial-1.ply"}
    found = wp.measure(given, DISC, vehicle="mine")
    assert values(found) == values(measured)
    assert repr(found).startswith("<Alignment of mine: RR, RL, FR, FL, 1; ")
    given["2"] = np.random.default_rng(0).uniform(size=(5000, 3))
    broken = wp.measure(given, target="disc-250")
    assert not broken.complete
    assert broken.wheels["2"].status != "ok"
    with pytest.raises(wp.NotMeasuredError, match="2: ") as caught:
        _ = broken.wheels["2"].toe
    assert caught.value.status == broken.wheels["2"].status
    assert "2: " in repr(broken.wheels["2"])


def test_a_trial_has_no_values_of_one_whose_name_goes_on_after_a_dot(clouds):
    trials = {"1": clouds["RR"], "1.5": clouds["RL"]}
    found = wp.measure(clouds | trials, target=DISC).wheels
    assert list(found["1"]._values) == list(found["1.5"]._values) == list(found["FL"]._values)
    with pytest.raises(KeyError, match=r"1 has no '5\.toe'"):
        _ = found["1"]["5.toe"]


def test_covariance_and_values_are_those_of_the_measurement(measured):
    covariance = measured.covariance
    assert isinstance(covariance, Covariance)
    total = covariance["RL.toe", "RL.toe"] + covariance["RR.toe", "RR.toe"]
    total += 2.0 * covariance["RL.toe", "RR.toe"]
    assert measured["rear_total_toe"].u ** 2 == pytest.approx(total, rel=1e-9)
    assert set(covariance.names) <= set(measured)
    with pytest.raises(KeyError, match="no 'toe'"):
        _ = covariance["toe", "RR.toe"]
    with pytest.raises(KeyError, match="no 'toe'"):
        _ = measured["toe"]
    with pytest.raises(KeyError, match="FL has no 'caster'"):
        _ = measured.wheels["FL"]["caster"]
    toe = measured.wheels["FL"].toe
    assert toe.U_deg == pytest.approx(toe.k * toe.u_deg)
    assert toe is measured["FL.toe"]
    with pytest.raises(TypeError, match="is an angle: use deg"):
        _ = toe.mm
    with pytest.raises(TypeError, match="is a length: use mm"):
        _ = measured["wheelbase"].deg


def test_reprs_are_short_and_digits_follow_the_uncertainty(measured, capture):
    assert repr(
        Value("a", "rad", np.radians(0.123456), np.radians(0.001), np.radians(0.00196))
    ) == ("a = (+0.1235 ± 0.0020) °, k = 1.96")
    comparison = wp.validate(measured, capture / "five-point.txt")
    for one in (
        comparison,
        measured,
        measured.covariance,
        measured.wheels["FL"],
        measured["FL.toe"],
    ):
        assert len(repr(one)) < 120
        assert "\n" not in repr(one)


def test_reports_are_those_of_the_command(measured, tmp_path, monkeypatch):
    names = {path.name for path in measured.save(tmp_path / "out")}
    assert {"measurement.json", "report.txt", "report.html"} <= names
    assert (tmp_path / "out" / "report.html").read_text() == measured.html()
    assert (tmp_path / "out" / "report.txt").read_text() == measured.text()
    assert (tmp_path / "out" / "measurement.json").read_text() == measured.json()
    assert measured._repr_html_().startswith("<pre>")
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    measured.show()
    [page] = opened
    assert Path(page.removeprefix("file://")).read_text() == measured.html()


def test_a_notebook_shows_the_report_in_a_frame(measured, monkeypatch):
    shown: list[str] = []
    display = SimpleNamespace(display=shown.append, HTML=str)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=object))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    measured.show()
    [frame] = shown
    assert frame.startswith('<iframe srcdoc="&lt;!')
    assert frame.count('"') == 4  # the report's own are escaped


def test_tables_are_of_pandas(measured, monkeypatch):
    table = measured.table()
    assert list(table.index) == list(measured)
    row = table.loc["FL.toe"]
    assert (row["value"], row["unit"]) == (measured["FL.toe"].deg, "°")
    assert row["U"] == pytest.approx(row["k"] * row["u"])
    shared = measured.covariance.table()
    assert list(shared.index) == list(shared.columns) == list(measured.covariance.names)
    assert shared.loc["FL.toe", "FR.toe"] == measured.covariance["FL.toe", "FR.toe"]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(wp.MissingDependencyError, match=re.escape("wheelplane[pandas]")):
        measured.table()


def test_one_scan_gives_its_target_as_the_measurement_has_it(clouds, measured):
    found = wp.find_target(clouds["FL"], DISC)
    wheel = measured.wheels["FL"]
    assert np.array_equal(found.centre_m, wheel.centre_m)
    assert abs(found.normal @ wheel.normal) == pytest.approx(1.0, abs=1e-15)
    assert found.normal @ (np.median(clouds["FL"][:, :3], axis=0)) < 0.0  # the scanner at 0 0 0
    assert found.covariance.shape == (6, 6)
    assert len(repr(found)) < 200
    with pytest.raises(wp.NotMeasuredError) as caught:
        wp.find_target(np.random.default_rng(0).uniform(size=(5000, 3)), "disc-250")
    assert caught.value.status


def test_planes_of_arrays():
    rng = np.random.default_rng(1)
    square = np.column_stack([rng.uniform(size=(4000, 2)), rng.normal(0.0, 1e-4, 4000)])
    plane = fit_plane(square)
    assert abs(plane.normal[2]) == pytest.approx(1.0, abs=1e-6)
    assert plane.rms_m == pytest.approx(1e-4, rel=0.05)
    [found] = wp.find_planes(square)
    assert found.points > 0.98 * len(square)
    assert "4000 points" in repr(plane)
    assert fit_plane(square.astype(np.float32)[::-1]).points == len(square)
    assert fit_plane(1e3 * square, length_unit="mm").rms_m == pytest.approx(plane.rms_m)


def test_five_points_agree_and_are_measured_too(capture, measured):
    file = wp.read_five_point(capture / "five-point.txt")
    comparison = wp.validate(measured, file)
    assert isinstance(comparison, wp.Comparison)
    assert comparison.verdict == wp.validate(measured, str(capture / "five-point.txt")).verdict
    assert comparison.names == tuple(measured.wheels)
    own = wp.measure(file)
    assert isinstance(own, Alignment)
    assert own["FL.toe"].value != measured["FL.toe"].value
    with pytest.raises(wp.InputError, match="no alignment"):
        wp.validate(file, file)
    with pytest.raises(wp.InputError, match="no five-point file"):
        wp.validate(measured, 3)


@pytest.mark.parametrize(
    ("scans", "more", "says"),
    [
        ({"RR": np.zeros((3, 3))}, {}, "lack RL, FR, FL"),
        (dict.fromkeys(WHEELS, np.zeros((3, 3))), {"target": None}, "no target is named"),
        (dict.fromkeys(WHEELS, np.zeros((3, 3))), {"target": "nothing"}, "nothing"),
        (3, {}, "a int is no set of scans"),
        ("nowhere", {}, "no such file or folder"),
        (dict.fromkeys(WHEELS, np.ones((3, 3))), {"length_unit": "km"}, "'km' is unknown"),
        (dict.fromkeys(WHEELS, np.ones((3, 3))), {"scanner": "nothing"}, "nothing"),
    ],
)
def test_what_cannot_be_measured_is_one_clear_line(scans, more, says):
    with pytest.raises(wp.WheelplaneError, match=says) as caught:
        wp.measure(scans, **({"target": "disc-250"} | more))
    assert "\n" not in str(caught.value)


POINTS = np.random.default_rng(0).random((100, 3))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: wp.read_five_point(3), "^a int is no five-point file: give its path$"),
        (lambda: wp.read_five_point(POINTS), "^a ndarray is no five-point file: give its path$"),
        (lambda: wp.find_target(POINTS, "disc-250", config=3), "^a int is no configuration: "),
        (lambda: wp.find_target(POINTS, "disc-250", scanner=3), "^scanner 3 is no scanner: "),
        (lambda: wp.find_planes(POINTS, "a"), "^max_planes 'a' is no whole number: "),
        (lambda: wp.find_planes(POINTS, -1), "^max_planes -1 is no whole number: "),
        (lambda: wp.find_planes(POINTS, seed=0.5), "^seed 0.5 is no whole number: "),
        (lambda: wp.fit_plane(POINTS[:, :2]), r"^points: an array of the shape \(100, 2\) is no"),
    ],
)
def test_an_argument_of_another_kind_is_one_clear_line(call, says):
    with pytest.raises(wp.InputError, match=says):
        call()


def test_five_points_are_not_compared_with_themselves():
    """They would agree as dense scans do, whatever is wrong with them."""
    file = wp.read_five_point(FIGURE_4)
    with pytest.raises(wp.InputError, match=r"figure-4\.txt: is of five points .* of scans"):
        wp.validate(wp.measure(file), file)


def test_numbers_of_numpy_are_whole_numbers():
    scan = POINTS * [1.0, 1.0, 1e-3]
    found = wp.find_planes(scan, np.int64(1), seed=np.uint8(2))
    assert [one.points for one in found] == [one.points for one in wp.find_planes(scan, 1, seed=2)]


def test_what_is_given_is_read_as_it_is(tmp_path):
    assert is_path("a.ply")
    assert is_path(Path("a.ply"))
    assert not is_path(np.zeros(3))
    scan = as_scan(np.eye(3) + 1.0, "m", "here")
    assert as_scan(scan, "m", "here") is scan
    target = as_target("disc-250")
    assert as_target(target) is target
    settings = as_config(None, None)
    assert as_config(settings, None) is settings
    path = tmp_path / "own.toml"
    path.write_text("seed = 7\n")
    assert as_config(path, None).seed == 7
    assert as_config(str(path), "default").seed == 7


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"length_unit": "km"}, "length_unit 'km' is unknown: give m, mm, in, cm, ft"),
        ({"vertical": "x"}, "vertical 'x' is unknown: give wheels, floor, gravity"),
        ({"target": 5}, "target 5 is no target"),
    ],
)
def test_an_option_that_is_none_is_named(options, words):
    points = np.random.default_rng(0).random((100, 3))
    known = {"target": "disc-250"} | options
    with pytest.raises(wp.InputError, match=words):
        wp.measure(dict.fromkeys(("RR", "RL", "FR", "FL"), points), **known)


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ({"target": "disc-250"}, "target has no effect on five points: leave it out"),
        ({"length_unit": "mm"}, "length_unit has no effect .*: give it to read_five_point"),
        ({"length_unit": "m"}, "length_unit has no effect on five points"),
        ({"scanner": "default"}, "scanner has no effect on five points"),
        ({"config": load_config(None)}, "config has no effect on five points"),
        ({"vertical": "floor"}, "vertical has .*: they show neither floor nor gravity"),
        ({"vehicle": "own"}, "vehicle has no effect on five points"),
    ],
)
def test_an_argument_without_effect_on_five_points_is_refused(capture, argument, says):
    file = wp.read_five_point(capture / "five-point.txt")
    with pytest.raises(wp.InputError, match=says):
        wp.measure(file, **argument)


def test_an_argument_without_effect_on_a_capture_is_refused(capture):
    with pytest.raises(wp.InputError, match="vehicle has no effect on a capture: state vehicle in"):
        wp.measure(capture, vehicle="own")
    with open_capture(capture) as opened:
        for argument in ({"vehicle": "own"}, {"target": "disc-250"}, {"length_unit": "m"}):
            name = next(iter(argument))
            with pytest.raises(wp.InputError, match=f"{name} has no effect on an open capture: "):
                wp.measure(opened, **argument)


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ((7, "7"), "two scans have the name '7': give each trial its own"),
        (("7", 7), "two scans have the name '7'"),
        (("",), "the trial '' has no name: give one"),
        ((" ",), "the trial ' ' has no name"),
        (("vehicle",), "a trial is called 'vehicle', as the vehicle's own: rename it"),
    ],
)
def test_every_trial_has_a_name_of_its_own(names, says):
    points = np.random.default_rng(0).random((100, 3))
    with pytest.raises(wp.InputError, match=says):
        wp.measure(dict.fromkeys((*WHEELS, *names), points), "disc-250")


def pickled(found):
    return pickle.loads(pickle.dumps(found))


@pytest.mark.parametrize("copied", [pickled, copy.deepcopy, copy.copy])
def test_results_are_copied_and_pickled_as_they_are(copied, clouds, measured, capture):
    assert values(measured)  # of a result whose values were read before
    again = copied(measured)
    assert again == measured
    assert hash(again) == hash(measured)
    assert again.json() == measured.json()
    assert again.text() == measured.text()
    plane = fit_plane(clouds["FL"])
    results = (
        *(measured.vehicle, measured.wheels, measured.wheels["FL"], measured["FL.toe"]),
        *(measured.covariance, plane, wp.find_target(clouds["FL"], DISC)),
    )
    for one in results:
        assert copied(one) == one
    comparison = wp.validate(measured, capture / "five-point.txt")
    assert np.array_equal(copied(comparison).en, comparison.en)


def test_results_of_other_values_are_not_equal(capture, measured):
    assert wp.measure(capture) == measured
    assert wp.measure(wp.read_five_point(capture / "five-point.txt")) != measured
    assert measured != dict.fromkeys(measured)
    assert measured.wheels["FL"] != measured.wheels["RL"]
    plane = fit_plane(np.eye(3))
    assert plane != dataclasses.replace(plane, normal=-plane.normal)
    assert plane != dataclasses.replace(plane, points=4)
    assert plane != measured.wheels["FL"]


def test_results_by_name_cannot_be_changed(measured):
    for held in (measured.wheels, measured.vehicle):
        with pytest.raises(TypeError, match="does not support item assignment"):
            held["FL"] = None


def printed_by(monkeypatch, capsys, *words: object) -> str:
    monkeypatch.setattr(sys, "argv", ["wheelplane", *map(str, words)])
    with pytest.raises(SystemExit):
        main()
    return capsys.readouterr().out


@pytest.mark.parametrize(
    "look",
    [
        {"angles": "deg"},
        {"axis": "thrust-line", "angles": "mm/m"},
        {"convention": "iso-8855"},
        {"convention": "german-workshop", "axis": "rear-axle"},
        {"angles": "mm", "rim": "16in"},
    ],
)
def test_reports_are_those_of_the_command_with_the_same_options(
    look, capture, measured, tmp_path, monkeypatch, capsys
):
    options = [word for name, value in look.items() for word in (f"--{name}", value)]
    own, of_command = tmp_path / "own", tmp_path / "command"
    printed_by(monkeypatch, capsys, "measure", capture, "-o", of_command, *options)
    measured.save(own, **look)
    for name in ("report.txt", "report.html", "measurement.json"):
        assert (own / name).read_text() == (of_command / name).read_text(), name
    assert measured.text(**look) == (own / "report.txt").read_text() != measured.text()
    assert measured.html(**look) == (own / "report.html").read_text() != measured.html()


@pytest.mark.parametrize(
    ("look", "says"),
    [
        ({"axis": "x"}, "axis 'x' is unknown: give rear-axle, centreline, thrust-line, side-b"),
        ({"angles": "x"}, "angles 'x' is unknown: give dms, deg, mm/m, mm"),
        ({"convention": "x"}, "convention 'x' is unknown: give default, iso-8855, german-workshop"),
        ({"language": "x"}, "language 'x': known are en, pt"),
        ({"angles": "mm"}, "rim's diameter"),
    ],
)
def test_choices_of_a_report_are_listed(look, says):
    with pytest.raises(wp.InputError, match=says):
        report_options(**look)


def test_reports_name_the_vertical_of_camber(measured):
    """Camber from gravity is not to be read as camber from the wheel centres."""
    assert report_options("gravity").view.vertical == "gravity"
    vertical = Vertical("gravity", np.array([0.0, 0.0, 1.0]), (), "")
    found = Alignment(dataclasses.replace(measured.measurement, vertical=vertical))
    for made in (found.text, found.html, found._repr_html_):
        assert "gravity" in made()
    assert "from gravity" not in measured.text()


def test_a_comparison_gives_what_the_command_writes(
    capture, measured, tmp_path, monkeypatch, capsys
):
    file, of_command = capture / "five-point.txt", tmp_path / "command"
    words = ("validate", capture, "--five-point", file, "--json")
    comparison = wp.validate(measured, file)
    assert json.loads(comparison.json()) == json.loads(printed_by(monkeypatch, capsys, *words))
    printed_by(monkeypatch, capsys, *words[:-1], "-o", of_command)
    names = {path.name for path in comparison.save(tmp_path / "own")}
    assert names == {path.name for path in of_command.iterdir()}
    for name in names:
        assert (tmp_path / "own" / name).read_text() == (of_command / name).read_text(), name
    assert (of_command / "validation.txt").read_text() == comparison.text()
    assert (of_command / "validation.html").read_text() == comparison.html()
    assert comparison.html("pt") != comparison.html()


def test_a_value_as_a_number_is_in_rad_or_m_and_as_text_has_its_unit(measured):
    for name, shown in (("FL.toe", "deg"), ("wheelbase", "mm")):
        value = measured[name]
        assert float(value) == value.value
        unit = {"deg": "°", "mm": "mm"}[shown]
        assert f"{value:+.3f}" == f"{getattr(value, shown):+.3f} {unit}"
        assert f"{value}" == str(value) == repr(value)
    with pytest.raises(ValueError, match="format"):
        f"{measured['FL.toe']:nonsense}"
