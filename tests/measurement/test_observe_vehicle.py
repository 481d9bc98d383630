"""One cloud of a whole vehicle: it measures as four scans of its wheels do, or says why not."""

from __future__ import annotations

import gc
import gzip
import json
import math
import re
import shutil
import weakref
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.support.native_files import E57Scan, pose, write_e57, xyz
from tests.support.scenes import rotation
from tests.support.validation_cars import write_capture
from wheelplane.capture.open_capture import NO_OPTIONS, CaptureOptions, open_capture
from wheelplane.cli import cli
from wheelplane.config import Config
from wheelplane.errors import InputError, NotMeasuredError, WheelplaneError
from wheelplane.measure import fit_target, measure_capture
from wheelplane.measurement import observe_vehicle as observe_cloud
from wheelplane.readers import read_scan
from wheelplane.report.json.measurement import to_json
from wheelplane.report.text.report import detailed_report
from wheelplane.vehicle.frame import REFERENCE_WHEELS
from wheelplane_synth.output.files import ply
from wheelplane_synth.output.whole import write_whole

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
FLOOR_M = 0.31
ARCSEC = math.pi / 648_000
SAME_RAD = 0.1 * ARCSEC  # of the same points, in another order, file or place
# The face is found elsewhere by a little in a cloud than in a scan, so that up to a 25th of its
# points change at the margins: by sqrt(1 / 25) of u.
ALIKE_U = 0.2


@dataclass(frozen=True)
class Bay:
    """A car's four single scans and a floor: points (N, 3) of each, in one system of coordinates.

    folder: the four as a capture of single scans, with truth.json and five-point.txt.
    """

    folder: Path
    scans: tuple[np.ndarray, ...]
    floor: np.ndarray
    truth: dict

    @property
    def forward(self):
        return np.array(self.truth["frame"]["forward"])

    @property
    def left(self):
        return np.array(self.truth["frame"]["left"])

    @property
    def cloud(self):
        return np.concatenate([*self.scans, self.floor])

    @property
    def front(self):
        return ",".join(f"{x:.3f}" for x in self.forward)


