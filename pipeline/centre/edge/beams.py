"""What lies behind a plate's edge, as its beams see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...config import CentreConfig
from ...targets import Outline, sector
from ...vectors import Array, Mask, turned

RING_M = (0.001, 0.011)  # where the clean background is looked up, beyond the spot
MAX_SPREAD = 0.15  # sectors whose background is rougher than this share of its depth are left out


@dataclass(frozen=True)
class Background:
    """Depth and spread of the clean background by sector, (K,) each, and where it can be used."""

    depth_m: Array
    spread_m: Array
    usable: Mask

    def sector(self, beams: Beams) -> npt.NDArray[np.int64]:
        """The sector (N,) that each beam falls in."""
        return sector(beams.share, len(self.usable))


def look_up(beams: Beams, depth: Array, state: Array) -> Background:
    """Median depth of what lies just beyond the edge, sector by sector."""
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
    """Points of mixed range about the edge, of those on the face in a ring of 2 mm just inside."""
    share = depth / background.depth_m[background.sector(beams)]
    mixed = (np.abs(beams.x_m) < 0.004) & (share > 0.2) & (share < 0.8)
    ring = (beams.x_m > -0.005) & (beams.x_m < -0.003) & (np.abs(share) < 0.2)
    return float(np.count_nonzero(mixed) / max(int(np.count_nonzero(ring)), 1))


# A state is (9,): centre u v, beam u v, 1/distance, log spot, log thickness, log echo, turn.
CENTRE, BEAM, INVERSE = slice(0, 2), slice(2, 4), 4
SPOT, THICKNESS, RATIO, TURN = 5, 6, 7, 8
HELD_BEAM, HELD_THICKNESS = 0.05, 0.03  # of a fit that ran away from them (k = 1)
TURN_RAD = 0.1  # what the segmentation's axes may be turned against the target's (k = 1)
MIN_DEPTH_M = 0.006  # what lies nearer behind the face is not taken for background


@dataclass(frozen=True)
class Prior:
    """What is known before: mean (9,) and weight (9,), one over the variance."""

    mean: Array
    weight: Array

    @classmethod
    def of(cls, thickness_m: float | None, config: CentreConfig) -> Prior:
        """Of a plate of that thickness, if it is known, seen by a laser spot as configured."""
        known = thickness_m is not None
        thickness = thickness_m if thickness_m is not None else 0.008
        logs = np.log([config.spot_radius_m, max(thickness, 1e-4)])
        mean = np.array([0.0, 0.0, 0.0, 0.0, 0.4, *logs, 0.0, 0.0])
        sigma = [0.01, 0.01, 3.0, 3.0, 0.3, 0.7, 0.3 if known else 1.0, 1.5, TURN_RAD]
        return cls(mean, 1.0 / np.array(sigma) ** 2)

    def held(self, state: Array) -> Prior:
        """The same with the thickness and the beams held near what is known, from a start (9,)."""
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[BEAM] = state[BEAM]
        weight[BEAM] = HELD_BEAM**-2
        weight[THICKNESS] = HELD_THICKNESS**-2
        return Prior(mean, weight)

    @classmethod
    def beside(cls, state: Array) -> Prior:
        """Of another edge of a plate, the first of which has that state (9,): same beams."""
        sigma = [0.01, 0.01, 0.02, 0.02, 0.03, 0.2, 0.2, 0.7, TURN_RAD]
        return cls(state, 1.0 / np.array(sigma) ** 2)


@dataclass(frozen=True)
class Beams:
    """Beams carried to the plane, (N,) each or (N, 2): x outside the edge, its normal rho, tau.

    q_m: where they met the plane, seen from the centre. shrink: of a step at the point's depth, on
    its way to the plane. curve: see outline.Feet.
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
    """Where each point's beam met the plane: q = c + (p - c - z g) / (1 + z/D), seen from c.

    tau: at the depth z, a beam that met the plane x outside the edge is x - tau z outside the wall,
    less (z t)^2 / (2 R) by the wall's own curvature where the beam runs aside by t per depth; that
    is taken as a straight line down to the thickness.
    """
    shrink = 1.0 / (1.0 + state[INVERSE] * depth)
    q = (plane - state[CENTRE] - depth[:, None] * state[BEAM]) * shrink[:, None]
    closest = outline.closest(turned(q, -state[TURN]))
    rho = turned(closest.normal, state[TURN])
    outward = rho @ state[BEAM]
    aside = state[BEAM] @ state[BEAM] - outward**2
    bent = np.exp(state[THICKNESS]) * aside * closest.bend / 2.0
    tau = -outward - state[INVERSE] * closest.support_m - bent
    return Beams(closest.x_m, rho, tau, shrink, q, closest.curve, closest.share, closest.clear)
