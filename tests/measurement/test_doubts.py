"""Scans that contradict what they are named for: no verdict rests on their values."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.batches import call
from tests.support.turning import NOWHERE, PLACES, Scene, facing
from wheelplane.capture.vertical import StatedVertical
from wheelplane.cloud.preview import cloud_sample
from wheelplane.errors import Doubt, InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import FivePointFile, read_five_point
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.doubts import FAR_M, TRACKS, TWIST_M, WHEELBASES
from wheelplane.measurement.evaluate import align, find_verticals
from wheelplane.measurement.records import Evidence
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.notes import notes_in
from wheelplane.report.format.view import PAPER
from wheelplane.report.format.writer import Writer
from wheelplane.report.html.results import headline
from wheelplane.report.json.measurement import to_json
from wheelplane.report.json.stored import read_measurement
from wheelplane.report.tables.conformity import limits_table
from wheelplane.report.text.conformity import conformity_text

POINTS = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
WIDE = {"lower_deg": -20.0, "upper_deg": 20.0}
AXLE = {"toe": WIDE, "camber": WIDE}
LIMITS = {"rear": AXLE, "front": AXLE, "vehicle": {"thrust_angle": WIDE}}
OTHER_SIDE = {"RR": "RL", "RL": "RR", "FR": "FL", "FL": "FR"}
OTHER_END = {"RR": "FR", "FR": "RR", "RL": "FL", "FL": "RL"}
FLOOR_M = -0.3  # below the wheel centres


def scene(names=None, moved=None, trials=(), flip=(1.0, 1.0, 1.0), floor=False):
    """Measure a car that stands upright in z, whose wheels may have others' names.

    moved: shift of a wheel's centre. trials: name, wheel it is named for, shift from RR. flip:
    signs of the axes of the scans.
    """
    made, flip = Scene(seed=1, noise=0.0), np.array(flip)
    made.R, made.shift = Rotation.from_euler("z", 40.0, degrees=True), np.zeros(3)
    looks = [(wheel, "reference", wheel, wheel, (moved or {}).get(wheel, 0.0)) for wheel in PLACES]
    looks += [(name, "trial", "RR", named, shift) for name, named, shift in trials]
    for name, role, at, wheel, shift in looks:
        at = (names or {}).get(at, at)
        centre, normal = np.array(PLACES[at]) + shift, facing(at, 0.002, -0.01)
        made.look(name, role, wheel, flip * centre, flip * normal)
    if floor:
        across = np.arange(-0.7, 0.71, 0.05)
        for index, one in enumerate(made.seen[:4]):
            x, y = np.meshgrid(across, across)
            place = np.array(PLACES[one.wheel])
            level = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, FLOOR_M - place[2])])
            points = made.R.apply(flip * (level + place))
            made.seen[index] = replace(one, cloud=cloud_sample(points))
    return made


def measured(made, stated=()):
    return align(made.seen, NOWHERE, (), find_verticals(stated, "wheels", "test"))


@cache
def sound():
    return measured(scene(trials=[("1", "RR", 0.01)]))


def judged(measurement):
    return assess(measurement, Tolerance.model_validate(LIMITS))


def undecided(measurement):
    """Subjects of the verdicts that are not conforming; none is nonconforming."""
    found = judged(measurement).verdicts
    assert {verdict.decision for verdict in found} <= {"conform", "undecided"}
    return {verdict.quantity.subject for verdict in found if verdict.decision == "undecided"}


EVERYTHING = {*PLACES, "1", "vehicle"}
TRIAL = [("1", "RR", 0.01)]


def test_a_vehicle_whose_wheels_are_where_they_are_named_is_decided():
    assert sound().doubts == ()
    assert undecided(sound()) == set()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"names": OTHER_SIDE}, "left and right, or front and rear, are exchanged"),
        ({"names": OTHER_END}, "left and right, or front and rear, are exchanged"),
        ({"flip": (1, -1, 1)}, "opposite to z (-1.00)"),
        ({"moved": {"FL": [0.0, 1.1 * TRACKS * 2.0, 0.0]}}, "tracks of"),
        ({"moved": {"FL": [1.1 * WHEELBASES * 2.65 / (1.0 - WHEELBASES), 0.0, 0.0]}}, "wheelbases"),
        ({"moved": {"FR": [0.0, 0.0, 0.5]}}, "inclined by 18."),
        ({"moved": {"RL": [0.0, 0.0, -0.5]}}, "m over its track"),
    ],
)
def test_no_verdict_rests_on_a_vehicle_in_doubt(change, says):
    found = measured(scene(trials=TRIAL, **change))
    assert len(found.doubts) == 1
    assert says in found.doubts[0]
    assert undecided(found) == EVERYTHING
    for verdict in judged(found).verdicts:
        assert verdict.reason == found.doubts[0]
        assert (verdict.probability, verdict.risk) == (None, None)


def test_a_target_that_faces_along_the_car_is_refused_by_capture_and_wheel():
    """Wheels exchanged across the vehicle: the frame's rear axle runs along their planes.

    A trial that does so is not measured, and all others are.
    """
    crossed = {"RR": "FL", "FL": "RR"}
    with pytest.raises(InputError, match=r"^test: wheel RR: the normal of its plane"):
        measured(scene(names=crossed))
    made = scene(trials=TRIAL)
    trial = made.seen[-1]
    target = replace(trial.evidence.target, normal=made.R.apply([1.0, 0.0, 0.0]))
    made.seen[-1] = replace(trial, evidence=replace(trial.evidence, target=target))
    *others, last = measured(made).wheels
    assert {one.observation.status for one in others} == {"ok"}
    assert (last.observation.status, last.angles) == ("no-wheel", None)
    assert re.match(r"wheel RR: the normal of its plane .* undefined$", last.observation.reason)


@pytest.mark.parametrize("wheel", PLACES)
def test_axles_are_twisted_by_no_more_than_a_suspension_travels(wheel):
    """One wheel is raised: by a flat tyre of the other, and beyond all travel."""
    own = abs(PLACES["FR"][2] - PLACES["FL"][2])  # twist of the car itself, 15 mm
    for rise_m in (0.1, -0.1, TWIST_M - 0.02, 0.02 - TWIST_M):
        assert measured(scene(moved={wheel: [0.0, 0.0, rise_m]})).doubts == ()
    for rise_m in (TWIST_M + 0.02, -TWIST_M - 0.02, 0.5):
        found = measured(scene(moved={wheel: [0.0, 0.0, rise_m]}))
        (doubt,) = found.doubts
        angle = np.radians(float(doubt.parts["angle"]))
        assert angle == pytest.approx(np.arctan2(abs(rise_m), 1.5), abs=own / 1.5 + 0.005)
        height_m = found.frame.front_track_m * np.sin(angle)
        assert float(doubt.parts["height"]) == pytest.approx(height_m, abs=0.01)
    raised = {"FR": [0.0, 0.0, 0.5], "FL": [0.0, 0.0, 0.5]}  # both: a ramp, and no twist
    assert measured(scene(moved=raised)).doubts == ()


@pytest.mark.parametrize(
    "made",
    [
        scene(trials=TRIAL, names=OTHER_SIDE),
        scene(trials=TRIAL, flip=(1, 1, -1), floor=True),
        scene(trials=[*TRIAL, ("2", "RL", 0.012)]),
    ],
)
def test_a_stored_measurement_is_in_doubt_as_it_was_measured(made, tmp_path):
    found = measured(made)
    tree = json.loads(to_json(found, judged(found)))
    (tmp_path / "measurement.json").write_text(json.dumps(tree))
    again, verdicts = read_measurement(tmp_path / "measurement.json", "it")
    assert again.doubts == found.doubts != ()
    assert undecided(again) == undecided(found)
    assert verdicts.decision == "undecided"
    assert json.loads(to_json(again, verdicts))["doubts"] == tree["doubts"]
    portuguese = load_translations("pt")
    assert notes_in(again.doubts, portuguese) == notes_in(found.doubts, portuguese)


def test_of_a_trial_at_another_wheel_its_own_values_alone_are_undecided():
    found = measured(scene(trials=[*TRIAL, ("2", "RL", 0.012)]))
    assert [doubt.parts["trial"] for doubt in found.doubts] == ["2"]
    assert undecided(found) == {"2"}
    assert judged(found).decision == "undecided"


@pytest.mark.parametrize("named", ["RR", None])
@pytest.mark.parametrize("way", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
def test_a_trial_that_lies_at_no_wheel_is_in_doubt(named, way):
    """Whether it is named for the nearest wheel, or none; the scene's RR is at the origin."""
    near = measured(scene(trials=[("1", named, 0.9 * FAR_M * np.array(way))]))
    assert near.doubts == ()
    for distance_m in (1.1 * FAR_M, 1.1):
        found = measured(scene(trials=[*TRIAL, ("2", named, distance_m * np.array(way))]))
        (doubt,) = found.doubts
        assert doubt.parts == {"trial": "2", "distance": f"{distance_m:.3f}", "nearest": "RR"}
        assert undecided(found) == {"2"}
    far = measured(scene(trials=[*TRIAL, ("2", "RR", 7.0 * np.array(way))]))
    assert undecided(far) == {"2"}


