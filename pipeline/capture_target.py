"""The target of a capture: as its option names it, or its capture.toml."""

from __future__ import annotations

from pathlib import Path

from pipeline.capture_file import CaptureFile
from pipeline.errors import ConfigError, InputError
from pipeline.targets import Target, load_target, parse_target, scaled, size_of
from pipeline.units import in_metres

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
