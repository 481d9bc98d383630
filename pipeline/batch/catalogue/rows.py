"""JSON of one result -> its rows in the catalogue."""

from __future__ import annotations

import hashlib
import json
import math
import re
import sqlite3
import threading
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from ...report.json.measurement import SCHEMA
from ...system import frozen
from .calibration_row import CalibrationRow, calibration_row

MOST_POINTS = 2**53  # of a scan; a catalogue counts in 64 bits
FRAME_KINDS = ("rear_track", "front_track", "wheelbase")
UNITS = ("deg", "m")
SURROGATE = re.compile("[\ud800-\udfff]")
DAMAGED = "damaged"
STATUSES = ("ok", "part", "failed", "quarantined", "damaged")
FAILED = ("failed", "quarantined", DAMAGED)
WHEELS = "wheels"  # vertical of results from before there were others
SECTIONS = (
    "$.schema $.capture $.vehicle_name $.wheels $.frame $.vehicle $.batch $.provenance.version "
    "$.calibration $.vertical_in_use $.doubts $.provenance.inputs"
)


@frozen
class CaptureRow:
    """Capture and the outcome of its measurement.

    day: `date` in days since 1970-01-01, UTC unless it names a zone. status: ok, part, failed,
    quarantined, or damaged (its JSON cannot be read). wheels: number of wheels and trials of the
    capture; wheels_ok: those with angles. vertical: from which its cambers are; empty of none.
    doubted: 1 where the scans contradict the names of the wheels, so that statistics leave it out.
    scans: number that captures of the same files share; None without checksums.
    """

    key: str
    name: str = ""
    kind: str = ""
    vehicle: str = ""
    date: str | None = None
    day: float | None = None
    status: str = DAMAGED
    stage: str = ""
    reason: str = ""
    wheels: int = 0
    wheels_ok: int = 0
    points_total: int = 0
    version: str = ""
    config_sha256: str = ""
    vertical: str = ""
    doubted: int = 0
    scans: int | None = None
    size: int = 0
    md5: str = ""


@frozen
class WheelRow:
    """Wheel or trial of a capture; None where not measured. u: standard uncertainty (k = 1)."""

    name: str
    role: str
    wheel: str | None
    status: str
    toe_deg: float | None
    camber_deg: float | None
    u_toe_deg: float | None
    u_camber_deg: float | None
    points_on_target: int | None
    plane_rms_m: float | None


@frozen
class QuantityRow:
    """Quantity of the vehicle, such as rear_total_toe; unit: deg or m."""

    kind: str
    value: float | None
    u: float | None
    unit: str


@frozen
class Record:
    """All rows of one result."""

    capture: CaptureRow
    wheels: tuple[WheelRow, ...] = ()
    quantities: tuple[QuantityRow, ...] = ()
    calibration: CalibrationRow | None = None


class _DamagedError(Exception):
    """Reason why a JSON file is not a result."""


def read_record(key: str, data: bytes, tree: dict[str, Any] | None = None) -> Record:
    """Return the rows of the JSON `data` of the result `key`; status `damaged` with the reason.

    tree: what is in it, if that is known.
    """
    blank = CaptureRow(
        key, size=len(data), md5=hashlib.md5(data, usedforsecurity=False).hexdigest()
    )
    try:
        return _record(blank, _sections(data) if tree is None else _sections_of(tree))
    except _DamagedError as error:
        return Record(replace(blank, stage="catalogue", reason=str(error)))


def _sections(data: bytes) -> list[Any]:
    """Extract the parts that the catalogue needs; SQLite parses 5 times faster than json."""
    if b"\0" in data:
        raise _DamagedError(f"not JSON: zero byte at {data.index(0)} of {len(data)}")
    try:
        (found,) = _connection().execute(_EXTRACT, (data.decode(),)).fetchone()
        sections = json.loads(found)
    except UnicodeDecodeError as error:
        raise _DamagedError(f"not UTF-8 at byte {error.start} of {len(data)}") from error
    except (sqlite3.Error, ValueError, TypeError, RecursionError) as error:
        raise _DamagedError(f"not JSON, or incomplete ({len(data)} bytes)") from error
    assert isinstance(sections, list)
    return sections


def _sections_of(tree: dict[str, Any]) -> list[Any]:
    origin, ours = "$.provenance.", tree["provenance"]
    return [
        ours.get(path[len(origin) :]) if path.startswith(origin) else tree.get(path[2:])
        for path in SECTIONS.split()
    ]


_EXTRACT = f"SELECT json_extract(?, {', '.join(map(repr, SECTIONS.split()))})"
_per_thread = threading.local()


class _Parser(sqlite3.Connection):
    """Connection that is closed when its thread ends; Python 3.13 warns of open ones."""

    def __del__(self) -> None:
        self.close()


def _connection() -> sqlite3.Connection:
    if not hasattr(_per_thread, "connection"):
        _per_thread.connection = sqlite3.connect(
            ":memory:", check_same_thread=False, factory=_Parser
        )
    connection = _per_thread.connection
    assert isinstance(connection, sqlite3.Connection)
    return connection