def with_trial(made, of, noise, rng):
    """Add trial 2: the scan `of` once more, its fit moved by this share of its noise."""
    first = next(one for one in made.seen if one.name == of)
    target = first.evidence.target
    factor = np.hstack([one.factor for one in target.components])
    moved = noise * factor @ rng.normal(size=factor.shape[1])
    normal = target.normal + moved[:3]
    sign = rng.choice([-1.0, 1.0]) if noise else 1.0
    near = replace(
        target,
        normal=sign * normal / np.linalg.norm(normal),
        centre_m=target.centre_m + moved[3:],
    )
    again = replace(first, name="2", role="trial", sha256="another", evidence=Evidence(near))
    made.seen = [one for one in made.seen if one.name != "2"] + [again]
    return made


@pytest.mark.parametrize("of", ["RR", "1"])
def test_a_copy_of_another_scan_is_no_trial(of):
    """A copy of the reference or a trial, exported again too: digits move a fit by 3 % of u."""
    made, rng = scene(trials=TRIAL), np.random.default_rng(1)
    for noise in (0.0, 1e-6, *[0.02] * 20):
        found = measured(with_trial(made, of, noise, rng))
        assert [dict(doubt.parts) for doubt in found.doubts] == [{"trial": "2", "name": of}]
        assert undecided(found) == {"2"}


