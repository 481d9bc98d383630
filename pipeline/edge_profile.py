"""What range a laser spot of finite size returns near the rim of a plate: the model and its slopes.

A beam that meets the plane of the face at the signed distance x outside the rim sees, in turn: the
face (depth 0); the side wall, if the rim's wall there faces the scanner (depth x / tau, down to the
thickness T at x = T tau); then the background (depth B). tau is the tangent of the incidence
against the wall: how far the beam runs inwards for each metre of depth. The range that comes back
is the mean of that profile over the spot, a uniform disc of radius s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.kernels import Array

# Chord distribution of a unit disc: k(u) = 2 sqrt(1-u^2)/pi; F its integral, G the integral of F.
_U = np.linspace(-1.0, 1.0, 4001)
_F = 0.5 + (_U * np.sqrt(1.0 - _U**2) + np.arcsin(_U)) / np.pi
_G = np.concatenate([[0.0], np.cumsum((_F[1:] + _F[:-1]) * 0.5 * (_U[1] - _U[0]))])


@dataclass(frozen=True)
class EdgeProfile:
    """Mean depth (N,) over the spot, and its derivatives: by x, tau, log s and T, (N,) each."""

    depth_m: Array
    d_x: Array
    d_tau: Array
    d_log_spot: Array
    d_thickness: Array
    background_share: Array


def edge_profile(
    x_m: Array, tau: Array, background_m: Array, spot_m: Array, thickness_m: float
) -> EdgeProfile:
    """Depth behind the face that a beam at x_m (N,) returns; all arrays (N,), metres.

    With w = T tau, a = x/s, b = (x - w)/s:
    depth = T s/w (G(a) - G(b)) + (B - T) F(b); as w -> 0 the first term tends to T F(a).
    """
    width = np.maximum(thickness_m * tau, 1e-3 * spot_m)  # a wall no wider than this acts as none
    a, b = x_m / spot_m, (x_m - width) / spot_m
    Fa, Fb = _share(a), _share(b)
    wall = (_integral(a) - _integral(b)) * spot_m / width  # mean depth on the wall, over T
    step = (background_m - thickness_m) * _chord(b) / spot_m
    d_width = thickness_m * (Fb - wall) / width - step
    on_wall = width > 1e-3 * spot_m
    d_log_spot = thickness_m * (wall - (a * Fa - b * Fb) * spot_m / width) - step * b * spot_m
    return EdgeProfile(
        depth_m=thickness_m * wall + (background_m - thickness_m) * Fb,
        d_x=thickness_m * (Fa - Fb) / width + step,
        d_tau=np.where(on_wall, d_width * thickness_m, 0.0),
        d_log_spot=d_log_spot,
        d_thickness=wall - Fb + np.where(on_wall, d_width * tau, 0.0),
        background_share=Fb,
    )


def _chord(u: Array) -> Array:
    return np.asarray(2.0 / np.pi * np.sqrt(np.clip(1.0 - u * u, 0.0, None)))


def _share(u: Array) -> Array:
    return np.asarray(np.interp(u, _U, _F))


def _integral(u: Array) -> Array:
    return np.asarray(np.interp(u, _U, _G) + np.maximum(u - 1.0, 0.0))
