"""Check that the angles and lengths that a measurement.json states are those of its poses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from ...measurement import Measurement
from ..format.earlier import counted_otherwise
from .measurement import to_tree

WHEEL = ("toe", "camber", "camber_iso")
STEERING_AXIS = ("caster", "inclination")
RELATIVE, DEG_OR_M = 1e-5, 1e-6  # of rounding


def check_stated_values(tree: Mapping[str, Any], found: Measurement) -> None:
    """Raise ValueError where the file states another value than its poses give.

    tree: of the file. found: the measurement by its poses. What the file lacks is not compared, nor
    are uncertainties and what its version counted otherwise.
    """
    stated = dict(_values(tree))
    for name in counted_otherwise(tree):
        stated.pop(f"uncertainty of {name}: value", None)
    for name, value in _values(to_tree(found)):
        other = stated.get(name)
        if value is None or other is None:
            continue
        if not math.isclose(value, other, rel_tol=RELATIVE, abs_tol=DEG_OR_M):
            raise ValueError(f"{name} is {other:.6g}, but {value:.6g} by its poses")


def _values(tree: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values by name, in degrees and metres; None where unmeasured."""
    for wheel in tree["wheels"]:
        for kind in WHEEL:
            yield f"{wheel['name']}: {kind}_deg", wheel.get(f"{kind}_deg")
    for key, value in tree["vehicle"].items():
        if not isinstance(value, str):
            yield f"vehicle: {key}", value
    for entry in tree["uncertainty"]:
        yield f"uncertainty of {entry['quantity']}: value", entry.get("value")
    for axis in tree["steering"]["kingpins"]:
        for kind in STEERING_AXIS:
            yield f"steering axis of {axis['wheel']}: {kind}_deg", axis.get(f"{kind}_deg")