def test_a_second_scan_is_no_copy():
    """Fits that noise alone moves apart, by the root of two of one scan's, are none."""
    made, rng = scene(trials=TRIAL), np.random.default_rng(2)
    assert all(measured(with_trial(made, "RR", 2**0.5, rng)).doubts == () for _ in range(300))


def test_the_reference_scan_in_a_sweep_is_no_copy():
    made = scene()
    front = made.seen[list(PLACES).index("FL")]
    made.seen.append(replace(front, name="FL ahead", role="sweep"))
    assert measured(made).doubts == ()


def positions(role, named="FL"):
    """Three scans of the wheel FL turned about its own axis, named for a wheel."""
    made = scene()
    for index in range(3):
        at = np.array(PLACES["FL"]) + 0.001 * index
        normal = facing("FL", 0.002 + 0.01 * index, -0.01)
        made.look(f"turn {index}", role, named, at, normal)
    return made


@pytest.mark.parametrize("role", ["sweep", "runout"])
def test_a_position_that_copies_another_of_its_wheel_is_refused(role):
    """A wheel then seems not to have moved: without run-out, 64 u off at a smaller u."""
    made = positions(role)
    assert measured(made).doubts == ()
    first, last = made.seen[-3], made.seen[-1]
    made.seen[-1] = replace(first, name=last.name, turn=last.turn, sha256="another")
    with pytest.raises(InputError, match="turn 2 holds the same points as turn 0: it is a copy"):
        measured(made)


