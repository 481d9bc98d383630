"""Write the reports of a measurement to a folder, each file whole or not at all.

What makes them is imported when they are made: most commands print, and write none.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..measurement import Conformity, Measurement
from ..system import frozen
from .format.language import load_translations
from .format.report_options import ReportOptions
from .format.view import PAPER

if TYPE_CHECKING:
    from .html.document import Document


@frozen
class ReportFiles:
    """Which reports to write beside measurement.json, report.txt and budget.svg."""

    pictures: bool = True
    html: bool = True
    pdf: bool = False


EVERYDAY = ReportFiles()
REPORTS = ("report.html", "report.pdf", "target-*.png")


def write_reports(
    measurement: Measurement,
    folder: Path,
    conformity: Conformity | None = None,
    options: ReportOptions | None = None,
    wanted: ReportFiles = EVERYDAY,
) -> list[Path]:
    """Write measurement.json, report.txt, budget.svg and the wanted reports to `folder`.

    Reports of an earlier measurement that this one does not replace are removed: they would stand
    beside its numbers as its own.
    """
    from .json.measurement import to_json
    from .plots.budget import budget_drawing
    from .plots.files import file_name
    from .plots.target_face import face_png
    from .text.report import detailed_report

    options = options or ReportOptions(load_translations("en"), PAPER)
    view = options.view
    files = {
        "measurement.json": to_json(measurement, conformity, view.axis, options.before).encode(),
        "report.txt": detailed_report(measurement, conformity, view, options.before).encode(),
        "budget.svg": budget_drawing(measurement, options.words, view.axis).svg.encode(),
    }
    files |= report_files(measurement, conformity, options, wanted)
    for result in measurement.wheels if wanted.pictures else ():
        png = face_png(result, measurement.frame, options.words)
        if png is not None:
            files[file_name(f"target-{result.observation.name}", "png", files)] = png
    return write_result(folder, files, "measurement.json", REPORTS)


def report_files(
    measurement: Measurement,
    conformity: Conformity | None,
    options: ReportOptions,
    wanted: ReportFiles,
) -> dict[str, bytes]:
    """Return the wanted forms of the report by file name. Raises MissingDependencyError."""
    if not (wanted.html or wanted.pdf):
        return {}
    from .html.page import page_of, rendered

    page, files = page_of(measurement, conformity, options), {}
    if wanted.html:
        files["report.html"] = rendered(page).encode()
    if wanted.pdf:
        files["report.pdf"] = _printed(rendered(page, still=True))
    return files


def document_files(
    stem: str, document: Document, options: ReportOptions, wanted: ReportFiles
) -> dict[str, bytes]:
    """Return the wanted forms of a document by file name. Raises MissingDependencyError."""
    from .html.document import document_html

    page = document_html(document, options.words, options.laboratory)
    files = {f"{stem}.html": page.encode(errors="backslashreplace")} if wanted.html else {}
    if wanted.pdf:
        files[f"{stem}.pdf"] = _printed(page)
    return files


def _printed(page: str) -> bytes:
    """Return a page as PDF, whose identifier is a hash of the page."""
    from .html.pdf import pdf_report

    identifier = hashlib.sha256(page.encode(errors="backslashreplace")).hexdigest()[:32]
    return pdf_report(page, identifier)


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write files, content by name, to `folder`; create the folder where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be created ({error.strerror}): give another folder"
        ) from error
    return [write_whole(folder / name, content) for name, content in files.items()]


def write_result(
    folder: Path, files: Mapping[str, bytes], record: str, others: Iterable[str]
) -> list[Path]:
    """Write files as `write_files`, and remove what an earlier result left in the folder.

    record: the file that every result of this kind has; where there is none, nothing is of one.
    others: patterns of the names that a result may have besides.
    """
    there = (folder / record).is_file()
    earlier = {path for pattern in others if there for path in folder.glob(pattern)}
    written = write_files(folder, files)
    for path in earlier - set(written):
        path.unlink(missing_ok=True)
    return written


def keep_inputs(outputs: Iterable[Path | None], inputs: Iterable[Path]) -> None:
    """Raise InputError where an output of a command would replace a file that it reads, or writes.

    What is no regular file, such as /dev/stdout, takes several.
    """
    read = [path for path in inputs if path.exists()]
    named = set[Path]()
    for path in outputs:
        if path is None or (path.exists() and not path.is_file()):
            continue
        if path.is_file() and any(path.samefile(one) for one in read):
            raise InputError(f"{path}: this command reads it: give another path for its output")
        if path.resolve() in named:
            raise InputError(f"{path}: two outputs go to this file: give a path for each")
        named.add(path.resolve())


def write_whole(path: Path, content: bytes) -> Path:
    """Write `content` under a temporary name beside `path`, then move it there.

    What is no regular file, such as /dev/stdout or a pipe, is written to, never replaced.
    """
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return path
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
        raise InputError(
            f"{path}: cannot be written ({error.strerror}): give another path"
        ) from error
    return path


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
