"""Options that the page offers, and validation of those in a request."""

from __future__ import annotations

import math
import mimetypes
from typing import Any

from ...config import config_folder
from ...measurement import BY_MODEL
from ..security import RefusedError

UNITS = ("m", "mm", "in")
ANGLE_UNITS = ("deg", "gon", "rad")
SCALAR: dict[str, tuple[str, ...]] = {
    "read_as": ("five-point", "cloud"),
    "length_unit": UNITS,
    "up": ("auto", "floor", "z"),
    "coordinates": ("cartesian", "spherical"),
    "angle_unit": ANGLE_UNITS,
    "azimuth": ("auto", "clockwise", "counterclockwise"),
}


MOST_HINTS, LONGEST_NAME = 200, 200


def known() -> dict[str, list[str]]:
    """Return the names of targets, scanners and tolerances, and that by the vehicle model."""
    names = {
        kind: sorted(path.stem for path in (config_folder() / kind).glob("*.toml"))
        for kind in ("targets", "scanners", "tolerances")
    }
    return names | {"tolerances": [BY_MODEL, *names["tolerances"]]}


def checked(given: Any) -> dict[str, Any]:
    """Validate the options of a measurement: known names and finite numbers, no paths.

    Raises RefusedError for any other.
    """
    if not isinstance(given, dict):
        raise RefusedError(400, "the options are not a JSON object")
    names = known()
    allowed = SCALAR | {
        "target": tuple(names["targets"]),
        "scanner": tuple(names["scanners"]),
        "station": tuple(names["scanners"]),
        "tolerance": tuple(names["tolerances"]),
    }
    options: dict[str, Any] = {}
    for key, value in given.items():
        if value in (None, ""):
            continue
        if key == "hints":
            options[key] = _hints(value)
        elif key in ("front", "front_point"):
            options[key] = _vector(key, value)
        elif key not in allowed or value not in allowed[key]:
            raise RefusedError(
                400, f"{str(key)[:40]}: {str(value)[:60]!r} is not an available choice"
            )
        else:
            options[key] = value
    return options


def type_of(name: str) -> str:
    """Return the media type of a file by its name."""
    return mimetypes.guess_type(name)[0] or "application/octet-stream"


def _hints(value: Any) -> dict[str, tuple[float, float, float]]:
    """Validate the points on targets, by the name of their scan or wheel."""
    if not isinstance(value, dict) or len(value) > MOST_HINTS:
        raise RefusedError(400, "hints: give X,Y,Z by the name of each scan")
    return {str(name)[:LONGEST_NAME]: _vector("hints", point) for name, point in value.items()}


def _vector(key: str, value: Any) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in str(value).split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise RefusedError(400, f"{key}: give three numbers X,Y,Z, such as 1,0,0")
    return x, y, z
