"""Views of a folder of batch results: captures, failures, trends."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...batch.catalogue.catalogue import Catalogue, open_catalogue
from ...batch.catalogue.load_records import json_name
from ...batch.catalogue.rows import STATUSES, CaptureRow
from ...batch.operation.why import account_of, files_of
from ...batch.results.control_chart import control_chart
from ...batch.results.query import (
    Filter,
    capture_of,
    captures,
    count,
    failures,
    known_quantity,
    quantities_of,
    quantity_units,
    verticals,
    wheels_of,
)
from ...batch.results.series import series
from ...batch.results.tables import (
    capture_class,
    capture_status,
    counted_notes,
    doubts_listed,
    drift_table,
    expanded,
    failures_table,
    quantity_name,
    unlike_verticals,
)
from ...batch.results.trend_plot import trend_drawing
from ...batch.results.trends import drifts
from ...files import lies_in
from ...report.format.language import Translations
from ...report.format.notes import joined_notes_in
from ...report.format.view import PAPER
from ...report.format.writer import NONE, Table, Writer
from ...vehicle import REFERENCE_WHEELS, Unit
from ..content.changes import changes
from ..content.panel import table_tree
from ..security import RefusedError
from .calibrations import listed_calibrations, one_calibration
from .charts import chart_tree
from .parameters import Parameters, filter_of, offset_of
from .runs import runs

PAGE = 50
MOST_BEFORE = 100
LISTED = [
    *((wheel, kind) for kind in ("toe", "camber") for wheel in REFERENCE_WHEELS),
    ("", "rear_total_toe"), ("", "front_total_toe"), ("", "thrust_angle"),
]  # fmt: skip
MEASURED = "measurements"


def answer(
    question: str, folder: Path, parameters: Parameters, words: Translations
) -> dict[str, Any]:
    """Return a view of the results in `folder`. Raises RefusedError, InputError."""
    if question == "runs":  # which needs no catalogue, and has no result at first
        return runs(folder, words)
    if question not in QUESTIONS:
        raise RefusedError(404, "no such view of an archive")
    if question == "overview" and not (folder / MEASURED).is_dir():
        return {"total": 0, "statuses": [], "vehicles": [], "quantities": [], "verticals": []}
    with open_catalogue(str(folder)) as catalogue:
        found = QUESTIONS[question](catalogue, parameters, words)
        if question in OF_CAMBERS:
            notices = [_unlike_verticals(catalogue, parameters, words)]
            if question in STATISTICS:
                notices += counted_notes(catalogue, filter_of(parameters), words)
            found["notice"] = " ".join(filter(None, notices))
        return found


def _unlike_verticals(catalogue: Catalogue, parameters: Parameters, words: Translations) -> str:
    """Return a notice where cambers of the captures are not to be compared; empty elsewhere."""
    each = unlike_verticals(catalogue, filter_of(parameters), words)
    charted = parameters.get("quantity", "")
    if not each or (charted and not any(name in charted for name in BY_VERTICAL)):
        return ""
    return words("page.unlike_verticals", each=each)


def plot(folder: Path, parameters: Parameters, words: Translations) -> str:
    """Draw one quantity of the captures that match a filter over time, as SVG."""
    quantity, which = parameters.get("quantity", ""), filter_of(parameters)
    with open_catalogue(str(folder)) as catalogue:
        found = series(catalogue, [quantity], which)
        line = drifts(catalogue, [quantity], which)
    if not found or not line or not math.isfinite(line[0].slope):
        raise RefusedError(404, words("page.no_trend"))
    name = quantity_name(quantity, Writer(words, PAPER))
    return trend_drawing(found[0], line[0], name, words).svg


def _overview(catalogue: Catalogue, _: Parameters, words: Translations) -> dict[str, Any]:
    """Return the number of captures of each status, and the choices of vehicle and quantity."""
    writer = Writer(words, PAPER)
    of_status = {status: count(catalogue, Filter(status=(status,))) for status in STATUSES}
    rows = catalogue.connection.execute(
        "SELECT DISTINCT vehicle FROM captures WHERE vehicle <> '' ORDER BY vehicle LIMIT 1000"
    )
    return {
        "total": sum(of_status.values()),
        "statuses": [[s, words(f"page.{s}"), n] for s, n in of_status.items()],
        "vehicles": [vehicle for (vehicle,) in rows],
        "quantities": [[q, quantity_name(q, writer)] for q in quantity_units(catalogue)],
        "verticals": [[v, words.known("page", f"vertical_{v}")] for v in verticals(catalogue)],
    }


def _captures(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return a page of the captures that match a filter."""
    which = filter_of(parameters)
    offset = offset_of(parameters.get("offset", "0"))
    found = list(captures(catalogue, which, "name", PAGE, offset))
    angles = [_angles(catalogue, row.key, words) for row in found]
    rows = [
        [
            row.name or row.key,
            row.vehicle or NONE,
            row.date or NONE,
            capture_status(row, words),
            *shown,
        ]
        for row, shown in zip(found, angles, strict=True)
    ]
    head = [words(f"page.{name}").lower() for name in ("name", "vehicle", "date", "status")]
    head += [
        f"{words.wheel(wheel)} {words.known('quantity', kind)}" if wheel else
        words.known("quantity", kind) for wheel, kind in LISTED
    ]  # fmt: skip
    table = Table(
        head, rows, 4, words("page.captures"),
        list(map(capture_class, found)), [1],
    )  # fmt: skip
    keys = [row.key for row in found]
    return {
        "table": table_tree(table),
        "keys": keys,
        "offset": offset,
        "total": count(catalogue, which),
        "doubts": doubts_listed(found, words),
    }


