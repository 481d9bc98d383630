"""Files of a calibration that was entered on the page: item, readings, results, certificate."""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...calibration import (
    COLUMNS,
    Calibration,
    ItemFile,
    Reference,
    calibrate_file,
    issue,
    item_toml,
    load_certificate,
    load_item,
    read_texts,
)
from ...config import load_config, parse_section
from ...errors import ConfigError, InputError
from ...report.certificate import certificate_files
from ...report.format.laboratory import read_laboratory
from ...report.format.language import load_translations
from ...report.format.report_options import ReportOptions
from ...report.format.view import PAPER
from ...report.json.calibration import calibration_json
from ...report.text.calibration import calibration_text
from ...report.write import ReportFiles
from ...system import frozen
from ..security import RefusedError
from .faults import faults_in

ITEM, READINGS, CERTIFICATE = "item.toml", "readings.csv", "certificate.toml"
MOST_READINGS, LONGEST_CELL, MOST_REFERENCES = 5000, 200, 50


@frozen
class Request:
    """Item and readings as the page sends them.

    item: as plain data, or the text of an item.toml. readings: rows of texts in the order of
    COLUMNS. certificate: text of a certificate.toml, "" for none. references: names of the
    measurements of series 2, 3, ...
    """

    item: dict[str, Any] | str
    readings: tuple[tuple[str, ...], ...]
    certificate: str = ""
    references: tuple[str, ...] = ()


def request_of(given: dict[str, Any]) -> Request:
    """Return the checked content of a request. Raises RefusedError."""
    item, rows, certificate = (given.get(key) for key in ("item", "readings", "certificate"))
    if not isinstance(item, dict | str) or not isinstance(certificate or "", str):
        raise RefusedError(400, "item: a table, or the text of an item.toml, is needed")
    if not isinstance(rows, list) or not all(map(_is_row, rows)):
        raise RefusedError(400, f"readings: rows of {len(COLUMNS)} short texts are needed")
    if len(rows) > MOST_READINGS:
        raise RefusedError(413, f"more than {MOST_READINGS} readings: use wheelplane calibrate")
    others = given.get("references") or []
    if not isinstance(others, list) or len(others) > MOST_REFERENCES or not _are_texts(others):
        raise RefusedError(400, f"references: up to {MOST_REFERENCES} measurements are needed")
    return Request(item, tuple(map(tuple, rows)), certificate or "", tuple(others))


def _are_texts(values: list[Any]) -> bool:
    return all(isinstance(value, str) for value in values)


def _is_row(row: Any) -> bool:
    cells = row if isinstance(row, list) else []
    texts = all(isinstance(c, str) and len(c) <= LONGEST_CELL and _is_line(c) for c in cells)
    return texts and len(cells) == len(COLUMNS)


def _is_line(text: str) -> bool:
    return text.isprintable()  # a line break within a cell would shift the rows' numbers


def item_of(given: Request) -> ItemFile:
    """Return the item of a request. Raises ConfigError with what is missing."""
    if isinstance(given.item, dict):
        return parse_section(ItemFile, given.item, ITEM)
    with _written({ITEM: given.item.encode()}) as folder:
        return load_item(folder / ITEM)


@contextmanager
def _written(files: dict[str, bytes]) -> Iterator[Path]:
    """Yield a folder with the files, which errors then name without it."""
    with tempfile.TemporaryDirectory(prefix="wheelplane-") as scratch:
        for name, content in files.items():
            (Path(scratch) / name).write_bytes(content)
        try:
            yield Path(scratch)
        except (ConfigError, InputError) as error:
            kind = ConfigError if isinstance(error, ConfigError) else InputError
            raise kind(str(error).replace(f"{scratch}/", "")) from error


def readings_csv(rows: tuple[tuple[str, ...], ...]) -> bytes:
    """Return the table of readings as `wheelplane calibrate` reads it."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows)
    return text.getvalue().encode()


def calibration_files(
    references: Sequence[Reference], given: Request, config: Path | None, language: str
) -> dict[str, bytes]:
    """Return the files by name, as `wheelplane calibrate` with the same files writes them.

    The files are written and read again, so that what is saved is what was evaluated. Raises
    FaultyTableError, ConfigError, InputError.
    """
    files = {
        ITEM: item_toml(item_of(given)).encode(),
        READINGS: readings_csv(given.readings),
    }
    files |= {CERTIFICATE: given.certificate.encode()} if given.certificate else {}
    with _written(files) as folder, faults_in(load_translations(language)):
        found = calibrate_file(references, load_item(folder / ITEM), folder / READINGS)
        stated = folder / CERTIFICATE if given.certificate else None
        return files | _results(found, stated, config, language)


def _results(
    found: Calibration, stated: Path | None, config: Path | None, language: str
) -> dict[str, bytes]:
    settings, record = load_config(config), calibration_json(found)
    made = issue(found, load_certificate(stated, settings))
    laboratory = read_laboratory(settings.report)
    options = ReportOptions(load_translations(language), PAPER, laboratory)
    return {
        "calibration.json": record.encode(),
        "calibration.txt": calibration_text(found).encode(),
        **certificate_files(made, record, options, ReportFiles(html=True)),
    }


def read_table(plan: dict[str, Any], _send: Callable[[str, object], None]) -> None:
    """Read the table of readings plan["table"], and write its rows as JSON to plan["file"]."""
    path, words = Path(plan["table"]), load_translations(plan["language"])
    with faults_in(words):
        rows = read_texts(path)
    text = json.dumps([list(row) for row in rows], ensure_ascii=False)
    (Path(plan["out"]) / plan["file"]).write_text(text, encoding="utf-8")
