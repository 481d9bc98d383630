"""What stands before the scanner: a wheel with its target, the body around it, the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..parameters.parameters import Body
from ..parameters.plate_file import TargetFile
from ..vehicle.vehicle import FORWARD, UP, Vehicle, Wheel
from ..vehicle.wheel_solids import adapter, check_wheel, rolling
from .form import FLAT, Form
from .pattern import Pattern, pattern_on
from .solids import Solid, arch_plate, box, joined
from .target import Mount, plate_solid

NEUTRAL = Mount()


@dataclass(frozen=True)
class Plate:
    """One target as it stands before the scanner: T_station_plate (4, 4), its form, its print."""

    T_station_plate: Array
    form: Form = FLAT
    pattern: Pattern | None = None

    def uv_m(self, points_station_m: Array) -> Array:
        """Points (N, 3) along the axes of the face, (N, 2)."""
        away = points_station_m - self.T_station_plate[:3, 3]
        return np.asarray(away @ self.T_station_plate[:3, :2])


@dataclass(frozen=True)
class Scene:
    """Facets in station coordinates: the axes of the site, the origin in the scanner.

    vertices_m (V, 3), faces (F, 3); each facet's plane normal . x = offset with a unit normal
    (F, 3) and offset_m (F,); surface (F,) numbers smooth surfaces; reflectance (F,); plate (F,)
    is the number of the target of whose measured face it is part, or -1. The plane of such a facet
    is the plate's and not that of its corners; on it lies the form of the plate.
    """

    vertices_m: Array
    faces: npt.NDArray[np.int64]
    normals: Array
    offsets_m: Array
    surface: npt.NDArray[np.int64]
    reflectance: Array
    plate: npt.NDArray[np.int64]
    plates: tuple[Plate, ...] = ()


@dataclass(frozen=True)
class Mounted:
    """A target on its wheel, as it was clamped."""

    wheel: Wheel
    mount: Mount
    target: TargetFile

    @property
    def plate(self) -> Wheel:
        """Where the plate is, as if it were the wheel's true pose."""
        return self.mount.on(self.wheel)

    def solids(self, body: Body) -> list[Solid]:
        """Plate, adapter and wheel in vehicle coordinates."""
        check_wheel(body, self.wheel, self.target)
        on_plate = [plate_solid(self.target), *adapter(self.wheel, self.target)]
        solids = [solid.placed(self.plate.T_vehicle_target) for solid in on_plate]
        on_wheel = rolling(body, self.wheel)
        return solids + [solid.placed(self.wheel.T_vehicle_target) for solid in on_wheel]


def build_scene(
    vehicle: Vehicle,
    wheel: Wheel,
    target: TargetFile,
    station_vehicle_m: Array,
    mount: Mount = NEUTRAL,
    before: Sequence[Solid] = (),
) -> Scene:
    """The scene of one wheel as the scanner at `station_vehicle_m` (3,) has it before itself.

    before: what else there is, in target coordinates.
    """
    mounted = Mounted(wheel, mount, target)
    solids = mounted.solids(vehicle.body)
    solids += [solid.placed(wheel.T_vehicle_target) for solid in before]
    solids += [solid.placed(_upright(wheel)) for solid in _panels(vehicle.body, wheel)]
    solids += [_floor(vehicle, wheel)]
    return seen_from(station_vehicle_m, solids, [mounted], vehicle)


def seen_from(
    station_vehicle_m: Array, solids: Sequence[Solid], mounted: Sequence[Mounted], vehicle: Vehicle
) -> Scene:
    """Solids in vehicle coordinates as the scanner there has them before itself.

    mounted: the targets, in the order in which their faces stand among the solids. Positions are
    taken relative to the station first and turned after, so that the place of the vehicle in the
    site costs no digits.
    """
    whole, reflectance = joined(solids)
    R_site_vehicle = vehicle.T_site_vehicle[:3, :3]
    vertices = (whole.vertices_m - station_vehicle_m) @ R_site_vehicle.T
    normals, offsets = _planes(vertices[whole.faces])
    plates = tuple(_plate(one, R_site_vehicle, station_vehicle_m) for one in mounted)
    number = _numbered(solids)
    for k, plate in enumerate(plates):
        normal = plate.T_station_plate[:3, 2]
        normals[number == k] = normal
        offsets[number == k] = normal @ plate.T_station_plate[:3, 3]
    return Scene(
        vertices, whole.faces, normals, offsets, whole.surface, reflectance, number, plates
    )


def _plate(mounted: Mounted, R_site_vehicle: Array, station_vehicle_m: Array) -> Plate:
    plate = mounted.plate
    pose = np.eye(4)
    pose[:3, :2] = R_site_vehicle @ plate.T_vehicle_target[:3, :2]
    pose[:3, 2] = R_site_vehicle @ plate.normal_vehicle
    pose[:3, 3] = R_site_vehicle @ (plate.centre_vehicle_m - station_vehicle_m)
    mount = mounted.mount
    printed = pattern_on(mounted.target, mounted.wheel.wheel, mount.print_shift_m)
    return Plate(pose, mount.form, printed)


def _numbered(solids: Sequence[Solid]) -> npt.NDArray[np.int64]:
    """Of every facet the number of the face it is part of, counted over the solids, or -1."""
    faces = np.cumsum([bool(solid.front.any()) for solid in solids]) - 1
    parts = [np.where(solid.front, k, -1) for solid, k in zip(solids, faces, strict=True)]
    return np.concatenate(parts)


def _panels(body: Body, wheel: Wheel) -> list[Solid]:
    """Door, fender and wheel-well; z = 0 is the target's upright plane, x along the car, y up.

    The door is flat and larger than the target: a plane that a careless search prefers.
    """
    toward_door = 1.0 if wheel.wheel.startswith("R") else -1.0
    arch = body.arch_radius_m
    door = arch_plate((np.radians(-25), np.radians(58)), arch, (1.1, 1.1, 0.7), 0.03, 0.6)
    fender = arch_plate((np.radians(58.6), np.radians(205)), arch, (0.6, 0.6, 0.62), 0.03, 0.6)
    well = box((-0.7, -body.tyre_radius_m, -0.45), (0.7, 0.6, -0.44), 0.15)
    skin = -wheel.stand_off_m - 0.015
    ahead = toward_door * -wheel.side
    return [_turned_along(door, ahead, skin), _turned_along(fender, ahead, skin - 0.006), well]


def _turned_along(plate: Solid, ahead: float, height_m: float) -> Solid:
    """Mirror x where the door lies the other way, and set the plate at a height."""
    pose = np.diag([ahead, 1.0, 1.0, 1.0])
    pose[2, 3] = height_m
    return plate.placed(pose)


def _upright(wheel: Wheel) -> Array:
    """T_vehicle_panel (4, 4): origin the target centre, z straight outboard, y up."""
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([-wheel.side * FORWARD, UP, np.cross(-wheel.side * FORWARD, UP)])
    pose[:3, 3] = wheel.centre_vehicle_m
    return pose


def _floor(vehicle: Vehicle, wheel: Wheel) -> Solid:
    x, y, _ = wheel.centre_vehicle_m
    top = vehicle.floor_m
    return box((x - 5.0, y - 5.0, top - 0.1), (x + 5.0, y + 5.0, top), reflectance=0.3)


def _planes(corners_m: Array) -> tuple[Array, Array]:
    """Unit normals (F, 3) and offsets (F,) of the facets with corners (F, 3, 3)."""
    a, b, c = corners_m[:, 0], corners_m[:, 1], corners_m[:, 2]
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, np.einsum("ij,ij->i", normals, a)
