"""Explanation and hints: a refused scan shows why, and a person's choice measures it.

The law: a target chosen among two measures as it does where it is the only one.
"""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from tests.support.batches import call
from tests.support.made import (
    RADIUS_M,
    as_one_cloud,
    read_ply,
    with_second_target,
    write_small_capture,
)
from tests.support.round_wheels import vehicle_points, with_disc
from wheelplane.capture import CaptureOptions, open_capture
from wheelplane.commands.shared.options import three_numbers
from wheelplane.config import Config, SegmentConfig
from wheelplane.detection import Candidate, rivals
from wheelplane.errors import InputError, NotMeasuredError
from wheelplane.explanation.explain import explain_capture
from wheelplane.explanation.explain_cloud import SAMPLE
from wheelplane.explanation.records import (
    ExplainedCandidate,
    ExplainedScan,
    Explanation,
    Finding,
)
from wheelplane.explanation.verdicts import MOST_SHOWN, apart
from wheelplane.measure import measure_capture
from wheelplane.report.candidates.pictures import picture_corners_m, places
from wheelplane.report.candidates.text import explanation_text
from wheelplane.report.candidates.tree import explanation_tree, point_of, verdict_of
from wheelplane.report.explanation import write_explanation
from wheelplane.report.format.language import load_translations
from wheelplane.targets import load_target
from wheelplane.units import LENGTH_UNITS, in_metres
from wheelplane.wheel import find_patch
from wheelplane_synth.output.files import ply

RAISED_M = 0.55
COARSE_M = 0.014  # steps of coordinates
SAME_U = 0.35  # of the same points, with a second target above them that turns no normal


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return write_small_capture(tmp_path_factory.mktemp("plain") / "car", trials=0)


@pytest.fixture(scope="module")
def measured(plain):
    return measurement(plain)


@pytest.fixture(scope="module")
def doubled(plain, measured):
    """The same capture, with the target of FL a second time above the wheel."""
    return with_second_target(plain, centre(measured, "FL"), RAISED_M)


@pytest.fixture(scope="module")
def whole(plain, tmp_path_factory):
    """The four scans as one cloud."""
    folder = tmp_path_factory.mktemp("whole") / "car"
    folder.mkdir()
    as_one_cloud(plain, folder / "whole.ply")
    return folder


def measurement(folder, **options):
    with open_capture(folder, "disc-250", CaptureOptions(**options)) as capture:
        return measure_capture(capture, Config())


def explained(folder, **options):
    with open_capture(folder, "disc-250", CaptureOptions(**options)) as capture:
        return {scan.name: scan for scan in explain_capture(capture, Config()).scans}


def check_shown(scan: ExplainedScan, radius_m: float = RADIUS_M):
    """Each place once, best match first, numbered from 1."""
    found = [one.candidate for one in scan.candidates]
    assert len(found) <= MOST_SHOWN
    assert apart(found, radius_m) == found
    assert [one.number for one in scan.candidates] == list(range(1, len(found) + 1))
    matches = [one.match for one in found]
    assert matches == sorted(matches, reverse=True)


def wheel(found, name):
    return next(one for one in found.wheels if one.observation.name == name)


def centre(found, name):
    return wheel(found, name).observation.fitted.centre_m


def up_uncertainty(found, name):
    return math.sqrt(wheel(found, name).observation.fitted.centre_covariance_m2[2, 2])


def moved(found, name, *by_m):
    return tuple(centre(found, name) + np.array(by_m))


def toe_and_camber(found, name):
    """Values and standard uncertainties (2, 2), rad."""
    of = wheel(found, name)
    return np.array([[of.angles.toe_rad, of.u_toe_rad], [of.angles.camber_rad, of.u_camber_rad]])


def check_alike(found, other, name):
    (one, two) = (toe_and_camber(m, name) for m in (found, other))
    assert np.all(np.abs(one - two)[:, 0] < SAME_U * two[:, 1])


