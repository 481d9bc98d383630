"""One result's JSON -> its rows in the catalogue."""

from __future__ import annotations

import hashlib
import json
import math
import re
import sqlite3
import threading
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from ...report.json.measurement import SCHEMA

FRAME_KINDS = ("rear_track", "front_track", "wheelbase")
UNITS = ("deg", "m")
SURROGATE = re.compile("[\ud800-\udfff]")
DAMAGED = "damaged"
FAILED = ("failed", "quarantined", DAMAGED)
SECTIONS = (
    "$.schema $.capture $.vehicle_name $.wheels $.frame $.vehicle $.batch $.provenance.version"
)


@dataclass(frozen=True)
class CaptureRow:
    """A capture: what became of it. day: `date` as days since 1970-01-01, UTC where it says none.

    status: ok, part, failed, quarantined, or damaged (its JSON cannot be read); wheels: those of
    the capture, trials included; wheels_ok: those with angles.
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
    size: int = 0
    md5: str = ""


@dataclass(frozen=True)
class WheelRow:
    """A wheel or trial of a capture; None where it was not measured. u: standard (k = 1)."""

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


@dataclass(frozen=True)
class QuantityRow:
    """A quantity of the vehicle, such as rear_total_toe; unit: deg or m."""

    kind: str
    value: float | None
    u: float | None
    unit: str


@dataclass(frozen=True)
class Record:
    """All rows of one JSON."""

    capture: CaptureRow
    wheels: tuple[WheelRow, ...] = ()
    quantities: tuple[QuantityRow, ...] = ()


class _DamagedError(Exception):
    """Why a JSON is none of ours."""


def read_record(key: str, data: bytes) -> Record:
    """The rows of the JSON `data` that stands under `key`; status `damaged`, and why, if it is."""
    blank = CaptureRow(
        key, size=len(data), md5=hashlib.md5(data, usedforsecurity=False).hexdigest()
    )
    try:
        return _record(blank, _sections(data))
    except _DamagedError as error:
        return Record(replace(blank, stage="catalogue", reason=str(error)))


def _sections(data: bytes) -> list[Any]:
    """The parts that the catalogue needs; SQLite checks and cuts the text, 5 times json's speed."""
    if b"\0" in data:
        raise _DamagedError(f"not JSON: a zero byte at {data.index(0)} of {len(data)}")
    try:
        (found,) = _connection().execute(_EXTRACT, (data.decode(),)).fetchone()
        sections = json.loads(found)
    except UnicodeDecodeError as error:
        raise _DamagedError(f"not UTF-8 at byte {error.start} of {len(data)}") from error
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise _DamagedError(f"not JSON, or not whole ({len(data)} bytes)") from error
    assert isinstance(sections, list)
    return sections


_EXTRACT = f"SELECT json_extract(?, {', '.join(map(repr, SECTIONS.split()))})"
_of_thread = threading.local()


def _connection() -> sqlite3.Connection:
    if not hasattr(_of_thread, "connection"):
        _of_thread.connection = sqlite3.connect(":memory:", check_same_thread=False)
    connection = _of_thread.connection
    assert isinstance(connection, sqlite3.Connection)
    return connection


def _record(blank: CaptureRow, sections: list[Any]) -> Record:
    schema, name, vehicle_name, wheels, frame, vehicle, batch, version = sections
    if schema != SCHEMA:
        raise _DamagedError(f"schema {schema!r:.60} in place of {SCHEMA!r}")
    if not isinstance(wheels, list) or not isinstance(batch, dict):
        raise _DamagedError("no `wheels` or no `batch` in it")
    if batch.get("key") != blank.key:
        raise _DamagedError(f"it holds the result {batch.get('key')!r:.80}")
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
        points_total=_points(wheels, of_cloud=batch.get("kind") == "cloud"),
        version=_text({"version": version}, "version"),
        config_sha256=_text(batch, "config_sha256"),
    )
    return Record(capture, rows, tuple(_quantities(frame or {}, vehicle or {})))


def _wheel(wheel: Any) -> WheelRow:
    if not isinstance(wheel, dict):
        raise _DamagedError("a wheel is no object")
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
    """Of the vehicle and of its frame, each value with its u, in the order of the JSON."""
    if not isinstance(frame, dict) or not isinstance(vehicle, dict):
        raise _DamagedError("`frame` or `vehicle` is no object")
    of_frame = {f"{kind}_m": frame.get(f"{kind}_m") for kind in FRAME_KINDS if frame}
    rows = []
    for key in (*of_frame, *vehicle):
        kind, _, unit = key.rpartition("_")
        if unit in UNITS and kind and not kind.startswith("u_"):
            tree = frame if key in of_frame else vehicle
            rows.append(QuantityRow(kind, _number(tree, key), _number(tree, f"u_{key}"), unit))
    return rows


def _points(wheels: list[Any], of_cloud: bool) -> int:
    """Points of the scans; those of one cloud, which each of its wheels states, count once."""
    stated = [_count(wheel, "points_total") or 0 for wheel in wheels]
    return max(stated, default=0) if of_cloud else sum(stated)


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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise _DamagedError(f"`{key}` is {value!r:.60}, not a number")
    return float(value)


def _count(tree: dict[str, Any], key: str) -> int | None:
    value = _number(tree, key)
    return None if value is None else int(value)
