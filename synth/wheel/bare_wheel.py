"""One bare wheel, drawn: its spin axis, the rim's own axis, and its solids."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..parameters.parameters import BareWheel, Body
from ..parameters.recipe import Recipe
from ..scene.solids import Solid
from ..scene.target import Mount
from ..vehicle.vehicle import UP, Wheel, about
from .brake import brake
from .rim import edge_radius_m, rim
from .runout import Wave, draw_wave
from .tyre import flange_radius_m, tyre, tyre_curve


@dataclass(frozen=True)
class DrawnWheel:
    """A wheel in its own coordinates: z the spin axis, the origin level with the flange's edge.

    rim_waves, tyre_waves: lateral and radial; words: of the lettering. seed: of its small parts,
    which are the same in all scans of the wheel.
    """

    form: BareWheel
    body: Body
    rim_waves: tuple[Wave, Wave]
    tyre_waves: tuple[Wave, Wave]
    words: Array = field(repr=False)
    seed: int = 0

    @property
    def edge_m(self) -> float:
        """Radius of the flange's edge."""
        return edge_radius_m(self.body, self.form)

    @property
    def widest_m(self) -> float:
        """Height of the tyre's widest ring over the flange's edge."""
        return float(tyre_curve(self.body, self.form)[:, 1].max())

    @property
    def tilt_rad(self) -> tuple[float, float]:
        """Tilt of the rim's own axis about x and y, by the first harmonic of its run-out."""
        cos, sin = (self.rim_waves[0].first / self.edge_m).tolist()
        return sin, -cos

    @property
    def shift_m(self) -> tuple[float, float]:
        """Shift of the rim's own axis along x and y."""
        x, y = self.rim_waves[1].first.tolist()
        return x, y

    @property
    def T_wheel_rim(self) -> Array:
        """Pose (4, 4) of the rim's own axis: the first harmonics of its run-out."""
        tilt = np.array([*self.tilt_rad, 0.0])
        angle = float(np.linalg.norm(tilt))
        pose = np.eye(4)
        pose[:2, 3] = self.shift_m
        if angle > 0.0:
            pose[:3, :3] = about(tilt / angle, angle)
        return pose

    @property
    def mount(self) -> Mount:
        """The rim on its wheel, as if it were a target mounted there."""
        return Mount(self.tilt_rad, self.shift_m)

    def solids(self, wheel: Wheel, turn_rad: float = 0.0, coarse: int = 1) -> list[Solid]:
        """Build the wheel, turned about its spin axis, in the coordinates of `wheel`.

        coarse: how many times fewer facets it has about its axis.
        """
        down = -UP @ wheel.T_vehicle_target[:3, :2]
        down_rad = float(np.arctan2(down[1], down[0]))
        rng = np.random.default_rng(self.seed)
        waves = (self.rim_waves[0].beyond_first, self.rim_waves[1].beyond_first)
        pose = np.eye(4)
        pose[:3, :3] = about(np.array([0.0, 0.0, 1.0]), turn_rad)
        pose = pose @ self.T_wheel_rim
        own = rim(self.body, self.form, waves, rng, coarse)
        form = (self.body, self.form, self.tyre_waves)
        rubber = tyre(*form, down_rad, turn_rad, self.words, coarse)
        return [
            rubber,
            *(part.placed(pose) for part in own),
            *brake(-self.form.dish_m, down_rad),
        ]


def draw_bare_wheel(body: Body, recipe: Recipe, rng: np.random.Generator) -> DrawnWheel:
    """Draw the form of a wheel, its run-out and its lettering."""
    form = recipe.draw("bare_wheel", BareWheel, rng)
    if flange_radius_m(body, form) + 0.03 > body.tyre_radius_m:
        from ..errors import SynthError

        raise SynthError(
            f"body.tyre_radius_m {body.tyre_radius_m}: leaves less than 30 mm of side wall; make "
            "the tyre larger or the rim smaller"
        )
    rims = draw_wave(form.rim_runout_m, rng), draw_wave(form.rim_runout_m, rng)
    tyres = draw_wave(form.tyre_runout_m, rng), draw_wave(form.tyre_runout_m, rng)
    starts = rng.uniform(0.0, np.pi) + np.array([0.0, np.pi]) + rng.uniform(-0.3, 0.3, 2)
    words = np.column_stack([starts, rng.integers(5, 12, 2)])
    return DrawnWheel(form, body, rims, tyres, words, int(rng.integers(2**31)))
