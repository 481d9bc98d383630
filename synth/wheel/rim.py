"""The rim: flange, ledge and barrel, spokes, hub with its cap and nuts, weights and valve."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..parameters.parameters import BareWheel, Body
from ..scene.solids import Solid, box, revolved
from .runout import Wave
from .surface import at_steps, grid_solid, rounded, swept
from .tyre import flange_radius_m

SECTIONS = 1440
ALBEDO = 0.55
NUTS, NUT_CIRCLE_M = 5, 0.056
ALONG, ACROSS = 40, 13  # vertices of a spoke's face


def rim_curve(body: Body, form: BareWheel) -> Array:
    """Return the meridian (K, 2) of radius and z, from the barrel's inner end to the flange.

    The flange's edge, its highest ring, is at z = 0.
    """
    flange = flange_radius_m(body, form)
    corners = [
        (flange - 0.052, -0.80 * body.tyre_width_m),
        (flange - 0.046, -0.055),
        (flange - 0.040, -0.024),
        (flange - 0.030, -0.018),
        (flange - 0.018, -0.013),
        (flange - 0.0105, -0.008),
        (flange - 0.0085, 0.001),
        (flange - 0.0015, 0.001),
        (flange, -0.004),
        (flange, -0.016),
    ]
    curve = at_steps(rounded(np.array(corners)), 0.0012)
    curve[:, 1] -= curve[:, 1].max()
    return curve


def edge_radius_m(body: Body, form: BareWheel) -> float:
    """Return the radius of the flange's edge: of its highest ring."""
    curve = rim_curve(body, form)
    return float(curve[np.argmax(curve[:, 1]), 0])


def rim(
    body: Body,
    form: BareWheel,
    waves: tuple[Wave, Wave],
    rng: np.random.Generator,
    coarse: int = 1,
) -> list[Solid]:
    """Build the rim about its own axis z; waves: lateral and radial, beyond the first harmonic."""
    flange = flange_radius_m(body, form)

    def displace(radius: Array, z: Array, angle: Array) -> tuple[Array, Array]:
        turn = angle[:, 0]
        return radius + waves[1].at(turn)[:, None], z + waves[0].at(turn)[:, None]

    ring = swept(rim_curve(body, form), SECTIONS // coarse, ALBEDO, displace)
    hub_z = -form.dish_m
    parts = [ring, *_hub(hub_z)]
    outer = flange - 0.034
    for number in range(form.spokes):
        parts.append(_spoke(number / form.spokes, hub_z, outer, form.spoke_width_m))
    parts += [_weight(flange, rng) for _ in range(form.weights)]
    parts.append(_valve(flange, (0.5 + rng.integers(form.spokes)) / form.spokes))
    return [part.of("rim") for part in parts]


def _hub(face_m: float) -> list[Solid]:
    profile = [(0.0, face_m - 0.05), (0.076, face_m - 0.05), (0.076, face_m - 0.004),
               (0.072, face_m), (0.0, face_m)]  # fmt: skip
    cap = [(0.0, face_m), (0.031, face_m), (0.029, face_m + 0.004), (0.015, face_m + 0.007),
           (0.0, face_m + 0.008)]  # fmt: skip
    nut = [(0.0, face_m), (0.0095, face_m), (0.0095, face_m + 0.012), (0.0, face_m + 0.012)]
    nuts = []
    for number in range(NUTS):
        pose = np.eye(4)
        turn = 2.0 * np.pi * (number + 0.5) / NUTS
        pose[:2, 3] = NUT_CIRCLE_M * np.cos(turn), NUT_CIRCLE_M * np.sin(turn)
        nuts.append(revolved(nut, 24, 0.4).placed(pose))
    return [revolved(profile, 240, ALBEDO), revolved(cap, 120, 0.3), *nuts]


def _spoke(turn: float, hub_z: float, outer_m: float, width_m: float) -> Solid:
    """Build a spoke with a crowned face and side walls; it widens towards the rim."""
    along = np.linspace(0.06, outer_m, ALONG)
    share = (along - along[0]) / (along[-1] - along[0])
    half = 0.5 * width_m * (0.8 + 0.2 * share**2)
    face = hub_z + (-0.018 - hub_z) * share + 0.006 * np.sin(np.pi * share)
    across = np.linspace(-1.0, 1.0, ACROSS)
    x = np.broadcast_to(along[:, None], (ALONG, ACROSS))
    y = half[:, None] * across
    z = face[:, None] - 0.003 * across**2
    side = np.stack([x[:, :1], y[:, :1], z[:, :1] - 0.02], -1)
    other = np.stack([x[:, -1:], y[:, -1:], z[:, -1:] - 0.02], -1)
    grid = np.concatenate([side, np.stack([x, y, z], -1), other], axis=1)
    return grid_solid(grid, ALBEDO, closed=False).placed(_about_z(turn))


def _weight(flange_m: float, rng: np.random.Generator) -> Solid:
    """Build a clip-on weight over the flange."""
    half = rng.uniform(0.01, 0.025)
    low, high = (flange_m - 0.016, -half, -0.006), (flange_m - 0.001, half, 0.003)
    return box(low, high, 0.4).placed(_about_z(rng.uniform()))


def _valve(flange_m: float, turn: float) -> Solid:
    profile = [(0.0, -0.03), (0.004, -0.03), (0.004, 0.004), (0.0, 0.006)]
    pose = _about_z(turn)
    pose[:3, 3] = pose[:3, 0] * (flange_m - 0.038)
    return revolved(profile, 24, 0.08).placed(pose)


def _about_z(turn: float) -> Array:
    pose = np.eye(4)
    c, s = np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)
    pose[:2, :2] = [[c, -s], [s, c]]
    return pose
