"""Model of a mixed pixel: the range returned near a target's edge by a footprint of finite size.

A beam that meets the target's plane at the signed distance x outside the edge meets: the target
(depth 0); the chamfer of its edge, 45 degrees and c wide (depth (x + c) / (1 + tau), from x = -c to
x = c tau); its side wall, where that faces the scanner (depth x / tau, down to the thickness T at
x = T tau); then the background (depth B). tau is the tangent of the incidence against the wall: how
far the beam runs inwards for each metre of depth. The returned range is the mean of that profile
over the footprint, weighted by reflectance: of the target 1, of the wall and of the background
their own. The footprint's profile lies between a uniform disc of radius s and the Gaussian
exp(-2 (r/s)^2), whose standard deviations across an edge are the same, s/2.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from ...system import frozen
from ...vectors import Array

UNIFORM, GAUSSIAN = 0.0, 1.0
HIDDEN = -0.999  # slope of beams along a chamfer
# Width of the chamfer for which a rounded edge is taken, measured, and of the one that leaves as
# much material, of its radius.
TAKEN_FOR, AS_MUCH = 0.7, float(np.sqrt(2.0 - np.pi / 2.0))
EITHER = 0.5  # roundness of an edge that may be either
LEAST_MODULATION = 1e-2  # 1/m^2, of 60 m; less is developed about 0
LEAST_LIGHT = 1e-6  # of a footprint's, where returns cancel, or none is near
END, _STEPS = 2.0, 8000  # of the tables, in radii on both sides


@frozen
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
        disc = 2.0 / np.pi * np.sqrt(square)
        return Footprint(
            share=places.between(self._tables[0]),
            integral=places.between(self._tables[1]) + np.maximum(u - END, 0.0),
            density=(1.0 - self.shape) * disc + self.shape * bell,
            moment=(1.0 - self.shape) * (square * disc / 3.0) + self.shape * bell / 4.0,
            share_by_shape=places.between(_BY_SHAPE[0]),
            integral_by_shape=places.between(_BY_SHAPE[1]),
        )

    def moment_by_shape(self, u: Array) -> Array:
        """Return the derivative (N,) of a footprint's moment at u by the shape."""
        square = np.clip(1.0 - u * u, 0.0, None)
        return np.asarray(_bell(u) / 4.0 - square * chord(u) / 3.0)

    @cached_property
    def _tables(self) -> tuple[_Table, _Table]:
        return _Table.of(_mixed(_F, self.shape)), _Table.of(_mixed(_G, self.shape))


@lru_cache(maxsize=8)
def profile_of(shape: float) -> Profile:
    """Return a profile, whose tables are made once."""
    return Profile(shape)


@frozen(eq=False)
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


@frozen(eq=False)
class _Table:
    """Values (K,) over _U, and by how much each is below the next (K - 1,)."""

    values: Array
    rises: Array

    @classmethod
    def of(cls, values: Array) -> _Table:
        return cls(values, np.diff(values))


class _Places:
    """Places (N,) in tables over _U, between which these are interpolated; their ends beyond."""

    def __init__(self, u: Array) -> None:
        place = np.clip((u + END) * (_STEPS / (2.0 * END)), 0.0, _STEPS - 1e-9)
        self._row = place.astype(np.intp)
        self._beyond = place - self._row

    def between(self, table: _Table) -> Array:
        """Interpolate a table linearly."""
        beyond = self._beyond * table.rises.take(self._row)
        return np.asarray(table.values.take(self._row) + beyond)


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
_BY_SHAPE = _Table.of(_F[1] - _F[0]), _Table.of(_G[1] - _G[0])


