"""Solids of a wheel in target coordinates: tyre, rim, hub, brake disc, the target's adapter."""

from __future__ import annotations

import numpy as np

from ..errors import SynthError
from ..parameters.parameters import Body
from ..parameters.plate_file import TargetFile
from ..scene.solids import Solid, box, revolved
from .vehicle import Wheel


def check_wheel(body: Body, wheel: Wheel, target: TargetFile) -> None:
    """Raise SynthError if the sizes of wheel and target do not fit."""
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


def adapter(wheel: Wheel, target: TargetFile) -> list[Solid]:
    """Build a shaft from the hub to the back of the target, with a flange behind it.

    For a target with an open centre: a tube about the opening.
    """
    back, hub = -target.thickness, -wheel.stand_off_m - 0.02
    flange = back - 0.008
    inner, outer = target.open_m
    if inner > 0.0:
        profile = [(inner, hub), (outer, hub), (outer, back), (inner, back), (inner, hub)]
        return [revolved(profile, 180, reflectance=0.4)]
    shaft = min(0.03, 0.6 * outer)
    profile = [(0.0, hub), (shaft, hub), (shaft, flange), (outer, flange), (outer, back),
               (0.0, back)]  # fmt: skip
    return [revolved(profile, 90, reflectance=0.4)]


def rolling(body: Body, wheel: Wheel) -> list[Solid]:
    """Build tyre, rim barrel, hub, spokes and brake disc, inboard of the sidewall plane."""
    out = -wheel.stand_off_m
    rim, width = body.rim_diameter_m / 2, body.tyre_width_m
    face = out - 0.02
    spokes = [_spoke(k / max(body.spokes, 1), face, rim) for k in range(body.spokes)]
    barrel = [(rim - 0.014, face), (rim + 0.002, face + 0.006), (rim + 0.002, out - width),
              (rim - 0.014, out - width), (rim - 0.014, face)]  # fmt: skip
    rim_parts = [
        revolved(barrel, 240, reflectance=0.55),
        _cylinder(0.075, face - 0.05, face, reflectance=0.55),
        _cylinder(0.15, out - 0.11, out - 0.09, reflectance=0.35),
        *spokes,
    ]
    return [_tyre(body, out).of("tyre"), *(part.of("rim") for part in rim_parts)]


def _tyre(body: Body, out_m: float) -> Solid:
    """Build a tyre of section |r|^4 + |z|^4 = 1, smooth, so that its facets are no edges."""
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
