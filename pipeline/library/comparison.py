"""Comparison of a measurement with another method."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from ..five_point import FivePointFile, read_five_point
from ..validation import Comparison, Request, compare_with_points, points_of
from .alignment import Alignment


def validate(alignment: Alignment, five_points: FivePointFile | str | Path) -> Comparison:
    """Compare a measurement from scans with five points on the same wheels, in the same order.

    five_points: a file that `read_five_point` read, or its path. The comparison states whether the
    methods agree within their uncertainties (`verdict`), and where not.

    Raises InputError where the two cannot be of one vehicle, or differ in their wheels.
    """
    if not isinstance(alignment, Alignment):
        kind = type(alignment).__name__
        raise InputError(f"a {kind} is no alignment: give what `measure` returns")
    file = read_five_point(five_points) if isinstance(five_points, (str, Path)) else five_points
    if not isinstance(file, FivePointFile):
        kind = type(file).__name__
        raise InputError(f"a {kind} is no five-point file: give one that was read, or its path")
    points = points_of(file, list(alignment.wheels))
    return compare_with_points(alignment.measurement, points, Request("five-point"))
