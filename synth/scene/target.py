"""The target on a wheel: its solid, and its mounting."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..parameters.pattern_file import PatternFile
from ..parameters.plate_file import RectangleFile, RingFile, SquareFile, TargetFile
from ..vehicle.vehicle import Wheel, about
from .form import FLAT, Form, draw_form, rectangle_m, ring_m
from .solids import Solid, bevelled, box, joined, punched, revolved

# The polygon lies within radius * (1 - cos(pi / SECTIONS)) of its circle: 0.3 um at 125 mm.
SECTIONS = 1440
ARC = 12  # facets of a rounded edge: within 0.2 % of its radius
REFLECTANCE = 0.8


@dataclass(frozen=True)
class Mount:
    """One mounting of one target.

    The wheel's true plane and centre are z = 0 and the origin of its target coordinates; the
    mounting plane and centre of the target are those of its mounted coordinates. tilt_rad: about x
    and y; shift_m: along x and y; form: of the face over the mounting plane; print_shift_m: of the
    print, along x and y.
    """

    tilt_rad: tuple[float, float] = (0.0, 0.0)
    shift_m: tuple[float, float] = (0.0, 0.0)
    form: Form = FLAT
    print_shift_m: tuple[float, float] = (0.0, 0.0)

    @property
    def T_target_mounted(self) -> Array:
        """Pose (4, 4) of the mounted target in the target coordinates of its wheel."""
        angle = float(np.hypot(*self.tilt_rad))
        pose = np.eye(4)
        if angle > 0.0:
            pose[:3, :3] = about(np.array([*self.tilt_rad, 0.0]) / angle, angle)
        pose[:2, 3] = self.shift_m
        return pose

    def to_json(self, target: TargetFile) -> dict[str, Any]:
        """Return the drawn values, if any, in target coordinates."""
        drawn: dict[str, Any] = {}
        if target.clamp_tilt_deg > 0.0:
            drawn["clamp_tilt_deg"] = [float(np.degrees(tilt)) for tilt in self.tilt_rad]
        if target.clamp_shift > 0.0:
            drawn["clamp_shift_m"] = list(self.shift_m)
        if self.print_shift_m != (0.0, 0.0):
            drawn["print_shift_m"] = list(self.print_shift_m)
        return drawn

    def on(self, wheel: Wheel) -> Wheel:
        """Return the pose of the target on this wheel, as if it were the wheel's true pose."""
        return replace(wheel, T_vehicle_target=wheel.T_vehicle_target @ self.T_target_mounted)


def draw_mount(target: TargetFile, rng: np.random.Generator) -> Mount:
    """Draw form and mounting of a target; exact values draw nothing."""
    tilt_rad = shift_m = print_m = (0.0, 0.0)
    if target.clamp_tilt_deg > 0.0:
        tilt_rad = _pair(np.radians(target.clamp_tilt_deg), rng)
    if target.clamp_shift > 0.0:
        shift_m = _pair(target.clamp_shift, rng)
    form = draw_form(target.radius_m, target.flatness, rng, _face_m(target))
    if isinstance(target, PatternFile) and target.print_shift > 0.0:
        print_m = _pair(target.print_shift, rng)
    return Mount(tilt_rad, shift_m, form, print_m)


def _face_m(target: TargetFile) -> Array:
    """Return points (N, 2) all over the face."""
    match target:
        case RingFile():
            return ring_m(target.hole_diameter / 2, target.diameter / 2)
        case SquareFile():
            return rectangle_m(target.side, target.side)
        case RectangleFile():
            return rectangle_m(target.width, target.height)
        case PatternFile() if target.width is not None and target.height is not None:
            return rectangle_m(target.width, target.height)
    return ring_m(0.0, target.radius_m)


def _pair(sigma: float, rng: np.random.Generator) -> tuple[float, float]:
    one, other = rng.normal(0.0, sigma, 2)
    return float(one), float(other)


def target_solid(target: TargetFile) -> Solid:
    """Build the target in its own coordinates: front face on z = 0, body at z < 0.

    The facets exactly on z = 0 are flagged as the front face.
    """
    solid = _body(target)
    front = np.all(np.abs(solid.corners_m[:, :, 2]) < 1e-12, axis=1)
    return solid.with_front(front).of("wall")


def _body(target: TargetFile) -> Solid:
    edge = _edge(target)
    match target:
        case RingFile():
            return _round(target.diameter / 2, target.thickness, edge, target.hole_diameter / 2)
        case SquareFile():
            return _square(target, edge)
        case RectangleFile():
            return _rectangle(target.width, target.height, target.thickness, edge)
        case PatternFile() if target.width is not None and target.height is not None:
            return _rectangle(target.width, target.height, target.thickness, edge)
    return _round(target.radius_m, target.thickness, edge)


def _edge(target: TargetFile) -> Array:
    """Return the profile of the face's edges, from the wall to the face: distance from the wall
    and height over the face (K, 2); one point where they are sharp.
    """
    if target.chamfer:
        return np.array([[0.0, -target.chamfer], [target.chamfer, 0.0]])
    if not target.edge_radius:
        return np.zeros((1, 2))
    turn = np.linspace(0.0, np.pi / 2.0, ARC + 1)
    arc = target.edge_radius * np.column_stack([1.0 - np.cos(turn), np.sin(turn) - 1.0])
    arc[-1, 1] = 0.0
    return arc


def _round(radius: float, thickness: float, edge: Array, hole: float = 0.0) -> Solid:
    """Build a disc, or a ring about a hole of that radius."""
    rim = [(radius - x, z) for x, z in edge.tolist()]
    inner = [(hole + x, z) for x, z in edge[::-1].tolist()] if hole > 0.0 else [(hole, 0.0)]
    profile = [(hole, -thickness), (radius, -thickness), *rim, *inner]
    if hole > 0.0:
        profile.append(profile[0])
    return revolved(profile, SECTIONS, REFLECTANCE)


def _rectangle(width: float, height: float, thickness: float, edge: Array) -> Solid:
    half = np.array([width, height]) / 2
    if len(edge) > 1:
        return bevelled(half, thickness, edge, REFLECTANCE)
    return box((*-half, -thickness), (*half, 0.0), REFLECTANCE)


def _square(target: SquareFile, edge: Array) -> Solid:
    """Build four mirrored quarters, each with its hole, whose edges coincide point by point."""
    half, middle = target.side / 2, target.hole_spacing / 2
    hole = target.hole_diameter / 2
    quarter = punched(half, middle, hole, target.thickness, edge, SECTIONS // 4, REFLECTANCE)
    mirrors = [np.diag([u, v, 1.0, 1.0]) for u in (1.0, -1.0) for v in (1.0, -1.0)]
    whole, _ = joined([quarter.placed(mirror) for mirror in mirrors])
    return replace(whole, reflectance=REFLECTANCE)