@pytest.mark.parametrize("role", ["sweep", "runout"])
def test_no_verdict_rests_on_a_sweep_or_run_out_of_another_wheel(role):
    """It moves axes and wheels, unlike a trial: FR's caster was conforming by the scans of FL."""
    found = measured(positions(role, named="FR"))
    assert [dict(doubt.parts)["scan"] for doubt in found.doubts] == ["turn 0", "turn 1", "turn 2"]
    assert {doubt.parts["nearest"] for doubt in found.doubts} == {"FL"}
    assert undecided(found) == EVERYTHING - {"1"}
    far = positions(role)
    for one in far.seen[-3:]:
        one.fitted.centre_m[2] += 1.1
    assert ["its nearest wheel" in doubt for doubt in measured(far).doubts] == [True] * 3


def test_a_value_outside_its_limits_is_undecided_too_where_it_may_be_of_another_wheel():
    limits = Tolerance.model_validate({"rear": {"toe": {"lower_deg": 10.0}}})
    assert assess(sound(), limits).decision == "not conform"
    found = measured(scene(names=OTHER_SIDE))
    assert assess(found, limits).decision == "undecided"


@pytest.mark.parametrize("flip", [(1, 1, -1), (1, -1, 1), (-1, 1, 1)])
def test_a_floor_above_the_wheel_centres_shows_mirrored_scans(flip):
    """Of z mirrored, the frame's up is z, and only the floor shows it."""
    found = measured(scene(flip=flip, floor=True))
    assert [doubt.parts["height"] for doubt in found.doubts] == ["0.30"]
    assert undecided(found) == EVERYTHING - {"1"}
    assert measured(scene(floor=True)).doubts == ()


@pytest.mark.parametrize("by", ["floor", "gravity"])
def test_where_the_vertical_is_known_z_may_point_down(by):
    turned = (1, -1, -1)  # half a turn about x: no mirror image
    assert undecided(measured(scene(flip=turned))) == EVERYTHING - {"1"}
    stated = StatedVertical("gravity", (0.0, 0.0, -1.0), 1e-4, "gravity = [0, 0, 1]", "")
    floor = by == "floor"
    found = measured(scene(flip=turned, floor=floor), () if floor else (stated,))
    assert found.doubts == ()


SWAPPED = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])  # y and z: a mirror


def turned_to(made, axes):
    """The scans of a scene as in a file of other axes, (3, 3)."""
    for index, one in enumerate(made.seen):
        target = one.evidence.target
        moved = replace(target, normal=axes @ target.normal, centre_m=axes @ target.centre_m)
        cloud = one.cloud and cloud_sample(one.cloud.points_m @ axes.T)
        made.seen[index] = replace(one, evidence=replace(one.evidence, target=moved), cloud=cloud)
    return made


