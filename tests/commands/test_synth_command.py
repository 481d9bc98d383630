"""`wheelplane synth --whole`: what it writes, says, and refuses."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from tests.support.made import read_ply
from wheelplane.commands import synth as command

ROOT = Path(__file__).resolve().parents[2]


def synth(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "wheelplane", "synth", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_whole_vehicle_is_one_cloud_with_its_truth(tmp_path):
    out = tmp_path / "car"
    run = synth(out, "--whole", "--points", "2e4", "--seed", 3)
    points, _ = read_ply(out / "vehicle.ply")
    said = f"wrote {out}: vehicle.ply, {len(points)} points, five-point.txt, truth.json"
    shown = json.loads((out / "truth.json").read_text())
    front = ",".join(f"{axis:.2f}" for axis in shown["frame"]["forward"])
    then = f"wheelplane measure {out / 'vehicle.ply'} --target disc-250 --front={front}"
    assert run.stdout.splitlines() == [said, f"measure it: {then}"]
    assert (run.returncode, run.stderr) == (0, "")
    assert shown["seed"] == 3
    assert shown["used"]["panorama"]["points"] == 20_000
    assert sum(scan["points"] for scan in shown["used"]["scans"]) == len(points)


@pytest.mark.slow
def test_an_e57_is_asked_for_by_name(tmp_path):
    pytest.importorskip("pye57")
    run = synth(tmp_path / "car", "--whole", "e57", "--points", 1e4)
    assert (run.returncode, run.stderr) == (0, "")
    names = sorted(path.name for path in (tmp_path / "car").iterdir())
    assert names == ["five-point.txt", "truth.json", "vehicle.e57"]


@pytest.mark.parametrize(
    ("arguments", "fact"),
    [
        (("--points", "2e4"), "--points without --whole"),
        (("--whole", "--trials", "2"), "--trials with --whole"),
        (("--whole", "pcd"), "'pcd' is not one of 'ply', 'e57'"),
        (("--whole", "--points", "5"), "'--points'"),
        (("--whole", "--vehicle", "saloon-turning"), "a whole vehicle is scanned at rest"),
        (("--whole", "--target", "disc"), "disc"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(tmp_path, arguments, fact):
    run = synth(tmp_path / "car", *arguments)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("wheelplane: ")
    assert fact in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_command_that_measures_a_cloud_can_be_pasted(monkeypatch):
    tree = {"frame": {"forward": [0.0, 1.0, 0.0]}}
    made = SimpleNamespace(used={"scans": [{"points": 3}]}, to_json=lambda: tree)
    monkeypatch.setattr(command, "_make", lambda *_: made)
    arguments = ["my car", "--whole", "--target", "my targets/disc.toml"]
    shown = CliRunner().invoke(command.synth, arguments, standalone_mode=False).output
    line = shown.splitlines()[1].removeprefix("measure it: wheelplane ")
    pasted = ["measure", "my car/vehicle.ply", "--target", "my targets/disc.toml"]
    assert shlex.split(line) == [*pasted, "--front=0.00,1.00,0.00"]


def test_help_tells_of_whole_vehicles():
    text = " ".join(synth("--help").stdout.split())
    assert "wheelplane synth car --seed 7 --whole --points 2e6" in text
    assert "which way is forward in the cloud's coordinates" in text
