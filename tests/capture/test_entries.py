"""From capture.toml or file names to entries: nothing lost, nothing doubled, files where stated."""

import math
import random
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelplane.capture.declaration import CaptureFile, files_of, find_capture_file
from wheelplane.capture.declaration import read_capture_file as read_declaration
from wheelplane.capture.entries import scans_of
from wheelplane.capture.entry import ScanEntry, Turn
from wheelplane.capture.file_names import (
    by_file_names,
    clouds_of,
    filled_by_names,
    is_capture,
    only_cloud,
)
from wheelplane.capture.folder import capture_folder, check_path
from wheelplane.errors import InputError
from wheelplane.readers import READERS

WHEELS = ("RR", "RL", "FR", "FL")
TOML = """
date = 2026-11-20
target = "plate.toml"
scanner = "scanner.toml"
[reference]
RR = "a.ply"
RL = "b.e57"
FR = "c.las"
FL = "sub/d.npy"
[[trial]]
name = "1"
file = "e.ply"
repeats = "RL"
[[trial]]
name = "2"
file = "f.ply"
wheel = "FR"
[[trial]]
name = "3"
file = "g.ply"
repeats = "2"
[[sweep]]
name = "s1"
file = "h.ply"
wheel = "FL"
position = "left"
[[sweep]]
name = "s2"
file = "sub/./d.npy"
wheel = "FL"
position = "ahead"
[[runout]]
name = "o1"
file = "a.ply"
wheel = "RR"
angle_deg = 0.0
[[runout]]
name = "o2"
file = "i.ply"
wheel = "RR"
angle_deg = 180.0
u_angle_deg = 2.0
"""
SCANS = {*["a.ply", "b.e57", "c.las", "sub/d.npy", "e.ply", "f.ply", "g.ply", "h.ply", "i.ply"]}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "Capture.TOML").write_text(TOML)
    for name in SCANS:
        (tmp_path / name).write_bytes(b"?")
    return tmp_path


def declared_in(folder):
    return read_declaration(find_capture_file(folder), "capture.toml")


def test_every_declared_scan_is_one_entry_with_its_own_file(folder):
    declared = declared_in(folder)
    found = scans_of(declared, folder, "capture.toml", packed=False)
    assert [entry.name for entry in found] == [*WHEELS, "1", "2", "3", "s1", "s2", "o1", "o2"]
    assert {Path(entry.file).as_posix() for entry in found} == SCANS
    assert all(entry.path.samefile(folder / entry.file) for entry in found)
    assert sorted(files_of(declared)) == sorted(
        [*(entry.file for entry in found), "plate.toml", "scanner.toml"]
    )


def test_a_repeat_shows_the_wheel_that_it_repeats(folder):
    found = {e.name: e for e in scans_of(declared_in(folder), folder, "c", packed=False)}
    for entry in found.values():
        if entry.repeats is not None:
            assert entry.wheel == found[entry.repeats].wheel
            assert found[entry.repeats].repeats is None
    assert [found[name].wheel for name in "123"] == ["RL", "FR", "FR"]


def test_the_position_of_a_wheel_is_stated_by_sweeps_and_run_outs_alone(folder):
    found = scans_of(declared_in(folder), folder, "c", packed=False)
    for entry in found:
        assert (entry.turn is None) == (entry.role in ("reference", "trial"))
    stated = {entry.name: entry.turn for entry in found}
    assert stated["s1"] == Turn(position="left")
    assert (stated["o2"].angle_rad, stated["o2"].u_rad) == (math.pi, math.radians(2.0))
    assert stated["o1"].angle_rad == 0.0
    assert ScanEntry("RR", "reference", "RR", "a.ply", folder).turn is None


@pytest.mark.parametrize("lost", sorted(SCANS))
def test_a_scan_that_is_not_there_is_named(folder, lost):
    (folder / lost).unlink()
    with pytest.raises(InputError) as caught:
        scans_of(declared_in(folder), folder, "capture.toml", packed=False)
    assert f"the scan {lost} is missing" in str(caught.value).replace("sub/./", "sub/")


