"""Targets that are known by their outline: disc, ring, rectangle, square with four holes.

A new shape is one class here, of its sizes, `region` and `description`, and one row of `SHAPES`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import (  # noqa: TID253 - a target is a pydantic model
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from ..config import Section
from .outline import Circle, Holes, OuterEdge, rectangle
from .region import Region

INCH_M, FLANGE_HEIGHT_M = 0.0254, 0.0175  # of rims by their size, and their flange over the seat
USUAL_RIM_INCH = 17.0
WEB_M = 0.01  # of material, at least, between a hole and any other edge


class Plate(Section):
    """Properties of every flat target, lengths in metres; `thickness` where it is known.

    chamfer: width of the chamfer of 45 degrees along the edges of the face, where it is known; 0 of
    sharp ones. edge_radius: of rounded ones. The sizes are those of the plate, with either.
    flatness: the front face lies between two planes that far apart, metres. clamp_tilt_deg,
    clamp_shift: mounting repeatability, standard deviations per axis, degrees and metres.
    stand_off: of the face from the plane of the rim flange's edge, outwards along the normal, with
    its standard uncertainty, metres.
    """

    thickness: float | None = Field(None, ge=0.0, lt=0.2)
    chamfer: float | None = Field(None, ge=0.0, le=0.003)
    edge_radius: float | None = Field(None, ge=0.0, le=0.003)
    flatness: float = Field(0.0, ge=0.0, lt=0.01)
    clamp_tilt_deg: float = Field(0.0, ge=0.0, lt=5.0)
    clamp_shift: float = Field(0.0, ge=0.0, lt=0.05)
    stand_off: float | None = Field(None, gt=-0.5, lt=1.0)
    stand_off_u: float | None = Field(None, ge=0.0, lt=0.1)
    shape: str

    lengths: ClassVar[tuple[str, ...]] = (
        "thickness",
        "chamfer",
        "edge_radius",
        "flatness",
        "clamp_shift",
        "stand_off",
        "stand_off_u",
    )
    size: ClassVar[tuple[str, ...]] = ()  # the lengths from which the unit of all is inferred

    @model_validator(mode="after")
    def _stand_off_has_uncertainty(self) -> Plate:
        if (self.stand_off is None) != (self.stand_off_u is None):
            raise ValueError("stand_off and stand_off_u, its standard uncertainty: state both")
        return self

    @model_validator(mode="after")
    def _edges_fit(self) -> Plate:
        if self.chamfer is not None and self.edge_radius is not None:
            raise ValueError("chamfer and edge_radius: state one of them")
        for name, extent in (("chamfer", self.chamfer), ("edge_radius", self.edge_radius)):
            if extent and self.thickness is not None and extent > self.thickness:
                raise ValueError(
                    f"{name} {extent} is wider than the plate is thick, {self.thickness}: "
                    "check both"
                )
        return self

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what is not stated of these: settings of before keep their digest."""
        tree: dict[str, Any] = write(self)
        for name in ("chamfer", "edge_radius"):
            if tree[name] is None:
                del tree[name]
        if self.stand_off is None:
            del tree["stand_off"], tree["stand_off_u"]
        return tree

    @property
    def region(self) -> Region:
        """The front face in the target's axes, its centre at the origin."""
        raise NotImplementedError

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        raise NotImplementedError

    @property
    def edge(self) -> OuterEdge:
        """The outer edge."""
        return replace(self.region.edge, description=self.description)

    @property
    def holes(self) -> Holes | None:
        """The edges of the holes, if there are any."""
        holes_m = self.region.holes_m
        return Holes(holes_m, f"the holes of {self.description}") if len(holes_m) else None

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the target, metres."""
        return self.region.radius_m

    @property
    def turn_period_rad(self) -> float:
        """The smallest in-plane rotation that leaves the outline as it is; 0 where any does."""
        return self.region.period_rad


class DiscTarget(Plate):
    """A flat disc."""

    shape: Literal["disc"]
    diameter: float = Field(gt=0.01, lt=3.0)

    lengths = (*Plate.lengths, "diameter")
    size = ("diameter",)

    @property
    def region(self) -> Region:
        """The front face."""
        return Region(Circle(self.diameter / 2.0))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a disc of {self.diameter * 1e3:.5g} mm"


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
                f"hole_diameter {self.hole_diameter} leaves less than {WEB_M} of material around "
                f"it in a diameter of {self.diameter}: check both"
            )
        return self

    @property
    def region(self) -> Region:
        """The front face."""
        return Region(Circle(self.diameter / 2.0), np.array([[0.0, 0.0, self.hole_diameter / 2.0]]))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a ring of {self.diameter * 1e3:.5g} mm"


class RectangleTarget(Plate):
    """A flat rectangle: `width` along the axis u, `height` along v."""

    shape: Literal["rectangle"]
    width: float = Field(gt=0.01, lt=3.0)
    height: float = Field(gt=0.01, lt=3.0)

    lengths = (*Plate.lengths, "width", "height")
    size = ("width", "height")

    @property
    def region(self) -> Region:
        """The front face."""
        return Region(rectangle(self.width, self.height))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a rectangle of {self.width * 1e3:.5g} x {self.height * 1e3:.5g} mm"


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
                f"{taken} leave less than {WEB_M} of material to the edge of a side of "
                f"{self.side}: check all three"
            )
        if self.hole_spacing < self.hole_diameter + WEB_M:
            raise ValueError(f"{taken} leave less than {WEB_M} between the holes: check both")
        return self

    @property
    def region(self) -> Region:
        """The front face."""
        a, radius = self.hole_spacing / 2.0, self.hole_diameter / 2.0
        holes = np.array([[u, v, radius] for u in (-a, a) for v in (-a, a)])
        return Region(rectangle(self.side, self.side), holes)

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a square of {self.side * 1e3:.5g} mm"


class WheelTarget(Plate):
    """The wheel itself, with nothing mounted on it: its rim, or its tyre where no rim is seen.

    rim: nominal diameter, such as "17in", if it is known. rim_runout: total indicator reading of
    the rim against the spin axis, lateral and radial, metres: it stands for the mounting, whose
    standard deviations per axis follow from it where they are not stated.
    """

    shape: Literal["wheel"]
    rim: str | None = Field(None, pattern=r"^[1-9][0-9]?(\.[05])?in$", examples=["16in"])
    rim_runout: float = Field(0.0, ge=0.0, lt=0.02)

    lengths = (*Plate.lengths, "rim_runout")

    @model_validator(mode="before")
    @classmethod
    def _runout_as_mounting(cls, values: Any) -> Any:
        runout = values.get("rim_runout") if isinstance(values, dict) else None
        if not isinstance(runout, float) or not 0.0 < runout < 0.02:
            return values
        shift = runout / 2.0 / math.sqrt(2.0)  # an amplitude of half the reading, in any direction
        tilt = math.degrees(shift / _flange_m(values.get("rim")))
        return {"clamp_tilt_deg": tilt, "clamp_shift": shift, **values}

    @model_validator(mode="after")
    def _stands_nowhere_off(self) -> WheelTarget:
        if self.stand_off is not None:
            raise ValueError("a bare wheel has no stand_off: leave it out")
        return self

    @property
    def rim_inch(self) -> float | None:
        """Nominal diameter of the rim, inches, if it is stated."""
        return None if self.rim is None else float(self.rim.removesuffix("in"))

    @property
    def region(self) -> Region:
        """A disc within the rim's flange, of a usual rim where none is stated."""
        return Region(Circle(_flange_m(self.rim)))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return "a wheel" if self.rim is None else f"a wheel of {self.rim}"


def _flange_m(rim: object) -> float:
    """Return the radius of a rim's flange."""
    try:
        inch = float(str(rim).removesuffix("in"))
    except ValueError:
        inch = USUAL_RIM_INCH
    return inch * INCH_M / 2.0 + FLANGE_HEIGHT_M
