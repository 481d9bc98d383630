"""Flatness deviation of a target's face, as a sum of waves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

WAVES = 6
WAVELENGTHS = (0.6, 2.4)  # in diameters of the target
RINGS, TURNS = 40, 120


@dataclass(frozen=True)
class Form:
    """Height of a face over its mounting plane: a sum of plane waves.

    wave: (K, 2) rad/m; phase: (K,); amplitude_m: (K,). No waves: a flat face.
    """

    wave: Array
    phase: Array
    amplitude_m: Array
    lift_m: float

    def height_m(self, uv_m: Array) -> Array:
        """Return the height (...) at points uv_m (..., 2) of the face, positive outwards."""
        return np.asarray(np.sin(uv_m @ self.wave.T + self.phase) @ self.amplitude_m + self.lift_m)


FLAT = Form(np.zeros((0, 2)), np.zeros(0), np.zeros(0), 0.0)


def draw_form(
    radius_m: float, flatness_m: float, rng: np.random.Generator, face_m: Array | None = None
) -> Form:
    """Draw a smooth form between two planes `flatness_m` apart, parallel to the mounting plane.

    Six waves of any direction and phase, normal amplitudes and lengths between 0.6 and 2.4
    diameters. radius_m: of the smallest circle about the face. face_m: points (N, 2) all over it,
    its edge included; None for a disc. The plane that fits a disc best is tilted about either axis
    by 0.51 * flatness / diameter rms: see tests/synth/test_synth.py.
    """
    if flatness_m == 0.0:
        return FLAT
    turn, phase = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
    length_m = 2.0 * radius_m * rng.uniform(*WAVELENGTHS, WAVES)
    wave = 2.0 * np.pi / length_m[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    raw = Form(wave, phase, rng.standard_normal(WAVES), 0.0)
    height = raw.height_m(ring_m(0.0, radius_m) if face_m is None else face_m)
    low, high = float(height.min()), float(height.max())
    scale = flatness_m / (high - low)
    return Form(wave, phase, raw.amplitude_m * scale, -scale * (low + high) / 2.0)


def ring_m(inner_m: float, outer_m: float) -> Array:
    """Return points (N, 2) over a disc, or a ring, its edges included."""
    reach = inner_m + (outer_m - inner_m) * np.arange(RINGS + 1) / RINGS
    turn = 2.0 * np.pi * np.arange(TURNS) / TURNS
    return np.stack(
        [np.outer(reach, np.cos(turn)).ravel(), np.outer(reach, np.sin(turn)).ravel()], axis=1
    )


def rectangle_m(width_m: float, height_m: float) -> Array:
    """Return points (N, 2) over a rectangle, its edges included."""
    along = np.linspace(-0.5, 0.5, 2 * RINGS + 1)
    u, v = np.meshgrid(width_m * along, height_m * along)
    return np.column_stack([u.ravel(), v.ravel()])
