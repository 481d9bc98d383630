"""Record of one scan of a capture: its name, its role, its wheel, its file."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Literal

from ..files import sha256, sha256_of
from ..readers import ReadOptions, Scan, read_scan
from ..system import frozen, stage

Role = Literal["reference", "trial", "sweep", "runout", "vehicle"]


@frozen
class Turn:
    """Stated position of a wheel in a scan of a sweep or a run-out.

    position: of the steering wheel, the same name for both front wheels, or of a vehicle that has
    rolled, the same for all four; None if not stated.
    angle_rad: rotation about the axle, > 0 as the wheel rolls forwards, u_rad: its standard
    uncertainty; None in a sweep, whose angles are measured.
    """

    position: str | None = None
    angle_rad: float | None = None
    u_rad: float | None = None


@frozen
class ScanEntry:
    """One scan: its name in the result, its role, its wheel if named, its file.

    repeats: the reference wheel or trial that it shows again, with nothing moved. turn: position of
    the wheel in a sweep or a run-out. The role 'vehicle' is that of a cloud of all wheels. scan: of
    points in memory, which no file holds.
    """

    name: str
    role: Role
    wheel: str | None
    file: str
    path: Path
    repeats: str | None = None
    turn: Turn | None = None
    scan: Scan | None = field(default=None, repr=False, compare=False)

    @stage("read")
    def read(
        self, length_unit: str, source: str, options: ReadOptions, in_place: bool = False
    ) -> Scan:
        """Return the scan, read from its file unless it is in memory; in_place: as of `read_scan`.

        In its file, only passes by compiled kernels are as fast as in memory.
        """
        if self.scan is not None:
            return self.scan
        return read_scan(self.path, length_unit, source, options, in_place=in_place)

    @property
    @stage("read")
    def sha256(self) -> str:
        """Digest of the file, or of the points in memory: float64, metres, row by row."""
        return sha256(self.path) if self.scan is None else sha256_of(self.scan.points_m.data)
