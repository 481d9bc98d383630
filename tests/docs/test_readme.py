"""Tests of the README: commands run and print what it shows."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.support.made import write_small_capture
from wheelplane.capture.open_capture import open_capture

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND = [sys.executable, "-m", "wheelplane"]


def run(*arguments: str) -> str:
    done = subprocess.run(
        [*COMMAND, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def block(start: str) -> list[str]:
    found = re.search(rf"```\w*\n{start}(.*?)```", README, re.DOTALL)
    assert found, f"the README has no block that begins with {start}"
    return found[1].strip("\n").split("\n")


def test_five_points_of_the_paper_print_the_shown_output():
    shown = block(r"\$ wheelplane five-point tests/data/paper/figure-4.txt\n")
    printed = run("five-point", "tests/data/paper/figure-4.txt").strip("\n").split("\n")
    assert [line.rstrip() for line in shown] == [line.rstrip() for line in printed]


@pytest.mark.slow
def test_demo_prints_the_shown_output(tmp_path):
    shown = block("Making a vehicle")
    printed = run("demo", str(tmp_path)).strip("\n").split("\n")
    rows = [line.split() for line in printed if "°" in line]
    shown_rows = [line.split() for line in shown if "°" in line]
    assert len(rows) == len(shown_rows) == 12
    for row, shown_row in zip(rows, shown_rows, strict=True):
        assert row[:3] + row[4:5] == shown_row[:3] + shown_row[4:5]  # names and true values
        error, u = (float(text.rstrip('"')) for text in row[5:])
        shown_error = float(shown_row[5].rstrip('"'))
        assert abs(error) < 4.5 * u < 4.5 * 20
        # margin for rounding of a ray at an edge on another processor
        assert error == pytest.approx(shown_error, abs=2.0)
    names = [line.rsplit("/", 1)[-1] for line in printed if line.startswith("wrote ")]
    assert names == [line.rsplit("/", 1)[-1] for line in shown if line.startswith("wrote ")]


def test_shown_capture_file_is_valid(tmp_path):
    text = 'length_unit = "m"' + "\n".join(block('length_unit = "m"'))
    (tmp_path / "capture.toml").write_text(text, encoding="utf-8")
    for file in [*tomllib.loads(text)["reference"].values(), "trial-1.ply"]:
        (tmp_path / file).touch()
    with open_capture(tmp_path) as capture:
        assert [entry.name for entry in capture.entries] == ["RR", "RL", "FR", "FL", "1"]
        assert capture.target.diameter == 0.25


def test_every_named_command_exists():
    known = run("--help")
    for name in set(re.findall(r"`?wheelplane (?!as )([a-z][a-z-]+)", README)):
        assert re.search(rf"^  {name} ", known, re.MULTILINE), name


def test_the_library_is_used_as_shown(tmp_path, capsys):
    capture = write_small_capture(tmp_path / "capture", trials=0)
    code = "\n".join(block("import wheelplane as wp")).replace("demo-output/capture", str(capture))
    exec("import wheelplane as wp\n" + code, {})
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows] == ["RR", "RL", "FR", "FL"]
    assert all(abs(float(toe)) < 2.0 and 0.0 < float(u) < 0.1 for _, toe, u, _ in rows)
