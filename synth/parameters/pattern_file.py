"""Models of printed targets in configs/targets/; lengths in metres."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator  # noqa: TID253  a class needs its base at once

from .plate_file import TargetFile

Side = Literal["RR", "RL", "FR", "FL"]
Markers = Annotated[tuple[int, ...], Field(strict=False)]


class PatternFile(TargetFile):
    """A board, round or rectangular, with a pattern printed dark on light.

    rows, columns: of circles, of inner corners of a checkerboard, or of markers, `pitch` apart;
    rows run along u, the first at the top. offset, turn_deg: of the pattern's centre from the
    face's, and its rotation on the face, anticlockwise as seen. print_shift: standard deviation of
    the print's position along either axis. ids: of markers, row by row, on every wheel; or wheels:
    of each wheel.
    """

    shape: Literal["pattern"]
    kind: Literal["circles", "checkerboard", "aruco"]
    rows: int = Field(ge=1, le=100)
    columns: int = Field(ge=1, le=100)
    pitch: float = Field(gt=0.0)
    offset: tuple[float, float] = Field((0.0, 0.0), strict=False)
    turn_deg: float = 0.0
    print_shift: float = Field(0.0, ge=0.0, le=0.01)
    diameter: float | None = Field(None, gt=0.0)
    width: float | None = Field(None, gt=0.0)
    height: float | None = Field(None, gt=0.0)
    circle_diameter: float | None = Field(None, gt=0.0)
    marker_size: float | None = Field(None, gt=0.0)
    dictionary: str | None = None
    ids: Markers | None = None
    wheels: dict[Side, Markers] | None = None

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle about the face."""
        if self.diameter is not None:
            return self.diameter / 2
        return math.hypot(self.width or 0.0, self.height or 0.0) / 2

    def ids_of(self, wheel: str) -> tuple[int, ...]:
        """Return the markers on a wheel's target, row by row."""
        by_name = {str(name): ids for name, ids in (self.wheels or {}).items()}
        return by_name.get(wheel, ()) if self.wheels is not None else self.ids or ()

    @model_validator(mode="after")
    def _has_an_outline(self) -> PatternFile:
        sides = [self.width, self.height].count(None)
        if (self.diameter is None) != (sides == 0) or sides == 1:
            raise ValueError("a board has a diameter, or a width and a height")
        return self

    @model_validator(mode="after")
    def _has_its_features(self) -> PatternFile:
        needs = {"circles": "circle_diameter", "aruco": "marker_size"}.get(self.kind)
        if needs is not None and getattr(self, needs) is None:
            raise ValueError(f"kind '{self.kind}' needs a {needs}")
        if needs is not None and getattr(self, needs) > self.pitch:
            raise ValueError(f"{needs} {getattr(self, needs)} is more than the pitch {self.pitch}")
        if self.kind == "aruco":
            self._check_markers()
        return self

    def _check_markers(self) -> None:
        if self.dictionary is None or (self.ids is None) == (self.wheels is None):
            raise ValueError("kind 'aruco' needs a dictionary, and ids or wheels")
        for wheel in ("RR", "RL", "FR", "FL"):
            if len(self.ids_of(wheel)) != self.rows * self.columns:
                raise ValueError(
                    f"{wheel} has {len(self.ids_of(wheel))} markers for {self.rows} rows of "
                    f"{self.columns}"
                )
