"""Opening of a capture: a folder, zip or tar with one scan per wheel, or one cloud of all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field
from pathlib import Path

from ..errors import InputError
from ..readers import AS_THE_FILE_SAYS, ReadOptions
from ..system import frozen
from ..targets import Target, TargetChoice
from ..units import LengthUnit
from ..vehicle import REFERENCE_WHEELS
from .declaration import (
    CaptureFile,
    Upright,
    Vector,
    find_capture_file,
    read_capture_file,
    reading_of,
)
from .entries import check_inside, scans_of
from .entry import ScanEntry
from .file_names import by_file_names, filled_by_names
from .folder import capture_folder
from .front import Front
from .hints import Corners, Hint, hints_of
from .mounted import targets_of
from .vertical import StatedVertical, stated_verticals


@frozen
class Capture:
    """A capture, ready to be read: entries are RR, RL, FR, FL, the trials, sweeps, run-outs.

    targets: by the names of scans, or of a cloud's wheels, whose target is not the common one.
    cloud: instead of entries, the one scan that shows all wheels, with its `front`, if given, and
    the method that finds `up`; rolled: more such scans, after the vehicle has rolled. date: in ISO
    8601, if declared. vehicle_model: if declared. reading: what the scans do not say. verticals:
    the floor's normal and gravity, as far as they are stated. hints: the operator's decisions, by
    the name of an entry, for a cloud of a wheel or 'vehicle'. folder: that holds its files,
    unpacked if they came in an archive. within: folder that they must lie in, if they were not
    unpacked.
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
    vehicle_model: str | None = None
    reading: ReadOptions = AS_THE_FILE_SAYS
    verticals: tuple[StatedVertical, ...] = ()
    hints: Mapping[str, Hint] = field(default_factory=dict)
    folder: Path = Path()
    within: Path | None = None
    targets: Mapping[str, Target] = field(default_factory=dict)
    rolled: tuple[ScanEntry, ...] = ()

    def target_of(self, entry: ScanEntry) -> Target:
        """Return the target that a scan shows."""
        return self.targets.get(entry.name, self.target)

    @property
    def of_wheels(self) -> dict[str, Target]:
        """Target of each of RR, RL, FR, FL."""
        return {wheel: self.targets.get(wheel, self.target) for wheel in REFERENCE_WHEELS}

    @property
    def steps(self) -> int:
        """Number of progress steps of its measurement."""
        clouds = 0 if self.cloud is None else 1 + len(self.rolled)
        return len(self.entries) + clouds * (2 + len(REFERENCE_WHEELS))

    def called(self, entry: ScanEntry) -> str:
        """Return the name of a scan's file in messages."""
        bare = entry.path == Path(self.source)
        return self.source if bare else f"{self.source}: {entry.file}"


@frozen
class CaptureOptions:
    """Command-line overrides of capture.toml.

    reading: replaces its columns and pitch, if it states either.
    front, front_point, up: of one cloud of the vehicle, in its file's coordinates and unit.
    of_clouds: these three are given for many captures, and apply to those that are clouds.
    hints: points on targets by the name of their scan or wheel, likewise; regions: corners (K, 3)
    of the region in which the target of a scan lies, of a cloud by 'vehicle'.
    """

    length_unit: LengthUnit | None = None
    front: Vector | None = None
    front_point: Vector | None = None
    up: Upright | None = None
    of_clouds: bool = False
    reading: ReadOptions = AS_THE_FILE_SAYS
    hints: Mapping[str, Vector] = field(default_factory=dict)
    regions: Mapping[str, Corners] = field(default_factory=dict)


NO_OPTIONS = CaptureOptions()


@frozen
class _Opened:
    """Declaration of a capture, its name in messages, its folder, its scans, and their limit."""

    declared: CaptureFile
    where: str
    folder: Path
    scans: tuple[ScanEntry, ...]
    within: Path | None


