"""`wheelplane validate`: from files to verdicts, exit codes and reports."""

from __future__ import annotations

import json
import re
import shutil
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.support.scenes import rotation
from tests.support.validation_cars import TM30, Car, write_capture
from wheelplane.capture.open_capture import open_capture
from wheelplane.cli import cli
from wheelplane.config import Config
from wheelplane.errors import ConfigError, Doubt, InputError, WheelplaneError
from wheelplane.five_point.file import FivePointFile, read_five_point
from wheelplane.measurement import Evidence, Observation, Provenance, align
from wheelplane.report.format.language import load_translations
from wheelplane.report.json.measurement import to_json
from wheelplane.report.json.stored import read_measurement
from wheelplane.report.plots.validation import ticks
from wheelplane.report.tables.study import verdict_lines
from wheelplane.report.text.validation import validation_text
from wheelplane.targets.plates import DiscTarget
from wheelplane.validation import study
from wheelplane.validation.five_point import (
    FivePointOptions,
    match_blocks,
    pentagon_scatter_m,
    points_of,
)
from wheelplane.validation.request import Request
from wheelplane.validation.study import (
    EACH,
    ComparisonStudy,
    Row,
    is_archive_of_captures,
    validate_archive,
)
from wheelplane.validation.truth import read_truth
from wheelplane.validation.validate_capture import compare_with_points, validate_capture
from wheelplane.web.content.comparing import compare_measurements

FILE = Path("five-point.txt")
FINE = TM30.model_copy(update={"range_sigma_m": 5e-5, "aiming_sigma_m": 0.0})
SCANS = ["RR", "RL", "FR", "FL", "1", "2"]