def _record(blank: CaptureRow, sections: list[Any]) -> Record:
    schema, name, vehicle_name, wheels, frame, vehicle, batch, version, *more = sections
    calibrated, vertical, doubts, inputs = more
    if schema != SCHEMA:
        raise _DamagedError(f"schema {schema!r:.60} instead of {SCHEMA!r}")
    if not isinstance(wheels, list) or not isinstance(batch, dict):
        raise _DamagedError("`wheels` or `batch` is missing")
    if batch.get("key") != blank.key:
        raise _DamagedError(f"contains the result {batch.get('key')!r:.80}")
    rows = tuple(_wheel(wheel) for wheel in wheels)
    date = _text(batch, "date") or None
    capture = replace(
        blank,
        name=_text({"capture": name}, "capture"),
        kind=_text(batch, "kind"),
        vehicle=_text({"vehicle_name": vehicle_name}, "vehicle_name"),
        date=date,
        day=None if date is None else _day(date),
        status=_text(batch, "status"),
        stage=_text(batch, "stage"),
        reason=_text(batch, "reason"),
        wheels=len(rows),
        wheels_ok=sum(row.toe_deg is not None for row in rows),
        points_total=_points(wheels, _text(batch, "kind")),
        version=_text({"version": version}, "version"),
        config_sha256=_text(batch, "config_sha256"),
        vertical=(_text({"vertical": vertical}, "vertical") or WHEELS) if rows else "",
        doubted=int(_is_doubted(doubts or [])),
        scans=_scans(inputs or {}),
    )
    quantities = tuple(_quantities(frame or {}, vehicle or {}))
    return Record(capture, rows, quantities, calibration_row(calibrated))


def _wheel(wheel: Any) -> WheelRow:
    if not isinstance(wheel, dict):
        raise _DamagedError("a wheel is not an object")
    angles = {
        key: _number(wheel, key)
        for key in ("toe_deg", "camber_deg", "u_toe_deg", "u_camber_deg", "plane_rms_m")
    }
    return WheelRow(
        name=_text(wheel, "name"),
        role=_text(wheel, "role"),
        wheel=_text(wheel, "wheel") or None,
        status=_text(wheel, "status"),
        points_on_target=_count(wheel, "points_on_target"),
        **angles,
    )


def _quantities(frame: Any, vehicle: Any) -> list[QuantityRow]:
    """Return the quantities of vehicle and frame with their u, in the order of the JSON."""
    if not isinstance(frame, dict) or not isinstance(vehicle, dict):
        raise _DamagedError("`frame` or `vehicle` is not an object")
    of_frame = {f"{kind}_m": frame.get(f"{kind}_m") for kind in FRAME_KINDS if frame}
    rows = []
    for key in (*of_frame, *vehicle):
        kind, _, unit = key.rpartition("_")
        if unit in UNITS and kind and not kind.startswith("u_"):
            if SURROGATE.search(kind):
                raise _DamagedError(f"a quantity is {kind!r:.60}, not Unicode")
            tree = frame if key in of_frame else vehicle
            rows.append(QuantityRow(kind, _number(tree, key), _number(tree, f"u_{key}"), unit))
    return rows


def _is_doubted(doubts: Any) -> bool:
    """Return whether a doubt is about the vehicle, and not about a trial."""
    if not isinstance(doubts, list) or not all(isinstance(one, dict) for one in doubts):
        raise _DamagedError("`doubts` is not a list of objects")
    return any(one.get("trial") is None for one in doubts)


def _scans(inputs: Any) -> int | None:
    """Return a number of 60 bits by the checksums of the files, whatever they are called."""
    if not isinstance(inputs, dict) or not all(isinstance(one, str) for one in inputs.values()):
        raise _DamagedError("`inputs` is not an object of texts")
    every = "\n".join(sorted(set(inputs.values())))
    digest = hashlib.sha256(every.encode(errors="surrogatepass")).hexdigest()
    return int(digest[:15], 16) if every else None


def _points(wheels: list[Any], kind: str) -> int:
    """Return the number of points read: a scan of a wheel and of its run-out counts once."""
    by_scan: dict[str, int] = {}
    for wheel in wheels:
        scan = _text(wheel, "name" if kind == "five-point" else "file")
        if kind == "cloud":
            scan = scan.partition(": ")[0]
        by_scan[scan] = max(by_scan.get(scan, 0), _count(wheel, "points_total") or 0)
    total = sum(by_scan.values())
    if total > MOST_POINTS:
        raise _DamagedError(f"its scans hold {total} points")
    return total


def _day(date: str) -> float:
    try:
        moment = datetime.fromisoformat(date)
    except ValueError as error:
        raise _DamagedError(f"date {date!r:.60} is not ISO 8601") from error
    zoned = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return zoned.timestamp() / 86400.0


def _text(tree: dict[str, Any], key: str) -> str:
    value = tree.get(key)
    if value is not None and not isinstance(value, str):
        raise _DamagedError(f"`{key}` is {value!r:.60}, not text")
    if value and SURROGATE.search(value):
        raise _DamagedError(f"`{key}` is {value!r:.60}, not Unicode")
    return value or ""


def _number(tree: dict[str, Any], key: str) -> float | None:
    value = tree.get(key)
    if value is None:
        return None
    try:
        if isinstance(value, bool) or not math.isfinite(value):
            raise TypeError
        return float(value)
    except (TypeError, OverflowError) as error:
        raise _DamagedError(f"`{key}` is {value!r:.60}, not a number") from error


def _count(tree: dict[str, Any], key: str) -> int | None:
    value = _number(tree, key)
    if value is None:
        return None
    if not 0 <= value < MOST_POINTS:
        raise _DamagedError(f"`{key}` is {value:g}, no number of points")
    return int(value)
