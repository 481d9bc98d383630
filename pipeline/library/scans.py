"""Clouds as the library's users hold them: files, arrays, or clouds of other libraries."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from ..config import Config, load_config, with_scanner
from ..errors import InputError
from ..readers import Scan, read_scan, scan_of_points
from ..targets import Target, TargetChoice, load_target, parse_target, read_targets
from ..units import LengthUnit

TargetName = str | Mapping[str, object] | Target
Settings = Config | str | Path | None


def as_scan(points: object, length_unit: LengthUnit, name: str) -> Scan:
    """Read a file, or copy points to metres. Raises InputError, one line."""
    check_one_of(length_unit, LengthUnit, "length_unit")
    if isinstance(points, Scan):
        return points
    if is_path(points):
        return read_scan(Path(os.fspath(points)), length_unit)  # type: ignore[call-overload]
    return scan_of_points(points, length_unit, name)


def check_one_of(value: object, names: object, what: str) -> None:
    """Raise InputError unless a value is one of the names of a Literal."""
    known = get_args(names)
    if value not in known:
        raise InputError(f"{what} {value!r} is unknown: give {', '.join(known)}")


def is_path(points: object) -> bool:
    """Return whether it names a file."""
    return isinstance(points, (str, os.PathLike))


def as_target(target: TargetName) -> Target:
    """Return the target by its name, the path of its file, or its table in metres."""
    if isinstance(target, str):
        return load_target(target)
    if isinstance(target, Mapping):
        return parse_target(dict(target), "target")
    if not isinstance(target, Target):
        raise InputError(f"target {target!r} is no target: give its name, its file or its table")
    return target


def as_targets(target: TargetName) -> TargetChoice:
    """Return the target of all scans and those of single wheels, as `--target` names them."""
    return read_targets(target) if isinstance(target, str) else TargetChoice(as_target(target))


def as_config(config: Settings, scanner: str | None) -> Config:
    """Return the settings, read from their file, with the scanner's."""
    if not (config is None or isinstance(config, Config) or is_path(config)):
        kind = type(config).__name__
        raise InputError(f"a {kind} is no configuration: give a Config, or the path of its file")
    if not (scanner is None or isinstance(scanner, str)):
        raise InputError(f"scanner {scanner!r} is no scanner: give its name, or its file as text")
    if not isinstance(config, Config):
        config = load_config(None if config is None else Path(config))
    return with_scanner(config, scanner)
