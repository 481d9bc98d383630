"""What a capture states of its scans: columns of text and pitch of heights, in every command."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from tests.measurement.test_measure import NAMES
from tests.readers.test_formats import angles, clouds, measured, text
from wheelplane.batch.plan.settings import BatchSettings
from wheelplane.capture import CaptureOptions, open_capture, open_entries
from wheelplane.cli import main
from wheelplane.commands.shared.capture_options import read_options
from wheelplane.config import Config
from wheelplane.errors import ConfigError, InputError
from wheelplane.measure import measure_capture
from wheelplane.readers import AS_THE_FILE_SAYS, ReadOptions

COLUMNS = ("row", "col", "z", "x", "y", "-")


@pytest.fixture
def run(capsys, monkeypatch):
    """Exit code, standard output and standard error of a command."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wheelplane", *map(str, arguments)])
        with mock.patch.dict(os.environ), pytest.raises(SystemExit) as left:
            main()
        return left.value.code, *capsys.readouterr()

    return call


def write_rows(folder: Path, declared: str = "") -> Path:
    """The car as text of row, column, z, x, y and a colour, without names."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, points in zip(NAMES, clouds(), strict=True):
        row, column = np.divmod(np.arange(len(points)), 97)
        table = np.column_stack([row, column, points[:, [2, 0, 1]], row % 200])
        lines = text(table).replace(".0 ", " ").replace(".0\n", "\n")
        (folder / f"{name.lower()}.xyz").write_text(lines)
    reference = "".join(f'{name} = "{name.lower()}.xyz"\n' for name in NAMES)
    (folder / "capture.toml").write_text(f"{declared}\n[reference]\n{reference}")
    return folder


DECLARED = f"columns = {json.dumps(list(COLUMNS))}"


def test_columns_of_a_capture_lead_to_the_same_angles(tmp_path):
    reference = measured(tmp_path / "ply", "ply")
    with open_capture(write_rows(tmp_path / "rows", DECLARED), "disc-250") as capture:
        assert capture.reading == ReadOptions(COLUMNS)
        found = measure_capture(capture, Config())
    assert angles(found).tolist() == angles(reference).tolist()
    assert found.provenance.config["columns"] == list(COLUMNS)
    assert "columns" not in reference.provenance.config
    with (
        open_capture(write_rows(tmp_path / "bare"), "disc-250") as capture,
        pytest.raises(InputError, match=r"rr\.xyz: its first two columns are whole numbers"),
    ):
        measure_capture(capture, Config())


def test_the_command_line_replaces_what_the_capture_states(tmp_path):
    folder = write_rows(tmp_path, "pitch = [0.1, 0.2]")
    with open_entries(folder) as entries:
        assert entries.reading == ReadOptions(pitch=(0.1, 0.2))
        assert (entries.length_unit, len(entries.scans)) == ("m", 4)
    given = ReadOptions(COLUMNS)
    with open_capture(folder, "disc-250", CaptureOptions(reading=given)) as capture:
        assert capture.reading == given
    with open_entries(folder, given) as entries:
        assert entries.reading == given


@pytest.mark.parametrize(
    ("declared", "says"),
    [
        ('columns = ["x", "y"]', "capture.toml: columns or pitch: z is named 0 times: name it on"),
        ('columns = ["x", "y", "z", "shade"]', "the column 'shade' is unknown"),
        ('columns = "x,y,z"', "'?columns'?: "),
        ("pitch = [0.1, 0.0]", "columns or pitch: the pitch needs two numbers other than 0"),
        ("pitch = [0.1]", "pitch"),
        (f"{DECLARED}\npitch = [0.1, 0.1]", "has a pitch and no named columns"),
        ('colums = ["x", "y", "z"]', "did you mean 'columns'"),
    ],
)
def test_a_declaration_that_cannot_be_is_refused(tmp_path, declared, says):
    with (
        pytest.raises(ConfigError, match=says) as caught,
        open_capture(write_rows(tmp_path, declared), "disc-250"),
    ):
        pass
    assert len(str(caught.value).splitlines()) == 1


def test_the_commands_take_columns(tmp_path, run):
    folder = write_rows(tmp_path / "archive" / "capture")
    names = ",".join(COLUMNS)
    code, out, _ = run("measure", folder, "--target", "disc-250", "--columns", names, "--json")
    assert code == 0
    assert len(json.loads(out)["wheels"]) == 4
    code, _, err = run("measure", folder, "--target", "disc-250")
    assert (code, err.count("\n")) == (2, 1)
    assert "rr.xyz: its first two columns are whole numbers" in err
    wheel = folder / "rr.xyz"
    points = len(clouds()[0])
    for command in ("inspect", "plane"):
        code, out, _ = run(command, wheel, "--columns", names, "--json")
        tree = json.loads(out)
        assert (code, tree.get("points", tree.get("points_total"))) == (0, points)
        assert run(command, wheel)[0] == 2
    code, out, _ = run("inspect", folder, "--columns", names, "--json")
    assert [entry["points"] for entry in json.loads(out)["entries"]] == [len(p) for p in clouds()]
    results = tmp_path / "results"
    given = ("--target", "disc-250", "--columns", names, "--workers", 1)
    code, out, err = run("batch", tmp_path / "archive", "-o", results, *given)
    assert (code, "now: 1 ok" in out) == (0, True), (out, err)
    found = next((results / "measurements").rglob("*.json"))
    assert json.loads(found.read_text())["provenance"]["config"]["columns"] == list(COLUMNS)


def test_the_commands_take_a_pitch(tmp_path, run):
    heights = np.add.outer(0.02 * np.arange(60), 0.01 * np.arange(80))
    heights += np.random.default_rng(0).normal(0, 1e-3, heights.shape)
    path = tmp_path / "heights.csv"
    np.savetxt(path, heights, delimiter=",", fmt="%.5f")
    code, out, err = run("plane", path, "--pitch", "0.05,0.1", "--json", "--all-points")
    assert (code, err) == (0, "")
    normal = np.array(json.loads(out)["planes"][0]["normal"])
    expected = np.array([-0.2, -0.2, 1.0]) / np.linalg.norm([-0.2, -0.2, 1.0])
    # Noise of 1 mm over a side of 4 m and 4,800 points.
    bound = 5 * 1e-3 / (4.0 * np.sqrt(heights.size / 12))
    assert np.abs(normal * np.sign(normal[2]) - expected).max() < bound
    code, out, _ = run("inspect", path, "--pitch", "-0.05,-0.1", "--json")
    assert (code, json.loads(out)["raster"]) == (0, [60, 80])
    code, _, err = run("plane", path)
    assert (code, "give --pitch DX,DY" in err) == (2, True)


@pytest.mark.parametrize(
    ("columns", "pitch", "says"),
    [
        ("x,y", None, "--columns x,y: z is named 0 times"),
        (None, "0.1", "--pitch 0.1: two numbers DX,DY are needed, such as 0.05,0.1"),
        (None, "a,b", "--pitch a,b: two numbers DX,DY are needed"),
        (None, "0,1", "--pitch 0,1: the pitch needs two numbers other than 0"),
        (None, "inf,1", "--pitch inf,1: the pitch needs two numbers"),
        ("x,y,z", "1,1", "--columns x,y,z --pitch 1,1: a matrix of heights has a pitch and no n"),
    ],
)
def test_options_that_cannot_be_are_refused(columns, pitch, says):
    with pytest.raises(InputError) as caught:
        read_options(columns, pitch)
    assert str(caught.value).startswith(says)


def test_options_are_read():
    assert read_options(None, None) == AS_THE_FILE_SAYS
    assert read_options("X, y,z,-", None).columns == ("X", "y", "z", "-")
    assert read_options(None, " 0.5,-1e-3").pitch == (0.5, -1e-3)


def test_a_batch_without_them_keeps_its_settings():
    """The digest of results that users hold depends on what is stated, not on what could be."""
    plain = BatchSettings()
    told = plain.effective("folder")["told"]
    assert set(told) == set(asdict(CaptureOptions())) - {"reading"}
    stated = BatchSettings(options=CaptureOptions(reading=ReadOptions(COLUMNS)))
    assert stated.effective("folder")["told"]["columns"] == list(COLUMNS)
    assert stated.digest("folder") != plain.digest("folder")
    assert stated.digest("five-point") == plain.digest("five-point")