@pytest.fixture(scope="module")
def bay(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bay") / "wheels"
    write_capture(folder, 3, trials=0)
    declaration = folder / "capture.toml"
    sharp = declaration.read_text().replace("diameter = 0.25", "diameter = 0.25\nchamfer = 0.0")
    declaration.write_text(sharp)
    truth = json.loads((folder / "truth.json").read_text())
    frame = {name: np.array(truth["frame"][name]) for name in ("origin_m", "left", "forward", "up")}
    rng = np.random.default_rng(1)
    across, along = rng.uniform(-3.0, 3.0, (60_000, 1)), rng.uniform(-2.5, 5.0, (60_000, 1))
    floor = frame["origin_m"] + across * frame["left"] + along * frame["forward"]
    floor += rng.normal(0.0, 1e-3, floor.shape) - FLOOR_M * frame["up"]
    scans = tuple(read_scan(folder / f"{w.lower()}.ply").points_m for w in REFERENCE_WHEELS)
    return Bay(folder, scans, floor, truth)


def write(path, points, unit_m=1.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(ply(points / unit_m, np.ones(len(points), np.float32)))
    return path


def measured(source, stated=NO_OPTIONS, target="disc-250", **options):
    with open_capture(source, target, stated) as capture:
        return measure_capture(capture, Config(), **options)


@pytest.fixture(scope="module")
def single(bay):
    return measured(bay.folder)


@pytest.fixture(scope="module")
def vehicle(bay, tmp_path_factory):
    """The file of the cloud, alone in its folder."""
    return write(tmp_path_factory.mktemp("whole") / "vehicle.ply", bay.cloud)


@pytest.fixture(scope="module")
def whole(bay, vehicle):
    return measured(vehicle, CaptureOptions(front=tuple(bay.forward)))


def angles(measurement):
    found = [wheel.angles for wheel in measurement.wheels]
    return np.array([[a.toe_rad, a.camber_rad] for a in found])


def names(measurement):
    return tuple(wheel.observation.name for wheel in measurement.wheels)


def run(*arguments):
    """Exit code 2 and its one line, or the code and what was printed."""
    done = CliRunner().invoke(cli, [str(a) for a in arguments], standalone_mode=False)
    if isinstance(done.exception, WheelplaneError):
        text = str(done.exception)
        assert "\n" not in text
        return 2, text
    if done.exception is not None:
        raise done.exception
    return done.return_value, done.output


def refused(*arguments):
    code, text = run(*arguments)
    assert code == 2
    return text


def test_a_cloud_measures_as_the_scans_it_is_made_of(bay, single, whole):
    assert names(whole) == REFERENCE_WHEELS
    u = np.array([[w.u_toe_rad, w.u_camber_rad] for w in whole.wheels])
    assert np.all(np.abs(angles(whole) - angles(single)) < ALIKE_U * u)
    true = np.radians([[w["toe_deg"], w["camber_deg"]] for w in bay.truth["wheels"]])
    assert np.abs(angles(whole) - true).max() < 4.0 * u.max()
    assert np.abs(true).max() > 20.0 * u.max()  # zero angles would not do
    for result, points in zip(whole.wheels, bay.scans, strict=True):
        seen = result.observation
        assert (seen.role, seen.wheel, seen.source) == ("reference", seen.name, "vehicle.ply")
        assert seen.points_total == len(bay.cloud) > len(points)


def test_in_any_order_of_points_and_at_any_place(bay, whole, tmp_path):
    rng = np.random.default_rng(0)
    points = rng.permutation(bay.cloud + rng.uniform(-500.0, 500.0, 3))
    found = measured(write(tmp_path / "any.ply", points), CaptureOptions(front=tuple(bay.forward)))
    np.testing.assert_allclose(angles(found), angles(whole), rtol=0, atol=SAME_RAD)


@pytest.mark.parametrize("seed", range(2))
def test_in_coordinates_turned_anyhow(seed, bay, whole, tmp_path):
    """Points are counted in, and cells of the edges, along axes that turn: within u it is alike."""
    R = rotation(np.random.default_rng(seed))
    source = write(tmp_path / "any.ply", bay.cloud @ R.T)
    found = measured(source, CaptureOptions(front=tuple(R @ bay.forward), up="floor"))
    assert names(found) == REFERENCE_WHEELS
    u = [[wheel.u_toe_rad, wheel.u_camber_rad] for wheel in whole.wheels]
    assert np.all(np.abs(angles(found) - angles(whole)) < u)


def test_the_other_end_as_front_names_all_wheels_anew(bay, vehicle, whole):
    turned = measured(vehicle, CaptureOptions(front=tuple(-bay.forward)))
    centres = {w.observation.name: w.observation.fitted.centre_m for w in whole.wheels}
    for result, was in zip(turned.wheels, ("FL", "FR", "RL", "RR"), strict=True):
        np.testing.assert_allclose(result.observation.fitted.centre_m, centres[was], atol=1e-9)


def quaternion(R):
    """(w, x, y, z) of a rotation by less than half a turn."""
    w = math.sqrt(1.0 + np.trace(R)) / 2.0
    return (w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w)))


def posed(points, name, seed):
    """One scan of an E57, in coordinates of its own."""
    rng = np.random.default_rng(seed)
    R = np.eye(3)
    while np.trace(R) > 2.9 or np.trace(R) < 0.0:
        R = rotation(rng)
    t = rng.uniform(-3.0, 3.0, 3)
    return E57Scan(xyz((points - t) @ R), name, pose(quaternion(R), tuple(t)))


