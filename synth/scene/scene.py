"""Scene before the scanner: wheels with their targets, the body around them, the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..parameters.parameters import Body, Surfaces
from ..parameters.plate_file import TargetFile
from ..vehicle.vehicle import FORWARD, UP, Vehicle, Wheel
from ..vehicle.wheel_solids import adapter, check_wheel, rolling
from .form import FLAT, Form
from .optics import Optics
from .pattern import Pattern
from .shade import Shade, print_on
from .solids import Solid, arch_panel, box, joined
from .target import REFLECTANCE, Mount, target_solid

NEUTRAL = Mount()
BUILT = Surfaces()


@dataclass(frozen=True)
class PlacedTarget:
    """One target before the scanner: its pose T_station_target (4, 4), its form, its print."""

    T_station_target: Array
    form: Form = FLAT
    pattern: Pattern | Shade | None = None

    def uv_m(self, points_station_m: Array) -> Array:
        """Return points (N, 3) along the axes of the face, (N, 2)."""
        local = points_station_m - self.T_station_target[:3, 3]
        return np.asarray(local @ self.T_station_target[:3, :2])

    def seen_from(self, origin_m: Array) -> PlacedTarget:
        """Return the target in coordinates whose origin lies at origin_m (3,)."""
        pose = self.T_station_target.copy()
        pose[:3, 3] -= origin_m
        return replace(self, T_station_target=pose)


@dataclass(frozen=True)
class Scene:
    """Facets in station coordinates: the axes of the site, the origin in the scanner.

    vertices_m (V, 3), faces (F, 3); each facet's plane normal . x = offset with a unit normal
    (F, 3) and offset_m (F,); surface (F,) numbers smooth surfaces; reflectance (F,); target (F,)
    is the number of the target whose measured face it belongs to, or -1. The plane of such a facet
    is the target's, not that of its corners; the form of the target is added to it. plate (F,): it
    belongs to a target's plate. optics: None where all surfaces return light alike.
    """

    vertices_m: Array
    faces: npt.NDArray[np.int64]
    normals: Array
    offsets_m: Array
    surface: npt.NDArray[np.int64]
    reflectance: Array
    target: npt.NDArray[np.int64]
    plate: Mask
    targets: tuple[PlacedTarget, ...] = ()
    optics: Optics | None = None

    def seen_from(self, origin_m: Array) -> Scene:
        """Return the scene in coordinates whose origin lies at origin_m (3,)."""
        return replace(
            self,
            vertices_m=self.vertices_m - origin_m,
            offsets_m=self.offsets_m - self.normals @ origin_m,
            targets=tuple(target.seen_from(origin_m) for target in self.targets),
        )


@dataclass(frozen=True)
class Mounted:
    """A target mounted on its wheel."""

    wheel: Wheel
    mount: Mount
    target: TargetFile

    @property
    def pose(self) -> Wheel:
        """Pose of the mounted target, as if it were the wheel's true pose."""
        return self.mount.on(self.wheel)

    def solids(self, body: Body) -> list[Solid]:
        """Build target, adapter and wheel in vehicle coordinates."""
        check_wheel(body, self.wheel, self.target)
        on_target = [target_solid(self.target), *adapter(self.wheel, self.target)]
        solids = [solid.placed(self.pose.T_vehicle_target) for solid in on_target]
        on_wheel = rolling(body, self.wheel)
        return solids + [solid.placed(self.wheel.T_vehicle_target) for solid in on_wheel]


def build_scene(
    vehicle: Vehicle,
    wheel: Wheel,
    target: TargetFile,
    station_vehicle_m: Array,
    mount: Mount = NEUTRAL,
    obstacles: Sequence[Solid] = (),
    surfaces: Surfaces = BUILT,
) -> Scene:
    """Build the scene of one wheel for the scanner at `station_vehicle_m` (3,).

    obstacles: in target coordinates.
    """
    mounted = Mounted(wheel, mount, target)
    solids = mounted.solids(vehicle.body)
    solids += [solid.placed(wheel.T_vehicle_target) for solid in obstacles]
    solids += around(vehicle, wheel)
    return seen_from(station_vehicle_m, solids, [mounted], vehicle, surfaces)


def around(vehicle: Vehicle, wheel: Wheel) -> list[Solid]:
    """Build what is around a wheel, in vehicle coordinates: the body's panels and the floor."""
    panels = [solid.placed(_upright(wheel)) for solid in _panels(vehicle.body, wheel)]
    return [*panels, _floor(vehicle, wheel)]


