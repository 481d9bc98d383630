"""What was scanned: a folder, zip or tar with one scan a wheel, or one cloud of all wheels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import ConfigError, InputError
from ..targets import Target, load_target, parse_target, scaled, size_of
from ..units import LengthUnit, in_metres
from ..vehicle import REFERENCE_WHEELS
from .declaration import (
    CaptureFile,
    Upright,
    Vector,
    find_capture_file,
    read_capture_file,
)
from .entries import scans_of
from .entry import ScanEntry
from .file_names import by_file_names, filled_by_names
from .folder import capture_folder
from .front import Front


@dataclass(frozen=True)
class Capture:
    """A capture, ready to be read: entries are RR, RL, FR, FL, the trials, sweeps, run-outs.

    cloud: in their place, the one scan that shows all wheels; its `front`, where told, and by what
    its `up` is told. date: as ISO 8601 writes it, where declared.
    """

    source: str
    vehicle: str | None
    length_unit: str
    target: Target
    scanner: str | None
    entries: tuple[ScanEntry, ...]
    cloud: ScanEntry | None = None
    front: Front | None = None
    up: Upright = "auto"
    date: str | None = None

    @property
    def steps(self) -> int:
        """How many times measuring it tells its progress."""
        return len(self.entries) if self.cloud is None else 2 + len(REFERENCE_WHEELS)

    def called(self, entry: ScanEntry) -> str:
        """How messages call the file of a scan."""
        bare = entry.path == Path(self.source)
        return self.source if bare else f"{self.source}: {entry.file}"


@dataclass(frozen=True)
class CaptureOptions:
    """What options tell of a capture; each goes before what its capture.toml says.

    front, front_point, up: of one cloud of the vehicle, in its file's coordinates and unit.
    of_clouds: these three are told of many captures, and mean those that are clouds.
    """

    length_unit: LengthUnit | None = None
    front: Vector | None = None
    front_point: Vector | None = None
    up: Upright | None = None
    of_clouds: bool = False


NOTHING_TOLD = CaptureOptions()


@dataclass(frozen=True)
class _Opened:
    """What a capture declares, how messages call that, the folder of its files, and its scans."""

    declared: CaptureFile
    where: str
    folder: Path
    scans: tuple[ScanEntry, ...]


@contextmanager
def open_capture(
    source: Path, target: str | Target | None = None, told: CaptureOptions = NOTHING_TOLD
) -> Iterator[Capture]:
    """Open the capture at `source`; `target`, or its name, goes before the capture's own.

    An archive is unpacked into a temporary folder, which goes with the context.
    Raises InputError or ConfigError for what is missing or contradicts itself.
    """
    with _opened(source, told.length_unit) as found:
        declared = found.declared
        whole = declared.reference is None
        yield Capture(
            source=str(source),
            vehicle=declared.vehicle,
            length_unit=declared.length_unit,
            target=target_of(declared, target, found.folder, found.where),
            scanner=_beside(declared.scanner, found.folder),
            entries=() if whole else found.scans,
            cloud=found.scans[0] if whole else None,
            front=_front(found, told, source),
            up=told.up or declared.up,
            date=None if declared.date is None else declared.date.isoformat(),
        )


@contextmanager
def open_entries(source: Path) -> Iterator[tuple[str, tuple[ScanEntry, ...]]]:
    """The length unit and the scans of the capture at `source`, whose target need not be known."""
    with _opened(source) as found:
        yield found.declared.length_unit, found.scans


@contextmanager
def _opened(source: Path, length_unit: LengthUnit | None = None) -> Iterator[_Opened]:
    with capture_folder(source) as place:
        path = find_capture_file(place) if place.is_dir() else None
        where = str(source) if path is None else f"{source}: capture.toml"
        if path is not None:
            declared = filled_by_names(read_capture_file(path, where), place, source)
        elif place.is_dir():
            declared = by_file_names(place, source)
        else:
            declared = CaptureFile(cloud=place.name)
        if length_unit is not None:
            declared = declared.model_copy(update={"length_unit": length_unit})
        folder = place if place.is_dir() else place.parent
        packed = place.is_dir() and not source.is_dir()
        yield _Opened(declared, where, folder, scans_of(declared, folder, where, packed=packed))


def _front(found: _Opened, told: CaptureOptions, source: Path) -> Front | None:
    """The front as the options tell it, else as capture.toml does."""
    declared = found.declared
    options = ("--front", told.front), ("--front-point", told.front_point), ("--up", told.up)
    named = next((name for name, value in options if value is not None), None)
    if declared.reference is not None and told.of_clouds:
        return None
    if declared.reference is not None and named is not None:
        raise InputError(
            f"{source}: {named} is of a cloud that shows the whole vehicle, but each of "
            f"{', '.join(REFERENCE_WHEELS)} has a scan of its own here: leave it out"
        )
    unit = declared.length_unit
    return Front.told("", "--front", told.front, told.front_point, unit) or Front.told(
        f"{found.where}: ", "front", declared.front, declared.front_point, unit
    )


def _beside(name: str | None, folder: Path) -> str | None:
    """A configuration's name as it is; that of a file, as lying in the capture's folder."""
    return str(folder / name) if name is not None and name.endswith(".toml") else name


TARGET_SIZES_M = (0.03, 1.5)  # no wheel target is smaller or larger


def target_of(
    declared: CaptureFile, named: str | Target | None, folder: Path, where: str
) -> Target:
    """The target, `named` before the one declared; raises ConfigError or InputError."""
    if named is not None:
        return load_target(named) if isinstance(named, str) else named
    told = declared.target
    if told is None:
        raise InputError(
            f"{where}: no target is named: add --target, for instance --target disc-250"
        )
    if isinstance(told, dict):
        return parse_target(_in_metres(told, declared.length_unit, where), f"{where}: [target]")
    if not isinstance(told, str):
        raise ConfigError(f"{where}: target is {told!r}: name one, or write a table [target]")
    try:
        return load_target(str(folder / told) if told.endswith(".toml") else told)
    except ConfigError as error:
        raise ConfigError(f"{where}: {str(error).removeprefix(f'{folder}/')}") from error


def _in_metres(table: dict[str, object], unit: str, where: str) -> dict[str, object]:
    """Sizes of [target] in metres: written in metres or in the capture's unit, as only one can be.

    A diameter of 0.25 in a capture in mm is 0.25 m, since no target is 0.25 mm wide; 250 is 250 mm.
    """
    judged = size_of(table)
    if unit == "m" or judged is None:
        return table
    key, size = judged
    low, high = TARGET_SIZES_M
    scales = [s for s in (1.0, in_metres(1.0, unit)) if low <= size * s <= high]
    if len(scales) != 1:
        raise InputError(
            f"{where}: [target] {key} {size:g} can be meant in m or in {unit}: "
            "use --target with a file of the target, which is in metres"
        )
    return scaled(table, scales[0])