def test_two_targets_are_refused_and_both_are_shown(doubled, measured):
    with pytest.raises(InputError, match="ambiguous-target"):
        measurement(doubled)
    found = explained(doubled)
    assert [scan.status for scan in found.values()] == ["ok", "ok", "ok", "ambiguous-target"]
    first, second = found["FL"].candidates[:2]
    assert (first.standing, second.standing) == ("rival", "rival")
    heights = sorted(one.candidate.centre_m[2] for one in (first, second))
    assert heights[1] - heights[0] == pytest.approx(RAISED_M, abs=0.003)
    assert found["FL"].face is not None
    for scan in found.values():
        check_shown(scan)
    for name in ("RR", "RL", "FR"):
        (best, *others) = found[name].candidates
        np.testing.assert_allclose(best.candidate.centre_m, centre(measured, name), atol=0.003)
        assert best.standing == "chosen"
        assert {one.standing for one in others} <= {"refused"}


def test_a_chosen_target_measures_as_if_it_were_the_only_one(doubled, measured):
    found = measurement(doubled, hints={"FL": moved(measured, "FL", 0.02, 0.0, -0.03)})
    check_alike(found, measured, "FL")
    assert any(note.startswith("FL: The operator chose the target") for note in found.notes)
    assert found.provenance.config["hints"]["FL"]["near_m"]
    raised = measurement(doubled, hints={"FL": moved(measured, "FL", 0.0, 0.0, RAISED_M)})
    # Nothing is behind the copy: its centre is by its outermost points.
    u_m = math.hypot(up_uncertainty(raised, "FL"), up_uncertainty(found, "FL"))
    assert 1e-5 < u_m < 1e-3
    apart_m = centre(raised, "FL")[2] - centre(found, "FL")[2]
    assert apart_m == pytest.approx(RAISED_M, abs=2.0 * u_m)


def test_a_box_hides_what_lies_outside(doubled, measured):
    low = centre(measured, "FL") - 0.4
    box = f"\n[hints.FL]\nbox = [{low.tolist()}, {(low + 0.8).tolist()}]\n"
    folder = doubled.parent / "boxed"
    shutil.copytree(doubled, folder, dirs_exist_ok=True)
    with (folder / "capture.toml").open("a") as file:
        file.write(box)
    found = measurement(folder)
    np.testing.assert_allclose(centre(found, "FL"), centre(measured, "FL"), atol=1e-4)


def test_what_is_missing_in_a_box_is_said_to_be_missing_there(plain, whole, measured, tmp_path):
    """Neither the scan nor the target is at fault."""
    centres = np.array([centre(measured, name) for name in ("RR", "RL", "FR", "FL")])
    above, rear, reach = centres[3] + [0.0, 0.0, 0.3], centres[:2], np.array([0.3, 0.3, 0.15])
    for name, folder, low, high, missing in (
        ("FL", plain, above - reach, above + reach, "(no|two) plane"),
        ("vehicle", whole, rear.min(axis=0) - 0.5, rear.max(axis=0) + 0.5, "2 targets found"),
    ):
        boxed = shutil.copytree(folder, tmp_path / name)
        with (boxed / "capture.toml").open("a") as file:
            file.write(f"\n[hints.{name}]\nbox = [{low.tolist()}, {high.tolist()}]\n")
        front = None if name == "FL" else tuple(measured.frame.forward)
        with pytest.raises(InputError, match=f"chose the box from .* m: there, {missing}"):
            measurement(boxed, front=front)


def drawn(scan, middle_m, half_m, turn_rad=0.0):
    """Corners of a square about a place (3,), across the normal of a scan's best candidate."""
    right, up, _ = scan.candidates[0].candidate.basis
    angles = turn_rad + math.pi * np.array([0.25, 0.75, 1.25, 1.75])
    ways = np.column_stack([np.cos(angles), np.sin(angles)]) * half_m * math.sqrt(2.0)
    return tuple(map(tuple, middle_m + ways @ [right, up]))


@pytest.fixture(scope="module")
def seen(doubled):
    """The explained scan of FL, with its two targets."""
    return explained(doubled)["FL"]


