"""Measurement that a process of the page stored in a folder, read without running what is in it."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path
from typing import Any

from ...config import Section
from ...errors import InputError, Wording
from ...files import lies_in
from ...measurement import Conformity, Measurement
from ...report.json.stored import RECORD, read_measurement

PICKLE = "measurement.pickle"
OURS = __package__.partition(".")[0]
ROOMS = {"capture", "centre", "cloud", "errors", "measurement", "plane", "targets", "uncertainty",
         "vehicle", "validation"}  # fmt: skip
ARRAYS = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "_reconstruct"),
}


def store(found: object, path: Path) -> None:
    """Write records and arrays to a file."""
    path.write_bytes(pickle.dumps(found))


def load(folder: Path) -> tuple[Measurement, Conformity | None]:
    """Load the measurement in a folder, and its conformity.

    Where it was stored by another version, or not by the page, measurement.json stands for it,
    which lacks the points. Raises InputError.
    """
    path = folder / PICKLE
    if path.is_file() and lies_in(path, folder):
        try:
            found = load_records(path)
            if isinstance(found, tuple) and isinstance(found[0], Measurement) and whole(found[0]):
                return found
        except InputError:
            pass
    return read_measurement(folder / RECORD, RECORD)


def load_records(path: Path) -> Any:
    """Load what `store` wrote: records of this program and arrays, and nothing else.

    A file from elsewhere can neither name a function to be called nor a class with effects. Raises
    InputError for any other content.
    """
    try:
        with path.open("rb") as stream:
            return _Records(stream).load()
    except Exception as error:  # of damaged data, any
        raise InputError(f"{path.name}: not stored by this version: measure again") from error


def whole(found: object) -> bool:
    """Return whether a record, and each in it, has all fields of its class in this version."""
    if dataclasses.is_dataclass(found):
        fields = [field.name for field in dataclasses.fields(found)]
        return vars(found).keys() >= set(fields) and all(whole(getattr(found, f)) for f in fields)
    return not isinstance(found, tuple) or all(map(whole, found))


class _Records(pickle.Unpickler):
    """Reader of pickles that knows arrays, and this program's dataclasses, settings, sentences."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a class that is allowed. Raises UnpicklingError for all else."""
        if (module, name) in ARRAYS:
            return super().find_class(module, name)
        package, room, *_ = [*module.split("."), ""]
        if package == OURS and room in ROOMS and "." not in name:
            found = super().find_class(module, name)
            if isinstance(found, type) and (
                dataclasses.is_dataclass(found) or issubclass(found, Section | Wording)
            ):
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no record")