def test_an_e57_of_posed_scans_says_which_scan_shows_which_wheel(bay, whole, tmp_path):
    rear, front = np.concatenate(bay.scans[:2]), np.concatenate([*bay.scans[2:], bay.floor])
    scans = [posed(rear, "Scan 1", 0), posed(np.zeros((0, 3)), "empty", 1)]
    path = write_e57(tmp_path / "v.e57", *scans, posed(front, "Scan 2", 2))
    found = measured(path, CaptureOptions(front=tuple(bay.forward)))
    # Each face has its background from its own scan; the floor is in one of them alone.
    u = np.array([[w.u_toe_rad, w.u_camber_rad] for w in whole.wheels])
    assert np.all(np.abs(angles(found) - angles(whole)) < ALIKE_U * u)
    sources = [wheel.observation.source for wheel in found.wheels]
    assert sources == ["v.e57: Scan 1", "v.e57: Scan 1", "v.e57: Scan 2", "v.e57: Scan 2"]
    assert list(found.provenance.inputs) == ["v.e57"]
    assert [w["file"] for w in json.loads(to_json(found))["wheels"]] == sources


@pytest.mark.parametrize("kind", ["gz", "zip", "folder", "toml"])
def test_packed_or_in_a_folder_or_declared_it_is_the_same(kind, bay, vehicle, whole, tmp_path):
    stated, target = CaptureOptions(front=tuple(bay.forward)), "disc-250"
    source = tmp_path / f"vehicle.ply.{kind}"
    if kind == "gz":
        source.write_bytes(gzip.compress(vehicle.read_bytes(), 1))
    elif kind == "zip":
        with zipfile.ZipFile(source, "w") as archive:
            archive.write(vehicle, "vehicle.ply")
    elif kind == "folder":
        source = vehicle.parent
    else:
        source = write(tmp_path / "c" / "vehicle.ply", bay.cloud, 1e-3).parent
        way = [round(x, 2) for x in bay.forward.tolist()]
        (source / "capture.toml").write_text(
            f'length_unit = "mm"\ntarget = "disc-250"\nfront = {way}\n'
        )
        stated, target = NO_OPTIONS, None
    found = measured(source, stated, target)
    np.testing.assert_allclose(angles(found), angles(whole), rtol=0, atol=SAME_RAD)


def test_the_result_says_how_the_wheels_were_named(bay, vehicle, tmp_path):
    code, out = run("measure", vehicle, "--target", "disc-250", "--front", bay.front, "--json")
    tree = json.loads(out)
    assert code == 0
    naming = tree["provenance"]["naming"]
    assert naming["front"] == f"--front {','.join(f'{float(x):g}' for x in bay.front.split(','))}"
    assert naming["up"].startswith("the floor, 0.31 m below the wheels' centres, and the z axis, ")
    assert tree["notes"][0] == (
        f"Wheels named by the geometry; front: {naming['front']}; up: {naming['up']}."
    )
    assert list(tree["provenance"]["inputs"]) == ["vehicle.ply"]
    again = run("measure", vehicle, "--target", "disc-250", "--front", bay.front, "--json")[1]
    assert again == out
    _, text = run(
        *("measure", vehicle.parent, "--target", "disc-250", "--no-pictures"),
        *("--front", bay.front, "-o", tmp_path / "out"),
    )
    report = (tmp_path / "out" / "report.txt").read_text()
    for shown in (text, report):
        assert tree["notes"][0] in shown
    assert f"Points read (pontos lidos): {len(bay.cloud)} in 4 planes." in report


def test_a_capture_of_single_scans_names_nothing(single):
    assert single.provenance.naming is None
    assert json.loads(to_json(single))["provenance"]["naming"] is None
    assert "named by" not in detailed_report(single)


def test_like_targets_elsewhere_are_reported_and_left_out(bay, whole, tmp_path):
    """A fifth target leans on the wall, 4 m to the left of the front left wheel."""
    aside = bay.scans[3] + 4.0 * bay.left
    found = measured(
        write(tmp_path / "v.ply", np.concatenate([bay.cloud, aside])),
        CaptureOptions(front=tuple(bay.forward)),
    )
    np.testing.assert_allclose(angles(found), angles(whole), rtol=0, atol=SAME_RAD)
    place = whole.wheels[3].observation.fitted.centre_m + 4.0 * bay.left
    note = found.notes[1]
    assert note.startswith("Like the target, but at none of the vehicle's wheels: at (")
    stated = [float(x) for x in note.split("(")[1].split(")")[0].split(",")]
    np.testing.assert_allclose(stated, place, atol=0.005)


