"""A zip that holds several captures: found, measured and resumed as in folders."""

from __future__ import annotations

import json
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.batches import (
    archive_of,
    call,
    five_points,
    run,
    run_process,
    settle,
    trees,
    zip_of_discs,
)
from wheelplane.batch.plan.discover import holds_several
from wheelplane.batch.storage.entry import Entry
from wheelplane.batch.storage.local import LocalStore
from wheelplane.batch.storage.remote import RemoteStore
from wheelplane.batch.storage.zipped import ZippedRemoteStore, ZippedStore

SHOWN = re.compile("--(plot|explain) DIR")
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


def test_captures_of_a_zip_that_is_cut_are_not_gone_and_its_row_ends_when_it_is_whole(tmp_path):
    plain = archive_of(tmp_path / "plain", 3)
    archive, results = tmp_path / "archive", tmp_path / "results"
    whole = packed(plain, archive / "all.zip").read_bytes()
    packed(plain, archive / "other.zip")
    settle(archive)
    assert run(archive, results, *OPTIONS).returncode == 0
    measured = set(trees(results))
    (archive / "all.zip").write_bytes(whole[:-30])
    (archive / "other.zip").unlink()
    settle(archive)
    for outcome in ("now: 1 failed", "now: nothing new"):
        done = run(archive, results, *OPTIONS)
        assert outcome in done.stdout
        assert "3 no longer in the archive" in done.stdout  # those of the other
    assert set(trees(results)) == {*measured, "all.zip"}
    (archive / "all.zip").write_bytes(whole)
    settle(archive)
    done = run(archive, results, *OPTIONS)
    assert "now: 3 recognised" in done.stdout
    assert "3 no longer in the archive" in done.stdout
    assert set(trees(results)) == measured


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
        command = SHOWN.sub("--json", line.partition(": ")[2])
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, check=True
        )
        assert numbers(json.loads(done.stdout) | {"batch": tree["batch"]}) == numbers(tree)


@pytest.mark.slow
@pytest.mark.parametrize("is_far", [False, True])
def test_the_command_that_why_names_has_the_options_of_the_run(
    remote, tmp_path, monkeypatch, is_far
):
    """Run as printed, in another folder: without --target and --radius there would be no result."""
    plain = archive_of(tmp_path / "plain", 1)
    discs(plain / "it's here", 1)
    (plain / "it's here" / "capture.toml").unlink()
    packed(archive_of(tmp_path / "two", 2), plain / "two.zip")
    settle(plain)
    (tmp_path / "ours.toml").write_text('shape = "disc"\ndiameter = 0.25\n')
    archive, results = plain, tmp_path / "results"
    if is_far:
        archive = "s3://cars/archive"
        put_all(plain, RemoteStore(archive))
    monkeypatch.chdir(tmp_path)
    options = ("--target", "ours.toml", "--radius", "999", "--length-unit", "m")
    run(archive, results, *OPTIONS, *options)
    found = trees(results)
    assert {name: tree["batch"]["status"] for name, tree in found.items()} == {
        "it's here": "ok", "00/car-0000.txt": "failed", "two.zip/00/car-0000.txt": "failed",
        "two.zip/00/car-0001.txt": "failed",
    }  # fmt: skip
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for name, tree in found.items():
        said = call("batch", "-o", results, "--why", name).stdout.splitlines()
        see, again = (line.partition(": ")[2] for line in said[-2:])
        folder = tmp_path / "at" / name
        folder.mkdir(parents=True)
        done = subprocess.run(
            SHOWN.sub("--json", see), shell=True, cwd=folder, capture_output=True,
            env=os.environ | {"PATH": path}, check=False, text=True,
        )  # fmt: skip
        if tree["batch"]["status"] == "ok":
            assert numbers(json.loads(done.stdout) | {"batch": tree["batch"]}) == numbers(tree)
        else:
            assert done.returncode == 2
            assert "radius" in done.stderr
            assert "radius" in tree["batch"]["reason"]
        assert "1 " in call(*shlex.split(again)[1:], *OPTIONS).stdout.partition("now: ")[2][:2]


