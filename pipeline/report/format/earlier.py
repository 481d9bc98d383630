"""An earlier measurement of the same vehicle, from its measurement.json, and what changed since."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any

from ...errors import InputError, fact_of, remedy_of
from ...measurement import Measurement
from ...system import frozen
from ...vehicle import named
from .view import DEFINED

SCHEMA = "wheelplane/measurement/1"
SCALE = {"deg": math.radians(1.0), "m": 1.0}
STEERING = ("caster", "inclination")


@frozen
class Known:
    """A value with its standard and expanded uncertainty, radians or metres."""

    value: float
    u: float
    expanded: float

    def less(self, other: Known) -> Known:
        """Return the difference of two independent values."""
        u, expanded = math.hypot(self.u, other.u), math.hypot(self.expanded, other.expanded)
        return Known(self.value - other.value, u, expanded)


@frozen
class Earlier:
    """Content of measurement.json, by name: `RR.toe`, `thrust_angle`, `FL.caster`.

    compensated: wheels whose angles are free of run-out. inputs: SHA-256 of the scans. wheels: of
    the wheels and trials, by name.
    """

    source: str
    sha256: str
    capture: str
    vehicle: str | None
    date: str | None
    values: Mapping[str, Known]
    vertical: str = "wheels"
    compensated: frozenset[str] = frozenset()
    inputs: frozenset[str] = frozenset()
    wheels: Mapping[str, str | None] = field(default_factory=dict)

    def values_for(self, now: Measurement) -> dict[str, Known]:
        """Return the values without those of trials that are at another wheel now."""
        wheels = {one.observation.name: one.wheel for one in now.wheels}
        moved = {name for name, wheel in self.wheels.items() if wheels.get(name, wheel) != wheel}
        return {
            name: known
            for name, known in self.values.items()
            if name.rpartition(".")[0] not in moved
        }


def read_tree(path: Path, name: str) -> tuple[dict[str, Any], bytes]:
    """Return the tree of a measurement.json, and the file's bytes.

    Raises InputError that names the file `name` and the fact.
    """
    try:
        data = path.read_bytes()
        tree = json.loads(data)
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}: {remedy_of(error)}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not JSON: give a measurement.json") from error
    if not isinstance(tree, dict) or tree.get("schema") != SCHEMA:
        raise InputError(f"{name}: no measurement of schema {SCHEMA!r}: give a measurement.json")
    return tree, data


def read_earlier(path: Path) -> Earlier:
    """Read measurement.json. Raises InputError that names the file and the fact."""
    tree, data = read_tree(path, str(path))
    try:
        return Earlier(
            source=str(path),
            sha256=hashlib.sha256(data).hexdigest(),
            capture=str(tree["capture"]),
            vehicle=tree["vehicle_name"],
            date=None if tree["date"] is None else str(tree["date"]),
            values=dict(_values(tree)),
            vertical=tree.get("vertical_in_use", "wheels"),
            compensated=frozenset(
                w["name"] for w in tree.get("wheels", ()) if w.get("compensated")
            ),
            inputs=frozenset(tree.get("provenance", {}).get("inputs", {}).values()),
            wheels={w["name"]: w["wheel"] for w in tree.get("wheels", ())},
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: a measurement.json that is incomplete ({fact_of(error)}): measure that "
            "capture again"
        ) from error


def check_same_vertical(earlier: Earlier, vertical: str) -> None:
    """Raise InputError where the cambers of the two are not measured from the same vertical."""
    if earlier.vertical != vertical:
        raise InputError(
            f"{earlier.source}: its camber, caster and SAI are those of --vertical "
            f"{earlier.vertical}, not {vertical}: give that, or another earlier measurement"
        )


def check_same_vehicle(earlier: Earlier, vehicle: str | None, source: str) -> None:
    """Raise InputError where both name their vehicle, and not the same one."""
    if earlier.vehicle and vehicle and earlier.vehicle != vehicle:
        raise InputError(
            f"{earlier.source}: is of the vehicle {earlier.vehicle!r}, {source} of {vehicle!r}: "
            "give an earlier measurement of the same vehicle"
        )


def check_comparable(earlier: Earlier, measurement: Measurement) -> None:
    """Raise InputError where the values of the two do not show what has changed since."""
    made = measurement.provenance
    check_same_vehicle(earlier, made.vehicle, made.source)
    check_same_vertical(earlier, measurement.vertical_kind)
    if earlier.date and made.date and _is_after(earlier.date, made.date):
        raise InputError(
            f"{earlier.source}: is of {earlier.date}, after {made.source} of {made.date}: exchange "
            "the two, or give another earlier measurement"
        )
    now = {one.observation.name for one in measurement.wheels if one.compensated}
    unlike = sorted({"RR", "RL", "FR", "FL"} & (now ^ earlier.compensated))
    if unlike:
        free, mounted = ("after", "before") if set(unlike) & now else ("before", "after")
        raise InputError(
            f"{earlier.source}: the angles of {', '.join(unlike)} are those of the axle, free of "
            f"run-out, {free}, and those of the target as mounted {mounted}: measure both with "
            "run-outs, or both without"
        )


def _is_after(date: str, other: str) -> bool:
    """Return whether a date (ISO 8601) is after another: by time where both have one of a kind."""
    with suppress(ValueError):
        first, second = map(dt.datetime.fromisoformat, (date, other))
        if "T" in date and "T" in other and (first.tzinfo is None) == (second.tzinfo is None):
            return first > second
    return date[:10] > other[:10]


def counted_otherwise(tree: Mapping[str, Any]) -> frozenset[str]:
    """Return the quantities of a measurement.json that its version counted otherwise.

    Its toes of rear trials are from the thrust line of the reference wheels, unless its words for
    that line are those of today.
    """
    stated = tree.get("axes", {}).get("thrust-line", {}).get("definition")
    if stated == DEFINED["thrust-line"]:
        return frozenset()
    return frozenset(
        f"{wheel['name']}.{named(kind, 'thrust-line')}"
        for wheel in tree["wheels"]
        for kind in ("toe", "camber_iso")
        if wheel["role"] != "reference" and wheel["wheel"] in ("RR", "RL")
    )


def _values(tree: Mapping[str, Any]) -> Iterator[tuple[str, Known]]:
    """Yield the values by name, but for provisional ones of wheels that were not measured."""
    otherwise = counted_otherwise(tree)
    unsure = {wheel["name"] for wheel in tree.get("wheels", ()) if wheel["toe_deg"] is None}
    for entry in tree["uncertainty"]:
        if entry["quantity"] in otherwise or entry["quantity"].rpartition(".")[0] in unsure:
            continue
        numbers = (entry["value"], entry["u"], entry["expanded_95"])
        yield entry["quantity"], _known(numbers, SCALE[entry["unit"]])
    for axis in tree["steering"]["kingpins"]:
        for name in STEERING:
            numbers = (axis[f"{name}_deg"], axis[f"u_{name}_deg"], axis[f"expanded_{name}_deg"])
            if None not in numbers:
                yield f"{axis['wheel']}.{name}", _known(numbers, SCALE["deg"])


def _known(numbers: tuple[float, float, float], scale: float) -> Known:
    return Known(*(float(number) * scale for number in numbers))
