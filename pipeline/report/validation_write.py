"""Write a validation to a folder: validation.json, validation.txt, the plots."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.report.validation_archive_text import survey_text
from pipeline.report.validation_json import validation_json
from pipeline.report.validation_svg import bland_altman_svg, differences_svg, line_svg
from pipeline.report.validation_text import validation_text
from pipeline.report.write import write_whole
from pipeline.validate_archive import Survey
from pipeline.validate_compare import Comparison


def validation_report(found: Comparison | Survey) -> str:
    """The text, of one capture or of many; printable whatever a path holds."""
    text = validation_text(found) if isinstance(found, Comparison) else survey_text(found)
    return text.encode(errors="backslashreplace").decode()


def write_validation(found: Comparison | Survey, folder: Path) -> list[Path]:
    """Each file whole or not at all."""
    files = {"validation.json": validation_json(found), "validation.txt": validation_report(found)}
    if isinstance(found, Comparison):
        files["differences.svg"] = differences_svg(found)
    else:
        labels = found.found[0].first.label, found.found[0].second.label
        for one in found.agreements:
            files[f"bland-altman-{one.kind}.svg"] = bland_altman_svg(one, *labels)
            files[f"line-{one.kind}.svg"] = line_svg(one, *labels)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}): name another") from error
    encoded = {n: text.encode(errors="backslashreplace") for n, text in files.items()}
    return [write_whole(folder / name, content) for name, content in encoded.items()]
