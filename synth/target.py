"""The disc that is clamped to the wheel: as made, and as it was clamped."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from synth.form import FLAT, Form, draw_form
from synth.parameters import TargetFile
from synth.solids import Solid, revolved
from synth.vehicle import Wheel, about

Array = npt.NDArray[np.float64]

# The polygon lies within radius * (1 - cos(pi / SECTIONS)) of its circle: 0.3 um at 125 mm.
SECTIONS = 1440


@dataclass(frozen=True)
class Mount:
    """One clamping of one plate.

    The wheel's true plane and centre are z = 0 and the origin of its target coordinates; so are
    the mounting plane and centre of the plate in the plate's own. tilt_rad: about x and y;
    shift_m: along x and y; form: of the face over the mounting plane.
    """

    tilt_rad: tuple[float, float] = (0.0, 0.0)
    shift_m: tuple[float, float] = (0.0, 0.0)
    form: Form = FLAT

    @property
    def T_target_plate(self) -> Array:
        """Pose (4, 4) of the plate in the target coordinates of its wheel."""
        angle = float(np.hypot(*self.tilt_rad))
        pose = np.eye(4)
        if angle > 0.0:
            pose[:3, :3] = about(np.array([*self.tilt_rad, 0.0]) / angle, angle)
        pose[:2, 3] = self.shift_m
        return pose

    def on(self, wheel: Wheel) -> Wheel:
        """Where the plate is on this wheel, as if it were the wheel's true pose."""
        return replace(wheel, T_vehicle_target=wheel.T_vehicle_target @ self.T_target_plate)


def draw_mount(target: TargetFile, rng: np.random.Generator) -> Mount:
    """How a plate came out and was clamped; what is perfect draws nothing."""
    tilt_rad = shift_m = (0.0, 0.0)
    if target.clamp_tilt_deg > 0.0:
        tilt_rad = _pair(np.radians(target.clamp_tilt_deg), rng)
    if target.clamp_shift > 0.0:
        shift_m = _pair(target.clamp_shift, rng)
    return Mount(tilt_rad, shift_m, draw_form(target.diameter / 2, target.flatness, rng))


def _pair(sigma: float, rng: np.random.Generator) -> tuple[float, float]:
    one, other = rng.normal(0.0, sigma, 2)
    return float(one), float(other)


def disc(target: TargetFile) -> Solid:
    """The target in its own coordinates: front face on z = 0 about the origin, body at z < 0.

    The facets of the front face carry the plane z = 0 itself, and its flag.
    """
    radius, depth = target.diameter / 2, -target.thickness
    profile = [(0.0, depth), (radius, depth), (radius, 0.0), (0.0, 0.0)]
    solid = revolved(profile, SECTIONS, reflectance=0.8)
    front = np.all(np.abs(solid.corners_m[:, :, 2]) < 1e-12, axis=1)
    return solid.with_front(front)
