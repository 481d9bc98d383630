"""Model of a mixed pixel: the range returned near a target's edge by a footprint of finite size.

A beam that meets the target's plane at the signed distance x outside the edge meets: the target
(depth 0); its side wall, where that faces the scanner (depth x / tau, down to the thickness T at
x = T tau); then the background (depth B). tau is the tangent of the incidence against the wall: how
far the beam runs inwards for each metre of depth. The returned range is the mean of that profile
over the footprint, weighted by reflectance: of the target 1, of the wall and of the background
their own. The footprint's profile lies between a uniform disc of radius s and the Gaussian
exp(-2 (r/s)^2), whose standard deviations across an edge are the same, s/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ...vectors import Array

UNIFORM, GAUSSIAN = 0.0, 1.0
END, _STEPS = 2.0, 8000  # of the tables, in radii on both sides


@dataclass(frozen=True)
class Profile:
    """Shares of a footprint of unit radius beyond a straight edge, u outside it.

    shape: 0 of a uniform disc, 1 of a Gaussian; a share between is a mixture of both.
    """

    shape: float

    def share(self, u: Array) -> Array:
        """Return the share F beyond the edge (N,)."""
        return _Places(u).between(self._tables[0])

    def at(self, u: Array) -> Footprint:
        """Return all that a profile tells at u (N,)."""
        places, bell = _Places(u), _bell(u)
        square = np.clip(1.0 - u * u, 0.0, None)
        disc = 2.0 / (3.0 * np.pi) * square**1.5
        return Footprint(
            share=places.between(self._tables[0]),
            integral=places.between(self._tables[1]) + np.maximum(u - END, 0.0),
            density=(1.0 - self.shape) * (2.0 / np.pi * np.sqrt(square)) + self.shape * bell,
            moment=(1.0 - self.shape) * disc + self.shape * bell / 4.0,
            share_by_shape=places.between(_BY_SHAPE[0]),
            integral_by_shape=places.between(_BY_SHAPE[1]),
        )

    @cached_property
    def _tables(self) -> tuple[Array, Array]:
        return _mixed(_F, self.shape), _mixed(_G, self.shape)


@lru_cache(maxsize=8)
def profile_of(shape: float) -> Profile:
    """Return a profile, whose tables are made once."""
    return Profile(shape)


@dataclass(frozen=True)
class Footprint:
    """Shares of a footprint of unit radius beyond straight edges, (N,) each.

    share: F, beyond the edge; integral: of F from afar to there; density: derivative of F; moment:
    the part beyond the edge times its mean distance from the middle. by_shape: derivatives.
    """

    share: Array
    integral: Array
    density: Array
    moment: Array
    share_by_shape: Array
    integral_by_shape: Array


def chord(u: Array) -> Array:
    """Return the share of a uniform disc of unit radius per distance across it, at u (N,)."""
    return np.asarray(2.0 / np.pi * np.sqrt(np.clip(1.0 - u * u, 0.0, None)))


def spot_share(u: Array) -> Array:
    """Return the share of a uniform disc of unit radius beyond a straight edge, u outside it."""
    return Profile(UNIFORM).share(u)


def _bell(u: Array) -> Array:
    """Return the same as `chord` of a Gaussian, to two radii."""
    return np.asarray(np.where(np.abs(u) < END, np.exp(-2.0 * u * u) * np.sqrt(2.0 / np.pi), 0.0))


def _mixed(pair: Array, shape: float) -> Array:
    return np.asarray((1.0 - shape) * pair[0] + shape * pair[1])


class _Places:
    """Places (N,) in tables over _U, between which these are interpolated; their ends beyond."""

    def __init__(self, u: Array) -> None:
        place = np.clip((u + END) * (_STEPS / (2.0 * END)), 0.0, _STEPS - 1e-9)
        self._row = place.astype(np.intp)
        self._next, self._beyond = self._row + 1, place - self._row

    def between(self, table: Array) -> Array:
        """Interpolate a table linearly."""
        below = table[self._row]
        return np.asarray(below + self._beyond * (table[self._next] - below))


# F of both profiles and G, the integral of F; (2, K) each.
_U = np.linspace(-END, END, _STEPS + 1)
_INNER = np.clip(_U, -1.0, 1.0)
_BELLS = np.concatenate([[0.0], np.cumsum((_bell(_U)[1:] + _bell(_U)[:-1]) * END / _STEPS)])
_F = np.stack(
    [0.5 + (_INNER * np.sqrt(1.0 - _INNER**2) + np.arcsin(_INNER)) / np.pi, _BELLS / _BELLS[-1]]
)
_G = np.concatenate(
    [np.zeros((2, 1)), np.cumsum((_F[:, 1:] + _F[:, :-1]) * (END / _STEPS), axis=1)], axis=1
)
_BY_SHAPE = _F[1] - _F[0], _G[1] - _G[0]


@dataclass(frozen=True)
class EdgeProfile:
    """Mean depth (N,) over the footprint, and its derivatives, (N,) each.

    The derivatives are by x, tau, log footprint radius, thickness, log reflectance ratio of the
    background, reflectance of the wall, and shape of the footprint. background_share: of the
    footprint; background_light: of what is returned.
    """

    depth_m: Array
    d_x: Array
    d_tau: Array
    d_log_spot: Array
    d_thickness: Array
    d_log_ratio: Array
    d_wall: Array
    d_shape: Array
    background_share: Array
    background_light: Array


def edge_profile(
    x_m: Array,
    tau: Array,
    background_m: Array,
    spot_m: Array,
    thickness_m: float,
    reflectance_ratio: Array | float,
    wall: Array | float = 1.0,
    shape: float = UNIFORM,
    slant: Array | float = 0.0,
) -> EdgeProfile:
    """Return the depth behind the target that a beam at x_m (N,) returns; all (N,), metres.

    reflectance_ratio e: of background over target, wall o: of wall over target. With w = T tau,
    a = x/s, b = (x - w)/s, the share of the background is F(b), that of the wall F(a) - F(b), its
    mean depth there from M = s/w (G(a) - G(b)), the mean of F over the wall:
    depth = (o T (M - F(b)) + e B F(b)) / (1 - F(a) + o (F(a) - F(b)) + e F(b)).
    slant: by which a surface parallel to the target is deeper per distance inwards from the beam's
    axis. Parts of the footprint lie beside it; where all are of one brightness that cancels.
    """
    width = np.maximum(thickness_m * tau, 1e-3 * spot_m)  # a narrower wall acts as none
    a, b = x_m / spot_m, (x_m - width) / spot_m
    spot = profile_of(shape)
    at_a, at_b = spot.at(a), spot.at(b)
    Fa, Fb = at_a.share, at_b.share
    fa, fb = at_a.density / spot_m, at_b.density / spot_m
    M = (at_a.integral - at_b.integral) * spot_m / width
    e, o, T = reflectance_ratio, wall, thickness_m
    light = 1.0 - Fa + o * (Fa - Fb) + e * Fb
    m_a, m_b = slant * spot_m * at_a.moment, slant * spot_m * at_b.moment
    depth = (o * T * (M - Fb) + e * background_m * Fb + (1.0 - o) * m_a + (o - e) * m_b) / light

    def change(d_Fa: Array | float, d_Fb: Array | float, d_M: Array | float) -> Array:
        """Return the depth's change with F(a), F(b) and M, (N,) each."""
        by_a, by_b = depth * (1.0 - o), e * (background_m - depth) - o * (T - depth)
        return np.asarray((by_a * d_Fa + by_b * d_Fb + o * T * d_M) / light)

    d_width = np.where(width > 1e-3 * spot_m, change(0.0, -fb, (Fb - M) / width), 0.0)
    return EdgeProfile(
        depth_m=depth,
        d_x=change(fa, fb, (Fa - Fb) / width)
        - slant * ((1.0 - o) * x_m * fa + (o - e) * (x_m - width) * fb) / light,
        d_tau=d_width * T,
        d_log_spot=change(-x_m * fa, -b * spot_m * fb, M - (a * Fa - b * Fb) * spot_m / width),
        d_thickness=o * (M - Fb) / light + d_width * tau,
        d_log_ratio=e * (Fb * (background_m - depth) - m_b) / light,
        d_wall=(T * (M - Fb) - depth * (Fa - Fb) + m_b - m_a) / light,
        d_shape=change(
            at_a.share_by_shape,
            at_b.share_by_shape,
            (at_a.integral_by_shape - at_b.integral_by_shape) * (spot_m / width),
        ),
        background_share=Fb,
        background_light=e * Fb / light,
    )
