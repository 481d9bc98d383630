"""Comparison of two measurements of one vehicle: differences and their uncertainty."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import Doubt, InputError
from ...measurement import VERTICALS, Estimate, Measurement, by_name
from ...report.format.language import Translations, load_translations
from ...report.format.view import PAPER
from ...report.format.writer import Table, Writer
from ...report.html.provenance import is_five_point
from ...report.tables.comparison import differences_table
from ...report.tables.conformity import doubted
from ...report.text.validation import validation_text
from ...validation import (
    Comparison,
    RequestPart,
    as_method,
    check_alike,
    measured,
    note_of_plates,
    of_faces,
)
from ...validation import compare as compare_methods
from ...vehicle import REFERENCE_WHEELS
from ..files.stored import load, store
from .panel import table_tree

COMPARISON = "comparison.pickle"
SAME_FILES = (
    "Both are measured from the same files, whose errors they share: that they agree shows "
    "nothing, and U is not that of their difference."
)


def compare(plan: dict[str, Any], _send: Callable[[str, object], None]) -> None:
    """Compare the measurements of two jobs, and write comparison.json."""
    first, second = (load(Path(folder))[0] for folder in plan["folders"])
    found = compare_measurements(first, second, plan["names"])
    store((found, first.vertical_kind), Path(plan["out"]) / COMPARISON)
    words = load_translations(plan["language"])
    writer = Writer(words, replace(PAPER, vertical=first.vertical_kind))
    tree = {
        "verdict": found.verdict,
        "table": table_tree(differences_table(found, writer)),
        "lengths": table_tree(_lengths(*_of_one_kind(first, second), words, plan["names"])),
        "doubts": doubted(found.doubts, words),
        "missing": [{"name": name, "reason": reason} for name, reason in found.missing],
        "text": validation_text(found),
        "names": plan["names"],
    }
    text = json.dumps(tree, ensure_ascii=False, allow_nan=False)
    (Path(plan["out"]) / "comparison.json").write_text(text, encoding="utf-8")


def compare_measurements(
    first: Measurement, second: Measurement, names: tuple[str, str]
) -> Comparison:
    """Compare two measurements, first minus second, as independent methods.

    Raises InputError if they cannot be of the same vehicle.
    """
    parts = [measured(one) for one in _of_one_kind(first, second)]
    wheels = [dict(zip(part.names, part.wheels, strict=True)) for part in parts]
    shared = [name for name, wheel in wheels[0].items() if wheels[1].get(name) == wheel]
    verticals = [one.vertical_kind for one in (first, second)]
    if verticals[0] != verticals[1]:
        raise InputError(
            f"{names[0]} has its cambers from {VERTICALS[verticals[0]]}, {names[1]} from "
            f"{VERTICALS[verticals[1]]}: measure both from the same (--vertical)"
        )
    missing = [wheel for wheel in REFERENCE_WHEELS if wheel not in shared]
    if missing:
        raise InputError(
            f"{missing[0]} is measured in only one of the two: compare complete vehicles"
        )
    kept = [_of(part, shared) for part in parts]
    one, other = (as_method(name, p.results) for name, p in zip(names, kept, strict=True))
    check_alike(one, other, names[1])
    mounted = note_of_plates(first) or note_of_plates(second)
    return compare_methods(
        names[0],
        shared,
        kept[0].wheels,
        one,
        other,
        missing=_missing(wheels, names),
        notes=(
            *first.notes,
            *second.notes,
            *(mounted if _is_with_points(first, second) else ()),
            *_of_same_files(first, second),
        ),
        origins=(first.provenance, second.provenance),
    )


def _of_one_kind(first: Measurement, second: Measurement) -> tuple[Measurement, Measurement]:
    """Return the two; beside five points, which lie on the targets, scans as of these."""
    if _is_with_points(first, second):
        return of_faces(first), of_faces(second)
    return first, second


def _is_with_points(first: Measurement, second: Measurement) -> bool:
    """Return whether one is of five points a wheel, and the other of scans."""
    return is_five_point(first) != is_five_point(second)


def _of_same_files(first: Measurement, second: Measurement) -> list[Doubt]:
    """Return the doubt in a comparison of files with themselves, however each is evaluated."""
    one, other = (found.provenance.checksums for found in (first, second))
    return [Doubt(SAME_FILES)] if one and one == other else []


def _of(part: RequestPart, names: list[str]) -> RequestPart:
    known = dict(zip(part.names, part.results, strict=True))
    return RequestPart(tuple(known[name] for name in names), ())


def _missing(wheels: list[dict[str, str]], names: tuple[str, str]) -> tuple[tuple[str, str], ...]:
    """Return name and reason of what cannot be compared. wheels: by name, of both."""
    first, second = wheels
    return (
        *((name, f"only in {names[0]}") for name in first if name not in second),
        *((name, f"only in {names[1]}") for name in second if name not in first),
        *(
            (name, f"at {wheel} in {names[0]}, at {second[name]} in {names[1]}")
            for name, wheel in first.items()
            if second.get(name, wheel) != wheel
        ),
    )


def _lengths(
    first: Measurement, second: Measurement, words: Translations, names: tuple[str, str]
) -> Table:
    """Tabulate tracks and wheelbase of both, the difference and its standard uncertainty."""
    rows, writer = [], Writer(words, PAPER)
    for kind in ("rear_track", "front_track", "wheelbase"):
        one, other = (by_name(measurement)[kind] for measurement in (first, second))
        apart = Estimate(one.value - other.value, math.hypot(one.u, other.u))
        lengths = writer.millimetres(apart.value, apart.expanded, "+"), writer.size(apart.u, "m")
        rows.append(
            [words.known("quantity", kind), writer.value(one), writer.value(other), *lengths]
        )
    head = (words("page.quantity").lower(), *names, words("comparison.difference"), "u")
    return Table(head, rows, 1, words("page.lengths"))
