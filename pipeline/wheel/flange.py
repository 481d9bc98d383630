"""Flange and side wall on the meridian of a wheel: the flange's edge, the groove beside it."""

from __future__ import annotations

import math

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask
from .cells import CellPoints, Grid, medians
from .fit_axis import AxisFit
from .meridian import MAD, Meridian

FINE_M = 0.002  # widest ring on which a flange stands out
LEAST_M, MOST_M, SIGMAS = 0.0015, 0.02, 2.5  # depth of the groove between flange and side wall
RIVAL = 0.65  # of the clearest groove: another that may be the flange's
MEDIAN_LOSS = 1.25  # standard deviation of a median over that of a mean
FLANGE_M, WALL_M = 0.014, 0.050  # widths of the flange and of the side wall's inner half
WALL = (0.13, 0.41)  # height of a side wall over the tyre's radius
BULGE = 0.6  # of the tyre's radius: outside it are the rim's edge, side wall and shoulder
APEX = (0.3, 0.85)  # of the way from there to the tyre's radius: 0.45 to 0.74 of 290 wheels
RIM_M = 0.045  # of the rim inside its flange's edge that is of revolution
CREST_M = 0.0008  # of it outside the edge, before it falls away to the tyre
BESIDE_M = (0.01, 0.03)  # of the side wall, beyond the groove
DEEP = 0.08  # of the tyre's radius: no tyre bulges as far over its flange's edge
WALL_RADIUS_M = 0.08  # of a side wall's curve beside the tyre's widest ring
ROUND = 0.6  # of a ring's cells at one height
INCH_M, FLANGE_HEIGHT_M, SIZE_M = 0.0254, 0.0130, 0.012


@frozen
class Flange:
    """Radii of the flange's edge and of the groove between it and the tyre.

    clearness: depth of the groove over its standard uncertainty. noise_m: of single points on the
    side wall beside it.
    """

    edge_m: float
    groove_m: float
    clearness: float
    noise_m: float

    @property
    def within_m(self) -> tuple[float, float]:
        """Radii between which the points are the rim's.

        Noise carries points of the tyre across the groove, the farther the more it is: on one side
        of the wheel inwards from high on the wall, on the other outwards, which tilts these rings.
        The outer flank of the flange is seen on the scanner's side only: on the other, its rings
        are mixed pixels and tyre, which tilts them as well.
        """
        outer = max(self.edge_m, self.groove_m - self.noise_m)
        return self.edge_m - RIM_M, min(self.edge_m + CREST_M, outer)

    @property
    def rim_inch(self) -> float:
        """Nominal diameter of a rim with such a flange."""
        return 2.0 * (self.edge_m - FLANGE_HEIGHT_M) / INCH_M


def find_flange(points_m: Array, fit: AxisFit, rim_inch: float | None) -> Flange | None:
    """Find the flange's edge: a ridge, and outside it a groove, beyond which the tyre rises.

    points_m: (N, 3) of the wheel. rim_inch: nominal diameter of the rim, if it is stated. Of
    several, the clearest. None where no groove is clear, and where one nearer to the axis is about
    as clear: the outer one may be the tyre's, whose axis is not the rim's. Ridges DEEP below the
    tyre's widest ring are spokes and ledges of the rim.
    """
    radius, height, u = _fine(points_m, fit)
    outer = _outer_m(fit)
    widest_m = widest_ring(fit, (1.0 - WALL[1]) * outer)[1]
    width = float(radius[1] - radius[0])
    inside, outside = (max(2, round(reach / width)) for reach in (FLANGE_M, WALL_M))
    clear: list[Flange] = []
    for i in range(1, len(height) - 1):
        sides = height[[i - 1, i + 1]]
        if not np.isfinite(height[i]) or not np.all(height[i] <= sides):
            continue
        before, after = height[max(0, i - inside) : i], height[i + 1 : i + 1 + outside]
        edge = max(0, i - inside) + int(np.nanargmax(before))
        wall = i + 1 + int(np.nanargmax(after))
        depths = float(height[edge] - height[i]), float(height[wall] - height[i])
        depth, other = min(zip(depths, (edge, wall), strict=True))
        sigmas = depth / max(float(np.hypot(u[i], u[other])), 1e-9)
        found = Flange(float(radius[edge]), float(radius[i]), sigmas, _wall_noise(fit, radius[i]))
        inside_tyre = WALL[0] * outer < outer - found.groove_m < WALL[1] * outer
        deep = widest_m - float(height[edge]) > DEEP * outer
        own = not deep if rim_inch is None else _fits(found, rim_inch)
        if LEAST_M < depth < MOST_M and inside_tyre and own:
            clear.append(found)
    best = max(clear, key=lambda one: one.clearness, default=None)
    if best is None or best.clearness < SIGMAS:
        return None
    nearer = (one for one in clear if one.groove_m < best.groove_m - FLANGE_M)
    if any(one.clearness > RIVAL * best.clearness for one in nearer):
        return None
    return best


