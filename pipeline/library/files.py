"""Files that a program reads: five points, and measurements that were saved."""

from __future__ import annotations

import os
from pathlib import Path

from .. import five_point
from ..errors import InputError
from ..report.json.stored import RECORD, read_measurement
from .alignment import Alignment
from .messages import library_errors
from .scans import is_path

read_five_point = library_errors(five_point.read_five_point)


@library_errors
def open_measurement(path: str | os.PathLike[str]) -> Alignment:
    """Read a measurement.json, or the one in a folder of results, as `measure` returned it.

    Every angle is computed again from the poses and their covariance, and the verdict by the limits
    that the file states. What only the points of the
    scans show, such as their noise and the maps of the targets, is not in the file, nor in the
    result. Raises InputError, one line; also where the file states a value that its poses
    contradict, so that a file that was edited is seen.
    """
    if not is_path(path):
        kind = type(path).__name__
        raise InputError(f"a {kind} is no measurement.json: give its path, or that of its folder")
    file = Path(path)
    file = file / RECORD if file.is_dir() else file
    measurement, conformity = read_measurement(file, str(file))
    return Alignment(measurement, file.absolute(), conformity)