@pytest.mark.parametrize("degrees", [70.0, 90.0, 110.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_where_z_lies_across_nothing_is_decided_as_nothing_shows_a_mirror_image(degrees, mirrored):
    tilt = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    axes = tilt @ (np.diag([1.0, -1.0, 1.0]) if mirrored else np.eye(3))
    found = measured(turned_to(scene(trials=TRIAL), axes))
    (doubt,) = found.doubts
    assert "lies across the vehicle's up direction" in doubt
    up = (-1.0 if mirrored else 1.0) * np.cos(np.radians(degrees))
    assert float(doubt.parts["z"]) == pytest.approx(up, abs=0.02)
    assert undecided(found) == EVERYTHING


def test_y_and_z_exchanged_turn_every_camber_and_are_put_in_doubt():
    upright, found = measured(scene()), measured(turned_to(scene(), SWAPPED))
    for true, wrong in zip(upright.wheels, found.wheels, strict=True):
        assert wrong.angles.camber_rad == pytest.approx(-true.angles.camber_rad, abs=1e-9)
    assert [doubt.parts["z"] for doubt in found.doubts] == ["+0.00"]
    assert undecided(found) == EVERYTHING - {"1"}


@pytest.mark.parametrize("by", ["floor", "gravity", "leaning"])
def test_a_scanner_on_its_side_is_believed_where_something_checks_the_order(by):
    """The floor, gravity, or a z that is at most 60 degrees off."""
    degrees = 50.0 if by == "leaning" else 90.0
    tilt = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    up = tuple(tilt @ [0.0, 0.0, 1.0])
    stated = StatedVertical("gravity", up, 1e-4, "gravity = [0, 1, 0]", "")
    made = turned_to(scene(floor=by == "floor"), tilt)
    assert measured(made, (stated,) if by == "gravity" else ()).doubts == ()


def test_the_floor_shows_y_and_z_exchanged():
    found = measured(turned_to(scene(floor=True), SWAPPED))
    assert ["above the wheel centres" in doubt for doubt in found.doubts] == [True]


@pytest.mark.parametrize(
    ("language", "says"),
    [("en", "In doubt: Trial 2 is named for"), ("pt", "Em dúvida: O ensaio 2 tem o nome de")],
)
def test_reports_and_result_show_the_reason(language, says):
    words = load_translations(language)
    found = measured(scene(trials=[*TRIAL, ("2", "RL", 0.012)]))
    conformity, note = judged(found), found.doubts[0]
    text = conformity_text(conformity)
    assert text.count(note) == 1
    assert "at once: not known, since some are in doubt" in text
    assert any(line.startswith(says) for line in headline(found, conformity, words).says)
    table = limits_table(conformity, Writer(words, PAPER))
    rows = [row for row in table.rows if row[-1] == words("verdict.in_doubt")]
    assert len(rows) == len(AXLE)
    tree = json.loads(to_json(found, conformity))
    assert tree["doubts"] == [{"trial": "2", "note": note}]
    reasons = {one["name"]: one["reason"] for one in tree["conformity"]}
    assert reasons["2"] == note
    assert reasons["1"] == ""
    assert json.loads(to_json(sound()))["doubts"] == []


def test_blocks_of_left_and_right_exchanged_do_not_pass(tmp_path):
    """The paper's file, whose z points up: the command exits with 0, exchanged with 1."""
    blocks = np.array_split(POINTS.read_text().split(), 8)
    limits = tmp_path / "wide.toml"
    table = "lower_deg = -20.0\nupper_deg = 20.0\n"
    limits.write_text(
        "".join(f"[{a}.{k}]\n{table}" for a in ("rear", "front") for k in ("toe", "camber"))
    )
    for order, code in (((0, 1, 2, 3), 0), ((1, 0, 3, 2), 1)):
        file = tmp_path / "points.txt"
        file.write_text("".join(f"{line}\n" for i in order for line in blocks[i]))
        run = call("five-point", file, "--tolerance", limits)
        assert run.returncode == code
        assert ("Verdict: UNDECIDED" in run.stdout) == bool(code)
        assert ("In doubt: The frame's up points against z" in run.stdout) == bool(code)


def test_a_doubt_is_about_its_trial_or_about_all():
    assert Doubt("a note").is_about("RR")
    assert Doubt("Trial {trial}", trial="1").is_about("1")
    assert not Doubt("Trial {trial}", trial="1").is_about("vehicle")


@pytest.mark.parametrize("decimals", [9, 5])
def test_a_block_of_five_points_given_once_more_is_no_trial(decimals):
    """Rounded to 0.01 mm, too; one that was measured again is none."""
    blocks_m = read_five_point(POINTS).blocks_m
    rng = np.random.default_rng(3)
    again = blocks_m[0] + 3e-4 * rng.normal(size=(5, 3))
    for block, copied in ((np.round(blocks_m[0], decimals), True), (again, False)):
        points = np.concatenate([blocks_m[:4], block[None]])
        found = measure_five_point(FivePointFile(points, "five.txt", "", ()))
        doubts = [dict(doubt.parts) for doubt in found.doubts]
        assert doubts == [{"trial": "1", "name": "RR"}] * copied
