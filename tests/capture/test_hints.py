"""Hints: the operator's decisions are read, checked against the capture, and scaled to metres."""

from __future__ import annotations

import pytest

from tests.support.made import write_small_capture
from wheelplane.capture.hints import Hint
from wheelplane.capture.open_capture import CaptureOptions, open_capture
from wheelplane.errors import WheelplaneError

HINTS = """
[hints.FL]
near = [1.0, 2.0, 3.0]
by = "A. Lopes"
reason = "the other one is a hub cap"

[hints.1]
box = [[0, 0, 0], [1, 1, 1]]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return write_small_capture(tmp_path_factory.mktemp("made") / "car")


@pytest.fixture
def car(made, tmp_path):
    folder = tmp_path / "car"
    folder.mkdir()
    for file in made.iterdir():
        (folder / file.name).symlink_to(file) if file.suffix == ".ply" else None
    (folder / "capture.toml").write_text((made / "capture.toml").read_text())
    return folder


def add(folder, text, unit="m"):
    file = folder / "capture.toml"
    whole = file.read_text().replace('length_unit = "m"', f'length_unit = "{unit}"')
    file.write_text(whole + text)


def hints(folder, **options):
    with open_capture(folder, "disc-250", CaptureOptions(**options)) as capture:
        return dict(capture.hints)


def test_hints_are_read_by_the_name_of_the_scan(car):
    add(car, HINTS)
    assert hints(car) == {
        "FL": Hint((1.0, 2.0, 3.0), by="A. Lopes", reason="the other one is a hub cap"),
        "1": Hint(None, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    }


def test_hints_are_in_the_unit_of_the_scans(car):
    add(car, "\n[hints.FL]\nnear = [1000, 2000, 3000]\n", "mm")
    assert hints(car)["FL"].near_m == (1.0, 2.0, 3.0)
    assert hints(car, hints={"FL": (500.0, 0.0, 0.0)})["FL"].near_m == (0.5, 0.0, 0.0)


def test_the_command_line_replaces_the_point_and_keeps_the_box(car):
    add(car, "\n[hints.FL]\nnear = [1, 2, 3]\nbox = [[0, 0, 0], [1, 1, 1]]\n")
    found = hints(car, hints={"FL": (9.0, 9.0, 9.0), "RR": (1.0, 0.0, 0.0)})
    assert found["FL"] == Hint((9.0, 9.0, 9.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert found["RR"].near_m == (1.0, 0.0, 0.0)


SQUARE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))


def test_a_region_is_read_and_scaled(car):
    corners = [[1000 * x for x in corner] for corner in SQUARE]
    add(car, f"\n[hints.FL]\nregion = {corners}\n", "mm")
    assert hints(car)["FL"] == Hint(region_m=SQUARE)
    assert hints(car)["FL"].stated() == {"region_m": SQUARE}


def test_the_latest_choice_of_a_scan_counts(car):
    add(car, f"\n[hints.FL]\nregion = {[list(corner) for corner in SQUARE]}\n")
    add(car, "\n[hints.FR]\nnear = [1, 2, 3]\nby = 'A. Lopes'\n")
    found = hints(car, hints={"FL": (9.0, 9.0, 9.0)}, regions={"FR": SQUARE})
    assert found == {"FL": Hint((9.0, 9.0, 9.0)), "FR": Hint(region_m=SQUARE)}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[hints.FL]\nregion = [[0, 0, 0], [1, 0, 0]]", r"capture.toml: hints.FL.region"),
        (
            "[hints.FL]\nregion = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]",
            r"'FL': region: its corners lie",
        ),
        ("[hints.FL]\nregion = [[0, 0, 0], [1, 0, 0], [1, 1, nan]]", r"hints.FL.region"),
        ("[hints.VL]\nnear = [1, 2, 3]", r"hint 'VL': there is no such scan: name one of RR, RL,"),
        ("[hints.FL]\nby = 'A'", r"hint 'FL': add near = \[x, y, z\]"),
        ("[hints.FL]\nbox = [[0, 0, 0], [1, 0, 1]]", r"hint 'FL': box: the first corner"),
        ("[hints.FL]\nnear = [1, 2]", r"'hints.FL.near.2' is missing"),
        ("[hints.FL]\nnear = [1, 2, nan]", r"capture.toml: hints.FL.near"),
        ("[hints.FL]\nnaer = [1, 2, 3]", r"unknown key 'hints.FL.naer': did you mean 'near'"),
    ],
)
def test_a_hint_that_cannot_be_is_refused_with_its_name(car, text, message):
    add(car, f"\n{text}\n")
    with pytest.raises(WheelplaneError, match=message):
        hints(car)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[hints.FL]\nnear = [1, 2, 3]", r"hints name the targets of FL: add RR, RL, FR"),
        ("[hints.vehicle]\nnear = [1, 2, 3]", "near is for RR, RL, FR and FL"),
        ("[hints.FL]\nbox = [[0, 0, 0], [1, 1, 1]]", "a box is for 'vehicle'"),
        ("[hints.FL]\nregion = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]", "a region is for 'vehicle'"),
    ],
)
def test_of_a_cloud_all_wheels_are_named_or_none(tmp_path, text, message):
    (tmp_path / "whole.xyz").write_text("0 0 0\n")
    (tmp_path / "capture.toml").write_text(f'cloud = "whole.xyz"\n{text}\n')
    with pytest.raises(WheelplaneError, match=message):
        hints(tmp_path)