@contextmanager
def open_capture(
    source: Path,
    target: str | Target | TargetChoice | None = None,
    options: CaptureOptions = NO_OPTIONS,
    within: Path | None = None,
) -> Iterator[Capture]:
    """Open the capture at `source`; `target`, or its name, overrides the capture's own ones.

    An archive is unpacked into a temporary folder, which is deleted with the context. within:
    folder that the capture and all files that it names must lie in, such as that of a batch.
    Raises InputError or ConfigError for missing or contradictory entries.
    """
    with _opened(source, options.length_unit, within) as found:
        declared = found.declared
        whole = declared.reference is None
        common, own = targets_of(declared, target, found.scans, found.folder, found.where)
        yield Capture(
            source=str(source),
            vehicle=declared.vehicle,
            length_unit=declared.length_unit,
            target=common,
            scanner=_in_folder(declared.scanner, found.folder),
            entries=() if whole else found.scans,
            cloud=found.scans[0] if whole else None,
            rolled=found.scans[1:] if whole else (),
            front=_front(found, options, source),
            up=options.up or declared.up,
            date=None if declared.date is None else declared.date.isoformat(),
            vehicle_model=declared.vehicle_model,
            reading=_reading(found, options.reading),
            verticals=stated_verticals(declared, found.where),
            hints=hints_of(
                declared.hints,
                options.hints,
                options.regions,
                found.scans,
                declared.length_unit,
                found.where,
            ),
            folder=found.folder,
            within=found.within,
            targets=own,
        )


@frozen
class Entries:
    """The scans of a capture, and how they are read."""

    scans: tuple[ScanEntry, ...]
    length_unit: str
    reading: ReadOptions


@contextmanager
def open_entries(
    source: Path, reading: ReadOptions = AS_THE_FILE_SAYS, within: Path | None = None
) -> Iterator[Entries]:
    """Open the capture at `source` without its target; `reading` is as in CaptureOptions."""
    with _opened(source, within=within) as found:
        yield Entries(found.scans, found.declared.length_unit, _reading(found, reading))


def _reading(found: _Opened, given: ReadOptions) -> ReadOptions:
    return given if given.stated() else reading_of(found.declared, found.where)


@contextmanager
def _opened(
    source: Path, length_unit: LengthUnit | None = None, within: Path | None = None
) -> Iterator[_Opened]:
    check_inside(within, source, source.name, str(source))
    with capture_folder(source) as location:
        path = find_capture_file(location) if location.is_dir() else None
        where = str(source) if path is None else f"{source}: capture.toml"
        packed = location.is_dir() and not source.is_dir()
        if path is not None:
            check_inside(None if packed else within, path, path.name, str(source))
            declared = filled_by_names(read_capture_file(path, where), location, source)
        elif location.is_dir():
            declared = by_file_names(location, source)
        else:
            declared = CaptureFile(cloud=location.name)
        if length_unit is not None:
            declared = declared.model_copy(update={"length_unit": length_unit})
        folder = location if location.is_dir() else location.parent
        scans = scans_of(declared, folder, where, packed=packed, within=within)
        yield _Opened(declared, where, folder, scans, None if packed else within)


def _front(found: _Opened, options: CaptureOptions, source: Path) -> Front | None:
    """Return the front that the options give, else that of capture.toml."""
    declared = found.declared
    given = {"--front": options.front, "--front-point": options.front_point, "--up": options.up}
    named = next((name for name, value in given.items() if value is not None), None)
    if declared.reference is not None and options.of_clouds:
        return None
    if declared.reference is not None and named is not None:
        raise InputError(
            f"{source}: {named} is for a cloud of the whole vehicle, but each of "
            f"{', '.join(REFERENCE_WHEELS)} has a scan of its own here: leave it out"
        )
    unit = declared.length_unit
    return Front.given("", "--front", options.front, options.front_point, unit) or Front.given(
        f"{found.where}: ", "front", declared.front, declared.front_point, unit
    )


def _in_folder(name: str | None, folder: Path) -> str | None:
    """Return a configuration's name unchanged, and a file's as a path in the capture's folder."""
    return str(folder / name) if name is not None and name.endswith(".toml") else name
