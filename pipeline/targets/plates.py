"""Plates that are known by their outline: disc, ring, rectangle, square with four holes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator  # noqa: TID253 - a target is a pydantic model

from ..config import Section
from ..vectors import Array, Mask

NO_HOLES = np.zeros((0, 3))
ANY_WIDTH = (math.inf, math.inf)
WEB_M = 0.01  # of plate, at least, between a hole and any other edge


@dataclass(frozen=True)
class Region:
    """A face in its target's axes: what lies within `radius_m` of the origin, within the half
    widths `half_m` along u and v, and outside the holes, rows (u, v, radius) of (K, 3).
    """

    radius_m: float
    half_m: tuple[float, float]
    holes_m: Array

    @property
    def area_m2(self) -> float:
        """Of the face."""
        whole = math.pi * self.radius_m**2
        if self.half_m != ANY_WIDTH:
            whole = 4.0 * self.half_m[0] * self.half_m[1]
        return whole - math.pi * float(np.sum(self.holes_m[:, 2] ** 2))

    def shrunk(self, margin_m: float) -> Region:
        """The region less a margin along all its edges, those of the holes too."""
        holes = self.holes_m + np.array([0.0, 0.0, margin_m])
        half = (self.half_m[0] - margin_m, self.half_m[1] - margin_m)
        return Region(self.radius_m - margin_m, half, holes)

    def holds(self, uv_m: Array) -> Mask:
        """Which of uv_m (N, 2) lie in it: (N,)."""
        u, v = uv_m[:, 0], uv_m[:, 1]
        inside = u * u + v * v < self.radius_m**2
        inside &= (np.abs(u) < self.half_m[0]) & (np.abs(v) < self.half_m[1])
        for a, b, radius in self.holes_m:
            inside &= (u - a) ** 2 + (v - b) ** 2 > radius**2
        return np.asarray(inside)


class Plate(Section):
    """What is known of every plate, metres: its `thickness`, where it is told.

    flatness: the face lies between two planes that far apart, metres. clamp_tilt_deg, clamp_shift:
    standard deviations per axis of taking it off and putting it on again, degrees and metres.
    """

    thickness: float | None = Field(None, ge=0.0, lt=0.2)
    flatness: float = Field(0.0, ge=0.0, lt=0.01)
    clamp_tilt_deg: float = Field(0.0, ge=0.0, lt=5.0)
    clamp_shift: float = Field(0.0, ge=0.0, lt=0.05)

    lengths: ClassVar[tuple[str, ...]] = ("thickness", "flatness", "clamp_shift")
    size: ClassVar[tuple[str, ...]] = ()  # the lengths by which the unit of all is judged

    @property
    def region(self) -> Region:
        """The face."""
        raise NotImplementedError

    @property
    def radius_m(self) -> float:
        """Of the smallest circle about the face, metres."""
        return self.region.radius_m

    @property
    def turn_period_rad(self) -> float:
        """The turn about its centre that leaves the face as it is; 0 where every turn does."""
        half = self.region.half_m
        if half == ANY_WIDTH:
            return 0.0
        return math.pi / 2.0 if half[0] == half[1] else math.pi

    @property
    def words(self) -> str:
        """Shape and size as messages tell them."""
        raise NotImplementedError


class DiscTarget(Plate):
    """A flat disc."""

    shape: Literal["disc"]
    diameter: float = Field(gt=0.01, lt=3.0)

    lengths = (*Plate.lengths, "diameter")
    size = ("diameter",)

    @property
    def region(self) -> Region:
        """The face."""
        return Region(self.diameter / 2.0, ANY_WIDTH, NO_HOLES)

    @property
    def words(self) -> str:
        """Shape and size as messages tell them."""
        return f"a disc of {self.diameter * 1e3:.0f} mm"


class RingTarget(Plate):
    """A flat disc with a round hole in its middle, for the wheel's hub."""

    shape: Literal["ring"]
    diameter: float = Field(gt=0.01, lt=3.0)
    hole_diameter: float = Field(gt=0.005, lt=3.0)

    lengths = (*Plate.lengths, "diameter", "hole_diameter")
    size = ("diameter",)

    @model_validator(mode="after")
    def _hole_fits(self) -> RingTarget:
        if self.hole_diameter > self.diameter - 2.0 * WEB_M:
            raise ValueError(
                f"hole_diameter {self.hole_diameter} leaves less than {WEB_M} of plate about it in "
                f"a diameter of {self.diameter}: mend one of them"
            )
        return self

    @property
    def region(self) -> Region:
        """The face."""
        hole = np.array([[0.0, 0.0, self.hole_diameter / 2.0]])
        return Region(self.diameter / 2.0, ANY_WIDTH, hole)

    @property
    def words(self) -> str:
        """Shape and size as messages tell them."""
        return f"a ring of {self.diameter * 1e3:.0f} mm"


class RectangleTarget(Plate):
    """A flat rectangle: `width` along the axis u, `height` along v."""

    shape: Literal["rectangle"]
    width: float = Field(gt=0.01, lt=3.0)
    height: float = Field(gt=0.01, lt=3.0)

    lengths = (*Plate.lengths, "width", "height")
    size = ("width", "height")

    @property
    def region(self) -> Region:
        """The face."""
        return rectangle(self.width, self.height)

    @property
    def words(self) -> str:
        """Shape and size as messages tell them."""
        return f"a rectangle of {self.width * 1e3:.0f} x {self.height * 1e3:.0f} mm"


class SquareTarget(Plate):
    """A flat square with four round holes, at the corners of a centred square: hole_spacing."""

    shape: Literal["square"]
    side: float = Field(gt=0.01, lt=3.0)
    hole_diameter: float = Field(gt=0.005, lt=3.0)
    hole_spacing: float = Field(gt=0.0, lt=3.0)

    lengths = (*Plate.lengths, "side", "hole_diameter", "hole_spacing")
    size = ("side",)

    @model_validator(mode="after")
    def _holes_fit(self) -> SquareTarget:
        taken = f"hole_spacing {self.hole_spacing} and hole_diameter {self.hole_diameter}"
        if self.hole_spacing + self.hole_diameter > self.side - 2.0 * WEB_M:
            raise ValueError(
                f"{taken} leave less than {WEB_M} of plate to the edge of a side of {self.side}: "
                "mend one of them"
            )
        if self.hole_spacing < self.hole_diameter + WEB_M:
            raise ValueError(f"{taken} leave less than {WEB_M} between the holes: mend one of them")
        return self

    @property
    def region(self) -> Region:
        """The face."""
        a, radius = self.hole_spacing / 2.0, self.hole_diameter / 2.0
        holes = np.array([[u, v, radius] for u in (-a, a) for v in (-a, a)])
        return rectangle(self.side, self.side, holes)

    @property
    def words(self) -> str:
        """Shape and size as messages tell them."""
        return f"a square of {self.side * 1e3:.0f} mm"


def rectangle(width: float, height: float, holes_m: Array = NO_HOLES) -> Region:
    """A rectangular face."""
    half = (width / 2.0, height / 2.0)
    return Region(math.hypot(*half), half, holes_m)