@pytest.mark.parametrize("outside", ["../x.ply", "sub/../../x.ply", "/x.ply"])
def test_an_archive_reads_nothing_outside_itself_and_a_folder_may(folder, outside):
    inner = folder / "inner"
    shutil.copytree(folder / "sub", inner / "sub")
    for name in SCANS:
        shutil.copyfile(folder / name, inner / name)
    target = (inner / outside).resolve()
    declared = declared_in(folder)
    changed = declared.model_copy(update={"reference": declared.reference | {"RR": outside}})
    changed = changed.model_copy(update={"runout": ()})
    with pytest.raises(InputError, match="outside the archive"):
        scans_of(changed, inner, "c", packed=True)
    if target.parent == folder:
        target.write_bytes(b"?")
        assert scans_of(changed, inner, "c", packed=False)[0].path.samefile(target)


@given(st.data())
def test_file_names_say_the_same_in_any_case_and_order(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("names")
    suffixes = sorted(READERS)
    names, trials = {}, data.draw(st.sets(st.integers(0, 200), max_size=5))
    for stem in [*WHEELS, *(f"trial-{n}" for n in trials)]:
        stem = stem.upper() if data.draw(st.booleans()) and stem in WHEELS else stem.lower()
        names[stem.upper()] = stem + data.draw(st.sampled_from(suffixes))
    for name in random.Random(0).sample(sorted(names.values()), len(names)):
        (folder / name).touch()
    (folder / ".hidden.ply").touch()
    found = by_file_names(folder, Path("capture"))
    assert found.reference == {wheel: names[wheel] for wheel in WHEELS}
    # Numbers in their own order, not as text: 2 before 10.
    assert [trial.name for trial in found.trial] == [str(n) for n in sorted(trials)]
    assert [trial.file for trial in found.trial] == [names[f"TRIAL-{n}"] for n in sorted(trials)]
    assert is_capture(folder)
    filled = filled_by_names(CaptureFile(vehicle="x"), folder, Path("capture"))
    assert (filled.vehicle, filled.reference, filled.trial) == ("x", found.reference, found.trial)
    own = CaptureFile(cloud="other.ply")
    assert filled_by_names(own, folder, Path("capture")) is own


def test_one_cloud_is_found_among_other_files_and_two_are_a_question(tmp_path):
    for name in ("notes.txt", "table.csv", "photo.jpg", ".hidden.ply"):
        (tmp_path / name).touch()
    assert clouds_of(tmp_path) == []
    assert not is_capture(tmp_path)
    with pytest.raises(InputError, match="found none"):
        only_cloud(tmp_path, "here")
    (tmp_path / "car.e57").touch()
    assert only_cloud(tmp_path, "here") == "car.e57"
    assert by_file_names(tmp_path, tmp_path).cloud == "car.e57"
    (tmp_path / "car.ply.gz").touch()
    with pytest.raises(InputError, match=r"found 2 \(car\.e57, car\.ply\.gz\)"):
        only_cloud(tmp_path, "here")


@pytest.mark.parametrize("form", ["zip", "tar", "gztar", "xztar"])
@pytest.mark.parametrize("nested", [False, True])
def test_an_archive_is_its_folder_while_it_is_open(folder, tmp_path_factory, form, nested):
    base = tmp_path_factory.mktemp("archive") / "capture"
    root = folder.parent if nested else folder
    path = Path(shutil.make_archive(str(base), form, root, folder.name if nested else None))
    with capture_folder(path) as inside:
        names = {p.relative_to(inside).as_posix() for p in inside.rglob("*") if p.is_file()}
        assert names == SCANS | {"Capture.TOML"}
    assert not inside.exists()
    with capture_folder(folder) as same:
        assert same == folder
    assert folder.is_dir()


def test_a_path_that_the_system_refuses_is_an_input_error(tmp_path):
    name = tmp_path / ("x" * 5000)

    def too_long():
        raise OSError(36, "File name too long")

    assert check_path(tmp_path, tmp_path.is_dir)
    assert not check_path(tmp_path / "no", (tmp_path / "no").is_file)
    with pytest.raises(InputError, match="File name too long: check the path"):
        check_path(name, too_long)
