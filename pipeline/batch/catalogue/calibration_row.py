"""Calibration in the JSON of a result -> its row in the catalogue."""

from __future__ import annotations

from typing import Any

from ...system import frozen

TABLE = """
CREATE TABLE calibration_rows(
  id INTEGER PRIMARY KEY, serial TEXT NOT NULL, maker TEXT NOT NULL, model TEXT NOT NULL,
  decision TEXT, points INTEGER NOT NULL, worst REAL, worst_at TEXT NOT NULL, error TEXT NOT NULL,
  as_found TEXT);
CREATE VIEW calibrations AS
  SELECT key, c.name, c.date, serial, maker, model, decision, points, worst, worst_at, error,
    as_found
  FROM calibration_rows AS k JOIN captures AS c ON c.id = k.id;
"""


@frozen
class CalibrationRow:
    """Calibration of a machine.

    decision: conform, undecided, not conform; None without a maximum permissible error. points:
    number in the state in which each quantity was left. worst: largest |error|/MPE of these, and of
    those that were not read again as left, at the quantity and point `worst_at`. error: why there
    are no results. as_found: decision before the adjustment; None where nothing was read as
    left.
    """

    serial: str = ""
    maker: str = ""
    model: str = ""
    decision: str | None = None
    points: int = 0
    worst: float | None = None
    worst_at: str = ""
    error: str = ""
    as_found: str | None = None


def calibration_row(tree: Any) -> CalibrationRow | None:
    """Return the row of the part `calibration` of a result; None without one."""
    if tree is None:
        return None
    try:
        return _storable(_row(tree))
    except (KeyError, TypeError, AttributeError, ArithmeticError, UnicodeError) as error:
        return CalibrationRow(error=f"no calibration of this program ({type(error).__name__})")


def _row(tree: Any) -> CalibrationRow:
    item = tree["item"] or {}
    serial = str(item.get("serial", ""))
    if "error" in tree:
        return CalibrationRow(serial, error=str(tree["error"]))
    found = [(q["quantity"], point) for q in final(tree) for point in q["points"]]
    ratios = [
        (
            abs(point["error"][f"value_{unit}"]) / point[f"mpe_{unit}"],
            f"{kind} {point['point']}",
        )
        for kind, point in [*found, *_not_read_again(tree, found)]
        for unit in ("deg", "m")
        if point.get(f"mpe_{unit}") is not None
    ]
    worst, where = max(ratios, default=(None, ""))
    return CalibrationRow(
        serial,
        str(item["maker"]),
        str(item["model"]),
        tree["decision"],
        len(found),
        worst,
        where,
        as_found=tree.get("decision_as_found"),
    )


def _storable(row: CalibrationRow) -> CalibrationRow:
    """Raise TypeError or UnicodeError for what SQLite does not store; return the row."""
    decisions = row.decision, row.as_found
    if not all(isinstance(one, str | None) for one in decisions):
        raise TypeError
    for text in (row.serial, row.maker, row.model, *decisions, row.worst_at, row.error):
        (text or "").encode()
    return row


def _not_read_again(tree: Any, left: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Return quantity and point of what was read as found alone, of quantities read as left."""
    known = {(kind, point["point"]) for kind, point in left}
    found = [(q["quantity"], point) for q in tree["quantities"] for point in q["points"]]
    return [(kind, point) for kind, point in found if (kind, point["point"]) not in known]


def final(tree: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the results of a calibration in the state in which each quantity was left."""
    left = {q["quantity"] for q in tree["quantities"] if q["state"] == "as left"}
    return [q for q in tree["quantities"] if q["state"] == "as left" or q["quantity"] not in left]
