"""Views of a folder of batch results: captures, failures, trends."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...batch.catalogue.catalogue import Catalogue, open_catalogue
from ...batch.catalogue.rows import STATUSES
from ...batch.operation.why import account_of, files_of
from ...batch.results.calibration_list import (
    ListedCalibration,
    calibrations,
    calibrations_table,
    tree_of,
)
from ...batch.results.calibrations import certificate_of
from ...batch.results.query import (
    Filter,
    capture_of,
    captures,
    count,
    failures,
    quantities_of,
    quantity_units,
    wheels_of,
)
from ...batch.results.series import series
from ...batch.results.tables import drift_table, expanded, failures_table
from ...batch.results.trend_plot import trend_drawing
from ...batch.results.trends import drifts
from ...files import lies_in
from ...report.format.language import Translations
from ...report.format.view import PAPER
from ...report.format.writer import NONE, Table, Writer
from ...report.tables.calibration import STATES, point_name, quantity
from ...report.tables.conformity import decided
from ...vehicle import Unit
from ..security import RefusedError
from .panel import table_tree
from .runs import runs

PAGE = 50
MEASURED = "measurements"
CLASSES = {"ok": "", "part": "undecided"}
Parameters = Mapping[str, str]


def answer(
    question: str, folder: Path, parameters: Parameters, words: Translations
) -> dict[str, Any]:
    """Return a view of the results in `folder`. Raises RefusedError, InputError."""
    if question == "runs":  # which needs no catalogue, and has no result at first
        return runs(folder, words)
    if question not in QUESTIONS:
        raise RefusedError(404, "no such view of an archive")
    if question == "overview" and not (folder / MEASURED).is_dir():
        return {"total": 0, "statuses": [], "vehicles": [], "quantities": []}
    with open_catalogue(str(folder)) as catalogue:
        return QUESTIONS[question](catalogue, parameters, words)


def plot(folder: Path, quantity: str, words: Translations) -> str:
    """Draw one quantity over time, as SVG."""
    with open_catalogue(str(folder)) as catalogue:
        found = series(catalogue, [quantity])
        line = drifts(catalogue, [quantity])
    if not found or not line or not math.isfinite(line[0].slope):
        raise RefusedError(404, words("page.no_trend"))
    return trend_drawing(found[0], line[0], quantity_name(quantity, words), words).svg


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


def quantity_name(quantity: str, words: Translations) -> str:
    """Return the displayed name of a quantity of the catalogue, such as `RR toe`."""
    wheel, _, kind = quantity.rpartition(" ")
    return f"{wheel} {words.known('quantity', kind)}".strip()


def _overview(catalogue: Catalogue, _: Parameters, words: Translations) -> dict[str, Any]:
    """Return the number of captures of each status, and the choices of vehicle and quantity."""
    of_status = {status: count(catalogue, Filter(status=(status,))) for status in STATUSES}
    rows = catalogue.connection.execute(
        "SELECT DISTINCT vehicle FROM captures WHERE vehicle <> '' ORDER BY vehicle LIMIT 1000"
    )
    return {
        "total": sum(of_status.values()),
        "statuses": [[s, words(f"page.{s}"), n] for s, n in of_status.items()],
        "vehicles": [vehicle for (vehicle,) in rows],
        "quantities": [[q, quantity_name(q, words)] for q in quantity_units(catalogue)],
    }


def _offset(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise RefusedError(400, f"offset: {text[:40]!r} is not a whole number from 0")
    return int(text)


def _captures(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return a page of the captures that match a filter."""
    which = _filter(parameters)
    offset = _offset(parameters.get("offset", "0"))
    found = list(captures(catalogue, which, "name", PAGE, offset))
    rows = [
        [row.name, row.vehicle, row.date or NONE, words(f"page.{row.status}"), row.reason,
         f"{row.wheels_ok}/{row.wheels}", words.count(row.points_total)]
        for row in found
    ]  # fmt: skip
    head = ("name", "vehicle", "date", "status", "reason", "wheels", "points")
    table = Table(
        [words(f"page.{name}").lower() for name in head], rows, 5, words("page.captures"),
        [CLASSES.get(row.status, "not-conform") for row in found],
    )  # fmt: skip
    keys = [row.key for row in found]
    total = count(catalogue, which)
    return {"table": table_tree(table), "keys": keys, "offset": offset, "total": total}


