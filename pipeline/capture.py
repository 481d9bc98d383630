"""What was scanned: a folder, zip or tar with one scan a wheel, and which shows which."""

from __future__ import annotations

import lzma
import posixpath
import re
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from pydantic import Field  # noqa: TID253 - capture.toml is a pydantic model

from pipeline.config import (
    DiscTarget,
    Section,
    load_target,
    parse_section,
    parse_target,
    read_toml,
)
from pipeline.errors import ConfigError, InputError
from pipeline.reference_frame import REFERENCE_WHEELS

UNIT_M = {"m": 1.0, "mm": 1e-3, "in": 0.0254}
TARGET_SIZES_M = (0.03, 1.5)  # no wheel target is smaller or larger
MAX_UNPACKED_BYTES = 64 * 2**30
TAR_BLOCK = 512
# What zipfile and tarfile raise, with their decompressors, for damaged and for locked archives.
ARCHIVE_FAULTS = (
    zipfile.BadZipFile,
    tarfile.TarError,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    lzma.LZMAError,
    zlib.error,
)

Role = Literal["reference", "trial"]


@dataclass(frozen=True)
class ScanEntry:
    """One scan: its name in the result, its role, its wheel where named, its file."""

    name: str
    role: Role
    wheel: str | None
    file: str
    path: Path


@dataclass(frozen=True)
class Capture:
    """A capture, ready to be read: entries are RR, RL, FR, FL, then the trials."""

    source: str
    vehicle: str | None
    length_unit: str
    target: DiscTarget
    entries: tuple[ScanEntry, ...]


class _Trial(Section):
    name: str = Field(min_length=1)
    file: str = Field(min_length=1)
    wheel: Literal["RR", "RL", "FR", "FL"] | None = None


class _CaptureFile(Section):
    vehicle: str | None = None
    length_unit: Literal["m", "mm", "in"] = "m"
    target: object = None
    reference: dict[str, str]
    trial: tuple[_Trial, ...] = Field((), strict=False)


@contextmanager
def open_capture(source: Path, target: str | None = None) -> Iterator[Capture]:
    """Open the capture at `source`; `target` names the target and goes before the capture's own.

    An archive is unpacked into a temporary folder, which goes with the context.
    Raises InputError or ConfigError for what is missing or contradicts itself.
    """
    if _is_there(source, source.is_dir):
        yield _read_folder(source, source, target)
    elif not source.exists():
        raise InputError(f"{source}: no such file or folder: check the path")
    elif not source.is_file():
        raise InputError(f"{source}: not a regular file: copy the capture to a folder or a file")
    elif _is_archive(source):
        with tempfile.TemporaryDirectory(prefix="wheelplane-") as folder:
            _unpack(source, Path(folder))
            yield _read_folder(_top(Path(folder)), source, target)
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


def _is_archive(source: Path) -> bool:
    try:
        return zipfile.is_zipfile(source) or tarfile.is_tarfile(source)
    except ARCHIVE_FAULTS as error:
        raise _damaged(source, error) from error


def _read_folder(folder: Path, source: Path, target: str | None) -> Capture:
    declared = next((p for p in folder.iterdir() if p.name.lower() == "capture.toml"), None)
    if declared is not None:
        where = f"{source}: capture.toml"
        try:
            table = read_toml(declared)
        except ConfigError as error:
            raise ConfigError(f"{where}: {str(error).removeprefix(f'{declared}: ')}") from error
        parsed = parse_section(_CaptureFile, table, where)
        _check_reference(parsed.reference, where)
    else:
        parsed = _by_file_names(folder, source)
        where = str(source)
    entries = [ScanEntry(w, "reference", w, parsed.reference[w], Path()) for w in REFERENCE_WHEELS]
    entries += [ScanEntry(t.name, "trial", t.wheel, t.file, Path()) for t in parsed.trial]
    _check_names(entries, where)
    return Capture(
        source=str(source),
        vehicle=parsed.vehicle,
        length_unit=parsed.length_unit,
        target=_target(parsed, target, folder, where),
        entries=tuple(
            ScanEntry(e.name, e.role, e.wheel, e.file, _existing(folder, e.file, where))
            for e in entries
        ),
    )