def run(*arguments):
    done = CliRunner().invoke(cli, [str(a) for a in arguments], standalone_mode=False)
    if done.exception is not None and not isinstance(done.exception, WheelplaneError):
        raise done.exception
    return done


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A capture of four wheels and a trial, five-point.txt by a good station, the truth."""
    folder = tmp_path_factory.mktemp("made") / "capture"
    car, place = write_capture(folder, 3, FINE)
    return folder, car, place


def compared(folder, *, blocks=None, file=FILE, **options):
    request = Request("five-point", file, FivePointOptions(blocks=blocks, **options))
    with open_capture(folder) as capture:
        return validate_capture(capture, Config(), request)


@pytest.fixture(scope="module")
def found(made):
    return compared(made[0])


def test_differences_are_those_of_the_errors(made, found):
    folder, car, _ = made
    with open_capture(folder) as capture:
        dense = validate_capture(capture, Config(), Request("truth"))
        five = validate_capture(capture, Config(), Request("truth", FILE))
    np.testing.assert_allclose(
        found.difference_rad, dense.difference_rad - five.difference_rad, atol=1e-12
    )
    assert found.names == ("RR", "RL", "FR", "FL", "1")
    assert found.wheels == ("RR", "RL", "FR", "FL", "RR")
    np.testing.assert_allclose(found.spread.u**2, found.u_first**2 + found.u_second**2, rtol=1e-9)
    for one in (dense, five, found):  # all are right
        assert one.joint.probability > 1e-3
        assert one.joint.count == 10
    assert not np.any(dense.u_second)
    np.testing.assert_allclose(dense.second.angles_rad[:4], [w.toe_rad for w in car.drawn[:4]])


def test_five_points_in_any_coordinates_and_unit(made, found, tmp_path):
    folder, *_ = made
    capture = shutil.copytree(folder, tmp_path / "capture")
    rows = np.loadtxt(folder / FILE, delimiter=",")
    moved = (rows - rows.mean(axis=0)) @ rotation(np.random.default_rng(0)).T + [9.0, -4.0, 2.0]
    np.savetxt(capture / FILE, moved * 1000.0, delimiter=",", fmt="%.6f")
    other = compared(capture, length_unit="mm")
    assert other.joint.probability == pytest.approx(found.joint.probability, abs=1e-3)
    # the file in metres keeps six decimals: 0.3 um on 88 mm
    np.testing.assert_allclose(other.difference_rad, found.difference_rad, atol=2e-5)
    with pytest.raises(InputError, match=r"apart in m, .* give --length-unit mm"):
        compared(capture)


def test_blocks_go_by_order_or_by_name(made, found, tmp_path):
    folder, *_ = made
    capture = shutil.copytree(folder, tmp_path / "capture")
    blocks = np.loadtxt(folder / FILE, delimiter=",").reshape(-1, 5, 3)
    stray = blocks[:1] + 50.0
    order = np.concatenate([blocks[[4, 2, 3]], stray, blocks[[1, 0]]])
    np.savetxt(capture / FILE, order.reshape(-1, 3), delimiter=",", fmt="%.6f")
    other = compared(capture, blocks="1, FR,FL,-,RL,RR")
    np.testing.assert_allclose(other.difference_rad, found.difference_rad, atol=1e-12)
    with pytest.raises(InputError, match=r"holds 6 blocks.*5 scans \(RR,RL,FR,FL,1\)"):
        compared(capture)
    far = compared(capture, blocks="-,FR,FL,1,RL,RR")
    assert far.missing[0][0] == "1"
    assert "name its wheel" in far.missing[0][1]
    lost = compared(capture, blocks="-,FR,FL,-,RL,RR")
    assert lost.missing == (("1", "no block of five points is named for it"),)
    assert lost.names == ("RR", "RL", "FR", "FL")
    order[1] = order[1, 0]
    np.savetxt(capture / FILE, order.reshape(-1, 3), delimiter=",", fmt="%.6f")
    with pytest.raises(InputError, match="lines 6-10: block 2"):
        compared(capture, blocks="1,FR,FL,-,RL,RR")


@pytest.mark.parametrize(("line", "name", "rows"), [(2, "RR", 10), (23, "1", 8)])
def test_a_wrong_digit_is_named_and_does_not_disagree(made, found, tmp_path, line, name, rows):
    """A reference wheel is compared by its other four points; a trial is not compared."""
    folder, *_ = made
    capture = shutil.copytree(folder, tmp_path / "capture")
    points = np.loadtxt(folder / FILE, delimiter=",")
    points[line - 1, 2] += 0.04
    np.savetxt(capture / FILE, points, delimiter=",", fmt="%.6f")
    done = run("validate", capture, "--five-point", capture / FILE, "--json")
    tree = json.loads(done.stdout)
    assert done.return_value == 1
    (missing,) = tree["missing"]
    assert missing["name"] == name
    assert "block-not-" in missing["reason"]
    assert f"line {line}: point " in missing["reason"]
    assert ("row below" in missing["reason"]) == (name == "RR")
    assert len(tree["angles"]) == rows
    assert tree["verdict"] == "agree"
    assert tree["joint"]["probability"] > 1e-3
    others = [a for a in tree["angles"] if a["name"] == "RL"]
    plain = np.degrees(found.difference_rad[[1, 6]])
    for angle, before in zip(others, plain, strict=True):
        assert angle["difference_deg"] == pytest.approx(before, abs=3 * angle["u_deg"])
    against_truth = run("validate", capture, "--five-point", capture / FILE, "--truth", "--json")
    assert json.loads(against_truth.stdout)["missing"][0]["name"] == name
    assert against_truth.return_value == 1


def test_the_radius_of_five_points_is_stated(made):
    folder, *_ = made
    fine = run("validate", folder, "--five-point", folder / FILE, "--radius", 88, "--json")
    assert json.loads(fine.stdout)["missing"] == []
    with pytest.raises(InputError, match=r"five-point.txt: .* circles of 88 mm"):
        compared(folder, radius_m=0.12)


@pytest.mark.parametrize(
    ("count", "mapping", "said"),
    [
        (5, None, "five.txt holds 5 blocks, the capture 6 scans"),
        (7, None, "name the scan of each block with --blocks"),
        (6, "RR,RL,FR,FL,1", "--blocks names 5, but five.txt holds 6"),
        (6, "RR,RL,FR,FL,1,3", "names '3' for block 6"),
        (6, "RR,RL,FR,FL,1,1", "names '1' twice"),
        (6, "RR,RL,FR,-,1,2", "lacks FL"),
    ],
)
def test_blocks_that_do_not_fit_are_refused(count, mapping, said):
    with pytest.raises(InputError, match=said) as error:
        match_blocks(SCANS, count, mapping, "five.txt")
    assert "\n" not in str(error.value)


def test_blocks_that_fit_are_matched():
    assert match_blocks(SCANS, 6, None, "") == {name: i for i, name in enumerate(SCANS)}
    mapped = match_blocks(SCANS, 7, "2,RL,RR,-,FL,FR,1", "")
    assert list(mapped.items()) == [("RR", 2), ("RL", 1), ("FR", 5), ("FL", 4), ("1", 6), ("2", 0)]


def test_a_trial_at_another_wheel_is_refused(made, tmp_path):
    folder, *_ = made
    capture = shutil.copytree(folder, tmp_path / "capture")
    blocks = np.loadtxt(folder / FILE, delimiter=",").reshape(-1, 5, 3)
    blocks[4] = blocks[1] + 1e-3
    np.savetxt(capture / FILE, blocks.reshape(-1, 3), delimiter=",", fmt="%.6f")
    with pytest.raises(InputError, match="scan 1 is at RL, the scan at RR"):
        compared(capture)


def test_aiming_is_asked_for_and_counts(made):
    folder, *_ = made
    shown = compared(folder, aiming_m=0.002)
    silent = compared(folder)
    assert any("--aiming" in note for note in silent.notes)
    assert not any("--aiming" in note for note in shown.notes)
    # 2 mm a point, 0.9 mm the mean, on both centres of an axle 1.5 m apart
    extra = shown.u_second[0] ** 2 - silent.u_second[0] ** 2
    assert np.sqrt(extra) == pytest.approx(np.sqrt(2 / 5) * 0.002 / 1.5, rel=0.05)
    assert shown.shape_spread.u[4] > 3 * silent.shape_spread.u[4]


def test_angles_that_agree_over_centres_that_contradict_are_no_agreement(found, monkeypatch):
    assert found.verdict == "agree"
    assert "contradict each other" not in validation_text(found)
    bent = found.shape + 8.0 * found.shape_spread.u
    monkeypatch.setitem(found.__dict__, "shape", bent)
    monkeypatch.delitem(found.__dict__, "shape_test")
    assert found.joint.agrees
    assert found.verdict == "cannot tell"
    assert "centres contradict each other" in validation_text(found)


def test_scatter_about_regular_pentagons_is_what_they_were_aimed_with():
    blocks = [Car(seed).blocks(TM30)[0] for seed in range(40)]
    seen = pentagon_scatter_m(np.concatenate(blocks))
    assert seen == pytest.approx(0.0021, rel=0.1)  # 2 mm and what range noise adds
    still = TM30.model_copy(update={"aiming_sigma_m": 0.0, "range_sigma_m": 0.0,
                                    "range_sigma_ppm": 0.0, "angle_sigma_arcsec": 0.0})  # fmt: skip
    assert pentagon_scatter_m(Car(1).blocks(still)[0]) < 1e-7


def test_virtual_points_are_compared_by_what_they_add(made):
    folder, *_ = made
    with open_capture(folder) as capture:
        one = validate_capture(capture, Config(), Request("virtual"))
        again = validate_capture(capture, Config(), Request("virtual"))
        wide = validate_capture(capture, Config(), Request("virtual", radius_m=0.11))
    np.testing.assert_array_equal(one.difference_rad, again.difference_rad)
    assert 1e-3 < one.joint.probability < 1.0
    # 0.8 mm on a ring of 88 mm, less what all points have
    alone = 8e-4 / (0.088 * np.sqrt(2.5))
    np.testing.assert_allclose(one.planes.u, alone, rtol=0.1)
    np.testing.assert_allclose(wide.planes.u, alone * 0.088 / 0.11, rtol=0.1)
    np.testing.assert_allclose(one.u_second**2, one.u_first**2 + one.spread.u**2, rtol=1e-9)


def test_the_old_estimator_is_named_and_its_bias_shown(made):
    folder, *_ = made
    old = compared(folder, method="tcgc-2013")
    new = compared(folder)
    assert old.second.label == "five points, tcgc-2013"
    assert any("its camber is larger" in note for note in old.notes)
    assert np.abs(old.second.angles_rad - new.second.angles_rad).max() < 1e-3
    assert np.any(old.second.angles_rad != new.second.angles_rad)


def test_reports_say_units_signs_and_verdict(made, tmp_path):
    folder, *_ = made
    done = run("validate", folder, "--five-point", folder / FILE, "-o", tmp_path / "out")
    text = done.stdout
    assert done.return_value == (0 if "Verdict: agree" in text else 1)
    assert "Toe-in and camber with the top outward are positive" in text
    assert "dense scans less five points" in text
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["differences.svg", "validation.html", "validation.json", "validation.txt"]
    stale, others = ("bland-altman-toe.svg", "validation.pdf"), ("notes.txt", "target-1.png")
    for name in (*stale, *others):
        (tmp_path / "out" / name).write_bytes(b"1")
    run("validate", folder, "--five-point", folder / FILE, "-o", tmp_path / "out")
    beside = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert beside == sorted([*files, *others])  # no report of an earlier one beside its numbers
    picture = (tmp_path / "out" / "differences.svg").read_text(encoding="utf-8")
    ElementTree.fromstring(picture)
    assert "toe-in" in picture
    assert "/ °" in picture
    assert (tmp_path / "out" / "validation.txt").read_text(encoding="utf-8") in text
    again = run("validate", folder, "--five-point", folder / FILE, "--json").stdout
    assert (tmp_path / "out" / "validation.json").read_text(encoding="utf-8") == again
    tree = json.loads(again)
    assert tree["schema"] == "wheelplane/validation/1"
    row = tree["angles"][0]
    assert row["difference_deg"] == pytest.approx(row["first_deg"] - row["second_deg"])
    assert row["en"] == pytest.approx(row["difference_deg"] / row["expanded_95_deg"])
    assert row["difference_deg"] == pytest.approx(row["by_frame_deg"] + row["by_plane_deg"])


def test_an_error_that_would_not_be_seen_is_no_agreement(found):
    blind = replace(found, to_detect_rad=found.detectable_in_one_rad / 2)
    clear = replace(found, to_detect_rad=found.detectable_in_one_rad * 2)
    assert (blind.verdict, clear.verdict) == ("cannot tell", "agree")
    assert "would not be seen" in validation_text(blind)
    assert "would not be seen" not in validation_text(clear)
    moved = replace(found.first, angles_rad=found.first.angles_rad + 0.1)
    assert replace(blind, first=moved).verdict == "disagree"
    assert {*replace(blind, first=moved).verdicts} == {"disagree"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "nothing to compare with"),
        (("--virtual", "--truth"), "one at a time"),
        (("--virtual", "--aiming", "2"), "none is read"),
        (
            ("--five-point", FILE, "--aiming", "0.002"),
            "--aiming is 0.002 mm, and points are aimed at within 0.01 to 50 mm: if it is in m, "
            "give 2",
        ),
        (("--five-point", FILE, "--aiming", "2000"), "if it is in µm, give 2"),
        (("--truth", "--method", "tcgc-2013"), "none is read"),
        (("--truth", "--radius", "80"), "--radius without --virtual"),
        (("--five-point", "nowhere.txt"), "no such file"),
        (
            ("--total-station-position", "1,2,3", "--five-point", FILE),
            "name the total station as well",
        ),
        (
            ("--total-station", "leica-tm30", "--five-point", FILE),
            "--total-station-position X,Y,Z",
        ),
        (("--total-station", "leica-tm30", "--total-station-position", "1,2"), "three numbers"),
    ],
)
def test_what_cannot_be_compared_is_one_line(made, arguments, said):
    folder, *_ = made
    arguments = [folder / a if a == FILE else a for a in arguments]
    done = run("validate", folder, *arguments)
    assert isinstance(done.exception, WheelplaneError)
    assert said in str(done.exception)
    assert "\n" not in str(done.exception)


def test_a_stated_station_goes_before_the_scatter(made):
    folder, _, place = made
    with pytest.raises(ConfigError, match="name another scanner"):
        run_checked(folder, "default", place)
    found = run_checked(folder, "leica-tm30", place)
    # the TM30 states 2 mm to any surface
    assert found["angles"][0]["u_second_deg"] > 0.2


def run_checked(folder, station, place):
    at = ",".join(f"{x:.3f}" for x in place)
    done = run("validate", folder, "--five-point", folder / FILE, "--total-station", station,
               "--total-station-position", at, "--json")  # fmt: skip
    if done.exception:
        raise done.exception
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def archive(made, tmp_path_factory):
    """Four captures, one without a scan, one whose trial shows nothing, one with no points."""
    folder = tmp_path_factory.mktemp("archive")
    for index in range(2):
        write_capture(folder / f"c{index}", 20 + index, FINE, trials=1)
    broken = shutil.copytree(made[0], folder / "broken")
    (broken / "fl.ply").unlink()
    lame = shutil.copytree(made[0], folder / "lame")
    (lame / "trial-1.ply").write_bytes(scan_of_nothing())
    shutil.make_archive(str(folder / "packed"), "zip", made[0])
    bare = shutil.copytree(made[0], folder / "without")
    (bare / FILE).unlink()
    (folder / "notes.txt").write_text("not a capture")
    return folder


def scan_of_nothing():
    from wheelplane_synth.output.files import ply

    points = np.random.default_rng(0).uniform(-0.5, 0.5, (4000, 3))
    return ply(points, np.ones(len(points), np.float32))


def test_a_broken_capture_is_a_row_with_its_reason(archive, tmp_path):
    done = run("validate", archive, "-o", tmp_path)
    assert done.return_value == 1
    tree = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in tree["captures"]}
    assert list(rows) == ["broken", "c0", "c1", "lame", "packed.zip", "without"]
    assert "fl.ply is missing" in rows["broken"]["reason"]
    assert "no such file" in rows["without"]["reason"]
    assert rows["lame"]["missing"][0]["name"] == "1"
    assert [len(rows[name]["angles"]) for name in ("c0", "lame", "packed.zip")] == [10, 8, 10]
    assert tree["compared"] == 4
    assert "Not compared: broken" in done.stdout
    for kind in ("toe", "camber"):
        for plot in ("bland-altman", "line"):
            picture = (tmp_path / f"{plot}-{kind}.svg").read_text(encoding="utf-8")
            ElementTree.fromstring(picture)
            assert picture.count("<circle") == 19
            assert "positive)" in picture
    page = (tmp_path / "validation.html").read_text(encoding="utf-8")
    for name in ("c0", "c1", "lame", "packed.zip"):  # every file of every capture has its digest
        for file in ("rr.ply", "rl.ply", "fr.ply", "fl.ply", "trial-1.ply", FILE):
            assert re.search(rf">{name}: {file}<.*?>[0-9a-f]{{64}}<", page, re.DOTALL)
    bias = tree["agreement"]["toe"]["bias_deg"]
    assert bias["low"] < bias["value"] < bias["high"]
    assert tree["agreement"]["toe"]["captures_needed"]["bias_deg"] == pytest.approx(0.1)


@pytest.mark.slow
@pytest.mark.slow
def test_an_archive_against_the_truth(archive):
    done = run("validate", archive, "--truth", "--json")
    tree = json.loads(done.stdout)
    reasons = {row["name"]: row["reason"] for row in tree["captures"] if row["reason"]}
    assert set(reasons) == {"broken", "without"}
    assert "it has the scans of packed.zip" in reasons["without"]
    score = tree["scores"]["toe"]
    assert abs(score["bias_deg"]) <= score["rms_deg"] <= abs(score["worst_deg"]) < 0.05
    assert tree["captures"][1]["second"] == "truth"
    five = json.loads(run("validate", archive, "--truth", "--five-point", FILE, "--json").stdout)
    assert five["captures"][1]["first"] == "five points"


def test_a_copy_of_a_capture_is_no_independent_comparison(monkeypatch, tmp_path):
    """Five copies agreed, with a bias of limits that exclude 0, and would detect one of 0."""
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
    found, scans = Car(1).compare(station=FINE), {"a": "1", "b": "2", "c": "1"}

    def compared(path, *_):
        inputs = {f"{path.name}: rr.ply": f"sha256:{scans[path.name]}"}
        origin = Provenance(path.name, None, "", inputs, {}, 0)
        return Row(path.name, replace(found, origins=(origin, origin)))

    monkeypatch.setattr(study, "_row", compared)
    found = validate_archive(tmp_path, None, Config(), None, Request("truth"))
    assert [row.found is None for row in found.rows] == [False, False, True]
    assert found.rows[2].reason.startswith("it has the scans of a: a copy is no independent")
    assert not found.complete


def test_what_is_an_archive(archive, made, tmp_path):
    assert is_archive_of_captures(archive)
    assert not is_archive_of_captures(made[0])
    assert not is_archive_of_captures(archive / "packed.zip")
    for wrong in (tmp_path, archive / "broken" / ".."):
        request = Request("five-point", Path("absent.txt"))
        with pytest.raises(InputError, match=r"neither a capture|none of its 6"):
            validate_archive(wrong, None, Config(), None, request)


def survey(errors, count=30, see=None):
    found = [
        replace(Car(seed).compare(station=FINE, toe_error=errors(seed)), vehicle=str(seed))
        for seed in range(count)
    ]
    return ComparisonStudy("", tuple(Row(one.vehicle, one) for one in found), see)


def test_the_verdict_of_many_is_of_bias_and_of_single_captures():
    right = survey(lambda _: np.zeros(4))
    assert right.verdict == "agree"
    assert right.complete
    biased = survey(lambda _: np.full(4, np.radians(0.02)))
    assert biased.verdict == "disagree"
    assert biased.bias_probability < EACH
    scattered = survey(lambda seed: np.eye(4)[seed % 4] * np.radians(0.15) * (-1) ** seed)
    assert scattered.verdict == "disagree"
    assert scattered.chance_of_disagreeing < EACH
    blind = replace(right, to_detect_rad=right.detectable_rad / 2)
    assert (blind.verdict, replace(right, rows=right.rows[:3]).verdict) == ("cannot tell",) * 2


def test_many_agree_only_where_none_is_in_doubt():
    """As of one capture: what both methods share, or their u does not explain, is no agreement."""
    found = [replace(Car(seed).compare(station=FINE), vehicle=str(seed)) for seed in range(8)]
    assert not any(one.doubts or one.is_shape_contradicted for one in found)
    right = ComparisonStudy("", tuple(Row(f"c{k}", one) for k, one in enumerate(found)), None)
    assert (right.verdict, right.in_doubt) == ("agree", ())
    noted = replace(found[3], notes=(Doubt("upside down"),))
    targets = found[3].first.targets
    aside = replace(targets[0], centre_m=targets[0].centre_m + np.array([0.0, 0.02, 0.0]))
    moved = replace(found[3], first=replace(found[3].first, targets=(aside, *targets[1:])))
    for wrong in (noted, moved):
        study = replace(right, rows=(*right.rows[:3], Row("c3", wrong), *right.rows[4:]))
        assert wrong.verdict == study.verdict == "cannot tell"
        assert study.in_doubt == ("c3",)
        assert "c3" in verdict_lines(study, load_translations("en"))[-1]
    biased = survey(lambda _: np.full(4, np.radians(0.02)))
    doubted = replace(biased.found[-1], notes=noted.notes)
    assert replace(biased, rows=(*biased.rows[:-1], Row("", doubted))).verdict == "disagree"


@pytest.mark.parametrize(
    ("vehicles", "says"),
    [
        (["a", "b", "a", "b", "a", "b"], "needs four vehicles (2 here; captures of one vehicle"),
        (["a", "a", "a"], "needs four captures (3 here)"),
        (["a", "b", "c"], "needs four captures (3 here)"),
        (["a", "a", "a", "a"], "p = "),
    ],
)
def test_what_the_test_of_the_bias_lacks_is_said(vehicles, says):
    found = [replace(Car(i).compare(), vehicle=name) for i, name in enumerate(vehicles)]
    study = ComparisonStudy("", tuple(Row(str(i), one) for i, one in enumerate(found)), None)
    assert says in verdict_lines(study, load_translations("en"))[1]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: "{", "not a truth file"),
        (lambda t: t.replace('"RL"', '"RX"'), "it lacks 'RL'"),
        (lambda t: t.replace('"toe_deg"', "toe_deg", 1), r"\(line \d+ is not JSON\)"),
        (lambda t: t.replace('"toe_deg": ', '"toe_deg": true, "x": '), "finite number"),
        (lambda t: "[]", "not a truth file"),
        (lambda t: "[" * 100000, "not a truth file"),
        (lambda t: t.replace('"toe_deg": ', '"toe_deg": ' + "9" * 400, 1), "not a truth file"),
        (None, "no such file"),
    ],
)
def test_a_truth_that_is_none_is_refused(made, tmp_path, change, said):
    path = tmp_path / "truth.json"
    if change is not None:
        path.write_text(change((made[0] / "truth.json").read_text()))
    with pytest.raises(InputError, match=said) as error:
        read_truth(path, "truth.json", ["RR", "RL", "FR", "FL"])
    assert "\n" not in str(error.value)


def test_a_file_arranged_by_nothing_is_as_it_stands(made):
    path = made[0] / FILE
    plain = read_five_point(path)
    turned = read_five_point(path, arrange=lambda count: [0, 1, 2, 3])
    np.testing.assert_array_equal(turned.blocks_m, plain.blocks_m[:4])


@pytest.mark.parametrize("size", [1e-7, 0.013, 1.0, 7.3, 4e5])
def test_ticks_are_round_and_few(size):
    found = ticks(-0.3 * size, size)
    assert 4 <= len(found) <= 10
    assert found[0] >= -0.3 * size
    assert found[-1] <= size
    step = found[1] - found[0]
    leading = step / 10 ** np.floor(np.log10(step) + 1e-9)
    assert np.min(np.abs(leading - np.array([1, 2, 2.5, 5, 10]))) < 1e-6


@pytest.mark.parametrize("stand_off", [0.01, 0.06])
def test_five_points_are_compared_with_the_faces_that_they_lie_on(stand_off):
    """Not with centres carried to the wheels: tracks differed by twice the stand-off."""
    car = Car(1)
    faces, (blocks_m, _) = car.dense().targets, car.blocks()
    points = points_of(FivePointFile(blocks_m, "five.txt", "", ()), car.names)
    found = []
    for given in ({}, {"stand_off": stand_off, "stand_off_u": 0.0005}):
        target = DiscTarget(shape="disc", diameter=0.25, **given)
        seen = [
            Observation(
                name, "reference", name, "", "", 5, 0, evidence=Evidence(fit), target=target
            )
            for name, fit in zip(car.names, faces, strict=True)
        ]
        dense = align(seen, Provenance("bay", None, "0", {}, {}, 0))
        found.append(compare_with_points(dense, points, Request("five-point")))
        found.append(compare_measurements(dense, points.measurement, ("scans", "points")))
    for plain, carried in (found[::2], found[1::2]):
        np.testing.assert_array_equal(carried.difference_rad, plain.difference_rad)
        assert carried.joint == plain.joint
        assert carried.shape_test == plain.shape_test


def test_five_points_are_not_compared_with_centres_that_a_file_holds_in_the_place_of_faces(
    tmp_path,
):
    car = Car(1)
    points = points_of(FivePointFile(car.blocks()[0], "five.txt", "", ()), car.names)
    for given, refused in (({}, False), ({"stand_off": 0.085, "stand_off_u": 0.0005}, True)):
        target = DiscTarget(shape="disc", diameter=0.25, **given)
        origin = Provenance("bay", None, "0", {}, {"target": target.model_dump()}, 0)
        seen = [
            Observation(name, "reference", name, "", "", 5, 0, evidence=Evidence(fit),
                        target=target)
            for name, fit in zip(car.names, car.dense().targets, strict=True)
        ]  # fmt: skip
        path = tmp_path / "measurement.json"
        path.write_text(to_json(align(seen, origin)), encoding="utf-8")
        read, _ = read_measurement(path, "measurement.json")
        if refused:
            with pytest.raises(InputError, match="of the wheels, its targets stand off these"):
                compare_with_points(read, points, Request("five-point"))
        else:
            assert not compare_with_points(read, points, Request("five-point")).missing


def test_a_trial_at_another_wheel_is_no_trial_of_the_other_measurement():
    """Its name alone is the same: the page compares what both measured, and names the rest."""
    car = Car(1)
    seen = [
        Observation(name, role, wheel, "", "", 5, 0, evidence=Evidence(fit))
        for name, role, wheel, fit in zip(
            (*car.names, "1", "2"),
            4 * ["reference"] + 2 * ["trial"],
            (*car.names, "RR", "FL"),
            [car.dense().targets[i] for i in (0, 1, 2, 3, 0, 3)],
            strict=True,
        )
    ]
    moved = [*seen[:4], replace(seen[5], name="1"), seen[5]]
    both = [align(each, Provenance("bay", None, "0", {}, {}, 0)) for each in (seen, moved)]
    found = compare_measurements(*both, ("before", "after"))
    assert found.names == (*car.names, "2")
    assert found.missing == (("1", "at RR in before, at FL in after"),)
    np.testing.assert_array_equal(found.difference_rad, 0.0)
