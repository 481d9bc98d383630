"""What was scanned: a folder, zip or tar with one scan a wheel, and which shows which."""

from __future__ import annotations

import math
import posixpath
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import Field  # noqa: TID253 - capture.toml is a pydantic model

from pipeline.archive import ARCHIVE_SUFFIXES, COMPRESSED_SUFFIXES, is_archive, open_archive
from pipeline.config import Section, parse_section, read_toml
from pipeline.errors import ConfigError, InputError
from pipeline.reference_frame import REFERENCE_WHEELS
from pipeline.targets import DiscTarget, load_target, parse_target
from pipeline.units import in_metres

TARGET_SIZES_M = (0.03, 1.5)  # no wheel target is smaller or larger

Role = Literal["reference", "trial", "sweep", "runout"]


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
    scan of a sweep or a run-out.
    """

    name: str
    role: Role
    wheel: str | None
    file: str
    path: Path
    repeats: str | None = None
    turn: Turn | None = None


@dataclass(frozen=True)
class Capture:
    """A capture, ready to be read: entries are RR, RL, FR, FL, the trials, sweeps, run-outs."""

    source: str
    vehicle: str | None
    length_unit: str
    target: DiscTarget
    scanner: str | None
    entries: tuple[ScanEntry, ...]


class _Trial(Section):
    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: Literal["RR", "RL", "FR", "FL"] | None = None
    repeats: str | None = None


class _Sweep(Section):
    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: Literal["RR", "RL", "FR", "FL"]
    position: str | None = Field(None, min_length=1)


class _Runout(Section):
    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: Literal["RR", "RL", "FR", "FL"]
    angle_deg: float
    u_angle_deg: float = Field(1.0, gt=0.0, le=30.0)


class _CaptureFile(Section):
    vehicle: str | None = None
    length_unit: Literal["m", "mm", "in"] = "m"
    target: object = None
    scanner: str | None = None
    reference: dict[str, str]
    trial: tuple[_Trial, ...] = Field((), strict=False)
    sweep: tuple[_Sweep, ...] = Field((), strict=False)
    runout: tuple[_Runout, ...] = Field((), strict=False)


@contextmanager
def open_capture(source: Path, target: str | None = None) -> Iterator[Capture]:
    """Open the capture at `source`; `target` names the target and goes before the capture's own.

    An archive is unpacked into a temporary folder, which goes with the context.
    Raises InputError or ConfigError for what is missing or contradicts itself.
    """
    with _opened(source) as (folder, packed):
        parsed, where = _declaration(folder, source)
        entries = _entries(parsed, folder, where, packed=packed)
        yield Capture(
            source=str(source),
            vehicle=parsed.vehicle,
            length_unit=parsed.length_unit,
            target=_target(parsed, target, folder, where),
            scanner=_beside(parsed.scanner, folder),
            entries=entries,
        )


@contextmanager
def open_entries(source: Path) -> Iterator[tuple[str, tuple[ScanEntry, ...]]]:
    """The length unit and the scans of the capture at `source`, whose target need not be known."""
    with _opened(source) as (folder, packed):
        parsed, where = _declaration(folder, source)
        yield parsed.length_unit, _entries(parsed, folder, where, packed=packed)


@contextmanager
def _opened(source: Path) -> Iterator[tuple[Path, bool]]:
    """The folder of a capture, and whether it came out of an archive."""
    if _is_there(source, source.is_dir):
        yield source, False
    elif not source.exists():
        raise InputError(f"{source}: no such file or folder: check the path")
    elif not source.is_file():
        raise InputError(f"{source}: not a regular file: copy the capture to a folder or a file")
    elif is_archive(source, str(source)):
        with tempfile.TemporaryDirectory(prefix="wheelplane-") as scratch:
            folder = Path(scratch) / "capture"
            folder.mkdir()
            with open_archive(source, str(source), Path(scratch)) as archive:
                archive.unpack(folder)
            yield _top(folder), True
    else:
        raise InputError(
            f"{source}: not a folder, zip or tar: a capture holds one scan file for each of "
            f"{', '.join(REFERENCE_WHEELS)}; for a single cloud use `wheelplane plane`"
        )


def _is_there(source: Path, test: Callable[[], bool]) -> bool:
    try:
        return test()
    except OSError as error:  # a name too long, a folder that may not be entered
        raise InputError(f"{source}: {error.strerror}: check the path") from error


def _declaration(folder: Path, source: Path) -> tuple[_CaptureFile, str]:
    """What capture.toml, or the files' names, say; and how messages call it."""
    declared = next((p for p in folder.iterdir() if p.name.lower() == "capture.toml"), None)
    if declared is None:
        return _by_file_names(folder, source), str(source)
    where = f"{source}: capture.toml"
    try:
        table = read_toml(declared)
    except ConfigError as error:
        raise ConfigError(f"{where}: {str(error).removeprefix(f'{declared}: ')}") from error
    parsed = parse_section(_CaptureFile, table, where)
    _check_reference(parsed.reference, where)
    return parsed, where


