"""Targets of a capture: the common one, and those of single scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import ConfigError, InputError
from ..targets import (
    Target,
    TargetChoice,
    load_target,
    parse_target,
    read_targets,
    scaled,
    size_of,
)
from ..units import in_metres
from ..vehicle import REFERENCE_WHEELS
from .declaration import CaptureFile
from .entry import ScanEntry

TABLES = (".txt", ".csv")  # which may hold the points of a cloud, or five points a plane
TARGET_SIZES_M = (0.03, 1.5)  # no wheel target is smaller or larger


def targets_of(
    declared: CaptureFile,
    named: str | Target | TargetChoice | None,
    scans: Sequence[ScanEntry],
    folder: Path,
    where: str,
) -> tuple[Target, dict[str, Target]]:
    """Return the common target, and by the names of scans, or of a cloud's wheels, the others.

    named: replaces the common one and all others; where it names single wheels only, theirs. A
    wheel's own target is that of its trials, sweeps and run-outs too, unless they have their own.
    Raises ConfigError or InputError.
    """
    choice = read_targets(named) if isinstance(named, str) else named
    if not isinstance(choice, TargetChoice):
        choice = TargetChoice(choice)
    common, own = choice.common, dict(choice.of)
    if common is None:
        tables = declared.targets
        _check_names(tables, scans, f"{where}: [targets]")
        of_file = {
            name: _declared(table, f"{where}: [targets] {name}", folder, declared.length_unit)
            for name, table in tables.items()
        }
        own = of_file | own
        if declared.target is not None:
            common = _declared(declared.target, f"{where}: [target]", folder, declared.length_unit)
    return _resolved(common, own, scans, where)


def _resolved(
    common: Target | None, own: Mapping[str, Target], scans: Sequence[ScanEntry], where: str
) -> tuple[Target, dict[str, Target]]:
    found = {}
    for name, *keys in _names(scans):
        key = next((key for key in (name, *keys) if key is not None and key in own), None)
        if key is not None:
            found[name] = own[key]
        elif common is None:
            of_scan = f" for {name}" if own else ""
            points = "; a file of five points a plane is read by `wheelplane five-point`"
            raise InputError(
                f"{where}: no target is named{of_scan}: add --target, for example --target disc-250"
                f"{points if where.lower().endswith(TABLES) else ''}"
            )
    return common or found[REFERENCE_WHEELS[0]], found


def _names(scans: Sequence[ScanEntry]) -> list[tuple[str, str | None, str | None]]:
    """Return the names by which each scan's target is looked up; in a cloud, that of each wheel."""
    if any(scan.role == "vehicle" for scan in scans):
        return [(wheel, None, None) for wheel in REFERENCE_WHEELS]
    return [(scan.name, scan.repeats, scan.wheel) for scan in scans]


def _check_names(own: Mapping[str, object], scans: Sequence[ScanEntry], where: str) -> None:
    names = [name for name, *_ in _names(scans)]
    for name in own:
        if name not in names:
            raise InputError(
                f"{where} {name}: there is no such scan: name one of {', '.join(names)}"
            )


def _declared(own: object, where: str, folder: Path, unit: str) -> Target:
    """Return the target that a capture declares: a name, a file beside it, or a table."""
    if isinstance(own, dict):
        return parse_target(_in_metres(own, unit, where), where)
    of_file = where.removesuffix(": [target]")
    if not isinstance(own, str):
        raise ConfigError(f"{of_file}: target is {own!r}: name one, or write a table [target]")
    try:
        return load_target(str(folder / own) if own.endswith(".toml") else own)
    except ConfigError as error:
        raise ConfigError(f"{of_file}: {str(error).removeprefix(f'{folder}/')}") from error


def _in_metres(table: dict[str, object], unit: str, where: str) -> dict[str, object]:
    """Convert the sizes of a target's table to metres, from metres or the capture's unit.

    Only one of the two gives a size that a target can have: in a capture in mm, 0.25 is 0.25 m and
    250 is 250 mm.
    """
    known = size_of(table)
    if unit == "m" or known is None:
        return table
    key, size = known
    low, high = TARGET_SIZES_M
    scales = [s for s in (1.0, in_metres(1.0, unit)) if low <= size * s <= high]
    if len(scales) != 1:
        raise InputError(
            f"{where} {key} {size:g} may be in m or in {unit}: "
            "give --target with a file of the target, which is in metres"
        )
    return scaled(table, scales[0])
