"""A zip that holds several captures: found, measured and resumed as in folders."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.batches import archive_of, call, five_points, run, settle, trees, zip_of_discs
from wheelplane.batch.plan.discover import holds_several
from wheelplane.batch.storage.local import LocalStore
from wheelplane.batch.storage.zipped import ZippedStore

OPTIONS = ("--workers", "1")


def packed(folder: Path, archive: Path, ahead: str = "") -> Path:
    """Pack all files of a folder into a zip, by their paths in it."""
    archive.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(archive, "w") as target:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                target.write(path, f"{ahead}{path.relative_to(folder).as_posix()}")
    return archive


def discs(folder: Path, seed: int) -> Path:
    """A folder of one capture: four scans and capture.toml."""
    zip_of_discs(folder.with_suffix(".zip"), seed)
    with zipfile.ZipFile(folder.with_suffix(".zip")) as source:
        source.extractall(folder)
    folder.with_suffix(".zip").unlink()
    return folder


def numbers(tree: dict) -> tuple:
    """Return the measured values, whatever the capture is called."""
    wheels = [{key: wheel[key] for key in wheel if key != "file"} for wheel in tree["wheels"]]
    return tree["batch"]["status"], wheels, tree["frame"], tree["vehicle"]


@pytest.mark.parametrize("top", ["", "top/"])
def test_captures_in_a_zip_are_those_of_its_folder_under_other_names(tmp_path, top):
    plain = archive_of(tmp_path / "plain", 12)
    discs(plain / "discs" / "a", 1)
    discs(plain / "discs" / "b", 2)
    (plain / "bad.txt").write_text("no number\n")
    settle(plain)
    archive = tmp_path / "archive"
    packed(plain, archive / "2026" / "all.ZIP", top)
    settle(archive)
    assert run(plain, tmp_path / "of-folder", *OPTIONS).returncode == 1
    done = run(archive, tmp_path / "of-zip", *OPTIONS)
    assert done.returncode == 1, done.stderr
    expected = {
        f"2026/all.ZIP/{top}{name}": numbers(tree)
        for name, tree in trees(tmp_path / "of-folder").items()
    }
    assert len(expected) == 15
    found = trees(tmp_path / "of-zip")
    assert {name: numbers(tree) for name, tree in found.items()} == expected
    again = run(archive, tmp_path / "of-zip", *OPTIONS)
    assert "15 done before; now: nothing new" in again.stdout


def test_of_a_changed_zip_only_changed_captures_are_measured_again(tmp_path):
    plain = archive_of(tmp_path / "plain", 3)
    archive, results = tmp_path / "archive", tmp_path / "results"
    packed(plain, archive / "all.zip")
    settle(archive)
    assert run(archive, results, *OPTIONS).returncode == 0
    five_points(plain / "00" / "car-0001.txt", 77)
    packed(plain, archive / "all.zip")
    settle(archive)
    done = run(archive, results, *OPTIONS)
    assert "0 done before; now: 1 ok, 2 recognised" in done.stdout
    (archive / "all.zip").unlink()
    shutil.copytree(plain, archive / "left")
    settle(archive)
    assert "3 no longer in the archive" in run(archive, results, *OPTIONS).stdout


def test_a_zip_of_one_capture_keeps_its_name(tmp_path):
    archive = tmp_path / "archive"
    zip_of_discs(archive / "one.zip", 1)
    discs(tmp_path / "car", 2)
    packed(tmp_path / "car", archive / "top.zip", "car/")
    scans = tmp_path / "scans"
    scans.mkdir()
    for name in ("rr", "rl", "fr", "fl"):
        shutil.copy(tmp_path / "car" / f"{name}.xyz", scans)
        packed(scans, archive / "folder" / f"{name}.zip")
        (scans / f"{name}.xyz").unlink()
    shutil.copy(tmp_path / "car" / "capture.toml", archive / "folder")
    toml = archive / "folder" / "capture.toml"
    wheels = "".join(f'{name} = "{name.lower()}.zip"\n' for name in ("RR", "RL", "FR", "FL"))
    toml.write_text(f"{toml.read_text()}[reference]\n{wheels}")
    many = archive_of(tmp_path / "many", 2)
    packed(many, archive / "folder" / "more.zip")  # a file among those of the capture
    settle(archive)
    run(archive, tmp_path / "results", *OPTIONS)
    found = trees(tmp_path / "results")
    assert {name: tree["batch"]["kind"] for name, tree in found.items()} == {
        "one.zip": "zip",
        "top.zip": "zip",
        "folder": "folder",
    }
    assert {tree["batch"]["status"] for tree in found.values()} == {"ok"}, found
    assert "3 done before" in run(archive, tmp_path / "results", *OPTIONS).stdout


@pytest.mark.parametrize(
    ("members", "several"),
    [
        ([], False),
        (["a.txt"], False),
        (["a.txt", "b.csv"], True),
        (["readme.txt", "a.txt"], False),
        (["__MACOSX/a.txt", ".b.txt", "a.txt"], False),
        (["top/a.txt", "top/b.txt"], True),
        (["rr.ply", "rl.ply", "a/x.ply", "b/x.ply"], False),
        (["car/capture.toml", "car/a/x.ply", "car/b/x.ply"], False),
        (["cloud.e57", "a.txt", "b.txt"], False),
        (["a/capture.toml", "b/RR.ply", "b/FL.ply"], True),
        (["top/a/capture.toml", "top/a/rr.ply", "top/notes.pdf"], False),
        (["a/x.ply", "b/y.e57"], True),
    ],
)
def test_which_zips_hold_several_captures(members, several):
    assert holds_several(members) == several


def test_a_zip_that_breaks_the_limits_is_one_failed_row(tmp_path):
    archive = tmp_path / "archive"
    plain = archive_of(tmp_path / "plain", 2)
    packed(plain, archive / "out.zip")
    with zipfile.ZipFile(archive / "out.zip", "a") as target:
        target.writestr("../outside.txt", "1 2 3\n")
    (archive / "cut.zip").write_bytes(packed(plain, tmp_path / "whole.zip").read_bytes()[:-30])
    packed(plain, tmp_path / "elsewhere.zip")
    (archive / "link.zip").symlink_to(tmp_path / "elsewhere.zip")
    settle(archive)
    assert run(archive, tmp_path / "results", *OPTIONS).returncode == 1
    found = trees(tmp_path / "results")
    assert {name: tree["batch"]["status"] for name, tree in found.items()} == dict.fromkeys(
        ("cut.zip", "link.zip", "out.zip"), "failed"
    )
    assert not list(tmp_path.rglob("outside.txt"))


def test_a_file_that_a_packed_capture_names_is_taken_from_zip_or_folder(tmp_path):
    plain = tmp_path / "plain"
    discs(plain / "a", 1)
    discs(plain / "b", 2)
    target = 'shape = "disc"\ndiameter = 0.25\n'
    (plain / "a" / "capture.toml").write_text('target = "../ours.toml"\n')
    (plain / "b" / "capture.toml").write_text('target = "../../theirs.toml"\n')
    (plain / "ours.toml").write_text(target)
    archive, results = tmp_path / "archive", tmp_path / "results"
    packed(plain, archive / "all.zip")
    (archive / "theirs.toml").write_text(target)
    settle(archive)
    done = run(archive, results, *OPTIONS)
    assert done.returncode == 0, done.stdout
    assert "2 done before" in run(archive, results, *OPTIONS).stdout
    (archive / "theirs.toml").write_text(target.replace("0.25", "0.251"))
    os.utime(archive / "theirs.toml", (1e9, 1e9))
    assert "1 done before; now: 1 ok" in run(archive, results, *OPTIONS).stdout


@pytest.mark.parametrize("top", ["", "top of all/"])
def test_the_command_that_why_names_measures_a_packed_capture(tmp_path, top):
    """Run as printed, in a folder of its own: the wheels of the batch's result."""
    plain = archive_of(tmp_path / "plain", 1)
    for name, seed in (("a", 1), ("b", 2)):
        discs(plain / "it's here" / name, seed)
        (plain / "it's here" / name / "capture.toml").write_text('target = "../ours.toml"\n')
    (plain / "it's here" / "ours.toml").write_text('shape = "disc"\ndiameter = 0.25\n')
    packed(plain, tmp_path / "archive" / "2026" / "all.ZIP", top)
    settle(tmp_path / "archive")
    results = tmp_path / "results"
    assert run(tmp_path / "archive", results, *OPTIONS).returncode == 0
    bin_folder = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}"}
    found = trees(results)
    assert len(found) == 3
    for name, tree in found.items():
        said = call("batch", "-o", results, "--why", name).stdout
        (line,) = [line for line in said.splitlines() if line.startswith("see its targets: ")]
        folder = tmp_path / "at" / name
        folder.mkdir(parents=True)
        command = line.partition(": ")[2].replace("--plot DIR", "--json")
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, check=True
        )
        assert numbers(json.loads(done.stdout) | {"batch": tree["batch"]}) == numbers(tree)


def test_members_are_files_of_the_store(tmp_path):
    plain = archive_of(tmp_path / "plain", 2)
    archive = tmp_path / "archive"
    packed(plain, archive / "all.zip")
    store = ZippedStore(archive, confined=True)
    (listed,) = store.list()
    members = store.members(listed)
    assert [one.name for one in members] == [f"all.zip/00/car-000{k}.txt" for k in range(2)]
    for one in members:
        assert store.stat(one.name) == one
        assert store.exists(one.name)
        copy = store.fetch(one.name, tmp_path / "scratch")
        assert copy == tmp_path / "scratch" / one.name
        assert copy.read_bytes() == (plain / one.name.removeprefix("all.zip/")).read_bytes()
    assert not store.exists("all.zip/none")
    assert store.stat("all.zip/none") is LocalStore(archive).stat(members[0].name) is None
    packed(archive_of(plain, 1, 5), archive / "all.zip")
    assert len(store.members(next(iter(store.list())))) == 3
    store.close()
