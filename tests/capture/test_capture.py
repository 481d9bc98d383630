"""Which scan shows which wheel: folders, archives, capture.toml, and every way to get it wrong."""

from __future__ import annotations

import io
import json
import os
import tarfile
import zipfile
from pathlib import Path

import pytest

from wheelplane.capture.front import Front
from wheelplane.capture.open_capture import NO_OPTIONS, Capture, CaptureOptions, open_capture
from wheelplane.errors import ConfigError, InputError, WheelplaneError
from wheelplane.units import LENGTH_UNITS, in_metres

WHEELS = ("RR", "RL", "FR", "FL")
REFERENCE = "[reference]\n" + "".join(f'{w} = "{w.lower()}.ply"\n' for w in WHEELS)
DISC = 'target = "disc-250"\n'
TABLE = '[target]\nshape = "disc"\ndiameter = {}\n'


def fill(folder: Path, toml: str | bytes | None = None, files: tuple[str, ...] = ()) -> Path:
    """A folder of empty scans: opening a capture looks for them, and reads none."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in files or [f"{wheel.lower()}.ply" for wheel in WHEELS]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(name.encode())
    if toml is not None:
        data = toml.encode() if isinstance(toml, str) else toml
        (folder / "capture.toml").write_bytes(data)
    return folder


def refusal(source: Path, target: str | None = None) -> str:
    """What is said of a capture that cannot be opened: one line that names it."""
    with pytest.raises(WheelplaneError) as caught, open_capture(source, target):
        pass
    text = str(caught.value)
    assert type(caught.value) in (InputError, ConfigError)
    assert "\n" not in text
    assert text.startswith(f"{source}: ")
    return text


def entries(
    source: Path, target: str | None = "disc-250"
) -> list[tuple[str, str, str | None, str]]:
    """Name, role, wheel and file of every scan; the files are there and hold their own names."""
    with open_capture(source, target) as capture:
        for entry in capture.entries:
            assert entry.path.read_bytes() == entry.file.encode()
        return [(e.name, e.role, e.wheel, e.file) for e in capture.entries]


def test_four_clouds_with_other_names_are_not_guessed_at(tmp_path):
    files = ("a.ply", "b.ply", "c.ply", "d.ply")
    said = refusal(fill(tmp_path / "c", DISC, files))
    assert "one cloud" in said
    assert "found 4 (a.ply, b.ply, c.ply, d.ply)" in said
    assert "[reference]" in said


def test_names_of_files_fill_in_what_capture_toml_leaves_out(tmp_path):
    files = ("rr.ply", "RL.ply", "fr.ply", "fl.ply", "trial-2.ply", "trial-1.ply")
    source = fill(tmp_path / "c", 'vehicle = "AA-00-BB"\n' + DISC, files)
    plain = fill(tmp_path / "plain", None, files)
    assert entries(source, None) == entries(plain)
    with open_capture(source) as capture:
        assert (capture.vehicle, capture.vehicle_model) == ("AA-00-BB", None)
    (source / "rr.ply").unlink()
    assert "one scan rr.* is needed" in refusal(source)


def test_capture_toml_says_it_all(tmp_path):
    toml = (
        'vehicle = "AA-00-BB"\nvehicle_model = "Saloon 1.6"\nlength_unit = "mm"\n'
        + TABLE.format(250)
        + '[reference]\nFL = "a.xyz"\nFR = "b.npy"\nRL = "c.pcd"\nRR = "deep/d.ply"\n'
        + '[[trial]]\nname = "before"\nfile = "e.csv"\nwheel = "FL"\n'
        + '[[trial]]\nname = "after"\nfile = "f.txt"\n'
    )
    files = ("a.xyz", "b.npy", "c.pcd", "deep/d.ply", "e.csv", "f.txt")
    source = fill(tmp_path / "c", toml, files)
    assert entries(source, None) == [
        ("RR", "reference", "RR", "deep/d.ply"),
        ("RL", "reference", "RL", "c.pcd"),
        ("FR", "reference", "FR", "b.npy"),
        ("FL", "reference", "FL", "a.xyz"),
        ("before", "trial", "FL", "e.csv"),
        ("after", "trial", None, "f.txt"),
    ]
    with open_capture(source) as capture:
        assert (capture.source, capture.vehicle) == (str(source), "AA-00-BB")
        assert capture.vehicle_model == "Saloon 1.6"
        assert (capture.length_unit, capture.target.diameter) == ("mm", 0.25)


def test_file_names_say_it_in_any_case_and_trials_count_as_people_do(tmp_path):
    trials = ("trial-10.ply", "Trial-2.PLY", "TRIAL-a.xyz", "trial-1²2.ply")
    others = ("notes.md", "rrr.ply", "trial.ply", ".rr.ply", "trial-.ply")
    source = fill(tmp_path, None, ("RR.ply", "rl.PLY", "Fr.pcd", "fL.npy", *trials, *others))
    found = entries(source)
    assert found[:4] == [
        ("RR", "reference", "RR", "RR.ply"),
        ("RL", "reference", "RL", "rl.PLY"),
        ("FR", "reference", "FR", "Fr.pcd"),
        ("FL", "reference", "FL", "fL.npy"),
    ]
    names = [name for name, *_ in found[4:]]
    assert set(names) == {"10", "2", "a", "1²2"}
    assert {role for _, role, *_ in found[4:]} == {"trial"}
    plain = fill(tmp_path / "plain", None, ())
    for number in (10, 9, 1, 100):
        (plain / f"trial-{number}.ply").write_bytes(f"trial-{number}.ply".encode())
    assert [name for name, *_ in entries(plain)[4:]] == ["1", "9", "10", "100"]


def packed(folder: Path, kind: str, top: str = "") -> Path:
    path = folder.parent / f"capture.{kind}"
    if kind == "zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(folder.iterdir()):
                archive.write(file, top + file.name)
        return path
    with tarfile.open(path, "w:" + kind.partition(".")[2]) as tar:
        for file in sorted(folder.iterdir()):
            tar.add(file, top + file.name)
    return path


KINDS = ("zip", "tar", "tar.gz", "tar.bz2", "tar.xz")


@pytest.mark.parametrize("top", ["", "the car/"])
@pytest.mark.parametrize("kind", KINDS)
def test_an_archive_is_as_good_as_its_folder_and_leaves_nothing(kind, top, tmp_path, monkeypatch):
    folder = fill(tmp_path / "c", DISC + REFERENCE + '[[trial]]\nname = "1"\nfile = "rr2.ply"\n')
    (folder / "rr2.ply").write_bytes(b"rr2.ply")
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    archive = packed(folder, kind, top)
    assert entries(archive, None) == entries(folder, None)
    with open_capture(archive) as capture:
        assert capture.source == str(archive)
        assert list(scratch.iterdir())
    assert list(scratch.iterdir()) == []


def test_what_a_mac_adds_to_an_archive_is_not_the_capture(tmp_path):
    archive = packed(fill(tmp_path / "c", DISC + REFERENCE), "zip", "c/")
    with zipfile.ZipFile(archive, "a") as more:
        for name in (".DS_Store", "__MACOSX/c/._rr.ply", "c/._rr.ply"):
            more.writestr(name, b"x")
    assert [name for name, *_ in entries(archive, None)] == list(WHEELS)


@pytest.mark.parametrize("name", ["Capture.toml", "CAPTURE.TOML"])
def test_capture_toml_is_not_passed_over_for_its_case(name, tmp_path):
    source = fill(tmp_path, DISC + REFERENCE.replace("rr.ply", "other.ply"))
    (source / "capture.toml").rename(source / name)
    assert "other.ply is missing" in refusal(source)


@pytest.mark.parametrize(
    ("unit", "written", "metres"),
    [
        ("m", 0.25, 0.25),
        ("mm", 250, 0.25),
        ("mm", 0.25, 0.25),
        ("in", 10, 0.254),
        ("in", 0.25, 0.25),
    ],
)
def test_a_target_is_written_in_metres_or_in_the_unit_of_the_capture(
    unit, written, metres, tmp_path
):
    source = fill(tmp_path, f'length_unit = "{unit}"\n' + TABLE.format(written) + REFERENCE)
    with open_capture(source) as capture:
        assert capture.target.diameter == pytest.approx(metres, rel=1e-15)
        assert capture.target.radius_m == pytest.approx(metres / 2, rel=1e-15)
        assert capture.length_unit == unit


def test_a_diameter_that_can_be_meant_in_two_units_is_not_guessed(tmp_path):
    source = fill(tmp_path, 'length_unit = "in"\n' + TABLE.format(1.2) + REFERENCE)
    assert "1.2 may be in m or in in" in refusal(source)


def test_the_option_goes_before_the_file_and_a_file_is_sought_beside_capture_toml(tmp_path):
    (tmp_path / "plate.toml").write_text('shape = "disc"\ndiameter = 0.3\n')
    source = fill(tmp_path / "c", TABLE.format(0.2) + REFERENCE)
    for option, diameter in ((None, 0.2), ("disc-250", 0.25), (str(tmp_path / "plate.toml"), 0.3)):
        with open_capture(source, option) as capture:
            assert capture.target.diameter == diameter
    own = fill(tmp_path / "own", 'target = "plate.toml"\n' + REFERENCE)
    assert "plate.toml" in refusal(own)
    (own / "plate.toml").write_text('shape = "disc"\ndiameter = 0.4\n')
    with open_capture(own) as capture:
        assert capture.target.diameter == 0.4


def test_a_byte_order_mark_is_no_fault(tmp_path):
    source = fill(tmp_path, b"\xef\xbb\xbf" + (DISC + REFERENCE).encode())
    assert len(entries(source, None)) == 4


TRIAL = '[[trial]]\nname = "1"\nfile = "rr2.ply"\n'
NESTED = "a = " + "[" * 5000
LONG = "a" * 300


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        (DISC + REFERENCE.replace("RL =", "# RL ="), ["[reference] lacks RL"]),
        (DISC + REFERENCE + 'XR = "xr.ply"\n', ["'XR'", "RR, RL, FR, FL"]),
        (DISC + REFERENCE + TRIAL + 'wheel = "XR"\n', ["trial.0.wheel", "'RR'", "'XR'"]),
        (DISC + REFERENCE + TRIAL + 'wheell = "RR"\n', ["wheell", "did you mean 'wheel'?"]),
        (DISC + REFERENCE + '[[trial]]\nname = "1"\n', ["'trial.0.file' is missing"]),
        (DISC + REFERENCE + TRIAL.replace('"1"', '""'), ["trial.0.name"]),
        (DISC + REFERENCE + TRIAL.replace('"1"', '"RR"'), ["name 'RR' occurs twice"]),
        (DISC + REFERENCE + TRIAL.replace('"1"', '"vehicle"'), ["a trial is called 'vehicle'"]),
        (DISC + REFERENCE + TRIAL.replace("rr2", "rr"), ["file 'rr.ply' occurs twice"]),
        (DISC + REFERENCE + TRIAL.replace("rr2", "./x/../rr"), ["file 'rr.ply' occurs twice"]),
        (DISC + REFERENCE + TRIAL.replace('"1"', '"a\\nb"'), ["'a\\nb' is not plain text"]),
        (DISC + REFERENCE + TRIAL, ["the scan rr2.ply is missing"]),
        (DISC + REFERENCE.replace("rr.ply", ""), ["is missing"]),
        (DISC + REFERENCE.replace("rr.ply", LONG), ["too long"]),
        (DISC + REFERENCE.replace('"rr.ply"', "3"), ["reference.RR", "got 3"]),
        (DISC + "reference = 3\n", ["reference: a table is needed, got 3"]),
        ('date = "2026-11-03"\n' + DISC + REFERENCE, ["toml: date: a date is needed"]),
        *(
            (f"vehicle = 'x'\ndate = {no}\n" + DISC + REFERENCE, [f"date = {no} (line 2): no valid",
                                                                  "as 2026-11-03, without quotes"])
            for no in ("2026-13-45", "2026-11-3", "03.11.2026", "2026-02-30", "3/11/26")
        ),
        ('vehicel = "x"\n' + DISC + REFERENCE, ["'vehicel'", "did you mean 'vehicle'?"]),
        ("vehicle = 3\n" + DISC + REFERENCE, ["vehicle", "got 3"]),
        ('length_unit = "km"\n' + DISC + REFERENCE, ["'m', 'mm', 'in', 'cm' or 'ft'", "'km'"]),
        (REFERENCE, ["no target is named", "--target disc-250"]),
        ("target = 3\n" + REFERENCE, ["target is 3", "[target]"]),
        ('target = "disc-25O"\n' + REFERENCE, ["'disc-25O'", "did you mean 'disc-250'?"]),
        (TABLE.format(0.25).replace("disc", "disk") + REFERENCE, ["did you mean 'disc'?"]),
        ("[target]\ndiameter = 0.25\n" + REFERENCE, ["shape"]),
        (TABLE.format(0.25).replace("iameter", "iamter") + REFERENCE, ["did you mean 'diameter'"]),
        (TABLE.format(250) + REFERENCE, ["diameter", "less than 3", "250"]),
        (TABLE.format("nan") + REFERENCE, ["diameter", "finite"]),
        (TABLE.format("-0.25") + REFERENCE, ["diameter", "greater than"]),
        (TABLE.format("true") + REFERENCE, ["diameter", "got True"]),
        (TABLE.format('250\nthickness = true\nlength = "') + REFERENCE, ["not valid TOML"]),
        ("[target\n", ["not valid TOML", "line 1"]),
        (NESTED, ["not valid TOML"]),
        ("a = " + "9" * 5000, ["not valid TOML"]),
        ((DISC + REFERENCE).encode("utf-16"), ["not UTF-8 text", "save it as UTF-8"]),
        (f'vehicle = "é"\n{DISC}{REFERENCE}'.encode("latin-1"), ["not UTF-8 text"]),
    ],
)  # fmt: skip
def test_a_wrong_capture_toml_is_refused_in_one_line(toml, says, tmp_path):
    text = refusal(fill(tmp_path, toml))
    assert text.startswith(f"{tmp_path}: capture.toml: ")
    for part in says:
        assert part in text
    assert len(text) < 700


def test_a_switch_is_no_size_in_any_unit(tmp_path):
    table = TABLE.format(250) + "thickness = true\n"
    assert "thickness" in refusal(fill(tmp_path, 'length_unit = "mm"\n' + table + REFERENCE))


@pytest.mark.parametrize(
    ("files", "says"),
    [
        (("rr.ply", "rl.ply", "fr.ply"), "fl.* is needed, found none"),
        (("rr.ply", "rr.pcd", "rl.ply", "fr.ply", "fl.ply"), "found rr.pcd and rr.ply"),
        (("rr.ply", "RR.PLY", "rl.ply", "fr.ply", "fl.ply"), "found RR.PLY and rr.ply"),
        (("rr.ply", "rl.ply", "fr.ply", "fl.ply", "trial-1.ply", "trial-1.npy"), "'1' occurs"),
        (("notes.txt",), "rr.* is needed, found none"),
    ],
)  # fmt: skip
def test_file_names_that_leave_a_doubt_are_refused(files, says, tmp_path):
    assert says in refusal(fill(tmp_path, None, files), "disc-250")


def test_no_target_and_no_capture_toml_asks_for_the_option(tmp_path):
    assert "--target disc-250" in refusal(fill(tmp_path))


def test_a_name_that_is_no_text_is_refused(tmp_path):
    source = fill(tmp_path)
    try:
        (Path(os.fsdecode(os.fsencode(source) + b"/trial-\xff.ply"))).write_bytes(b"")
    except OSError:
        pytest.skip("this file system takes no such name")
    assert "not plain text" in refusal(source, "disc-250")


def test_an_unknown_option_target_is_refused_with_the_nearest(tmp_path):
    source = fill(tmp_path)
    for target, says in (("disk-250", "did you mean 'disc-250'?"), ("nope.toml", "nope.toml")):
        with (
            pytest.raises(ConfigError, match=says.replace("?", r"\?")),
            open_capture(source, target),
        ):
            pass


def test_what_is_no_capture_at_all(tmp_path):
    other = tmp_path / "photo.jpg"
    other.write_bytes(b"ply\n")
    assert "not a folder, zip or tar" in refusal(other)
    empty = tmp_path / "empty.zip"
    empty.write_bytes(b"")
    assert "an empty file" in refusal(empty)
    assert "no such file" in refusal(tmp_path / "nowhere")
    assert "too long" in refusal(tmp_path / LONG)
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in refusal(tmp_path / "pipe")
    (tmp_path / "void").mkdir()
    assert "found none" in refusal(tmp_path / "void", "disc-250")


CLOUD = 'cloud = "vehicle.e57"\n'
RUNOUT = '[[runout]]\nname = "half"\nfile = "rr2.ply"\nangle_deg = 180.0\n'
FRONT = "front = [0, -2, 0.5]\n"


def whole(
    source: Path, target: str | None = "disc-250", shown: CaptureOptions = NO_OPTIONS
) -> Capture:
    """The capture at `source`, which is one cloud that holds its own name."""
    with open_capture(source, target, shown) as capture:
        assert capture.entries == ()
        assert capture.cloud is not None
        assert (capture.cloud.role, capture.cloud.wheel) == ("vehicle", None)
        assert capture.cloud.path.read_bytes() == capture.cloud.file.encode()
        assert capture.steps == 6
        return capture


def cloud_file(capture: Capture) -> str:
    assert capture.cloud is not None
    return capture.cloud.file


@pytest.mark.parametrize(
    "name", ["vehicle.ply", "v.E57", "a.xyz.gz", "b.csv", "c.txt", "d.npz", "rr.ply", "e.laz.xz"]
)
def test_a_file_of_a_cloud_is_a_capture_of_a_whole_vehicle(name, tmp_path):
    fill(tmp_path, REFERENCE, (name, "other.ply"))  # what lies beside it does not matter
    capture = whole(tmp_path / name)
    assert cloud_file(capture) == name
    assert capture.called(capture.cloud) == str(tmp_path / name)
    assert (capture.length_unit, capture.front, capture.up) == ("m", None, "auto")
    assert "--target disc-250" in refusal(tmp_path / name)


@pytest.mark.parametrize("kind", ["folder", *KINDS])
def test_a_folder_or_archive_of_one_cloud_is_a_whole_vehicle(kind, tmp_path):
    others = ("five-point.txt", "truth.json", "points.csv", ".hidden.ply")
    folder = fill(tmp_path / "c", None, ("vehicle.ply", *others))
    source = folder if kind == "folder" else packed(folder, kind)
    capture = whole(source)
    assert cloud_file(capture) == "vehicle.ply"
    assert capture.called(capture.cloud) == f"{source}: vehicle.ply"


@pytest.mark.parametrize("kind", ["folder", "zip"])
def test_capture_toml_says_all_of_a_whole_vehicle(kind, tmp_path):
    toml = 'vehicle = "AA"\nlength_unit = "mm"\nup = "floor"\n' + CLOUD + FRONT + TABLE.format(250)
    folder = fill(tmp_path / "c", toml, ("vehicle.e57", "more.ply", "rr.ply"))
    capture = whole(folder if kind == "folder" else packed(folder, kind), None)
    assert cloud_file(capture) == "vehicle.e57"
    assert (capture.vehicle, capture.length_unit, capture.up) == ("AA", "mm", "floor")
    assert capture.target.radius_m == 0.125
    assert capture.front == Front("front 0,-2,0.5", (0.0, -2.0, 0.5))


def test_capture_toml_need_not_name_the_only_cloud(tmp_path):
    capture = whole(fill(tmp_path, DISC + FRONT, ("vehicle.ply", "notes.txt")), None)
    assert cloud_file(capture) == "vehicle.ply"
    table = fill(tmp_path / "t", DISC + 'cloud = "points.csv"\n', ("vehicle.ply", "points.csv"))
    assert cloud_file(whole(table, None)) == "points.csv"


@pytest.mark.parametrize("unit", LENGTH_UNITS)
def test_a_point_near_the_front_is_in_the_unit_of_the_file(unit, tmp_path):
    metre = 1.0 / in_metres(1.0, unit)
    point = (2.0 * metre, -3.0 * metre, 0.5 * metre)
    toml = f'length_unit = "{unit}"\nfront_point = {list(point)}\n' + DISC
    by_file = whole(fill(tmp_path / "c", toml, ("vehicle.ply",)), None)
    bare = tmp_path / "c" / "vehicle.ply"
    by_option = whole(bare, "disc-250", CaptureOptions(length_unit=unit, front_point=point))
    for capture in (by_file, by_option):
        assert capture.length_unit == unit
        assert capture.front is not None
        assert capture.front.point_m == pytest.approx((2.0, -3.0, 0.5), rel=1e-12)
        assert capture.front.direction is None


def test_options_go_before_the_file(tmp_path):
    toml = DISC + 'length_unit = "in"\nup = "z"\n' + FRONT
    source = fill(tmp_path, toml, ("vehicle.ply",))
    shown = CaptureOptions(length_unit="mm", front_point=(1000.0, 0.0, 0.0), up="floor")
    capture = whole(source, None, shown)
    assert (capture.length_unit, capture.up) == ("mm", "floor")
    assert capture.front == Front("--front-point 1000,0,0", None, (1.0, 0.0, 0.0))
    assert whole(source, None, CaptureOptions(front=(1.0, 0.0, 0.0))).front == Front(
        "--front 1,0,0", (1.0, 0.0, 0.0)
    )


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        (DISC + CLOUD + REFERENCE, ["both [reference] and cloud = 'vehicle.e57'", "keep"]),
        (DISC + CLOUD + TRIAL, ["[[trial]] without [reference]"]),
        (DISC + TRIAL.replace("trial", "sweep") + 'wheel = "FR"\n' + CLOUD, ["unknown key"]),
        (DISC + CLOUD.replace("vehicle", "missing"), ["the scan missing.e57 is missing"]),
        (DISC + CLOUD.replace("vehicle.e57", ""), ["cloud is empty: fill it in"]),
        (DISC + FRONT + REFERENCE, ["front with [reference]", "leave it out"]),
        (DISC + 'up = "auto"\n' + REFERENCE, ["up with [reference]"]),
        (DISC + CLOUD + FRONT + "front_point = [0, 0, 0]\n", ["front and front_point", "leave"]),
        (DISC + CLOUD + "front = [0, 0, 0.0]\n", ["front 0,0,0: has no length"]),
        (DISC + CLOUD + "front = [1, 2]\n", ["front.2"]),
        (DISC + CLOUD + 'front = "x"\n', ["front", "got 'x'"]),
        (DISC + CLOUD + "front = [nan, 0, 1]\n", ["front.0", "finite"]),
        (DISC + CLOUD + 'up = "y"\n', ["up", "'floor'", "got 'y'"]),
        (DISC + FRONT, ["front without cloud or [reference]", "and leave out front"]),
        (DISC + 'up = "floor"\n', ["up without cloud or [reference]", "and leave out up"]),
        (DISC + RUNOUT, ["runout without cloud or [reference]", "with the scan of each"]),
        (DISC + "cluod = 3\n", ["unknown key 'cluod'", "did you mean 'cloud'?"]),
    ],
)  # fmt: skip
def test_a_wrong_declaration_of_a_whole_vehicle_is_refused_in_one_line(toml, says, tmp_path):
    files = ("vehicle.e57", *(f"{wheel.lower()}.ply" for wheel in WHEELS), "rr2.ply")
    text = refusal(fill(tmp_path, toml, files))
    for part in says:
        assert part in text


@pytest.mark.parametrize(
    ("files", "says"),
    [
        (("a.ply", "b.ply"), "found 2 (a.ply, b.ply)"),
        (("a.ply", "a.e57", "x.txt"), "found 2 (a.e57, a.ply)"),
        (("a.ply", "rr.ply"), "rl.* is needed, found none"),
        (("notes.txt",), "rr.* is needed, found none"),
        (("points.csv",), "rr.* is needed, found none"),
    ],
)
def test_files_that_leave_a_doubt_which_is_the_cloud_are_refused(files, says, tmp_path):
    source = fill(tmp_path / "c", None, files)
    assert says in refusal(source, "disc-250")
    assert says in refusal(packed(source, "zip"), "disc-250")


@pytest.mark.parametrize(
    ("shown", "option"),
    [
        (CaptureOptions(front=(1.0, 0.0, 0.0)), "--front "),
        (CaptureOptions(front_point=(1.0, 0.0, 0.0)), "--front-point "),
        (CaptureOptions(up="z"), "--up "),
    ],
)
def test_what_tells_the_front_is_refused_where_each_wheel_has_its_scan(shown, option, tmp_path):
    source = fill(tmp_path)
    with pytest.raises(InputError) as caught, open_capture(source, "disc-250", shown):
        pass
    text = str(caught.value)
    assert text.startswith(f"{source}: {option}is for a cloud of the whole vehicle")
    assert "leave it out" in text


@pytest.mark.parametrize(
    ("name", "says"),
    [("../v.ply", "lies outside the archive"), ("v.zip", "is an archive in an archive")],
)
def test_the_cloud_of_an_archive_lies_in_it_and_is_no_archive(name, says, tmp_path):
    folder = fill(tmp_path / "c", DISC + f'cloud = "{name}"\n', ("v.zip",))
    (tmp_path / "v.ply").write_bytes(b"v.ply")
    with open_capture(folder) as capture:
        assert cloud_file(capture) == name
    assert says in refusal(packed(folder, "tar"))


def test_both_ways_to_tell_the_front_are_one_too_many(tmp_path):
    source = fill(tmp_path, None, ("vehicle.ply",))
    shown = CaptureOptions(front=(1.0, 0.0, 0.0), front_point=(1.0, 0.0, 0.0))
    with (
        pytest.raises(InputError, match=r"^--front and --front-point: both.*leave out one$"),
        open_capture(source, "disc-250", shown),
    ):
        pass


def write_tar(path: Path, name: str, kind: bytes = tarfile.REGTYPE, link: str = "") -> Path:
    with tarfile.open(path, "w") as tar:
        for wheel in WHEELS:
            member = tarfile.TarInfo(f"{wheel.lower()}.ply")
            tar.addfile(member, io.BytesIO())
        member = tarfile.TarInfo(name)
        member.type, member.linkname = kind, link
        tar.addfile(member)
    return path


@pytest.mark.parametrize(
    "name", ["../evil.ply", "/tmp/evil.ply", "a/../../evil.ply", "..\\evil.ply"]
)
@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_a_member_that_points_outside_is_refused_and_nothing_written(kind, name, tmp_path):
    source = tmp_path / "in" / f"slip.{kind}"
    source.parent.mkdir()
    if kind == "zip":
        with zipfile.ZipFile(source, "w") as archive:
            archive.writestr(name, b"evil")
    else:
        write_tar(source, name)
    before = sorted(tmp_path.rglob("*"))
    assert "points outside" in refusal(source, "disc-250")
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("name", ["../fl.ply", "a/../../fl.ply", "{}/fl.ply"])
def test_what_an_archive_names_must_lie_in_it(name, tmp_path):
    """A folder may name files beside it; an archive may not, be they there or not."""
    (tmp_path / "fl.ply").write_bytes(b"fl.ply")
    outside = name.format(tmp_path)
    toml = DISC + REFERENCE.replace("fl.ply", outside)
    folder = fill(tmp_path / "c", toml)
    (folder / "a").mkdir()
    with open_capture(folder) as capture:
        assert capture.entries[3].path.read_bytes() == b"fl.ply"
    for kind in KINDS:
        assert "lies outside the archive" in refusal(packed(folder, kind))


def test_a_target_file_of_an_archive_must_lie_in_it(tmp_path):
    (tmp_path / "mine.toml").write_text('shape = "disc"\ndiameter = 0.25\n')
    folder = fill(tmp_path / "c", 'target = "../mine.toml"\n' + REFERENCE)
    with open_capture(folder) as capture:
        assert capture.target.diameter == 0.25
    assert "'../mine.toml' lies outside the archive" in refusal(packed(folder, "zip"))


def test_an_archive_in_an_archive_is_not_opened(tmp_path):
    files = ("rr.zip", "rl.ply", "fr.ply", "fl.ply")
    folder = fill(tmp_path / "c", DISC + REFERENCE.replace("rr.ply", "rr.zip"), files)
    assert [e[3] for e in entries(folder)] == list(files)
    assert "'rr.zip' is an archive in an archive" in refusal(packed(folder, "tar"))


def test_compressed_scans_are_found_by_their_names(tmp_path):
    files = ("rr.ply.gz", "RL.xyz.bz2", "fr.ply", "fl.e57", "trial-7.ptx.xz")
    found = entries(fill(tmp_path, None, files))
    assert [(name, file) for name, _, _, file in found] == list(
        zip([*WHEELS, "7"], files, strict=True)
    )


def test_links_and_devices_of_a_tar_are_left_out(tmp_path):
    for kind, link in (
        (tarfile.SYMTYPE, "/etc/passwd"),
        (tarfile.CHRTYPE, ""),
        (tarfile.FIFOTYPE, ""),
    ):
        source = write_tar(tmp_path / "l.tar", "trial-1.ply", kind, link)
        with open_capture(source, "disc-250") as capture:
            assert len(capture.entries) == 4


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.files.MAX_UNPACKED_BYTES", 2**20)
    source = tmp_path / "bomb.zip"
    with zipfile.ZipFile(source, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("rr.ply", bytes(2**20 + 1))
    assert "at most" in refusal(source)


def noise(folder: Path) -> Path:
    """A capture by file names, whose trials would be missed in silence if the archive broke off."""
    source = fill(folder)
    for number in range(4):
        (source / f"trial-{number}.ply").write_bytes(os.urandom(3000))
    return source


def scans_or_refusal(archive: Path) -> dict[str, bytes] | str:
    try:
        with open_capture(archive, "disc-250") as capture:
            return {entry.file: entry.path.read_bytes() for entry in capture.entries}
    except WheelplaneError:
        return refusal(archive, "disc-250")


@pytest.mark.parametrize("kind", KINDS)
def test_an_archive_cut_anywhere_is_refused_or_whole(kind, tmp_path):
    folder = noise(tmp_path / "c")
    archive = packed(folder, kind)
    data = archive.read_bytes()
    refused = 0
    for cut in [1, 10, 18, 30, 100, *range(0, len(data), len(data) // 40)]:
        archive.write_bytes(data[:cut])
        found = scans_or_refusal(archive)
        if isinstance(found, str):
            refused += 1
            assert "again" in found  # pack or copy it: not its kind is wrong
        else:
            assert found == {p.name: p.read_bytes() for p in folder.iterdir()}
    assert refused >= 40


@pytest.mark.parametrize("kind", KINDS)
def test_an_archive_with_a_wrong_byte_never_loses_a_scan(kind, tmp_path):
    """tar has no check of its contents, so those may differ; no member may vanish."""
    folder = noise(tmp_path / "c")
    archive = packed(folder, kind)
    data = archive.read_bytes()
    for at in range(0, len(data), max(1, len(data) // 150)):
        archive.write_bytes(data[:at] + bytes([data[at] ^ 0x5A]) + data[at + 1 :])
        found = scans_or_refusal(archive)
        assert isinstance(found, str) or len(found) == 8


def test_a_locked_zip_says_so(tmp_path):
    archive = packed(fill(tmp_path / "c"), "zip")
    data = bytearray(archive.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(signature)
        while at >= 0:
            data[at + offset] |= 1
            at = data.find(signature, at + 4)
    archive.write_bytes(data)
    assert "password" in refusal(archive, "disc-250")


def test_an_empty_archive_is_no_capture(tmp_path):
    for kind in ("zip", "tar"):
        (tmp_path / kind).mkdir()
        assert "found none" in refusal(packed(tmp_path / kind, kind), "disc-250")


def test_the_text_of_a_refusal_does_not_grow_with_the_file(tmp_path):
    source = fill(tmp_path, f"reference = {json.dumps(['x' * 5000])}\n")
    assert len(refusal(source)) < 400
