"""Tolerance of a capture: the file that is named, or that of its vehicle model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...config import config_file, config_folder, parse_section, read_toml
from ...errors import ConfigError, InputError

if TYPE_CHECKING:
    from .model import Tolerance

BY_MODEL = "auto"  # stands for the shipped file of the capture's vehicle model


def load_tolerance(name: str) -> Tolerance:
    """Load a tolerance by name (`example`) or TOML file. Raises ConfigError."""
    return tolerance_of(read_toml(config_file("tolerances", name)), name)


def tolerance_of(tree: dict[str, Any], name: str) -> Tolerance:
    """Return the tolerance of a parsed file, or of a stored result. Raises ConfigError."""
    from .model import Tolerance  # the model's classes take a while to make

    return parse_section(Tolerance, tree, name)


def tolerance_for(name: str, vehicle_model: str | None, source: str) -> Tolerance:
    """Load the tolerance for a capture: by name or file, or that of its vehicle model.

    name: of a tolerance, or a TOML file; BY_MODEL or a folder: the file there that has the
    capture's vehicle_model. source: name of the capture in messages.
    Raises ConfigError or InputError where there is none, or it is another model's.
    """
    shipped = config_folder() / "tolerances"
    if name == BY_MODEL:
        return _by_model(shipped, "configs/tolerances", vehicle_model, source)
    if name and Path(name).is_dir() and not (shipped / f"{name}.toml").is_file():
        return _by_model(Path(name), name, vehicle_model, source)
    found = load_tolerance(name)
    if vehicle_model and found.vehicle_model and not _alike(found.vehicle_model, vehicle_model):
        raise InputError(
            f"{name}: its limits are those of vehicle model {found.vehicle_model!r}, but {source} "
            f"is of model {vehicle_model!r}: name other limits, or correct vehicle_model"
        )
    return found


def _by_model(folder: Path, where: str, vehicle_model: str | None, source: str) -> Tolerance:
    if vehicle_model is None:
        raise InputError(
            f"{source}: it names no vehicle_model, by which the limits are found in {where}: add "
            "it to capture.toml, or give --tolerance a file"
        )
    known = {path.name: load_tolerance(str(path)) for path in sorted(folder.glob("*.toml"))}
    models = {file: found.vehicle_model for file, found in known.items() if found.vehicle_model}
    fitting = [file for file, model in models.items() if _alike(model, vehicle_model)]
    if len(fitting) > 1:
        raise ConfigError(
            f"{where}: {fitting[0]} and {fitting[1]} both have the limits of vehicle model "
            f"{vehicle_model!r}: keep one"
        )
    if not fitting:
        there = ", ".join(sorted(map(repr, models.values()))) or "no model"
        raise ConfigError(
            f"{where}: it has the limits of {there}, but {source} is of vehicle model "
            f"{vehicle_model!r}: correct it, or add a file with vehicle_model = {vehicle_model!r}"
        )
    return known[fitting[0]]


def _alike(one: str, other: str) -> bool:
    """Return whether two models are the same but for capitals and spaces."""
    return one.casefold().split() == other.casefold().split()