def _angles(catalogue: Catalogue, key: str, words: Translations) -> list[str]:
    """Return toe and camber by wheel, total toe and thrust angle; a dash for what is missing."""
    found: dict[tuple[str, str], tuple[float | None, float | None]] = {
        ("", q.kind): (q.value, q.u) for q in quantities_of(catalogue, key) if q.unit == "deg"
    }
    for wheel in wheels_of(catalogue, key):
        found[wheel.name, "toe"] = wheel.toe_deg, wheel.u_toe_deg
        found[wheel.name, "camber"] = wheel.camber_deg, wheel.u_camber_deg
    return [_angle(*found.get(listed, (None, None)), words)[0] for listed in LISTED]


def _capture(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return one capture: its wheels and its vehicle's quantities."""
    found = capture_of(catalogue, parameters.get("key", ""))
    if found is None:
        raise RefusedError(404, "no such capture in these results")
    wheels = [
        [words.wheel(w.name), words.wheel(w.wheel or NONE), words.known("status", w.status),
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
        "name": found.name or found.key,
        "facts": [[words("page.status"), capture_status(found, words)]]
        + [[words("page.reason"), joined_notes_in(found.reason, words)]] * bool(found.reason)
        + [[words("page.date"), found.date]] * bool(found.date)
        + [[words("page.option_vertical"), words.known("page", f"vertical_{found.vertical}")]]
        * bool(found.vertical),
        "why": "" if found.status == "ok" else _why(catalogue, found.key),
        "record": _record(catalogue, found),
        "before": [
            [row.key, " ".join(filter(None, [row.date, row.name]))]
            for row in _earlier(catalogue, found)
        ],
        "tables": [
            table_tree(Table(head, rows, left))
            for head, rows, left in ((of_wheels, wheels, 3), (of_vehicle, quantities, 1))
            if rows
        ],
    }


def _record(catalogue: Catalogue, row: CaptureRow) -> str:
    """Return the path of the measurement in the results, '' where there is none to open."""
    name = json_name(row.key)
    local = catalogue.store.local
    opens = row.wheels_ok > 0 and local is not None and lies_in(local / name, local)
    return name if opens else ""


def _earlier(catalogue: Catalogue, row: CaptureRow) -> list[CaptureRow]:
    """Return the measured captures of the same vehicle before this one, the latest first."""
    if not row.vehicle or row.day is None or not _record(catalogue, row):
        return []
    which = Filter(vehicle=row.vehicle, until_day=row.day, status=("ok", "part"))
    dated = [one for one in captures(catalogue, which, "date") if one.day is not None]
    return [one for one in dated[::-1] if _record(catalogue, one)][:MOST_BEFORE]


def _changes(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return what changed from one capture of a vehicle to another."""
    local, paths, names = catalogue.store.local, [], []
    for key in (parameters.get("key", ""), parameters.get("before", "")):
        row = capture_of(catalogue, key)
        name = _record(catalogue, row) if row else ""
        if not row or not name or local is None:
            raise RefusedError(404, "no such measurement in these results")
        paths.append(local / name)
        names.append(row.name)
    return {"table": changes(paths[0], paths[1], names[1], words)}


def _chart(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return the control chart of one quantity of the captures that match a filter."""
    quantity = known_quantity(catalogue, parameters.get("quantity", ""))
    chart = control_chart(catalogue, quantity, filter_of(parameters))
    if chart is None:
        raise RefusedError(404, words("page.no_chart"))
    return chart_tree(chart, quantity_name(quantity, Writer(words, PAPER)), words)


def _why(catalogue: Catalogue, key: str) -> str:
    """Return the account of a result; empty if a link leads out of the folder of results."""
    local = catalogue.store.local
    if local is None or not all(lies_in(local / name, local) for name in files_of(key)):
        return ""
    return account_of(catalogue.store, key)


def _failures(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return the groups of failures, the most frequent first."""
    found = failures(catalogue, filter_of(parameters))
    return {"table": table_tree(failures_table(found, Writer(words, PAPER)))}


def _trends(catalogue: Catalogue, parameters: Parameters, words: Translations) -> dict[str, Any]:
    """Return the drift of every quantity, in the order of p-values."""
    found = sorted(
        drifts(catalogue, None, filter_of(parameters)), key=lambda d: (bool(d.reason), d.p)
    )
    table = drift_table(found, Writer(words, PAPER))
    return {"table": table_tree(table), "quantities": [one.quantity for one in found]}


QUESTIONS: dict[str, Callable[[Catalogue, Parameters, Translations], dict[str, Any]]] = {
    "overview": _overview,
    "captures": _captures,
    "capture": _capture,
    "failures": _failures,
    "trends": _trends,
    "calibrations": listed_calibrations,
    "calibration": one_calibration,
    "changes": _changes,
    "chart": _chart,
}


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


BY_VERTICAL = ("camber", "caster", "inclination")  # in names of quantities
STATISTICS = ("trends", "chart")
OF_CAMBERS = ("captures", *STATISTICS)
