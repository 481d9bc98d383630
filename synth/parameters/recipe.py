"""Recipe: a parameter file, whose numbers may be ranges, and random draws from it."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import SynthError
from .parameters import Section

Tree = dict[str, Any]
SectionT = TypeVar("SectionT", bound=Section)


@dataclass(frozen=True)
class Recipe:
    """A parameter file that is valid at both ends of every range."""

    source: str
    tree: Tree

    def draw(self, table: str, model: type[SectionT], rng: np.random.Generator) -> SectionT:
        """Draw one table: every range [low, high] becomes a uniform draw, in the model's order.

        A key that the file leaves out keeps its default without a draw. A range of an integer key
        draws integers.
        """
        values = self.tree.get(table, {})
        drawn = {}
        for key, field in model.model_fields.items():
            if key not in values:
                continue
            value = values[key]
            if _is_range(value):
                whole = field.annotation is int
                value = (
                    int(rng.integers(value[0], value[1], endpoint=True))
                    if whole
                    else float(rng.uniform(value[0], value[1]))
                )
            drawn[key] = value
        return model(**drawn)


def read_recipe(path: Path, model: type[Section]) -> Recipe:
    """Read and check a file: every wrong key or value is named in one SynthError."""
    tree = {key: value for key, value in _parse(path).items() if key not in model.unread}
    problems = _inverted(tree, "")
    for end in (0, 1):
        problems += _mistakes(_at_end(tree, end), model)
    _refuse(path, problems)
    return Recipe(str(path), tree)


def read_one_of(path: Path, key: str, models: Mapping[str, type[SectionT]]) -> SectionT:
    """Read and check a file without ranges, by the model that its `key` names."""
    tree = _parse(path)
    name = tree.get(key)
    if not isinstance(name, str) or name not in models:
        fact = f"'{key}' = {_one_line(repr(name))}" if key in tree else f"key '{key}' is missing"
        raise SynthError(f"{path}: {fact}; known are {', '.join(models)}; correct the file")
    _refuse(path, _mistakes(tree, models[name]))
    return models[name](**tree)


def _parse(path: Path) -> Tree:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SynthError(f"{path}: {error.strerror}; name a readable parameter file") from error
    except UnicodeDecodeError as error:
        raise SynthError(f"{path}: not UTF-8 text; name a TOML parameter file") from error
    except tomllib.TOMLDecodeError as error:
        raise SynthError(f"{path}: not valid TOML, {_one_line(str(error))}; correct it") from error


def _refuse(path: Path, problems: list[str]) -> None:
    if problems:
        raise SynthError(f"{path}: {'; '.join(dict.fromkeys(problems))}; correct the file")


def _mistakes(tree: Tree, model: type[Section]) -> list[str]:
    from pydantic import ValidationError

    try:
        model.model_validate(tree)
    except ValidationError as failure:
        return [
            _message(error["type"], error["loc"], error["msg"], error["input"], model)
            for error in failure.errors(include_url=False)
        ]
    return []


def _message(kind: str, where: tuple[int | str, ...], text: str, given: Any, model: Any) -> str:
    key = _one_line(".".join(map(str, where)))
    if kind == "missing":
        return f"key '{key}' is missing"
    if kind == "extra_forbidden":
        known = _known_keys(model)
        near = _nearest(key, known)
        return f"unknown key '{key}' (nearest: '{near}')"
    if kind == "value_error":
        return f"{key}: ".lstrip(": ") + _one_line(text).removeprefix("Value error, ")
    return f"'{key}' = {_one_line(repr(given))}: {_one_line(text)}"


def _nearest(key: str, known: list[str]) -> str:
    """Return the most similar known key, of the same table if there is one."""
    table, dot, _ = key.rpartition(".")
    near = difflib.get_close_matches(key, [k for k in known if k.startswith(table + dot)], 1, 0.0)
    return (near or difflib.get_close_matches(key, known, 1, 0.0))[0]


def _known_keys(model: type[Section], prefix: str = "") -> list[str]:
    keys = []
    for name, field in model.model_fields.items():
        keys.append(prefix + name)
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, Section):
            keys += _known_keys(inner, f"{prefix}{name}.")
    return keys


def _is_range(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(end, int | float) and not isinstance(end, bool) for end in value)
    )


def _at_end(value: Any, end: int) -> Any:
    if isinstance(value, dict):
        return {key: _at_end(inner, end) for key, inner in value.items()}
    return value[end] if _is_range(value) else value


def _inverted(value: Any, key: str) -> list[str]:
    if isinstance(value, dict):
        return [p for name, v in value.items() for p in _inverted(v, f"{key}.{name}".lstrip("."))]
    if _is_range(value) and value[0] > value[1]:
        return [f"'{key}' = {value}: low is above high"]
    return []


def _one_line(text: str) -> str:
    return " ".join(text.split())[:200]
