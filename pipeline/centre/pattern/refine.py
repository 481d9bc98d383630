"""Positions of printed features by least squares on the intensities of the points about each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...system import frozen
from ...vectors import Array
from ..edge.mixed_pixel import chord, spot_share

MIN_POINTS = 16  # points about a feature
MAX_STEPS, STEP_OF_BLUR = 30, 1e-4
MIN_CONTRAST = 2.0  # of the edge, over the scatter of the intensities


@frozen(eq=False)
class Shading:
    """Basis (N, T) of a feature's intensity about its centre, and its derivatives by u and v.

    The intensity is any linear combination of the terms, so either polarity is covered.
    """

    terms: Array
    by_u: Array
    by_v: Array


Shade = Callable[[Array, Array], Shading]  # of points (N, 2) about the centre, and blur (N,)


def round_spot(radius_m: float) -> Shade:
    """Return the shading of a circle of one intensity on a ground of another."""

    def shade(q: Array, blur: Array) -> Shading:
        reach = np.maximum(np.hypot(q[:, 0], q[:, 1]), 1e-9)
        x = (reach - radius_m) / blur
        slope = (chord(x) / blur / reach)[:, None] * q
        flat = np.zeros(len(q))
        return Shading(
            np.column_stack([np.ones(len(q)), spot_share(x)]),
            np.column_stack([flat, slope[:, 0]]),
            np.column_stack([flat, slope[:, 1]]),
        )

    return shade


def crossing(rotation_rad: float) -> Shade:
    """Return the shading of two crossing straight edges, along axes rotated by rotation_rad."""
    c, s = np.cos(rotation_rad), np.sin(rotation_rad)
    a, b = np.array([c, s]), np.array([-s, c])

    def shade(q: Array, blur: Array) -> Shading:
        (A, dA), (B, dB) = (
            (spot_share(q @ axis / blur), chord(q @ axis / blur) / blur) for axis in (a, b)
        )
        one, flat = np.ones(len(q)), np.zeros(len(q))
        along = [
            np.column_stack([flat, dA * a[k], dB * b[k], dA * B * a[k] + A * dB * b[k]])
            for k in (0, 1)
        ]
        return Shading(np.column_stack([one, A, B, A * B]), along[0], along[1])

    return shade


def place_feature(q: Array, intensity: Array, blur: Array, shade: Shade) -> Array | None:
    """Locate a feature (2,) by the intensities (N,) at q (N, 2) about its expected position.

    blur: (N,) half the width over which the footprint smears an edge. Gauss-Newton on the position,
    with the intensities eliminated at each step (variable projection: Golub, Pereyra, SIAM J.
    Numer. Anal. 10 (1973) 413). None where the points show no such feature.
    """
    if len(q) < MIN_POINTS:
        return None
    position = np.zeros(2)
    for _ in range(MAX_STEPS):
        shading = shade(q - position, blur)
        level, *_ = np.linalg.lstsq(shading.terms, intensity, rcond=None)
        residual = intensity - shading.terms @ level
        slopes = -np.column_stack([shading.by_u @ level, shading.by_v @ level])
        # The part of the slopes that the intensities cannot absorb.
        free = slopes - shading.terms @ np.linalg.lstsq(shading.terms, slopes, rcond=None)[0]
        information = free.T @ free
        if np.linalg.cond(information) > 1e4:
            return None
        step = np.linalg.solve(information, free.T @ residual)
        longest = float(np.abs(step).max())
        position = position + step * min(1.0, 0.5 * float(blur.mean()) / max(longest, 1e-12))
        if longest < STEP_OF_BLUR * float(blur.mean()):
            break
    scatter = float(np.sqrt(np.mean(residual**2)))
    contrast = float(np.ptp(shading.terms @ level))
    return position if contrast > MIN_CONTRAST * scatter and longest < 0.1 * blur.mean() else None
