"""Errors of the library: in its own words, of the types and in the one line of the program's."""

from __future__ import annotations

import ast
import pickle
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import wheelplane as wp
from tests.support.made import write_small_capture
from wheelplane.library.messages import (
    ADVICE,
    ARGUMENTS,
    DECLARED,
    OPTION,
    in_library_words,
    library_errors,
)

PIPELINE = Path(__file__).resolve().parents[2] / "pipeline"
# Rooms whose errors the library raises; not their options of other commands.
ROOMS = (
    *("readers", "capture", "detection", "measurement", "diagnostics", "five_point", "kinematics"),
    *("wheel", "centre", "plane", "targets", "report/format"),
)
OF_COMMANDS = {"sample", "radius", "tolerance", "before", "digits", "total-station-position"}


def strings() -> Iterator[str]:
    """All texts in those rooms that name an option of the command line."""
    for room in ROOMS:
        for path in sorted((PIPELINE / room).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            for node in ast.walk(tree):
                text = node.value if isinstance(node, ast.Constant) else None
                if isinstance(text, str) and id(node) not in docs and OPTION.search(text):
                    yield text


def test_every_option_that_an_error_may_name_has_words_in_the_library():
    named = {found for text in strings() for found in OPTION.findall(text)}
    assert len(named) > 10
    by_advice = {found for advice in ADVICE for found in OPTION.findall(advice)}
    assert named <= ARGUMENTS | set(DECLARED) | by_advice | OF_COMMANDS
    assert not any("--" in instead for instead in ADVICE.values())


def test_advice_on_blocks_is_to_order_them(tmp_path):
    capture = write_small_capture(tmp_path / "capture")
    file, measured = capture / "five-point.txt", wp.measure(capture)
    rows = file.read_text().splitlines(keepends=True)
    assert len(rows) == 25
    file.write_text("".join(rows[:20]))
    with pytest.raises(wp.InputError, match=r"5 scans .*: give a block for each scan, in"):
        wp.validate(measured, file)
    file.write_text("".join([*rows[5:10], *rows[:5], *rows[15:20], *rows[10:15], *rows[20:]]))
    with pytest.raises(wp.InputError, match=r"give the blocks in the order of the scans$"):
        wp.validate(measured, file)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("check --target and length_unit", "check target and length_unit"),
        ("give --length-unit mm, or length_unit", "give length_unit mm, or length_unit"),
        ("give --up floor if z", "give up of a capture.toml floor if z"),
        ("choose the four by --hint", "choose the four by [hints] of a capture.toml"),
        ("--columns (or columns in capture.toml) is not", "columns in capture.toml is not"),
        ("x with --sample", "x with sample of the command"),
        ("nothing - or -- of it", "nothing - or -- of it"),
    ],
)
def test_options_are_arguments_or_what_a_capture_states(message, words):
    assert in_library_words(message) == words


def test_errors_keep_their_type_and_status():
    @library_errors
    def fail(status: str) -> None:
        """Fail."""
        raise wp.NotMeasuredError(status, "scan again, or check --target")

    with pytest.raises(wp.NotMeasuredError, match=r"scan again, or check target$") as caught:
        fail("no-target")
    assert caught.value.status == "no-target"
    assert (fail.__name__, fail.__doc__) == ("fail", "Fail.")


@pytest.mark.parametrize(
    "error", [wp.InputError("a: b"), wp.ConfigError("c"), wp.NotMeasuredError("no-plane", "d")]
)
def test_errors_come_back_from_another_process(error):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


@pytest.mark.parametrize("form", ["memory", "capture"])
def test_no_error_of_a_measurement_names_an_option(form, tmp_path):
    noise = np.random.default_rng(0).uniform(size=(5000, 3))
    capture = write_small_capture(tmp_path / "capture")
    scans: object = {"RR": noise, **dict.fromkeys(("RL", "FR", "FL"), capture / "rl.ply")}
    if form == "capture":
        (capture / "rr.ply").unlink()
        text = (capture / "capture.toml").read_text().replace("rr.ply", "rr.xyz")
        (capture / "capture.toml").write_text(text)
        table = np.column_stack([np.arange(5000.0), noise])
        np.savetxt(capture / "rr.xyz", table, fmt=["%d", "%.6f", "%.6f", "%.6f"])
        scans = capture
    with pytest.raises(wp.InputError) as caught:
        wp.measure(scans, "disc-250")
    assert not OPTION.search(str(caught.value))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda path: wp.read_five_point(path, length_unit="km"), "length_unit is 'km': give"),
        (lambda path: wp.read_five_point(path, coordinates="spherical"), "give angle_unit deg"),
        (lambda path: wp.measure(path.parent, vertical="gravity"), ": vertical gravity: "),
    ],
)
def test_arguments_are_named_as_they_are_written(call, says, tmp_path):
    path = write_small_capture(tmp_path / "capture") / "five-point.txt"
    with pytest.raises(wp.InputError, match=says):
        call(path)