@pytest.mark.slow
@pytest.mark.parametrize(("half_m", "turn_rad"), [(0.24, 0.0), (0.13, 0.4), (0.1, 0.0)])
def test_a_region_chooses_a_target_as_a_point_on_it_does(doubled, seen, half_m, turn_rad):
    """Also one that cuts the target's edge: its border hides nothing from the measurement."""
    for one in seen.candidates[:2]:
        middle_m = one.candidate.centre_m + np.array([0.02, -0.01, 0.02])
        region = drawn(seen, middle_m, half_m, turn_rad)
        by_region = measurement(doubled, regions={"FL": region})
        clicked = measurement(doubled, hints={"FL": tuple(one.candidate.centre_m)})
        check_alike(by_region, clicked, "FL")
        np.testing.assert_allclose(centre(by_region, "FL"), centre(clicked, "FL"), atol=5e-5)
        (note,) = [note for note in by_region.notes if note.startswith("FL: ")]
        assert "The operator chose the region with corners (" in note
        assert by_region.provenance.config["hints"] == {"FL": {"region_m": region}}


def test_the_order_of_points_and_corners_chooses_nothing_else(doubled, seen, tmp_path):
    folder = tmp_path / "shuffled"
    shutil.copytree(doubled, folder)
    points, intensity = read_ply(folder / "fl.ply")
    order = np.random.default_rng(0).permutation(len(points))
    (folder / "fl.ply").write_bytes(ply(points[order], intensity[order]))
    region = drawn(seen, seen.candidates[0].candidate.centre_m, 0.2)
    one = measurement(doubled, regions={"FL": region})
    other = measurement(folder, regions={"FL": region[2:] + region[:2]})
    check_alike(other, one, "FL")
    np.testing.assert_allclose(centre(other, "FL"), centre(one, "FL"), atol=5e-5)


@pytest.mark.parametrize(
    ("up_m", "half_m", "message"),
    [
        (RAISED_M / 2.0, 0.6, r"ambiguous-target\): The operator chose the region .*: there, two"),
        (RAISED_M / 2.0, 0.08, r"no-(target|plane)\): The operator chose the region .*: there, "),
        (40.0, 0.2, r"fl.ply: The operator chose the region .*, which holds none of its"),
    ],
)
def test_a_region_without_one_target_is_refused(doubled, measured, seen, up_m, half_m, message):
    middle_m = np.array(moved(measured, "FL", 0.0, 0.0, up_m))
    given = {"regions": {"FL": drawn(seen, middle_m, half_m)}}
    with pytest.raises(InputError, match=message) as refused:
        measurement(doubled, **given)
    assert "\n" not in str(refused.value)
    scan = explained(doubled, **given)["FL"]
    assert scan.reason in str(refused.value)
    assert len(scan.drawn_m) == 4
    outside = [one for one in scan.candidates if one.finding == "outside_region"]
    assert not outside if "ambiguous" in message else len(outside) >= 2  # to choose from


def test_the_border_of_a_region_must_hold_the_centre(doubled, seen):
    """Most of the target lies in it, but not its centre."""
    best = seen.candidates[0].candidate
    aside = best.centre_m + 0.16 * best.basis[0]
    with pytest.raises(InputError, match=r"has its centre .* m outside of it"):
        measurement(doubled, regions={"FL": drawn(seen, aside, 0.155)})


def test_of_a_cloud_the_targets_in_a_region_count(whole, measured):
    """A region about the wheels, though it cuts the edges of their targets, measures as none."""
    centres = np.array([centre(measured, name) for name in ("RR", "RL", "FR", "FL")])
    low, high = centres.min(axis=0) - 0.05, centres.max(axis=0) + 0.05
    (x0, y0, z), (x1, y1, _) = low, high
    region = ((x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z))
    front = tuple(centres[2:].mean(axis=0) - centres[:2].mean(axis=0))
    found = measurement(whole, regions={"vehicle": region}, front=front)
    plain = measurement(whole, front=front)
    for name in ("RR", "RL", "FR", "FL"):
        check_alike(found, plain, name)
        np.testing.assert_allclose(centre(found, name), centre(plain, name), atol=5e-5)
    assert any("vehicle: The operator chose the region" in note for note in found.notes)
    away = tuple((x + 90.0, y, z) for x, y, z in region)
    with pytest.raises(InputError, match="holds none of the 4 targets that are found"):
        measurement(whole, regions={"vehicle": away}, front=front)
    half = tuple((min(x, (x0 + x1) / 2.0), y, z) for x, y, z in region)
    with pytest.raises(InputError, match=r"chose the region .*: there, 2 targets found, four are"):
        measurement(whole, regions={"vehicle": half}, front=front)


