"""`wheelplane batch`: nothing lost, nothing twice, whatever dies; a bad capture stops no other."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.support.batches import (
    ROOT,
    archive_of,
    call,
    descendants,
    five_points,
    kill,
    left,
    poisoned,
    run,
    run_process,
    settle,
    start,
    trees,
)
from tests.support.made import write_small_capture


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A capture of four coarse scans."""
    return write_small_capture(tmp_path_factory.mktemp("synth") / "capture", trials=1)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """An archive of sixty tiny captures, and its results by one worker."""
    folder = tmp_path_factory.mktemp("undisturbed")
    archive = archive_of(folder / "archive", 60)
    done = run_process(archive, folder / "results", "--workers", "1")
    assert done.returncode == 0, done.stderr
    return archive, left(folder / "results")


def test_number_of_workers_changes_nothing(undisturbed, tmp_path):
    archive, expected = undisturbed
    assert run(archive, tmp_path / "results", "--workers", "3").returncode == 0
    assert left(tmp_path / "results") == expected
    assert len(expected) == 61


@pytest.mark.slow
def test_a_run_that_is_killed_goes_on_to_the_same_end(undisturbed, tmp_path):
    archive, expected = undisturbed
    rng = random.Random(1)
    for _ in range(4):
        process = start(archive, tmp_path / "results", "--workers", "2")
        time.sleep(rng.uniform(0.5, 3.0))
        kill(process.pid)
        process.communicate()
    assert run(archive, tmp_path / "results").returncode == 0
    assert left(tmp_path / "results") == expected


@pytest.mark.slow
def test_workers_that_are_killed_cost_nothing(undisturbed, tmp_path):
    archive, expected = undisturbed
    rng = random.Random(2)
    process = start(archive, tmp_path / "results", "--workers", "2")
    kills = 0
    while process.poll() is None and kills < 6:
        time.sleep(rng.uniform(0.2, 0.5))
        children = descendants(process.pid)
        if len(children) > 2:
            kill(rng.choice(children))
            kills += 1
    out, err = process.communicate()
    assert process.returncode == 0, out + err
    assert kills > 0
    assert left(tmp_path / "results") == expected


def test_two_runners_on_the_same_results_do_not_corrupt_them(undisturbed, tmp_path):
    archive, expected = undisturbed
    both = [start(archive, tmp_path / "results", "--workers", "1") for _ in range(2)]
    for process in both:
        out, err = process.communicate()
        assert process.returncode == 0, out + err
    assert left(tmp_path / "results") == expected


def test_shards_together_are_the_whole(undisturbed, tmp_path):
    archive, expected = undisturbed
    for k in (1, 2, 3):
        done = run(archive, tmp_path / "results", "--shard", f"{k}/3")
        assert done.returncode == 0, done.stderr
        count = len(list((tmp_path / "results" / "measurements").rglob("*.json")))
        assert (count == 60) == (k == 3)
    assert left(tmp_path / "results") == expected


@pytest.mark.slow
def test_poison_kills_only_its_own_child(undisturbed, tmp_path):
    archive = shutil.copytree(undisturbed[0], tmp_path / "archive")
    for name in ("crash", "hang", "greedy", "once"):
        five_points(archive / "bad" / f"{name}.txt", 7)
    settle(archive)
    options = ("--workers", "2", "--timeout", "4", "--memory", "300M")
    done = run_process(archive, tmp_path / "results", *options, **poisoned(tmp_path))
    assert done.returncode == 1
    found = trees(tmp_path / "results")
    assert len(found) == 64
    bad = {name: tree["batch"] for name, tree in found.items() if tree["batch"]["status"] != "ok"}
    assert {name: (b["status"], b["stage"]) for name, b in bad.items()} == {
        f"bad/{name}.txt": ("quarantined", "child") for name in ("crash", "hang", "greedy")
    }
    assert bad["bad/crash.txt"]["reason"] == "it crashes the program (SIGSEGV)"
    assert bad["bad/hang.txt"]["reason"] == "it takes more than 4 s"
    assert bad["bad/greedy.txt"]["reason"] == "it needs more than 300 MB of memory"
    log = (tmp_path / "results" / "logs" / f"{bad['bad/crash.txt']['key']}.log").read_text()
    assert log.count("SIGSEGV") == 2  # retried once
    assert "poisoned" in log  # where it crashed
    others = {k: v for k, v in left(tmp_path / "results").items() if k in undisturbed[1]}
    assert len(others) == 61
    # what was put aside is not tried again, unless asked for
    again = run(archive, tmp_path / "results", *options)
    assert "64 captures: 64 done before, 0 to do" in again.stderr
    assert run(archive, tmp_path / "results", "--retry").returncode == 0
    assert {tree["batch"]["status"] for tree in trees(tmp_path / "results").values()} == {"ok"}