@frozen(eq=False)
class EdgeProfile:
    """Mean depth (N,) over the footprint, and its derivatives, (N,) each.

    The derivatives are by x, tau, log footprint radius, thickness, log reflectance ratio of the
    background, reflectance of the wall, shape of the footprint, chamfer, its lean (d_tau: of the
    wall), its reflectance, modulation, and, of a target alone, slant.
    background_share: of the footprint; by_background: by the depth of the background, its share of
    what is returned where ranges are averaged.
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
    by_background: Array
    d_chamfer: Array | float = 0.0
    d_lean: Array | float = 0.0
    d_bevel: Array | float = 0.0
    d_modulation: Array | float = 0.0
    d_slant: Array | float = 0.0


@frozen(eq=False)
class Sum:
    """Measured range (N,) of two returns in one footprint, and its derivatives, (N,) each.

    share: of the farther one. by_share; by_far, by its range; by_near: by that of the nearer one,
    over its share; by_modulation.
    """

    range_m: Array
    share: Array
    by_share: Array
    by_far: Array
    by_near: Array
    by_modulation: Array | float = 0.0


def mean_of(share: Array, near_m: Array, far_m: Array) -> Sum:
    """Return the mean of two ranges (N,), of which the farther one has a share."""
    apart_m = far_m - near_m
    return Sum(near_m + share * apart_m, share, apart_m, share, np.ones_like(share))


def sum_of_phases(share: Array, near_m: Array, far_m: Array, modulation: float) -> Sum:
    """Return the range that a phase-shift scanner measures of two (N,); share: of the farther one.

    modulation: square of the phase per metre, 1/m^2, of the shortest modulation. Its vectors add;
    longer ones, which add nearly as the ranges' mean, resolve its ambiguity. Near 0, and below it,
    by the third cumulant of both ranges.
    Source: Godbaz, Cree and Dorrington, Remote Sensing 4 (2012) 21.
    """
    b, a, D = share, 1.0 - share, far_m - near_m
    if modulation < LEAST_MODULATION:
        skew, square = D**3 * b * a * (a - b) / 6.0, modulation * D * D
        return Sum(
            range_m=near_m + b * D - modulation * skew,
            share=b,
            by_share=D * (1.0 - square * (1.0 - 6.0 * a * b) / 6.0),
            by_far=b * (1.0 - square * a * (a - b) / 2.0),
            by_near=1.0 + square * b * (a - b) / 2.0,
            by_modulation=-skew,
        )
    wave = np.sqrt(modulation)
    sine, cosine = np.sin(wave * D), np.cos(wave * D)
    level, upright = a + b * cosine, b * sine
    square = np.maximum(level**2 + upright**2, LEAST_LIGHT)
    mean = wave * b * D
    beyond = np.arctan2(upright, level) - mean
    apart_m = (mean + beyond - 2.0 * np.pi * np.rint(beyond / (2.0 * np.pi))) / wave
    by_far = b * (b + a * cosine) / square
    return Sum(
        range_m=near_m + apart_m,
        share=b,
        by_share=sine / (wave * square),
        by_far=by_far,
        by_near=level / square,
        by_modulation=(D * by_far - apart_m) / (2.0 * modulation),
    )


def rounded(tau: Array, roundness: float) -> tuple[float, Array, Array | float]:
    """Return width, lean at slopes tau (N,) and its derivative of the chamfer in an edge's place.

    roundness: 0 of a chamfer of width 1; 1 of the radius that is taken for it, 1 / TAKEN_FOR: the
    chamfer then leaves as much material, and ends on the far side where beams touch the round, by
    1 - cos a + (1 - sin a) tan a of the radius inside a sharp edge, at an incidence of a.
    """
    if roundness == 0.0:
        return 1.0, tau, 1.0
    far = np.maximum(-tau, 0.0)
    cosine = 1.0 / np.sqrt(1.0 + far**2)
    flat = 1.0 - far * cosine
    width = 1.0 + roundness * (AS_MUCH / TAKEN_FOR - 1.0)
    part = roundness / (TAKEN_FOR * width)
    touched = 1.0 - cosine + flat * far
    lean = tau - part * (touched - AS_MUCH * far)
    return width, lean, np.where(far > 0.0, 1.0 + part * (flat - AS_MUCH), 1.0)


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
    chamfer_m: float = 0.0,
    bevel: Array | float = 1.0,
    modulation: float | None = None,
    lean: Array | None = None,
    alone: bool = False,
) -> EdgeProfile:
    """Return the depth behind the target that a beam at x_m (N,) returns; all (N,), metres.

    Edges of the surfaces lie at x_0 = -c, the face's, x_1 = c tau, the chamfer's, and x_2, that of
    the wall, T tau where it faces the scanner. Of F and its integral G at (x - x_i)/s, the means of
    F over the chamfer and the wall are M_01 and M_12, M_ij = s/(x_j - x_i) (G_i - G_j). With the
    reflectances b, o and e of chamfer, wall and background over that of the face
    depth = (b c (M_01 - F_1) + o (c (F_1 - F_2) + (T - c) (M_12 - F_2)) + e B F_2) /
    (1 - F_0 + b (F_0 - F_1) + o (F_1 - F_2) + e F_2),
    which is smooth in c about 0, also below. From tau = -1 on the chamfer is hidden.
    lean: of the chamfer, where it is not tau, as of a rounded edge, see `rounded`.
    modulation: None: ranges are averaged; else what lies near and the background add as
    `sum_of_phases`: depths of millimetres add as their mean, decimetres do not.
    slant: by which a surface parallel to the target is deeper per distance inwards from the beam's
    axis. Parts of the footprint lie beside it; where all are of one brightness that cancels.
    alone: whether nothing that returns lies behind the target. Its edges are then where most of the
    brightness changes: what lies beside counts in all slopes; else it does in that by x.
    """
    c, T, e, o, b = chamfer_m, thickness_m, reflectance_ratio, wall, bevel
    lean = tau if lean is None else lean
    seen = np.maximum(lean, HIDDEN)
    run, facing = 1.0 + seen, np.maximum(tau, 0.0)
    width = np.maximum((T - c) * facing, 1e-3 * spot_m)  # a narrower wall acts as none
    x_1 = x_m - c * seen
    spot = profile_of(shape)
    at_0, at_2 = (spot.at(x / spot_m) for x in (x_m + c, x_1 - width))
    at = at_0, at_0 if c == 0.0 else spot.at(x_1 / spot_m), at_2
    F_0, F_1, F_2 = (one.share for one in at)
    f_0, f_1, f_2 = (one.density / spot_m for one in at)
    m_0, m_1, m_2 = (slant * spot_m * one.moment for one in at)
    H = (at[0].integral - at[1].integral) * spot_m  # c (1 + tau) M_01
    M = (at[1].integral - at[2].integral) * spot_m / width
    near, far = 1.0 - F_0 + b * (F_0 - F_1) + o * (F_1 - F_2), e * F_2
    light = near + far
    on_bevel, on_wall = H / run - c * F_1, c * (F_1 - F_2) + (T - c) * (M - F_2)
    beside = (1.0 - b) * m_0 + (b - o) * m_1 + (o - e) * m_2
    summed_m = b * on_bevel + o * on_wall + beside
    near_m = np.where(near > LEAST_LIGHT, summed_m, 0.0) / np.maximum(near, LEAST_LIGHT)
    if modulation is None:
        measured = mean_of(far / light, near_m, background_m)
    else:
        measured = sum_of_phases(far / light, near_m, background_m, modulation)
    # By the sum of near depths, less by near light, and by far light.
    by_sum = measured.by_near / light
    by_near = near_m * by_sum + measured.by_share * measured.share / light
    by_far = measured.by_share * (1.0 - measured.share) / light
    by_F_0, by_F_1 = (1.0 - b) * by_near, (b - o) * (by_near - c * by_sum)
    by_F_2 = e * by_far - o * (T * by_sum - by_near)
    by_H, by_M = by_sum * (b / run), by_sum * (o * (T - c))

    def change(d_F: tuple[Array, ...], d_H: Array, d_M: Array) -> Array:
        """Return the depth's change with F_0, F_1, F_2, H and M, (N,) each."""
        by_F = by_F_0 * d_F[0] + by_F_1 * d_F[1] + by_F_2 * d_F[2]
        return np.asarray(by_F + by_H * d_H + by_M * d_M)

    d_width = np.where(width > 1e-3 * spot_m, by_M * ((F_2 - M) / width) - by_F_2 * f_2, 0.0)
    d_x_1 = by_H * F_1 + by_M * ((F_2 - F_1) / width) - by_F_1 * f_1 - by_F_2 * f_2
    tilted = (1.0 - b) * (x_m + c) * f_0 + (b - o) * x_1 * f_1 + (o - e) * (x_1 - width) * f_2
    profile = EdgeProfile(
        depth_m=measured.range_m,
        d_x=change((f_0, f_1, f_2), F_0 - F_1, (F_1 - F_2) / width) - slant * tilted * by_sum,
        d_tau=d_width * (T - c),
        d_log_spot=change(
            (-(x_m + c) * f_0, -x_1 * f_1, -(x_1 - width) * f_2),
            H - ((x_m + c) * F_0 - x_1 * F_1),
            M - (x_1 * F_1 - (x_1 - width) * F_2) / width,
        ),
        d_thickness=o * (M - F_2) * by_sum + d_width * facing,
        d_log_ratio=e * (F_2 * by_far - m_2 * by_sum),
        d_wall=(on_wall + m_2 - m_1) * by_sum - by_near * (F_1 - F_2),
        d_shape=change(
            tuple(one.share_by_shape for one in at),
            (at[0].integral_by_shape - at[1].integral_by_shape) * spot_m,
            (at[1].integral_by_shape - at[2].integral_by_shape) * (spot_m / width),
        ),
        background_share=F_2,
        by_background=measured.by_far,
        d_chamfer=by_F_0 * f_0
        + by_H * F_0
        + seen * d_x_1
        - facing * d_width
        + (o * (F_1 - M) - b * F_1) * by_sum,
        d_lean=np.where(lean > HIDDEN, c * d_x_1 - b * H / run**2 * by_sum, 0.0),
        d_bevel=(on_bevel + m_1 - m_0) * by_sum - by_near * (F_0 - F_1),
        d_modulation=measured.by_modulation,
    )
    if not alone:
        return profile
    # By where the edges of face, chamfer and wall lie, and by the footprint's size and shape.
    places = x_m + c, x_1, x_1 - width
    steps = [by_sum * step for step in (1.0 - b, b - o, o - e)]
    by_0, by_1, by_2 = (
        slant * step * x * f for step, x, f in zip(steps, places, (f_0, f_1, f_2), strict=True)
    )
    by_2_wide = np.where(width > 1e-3 * spot_m, by_2, 0.0)
    moments = [spot_m * spot.moment_by_shape(x / spot_m) for x in places]
    return replace(
        profile,
        d_tau=profile.d_tau + by_2_wide * (T - c),
        d_log_spot=profile.d_log_spot
        + (by_0 * places[0] + by_1 * places[1] + by_2 * places[2] + beside * by_sum),
        d_thickness=profile.d_thickness + facing * by_2_wide,
        d_shape=profile.d_shape
        + slant * sum(step * moment for step, moment in zip(steps, moments, strict=True)),
        d_chamfer=profile.d_chamfer + (seen * (by_1 + by_2) - by_0 - facing * by_2_wide),
        d_lean=profile.d_lean + np.where(lean > HIDDEN, c * (by_1 + by_2), 0.0),
        d_slant=spot_m * sum(step * one.moment for step, one in zip(steps, at, strict=True)),
    )
