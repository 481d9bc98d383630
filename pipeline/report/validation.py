"""Write the reports of a validation to a folder."""

from __future__ import annotations

from pathlib import Path

from ..validation import Comparison, ComparisonStudy, Mountings
from .format.language import load_translations
from .format.report_options import ReportOptions
from .format.view import PAPER, View
from .format.writer import Writer
from .html.comparison import comparison_document, mountings_document, study_document
from .html.document import Document, document_html
from .json.validation import validation_json
from .plots.validation import bland_altman_drawing, differences_drawing, line_drawing
from .tables.comparison import labels
from .text.validation import mountings_text, survey_text, validation_text
from .write import EVERYDAY, ReportFiles, document_files, write_result

REPORTS = ("validation.html", "validation.pdf", "differences.svg", "bland-altman-*.svg",
           "line-*.svg")  # fmt: skip
Validated = Comparison | ComparisonStudy | Mountings


def validation_report(found: Validated, view: View = PAPER) -> str:
    """Return the text report of one capture or of many; printable whatever bytes a path holds."""
    if isinstance(found, Mountings):
        text = mountings_text(found, view)
    elif isinstance(found, Comparison):
        text = validation_text(found, view)
    else:
        text = survey_text(found, view)
    return text.encode(errors="backslashreplace").decode()


def validation_html(found: Validated, options: ReportOptions) -> str:
    """Return validation.html, one file that needs no network."""
    writer = Writer(options.words, options.view)
    document = _document(found, writer, validation_json(found))
    return document_html(document, options.words, options.laboratory)


def write_validation(
    found: Validated,
    folder: Path,
    options: ReportOptions | None = None,
    wanted: ReportFiles = EVERYDAY,
) -> list[Path]:
    """Write validation.json, validation.txt, the plots and the wanted reports to `folder`.

    Reports and plots of an earlier validation that this one does not replace are removed.
    """
    options = options or ReportOptions(load_translations("en"), PAPER)
    record, words = validation_json(found), options.words
    files = {"validation.json": record, "validation.txt": validation_report(found, options.view)}
    if isinstance(found, Comparison):
        files["differences.svg"] = differences_drawing(found, words).svg
    elif isinstance(found, ComparisonStudy):
        methods = labels(found.found[0], words)
        for one in found.agreements:
            drawing = bland_altman_drawing(one, *methods, words)
            files[f"bland-altman-{one.kind}.svg"] = drawing.svg
            files[f"line-{one.kind}.svg"] = line_drawing(one, *methods, words).svg
    content = {name: text.encode(errors="backslashreplace") for name, text in files.items()}
    if wanted.html or wanted.pdf:
        writer = Writer(words, options.view)
        content |= document_files("validation", _document(found, writer, record), options, wanted)
    return write_result(folder, content, "validation.json", REPORTS)


def _document(found: Validated, writer: Writer, record: str) -> Document:
    if isinstance(found, Mountings):
        return mountings_document(found, writer, record)
    if isinstance(found, Comparison):
        return comparison_document(found, writer, record)
    return study_document(found, writer, record)
