"""Verticals as capture.toml states them: the floor's normal, gravity."""

from __future__ import annotations

import math
from typing import Literal

from ..errors import InputError
from ..system import frozen
from .declaration import CaptureFile

SENSES: dict[Literal["floor", "gravity"], tuple[float, str]] = {
    "floor": (1.0, "the floor's normal, upwards"),
    "gravity": (-1.0, "the way in which things fall"),
}


@frozen
class StatedVertical:
    """A direction up, (3,) unit, scan coordinates, with u (k = 1) about each axis across it.

    note: the entry, as the user wrote it. meaning: the sense in which it is written.
    """

    kind: Literal["floor", "gravity"]
    up: tuple[float, float, float]
    u_rad: float
    note: str
    meaning: str


def stated_verticals(declared: CaptureFile, where: str) -> tuple[StatedVertical, ...]:
    """Return the verticals that a capture states. Raises InputError without length or u."""
    found = []
    for kind, (sense, meaning) in SENSES.items():
        vector, u_deg = getattr(declared, kind), getattr(declared, f"{kind}_u_deg")
        if vector is None and u_deg is None:
            continue
        if vector is None:
            raise InputError(f"{where}: {kind}_u_deg without {kind} = [x, y, z]: add {meaning}")
        note = f"{kind} = [{', '.join(f'{x:g}' for x in vector)}]"
        largest = max(map(abs, vector))
        if not (math.isfinite(largest) and largest > 0.0):
            raise InputError(f"{where}: {note}: it has no length: give {meaning}")
        if u_deg is None:
            raise InputError(
                f"{where}: {note}: add {kind}_u_deg, its standard uncertainty about each axis"
            )
        whole = sense * math.hypot(*(x / largest for x in vector)) * largest
        x, y, z = (part / whole for part in vector)
        found.append(StatedVertical(kind, (x, y, z), math.radians(u_deg), note, meaning))
    return tuple(found)
