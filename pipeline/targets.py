"""The targets that can be measured: shape and sizes of the face, and what is known of the plate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field  # noqa: TID253 - a target is a pydantic model

from pipeline.config import Section, config_file, parse_section, read_toml
from pipeline.errors import ConfigError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """A face in its target's axes: what lies within `radius_m` of the origin, within the half
    widths `half_m` along u and v, and outside the holes, rows (u, v, radius) of (K, 3).
    """

    radius_m: float
    half_m: tuple[float, float]
    holes_m: Array

    def shrunk(self, margin_m: float) -> Region:
        """The region less a margin along all its edges, those of the holes too."""
        holes = self.holes_m + np.array([0.0, 0.0, margin_m])
        half = (self.half_m[0] - margin_m, self.half_m[1] - margin_m)
        return Region(self.radius_m - margin_m, half, holes)

    def holds(self, uv_m: Array) -> npt.NDArray[np.bool_]:
        """Which of uv_m (N, 2) lie in it: (N,)."""
        u, v = uv_m[:, 0], uv_m[:, 1]
        inside = u * u + v * v < self.radius_m**2
        inside &= (np.abs(u) < self.half_m[0]) & (np.abs(v) < self.half_m[1])
        for a, b, radius in self.holes_m:
            inside &= (u - a) ** 2 + (v - b) ** 2 > radius**2
        return np.asarray(inside)


NO_HOLES = np.zeros((0, 3))
ANY_WIDTH = (math.inf, math.inf)


class DiscTarget(Section):
    """A flat disc: `diameter` in metres, and its `thickness` where known.

    flatness: the face lies between two planes that far apart, metres. clamp_tilt_deg, clamp_shift:
    standard deviations per axis of taking it off and putting it on again, degrees and metres.
    """

    shape: Literal["disc"]
    diameter: float = Field(gt=0.01, lt=3.0)
    thickness: float | None = Field(None, ge=0.0, lt=0.2)
    flatness: float = Field(0.0, ge=0.0, lt=0.01)
    clamp_tilt_deg: float = Field(0.0, ge=0.0, lt=5.0)
    clamp_shift: float = Field(0.0, ge=0.0, lt=0.05)

    @property
    def radius_m(self) -> float:
        """Of the smallest circle about the face, metres."""
        return self.diameter / 2.0

    @property
    def region(self) -> Region:
        """The face."""
        return Region(self.radius_m, ANY_WIDTH, NO_HOLES)

    @property
    def turn_period_rad(self) -> float:
        """The turn about its centre that leaves the face as it is; 0 where every turn does."""
        return 0.0


def load_target(name: str) -> DiscTarget:
    """Target by name (`disc-250`) or TOML file."""
    path = config_file("targets", name)
    return parse_target(read_toml(path), name)


def parse_target(table: dict[str, object], where: str) -> DiscTarget:
    """Target from a table with `shape` and its sizes in metres; `where` names it in errors."""
    shape = table.get("shape")
    if shape != "disc":
        raise ConfigError(f"{where}: target shape {shape!r} is not known: known is 'disc'")
    return parse_section(DiscTarget, table, where)
