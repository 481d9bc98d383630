"""Targets as one option names them: of all wheels, and of single ones."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from ..errors import ConfigError
from ..system import frozen
from ..vehicle import REFERENCE_WHEELS
from .registry import Target, load_target

OF_A_WHEEL = re.compile(rf",(?=\w+=)|,\s+(?=(?:{'|'.join(REFERENCE_WHEELS)})=)")  # before its name


@frozen
class TargetChoice:
    """The target of all wheels, None for that of the capture, and those of single wheels."""

    common: Target | None
    of: Mapping[str, Target] = field(default_factory=dict)

    def stated(self) -> dict[str, Any] | None:
        """Return the targets as plain data; of single wheels only where there are any."""
        common = None if self.common is None else self.common.model_dump()
        if not self.of:
            return common
        return {"all": common} | {wheel: one.model_dump() for wheel, one in self.of.items()}


def names_of_targets(text: str) -> tuple[str | None, dict[str, str]]:
    """Split `disc-250`, `disc-250,FR=wheel,FL=wheel` or `FR=wheel`: the common name, the wheels'.

    Raises ConfigError for a wheel that is none, or is named twice.
    """
    common, of = None, {}
    for number, part in enumerate(OF_A_WHEEL.split(text)):
        wheel, equals, name = part.partition("=")
        if not equals or (number == 0 and wheel not in REFERENCE_WHEELS):
            common = part
        elif wheel in REFERENCE_WHEELS and wheel not in of:
            of[wheel] = name
        else:
            fact = "is named twice" if wheel in of else "is no wheel"
            raise ConfigError(
                f"target {text!r}: {wheel} {fact}: give NAME,WHEEL=NAME with each of "
                f"{', '.join(REFERENCE_WHEELS)} once at most"
            )
    return common, of


def read_targets(text: str) -> TargetChoice:
    """Load the targets that such a text names. Raises ConfigError."""
    common, of = names_of_targets(text)
    return TargetChoice(
        None if common is None else load_target(common),
        {wheel: load_target(name) for wheel, name in of.items()},
    )
