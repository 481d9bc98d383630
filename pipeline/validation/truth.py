"""Truth of a synthetic capture (truth.json) as a method without uncertainty."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..centre import TargetFit
from ..errors import InputError, fact_of
from ..vectors import Array
from .comparison import ComparedMethod

ADVICE = "make the capture anew with `wheelplane synth`, or leave out --truth"


def read_truth(path: Path, name: str, names: Sequence[str]) -> ComparedMethod:
    """Read the true angles of `names`, in order. Raises InputError if the file lacks them."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
        wheels = {wheel["name"]: wheel for wheel in tree["wheels"]}
        found = [wheels[wheel] for wheel in names]
        targets = tuple(_target(wheel) for wheel in found)
        angles = [math.radians(_number(w[f"{k}_deg"])) for k in ("toe", "camber") for w in found]
    except FileNotFoundError:
        raise InputError(
            f"{name}: no such file, so there is no truth to compare with: {ADVICE}"
        ) from None
    except (OSError, ArithmeticError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            f"{name}: not a truth file of these wheels ({fact_of(error)}): {ADVICE}"
        ) from error
    return ComparedMethod("truth", targets, np.array(angles))


def _target(wheel: dict[str, Any]) -> TargetFit:
    return TargetFit(
        centre_m=_three(wheel["centre_m"]),
        normal=_three(wheel["normal"]),
        components=(),
        plane_rms_m=0.0,
        points_on_target=0,
        method="points",
    )


def _three(values: list[Any]) -> Array:
    x, y, z = values
    return np.array([_number(x), _number(y), _number(z)])


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a finite number")
    return float(value)