def _check_reference(reference: dict[str, str], where: str) -> None:
    for wheel in REFERENCE_WHEELS:
        if wheel not in reference:
            raise InputError(f"{where}: [reference] lacks {wheel}: name the scan of that wheel")
    extra = sorted(set(reference) - set(REFERENCE_WHEELS))
    if extra:
        raise InputError(
            f"{where}: [reference] names {extra[0]!r}: its wheels are {', '.join(REFERENCE_WHEELS)}"
        )


def _check_names(entries: list[ScanEntry], where: str) -> None:
    for what in ("name", "file"):
        seen: set[str] = set()
        for entry in entries:
            value = getattr(entry, what)
            _check_plain(value, where)
            if what == "file":
                value = posixpath.normpath(value)
            if value in seen:
                raise InputError(
                    f"{where}: the {what} {value!r} stands twice: give each scan its own"
                )
            seen.add(value)


def _check_plain(name: str, where: str) -> None:
    if not name.isprintable():
        raise InputError(f"{where}: the name {name!r} is not plain text: rename it")


def _by_file_names(folder: Path, source: Path) -> _CaptureFile:
    """Without capture.toml: rr.* rl.* fr.* fl.* are the wheels, trial-NAME.* the trials."""
    files = sorted(path.name for path in folder.iterdir() if path.is_file())
    reference = {}
    for wheel in REFERENCE_WHEELS:
        mine = [name for name in files if Path(name).stem.upper() == wheel]
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
        trial=tuple(_Trial(name=Path(name).stem[len("trial-") :], file=name) for name in trials),
    )


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
    scales = [s for s in (1.0, UNIT_M[unit]) if low <= diameter * s <= high]
    if len(scales) != 1:
        raise InputError(
            f"{where}: [target] diameter {diameter} can be meant in m or in {unit}: "
            "use --target with a file of the target, which is in metres"
        )
    return {
        key: value * scales[0]
        if isinstance(value, int | float) and not isinstance(value, bool)
        else value
        for key, value in table.items()
    }


def _existing(folder: Path, file: str, where: str) -> Path:
    path = folder / file
    if not _is_there(Path(where), path.is_file):
        raise InputError(f"{where}: the scan {file} is missing: add it, or mend its name")
    return path


def _unpack(source: Path, folder: Path) -> None:
    """Unpack files and folders only, and nothing that leaves `folder`."""
    try:
        if zipfile.is_zipfile(source):
            with zipfile.ZipFile(source) as archive:
                if any(member.flag_bits & 1 for member in archive.infolist()):
                    raise InputError(f"{source}: is locked with a password: unpack it by hand")
                names = [member.filename for member in archive.infolist()]
                _check_members(source, names, sum(m.file_size for m in archive.infolist()))
                archive.extractall(folder)  # noqa: S202 - members were checked
        else:
            with tarfile.open(source) as tar:
                members = [member for member in tar.getmembers() if member.isfile()]
                _check_end(tar)
                _check_members(source, [m.name for m in members], sum(m.size for m in members))
                tar.extractall(folder, members, filter="data")
    except ARCHIVE_FAULTS as error:
        raise _damaged(source, error) from error


def _damaged(source: Path, error: Exception) -> InputError:
    return InputError(f"{source}: the archive cannot be unpacked ({error}): pack or copy it anew")


def _check_end(tar: tarfile.TarFile) -> None:
    """Refuse what tarfile takes for the end, unless zeros stand there: a damaged header."""
    assert tar.fileobj is not None
    tar.fileobj.seek(tar.offset)
    if tar.fileobj.read(TAR_BLOCK) != bytes(TAR_BLOCK):
        raise tarfile.ReadError("it breaks off, or the header of a member is damaged")


def _check_members(source: Path, names: list[str], size: int) -> None:
    for name in names:
        path = PurePosixPath(name.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts:
            raise InputError(f"{source}: its member {name!r} points outside: pack it anew")
    if size > MAX_UNPACKED_BYTES:
        raise InputError(
            f"{source}: unpacks to {size / 2**30:.0f} GiB, {MAX_UNPACKED_BYTES >> 30} at most: "
            "unpack it by hand"
        )


def _top(folder: Path) -> Path:
    """The archive's own folder, where it holds nothing but one."""
    inside = [p for p in folder.iterdir() if p.name != "__MACOSX" and not p.name.startswith(".")]
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else folder
