"""Five-point files with one wrong digit, and clean ones: what is named, and what moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tests.support.paths import DATA
from tests.support.validation_cars import TM30, Car
from wheelplane.errors import InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.check_blocks import check_blocks
from wheelplane.five_point.file import FivePointFile, read_five_point

PAPER = DATA / "paper" / "figure-4.txt"
TEXT = PAPER.read_text("ascii")


def paper():
    """Blocks (8, 5, 3) of the paper's file."""
    return read_five_point(PAPER).blocks_m.copy()


def file(blocks):
    """A file with these blocks."""
    return FivePointFile(blocks, "five.txt", "", ())


def angles(measurement):
    """Toe and camber (M, 2) of all blocks, without suspect points."""
    return np.array([[w.evaluated.toe_rad, w.evaluated.camber_rad] for w in measurement.wheels])


def u(measurement):
    """Their standard uncertainties (M, 2)."""
    return np.column_stack([measurement.uncertainty.toe_rad, measurement.uncertainty.camber_rad])


def flagged(blocks, station=None, radius_m=None):
    """Indices of implausible blocks."""
    checks = check_blocks(blocks, station, radius_m)
    return [index for index, check in enumerate(checks) if check.status != "ok"]


@cache
def single_digit_changes():
    """Line, and the whole text, of every change of one digit of the paper's file to another."""
    return [
        (TEXT.count("\n", 0, at) + 1, TEXT[:at] + digit + TEXT[at + 1 :])
        for at, old in enumerate(TEXT)
        if old.isdigit()
        for digit in "0123456789"
        if digit != old
    ]


@dataclass
class Change:
    """One change that is read: largest move of an angle, in the u printed and in the clean one.

    Both where blocks are not checked. named: the block, and no other; right: the point as well;
    left: the largest error of an angle without the point, in the clean u.
    """

    printed: float
    clean: float
    named: bool
    right: bool
    left: float


def judge(changes, folder):
    """Return the changes that are not refused, and leave every block an angle, judged."""
    clean = measure_five_point(file(paper()))
    judged = []
    for line, text in changes:
        (folder / "five.txt").write_text(text)
        try:
            read = read_five_point(folder / "five.txt")
            plain = measure_five_point(read, check=False)
        except InputError:
            continue
        if not plain.complete:
            continue
        moved = np.abs(angles(plain) - angles(clean))
        bad = flagged(read.blocks_m)
        named, right, left = bad == [(line - 1) // 5], False, np.inf
        if named:
            found = measure_five_point(read)
            right = found.wheels[bad[0]].observation.suspect.line == line
            left = float((np.abs(angles(found) - angles(clean)) / u(clean)).max())
        sizes = float((moved / u(plain)).max()), float((moved / u(clean)).max())
        judged.append(Change(*sizes, named, right, left))
    return judged


def clean_files(count, seed):
    """Files of the generator's total station, from any direction, with four to eight blocks."""
    return (Car((seed, index), index % 5).blocks(TM30)[0] for index in range(count))