def _entries(
    parsed: _CaptureFile, folder: Path, where: str, *, packed: bool
) -> tuple[ScanEntry, ...]:
    """RR, RL, FR, FL, the trials, the sweeps, the run-outs; their files are there."""
    entries = [ScanEntry(w, "reference", w, parsed.reference[w], Path()) for w in REFERENCE_WHEELS]
    entries += [_of_trial(t, parsed.trial, where) for t in parsed.trial]
    entries += _of_sweeps(parsed.sweep, where) + _of_runouts(parsed.runout, where)
    _check_names(entries, where)
    if packed:
        told = [name for name in (parsed.target, parsed.scanner) if isinstance(name, str)]
        _check_inside(folder, [*(entry.file for entry in entries), *told], where)
    return tuple(replace(entry, path=_existing(folder, entry.file, where)) for entry in entries)


def _beside(name: str | None, folder: Path) -> str | None:
    """A configuration's name as it is; that of a file, as lying in the capture's folder."""
    return str(folder / name) if name is not None and name.endswith(".toml") else name


def _check_reference(reference: dict[str, str], where: str) -> None:
    for wheel in REFERENCE_WHEELS:
        if wheel not in reference:
            raise InputError(f"{where}: [reference] lacks {wheel}: name the scan of that wheel")
    extra = sorted(set(reference) - set(REFERENCE_WHEELS))
    if extra:
        raise InputError(
            f"{where}: [reference] names {extra[0]!r}: its wheels are {', '.join(REFERENCE_WHEELS)}"
        )


def _of_trial(trial: _Trial, trials: tuple[_Trial, ...], where: str) -> ScanEntry:
    """The entry of a trial; what it repeats is a reference wheel or a trial that repeats none."""
    told = f"{where}: trial {trial.name!r} repeats {trial.repeats!r}"
    of = trial.repeats
    if of is None or of in REFERENCE_WHEELS:
        if of is not None and trial.wheel not in (None, of):
            raise InputError(f"{told}, but its wheel is {trial.wheel}: leave its wheel out")
        return ScanEntry(trial.name, "trial", of or trial.wheel, trial.file, Path(), of)
    first = next((other for other in trials if other.name == of and other is not trial), None)
    if first is None or first.repeats is not None:
        raise InputError(f"{told}: name a reference wheel, or a trial that repeats no other")
    if trial.wheel is not None and trial.wheel != first.wheel:
        raise InputError(f"{told}, whose wheel is {first.wheel}: leave its wheel out")
    return ScanEntry(trial.name, "trial", first.wheel, trial.file, Path(), of)


def _of_sweeps(sweeps: tuple[_Sweep, ...], where: str) -> list[ScanEntry]:
    """The scans of the sweeps, of front wheels, each at one position of the steering."""
    entries, seen = [], set()
    for scan in sweeps:
        told = f"{where}: sweep {scan.name!r}"
        if scan.wheel.startswith("R"):
            raise InputError(f"{told} is of {scan.wheel}, which does not steer: name FR or FL")
        if scan.position is not None and (scan.wheel, scan.position) in seen:
            raise InputError(
                f"{told}: {scan.wheel} has another scan at position {scan.position!r}: "
                "give each its own, the same for FR and FL"
            )
        seen.add((scan.wheel, scan.position))
        turn = Turn(position=scan.position)
        entries.append(ScanEntry(scan.name, "sweep", scan.wheel, scan.file, Path(), turn=turn))
    return entries


def _of_runouts(runouts: tuple[_Runout, ...], where: str) -> list[ScanEntry]:
    """The scans of the run-outs, two or more a wheel."""
    entries = []
    for scan in runouts:
        if sum(other.wheel == scan.wheel for other in runouts) < 2:
            raise InputError(
                f"{where}: runout {scan.name!r} is the only one of {scan.wheel}: add a scan with "
                "the wheel turned about its axle, best by 180 degrees"
            )
        turn = Turn(None, math.radians(scan.angle_deg), math.radians(scan.u_angle_deg))
        entries.append(ScanEntry(scan.name, "runout", scan.wheel, scan.file, Path(), turn=turn))
    return entries


