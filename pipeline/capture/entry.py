"""One scan of a capture: what it is called, which wheel it shows, where its file lies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Role = Literal["reference", "trial", "sweep", "runout", "vehicle"]


@dataclass(frozen=True)
class Turn:
    """Where a wheel stood in a scan of a sweep or a run-out.

    position: of the steering wheel, named alike for both front wheels; None where not told.
    angle_rad: about the axle, as the wheel rolls forwards, u_rad: its standard uncertainty; None in
    a sweep, whose angles are measured.
    """

    position: str | None = None
    angle_rad: float | None = None
    u_rad: float | None = None


@dataclass(frozen=True)
class ScanEntry:
    """One scan: its name in the result, its role, its wheel where named, its file.

    repeats: the reference wheel or trial that it shows once more, with nothing moved. turn: of a
    scan of a sweep or a run-out. The role 'vehicle' is that of a cloud which shows all wheels.
    """

    name: str
    role: Role
    wheel: str | None
    file: str
    path: Path
    repeats: str | None = None
    turn: Turn | None = None