def bulges_inwards(fit: AxisFit) -> bool:
    """Return whether the side wall bulges against the axis's direction: a tyre's bulges outwards.

    Rim and tread lie behind it, so that a parabola through the round rings bends outwards, whatever
    is seen through the rim; its apex is between them. False where it is not: of a wheel that is
    seen in part, the rim alone decides nothing.
    """
    radius, height, outer = fit.meridian.grid.radius_m, fit.meridian.height_m, _outer_m(fit)
    own = _round(fit) & np.isfinite(height) & (radius > BULGE * outer) & (radius <= outer)
    if np.count_nonzero(own) < 3:
        return False
    inner = float(radius[own][0])
    bend, slope, _ = np.polyfit((radius[own] - inner) / (outer - inner), height[own], 2)
    return bool(bend > 0.0 and APEX[0] < -0.5 * slope / bend < APEX[1])


def _fine(points_m: Array, fit: AxisFit) -> tuple[Array, Array, Array]:
    """Return radius, height and its uncertainty on fine rings; NaN where the wheel is not round."""
    coarse = fit.meridian.grid
    width = min(FINE_M, coarse.width_m)
    rings = round(coarse.rings * coarse.width_m / width)
    points = CellPoints.of(points_m, fit.axis, fit.basis, Grid(coarse.low_m, width, rings, 1))
    over = points.height_m
    height, count = medians(points.cell, over, rings)
    spread, _ = medians(points.cell, np.abs(over - height[points.cell]), rings)
    radius = points.grid.radius_m
    ring = ((radius - coarse.low_m) / coarse.width_m).astype(int).clip(0, coarse.rings - 1)
    height[~_round(fit)[ring]] = np.nan
    return radius, height, MEDIAN_LOSS * MAD * spread / np.sqrt(np.maximum(count, 1))


def _round(fit: AxisFit) -> Mask:
    """Return the rings that are round, steep beside round ones, or hidden in part between them.

    A groove is hidden in part, seen aslant.
    """
    good = fit.cells.kept >= ROUND
    beside = np.zeros((2, len(good)), dtype=bool)
    beside[0, 1:], beside[1, :-1] = good[:-1], good[1:]
    return np.asarray(good | beside.all(axis=0) | (beside.any(axis=0) & ~fit.cells.used))


def _outer_m(fit: AxisFit) -> float:
    """Return the outer radius of the longest run of round rings: rim and side wall."""
    gaps = np.flatnonzero(np.concatenate([[True], ~_round(fit), [True]]))
    longest = int(np.argmax(np.diff(gaps)))
    return float(fit.meridian.grid.radius_m[max(int(gaps[longest + 1]) - 2, 0)])


def _wall_noise(fit: AxisFit, groove_m: float) -> float:
    """Return the noise of single points on the side wall beside a groove."""
    away = fit.meridian.grid.radius_m - groove_m
    known = fit.meridian.noise_m[(away > BESIDE_M[0]) & (away < BESIDE_M[1])]
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else 0.0


def _fits(flange: Flange, rim_inch: float) -> bool:
    return abs(flange.rim_inch - rim_inch) * 0.5 * INCH_M < SIZE_M


def widest_ring(fit: AxisFit, inner_m: float) -> tuple[float, float]:
    """Return radius and height of the highest round ring outside inner_m: the tyre's widest.

    Of rings that lie less than their noise below it, the highest is so by its noise: a parabola
    through those over which a side wall falls by twice the noise. NaN where none is seen.
    """
    radius, height = fit.meridian.grid.radius_m, fit.meridian.height_m
    own = (fit.cells.kept >= ROUND) & (radius > inner_m) & np.isfinite(height)
    if not own.any():
        return math.nan, math.nan
    noise_m = float(np.nanmedian(fit.cells.ring_u_m[own]))
    return _crest(fit.meridian, own, math.sqrt(2.0 * WALL_RADIUS_M * 2.0 * noise_m))


def edge_ring(fit: AxisFit, flange: Flange) -> tuple[float, float]:
    """Return radius and height of the flange's edge, its highest ring."""
    radius = fit.meridian.grid.radius_m
    own = np.isfinite(fit.meridian.height_m) & (np.abs(radius - flange.edge_m) < 0.006)
    return _crest(fit.meridian, own, 0.0)


def _crest(meridian: Meridian, own: Mask, reach_m: float) -> tuple[float, float]:
    """Return the top of a parabola by the highest ring, its neighbours and those within reach.

    The highest of several rings about as high is so by its noise.
    """
    radius, height, width = meridian.grid.radius_m, meridian.height_m, meridian.grid.width_m
    top = int(np.argmax(np.where(own, height, -np.inf)))
    off = radius - radius[top]
    near = (np.abs(off) < 1.5 * width) | (own & (np.abs(off) < reach_m))
    near &= np.isfinite(height)
    if np.count_nonzero(near) < 3:
        return float(radius[top]), float(height[top])
    bend, slope, level = (float(one) for one in np.polyfit(off[near], height[near], 2))
    most = 0.5 * max(width, reach_m)
    aside = float(np.clip(-0.5 * slope / bend, -most, most)) if bend < 0.0 else 0.0
    return float(radius[top]) + aside, level + (slope + bend * aside) * aside
