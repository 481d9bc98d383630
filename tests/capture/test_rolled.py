"""Positions of a vehicle that has rolled, as capture.toml declares them."""

import math

import pytest

from wheelplane.capture import open_capture
from wheelplane.errors import InputError

WHEELS = ("RR", "RL", "FR", "FL")
REFERENCE = "[reference]\n" + "".join(f'{w} = "{w}.ply"\n' for w in WHEELS)


def runout(wheel, position="half", angle=180.0, name=None):
    """Lines of one scan of a rolled vehicle."""
    own = f'wheel = "{wheel}"\nposition = "{position}"\n' if wheel else ""
    name = name or f"{wheel} {position}"
    return f'[[runout]]\nname = "{name}"\nfile = "{name}.ply"\nangle_deg = {angle}\n{own}'


def opened(folder, *parts):
    text = 'target = "wheel"\n' + "".join(parts)
    (folder / "capture.toml").write_text(text, encoding="utf-8")
    for line in text.splitlines():
        name = line.partition(' = "')[2].removesuffix('"')
        if name.endswith(".ply"):
            (folder / name).write_text("", encoding="utf-8")
    with open_capture(folder) as capture:
        return capture


def test_each_position_has_the_four_wheels_at_one_rotation(tmp_path):
    own = [runout(wheel, "half", 180.0) for wheel in WHEELS]
    own += [runout(wheel, "on", 300.0) for wheel in reversed(WHEELS)]
    rolled = opened(tmp_path, REFERENCE, *own).entries[4:]
    assert {e.role for e in rolled} == {"runout"}
    found = {(e.wheel, e.turn.position, round(math.degrees(e.turn.angle_rad))) for e in rolled}
    assert found == {(w, p, a) for w in WHEELS for p, a in (("half", 180), ("on", 300))}


def test_clouds_of_a_rolled_vehicle_follow_the_first(tmp_path):
    capture = opened(tmp_path, 'cloud = "car.ply"\n', runout(None, name="half"))
    assert capture.cloud.file == "car.ply"
    assert [(e.role, e.turn.position, e.file) for e in capture.rolled] == [
        ("vehicle", "half", "half.ply")
    ]
    assert capture.steps == 12
    assert capture.entries == ()


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        ([REFERENCE, *map(runout, WHEELS[:3])], "position 'half' has RR, RL, FR: a vehicle that"),
        (
            [REFERENCE, *map(runout, WHEELS[:3]), runout("FL", angle=170.0)],
            "once, with the same position and angle_deg",
        ),
        (
            [REFERENCE, *map(runout, WHEELS), runout("FL", name="again")],
            "has RR, RL, FR, FL, FL: a vehicle that rolled",
        ),
        ([REFERENCE, runout(None, name="half")], "'half' names no wheel: add wheel"),
        (['cloud = "car.ply"\n', runout("RR")], "'RR half' is of RR, in a capture of one cloud"),
        (
            [
                REFERENCE,
                *map(runout, WHEELS),
                '[[sweep]]\nname = "s"\nfile = "s.ply"\nwheel = "FL"\n',
            ],
            "'s' is of a sweep, in a capture of a vehicle that rolled",
        ),
        (
            [
                REFERENCE,
                '[[trial]]\nname = "t"\nfile = "t.ply"\nrepeats = "RR"\n',
                *map(runout, WHEELS),
            ],
            "'t' repeats RR, in a capture of a vehicle that rolled",
        ),
        (  # its u was 600 times too small: the frame of one position has the centres' run-out
            [
                REFERENCE,
                '[[trial]]\nname = "t"\nfile = "t.ply"\nwheel = "RR"\n',
                *map(runout, WHEELS),
            ],
            "'t' is a trial, in a capture of a vehicle that rolled",
        ),
    ],
)
def test_what_is_not_a_position_of_a_vehicle_is_refused(tmp_path, parts, line):
    with pytest.raises(InputError, match=line):
        opened(tmp_path, *parts)


def test_a_position_that_some_run_outs_lack_is_refused(tmp_path):
    plain = runout("FL").replace('position = "half"\n', "")
    with pytest.raises(InputError, match=r"a position that is not named has FL|'half' has RR"):
        opened(tmp_path, REFERENCE, *map(runout, WHEELS[:3]), plain)