def cloud_of_noise() -> bytes:
    """A PLY file of points all over a box."""
    points = np.random.default_rng(1).uniform(0.0, 0.6, (5000, 3)).astype("<f4")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 5000\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    return head.encode() + points.tobytes()


def broken(capture: Path, archive: Path) -> dict[str, tuple[str, str]]:
    """Captures broken in as many ways as there are, and the stage and words that tell how."""

    def changed(name: str) -> Path:
        return shutil.copytree(capture, archive / name)

    (changed("missing") / "rr.ply").unlink()
    cut = changed("cut") / "fl.ply"
    cut.write_bytes(cut.read_bytes()[:-100])
    (changed("junk") / "fr.ply").write_bytes(b"no cloud at all")
    (changed("empty") / "rl.ply").write_bytes(b"")
    toml = changed("typo") / "capture.toml"
    toml.write_text(toml.read_text().replace("[reference]", "[referense]"))
    toml = changed("target") / "capture.toml"
    toml.write_text(toml.read_text().replace('"disc"', '"dics"'))
    shutil.copy(changed("same") / "rr.ply", archive / "same" / "rl.ply")
    (changed("noise") / "rr.ply").write_bytes(cloud_of_noise())
    (archive / "noise.ply").write_bytes(cloud_of_noise())
    whole = Path(shutil.make_archive(str(archive / "spoiled"), "zip", capture))
    data = whole.read_bytes()
    (archive / "torn.zip").write_bytes(data[: len(data) // 2])
    whole.write_bytes(data[:5000] + bytes(1000) + data[6000:])
    with zipfile.ZipFile(archive / "bare.zip", "w") as packed:
        packed.writestr("notes.md", "nothing here")
    (archive / "half.txt").write_text("1 2 3\n4 5\n")
    (archive / "flat.txt").write_text("".join(f"{k} 0 0\n" for k in range(20)))
    return {
        "missing": ("discover", "rr.ply is missing"),
        "cut": ("read", "fl.ply"),
        "junk": ("read", "fr.ply"),
        "empty": ("read", "the file is empty"),
        "typo": ("discover", "did you mean 'reference'"),
        "target": ("discover", "did you mean 'disc'"),
        "same": ("frame", ""),
        "noise": ("segment", "the target of reference wheel RR was not measured"),
        "noise.ply": ("discover", "no target is named"),
        "torn.zip": ("discover", "no zip or tar, though its suffix says so, or cut"),
        "spoiled.zip": ("read", "cannot be unpacked"),
        "bare.zip": ("discover", "one scan rr.* is needed"),
        "half.txt": ("read", "line 2: 2 numbers where 3 are needed"),
        "flat.txt": ("plane", "one line"),
    }


def test_every_broken_capture_is_a_row_that_says_why_and_every_good_one_is_measured(
    capture, tmp_path
):
    archive = tmp_path / "archive"
    shutil.copytree(capture, archive / "2026" / "good")
    shutil.make_archive(str(archive / "packed"), "zip", capture)
    shutil.make_archive(str(archive / "packed-2"), "gztar", capture.parent, "capture")
    five_points(archive / "old" / "car.txt", 1)
    expected = broken(capture, archive)
    settle(archive)
    done = run(archive, tmp_path / "results")
    assert done.returncode == 1
    assert "Traceback" not in done.stdout + done.stderr
    found = trees(tmp_path / "results")
    good = {"2026/good": "folder", "packed.zip": "zip", "packed-2.tar.gz": "tar"}
    good |= {"old/car.txt": "five-point"}
    assert set(found) == set(expected) | set(good)
    for name, kind in good.items():
        assert (found[name]["batch"]["status"], found[name]["batch"]["kind"]) == ("ok", kind)
    for name, (stage, words) in expected.items():
        batch = found[name]["batch"]
        assert (batch["status"], batch["stage"]) == ("failed", stage), (name, batch)
        assert words in batch["reason"], name
        assert batch["reason"].startswith(name)
        assert (tmp_path / "results" / "logs" / f"{batch['key']}.log").is_file()
    for content in left(tmp_path / "results").values():  # nothing tells where it lay
        assert str(tmp_path).encode() not in content
        assert b"/tmp" not in content
        assert b"wheelplane-" not in content


def test_what_is_measured_is_what_the_command_measure_prints(capture, tmp_path):
    archive = tmp_path / "archive"
    shutil.copytree(capture, archive / "car")
    five_points(archive / "car.txt", 1, planes=6)
    assert run(archive, tmp_path / "results").returncode == 0
    for name, command in (("car", "measure"), ("car.txt", "five-point")):
        alone = subprocess.run(
            [sys.executable, "-m", "wheelplane", command, str(archive / name), "--json"],
            cwd=ROOT,
            capture_output=True,
            check=True,
        )
        text = alone.stdout.decode().replace(str(archive / name), name)
        tree = trees(tmp_path / "results")[name]
        assert tree.pop("batch")["status"] == "ok"
        assert tree == json.loads(text)


def test_captures_are_measured_from_the_vertical_in_use(capture, tmp_path):
    stated = shutil.copytree(capture, tmp_path / "archive" / "level")
    shutil.copytree(capture, tmp_path / "archive" / "unknown")
    file = stated / "capture.toml"
    file.write_text("gravity = [0.02, 0.0, -1.0]\ngravity_u_deg = 0.01\n" + file.read_text())
    assert run(tmp_path / "archive", tmp_path / "results", "--vertical", "gravity").returncode == 1
    found = trees(tmp_path / "results")
    assert found["level"]["vertical_in_use"] == "gravity"
    assert "gravity" in found["unknown"]["batch"]["reason"]


def test_moved_archives_are_recognised_and_changes_replace_what_was(undisturbed, tmp_path):
    archive = tmp_path / "here"
    shutil.copytree(undisturbed[0] / "00", archive)
    assert run(archive, tmp_path / "results").returncode == 0
    first = trees(tmp_path / "results")
    moved = shutil.copytree(archive, tmp_path / "there")
    refused = run(moved, tmp_path / "results")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "archive was" in refused.stderr
    assert "--resume to measure anew what this changes" in refused.stderr  # which is nothing
    resumed = run(moved, tmp_path / "results", "--resume")
    assert "now: 10 recognised" in resumed.stdout
    assert trees(tmp_path / "results") == first
    five_points(moved / "car-0003.txt", 99)
    (moved / "car-0004.txt").unlink()
    done = run(moved, tmp_path / "results")
    assert "9 captures: 8 done before, 1 to do" in done.stderr
    after = trees(tmp_path / "results")
    differing = {name for name in first if first[name] != after[name]}
    assert differing == {"car-0003.txt"}
    old = first["car-0003.txt"]["batch"]["key"]
    assert (tmp_path / "results" / "superseded" / f"{old}.json").is_file()
    # files that were only touched are looked at, and found to be the same
    settle(moved)
    assert "now: 9 recognised" in run(moved, tmp_path / "results").stdout


def test_other_settings_are_asked_for_and_replace_all(undisturbed, tmp_path):
    archive = shutil.copytree(undisturbed[0] / "00", tmp_path / "archive")
    assert run(archive, tmp_path / "results").returncode == 0
    first = left(tmp_path / "results")
    refused = run(archive, tmp_path / "results", "--length-unit", "mm")
    assert refused.returncode == 2
    assert 'length_unit was null, is "mm"' in refused.stderr
    assert left(tmp_path / "results") == first
    done = run(archive, tmp_path / "results", "--length-unit", "mm", "--resume")
    assert done.returncode == 1  # a car of 3 mm
    assert {tree["batch"]["status"] for tree in trees(tmp_path / "results").values()} == {"failed"}
    assert run(archive, tmp_path / "results", "--resume").returncode == 0
    assert left(tmp_path / "results") == first


def test_a_file_that_a_capture_names_elsewhere_is_part_of_it(capture, tmp_path):
    archive = tmp_path / "archive"
    toml = shutil.copytree(capture, archive / "car") / "capture.toml"
    text = toml.read_text()
    at = text.index("[target]")
    end = text.index("[", at + 1)
    (archive / "ours.toml").write_text(text[at:end].replace("[target]\n", ""))
    toml.write_text('target = "../ours.toml"\n' + text[:at] + text[end:])
    settle(archive)
    assert run(archive, tmp_path / "results").returncode == 0
    first = trees(tmp_path / "results")["car"]
    assert "1 done before, 0 to do" in run(archive, tmp_path / "results").stderr
    ours = (archive / "ours.toml").read_text()
    (archive / "ours.toml").write_text(re.sub(r"0\.25\d*", "0.249", ours))
    assert "0 done before, 1 to do" in run(archive, tmp_path / "results").stderr
    assert trees(tmp_path / "results")["car"]["wheels"] != first["wheels"]


def test_dates_come_from_the_capture_or_its_name(capture, tmp_path):
    archive = tmp_path / "archive"
    toml = shutil.copytree(capture, archive / "2020-01-01 car") / "capture.toml"
    toml.write_text("date = 2026-11-20T10:30:00Z\n" + toml.read_text())
    five_points(archive / "20251231 car.txt", 1)
    five_points(archive / "undated.txt", 2)
    pattern = r"(?P<y>\d{4})-?(?P<m>\d\d)-?(?P<d>\d\d)"
    assert run(archive, tmp_path / "results", "--date-in-name", pattern).returncode == 0
    found = {name: tree["batch"]["date"] for name, tree in trees(tmp_path / "results").items()}
    assert found == {
        "2020-01-01 car": "2026-11-20T10:30:00+00:00",
        "20251231 car.txt": "2025-12-31",
        "undated.txt": None,
    }


def test_the_summary_says_how_much_more_failed(tmp_path):
    texts = ["no number", "1 2", "1 2 3\n" * 4, "1,2\n3", "a b c d", "1 2 3\n" * 7, "\0", ""]
    for k, text in enumerate(texts):
        (tmp_path / "archive").mkdir(exist_ok=True)
        (tmp_path / "archive" / f"car-{k}.txt").write_text(text)
    summary = run(tmp_path / "archive", tmp_path / "results").stdout
    shown = sum(int(line.split()[0]) for line in summary.splitlines() if " failed, " in line)
    (rest,) = re.findall(r"^ +(\d+) for \d+ other reasons?: .* --failures$", summary, re.MULTILINE)
    held = re.search(r"(\d+) failed", summary)
    assert held
    assert shown + int(rest) == int(held[1])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--shard", "0/3"], "K from 1 to N"),
        (["--memory", "much"], "a size such as 900M"),
        (["--target", "disc-25"], "disc-250"),
        (["--coordinates", "spherical"], "--angle-unit"),
        (["--date-in-name", "("], "not a regular expression"),
        (["--date-in-name", "(?P<y>.)"], "y, m and d"),
        (["--date-in-name", r"(\d+)-(\d+)-(\d+)"], "it has 3 groups"),
        (["--scheduler", "tcp://127.0.0.1:1", "--workers", "2"], "leave it out"),
        (["--station", "1,2,3"], "--total-station"),
        (["--memory", "0G"], "a size such as 900M"),
        (["--memory", "99999999999T"], "a size such as 900M"),
        (["--timeout", "nan"], "nan is no finite number"),
        (["--timeout", "1e300"], "not in the range"),
        (["--settle", "inf"], "inf is no finite number"),
        (["--metrics", "/dev/null"], "no regular file"),
        (["--retry", ""], "'--retry' is empty"),
        (["--metrics", ""], "'--metrics' is empty"),
    ],
)
def test_unusable_options_are_one_line(options, words, tmp_path):
    five_points(tmp_path / "archive" / "car.txt", 1)
    done = run(tmp_path / "archive", tmp_path / "results", *options)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert words in done.stderr


