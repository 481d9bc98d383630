"""Write the reports of a measurement to a folder, each file whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from pipeline.conformity import Conformity
from pipeline.errors import InputError
from pipeline.measurement import Measurement
from pipeline.report.budget_svg import budget_svg
from pipeline.report.json_report import to_json
from pipeline.report.picture import face_png
from pipeline.report.text import detailed_report
from pipeline.report.view import PAPER, View


def write_reports(
    measurement: Measurement,
    folder: Path,
    pictures: bool = True,
    conformity: Conformity | None = None,
    view: View = PAPER,
) -> list[Path]:
    """measurement.json, report.txt and a picture of every scanned target, into `folder`."""
    files = {
        "measurement.json": to_json(measurement, conformity, view.axis).encode(),
        "report.txt": detailed_report(measurement, conformity, view).encode(),
        "budget.svg": budget_svg(measurement, view.axis).encode(),
    }
    for result in measurement.wheels if pictures else ():
        png = face_png(result)
        if png is not None:
            files[_picture_name(result.observation.name, files)] = png
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}): name another") from error
    return [write_whole(folder / name, content) for name, content in files.items()]


def write_whole(path: Path, content: bytes) -> Path:
    """Write `content` under a temporary name beside `path`, then move it there."""
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            Path(temporary).chmod(0o666 & ~_umask())
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}): name another") from error
    return path


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _picture_name(name: str, taken: Iterable[str]) -> str:
    """A file name that every system takes, and that none of `taken` has."""
    stem = "target-" + "".join(c if c.isalnum() or c in "-_" else "_" for c in name)[:40]
    while f"{stem}.png".casefold() in (other.casefold() for other in taken):
        stem += "_"
    return f"{stem}.png"