def test_the_cloud_is_let_go_before_the_fits(bay, vehicle, monkeypatch):
    """Its array, and with it most of the memory, is gone when the first target is fitted."""
    held = []

    def watched(*arguments, **options):
        scan = read_scan(*arguments, **options)
        held.append(weakref.ref(scan.points_m))
        return scan

    def fit(patch, target, config):
        gc.collect()
        assert held[0]() is None
        assert all(part.base is None or part.base.size < 2 * part.size for part in [patch.face_m])
        return fit_target(patch, target, config)

    monkeypatch.setattr("wheelplane.capture.entry.read_scan", watched)
    measured(vehicle, CaptureOptions(front=tuple(bay.forward)), fit=fit)
    assert len(held) == 1


def test_progress_is_reported_as_often_as_it_says(bay, vehicle):
    stated = []
    with open_capture(vehicle, "disc-250", CaptureOptions(front=tuple(bay.forward))) as capture:
        measure_capture(capture, Config(), stated.append)
        assert len(stated) == capture.steps
    works = ["reading", "searching", *REFERENCE_WHEELS]
    assert stated == [f"vehicle.ply: {work}" for work in works]


def test_a_face_that_cannot_be_fitted_is_named_with_its_place(bay, vehicle, whole):
    place = whole.wheels[2].observation.fitted.centre_m

    def fit(patch, target, config):
        if np.linalg.norm(patch.origin_m - place) < 0.05:
            raise NotMeasuredError("wrong-outline", "its outline is bent")
        return fit_target(patch, target, config)

    with pytest.raises(InputError) as caught:
        measured(vehicle, CaptureOptions(front=tuple(bay.forward)), fit=fit)
    text = str(caught.value)
    assert text.startswith(f"{vehicle}: the target of FR, at (")
    assert "was not measured (wrong-outline): its outline is bent: " in text
    assert f"{place[0]:.1f}" in text


def with_markers(bay, stated):
    """A fit that reads from a face's place which wheel its markers name, by the true one."""
    centres = {w["name"]: np.array(w["centre_m"]) for w in bay.truth["wheels"]}

    def fit(patch, target, config):
        seen = fit_target(patch, target, config)
        true = min(centres, key=lambda name: np.linalg.norm(centres[name] - patch.origin_m))
        return replace(seen, target=replace(seen.target, wheel=stated.get(true)))

    return fit


@pytest.mark.parametrize("stated", [{"FL": "FL"}, {"RR": "RR", "FR": "FR"}])
def test_markers_tell_the_front(stated, bay, vehicle, whole, monkeypatch):
    monkeypatch.setattr(observe_cloud, "names_wheels", lambda _: True)
    found = measured(vehicle, fit=with_markers(bay, stated))
    np.testing.assert_allclose(angles(found), angles(whole), rtol=0, atol=SAME_RAD)
    assert "front: the markers of the boards" in found.notes[0]


def test_markers_that_contradict_the_front_stop_it(bay, vehicle):
    stated = {"FL": "FL", "RL": "RL"}
    way = CaptureOptions(front=tuple(-bay.forward))
    with pytest.raises(InputError, match=r"vehicle\.ply: by their markers, .* which contradicts"):
        measured(vehicle, way, fit=with_markers(bay, stated))


def test_markers_of_single_scans_must_not_contradict_their_names(bay, single, tmp_path):
    found = measured(bay.folder, fit=with_markers(bay, {"RL": "RL", "FR": "FR"}))
    np.testing.assert_array_equal(angles(found), angles(single))
    with pytest.raises(
        InputError, match=r"rl\.ply: it is named for RL, but .* those of FL: correct"
    ):
        measured(bay.folder, fit=with_markers(bay, {"RL": "FL"}))
    source = shutil.copytree(bay.folder, tmp_path / "c")
    (source / "capture.toml").unlink()
    shutil.copy(source / "fl.ply", source / "trial-1.ply")
    trial = measured(source, fit=with_markers(bay, {"FL": "FL"})).wheels[4]
    assert (trial.observation.name, trial.wheel) == ("1", "FL")


