"""The tyre: its side wall with lettering in relief, flattened and bulged where it stands."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..parameters.parameters import BareWheel, Body
from ..scene.solids import Solid
from .runout import Wave
from .surface import at_steps, rounded, swept

SECTIONS, STEP_M = 1800, 0.0015
LOADED_M = 0.01  # how far the floor flattens the tread
BULGE_RAD = 0.33  # half-length, 1 sigma, of the bulge about the contact patch
LETTER_M, STROKE_M = 0.016, 0.004


def tyre_curve(body: Body, form: BareWheel) -> Array:
    """Return the meridian (K, 2) of radius and z, from behind the flange's edge to the tread."""
    flange, outer = flange_radius_m(body, form), body.tyre_radius_m
    height, out = outer - flange, form.sidewall_out_m
    corners = [
        (flange - 0.006, -0.014),
        (flange + 0.001, -0.010),
        (flange + 0.004, -0.005),
        (flange + 0.10 * height, 0.5 * out),
        (flange + 0.28 * height, out),
        (flange + 0.60 * height, out),
        (flange + 0.80 * height, out - 0.012),
        (outer - 0.002, out - 0.022),
        (outer, out - 0.055),
        (outer, -0.5 * body.tyre_width_m),
        (outer, -0.8 * body.tyre_width_m),
    ]
    return at_steps(rounded(np.array(corners)), STEP_M)


def flange_radius_m(body: Body, form: BareWheel) -> float:
    """Return the outer radius of the rim's flange."""
    return body.rim_diameter_m / 2.0 + form.flange_height_m


def tyre(
    body: Body,
    form: BareWheel,
    waves: tuple[Wave, Wave],
    down_rad: float,
    turn_rad: float,
    words: Array,
    coarse: int = 1,
) -> Solid:
    """Build the tyre in the coordinates of the wheel.

    waves: lateral and radial, turned with the wheel by turn_rad, as the lettering is. down_rad:
    direction of the floor. words: (W, 2) where each word of the lettering starts, and its letters.
    """
    flange = flange_radius_m(body, form)
    height = body.tyre_radius_m - flange

    def displace(radius: Array, z: Array, angle: Array) -> tuple[Array, Array]:
        own = angle - turn_rad
        seated = np.clip((radius - flange) / (0.25 * height), 0.0, 1.0)
        seated = seated * seated * (3.0 - 2.0 * seated)
        wall = np.sin(np.pi * np.clip((radius - flange) / height, 0.0, 1.0)) * (z > -0.03)
        off = np.angle(np.exp(1j * (angle - down_rad)))
        lateral = waves[0].at(own[:, 0])[:, None] * seated
        lateral = lateral + form.bulge_m * wall * np.exp(-0.5 * (off / BULGE_RAD) ** 2)
        lateral += form.letters_m * _letters(radius, own, z, flange + 0.36 * height, words)
        radial = radius + waves[1].at(own[:, 0])[:, None] * seated
        depth = np.cos(off) * radial
        loaded = body.tyre_radius_m - LOADED_M
        radial = np.where(depth > loaded, loaded / np.maximum(np.cos(off), 0.1), radial)
        return radial, z + lateral

    return swept(tyre_curve(body, form), SECTIONS // coarse, 0.06, displace).of("tyre")


def _letters(radius: Array, angle: Array, z: Array, low_m: float, words: Array) -> Array:
    """Return 1 on the strokes of letters above low_m: a stem, a bar, and gaps between."""
    found = np.zeros(radius.shape)
    up = (radius - low_m) / LETTER_M
    band = (up > 0.0) & (up < 1.0) & (z > -0.02)
    for start, count in words:
        along = (np.mod(angle - start, 2.0 * np.pi)) * low_m
        number = np.floor(along / LETTER_M)
        inside = along - number * LETTER_M
        stem = inside < STROKE_M
        bar = (np.abs(up - 0.5 - 0.35 * np.sin(2.4 * number)) < 0.16) & (inside < 0.75 * LETTER_M)
        found[band & (number < count) & (stem | bar)] = 1.0
    return found
