"""Verticals stated in capture.toml: senses, and one line for what is missing."""

import math

import pytest

from wheelplane.capture.declaration import CaptureFile
from wheelplane.capture.vertical import stated_verticals
from wheelplane.errors import InputError


def stated(**entries):
    return stated_verticals(CaptureFile.model_validate(entries), "capture.toml")


def test_gravity_falls_and_the_floors_normal_rises():
    assert stated() == ()
    floor, gravity = stated(
        gravity=(0.0, 0.0, -9.81), gravity_u_deg=0.01, floor=(0.0, 3.0, 4.0), floor_u_deg=0.02
    )
    assert (gravity.kind, gravity.up) == ("gravity", (0.0, 0.0, 1.0))
    assert (floor.kind, floor.up) == ("floor", (0.0, 0.6, 0.8))
    assert (gravity.u_rad, floor.u_rad) == (math.radians(0.01), math.radians(0.02))
    assert gravity.note == "gravity = [0, 0, -9.81]"


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"gravity": (0.0, 0.0, -1.0)}, "add gravity_u_deg"),
        ({"floor_u_deg": 0.1}, "without floor = "),
        ({"gravity": (0.0, 0.0, 0.0), "gravity_u_deg": 0.1}, "has no length"),
    ],
)
def test_what_is_missing_is_one_line(entries, words):
    with pytest.raises(InputError, match=words) as error:
        stated(**entries)
    assert str(error.value).startswith("capture.toml: ")
