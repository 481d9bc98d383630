"""Models of targets in configs/targets/: shape and sizes, lengths in metres.

Axes of a face, seen from outside: u to the right, v up, rotated with the wheel by its spin.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import Field, model_validator  # noqa: TID253  a class needs its base at once

from .parameters import Section


class TargetFile(Section):
    """Keys of every target.

    chamfer: width of a chamfer of 45 degrees along the face's edges; edge_radius: of rounded ones.
    The sizes are the plate's.
    flatness: distance of two planes, parallel to the mounting plane, that enclose the face.
    clamp_tilt_deg, clamp_shift: mounting repeatability: standard deviations, along each axis of the
    face, of the target's plane and centre from the wheel's true ones. stand_off, stand_off_u: of a
    target on a wheel of real shape, from the flange's edge, and its standard deviation.
    """

    shape: str
    thickness: float = Field(gt=0.0)
    chamfer: float | None = Field(None, ge=0.0, le=0.003)
    edge_radius: float | None = Field(None, ge=0.0, le=0.003)
    flatness: float = Field(0.0, ge=0.0, le=0.001)
    clamp_tilt_deg: float = Field(0.0, ge=0.0, le=2.0)
    clamp_shift: float = Field(0.0, ge=0.0, le=0.02)
    stand_off: float | None = Field(None, ge=0.0, le=0.5)
    stand_off_u: float | None = Field(None, ge=0.0, le=0.05)

    @model_validator(mode="after")
    def _edge_fits(self) -> TargetFile:
        if self.chamfer is not None and self.edge_radius is not None:
            raise ValueError("chamfer and edge_radius: state one of them")
        for name in ("chamfer", "edge_radius"):
            if (getattr(self, name) or 0.0) >= self.thickness:
                raise ValueError(
                    f"{name} {getattr(self, name)} m: not below the thickness {self.thickness} m"
                )
        return self

    @property
    def stated(self) -> dict[str, Any]:
        """Content of the file, ready for JSON: shape, sizes of the face, the rest."""
        sizes = self.model_dump(exclude_unset=True, mode="json")
        rest = {key: sizes.pop(key) for key in TargetFile.model_fields if key in sizes}
        return {"shape": rest.pop("shape"), **sizes, **rest}

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        raise NotImplementedError

    @property
    def open_m(self) -> tuple[float, float]:
        """Inner and outer radius, about the centre, at which the back of the target may be held."""
        return 0.0, 0.055

    def ids_of(self, wheel: str) -> tuple[int, ...]:
        """Return the markers on a wheel's target, row by row."""
        return ()


class DiscFile(TargetFile):
    """A disc."""

    shape: Literal["disc"]
    diameter: float = Field(gt=0.0)

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        return self.diameter / 2


class RingFile(TargetFile):
    """A disc with a round hole in its middle."""

    shape: Literal["ring"]
    diameter: float = Field(gt=0.0)
    hole_diameter: float = Field(gt=0.0)

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        return self.diameter / 2

    @property
    def open_m(self) -> tuple[float, float]:
        """Inner and outer radius, about the centre, at which the back of the target may be held."""
        hole = self.hole_diameter / 2
        return hole + 0.2 * (self.radius_m - hole), hole + 0.6 * (self.radius_m - hole)

    @model_validator(mode="after")
    def _fits(self) -> RingFile:
        if self.hole_diameter >= self.diameter:
            raise ValueError(f"hole_diameter {self.hole_diameter} is not below the diameter")
        return self


class RectangleFile(TargetFile):
    """A rectangle, width along u and height along v."""

    shape: Literal["rectangle"]
    width: float = Field(gt=0.0)
    height: float = Field(gt=0.0)

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        return math.hypot(self.width, self.height) / 2


class SquareFile(TargetFile):
    """A square with four round holes at the corners of a square of hole_spacing."""

    shape: Literal["square"]
    side: float = Field(gt=0.0)
    hole_diameter: float = Field(gt=0.0)
    hole_spacing: float = Field(gt=0.0)

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        return self.side / math.sqrt(2.0)

    @property
    def open_m(self) -> tuple[float, float]:
        """Inner and outer radius, about the centre, at which the back of the target may be held."""
        clear = self.hole_spacing / math.sqrt(2.0) - self.hole_diameter / 2
        return 0.0, min(0.055, clear - 0.002)

    @model_validator(mode="after")
    def _fits(self) -> SquareFile:
        edge = self.chamfer or self.edge_radius or 0.0
        if self.hole_spacing + self.hole_diameter + 4.0 * edge >= self.side:
            raise ValueError("the holes reach beyond the side; reduce hole_spacing")
        if self.hole_spacing < self.hole_diameter + 2.0 * edge + 0.005:
            raise ValueError("the holes touch each other; increase hole_spacing")
        return self


class BareWheelFile(TargetFile):
    """Nothing mounted: the wheel itself is scanned; its form is in the vehicle's file.

    rim, rim_runout: as stated to the measurement; they change nothing here.
    """

    shape: Literal["wheel"]
    thickness: float = Field(0.001, gt=0.0)
    rim: str | None = None
    rim_runout: float = Field(0.0, ge=0.0, le=0.02)

    @property
    def radius_m(self) -> float:
        """Radius of a usual rim."""
        return 0.23
