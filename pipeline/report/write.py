"""Write the reports of a measurement to a folder, each file whole or not at all."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.conformity import Conformity
from pipeline.errors import InputError
from pipeline.measurement import Measurement
from pipeline.report.budget_svg import budget_svg
from pipeline.report.html import Dress, html_report
from pipeline.report.json_report import to_json
from pipeline.report.language import load_words
from pipeline.report.pdf import pdf_report
from pipeline.report.picture import face_png
from pipeline.report.plots import file_name
from pipeline.report.text import detailed_report
from pipeline.report.view import PAPER


@dataclass(frozen=True)
class Wanted:
    """Which reports to write beside measurement.json, report.txt and budget.svg."""

    pictures: bool = True
    html: bool = True
    pdf: bool = False


EVERYDAY = Wanted()


def write_reports(
    measurement: Measurement,
    folder: Path,
    conformity: Conformity | None = None,
    dress: Dress | None = None,
    wanted: Wanted = EVERYDAY,
) -> list[Path]:
    """measurement.json and what is wanted beside it, into `folder`."""
    dress = dress or Dress(load_words("en"), PAPER)
    view = dress.view
    files = {
        "measurement.json": to_json(measurement, conformity, view.axis).encode(),
        "report.txt": detailed_report(measurement, conformity, view).encode(),
        "budget.svg": budget_svg(measurement, view.axis).encode(),
    }
    if wanted.html:
        files["report.html"] = html_bytes(measurement, conformity, dress)
    if wanted.pdf:
        files["report.pdf"] = pdf_bytes(measurement, conformity, dress)
    for result in measurement.wheels if wanted.pictures else ():
        png = face_png(result, measurement.frame)
        if png is not None:
            files[file_name(f"target-{result.observation.name}", "png", files)] = png
    return write_files(folder, files)


def html_bytes(measurement: Measurement, conformity: Conformity | None, dress: Dress) -> bytes:
    """The page."""
    return html_report(measurement, conformity, dress).encode()


def pdf_bytes(measurement: Measurement, conformity: Conformity | None, dress: Dress) -> bytes:
    """The same, printed. Raises MissingDependencyError."""
    page = html_report(measurement, conformity, dress, still=True)
    return pdf_report(page, hashlib.sha256(page.encode()).hexdigest()[:32])


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Name and content of each, into `folder`, which is made where it is not there."""
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
