"""Options that the page offers, and validation of those in a request."""

from __future__ import annotations

import math
import mimetypes
from pathlib import Path
from typing import Any, get_args

from ...config import config_folder
from ...measurement import BY_MODEL, VerticalKind
from ...readers import ReadOptions
from ...units import LENGTH_UNITS
from ..security import RefusedError

ANGLE_UNITS = ("deg", "gon", "rad")
SCALAR: dict[str, tuple[str, ...]] = {
    "read_as": ("five-point", "cloud"),
    "length_unit": LENGTH_UNITS,
    "up": ("auto", "floor", "z"),
    "vertical": get_args(VerticalKind),
    "coordinates": ("cartesian", "spherical"),
    "angle_unit": ANGLE_UNITS,
    "azimuth": ("auto", "clockwise", "counterclockwise"),
}


KINDS = ("targets", "scanners", "tolerances")
NAMED = {"target": "targets", "scanner": "scanners", "station": "scanners"} | {
    "tolerance": "tolerances"
}
MOST_HINTS, LONGEST_NAME = 200, 200
MOST_CORNERS = 100  # of a region
Vector = tuple[float, float, float]


def known(own: Path | None = None) -> dict[str, list[str]]:
    """Return the names of targets, scanners and tolerances, and that by the vehicle model.

    own: folder of the user's files, whose names come first.
    """
    names = {kind: [*own_files(own, kind), *_shipped(own, kind)] for kind in KINDS}
    return names | {"tolerances": [BY_MODEL, *names["tolerances"]]}


def own_files(own: Path | None, kind: str) -> dict[str, Path]:
    """Return the user's files of a kind by name; they stand for shipped ones of the same name."""
    found = [] if own is None else sorted((own / kind).glob("*.toml"))
    return {path.stem: path for path in found}


def _shipped(own: Path | None, kind: str) -> list[str]:
    names = {path.stem for path in (config_folder() / kind).glob("*.toml")}
    return sorted(names - own_files(own, kind).keys())


def checked(given: Any, own: Path | None = None) -> dict[str, Any]:
    """Validate the options of a measurement: known names and finite numbers, no paths.

    own: folder of the user's files; a name of one is replaced by its path.
    Raises RefusedError for any other.
    """
    if not isinstance(given, dict):
        raise RefusedError(400, "the options are not a JSON object")
    names = known(own)
    allowed = SCALAR | {option: tuple(names[kind]) for option, kind in NAMED.items()}
    options: dict[str, Any] = {}
    for key, value in given.items():
        if value in (None, ""):
            continue
        if key == "hints":
            options[key] = _hints(value)
        elif key == "regions":
            options[key] = _regions(value)
        elif key in ("columns", "pitch"):
            options[key] = [part.strip() for part in str(value)[:LONGEST_NAME].split(",")]
        elif key in ("front", "front_point"):
            options[key] = _vector(key, value)
        elif key not in allowed or value not in allowed[key]:
            raise RefusedError(
                400, f"{str(key)[:40]}: {str(value)[:60]!r} is not an available choice"
            )
        else:
            files = own_files(own, NAMED[key]) if key in NAMED else {}
            options[key] = str(files[value]) if value in files else value
    reading_of(options)
    return options


def reading_of(options: dict[str, Any]) -> ReadOptions:
    """Return how scans are read, by the columns and the pitch of options. Raises RefusedError."""
    columns, pitch = options.get("columns"), options.get("pitch")
    try:
        steps = None
        if pitch is not None:
            dx, dy = map(float, pitch)
            steps = dx, dy
        return ReadOptions(None if columns is None else tuple(columns), steps)
    except ValueError as error:
        given = " and ".join(f"{key} {','.join(options[key])}" for key in ("columns", "pitch")
                             if key in options)  # fmt: skip
        fact = str(error) if pitch is None or len(pitch) == 2 else "two numbers are needed"
        raise RefusedError(400, f"{given}: {fact}: columns such as row,col,x,y,z,i, a pitch "
                           "such as 0.05,0.1") from error  # fmt: skip


def type_of(name: str) -> str:
    """Return the media type of a file by its name."""
    return mimetypes.guess_type(name)[0] or "application/octet-stream"


def _hints(value: Any) -> dict[str, Vector]:
    """Validate the points on targets, by the name of their scan or wheel."""
    if not isinstance(value, dict) or len(value) > MOST_HINTS:
        raise RefusedError(400, "hints: give X,Y,Z by the name of each scan")
    return {str(name)[:LONGEST_NAME]: _vector("hints", point) for name, point in value.items()}


def _regions(value: Any) -> dict[str, tuple[Vector, ...]]:
    """Validate the regions of targets, corners in rows, by the name of their scan."""
    if not isinstance(value, dict) or len(value) > MOST_HINTS:
        raise RefusedError(400, "regions: give corners by the name of each scan")
    regions: dict[str, tuple[Vector, ...]] = {}
    for name, corners in value.items():
        if not isinstance(corners, list) or not 3 <= len(corners) <= MOST_CORNERS:
            raise RefusedError(400, f"regions: give 3 to {MOST_CORNERS} corners [X, Y, Z]")
        texts = (",".join(map(str, one)) if isinstance(one, list) else "" for one in corners)
        regions[str(name)[:LONGEST_NAME]] = tuple(_vector("regions", text) for text in texts)
    return regions


def _vector(key: str, value: Any) -> Vector:
    try:
        x, y, z = (float(part) for part in str(value).split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise RefusedError(400, f"{key}: give three numbers X,Y,Z, such as 1,0,0")
    return x, y, z