@pytest.mark.slow
def test_each_cloud_of_a_vehicle_that_rolled_is_explained(whole, plain, measured, tmp_path):
    """The second lacks the front wheels, for which the capture is refused."""
    folder = tmp_path / "car"
    folder.mkdir()
    shutil.copy(whole / "whole.ply", folder / "first.ply")
    rear = [read_ply(plain / f"{wheel}.ply") for wheel in ("rr", "rl")]
    (folder / "second.ply").write_bytes(ply(*map(np.concatenate, zip(*rear, strict=True))))
    centres = np.array([centre(measured, name) for name in ("RR", "RL", "FR", "FL")])
    front = (centres[2:].mean(axis=0) - centres[:2].mean(axis=0)).tolist()
    (folder / "capture.toml").write_text(
        f'cloud = "first.ply"\nfront = {front}\n[[runout]]\nname = "rolled"\n'
        'file = "second.ply"\nangle_deg = 180.0\n'
    )
    with pytest.raises(InputError, match=r"second\.ply"):
        measurement(folder)
    found = explained(folder)
    assert [scan.file for scan in found.values()] == ["first.ply", "second.ply"]
    assert [scan.status for scan in found.values()] == ["ok", "not-named"]


def test_a_picture_says_where_its_corners_lie(seen):
    """The places of candidates in the picture, turned back, are their centres across the view."""
    origin, right, down = picture_corners_m(seen)
    assert abs((right - origin) @ (down - origin)) < 1e-9
    for one, (x, y) in zip(seen.candidates, places(seen), strict=True):
        apart = one.candidate.centre_m - (origin + x * (right - origin) + y * (down - origin))
        across = apart - (apart @ seen.best) * seen.best
        assert np.linalg.norm(across) < 1e-3


@pytest.mark.parametrize(
    ("away_m", "message"),
    [(0.3, "no-target"), (40.0, r"too-few-points\): 0 points within")],
)
def test_a_point_beside_all_planes_is_refused(doubled, measured, away_m, message):
    point = moved(measured, "FL", 0.0, 0.0, -away_m)
    with pytest.raises(InputError, match=message):
        measurement(doubled, hints={"FL": point})
    found = explained(doubled, hints={"FL": point})["FL"]
    assert found.status in message
    assert [one.standing for one in found.candidates] == ["rival", "rival"]


def test_named_wheels_of_a_cloud_are_those_of_single_scans(whole, measured):
    hints = {name: tuple(centre(measured, name)) for name in ("RR", "RL", "FR", "FL")}
    found = measurement(whole, hints=hints)
    for name in hints:
        check_alike(found, measured, name)
    (scan,) = explained(whole, hints=hints).values()
    assert {one.wheel for one in scan.candidates if one.standing == "chosen"} == set(hints)


def test_a_cloud_without_a_front_is_explained(whole):
    (scan,) = explained(whole).values()
    assert scan.status == "not-named"
    assert 0 < len(scan.sample_m) <= min(scan.points, SAMPLE)
    check_shown(scan)
    assert "the front of the vehicle is unknown" in scan.reason
    assert [one.standing for one in scan.candidates[:4]] == ["rival"] * 4


