"""Declared scans to entries: their files exist, and their names are unique."""

from __future__ import annotations

import math
import posixpath
from collections import Counter
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..files import ARCHIVE_SUFFIXES, lies_in
from ..vehicle import REFERENCE_WHEELS
from .declaration import (
    CaptureFile,
    DeclaredRunout,
    DeclaredSweep,
    DeclaredTrial,
    named_files,
)
from .entry import Role, ScanEntry, Turn
from .file_names import check_plain, only_cloud
from .folder import check_path


def scans_of(
    declared: CaptureFile, folder: Path, where: str, *, packed: bool, within: Path | None = None
) -> tuple[ScanEntry, ...]:
    """Return RR, RL, FR, FL, the trials, the sweeps, the run-outs; or the one cloud of all wheels.

    packed: the folder came out of an archive. within: folder that all files must lie in, for an
    archive its own; without it a capture.toml may name files elsewhere, which its owner can read
    anyway. Raises InputError for duplicate names, and for files that are missing or outside.
    """
    if declared.reference is None:
        cloud = declared.cloud or only_cloud(folder, where)
        entries = [ScanEntry("vehicle", "vehicle", None, cloud, Path())]
    else:
        entries = [
            ScanEntry(wheel, "reference", wheel, declared.reference[wheel], Path())
            for wheel in REFERENCE_WHEELS
        ]
    trials = {trial.name: trial for trial in reversed(declared.trial)}  # the first of a name
    entries += [_of_trial(trial, trials, where) for trial in declared.trial]
    entries += _of_sweeps(declared.sweep, where) + _of_runouts(declared.runout, where)
    _check_rolled(entries, where)
    _check_names(entries, where)
    for file in (*(entry.file for entry in entries), *named_files(declared)):
        check_inside(folder if packed else within, folder / file, file, where)
        if packed:
            _check_unpacked(file, where)
    return tuple(replace(entry, path=_existing(folder, entry.file, where)) for entry in entries)


def _of_trial(trial: DeclaredTrial, trials: dict[str, DeclaredTrial], where: str) -> ScanEntry:
    """Return the entry of a trial; check that what it repeats is itself no repeat."""
    fact = f"{where}: trial {trial.name!r} repeats {trial.repeats!r}"
    of = trial.repeats
    if of is None or of in REFERENCE_WHEELS:
        if of is not None and trial.wheel not in (None, of):
            raise InputError(f"{fact}, but its wheel is {trial.wheel}: leave its wheel out")
        return ScanEntry(trial.name, "trial", of or trial.wheel, trial.file, Path(), of)
    first = trials.get(of)
    if first is None or first is trial or first.repeats is not None:
        raise InputError(f"{fact}: name a reference wheel, or a trial that repeats no other")
    if trial.wheel is not None and trial.wheel != first.wheel:
        raise InputError(f"{fact}, whose wheel is {first.wheel}: leave its wheel out")
    return ScanEntry(trial.name, "trial", first.wheel, trial.file, Path(), of)


def _of_sweeps(sweeps: tuple[DeclaredSweep, ...], where: str) -> list[ScanEntry]:
    """Return the entries of the sweeps: front wheels, each at one position of the steering."""
    entries, seen = [], set()
    for scan in sweeps:
        scan_name = f"{where}: sweep {scan.name!r}"
        if scan.wheel.startswith("R"):
            raise InputError(f"{scan_name} is of {scan.wheel}, which does not steer: name FR or FL")
        if scan.position is not None and (scan.wheel, scan.position) in seen:
            raise InputError(
                f"{scan_name}: {scan.wheel} has another scan at position {scan.position!r}: "
                "give each its own, the same for FR and FL"
            )
        seen.add((scan.wheel, scan.position))
        pose = Turn(position=scan.position)
        entries.append(ScanEntry(scan.name, "sweep", scan.wheel, scan.file, Path(), turn=pose))
    return entries


def _of_runouts(runouts: tuple[DeclaredRunout, ...], where: str) -> list[ScanEntry]:
    """Return the entries of the run-outs, two or more per wheel; of a rolled vehicle, all four."""
    if any(scan.position or scan.wheel is None for scan in runouts):
        return _of_rolled(runouts, where)
    entries = []
    scans = Counter(scan.wheel for scan in runouts)
    for scan in runouts:
        if scans[scan.wheel] < 2:
            raise InputError(
                f"{where}: runout {scan.name!r} is the only one of {scan.wheel}: add a scan with "
                "the wheel rotated about its axle, best by 180 degrees"
            )
        pose = Turn(None, math.radians(scan.angle_deg), math.radians(scan.u_angle_deg))
        entries.append(ScanEntry(scan.name, "runout", scan.wheel, scan.file, Path(), turn=pose))
    return entries


