"""A made-up target shape, one class and one row of SHAPES, is found and its centre is located."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from tests.support import scenes
from tests.support.plates import in_target
from tests.support.scenes import Setup, Sheet, make
from wheelplane.centre.locate_centre import locate_centre
from wheelplane.centre.target_view import TargetView
from wheelplane.config import CentreConfig, PlaneConfig, SegmentConfig
from wheelplane.detection.find_target import find_target
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.report.plots.target import target_svg
from wheelplane.targets.outline import Circle, Polygon
from wheelplane.targets.plates import Plate
from wheelplane.targets.region import Region
from wheelplane.targets.registry import SHAPES, parse_target, scaled, size_of

PLAIN = Setup(spacing_m=0.0022, half_width_m=0.24, pairs=12)
SIXTH = np.arange(6) * math.pi / 3.0
PERIOD_RAD = {"hexagon": math.pi / 3.0, "two-holes": 2.0 * math.pi}
EFFECT_M = 1.2e-4  # what the known shapes are located to


class HexagonTarget(Plate):
    """A flat regular hexagon, one corner on the axis u."""

    shape: Literal["hexagon"]
    across: float  # corners

    lengths = (*Plate.lengths, "across")
    size = ("across",)

    @property
    def region(self) -> Region:
        """The front face."""
        return Region(Polygon(self.across / 2.0 * np.column_stack([np.cos(SIXTH), np.sin(SIXTH)])))

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a hexagon of {self.across * 1e3:.0f} mm"


HOLES = ((0.07, 0.0, 0.035), (-0.08, 0.0, 0.02))


class TwoHolesTarget(Plate):
    """A flat disc of 300 mm with two unlike holes on the axis u, scaled to `diameter`."""

    shape: Literal["two-holes"]
    diameter: float

    lengths = (*Plate.lengths, "diameter")
    size = ("diameter",)

    @property
    def region(self) -> Region:
        """The front face."""
        return Region(Circle(self.diameter / 2.0), np.array(HOLES) * self.diameter / 0.3)

    @property
    def description(self) -> str:
        """Shape and size, as in messages."""
        return f"a disc of {self.diameter * 1e3:.0f} mm with two holes"


TABLES = {
    "hexagon": {"shape": "hexagon", "across": 0.3, "thickness": 0.01},
    "two-holes": {"shape": "two-holes", "diameter": 0.3, "thickness": 0.01},
}


@dataclass(frozen=True)
class PolygonFace:
    """A flat polygon w = 0, by its corners; `echo` as the other pieces have it."""

    corners: np.ndarray
    echo: float = 1.0

    def meet(self, origin, ray):
        run = Sheet((0, 0, 0), outer=1.0).meet(origin, ray)
        foot = (origin + np.where(np.isfinite(run), run, 0.0)[:, None] * ray)[:, :2]
        for here, there in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            along, to = there - here, foot - here
            run = np.where(along[0] * to[:, 1] - along[1] * to[:, 0] < 0.0, np.inf, run)
        return run


def hexagon_pieces(setup, rng):
    """The hexagon's face, its walls, and the background."""
    radius, deep = setup.radius_m, setup.thickness_m / 2.0
    apothem = radius * math.cos(math.pi / 6.0)
    walls = []
    for angle in SIXTH + math.pi / 6.0:
        n = np.array([math.cos(angle), math.sin(angle), 0.0])
        middle = (*(apothem * n[:2]), -deep)
        walls.append(Sheet(middle, tuple(n), (-n[1], n[0], 0.0), (radius / 2.0, deep)))
    corners = radius * np.column_stack([np.cos(SIXTH), np.sin(SIXTH)])
    behind = Sheet((0, 0, -setup.background_m), normal=(0.04, -0.05, 1.0))
    return [PolygonFace(corners), *walls, behind]


@pytest.fixture(params=TABLES)
def scene(request, monkeypatch):
    """A made-up target as its table is read, and the scene that shows it."""
    for shape, model in (("hexagon", HexagonTarget), ("two-holes", TwoHolesTarget)):
        monkeypatch.setitem(SHAPES, shape, model)
    target = parse_target(TABLES[request.param], "new.toml")
    setup = PLAIN.but(radius_m=0.15)
    if request.param == "hexagon":
        monkeypatch.setattr(scenes, "_pieces", hexagon_pieces)
        return target, setup
    return target, setup.but(holes=HOLES)


@pytest.mark.parametrize("seed", [1])
def test_a_new_shape_is_found_and_its_centre_and_rotation_are_located(scene, seed):
    target, setup = scene
    cloud = make(setup, seed)
    patch = find_target(cloud.points_m, target, SegmentConfig(), seed)
    plane = fit_plane(patch, target, PlaneConfig())
    fitted = locate_centre(TargetView(patch, plane, target, CentreConfig()))
    result = in_target(cloud, fitted)
    assert np.linalg.norm(result.error_m) < EFFECT_M
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
    assert target.turn_period_rad == pytest.approx(PERIOD_RAD[target.shape])
    axis = cloud.R.T @ fitted.turn.axis
    off = math.remainder(math.atan2(axis[1], axis[0]), target.turn_period_rad)
    assert abs(off) < 2.0 * EFFECT_M / target.region.lever_m2**0.5


def test_a_new_shape_is_read_in_any_unit_listed_and_drawn(scene):
    target, _ = scene
    table = TABLES[target.shape]
    in_mm = {k: v * 1e3 if k in type(target).lengths else v for k, v in table.items()}
    name, size = size_of(in_mm)
    assert size == pytest.approx(300.0)
    assert getattr(parse_target(scaled(in_mm, 1e-3), "t"), name) == pytest.approx(0.3)
    drawing = target_svg("new", target)
    assert target.description in drawing
    corners = max(path.count("L") for path in re.findall(r' d="([^"]*)"', drawing))
    assert (corners >= 5) == (target.shape == "hexagon")