@pytest.mark.parametrize(
    "way", [{"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}, {"FL": "FR", "FR": "FL"}]
)
def test_left_and_right_exchanged_are_refused(whole, measured, way):
    hints = {
        name: tuple(centre(measured, way.get(name, name))) for name in ("RR", "RL", "FR", "FL")
    }
    with pytest.raises(InputError, match="lies to the right of"):
        measurement(whole, hints=hints)


def test_front_and_rear_exchanged_are_refused_where_the_front_is_stated(whole, measured):
    """Wheels named the other way round agree with up: only the stated front shows it."""
    hints = {name: tuple(centre(measured, name)) for name in ("RR", "RL", "FR", "FL")}
    turned = {"RR": "FL", "RL": "FR", "FR": "RL", "FL": "RR"}
    front = tuple(measured.frame.forward)
    back = tuple(-measured.frame.forward)
    assert measurement(whole, hints=hints, front=front).wheels
    for named, ahead in ((hints, back), ({one: hints[turned[one]] for one in hints}, front)):
        with pytest.raises(InputError, match="hints: FR and FL lie behind RR and RL, by --front"):
            measurement(whole, hints=named, front=ahead)


def test_the_command_writes_pictures_although_the_measurement_fails(doubled, tmp_path):
    out = tmp_path / "why"
    command = ["measure", doubled, "--target", "disc-250"]
    ended = call(*command, "--explain", out)
    assert ended.returncode == 2
    assert "it has the target's outline as well, 550 mm from the best" in ended.stdout
    tree = json.loads((out / "explanation.json").read_text())
    assert tree["schema"] == "wheelplane/explanation/1"
    lost = next(scan for scan in tree["scans"] if scan["name"] == "FL")
    assert lost["status"] == "ambiguous-target"
    assert all((out / name).read_bytes().startswith(b"\x89PNG") for name in lost["pictures"])
    hint = lost["candidates"][0]["hint"]
    assert f"--hint {hint}" in ended.stdout
    again = call(*command, "--hint", hint, "--json")
    assert again.returncode == 0
    assert json.loads(again.stdout)["provenance"]["config"]["hints"].keys() == {"FL"}


def test_no_picture_of_an_earlier_explanation_stays_beside_a_new_one(tmp_path):
    """They are of scans that are gone; before there is an explanation, nothing is removed."""
    scan = ExplainedScan("FL", "reference", "fl.ply", "not-read", "", 0, np.zeros((0, 3)), None)
    found, words = Explanation("car", "", "m", (scan,)), load_translations("en")
    others = {"best-1.png", "candidates-RR.png"}
    for name in (*others, "notes.txt"):
        (tmp_path / name).write_bytes(b"1")
    made = {path.name for path in write_explanation(found, tmp_path, words)}
    assert made == {"candidates-FL.png", "explanation.json"}
    assert {path.name for path in tmp_path.iterdir()} == made | others | {"notes.txt"}
    write_explanation(found, tmp_path, words)
    assert {path.name for path in tmp_path.iterdir()} == made | {"notes.txt"}


@pytest.mark.parametrize("unit", LENGTH_UNITS)
@pytest.mark.parametrize("centre_m", [(0.2, -3.1, -1e-6), (500123.4567, 4512345.678, 1e-6 - 1e6)])
def test_the_point_of_a_candidate_is_its_centre(unit, centre_m):
    """On a site's grid as well: with six digits it would lie metres beside the candidate."""
    found = Candidate(np.array(centre_m), np.eye(3), 0.6, 5e-4, 0.005, 13_000)
    text = point_of(ExplainedCandidate(1, found, "refused", "worse"), unit)
    place = 1e-3 if unit == "m" else 0.1
    given = np.array(three_numbers("--hint FL", text))
    np.testing.assert_allclose(given, np.array(centre_m) / in_metres(1.0, unit), atol=0.51 * place)
    assert "-0," not in f"{text},"
    assert text.startswith("0.2,-3.1,0") or (unit, centre_m[0]) != ("m", 0.2)


def test_a_scan_in_coarse_steps_is_explained_as_it_is_measured(plain, tmp_path, monkeypatch):
    """Points on steps beside the target's plane are its own, for the search and what it shows."""
    folder = tmp_path / "car"
    shutil.copytree(plain, folder)
    points, intensity = read_ply(folder / "fr.ply")
    points = np.rint(points / COARSE_M) * COARSE_M
    (folder / "fr.ply").write_bytes(ply(points, intensity))
    patch = find_patch(points, load_target("disc-250"), Config())

    def refused(*_):
        raise NotMeasuredError("no-outline", "as the search alone is of interest")

    monkeypatch.setattr("wheelplane.explanation.explain.fit_target", refused)
    with open_capture(folder, "disc-250") as capture:
        (one,) = (entry for entry in capture.entries if entry.name == "FR")
        (found,) = explain_capture(replace(capture, entries=(one,)), Config()).scans
    assert found.status == "no-outline"
    assert found.candidates[0].candidate.match == patch.match
    check_shown(found)


def test_an_unreadable_scan_is_explained_beside_the_others(plain, tmp_path):
    folder = tmp_path / "car"
    shutil.copytree(plain, folder)
    (folder / "rl.ply").write_bytes(b"ply\nnot at all")
    found = explained(folder)
    assert [scan.status for scan in found.values()] == ["ok", "not-read", "ok", "ok"]
    assert not found["RL"].candidates


def test_a_scan_whose_pose_is_refused_is_not_explained_as_measured(plain, tmp_path):
    folder = tmp_path / "car"
    shutil.copytree(plain, folder)
    points, intensity = read_ply(folder / "rl.ply")
    poses = "0 0 0\n1.01 0 0\n0 1 0\n0 0 1\n1.01 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    rows = "\n".join(f"{x:.6f} {y:.6f} {z:.6f} {i:.3f}" for (x, y, z), i in
                     zip(points.tolist(), intensity.tolist(), strict=True))  # fmt: skip
    (folder / "rl.ply").unlink()
    (folder / "rl.ptx").write_text(f"1\n{len(points)}\n{poses}{rows}\n")
    declared = folder / "capture.toml"
    declared.write_text(declared.read_text().replace("rl.ply", "rl.ptx"))
    with pytest.raises(InputError, match="is no rotation") as refused:
        measurement(folder)
    scan = explained(folder)["RL"]
    assert (scan.status, scan.reason) == ("not-read", str(refused.value))
    assert scan.points == len(points)


@pytest.mark.slow
def test_two_runs_write_the_same_bytes(doubled, tmp_path):
    for name in ("one", "two"):
        call("measure", doubled, "--target", "disc-250", "--explain", tmp_path / name)
    files = sorted(file.name for file in (tmp_path / "one").iterdir())
    assert len(files) == 9
    for name in files:
        one, two = ((tmp_path / run / name).read_bytes() for run in ("one", "two"))
        assert one == two, name


@pytest.mark.parametrize(
    ("hint", "message"),
    [
        ("FL", "write NAME=X,Y,Z"),
        ("FL=1,2", "three numbers X,Y,Z are needed"),
        ("XX=1,2,3", "wheelplane: --hint XX: there is no such scan: name one of RR"),
    ],
)
def test_a_wrong_option_is_one_line(plain, hint, message):
    ended = call("measure", plain, "--target", "disc-250", "--hint", hint)
    assert ended.returncode == 2
    assert message in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


def test_residuals_about_a_candidate_are_those_of_its_plane(doubled):
    scan = explained(doubled)["FL"]
    residuals = scan.face.residual_m[np.isfinite(scan.face.residual_m)]
    assert math.sqrt(float(np.mean(residuals**2))) == pytest.approx(scan.sigma_m, rel=0.25)
    assert Path(scan.file).suffix == ".ply"


def test_a_bare_wheel_has_no_candidates_but_a_status(plain):
    """Coarse scans of wheels with targets: whatever becomes of them as bare wheels is said."""
    with open_capture(plain, "wheel") as capture:
        found = explain_capture(capture, Config())
    for scan in found.scans:
        assert scan.candidates == ()
        assert scan.is_measured == (scan.reason == "")
        assert len(scan.sample_m) > 1000


@pytest.mark.slow
def test_a_cloud_of_bare_wheels_shows_its_wheels_and_no_plane(whole, measured):
    with open_capture(whole, "wheel") as capture:
        (scan,) = explain_capture(capture, Config()).scans
    assert scan.status == "not-named"
    assert {one.finding for one in scan.candidates} == {"stands"}
    for one in scan.candidates:
        discs_m = [centre(measured, name) for name in ("RR", "RL", "FR", "FL")]
        assert min(np.linalg.norm(one.candidate.centre_m - disc) for disc in discs_m) < 0.2


@pytest.mark.parametrize("finding", get_args(Finding))
def test_every_verdict_is_said_in_both_languages(finding):
    one = ExplainedCandidate(1, None, "refused", finding, "RR", least_match=0.5, apart_m=0.0123)
    english, portuguese = (verdict_of(one, load_translations(name)) for name in ("en", "pt"))
    assert english != portuguese
    if finding == "no_outline":
        assert "0.50" in english
        assert "0,50" in portuguese
    if finding in ("outline_too", "worse"):
        assert "12 mm" in english
        assert "12 mm" in portuguese


@pytest.mark.slow
def test_of_a_cloud_with_unlike_targets_each_kind_is_shown(tmp_path):
    """A disc before one of four real wheels, which is seen beside it."""
    rng = np.random.default_rng(51)
    names = ("RR", "RL", "FR", "FL")
    centres = [np.array([x, y, 0.32]) for x in (0.0, 2.6) for y in (-0.75, 0.75)]
    axes = [np.array([0.0, np.sign(y), 0.0]) for _, y, _ in centres]
    points = vehicle_points(rng, centres, axes)
    np.save(tmp_path / "car.npy", with_disc(rng, points, centres[0], axes[0], axes[0], 0.085))
    text = 'cloud = "car.npy"\nfront = [1, 0, 0]\ntarget = "wheel"\n[targets]\nRR = "disc-250"\n'
    (tmp_path / "capture.toml").write_text(text, encoding="utf-8")
    with open_capture(tmp_path) as capture:
        kinds = capture.of_wheels
        explanation = explain_capture(capture, Config())
    (scan,) = explanation.scans
    assert scan.status == "ok"
    chosen = {one.wheel: one for one in scan.candidates if one.standing == "chosen"}
    assert {name: one.target for name, one in chosen.items()} == {
        name: kinds[name].description for name in names
    }
    for name, centre in zip(names, centres, strict=True):
        assert np.linalg.norm(chosen[name].candidate.centre_m - centre) < 0.12
        assert chosen[name].region == kinds[name].region
    behind = [one for one in scan.candidates if one.finding == "other_target"]
    assert {(one.wheel, one.target) for one in behind} == {("RR", kinds["FL"].description)}
    shown = explanation_text(explanation)
    assert all(kind.description in shown for kind in kinds.values())
    tree = explanation_tree(explanation, {}, load_translations("en"))
    assert {one["target"] for one in tree["scans"][0]["candidates"]} == {
        kind.description for kind in kinds.values()
    }


def test_a_target_behind_what_hides_it_is_shown_and_offered():
    """On another surface and about as good; not a second place on the same, nor a poor one."""
    panel = Candidate(np.full(3, -1e-5), np.eye(3), 0.58, 5e-4, 0.005, 13_000)
    behind = replace(panel, centre_m=np.array([0.05, 0.0, -0.06]), match=0.57)
    beside = replace(panel, centre_m=np.array([0.05, 0.0, 0.0]), match=0.57)
    poor = replace(behind, centre_m=np.array([-0.05, 0.0, -0.06]), match=0.1)
    assert apart([panel, behind], RADIUS_M) == [panel, behind]
    assert apart([panel, beside, behind, poor], RADIUS_M) == [panel, behind]
    mixed = replace(panel, match=0.96, points=1000)  # so few points need half of it for a rival
    assert rivals(mixed, behind, load_target("disc-250"), SegmentConfig())
    assert apart([mixed, behind], RADIUS_M) == [mixed, behind]
    judged = (
        ExplainedCandidate(1, panel, "chosen", "outline"),
        ExplainedCandidate(2, behind, "refused", "worse", apart_m=0.078),
    )
    scan = ExplainedScan(
        "RR", "reference", "rr.ply", "no-outline", "", 9, np.zeros((0, 3)), None, judged
    )
    rival = replace(judged[0], standing="rival")
    cases = (
        (judged, "to choose the second: --hint RR=0.05,0,-0.06"),
        (judged[:1], ""),
        ((rival, judged[1]), "to choose the first: --hint RR=0,0,0"),
    )
    for candidates, offer in cases:
        found = Explanation("car", "", "m", (replace(scan, candidates=candidates),))
        assert offer in explanation_text(found)
        assert ("to choose" in explanation_text(found)) == bool(offer)
        assert "(0.000, 0.000, 0.000)" in explanation_text(found)