def test_limits_that_allow_no_result_end_the_run_in_a_line(tmp_path):
    five_points(tmp_path / "archive" / "car.txt", 1)
    done = run(tmp_path / "archive", tmp_path / "results", "--memory", "1M", "--workers", "1")
    assert (done.returncode, done.stdout) == (2, "")
    assert "1 MB of memory, even to write that it failed: allow more by --memory" in done.stderr


def test_a_limit_of_captures_may_exceed_all_numbers_of_the_machine(tmp_path):
    five_points(tmp_path / "archive" / "car.txt", 1)
    places = tmp_path / "archive", tmp_path / "results"
    assert run(*places, "--limit", str(10**20)).returncode == 0
    assert "1 captures: 1 ok" in call("results", places[1], "--limit", 10**20).stdout


def test_a_full_log_is_named(tmp_path):
    five_points(tmp_path / "archive" / "car.txt", 1)
    done = run(tmp_path / "archive", tmp_path / "results", "--log", "/dev/full")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--log /dev/full: cannot be written (No space left on device)" in done.stderr


def test_a_capture_is_named_by_the_bytes_of_its_file(tmp_path):
    name = os.fsdecode(b"b\xff.txt")
    five_points(tmp_path / "archive" / name, 1)
    places = tmp_path / "archive", tmp_path / "results"
    assert run(*places).returncode == 0
    assert "1 ok" in call("results", places[1], "--name", name).stdout
    assert call("batch", "-o", places[1], "--why", name).returncode == 0
    assert "1 to do" in run(*places, "--retry", name).stderr


def test_unusable_places_are_one_line(capture, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "'--output' is empty" in run(tmp_path, "").stderr
    for archive, words in (
        ("", "ARCHIVE]' is empty"),
        ("s3:///x", "names no bucket"),
        (tmp_path / "empty", "no captures found, nor any other file"),
        (tmp_path / "nowhere", "no such folder"),
        (capture, "itself a capture"),
        (five_points(tmp_path / "car.txt", 1), "is a file"),
        (Path(__file__).parents[1] / "poison", "no captures found, only .py"),
    ):
        done = run(archive, tmp_path / "results")
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert words in done.stderr


def test_results_within_the_archive_are_no_captures(undisturbed, tmp_path):
    archive = shutil.copytree(undisturbed[0] / "01", tmp_path / "archive")
    results = archive / "00 results"
    assert run(archive, results).returncode == 0
    (results / "table.csv").write_text("1,2,3\n")
    assert "10 captures: 10 done before, 0 to do" in run(archive, results).stderr