def test_no_front_is_asked_for_with_the_two_that_may_be_meant(bay, vehicle):
    text = refused("measure", vehicle, "--target", "disc-250")
    assert text.startswith(f"{vehicle}: the front of the vehicle is unknown: add --front ")
    offered = [way.split(",")[:3] for way in text.split("--front ")[1:]]
    for way in offered:
        option = ",".join(x.split(" ")[0] for x in way)
        assert run("measure", vehicle, "--target", "disc-250", "--front", option)[0] == 0
    cosines = [
        float(np.array([float(x.split(" ")[0]) for x in way]) @ bay.forward) for way in offered
    ]
    assert sorted(np.round(cosines, 1)) == [-1.0, 1.0]


def test_front_by_a_point_in_the_unit_of_the_file(bay, whole, tmp_path):
    path = write(tmp_path / "mm.ply", bay.cloud, 1e-3)
    nose = np.array(bay.truth["frame"]["origin_m"]) + 3.6 * bay.forward
    point = ",".join(f"{1e3 * x:.0f}" for x in nose)
    code, out = run(
        *("measure", path, "--target", "disc-250", "--length-unit", "mm"),
        *("--front-point", point, "--json"),
    )
    assert code == 0
    toes = [math.radians(wheel["toe_deg"]) for wheel in json.loads(out)["wheels"]]
    np.testing.assert_allclose(toes, angles(whole)[:, 0], rtol=0, atol=SAME_RAD)
    assert "lies" in refused(
        *("measure", path, "--target", "disc-250", "--length-unit", "mm"),
        *("--front-point", ",".join(f"{x:.3f}" for x in nose)),
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--front", "1,0"), "--front 1,0: three numbers X,Y,Z are needed"),
        (("--front", "1,0,x"), "--front 1,0,x: three numbers"),
        (("--front", "1,0,nan"), "--front 1,0,nan: three numbers"),
        (("--front", "0,0,0"), "--front 0,0,0: has no length"),
        (("--front-point", "1;0;0"), "--front-point 1;0;0: three numbers"),
        (("--front", "1,0,0", "--front-point", "1,0,0"), "both give the front"),
    ],
)
@pytest.mark.parametrize("command", [("measure",), ("validate", "--virtual")])
def test_a_front_that_is_none_is_refused_in_one_line(command, options, says, vehicle):
    assert says in refused(command[0], vehicle, *command[1:], "--target", "disc-250", *options)


def test_a_front_across_the_car_is_refused(bay, vehicle):
    way = ",".join(f"{x:.3f}" for x in bay.left)
    text = refused("measure", vehicle, "--target", "disc-250", "--front", way)
    assert text.startswith(f"{vehicle}: --front ")
    assert "it runs 90° off the line through the centres of the axles" in text


def test_two_vehicles_in_one_cloud_are_refused(bay, tmp_path):
    path = write(tmp_path / "v.ply", np.concatenate([bay.cloud, bay.cloud + 4.0 * bay.left]))
    text = refused("measure", path, "--target", "disc-250", "--front", bay.front)
    assert text.startswith(f"{path}: 8 targets found, on 2 vehicles (targets ")
    assert text.endswith("or crop the cloud to one vehicle")


def test_three_targets_are_refused_and_listed(bay, tmp_path):
    path = write(tmp_path / "v.ply", np.concatenate([*bay.scans[:3], bay.floor]))
    text = refused("measure", path, "--target", "disc-250", "--front", bay.front)
    assert text.startswith(f"{path}: 3 targets found, four are needed: target 1 at (")
    listed = [[float(x) for x in part.split(")")[0].split(",")] for part in text.split(" at (")[1:]]
    for wheel in bay.truth["wheels"][:3]:
        assert np.linalg.norm(np.array(listed) - wheel["centre_m"], axis=1).min() < 0.01
    bare = write(tmp_path / "floor.ply", bay.floor)
    assert "no target found, four are needed: none" in refused(
        "measure", bare, "--target", "disc-250", "--front", bay.front
    )