def _of_rolled(runouts: tuple[DeclaredRunout, ...], where: str) -> list[ScanEntry]:
    """Return the entries of a rolled vehicle: at each position its four wheels, or one cloud."""
    entries = []
    positions: dict[str, list[DeclaredRunout]] = {}
    for scan in runouts:
        position = scan.position or (scan.name if scan.wheel is None else "")
        positions.setdefault(position, []).append(scan)
        pose = Turn(position, math.radians(scan.angle_deg), math.radians(scan.u_angle_deg))
        role: Role = "vehicle" if scan.wheel is None else "runout"
        entries.append(ScanEntry(scan.name, role, scan.wheel, scan.file, Path(), turn=pose))
    for position, four in positions.items():
        wheels, angles = [str(scan.wheel) for scan in four], {scan.angle_deg for scan in four}
        if not position or (
            four[0].wheel and (sorted(wheels) != sorted(REFERENCE_WHEELS) or len(angles) > 1)
        ):
            named = f"position {position!r}" if position else "a position that is not named"
            raise InputError(
                f"{where}: runout: {named} has {', '.join(wheels)}: a vehicle that rolled needs "
                f"each of {', '.join(REFERENCE_WHEELS)} once, with the same position and angle_deg"
            )
    return entries


def _check_rolled(entries: list[ScanEntry], where: str) -> None:
    """Check that a capture of a rolled vehicle has neither trials, sweeps nor repeats.

    Its frame is that of mean centres. A trial is seen once, against the centres of one position,
    whose run-out turns what the frame calls ahead by more than u says.
    """
    if not any(e.role == "runout" and e.turn and e.turn.position for e in entries):
        return
    for entry in entries:
        if entry.role in ("sweep", "trial"):
            own = "is of a sweep" if entry.role == "sweep" else "is a trial"
            what = f"repeats {entry.repeats}" if entry.repeats else own
            raise InputError(
                f"{where}: {entry.name!r} {what}, in a capture of a vehicle that rolled, whose "
                "wheels are means over its positions: put it into a capture of its own"
            )


def _check_names(entries: list[ScanEntry], where: str) -> None:
    """Check that names and files are unique; a sweep or run-out may show the reference scan too.

    No trial is called `vehicle`, which names the vehicle's own quantities and doubts.
    """
    if any(entry.role == "trial" and entry.name == "vehicle" for entry in entries):
        raise InputError(
            f"{where}: a trial is called 'vehicle', as the vehicle's own quantities are: give it "
            "another name"
        )
    reference = {e.wheel: posixpath.normpath(e.file) for e in entries if e.role == "reference"}
    for kind in ("name", "file"):
        seen: set[object] = set()
        for entry in entries:
            value = getattr(entry, kind)
            check_plain(value, where)
            key: object = value
            if kind == "file":
                value = key = posixpath.normpath(value)
                if entry.role in ("sweep", "runout") and value == reference.get(entry.wheel):
                    key = (value, entry.role)
            if key in seen:
                raise InputError(
                    f"{where}: the {kind} {value!r} occurs twice: give each scan its own"
                )
            seen.add(key)


def check_inside(archive: Path | None, path: Path, name: str, where: str) -> None:
    """Raise InputError if a path leads out of the archive, itself or by a link.

    name, where: the path and who names it, in the message. archive: None for no limit.
    """
    if archive is not None and not lies_in(path, archive):
        raise InputError(f"{where}: {name!r} lies outside the archive: copy the file into it")


def _check_unpacked(file: str, where: str) -> None:
    if file.lower().endswith(ARCHIVE_SUFFIXES):
        raise InputError(f"{where}: {file!r} is an archive in an archive: unpack it by hand")


def _existing(folder: Path, file: str, where: str) -> Path:
    path = folder / file
    if not check_path(Path(where), path.is_file):
        raise InputError(f"{where}: the scan {file} is missing: add it, or correct its name")
    return path