def _is_once_more(entry: ScanEntry, value: str, entries: list[ScanEntry]) -> bool:
    """Whether a reference wheel's scan serves as one of its sweep or run-out too."""
    return entry.role in ("sweep", "runout") and any(
        other.role == "reference"
        and other.wheel == entry.wheel
        and posixpath.normpath(other.file) == value
        for other in entries
    )


def _check_names(entries: list[ScanEntry], where: str) -> None:
    for what in ("name", "file"):
        seen: set[object] = set()
        for entry in entries:
            value = getattr(entry, what)
            _check_plain(value, where)
            key: object = value
            if what == "file":
                value = key = posixpath.normpath(value)
                if _is_once_more(entry, value, entries):
                    key = (value, entry.role)
            if key in seen:
                raise InputError(
                    f"{where}: the {what} {value!r} stands twice: give each scan its own"
                )
            seen.add(key)


def _check_inside(folder: Path, files: list[str], where: str) -> None:
    """What an archive names must lie in it, and be no further archive.

    A folder's capture.toml may name files elsewhere: whoever gives a folder can read them anyway.
    """
    for file in files:
        if not (folder / file).resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{where}: {file!r} lies outside the archive: pack the file into it")
        if file.lower().endswith(ARCHIVE_SUFFIXES):
            raise InputError(f"{where}: {file!r} is an archive in an archive: unpack it by hand")


def _check_plain(name: str, where: str) -> None:
    if not name.isprintable():
        raise InputError(f"{where}: the name {name!r} is not plain text: rename it")


def _by_file_names(folder: Path, source: Path) -> _CaptureFile:
    """Without capture.toml: rr.* rl.* fr.* fl.* are the wheels, trial-NAME.* the trials."""
    files = sorted(path.name for path in folder.iterdir() if path.is_file())
    reference = {}
    for wheel in REFERENCE_WHEELS:
        mine = [name for name in files if _stem(name).upper() == wheel]
        if len(mine) != 1:
            found = " and ".join(mine) if mine else "none"
            raise InputError(
                f"{source}: one scan {wheel.lower()}.* is needed, found {found}: "
                "add or remove files, or write a capture.toml"
            )
        reference[wheel] = mine[0]
    trials = [name for name in files if re.match(r"trial-.+\..+", name, re.IGNORECASE)]
    for name in (*reference.values(), *trials):
        _check_plain(name, str(source))  # a name may hold bytes that are no text
    trials.sort(key=lambda name: [int(p) if p.isdecimal() else p for p in re.split(r"(\d+)", name)])
    return _CaptureFile(
        reference=reference,
        trial=tuple(_Trial(name=_stem(name)[len("trial-") :], file=name) for name in trials),
    )


def _stem(file: str) -> str:
    """The name without the format's suffix, and without that of a compression."""
    path = Path(file)
    return Path(path.stem).stem if path.suffix.lower() in COMPRESSED_SUFFIXES else path.stem


def _target(parsed: _CaptureFile, named: str | None, folder: Path, where: str) -> DiscTarget:
    if named is not None:
        return load_target(named)
    told = parsed.target
    if told is None:
        raise InputError(
            f"{where}: no target is named: add --target, for instance --target disc-250"
        )
    if isinstance(told, dict):
        return parse_target(_in_metres(told, parsed.length_unit, where), f"{where}: [target]")
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
    diameter = table.get("diameter")
    if unit == "m" or isinstance(diameter, bool) or not isinstance(diameter, int | float):
        return table
    low, high = TARGET_SIZES_M
    scales = [s for s in (1.0, in_metres(1.0, unit)) if low <= diameter * s <= high]
    if len(scales) != 1:
        raise InputError(
            f"{where}: [target] diameter {diameter} can be meant in m or in {unit}: "
            "use --target with a file of the target, which is in metres"
        )
    return {
        key: value * scales[0]
        if isinstance(value, int | float)
        and not isinstance(value, bool)
        and not key.endswith("_deg")
        else value
        for key, value in table.items()
    }


def _existing(folder: Path, file: str, where: str) -> Path:
    path = folder / file
    if not _is_there(Path(where), path.is_file):
        raise InputError(f"{where}: the scan {file} is missing: add it, or mend its name")
    return path


def _top(folder: Path) -> Path:
    """The archive's own folder, where it holds nothing but one."""
    inside = [p for p in folder.iterdir() if p.name != "__MACOSX" and not p.name.startswith(".")]
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else folder