def test_a_target_shown_twice_by_scans_that_are_not_registered_is_refused(bay, tmp_path):
    twice = bay.scans[1] + 0.2 * bay.left
    path = write(tmp_path / "v.ply", np.concatenate([bay.cloud, twice]))
    text = refused("measure", path, "--target", "disc-250", "--front", bay.front)
    assert "mm apart, so one target is seen twice" in text
    assert text.endswith("register the scans of the file again")


def test_the_wrong_unit_is_refused_with_the_right_one(bay, vehicle, tmp_path):
    common = ("--target", "disc-250", "--front", bay.front)
    text = refused("measure", vehicle, *common, "--length-unit", "mm")
    assert text.startswith(f"{vehicle}: the cloud is ")
    assert "if the file is in m, it is 7." in text
    assert text.endswith('give --length-unit m, or length_unit = "m" in a capture.toml')
    path = write(tmp_path / "mm.ply", bay.cloud, 1e-3)
    assert "--length-unit mm" in refused("measure", path, *common)


def test_no_target_is_asked_for(bay, vehicle):
    text = refused("measure", vehicle, "--front", bay.front)
    assert text == f"{vehicle}: no target is named: add --target, for example --target disc-250"


def test_a_file_that_is_no_cloud_is_refused_as_everywhere(bay, tmp_path):
    path = tmp_path / "v.ply"
    path.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\n")
    assert refused("measure", path, "--target", "disc-250", "--front", "1,0,0").startswith(
        f"{path}: "
    )


def test_front_is_refused_where_each_wheel_has_its_scan(bay):
    for command in (("measure",), ("validate", "--virtual")):
        text = refused(command[0], bay.folder, *command[1:], "--front", bay.front)
        assert text.startswith(f"{bay.folder}: --front is for a cloud of the whole vehicle")


def test_z_down_is_reported_from_the_floor(bay, tmp_path):
    flip = np.diag([1.0, -1.0, -1.0])
    path = write(tmp_path / "v.ply", bay.cloud @ flip)
    way = ",".join(f"{x:.3f}" for x in flip @ bay.forward)
    common = ("measure", path, "--target", "disc-250", "--front", way)
    assert "lies on the side to which z points: give --up floor" in refused(*common)
    assert run(*common, "--up", "floor")[0] == 0


@pytest.fixture(scope="module")
def declared(bay, tmp_path_factory):
    """A folder of the cloud with its capture.toml, truth.json and five-point.txt."""
    folder = write(tmp_path_factory.mktemp("declared") / "car" / "vehicle.ply", bay.cloud).parent
    for name in ("truth.json", "five-point.txt"):
        shutil.copy(bay.folder / name, folder)
    way = bay.forward.tolist()
    disc = '{ shape = "disc", diameter = 0.25, thickness = 0.01, chamfer = 0.0 }'
    (folder / "capture.toml").write_text(f"target = {disc}\nfront = {way}\n")
    return folder


@pytest.mark.parametrize(
    "against", [("--virtual",), ("--truth",), ("--five-point", "five-point.txt")], ids=str
)
def test_validate_compares_a_whole_vehicle_as_four_scans(against, bay, declared, monkeypatch):
    trees = []
    for source in (bay.folder, declared):
        monkeypatch.chdir(source)
        code, out = run("validate", source, *against, "--json")
        assert code in (0, 1)
        trees.append(json.loads(out))
    single, whole = trees
    assert whole["missing"] == []
    for one, other in zip(single["angles"], whole["angles"], strict=True):
        assert [one[key] for key in ("name", "wheel", "angle")] == [
            other[key] for key in ("name", "wheel", "angle")
        ]
        assert abs(one["first_deg"] - other["first_deg"]) < ALIKE_U * one["u_first_deg"]
        assert abs(other["difference_deg"]) < 4.5 * other["u_deg"]
        if against != ("--virtual",):  # whose five points are picked from those of the scans
            assert other["second_deg"] == pytest.approx(one["second_deg"], abs=1e-12)


