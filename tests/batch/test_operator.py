"""Questions of an operator: what failed and why, what is at work, what takes long."""

from __future__ import annotations

import pytest

from tests.support.batches import archive_of, call, run, settle, trees


@pytest.fixture
def finished(tmp_path):
    """An archive of two good captures and two bad ones, and its results."""
    archive = archive_of(tmp_path / "archive", 2)
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    (archive / "odd.txt").write_text("no number\n")
    settle(archive)
    assert run(archive, tmp_path / "results", "--workers", "1").returncode == 1
    return archive, tmp_path / "results"


def recent(results) -> dict[str, int]:
    paths = {path.stem: path for path in results.glob("measurements/*/*.json")}
    return {
        name: paths[tree["batch"]["key"]].stat().st_mtime_ns
        for name, tree in trees(results).items()
    }


@pytest.mark.parametrize(
    ("retry", "again"),
    [
        (("--retry",), {"bad.txt", "odd.txt"}),
        (("--retry", "failed"), {"bad.txt", "odd.txt"}),
        (("--retry", "ok"), {"00/car-0000.txt", "00/car-0001.txt"}),
        (("--retry", "odd.txt"), {"odd.txt"}),
        (("--retry", "00/car-0001.txt"), {"00/car-0001.txt"}),
        (("--retry", "quarantined"), set()),
    ],
)
def test_a_retry_measures_what_it_names_and_nothing_else(finished, retry, again):
    archive, results = finished
    before, content = recent(results), trees(results)
    done = run(archive, results, *retry, "--workers", "1")
    assert done.returncode == 1
    assert f"{4 - len(again)} done before, {len(again)} to do" in done.stderr
    after = recent(results)
    assert {name for name in before if before[name] != after[name]} == again
    assert trees(results) == content


def test_a_retry_of_an_unknown_name_is_one_line(finished):
    archive, results = finished
    done = run(archive, results, "--retry", "nowhere.txt")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "nowhere.txt" in done.stderr


def test_the_archive_may_follow_retry_as_before(finished):
    archive, results = finished
    done = call("batch", "--retry", archive, "-o", results)
    assert "2 done before, 2 to do" in done.stderr


def test_why_shows_reason_inputs_and_log(finished):
    archive, results = finished
    done = call("batch", "-o", results, "--why", "bad.txt")
    assert done.returncode == 0
    tree = trees(results)["bad.txt"]
    for text in ("bad.txt: failed at read", tree["batch"]["reason"], "line 2: 2 numbers"):
        assert text in done.stdout
    assert tree["provenance"]["inputs"]["bad.txt"] in done.stdout
    assert "Traceback" in done.stdout  # of the log
    assert f"wheelplane measure '{archive}/bad.txt' --plot DIR" in done.stdout
    assert "00/car-0000.txt: ok" in call("batch", "-o", results, "--why", "00/car-0000.txt").stdout


def test_why_of_an_unknown_name_is_one_line(finished):
    done = call("batch", "-o", finished[1], "--why", "nowhere")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "has no result of this name" in done.stderr


@pytest.mark.parametrize("arguments", [(), ("-o", "results"), ("archive",)])
def test_what_is_missing_is_said(arguments):
    done = call("batch", *arguments)
    assert (done.returncode, "Missing" in done.stderr) == (2, True)