def seen_from(
    station_vehicle_m: Array,
    solids: Sequence[Solid],
    mounted: Sequence[Mounted],
    vehicle: Vehicle,
    surfaces: Surfaces = BUILT,
) -> Scene:
    """Transform solids in vehicle coordinates to the scene of the scanner at that station.

    mounted: the targets, in the order of their faces among the solids. Positions are taken relative
    to the station before they are rotated, so that large site coordinates cost no digits.
    """
    whole, reflectance = joined(solids)
    reflectance = _albedos(solids, reflectance, surfaces)
    R_site_vehicle = vehicle.T_site_vehicle[:3, :3]
    vertices = (whole.vertices_m - station_vehicle_m) @ R_site_vehicle.T
    normals, offsets = _planes(vertices[whole.faces])
    targets = tuple(
        _placed_target(one, R_site_vehicle, station_vehicle_m, surfaces) for one in mounted
    )
    number = _numbered(solids)
    for k, target in enumerate(targets):
        normal = target.T_station_target[:3, 2]
        normals[number == k] = normal
        offsets[number == k] = normal @ target.T_station_target[:3, 3]
    facets = [len(solid.faces) for solid in solids]
    plate = np.repeat([bool(solid.front.any()) for solid in solids], facets)
    return Scene(
        vertices, whole.faces, normals, offsets, whole.surface, reflectance, number, plate, targets
    )


def _placed_target(
    mounted: Mounted, R_site_vehicle: Array, station_vehicle_m: Array, surfaces: Surfaces
) -> PlacedTarget:
    target = mounted.pose
    pose = np.eye(4)
    pose[:3, :2] = R_site_vehicle @ target.T_vehicle_target[:3, :2]
    pose[:3, 2] = R_site_vehicle @ target.normal_vehicle
    pose[:3, 3] = R_site_vehicle @ (target.centre_vehicle_m - station_vehicle_m)
    mount = mounted.mount
    light = REFLECTANCE if surfaces.face is None else surfaces.face
    name = mounted.wheel.wheel
    printed = print_on(mounted.target, name, mount.print_shift_m, light, surfaces)
    return PlacedTarget(pose, mount.form, printed)


def _albedos(solids: Sequence[Solid], built: Array, surfaces: Surfaces) -> Array:
    """Return the albedo (F,) of every facet: that of its surface if stated, else as built."""
    stated = surfaces.model_dump()
    facets = [len(solid.faces) for solid in solids]
    own = np.repeat([_or_nan(stated.get(solid.material)) for solid in solids], facets)
    front = np.concatenate([solid.front for solid in solids])
    own = np.where(front, _or_nan(surfaces.face), own)
    return np.where(np.isnan(own), built, own)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _numbered(solids: Sequence[Solid]) -> npt.NDArray[np.int64]:
    """Return for every facet the number of its target face, counted over the solids, or -1."""
    faces = np.cumsum([bool(solid.front.any()) for solid in solids]) - 1
    parts = [np.where(solid.front, k, -1) for solid, k in zip(solids, faces, strict=True)]
    return np.concatenate(parts)


def _panels(body: Body, wheel: Wheel) -> list[Solid]:
    """Build door, fender and wheel well; z = 0 is the upright plane, x along the car, y up.

    The door is flat and larger than the target: a plane that a naive search prefers.
    """
    toward_door = 1.0 if wheel.wheel.startswith("R") else -1.0
    arch = body.arch_radius_m
    door = arch_panel((np.radians(-25), np.radians(58)), arch, (1.1, 1.1, 0.7), 0.03, 0.6)
    fender = arch_panel((np.radians(58.6), np.radians(205)), arch, (0.6, 0.6, 0.62), 0.03, 0.6)
    well = box((-0.7, -body.tyre_radius_m, -0.45), (0.7, 0.6, -0.44), 0.15)
    skin = -wheel.stand_off_m - 0.015
    ahead = toward_door * -wheel.side
    return [_placed_panel(door, ahead, skin), _placed_panel(fender, ahead, skin - 0.006), well]


def _placed_panel(panel: Solid, ahead: float, height_m: float) -> Solid:
    """Mirror x if the door is on the other side, and shift the panel along z."""
    pose = np.diag([ahead, 1.0, 1.0, 1.0])
    pose[2, 3] = height_m
    return panel.placed(pose)


def _upright(wheel: Wheel) -> Array:
    """Return T_vehicle_panel (4, 4): origin the target centre, z straight outboard, y up."""
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([-wheel.side * FORWARD, UP, np.cross(-wheel.side * FORWARD, UP)])
    pose[:3, 3] = wheel.centre_vehicle_m
    return pose


def _floor(vehicle: Vehicle, wheel: Wheel) -> Solid:
    x, y, _ = wheel.centre_vehicle_m
    slab = box((x - 5.0, y - 5.0, -0.1), (x + 5.0, y + 5.0, 0.0), reflectance=0.3)
    return slab.of("floor").placed(vehicle.T_vehicle_floor)


def _planes(corners_m: Array) -> tuple[Array, Array]:
    """Return unit normals (F, 3) and offsets (F,) of the facets with corners (F, 3, 3)."""
    a, b, c = corners_m[:, 0], corners_m[:, 1], corners_m[:, 2]
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, np.einsum("ij,ij->i", normals, a)