def test_an_archive_finds_whole_vehicles_and_tells_of_bare_clouds(bay, declared, vehicle, tmp_path):
    shutil.copytree(declared, tmp_path / "a")
    shutil.copytree(bay.folder, tmp_path / "b")
    shutil.copy(vehicle, tmp_path / "bare.ply")
    shutil.copy(vehicle, tmp_path / "other.ply")
    code, out = run("validate", tmp_path, "--truth", "--json")
    assert code == 1
    rows = out
    for name in ("a", "b", "bare.ply", "other.ply"):
        assert f'"{name}"' in rows
    assert rows.count("a cloud without a folder, which may show a whole vehicle or one wheel") == 2


def test_validate_does_not_guess_what_a_folder_is(declared, vehicle, tmp_path):
    shutil.copytree(declared, tmp_path / "a")
    shutil.copy(vehicle, tmp_path / "bare.ply")
    text = refused("validate", tmp_path, "--truth")
    assert "holds the cloud bare.ply and 1 folders or archives" in text
    (tmp_path / "bare.ply").unlink()
    assert "front_point and up in the capture.toml of each" in refused(
        "validate", tmp_path, "--truth", "--front", "1,0,0"
    )


@pytest.mark.slow
@pytest.mark.slow
def test_a_made_vehicle_in_its_bay_whose_boards_tell_its_front(tmp_path):
    """With body, floor, walls, a lift, people; the E57 tells which station saw which wheel."""
    text = (CONFIGS / "scanners" / "default.toml").read_text()
    text = re.sub(r"window_deg = .*", "window_deg = 120.0", text)
    text = re.sub(r"lowest_deg = .*", "lowest_deg = -40.0", text)
    (tmp_path / "narrow.toml").write_text(re.sub(r"highest_deg = .*", "highest_deg = 0.0", text))
    truth = write_whole(
        tmp_path / "car",
        seed=5,
        vehicle=CONFIGS / "vehicles" / "saloon.toml",
        scanner=tmp_path / "narrow.toml",
        target=CONFIGS / "targets" / "pattern-aruco.toml",
        form="e57",
        points=1_200_000,
    ).to_json()
    found = measured(tmp_path / "car", target="pattern-aruco")
    assert "front: the markers of the boards; up: the floor, 0.3" in found.notes[0]
    for result, wheel in zip(found.wheels, truth["wheels"], strict=True):
        assert result.observation.name == wheel["name"]
        off_m = result.observation.fitted.centre_m - wheel["centre_m"]
        assert np.linalg.norm(off_m) < 0.005
        errors = [result.angles.toe_rad, result.angles.camber_rad] - np.radians(
            [wheel["toe_deg"], wheel["camber_deg"]]
        )
        assert np.all(np.abs(errors) < 4.0 * np.array([result.u_toe_rad, result.u_camber_rad]))
    sources = [result.observation.source for result in found.wheels]
    assert len(set(sources)) == 4  # from each wheel's own corner
    assert all(source.startswith("vehicle.e57: ") for source in sources)


@pytest.mark.slow
def test_inspect_and_plane_describe_the_cloud(bay, vehicle, declared):
    for source, name in ((vehicle, str(vehicle)), (declared, f"{declared}: vehicle.ply")):
        code, out = run("inspect", source)
        assert code == 0
        assert out.startswith(f"{name}: PLY, ")
        assert str(len(bay.cloud)) in out
        tree = json.loads(run("inspect", source, "--json")[1])
        assert (tree["file"], tree["points"]) == (name, len(bay.cloud))
    code, out = run("plane", vehicle, "--max-planes", 1, "--json")
    assert code == 0
    up = np.array(json.loads(out)["planes"][0]["normal"])  # the floor is the largest
    assert abs(up @ bay.truth["frame"]["up"]) > math.cos(math.radians(0.1))