def _capture(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return one capture: its wheels and its vehicle's quantities."""
    found = capture_of(catalogue, parameters.get("key", ""))
    if found is None:
        raise RefusedError(404, "no such capture in these results")
    wheels = [
        [w.name, w.wheel or NONE, words.known("status", w.status),
         *_angle(w.toe_deg, w.u_toe_deg, words), *_angle(w.camber_deg, w.u_camber_deg, words)]
        for w in wheels_of(catalogue, found.key)
    ]  # fmt: skip
    quantities = [
        [words.known("quantity", q.kind), *_value(q.value, q.u, q.unit, words)]
        for q in quantities_of(catalogue, found.key)
    ]
    toe, camber = (words.known("quantity", kind) for kind in ("toe", "camber"))
    of_wheels = (words("page.name").lower(), words("results.wheel"), words("page.status").lower(),
                 toe, "u", camber, "u")  # fmt: skip
    of_vehicle = (words("page.quantity").lower(), words("vehicle.value"), "u")
    return {
        "name": found.name,
        "facts": [[words("page.status"), words(f"page.{found.status}")]]
        + [[words("page.reason"), found.reason]] * bool(found.reason)
        + [[words("page.date"), found.date]] * bool(found.date),
        "why": "" if found.status == "ok" else _why(catalogue, found.key),
        "tables": [
            table_tree(Table(head, rows, left))
            for head, rows, left in ((of_wheels, wheels, 3), (of_vehicle, quantities, 1))
            if rows
        ],
    }


def _why(catalogue: Catalogue, key: str) -> str:
    """Return the account of a result; empty if a link leads out of the folder of results."""
    local = catalogue.store.local
    if local is None or not all(lies_in(local / name, local) for name in files_of(key)):
        return ""
    return account_of(catalogue.store, key)


def _failures(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return the groups of failures, the most frequent first."""
    found = failures(catalogue, _filter(parameters))
    return {"table": table_tree(failures_table(found, Writer(words, PAPER)))}


def _trends(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return the drift of every quantity, in the order of p-values."""
    found = sorted(
        drifts(catalogue, None, _filter(parameters)), key=lambda d: (bool(d.reason), d.p)
    )
    table = drift_table(found, Writer(words, PAPER))
    return {"table": table_tree(table), "quantities": [one.quantity for one in found]}


def _calibrations(
    catalogue: Catalogue, parameters: Parameters, words: Translations
) -> dict[str, Any]:
    """Return the calibrations of machines by the captures that match a filter."""
    found = calibrations(catalogue, _filter(parameters))
    table = calibrations_table(found, Writer(words, PAPER))
    return {
        "table": table_tree(replace(table, classes=[_class(one) for one in found])),
        "keys": [one.key for one in found],
    }


def _class(one: ListedCalibration) -> str:
    return "not-conform" if one.error else (one.decision or "").replace(" ", "-")


def _calibration(
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


QUESTIONS: dict[str, Callable[[Catalogue, Parameters, Translations], dict[str, Any]]] = {
    "overview": _overview,
    "captures": _captures,
    "capture": _capture,
    "failures": _failures,
    "trends": _trends,
    "calibrations": _calibrations,
    "calibration": _calibration,
}


def _filter(parameters: Parameters) -> Filter:
    status = parameters.get("status", "")
    return Filter(
        text=parameters.get("text", "")[:200],
        vehicle=parameters.get("vehicle") or None,
        status=(status,) if status in STATUSES else (),
    )


def _angle(value_deg: float | None, u_deg: float | None, words: Translations) -> tuple[str, str]:
    return _value(value_deg, u_deg, "deg", words)


def _value(value: float | None, u: float | None, unit: str, words: Translations) -> tuple[str, str]:
    """Format an angle in deg-min-sec with u in seconds, or a length in m with u in mm."""
    if value is None:
        return NONE, NONE
    writer, scale = Writer(words, PAPER), 1.0 if unit == "m" else math.radians(1.0)
    of: Unit = "m" if unit == "m" else "rad"
    text = writer.number(value * scale, of, expanded(u) * scale)
    return text, writer.size(None if u is None else u * scale, of)
