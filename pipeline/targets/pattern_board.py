"""Boards with a printed pattern: circles, a checkerboard, or ArUco markers."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator  # noqa: TID253 - a target is a pydantic model

from ..vectors import Array
from .outline import Circle, rectangle
from .plates import Plate
from .region import Region

WheelName = Literal["RR", "RL", "FR", "FL"]
Dictionary = Literal[
    "DICT_4X4_50",
    "DICT_4X4_100",
    "DICT_4X4_250",
    "DICT_5X5_50",
    "DICT_5X5_100",
    "DICT_5X5_250",
    "DICT_6X6_50",
    "DICT_6X6_100",
    "DICT_6X6_250",
    "DICT_APRILTAG_36h11",
]
MARKERS = {"DICT_APRILTAG_36h11": 587}  # of the others it stands in their names
REMOVE_IT = "remove it"


class PatternTarget(Plate):
    """A flat board, a disc of `diameter` or `width` x `height`, with a pattern printed on it.

    rows, columns: of circles, of a checkerboard's inner corners, or of markers; rows run along u,
    the first at the top (largest v), `pitch` apart. offset: of the pattern's centre from the
    board's, along u and v; turn_deg: rotation of the pattern on the board, counterclockwise as seen
    from the scanner. print_shift: standard deviation per axis of the pattern's position. circles:
    dark, of `circle_diameter`. checkerboard: the square beyond its first corner is dark. aruco:
    markers of `marker_size`, of a `dictionary`; their `ids` row by row, or by wheel in `wheels`.
    """

    shape: Literal["pattern"]
    kind: Literal["circles", "checkerboard", "aruco"]
    rows: int = Field(ge=1, le=40)
    columns: int = Field(ge=1, le=40)
    pitch: float = Field(gt=0.002, lt=1.0)
    offset: tuple[float, float] = Field((0.0, 0.0), strict=False)
    turn_deg: float = Field(0.0, ge=-180.0, le=180.0)
    print_shift: float = Field(0.0, ge=0.0, lt=0.01)
    diameter: float | None = Field(None, gt=0.01, lt=3.0)
    width: float | None = Field(None, gt=0.01, lt=3.0)
    height: float | None = Field(None, gt=0.01, lt=3.0)
    circle_diameter: float | None = Field(None, gt=0.002, lt=1.0)
    marker_size: float | None = Field(None, gt=0.005, lt=1.0)
    dictionary: Dictionary | None = None
    ids: tuple[int, ...] | None = Field(None, strict=False)
    wheels: dict[WheelName, Annotated[tuple[int, ...], Field(strict=False)]] | None = None

    lengths = (
        *Plate.lengths,
        *("pitch", "offset", "print_shift", "diameter", "width", "height"),
        *("circle_diameter", "marker_size"),
    )
    size = ("diameter", "width", "height")

    @model_validator(mode="after")
    def _is_whole(self) -> PatternTarget:
        self._check_outline()
        needed = {
            "circles": ("circle_diameter",),
            "checkerboard": (),
            "aruco": ("marker_size", "dictionary"),
        }[self.kind]
        for name in ("circle_diameter", "marker_size", "dictionary", "ids", "wheels"):
            given = getattr(self, name) is not None
            if name in needed and not given:
                raise ValueError(f"a pattern of kind {self.kind!r} needs {name}: add it")
            if given and name not in needed and (self.kind != "aruco" or name == "circle_diameter"):
                raise ValueError(f"a pattern of kind {self.kind!r} has no {name}: {REMOVE_IT}")
        if self.kind != "aruco" and self.rows * self.columns < 4:
            raise ValueError(f"{self.rows} x {self.columns} features are too few: print 4 or more")
        if self.feature_size_m > self.pitch * (1.0 if self.kind == "checkerboard" else 0.9):
            raise ValueError(f"pitch {self.pitch} leaves no gap between the features: increase it")
        if self.kind == "aruco":
            self._check_ids()
        if not self.region.holds(self.corners_m).all():
            raise ValueError(
                "the pattern reaches beyond the board: check its pitch, rows, columns and offset"
            )
        return self

    def _check_outline(self) -> None:
        sides = (self.width is not None) + (self.height is not None)
        if (self.diameter is not None) == (sides > 0) or sides == 1:
            raise ValueError(
                "the outline of the board is missing: give diameter, or width and height"
            )

    def _check_ids(self) -> None:
        if (self.ids is None) == (self.wheels is None) or self.wheels == {}:
            raise ValueError(
                "a pattern of kind 'aruco' needs ids, or a table wheels: add one of them"
            )
        count, listed = self.rows * self.columns, set[int]()
        assert self.dictionary is not None
        known = MARKERS.get(self.dictionary) or int(self.dictionary.rpartition("_")[2])
        for name, ids in self.id_sets.items():
            if len(ids) != count:
                raise ValueError(
                    f"{name} has {len(ids)} markers, rows x columns is {count}: check the ids"
                )
            for marker in ids:
                if not 0 <= marker < known:
                    raise ValueError(
                        f"{name}: {self.dictionary} has the markers 0 to {known - 1}, not {marker}"
                    )
                if marker in listed:
                    raise ValueError(
                        f"{name}: the marker {marker} is listed twice: list each marker once"
                    )
                listed.add(marker)

    @property
    def region(self) -> Region:
        """The front face."""
        if self.diameter is not None:
            return Region(Circle(self.diameter / 2.0))
        assert self.width is not None
        assert self.height is not None
        return Region(rectangle(self.width, self.height))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        if self.diameter is not None:
            return f"a round board of {self.diameter * 1e3:.5g} mm"
        half = self.region.half_m
        return f"a board of {half[0] * 2e3:.5g} x {half[1] * 2e3:.5g} mm"

    @property
    def id_sets(self) -> dict[str, tuple[int, ...]]:
        """Marker ids row by row, by wheel where each has its own."""
        if self.wheels is not None:
            return {str(wheel): ids for wheel, ids in self.wheels.items()}
        return {"ids": self.ids or ()}

    @property
    def feature_size_m(self) -> float:
        """Diameter of a circle, side of a marker or of a square, metres."""
        return self.circle_diameter or self.marker_size or self.pitch

    @property
    def places_m(self) -> Array:
        """Centres of circles and markers, or inner corners, row by row: (K, 2) in target axes."""
        row, column = np.divmod(np.arange(self.rows * self.columns), self.columns)
        local = np.column_stack([column - (self.columns - 1) / 2, (self.rows - 1) / 2 - row])
        return self._on_board(local * self.pitch)

    @property
    def print_period_rad(self) -> float:
        """Smallest rotation that maps the features onto themselves; of markers, a full one."""
        if self.kind == "aruco":
            return 2.0 * math.pi
        return math.pi / 2.0 if self.rows == self.columns else math.pi

    @property
    def corners_m(self) -> Array:
        """Corners of the printed area: (4, 2) in target axes."""
        grown = 2.0 if self.kind == "checkerboard" else self.feature_size_m / self.pitch
        half = np.array([self.columns - 1 + grown, self.rows - 1 + grown]) / 2.0 * self.pitch
        return self._on_board(half * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]))

    def _on_board(self, local_m: Array) -> Array:
        """Return points (N, 2) of the pattern's own axes in the target's."""
        c, s = math.cos(math.radians(self.turn_deg)), math.sin(math.radians(self.turn_deg))
        R = np.array([[c, -s], [s, c]])
        return np.asarray(local_m @ R.T + np.array(self.offset))

    def wheel_of(self, ids: Collection[int]) -> str | None:
        """Return the wheel that most of the markers `ids` belong to; None where there is none."""
        votes = {w: len(set(ids) & set(mine)) for w, mine in (self.wheels or {}).items()}
        best = max(votes, key=lambda wheel: votes[wheel], default=None)
        if best is None or votes[best] == 0 or list(votes.values()).count(votes[best]) > 1:
            return None
        return best
