"""Dark part of a plain face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..parameters.parameters import Surfaces
from ..parameters.plate_file import TargetFile
from .pattern import Pattern, pattern_on


@dataclass(frozen=True)
class Shade:
    """A face of albedo `light`, part of which is dark as `surfaces` states."""

    light: float
    surfaces: Surfaces

    def reflectance(self, uv_m: Array) -> Array:
        """Return the albedo (N,) at points (N, 2) of the face."""
        turn = np.radians(self.surfaces.dark_turn_deg)
        along = uv_m @ [np.cos(turn), np.sin(turn)]
        dark = along > 0.0
        if self.surfaces.dark_part == "squares":
            across = uv_m @ [-np.sin(turn), np.cos(turn)]
            squares = np.floor(np.stack([along, across]) / self.surfaces.dark_pitch_m)
            dark = squares.sum(axis=0) % 2 == 0
        return np.where(dark, self.surfaces.dark, self.light)


def print_on(
    target: TargetFile, wheel: str, shift_m: tuple[float, float], light: float, surfaces: Surfaces
) -> Pattern | Shade | None:
    """Return what a face of albedo `light` bears: its print, its dark part, or nothing."""
    pattern = pattern_on(target, wheel, shift_m)
    if surfaces.dark_part == "none":
        return pattern
    if pattern is not None:
        raise SynthError(
            f"surfaces.dark_part '{surfaces.dark_part}': the target has a print of its own; "
            "name a plain target, or leave dark_part out"
        )
    return Shade(light, surfaces)
