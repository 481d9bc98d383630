"""What stands before the scanner: a wheel with its target, the body around it, the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from synth.errors import SynthError
from synth.form import FLAT, Form
from synth.parameters import Body, TargetFile
from synth.solids import Solid, arch_plate, box, joined, revolved
from synth.target import Mount, disc
from synth.vehicle import FORWARD, UP, Vehicle, Wheel

Array = npt.NDArray[np.float64]
NEUTRAL = Mount()


@dataclass(frozen=True)
class Scene:
    """Facets in station coordinates: the axes of the site, the origin in the scanner.

    vertices_m (V, 3), faces (F, 3); each facet's plane normal . x = offset with a unit normal
    (F, 3) and offset_m (F,); surface (F,) numbers smooth surfaces; reflectance (F,); front (F,)
    marks the target's measured face, whose plane is the plate's and not that of its facets. On it
    lies the form of the plate, at (x, y) of T_station_plate (4, 4).
    """

    vertices_m: Array
    faces: npt.NDArray[np.int64]
    normals: Array
    offsets_m: Array
    surface: npt.NDArray[np.int64]
    reflectance: Array
    front: npt.NDArray[np.bool_]
    form: Form = FLAT
    T_station_plate: Array = field(default_factory=lambda: np.eye(4))


def build_scene(
    vehicle: Vehicle,
    wheel: Wheel,
    target: TargetFile,
    station_vehicle_m: Array,
    mount: Mount = NEUTRAL,
    before: Sequence[Solid] = (),
) -> Scene:
    """The scene of one wheel as the scanner at `station_vehicle_m` (3,) has it before itself.

    Positions are taken relative to the station first and turned after, so that the place of the
    vehicle in the site costs no digits. before: what else there is, in target coordinates.
    """
    _check(vehicle.body, wheel, target)
    plate = mount.on(wheel)
    on_plate = [disc(target), *_adapter(wheel, target)]
    on_wheel = [*_rolling(vehicle.body, wheel), *before]
    solids = [solid.placed(plate.T_vehicle_target) for solid in on_plate]
    solids += [solid.placed(wheel.T_vehicle_target) for solid in on_wheel]
    panels = [solid.placed(_upright(wheel)) for solid in _panels(vehicle.body, wheel)]
    solids += [*panels, _floor(vehicle, wheel)]
    whole, reflectance = joined(solids)
    R_site_vehicle = vehicle.T_site_vehicle[:3, :3]
    vertices = (whole.vertices_m - station_vehicle_m) @ R_site_vehicle.T
    normals, offsets = _planes(vertices[whole.faces])
    T_station_plate = np.eye(4)
    T_station_plate[:3, :2] = R_site_vehicle @ plate.T_vehicle_target[:3, :2]
    T_station_plate[:3, 2] = R_site_vehicle @ plate.normal_vehicle
    T_station_plate[:3, 3] = R_site_vehicle @ (plate.centre_vehicle_m - station_vehicle_m)
    normals[whole.front] = T_station_plate[:3, 2]
    offsets[whole.front] = T_station_plate[:3, 2] @ T_station_plate[:3, 3]
    return Scene(
        vertices,
        whole.faces,
        normals,
        offsets,
        whole.surface,
        reflectance,
        whole.front,
        mount.form,
        T_station_plate,
    )


def _check(body: Body, wheel: Wheel, target: TargetFile) -> None:
    if target.thickness > wheel.stand_off_m:
        raise SynthError(
            f"target thickness {target.thickness} m: more than the stand-off "
            f"{wheel.stand_off_m:.4f} m of {wheel.name}; raise stand_off_m or thin the target"
        )
    if body.rim_diameter_m / 2 + 0.05 > body.tyre_radius_m:
        raise SynthError(
            f"body.rim_diameter_m {body.rim_diameter_m}: leaves less than 50 mm of tyre at "
            f"tyre_radius_m {body.tyre_radius_m}; make the rim smaller"
        )


def _adapter(wheel: Wheel, target: TargetFile) -> list[Solid]:
    """A shaft from the hub to the back of the plate, with a flange behind the plate."""
    back, hub = -target.thickness, -wheel.stand_off_m - 0.02
    flange = back - 0.008
    profile = [(0.0, hub), (0.03, hub), (0.03, flange), (0.055, flange), (0.055, back), (0.0, back)]
    return [revolved(profile, 90, reflectance=0.4)]


def _rolling(body: Body, wheel: Wheel) -> list[Solid]:
    """Tyre, rim barrel, hub, spokes and brake disc, inboard of the sidewall plane."""
    out = -wheel.stand_off_m
    rim, width = body.rim_diameter_m / 2, body.tyre_width_m
    face = out - 0.02
    spokes = [_spoke(k / max(body.spokes, 1), face, rim) for k in range(body.spokes)]
    barrel = [(rim - 0.014, face), (rim + 0.002, face + 0.006), (rim + 0.002, out - width),
              (rim - 0.014, out - width), (rim - 0.014, face)]  # fmt: skip
    return [
        _tyre(body, out),
        revolved(barrel, 240, reflectance=0.55),
        _cylinder(0.075, face - 0.05, face, reflectance=0.55),
        _cylinder(0.15, out - 0.11, out - 0.09, reflectance=0.35),
        *spokes,
    ]


def _tyre(body: Body, out_m: float) -> Solid:
    """Section |r|^4 + |z|^4 = 1 between rim and tread, smooth so that its facets are no edges."""
    turn = np.linspace(0.0, 2 * np.pi, 97)
    cos, sin = np.cos(turn), np.sin(turn)
    rim_m, outer_m = body.rim_diameter_m / 2, body.tyre_radius_m
    radius = (rim_m + outer_m) / 2 + (outer_m - rim_m) / 2 * np.sign(cos) * np.sqrt(np.abs(cos))
    across = body.tyre_width_m / 2 * (np.sign(sin) * np.sqrt(np.abs(sin)) - 1) + out_m
    radius[-1], across[-1] = radius[0], across[0]
    return revolved(list(zip(radius, across, strict=True)), 360, reflectance=0.1)


def _spoke(turn: float, face_m: float, rim_m: float) -> Solid:
    pose = np.eye(4)
    cos, sin = np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)
    pose[:2, :2] = [[cos, -sin], [sin, cos]]
    bar = box((0.06, -0.028, face_m - 0.03), (rim_m - 0.008, 0.028, face_m - 0.004), 0.55)
    return bar.placed(pose)


def _cylinder(radius_m: float, low_m: float, high_m: float, reflectance: float) -> Solid:
    profile = [(0.0, low_m), (radius_m, low_m), (radius_m, high_m), (0.0, high_m)]
    return revolved(profile, 180, reflectance)


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
