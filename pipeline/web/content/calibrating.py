"""Calibration of a machine on the page: its points, and errors and decisions as readings grow."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...calibration import (
    COLUMNS,
    QUANTITIES,
    STATES,
    Calibration,
    CalibrationPoint,
    Fault,
    ItemFile,
    Reference,
    by_series,
    calibrate_unfinished,
    units_of,
)
from ...errors import ConfigError
from ...measurement import Estimate
from ...report.format.language import Translations, load_translations
from ...report.format.view import PAPER
from ...report.format.writer import Writer
from ...report.tables.calibration import (
    STATES as STATE_WORDS,
)
from ...report.tables.calibration import (
    adjustments_table,
    as_found,
    declared,
    point_name,
    points_table,
    quantity,
    rule_words,
    shown_lines,
    signed,
)
from ...report.tables.conformity import SIGNS, decided, doubted
from ...vehicle import AXES
from ..files.stored import load
from .calibration_files import READINGS, Request, item_of, readings_csv
from .faults import in_words, item_in_words
from .panel import table_tree

MOST_FAULTS = 200


def choices(words: Translations) -> dict[str, Any]:
    """Return what the page offers of an item: quantities with units and senses, axes, states."""
    return {
        "quantities": [
            {
                "kind": kind,
                "name": quantity(kind, words),
                "unit": one.unit,
                "axis": one.axis,
                "units": units_of(one),
                "senses": [] if len(one.signs) == 1 else _senses(one.signs, words),
            }
            for kind, one in QUANTITIES.items()
        ],
        "columns": COLUMNS,
        "axes": [[axis, words.known("axis", axis)] for axis in AXES],
        "definitions": [[d, words(f"calibration.camber_{d}")] for d in ("elevation", "iso")],
        "states": [[state, words(f"calibration.{STATE_WORDS[state]}")] for state in STATES],
    }


def _senses(senses: Iterable[str], words: Translations) -> list[list[str]]:
    return [[s, words(f"calibration.sense_{s.replace('-', '_')}")] for s in senses]


def evaluate(folders: Sequence[Path], given: Request, language: str) -> dict[str, Any]:
    """Evaluate what is entered so far against the measurements in `folders`, with every fault.

    One measurement is the reference of all series, several are those of series 1, 2, ... Without a
    complete item there are only its faults.
    """
    words = load_translations(language)
    try:
        item_file = item_of(given)
    except ConfigError as error:
        return {"item": None, "item_faults": item_in_words(str(error), words)}
    references = references_of(folders)
    tree: dict[str, Any] = {
        "item": item_file.model_dump(exclude_none=True),
        "item_faults": [],
        "sheets": _sheets(references[0], item_file, Writer(words, PAPER)),
    }
    if not given.readings:
        return tree | {"faults": [], "points": [], "results": []}
    with tempfile.TemporaryDirectory(dir=folders[0]) as scratch:
        path = Path(scratch) / READINGS
        path.write_bytes(readings_csv(given.readings))
        found, faults = calibrate_unfinished(references, item_file, path)
    listed = [_fault(fault, words) for fault in faults[:MOST_FAULTS]]
    return tree | {"faults": listed} | _found(found, words)


def references_of(folders: Sequence[Path]) -> tuple[Reference, ...]:
    """Return stored measurements as the references of series 1, 2, ...; one as that of all."""
    return by_series([reference_of(str(folder)) for folder in folders])


@lru_cache(maxsize=16)
def reference_of(folder: str) -> Reference:
    """Return the measurement that a measuring process stored in `folder`, as a reference."""
    return Reference(load(Path(folder))[0])


def _sheets(reference: Reference, item_file: ItemFile, writer: Writer) -> list[dict[str, Any]]:
    """Return the points of each quantity with their reference values, as the item counts them."""
    item = item_file.item
    found = []
    for kind, stated in item.declared().items():
        rows = []
        for point in reference.points(kind, item):
            known = reference.value(kind, point, item)
            assert isinstance(known, Estimate)
            text = writer.number(known.value, QUANTITIES[kind].unit, known.expanded)
            name = point_name(point, kind, writer.words)
            rows.append({"point": point, "name": name, "reference": text})
        found.append({"kind": kind, "mpe": stated.mpe, "points": rows})
    return found


def _fault(fault: Fault, words: Translations) -> dict[str, Any]:
    """Return the row of a fault, from 0 below the heading, and its words; None: of the table."""
    text = in_words(fault.fact, words)
    if fault.row is None:
        return {"row": None, "text": text}
    return {"row": fault.row - 2, "column": fault.column, "text": text}


def _found(found: Calibration, words: Translations) -> dict[str, Any]:
    writer = Writer(words, PAPER)
    tables = [
        {
            "table": table_tree(points_table(result, writer)),
            "lines": [declared(result, writer), *shown_lines(result, writer), *result.notes],
        }
        for result in found.results
    ]
    if found.adjustments:
        tables.append({"table": table_tree(adjustments_table(found, writer)), "lines": []})
    points = [_point(point, writer) for result in found.results for point in result.points]
    return {
        "points": points,
        "results": tables,
        "decision": None if found.decision is None else _decision(found.decision, words),
        "rule": rule_words(found, words),
        "warnings": [
            *as_found(found, words),
            *(words("calibration.warning", text=in_words(text, words)) for text in found.warnings),
            *doubted(found.doubts, words),
        ],
    }


def _point(point: CalibrationPoint, writer: Writer) -> dict[str, Any]:
    verdict = point.verdict
    return {
        "quantity": point.quantity,
        "state": point.state,
        "point": point.point,
        "error": signed(point.error, point, writer),
        "expanded": writer.size(point.error.expanded, point.unit),
        "decision": None if verdict is None else _decision(verdict.decision, writer.words),
    }


def _decision(decision: str, words: Translations) -> dict[str, str]:
    text = f"{SIGNS[decision]} {decided(decision, words)}"
    return {"kind": decision.replace(" ", "-"), "text": text}
