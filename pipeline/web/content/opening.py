"""A measurement.json, or a folder with one, -> all that the page shows of it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...files import lies_in
from ...report.json.stored import RECORD, read_measurement
from ..files.stored import load
from .measuring import Send, about, write_results

POINTS = ("points.json", "points.bin")


def open_measurement(plan: dict[str, Any], send: Send) -> None:
    """Open the source of the plan; the points of the scans, too, where the page kept them there."""
    out, allowed = Path(plan["out"]), Path(plan["allowed"])
    os.chdir(plan["base"])
    source = Path(plan["source"])
    file = source / RECORD if source.is_dir() else source
    if not lies_in(file, allowed):
        raise InputError(f"{source}: {file.name} leads outside the allowed folder: copy it there")
    found = load(source) if source.is_dir() else read_measurement(file, str(source))
    write_results(*found, out)
    shutil.copyfile(file, out / RECORD)  # with what only its first writer knew
    send("about", {"name": found[0].provenance.source} | about(found[0]))
    send("ready", True)
    points = [source / name for name in POINTS]
    if all(path.is_file() and lies_in(path, allowed) for path in points):
        for path in points:
            shutil.copyfile(path, out / path.name)
