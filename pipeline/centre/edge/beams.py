"""Beams about a target's edge, and the background behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...config import CentreConfig
from ...targets import Outline, sector
from ...vectors import Array, Mask, turned

RING_M = (0.001, 0.011)  # beyond the footprint: where the clean background is looked up
TWELFTHS, LEAST_IN_TWELFTH = 12, 4
MAX_SPREAD = 0.15  # sectors whose background is rougher than this share of its depth are left out


@dataclass(frozen=True)
class Background:
    """Depth and spread of the clean background by sector, (K,) each, and where it can be used."""

    depth_m: Array
    spread_m: Array
    usable: Mask

    def sector(self, beams: Beams) -> npt.NDArray[np.int64]:
        """Return the sector (N,) that each beam falls in."""
        return sector(beams.share, len(self.usable))


def look_up(beams: Beams, depth: Array, state: Array) -> Background:
    """Return the median depth of the background just beyond the edge, by sector."""
    beyond = beams.x_m - np.exp(state[SPOT]) - np.maximum(beams.tau, 0.0) * np.exp(state[THICKNESS])
    ring = (beyond > RING_M[0]) & (beyond < RING_M[1]) & (depth > MIN_DEPTH_M)
    count = int(np.clip(np.count_nonzero(ring) // 10, 12, 90))
    part, z = sector(beams.share[ring], count), depth[ring]
    order = np.lexsort((z, part))
    z = np.append(z[order], np.nan)
    start = np.searchsorted(part[order], np.arange(count + 1))
    size = np.diff(start)
    low, middle, high = (z[start[:-1] + (share * size).astype(int)] for share in (0.25, 0.5, 0.75))
    spread = (high - low) / 1.349
    with np.errstate(invalid="ignore"):
        usable = (size >= 5) & (spread < MAX_SPREAD * middle)
    return Background(middle, spread, usable)


def mixed_share(beams: Beams, depth: Array, background: Background) -> float:
    """Return mixed pixels about the edge, per point on the target in a 2 mm ring just inside.

    Of the middle one of twelfths of the edge: another surface before the background is seen in few.
    Of all of it where there are few points.
    """
    share = depth / background.depth_m[background.sector(beams)]
    mixed = (np.abs(beams.x_m) < 0.004) & (share > 0.2) & (share < 0.8)
    ring = (beams.x_m > -0.005) & (beams.x_m < -0.003) & (np.abs(share) < 0.2)
    if (total := int(np.count_nonzero(ring))) < LEAST_IN_TWELFTH * TWELFTHS:
        return float(np.count_nonzero(mixed) / max(total, 1))
    part = sector(beams.share, TWELFTHS)
    count = [np.bincount(part[chosen], minlength=TWELFTHS) for chosen in (mixed, ring)]
    shown = count[1] > 0
    return float(np.median(count[0][shown]) / np.mean(count[1][shown]))


# A state is (9,): centre u v, beam u v, 1/distance, log spot, log thickness, log reflectance
# ratio, in-plane rotation. That of a clean edge is (12,): also the reflectance of the wall seen
# edge-on and its rise with tau, and the spot's shape.
CENTRE, BEAM, INVERSE = slice(0, 2), slice(2, 4), 4
SPOT, THICKNESS, RATIO, ROTATION = 5, 6, 7, 8
WALL, SHAPE = slice(9, 11), 11
LAMBERT, LAMBERT_SIGMA, SHAPE_PRIOR = (0.0, 1.0), (0.2, 0.5), (0.5, 0.5)
LEAST_WALL = 0.02  # reflectance of a wall, of the target's
STATED_THICKNESS = 0.05  # relative standard uncertainty (k = 1)
HELD_BEAM, HELD_THICKNESS = 0.05, 0.03  # of a fit that diverged (k = 1)
ROTATION_RAD = 0.1  # of the detected axes against the target's (k = 1)
MIN_DEPTH_M = 0.006  # least depth of a background


@dataclass(frozen=True)
class Prior:
    """Prior of the state: mean and weight, one over the variance; (9,), of a clean edge (12,)."""

    mean: Array
    weight: Array

    @classmethod
    def of(cls, thickness_m: float | None, config: CentreConfig) -> Prior:
        """Return the prior for a target of that thickness, if known, and the set footprint."""
        known = thickness_m is not None
        thickness = thickness_m if thickness_m is not None else 0.008
        logs = np.log([config.spot_radius_m, max(thickness, 1e-4)])
        mean = np.array([0.0, 0.0, 0.0, 0.0, 0.4, *logs, 0.0, 0.0])
        sigma = [0.01, 0.01, 3.0, 3.0, 0.3, 0.7, 0.3 if known else 1.0, 1.5, ROTATION_RAD]
        return cls(mean, 1.0 / np.array(sigma) ** 2)

    def held(self, state: Array) -> Prior:
        """Return the prior with thickness and beams held near the start (9,)."""
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[BEAM] = state[BEAM]
        weight[BEAM] = HELD_BEAM**-2
        weight[THICKNESS] = HELD_THICKNESS**-2
        return Prior(mean, weight)

    def clean(self, thickness_is_known: bool) -> Prior:
        """Return the prior of a clean edge: returns part by power, of a wall by Lambert's law.

        No point shows the wall's lower edge, so that its thickness is what is stated.
        """
        mean, sigma = [*LAMBERT, SHAPE_PRIOR[0]], np.array([*LAMBERT_SIGMA, SHAPE_PRIOR[1]])
        weight = self.weight.copy()
        if thickness_is_known:
            weight[THICKNESS] = STATED_THICKNESS**-2
        return Prior(np.append(self.mean, mean), np.append(weight, sigma**-2))

    @classmethod
    def beside(cls, state: Array) -> Prior:
        """Return the prior for another edge of a target whose first edge has that state (9,)."""
        sigma = [0.01, 0.01, 0.02, 0.02, 0.03, 0.2, 0.2, 0.7, ROTATION_RAD]
        return cls(state, 1.0 / np.array(sigma) ** 2)


@dataclass(frozen=True)
class Beams:
    """Beams carried to the plane, (N,) each or (N, 2): x outside the edge, its normal rho, tau.

    q_m: where they met the plane, from the centre. shrink: of a step at the point's depth, on its
    way to the plane. curve: see ClosestPoints.
    """

    x_m: Array
    rho: Array
    tau: Array
    shrink: Array
    q_m: Array
    curve: Array
    share: Array
    clear: Mask


def carry(plane: Array, depth: Array, state: Array, outline: Outline) -> Beams:
    """Carry each point along its beam to the plane: q = (p - c - z g) / (1 + z/D), from c.

    tau: at the depth z, a beam that met the plane x outside the edge is x - tau z outside the wall,
    less (z t)^2 / (2 R) by the wall's curvature where the beam runs along the edge by t per depth;
    that is linearised down to the thickness.
    """
    shrink = 1.0 / (1.0 + state[INVERSE] * depth)
    q = (plane - state[CENTRE] - depth[:, None] * state[BEAM]) * shrink[:, None]
    closest = outline.closest(turned(q, -state[ROTATION]))
    rho = turned(closest.normal, state[ROTATION])
    outward = rho @ state[BEAM]
    aside = state[BEAM] @ state[BEAM] - outward**2
    bent = np.exp(state[THICKNESS]) * aside * closest.bend / 2.0
    tau = -outward - state[INVERSE] * closest.support_m - bent
    return Beams(closest.x_m, rho, tau, shrink, q, closest.curve, closest.share, closest.clear)
