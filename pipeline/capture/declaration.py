"""Model of capture.toml, checked as far as the file alone allows."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field  # noqa: TID253 - capture.toml is a pydantic model

from ..config import Section, parse_section, read_toml
from ..errors import ConfigError, InputError
from ..readers import ReadOptions
from ..units import LengthUnit
from ..vehicle import REFERENCE_WHEELS

WheelName = Literal["RR", "RL", "FR", "FL"]
Upright = Literal["auto", "floor", "z"]
Vector = tuple[float, float, float]
MOST_CORNERS = 100  # of a region
Corner = Annotated[Vector, Field(strict=False)]


class DeclaredTrial(Section):
    """A further scan of a wheel; repeats: the wheel or trial scanned again with nothing moved."""

    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: WheelName | None = None
    repeats: str | None = None


class DeclaredSweep(Section):
    """A scan of a front wheel at one position of the steering."""

    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: WheelName
    position: str | None = Field(None, min_length=1)


class DeclaredRunout(Section):
    """A scan of a lifted wheel, rotated about its axle by angle_deg; or of a vehicle that rolled.

    position: of a vehicle that rolled, the same text for its four wheels; one cloud of all wheels
    names no wheel, and its name serves.
    """

    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: WheelName | None = None
    position: str | None = Field(None, min_length=1)
    angle_deg: float
    u_angle_deg: float = Field(1.0, gt=0.0, le=30.0)


class DeclaredHint(Section):
    """The operator's decision on one scan: a point on its target, or where it is searched.

    box: its least and greatest corner; region: corners of a polygon.
    """

    near: Vector | None = Field(None, strict=False)
    box: tuple[Corner, Corner] | None = Field(None, strict=False)
    region: tuple[Corner, ...] | None = Field(
        None, strict=False, min_length=3, max_length=MOST_CORNERS
    )
    by: str | None = Field(None, min_length=1)
    reason: str | None = Field(None, min_length=1)


class CaptureFile(Section):
    """capture.toml: [reference] with one scan per wheel, or `cloud` for one scan of all wheels.

    front, front_point, up: of a cloud, whose wheels are identified by geometry. date: the day or
    time of the scans, as TOML writes it: date = 2026-11-20. vehicle_model: by which its limits are
    found. columns, pitch: what the scans do not say themselves, the names of a text's columns or
    the pitch of a matrix of heights. gravity: the way in which things fall, and floor: the normal
    of the floor, upwards, scan coordinates; u: standard uncertainties about each axis. hints: by
    the name of a scan, or of a cloud's wheel, in its coordinates and unit. targets: by the name of
    a scan, where not all show the same.
    """

    vehicle: str | None = None
    vehicle_model: str | None = Field(None, min_length=1)
    date: dt.datetime | dt.date | None = None
    length_unit: LengthUnit = "m"
    columns: tuple[str, ...] | None = Field(None, strict=False)
    pitch: tuple[float, float] | None = Field(None, strict=False)
    target: object = None
    targets: dict[str, object] = Field(default_factory=dict)
    scanner: str | None = None
    reference: dict[str, str] | None = None
    trial: tuple[DeclaredTrial, ...] = Field((), strict=False)
    sweep: tuple[DeclaredSweep, ...] = Field((), strict=False)
    runout: tuple[DeclaredRunout, ...] = Field((), strict=False)
    cloud: str | None = Field(None, min_length=1)
    front: Vector | None = Field(None, strict=False)
    front_point: Vector | None = Field(None, strict=False)
    up: Upright = "auto"
    gravity: Vector | None = Field(None, strict=False)
    gravity_u_deg: float | None = Field(None, ge=0.0, le=10.0)
    floor: Vector | None = Field(None, strict=False)
    floor_u_deg: float | None = Field(None, ge=0.0, le=10.0)
    hints: dict[str, DeclaredHint] = Field(default_factory=dict)


def reading_of(declared: CaptureFile, where: str) -> ReadOptions:
    """Return what a capture states of its scans. Raises ConfigError for columns that cannot be."""
    try:
        return ReadOptions(declared.columns, declared.pitch)
    except ValueError as error:
        raise ConfigError(f"{where}: columns or pitch: {error}") from error


def files_of(declared: CaptureFile) -> list[str]:
    """Return the files that a capture declares, by its names: scans, target, scanner."""
    more: tuple[DeclaredTrial | DeclaredSweep | DeclaredRunout, ...] = (
        *declared.trial,
        *declared.sweep,
        *declared.runout,
    )
    scans = [declared.cloud, *(declared.reference or {}).values(), *(scan.file for scan in more)]
    named = [n for n in named_files(declared) if n.endswith(".toml")]
    return [name for name in (*scans, *named) if isinstance(name, str)]


def named_files(declared: CaptureFile) -> list[str]:
    """Return the names by which a capture declares targets and scanner; a table has none."""
    named = (declared.target, *declared.targets.values(), declared.scanner)
    return [name for name in named if isinstance(name, str)]


def find_capture_file(folder: Path) -> Path | None:
    """Return the capture.toml of a folder, in upper or lower case."""
    return next((p for p in folder.iterdir() if p.name.lower() == "capture.toml"), None)


def read_capture_file(path: Path, where: str) -> CaptureFile:
    """Read the capture.toml at `path`; messages name it `where`.

    Raises ConfigError or InputError for entries that are wrong or contradict each other.
    """
    try:
        table = read_toml(path)
    except ConfigError as error:
        raise ConfigError(f"{where}: {str(error).removeprefix(f'{path}: ')}") from error
    declared = parse_section(CaptureFile, table, where)
    reading_of(declared, where)
    if declared.reference is None:
        _check_cloud(declared, where)
    else:
        _check_reference(declared, declared.reference, where)
    return declared


def _check_cloud(declared: CaptureFile, where: str) -> None:
    for table in ("trial", "sweep"):
        if getattr(declared, table):
            raise InputError(
                f"{where}: [[{table}]] without [reference]: a cloud of the whole vehicle has "
                f"no others: give each wheel its scan in [reference], or leave out [[{table}]]"
            )
    for scan in declared.runout:
        if scan.wheel is not None:
            raise InputError(
                f"{where}: runout {scan.name!r} is of {scan.wheel}, in a capture of one cloud: "
                "give each wheel its scan in [reference], or name a cloud of the rolled vehicle "
                "and leave out its wheel"
            )


def _check_reference(declared: CaptureFile, reference: dict[str, str], where: str) -> None:
    if declared.cloud is not None:
        raise InputError(
            f"{where}: holds both [reference] and cloud = {declared.cloud!r}: keep [reference] for "
            "one scan a wheel, or cloud for one scan of all wheels"
        )
    for scan in declared.runout:
        if scan.wheel is None:
            raise InputError(
                f'{where}: runout {scan.name!r} names no wheel: add wheel = "RR", or another'
            )
    for wheel in REFERENCE_WHEELS:
        if wheel not in reference:
            raise InputError(f"{where}: [reference] lacks {wheel}: name the scan of that wheel")
    extra = sorted(set(reference) - set(REFERENCE_WHEELS))
    if extra:
        raise InputError(
            f"{where}: [reference] names {extra[0]!r}: its wheels are {', '.join(REFERENCE_WHEELS)}"
        )
    for key in ("front", "front_point", "up"):
        if key in declared.model_fields_set:
            raise InputError(
                f"{where}: {key} with [reference], which names the wheels already: leave it out"
            )
