"""Model of a mixed pixel: the range returned near a target's edge by a footprint of finite size.

A beam that meets the target's plane at the signed distance x outside the edge meets: the target
(depth 0); its side wall, where that faces the scanner (depth x / tau, down to the thickness T at
x = T tau); then the background (depth B). tau is the tangent of the incidence against the wall: how
far the beam runs inwards for each metre of depth. The returned range is the mean of that profile
over the footprint, a uniform disc of radius s, weighted by reflectance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...vectors import Array

# Chord distribution of a unit disc: k(u) = 2 sqrt(1-u^2)/pi; F its integral, G the integral of F.
_U = np.linspace(-1.0, 1.0, 4001)
_F = 0.5 + (_U * np.sqrt(1.0 - _U**2) + np.arcsin(_U)) / np.pi
_G = np.concatenate([[0.0], np.cumsum((_F[1:] + _F[:-1]) * 0.5 * (_U[1] - _U[0]))])


@dataclass(frozen=True)
class EdgeProfile:
    """Mean depth (N,) over the footprint, and its derivatives, (N,) each.

    The derivatives are by x, tau, log footprint radius, thickness and log reflectance ratio.
    """

    depth_m: Array
    d_x: Array
    d_tau: Array
    d_log_spot: Array
    d_thickness: Array
    d_log_ratio: Array
    background_share: Array


def edge_profile(
    x_m: Array,
    tau: Array,
    background_m: Array,
    spot_m: Array,
    thickness_m: float,
    reflectance_ratio: float,
) -> EdgeProfile:
    """Return the depth behind the target that a beam at x_m (N,) returns; all (N,), metres.

    reflectance_ratio e: of background over target; each part of the footprint weighs by its own.
    With w = T tau, a = x/s, b = (x - w)/s, the share of the background is F(b), that of the wall
    F(a) - F(b), its mean depth there from the integral of F:
    depth = (T s/w (G(a) - G(b)) - T F(b) + e B F(b)) / (1 - F(b) + e F(b));
    as w -> 0 the first two terms cancel.
    """
    width = np.maximum(thickness_m * tau, 1e-3 * spot_m)  # a narrower wall acts as none
    a, b = x_m / spot_m, (x_m - width) / spot_m
    Fa, Fb, k = spot_share(a), spot_share(b), chord(b) / spot_m
    mean_F = (_integral(a) - _integral(b)) * spot_m / width  # of F over the wall
    light = 1.0 - Fb + reflectance_ratio * Fb
    depth = (thickness_m * (mean_F - Fb) + reflectance_ratio * background_m * Fb) / light
    # The slope of depth by F(b), all else equal; F(b) falls by k for each metre of width.
    by_share = (
        reflectance_ratio * background_m - thickness_m + (1.0 - reflectance_ratio) * depth
    ) / light
    by_mean = thickness_m / light
    d_width = by_mean * (Fb - mean_F) / width - by_share * k
    on_wall = width > 1e-3 * spot_m
    d_width = np.where(on_wall, d_width, 0.0)
    return EdgeProfile(
        depth_m=depth,
        d_x=by_mean * (Fa - Fb) / width + by_share * k,
        d_tau=d_width * thickness_m,
        d_log_spot=by_mean * (mean_F - (a * Fa - b * Fb) * spot_m / width)
        - by_share * k * b * spot_m,
        d_thickness=(mean_F - Fb) / light + d_width * tau,
        d_log_ratio=reflectance_ratio * Fb * (background_m - depth) / light,
        background_share=Fb,
    )


def chord(u: Array) -> Array:
    """Return the derivative of spot_share."""
    return np.asarray(2.0 / np.pi * np.sqrt(np.clip(1.0 - u * u, 0.0, None)))


def spot_share(u: Array) -> Array:
    """Return the share of a footprint of unit radius beyond a straight edge, u outside it: (N,)."""
    return np.asarray(np.interp(u, _U, _F))


def _integral(u: Array) -> Array:
    return np.asarray(np.interp(u, _U, _G) + np.maximum(u - 1.0, 0.0))
