"""Files of a machine under test in the folder of a capture: its item file, and its readings."""

from __future__ import annotations

from pathlib import Path

from ...calibration import FaultyTableError
from ...capture import check_inside
from ...errors import InputError

ITEM, READINGS = "item.toml", ("readings.csv", "readings.xlsx")
MOST_FAULTS = 5


def has_machine(folder: Path) -> bool:
    """Return whether a capture's folder holds any file of a machine under test."""
    return any((folder / name).exists() for name in (ITEM, *READINGS))


def machine_files(folder: Path, archive: Path | None) -> tuple[Path, Path]:
    """Return item file and readings. Raises InputError unless there is one of each.

    archive: folder that they must lie in; None for no limit.
    """
    there = [name for name in READINGS if (folder / name).exists()]
    for name in (ITEM, *there):
        check_inside(archive, folder / name, name, str(folder))
    if len(there) != 1:
        files = " and ".join(there) or "no readings"
        raise InputError(f"{files} beside {ITEM}: one of {' or '.join(READINGS)} is needed")
    return folder / ITEM, folder / there[0]


def in_words(error: Exception, folder: Path) -> str:
    """Return an error of these files in one line, the first of many faults."""
    if not isinstance(error, FaultyTableError):
        return " ".join(str(error).replace(f"{folder}/", "").split())
    more = len(error.faults) - MOST_FAULTS
    parts = [*error.faults[:MOST_FAULTS], *([f"{more} more"] if more > 0 else [])]
    return " ".join("; ".join(parts).split())
