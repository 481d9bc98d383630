"""Calibrations of machines in a folder of batch results."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...batch.catalogue.catalogue import Catalogue, open_catalogue
from ...batch.results.calibration_list import (
    ListedCalibration,
    calibrations,
    calibrations_table,
    tree_of,
)
from ...batch.results.calibrations import certificate_of
from ...report.format.language import Translations
from ...report.format.view import PAPER
from ...report.format.writer import NONE, Table, Writer
from ...report.tables.calibration import STATES, point_name, quantity
from ...report.tables.conformity import decided
from ...vehicle import Unit
from ..content.panel import table_tree
from ..security import RefusedError
from .parameters import Parameters, filter_of


def certificate(folder: Path, key: str) -> Path:
    """Return the certificate of a calibration in the results. Raises RefusedError without one."""
    with open_catalogue(str(folder)) as catalogue:
        found = _certificate(catalogue, tree_of(catalogue, key))
    if found is None:
        raise RefusedError(404, "no certificate of this calibration below these results")
    return found


def _certificate(catalogue: Catalogue, tree: dict[str, Any] | None) -> Path | None:
    local = catalogue.store.local
    if local is None or tree is None or "error" in tree:
        return None
    return certificate_of(local, tree)


def listed_calibrations(
    catalogue: Catalogue, parameters: Parameters, words: Translations
) -> dict[str, Any]:
    """Return the calibrations of machines by the captures that match a filter."""
    found = calibrations(catalogue, filter_of(parameters))
    table = calibrations_table(found, Writer(words, PAPER))
    return {
        "table": table_tree(replace(table, classes=[_class(one) for one in found])),
        "keys": [one.key for one in found],
    }


def _class(one: ListedCalibration) -> str:
    return "not-conform" if one.error else (one.decision or "").replace(" ", "-")


def one_calibration(
    catalogue: Catalogue, parameters: Parameters, words: Translations
) -> dict[str, Any]:
    """Return one calibration: the item and each point's error with U and decision."""
    tree = tree_of(catalogue, parameters.get("key", ""))
    if tree is None:
        raise RefusedError(404, "no such calibration in these results")
    item = tree["item"] or {}
    date = tree.get("date")
    facts = [[words(f"certificate.{key}"), item[key]] for key in ("serial", "software")
             if key in item]  # fmt: skip
    facts += [[words("page.date"), date]] * bool(date)
    if tree.get("decision_as_found") is not None:
        was = decided(tree["decision_as_found"], words).lower()
        facts.append([words("listing.as_found"), was])
    if "error" in tree:
        facts.append([words("page.reason"), tree["error"]])
    rows = [_calibrated(kind, point, words) for kind in tree.get("quantities", ())
            for point in kind["points"]]  # fmt: skip
    head = (words("calibration.of"), words("page.status").lower(), words("calibration.point"),
            words("calibration.reference"), words("calibration.error"), "U", "k",
            words("verdict.decision"))  # fmt: skip
    name = f"{item.get('maker', '')} {item.get('model', '')}".strip()
    tables = [table_tree(Table(head, rows, 3))] if rows else []
    return {
        "name": name or words("listing.calibrations"),
        "facts": facts,
        "tables": tables,
        "certificate": _certificate(catalogue, tree) is not None,
    }


def _calibrated(kind: dict[str, Any], point: dict[str, Any], words: Translations) -> list[str]:
    name, error, writer = kind["quantity"], point["error"], Writer(words, PAPER)
    unit: Unit = "m" if "value_m" in error else "rad"
    suffix, scale = ("m", 1.0) if unit == "m" else ("deg", math.radians(1.0))
    reference, value, wide = (
        scale * number[f"{key}_{suffix}"]
        for number, key in (
            (point["reference"], "value"),
            (error, "value"),
            (error, "expanded_95"),
        )
    )
    shown = writer.millimetres(value, wide, "+") if unit == "m" else writer.arc(value, wide, "+")
    decision, k = point["decision"], error["k"]
    return [
        quantity(name, words),
        words(f"calibration.{STATES[kind['state']]}"),
        point_name(point["point"], name, words),
        writer.number(reference, unit, wide),
        shown,
        writer.size(wide, unit),
        NONE if k is None else words.number(f"{k:.2f}"),
        NONE if decision is None else decided(decision, words).lower(),
    ]