def test_members_are_files_of_the_store(tmp_path):
    plain = archive_of(tmp_path / "plain", 2)
    archive = tmp_path / "archive"
    packed(plain, archive / "all.zip")
    store = ZippedStore(archive, confined=True)
    (listed,) = store.list()
    members = store.zips.members(listed)
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
    assert len(store.zips.members(next(iter(store.list())))) == 3
    store.zips.close()


def put_all(folder: Path, store: RemoteStore) -> None:
    """Put all files of a folder into object storage."""
    for path in folder.rglob("*"):
        if path.is_file():
            store.write(path.relative_to(folder).as_posix(), path.read_bytes())


@pytest.mark.slow
def test_captures_in_a_zip_in_object_storage_are_those_of_the_folder(remote, tmp_path):
    plain = archive_of(tmp_path / "plain", 5)
    discs(plain / "discs" / "a", 1)
    (plain / "discs" / "a" / "capture.toml").write_text('target = "../ours.toml"\n')
    (plain / "discs" / "ours.toml").write_text('shape = "disc"\ndiameter = 0.25\n')
    (plain / "bad.txt").write_text("no number\n")
    archive = tmp_path / "archive"
    packed(plain, archive / "2026" / "all.zip")
    zip_of_discs(archive / "one.zip", 1)
    (archive / "cut.zip").write_bytes((archive / "2026" / "all.zip").read_bytes()[:-30])
    settle(tmp_path)
    store = RemoteStore("s3://cars/archive")
    put_all(archive, store)
    assert run_process(archive, tmp_path / "local", *OPTIONS).returncode == 1
    done = run_process(store.url, tmp_path / "far", *OPTIONS)
    assert done.returncode == 1, done.stderr
    expected, found = (trees(tmp_path / place) for place in ("local", "far"))
    assert {name: numbers(tree) for name, tree in found.items()} == {
        name: numbers(tree) for name, tree in expected.items()
    }
    assert len(found) == 5 + 1 + 1 + 2
    assert (
        "9 done before; now: nothing new"
        in run_process(store.url, tmp_path / "far", *OPTIONS).stdout
    )
    five_points(plain / "00" / "car-0001.txt", 77)
    store.write("2026/all.zip", packed(plain, tmp_path / "new.zip").read_bytes())
    done = run_process(store.url, tmp_path / "far", *OPTIONS)
    assert "2 done before; now: 1 ok, 6 recognised" in done.stdout


@pytest.mark.parametrize("members", [1, 3, 2000])
def test_members_in_object_storage_are_listed_without_the_rest_of_the_zip(
    remote, tmp_path, monkeypatch, members
):
    """Two thousand, whose list alone is longer than the first piece."""
    path, noise = tmp_path / "many.zip", random.Random(1).randbytes(500)
    with zipfile.ZipFile(path, "w") as target:
        for k in range(members):
            target.writestr(f"folder of many files/car-{k:06d}.txt", noise)
    store = ZippedRemoteStore("s3://cars/archive")
    store.write("a/many.zip", path.read_bytes())
    read, real = [], RemoteStore.tail
    monkeypatch.setattr(RemoteStore, "tail", lambda *given: read.append(given[2]) or real(*given))
    (listed,) = store.list()
    found = store.zips.members(listed)
    assert len(found) == members
    assert read == ([2**16, 2**20] if members == 2000 else [min(2**16, listed.size)])
    assert members < 2000 or max(read) < listed.size
    (first, *_) = found
    assert first == Entry("a/many.zip/folder of many files/car-000000.txt", 500, listed.stamp)
    copy = store.fetch(first.name, tmp_path / "scratch")
    assert copy == tmp_path / "scratch" / first.name
    assert copy.read_bytes() == noise
    assert store.stat(first.name) == first
    assert store.exists(first.name)
    assert not store.exists("a/many.zip/none")
    assert store.fetch("a/many.zip", tmp_path / "scratch2").read_bytes() == path.read_bytes()
    store.zips.close()
