"""Targets that can be measured: by name, by file, or by a capture's own table."""

from __future__ import annotations

import difflib

from ..config import config_file, parse_section, read_toml
from ..errors import ConfigError
from .pattern_board import PatternTarget as PatternTarget
from .plates import DiscTarget as DiscTarget
from .plates import Plate
from .plates import RectangleTarget as RectangleTarget
from .plates import RingTarget as RingTarget
from .plates import SquareTarget as SquareTarget
from .plates import WheelTarget as WheelTarget

Target = Plate
SHAPES: dict[str, type[Target]] = {
    "disc": DiscTarget,
    "ring": RingTarget,
    "rectangle": RectangleTarget,
    "square": SquareTarget,
    "pattern": PatternTarget,
    "wheel": WheelTarget,
}


def load_target(name: str) -> Target:
    """Load a target by name (`disc-250`) or TOML file."""
    path = config_file("targets", name)
    return parse_target(read_toml(path), name)


def parse_target(table: dict[str, object], where: str) -> Target:
    """Return the target of a table with `shape` and sizes in metres; `where` names it in errors."""
    return parse_section(_model(table, where), table, where)


def _model(table: dict[str, object], where: str) -> type[Target]:
    shape = table.get("shape")
    if isinstance(shape, str) and shape in SHAPES:
        return SHAPES[shape]
    known = ", ".join(SHAPES)
    if shape is None:
        raise ConfigError(f"{where}: 'shape' is missing: add it; known are {known}")
    near = difflib.get_close_matches(str(shape), SHAPES, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ConfigError(f"{where}: target shape {shape!r} is not known: {hint}known are {known}")


def size_of(table: dict[str, object]) -> tuple[str, float] | None:
    """Return name and value of the length from which the unit of a target's table is inferred.

    It is the first of its shape's sizes that is a number; None if there is none.
    """
    model = SHAPES.get(str(table.get("shape")))
    for key in model.size if model else ():
        value = table.get(key)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return key, float(value)
    return None


def scaled(table: dict[str, object], scale: float) -> dict[str, object]:
    """Return a target's table with all lengths times `scale`; other values stay as they are."""
    model = SHAPES.get(str(table.get("shape")))
    lengths = model.lengths if model else ()
    return {k: _scaled(value, scale) if k in lengths else value for k, value in table.items()}


def _scaled(value: object, scale: float) -> object:
    if isinstance(value, list):
        return [_scaled(part, scale) for part in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return value * scale
