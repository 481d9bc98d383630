"""What lies behind a plate's edge, as its beams see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.kernels import Array
from pipeline.outline import sector
from pipeline.rim_beams import MIN_DEPTH_M, SPOT, THICKNESS, Beams

RING_M = (0.001, 0.011)  # where the clean background is looked up, beyond the spot
MAX_SPREAD = 0.15  # sectors whose background is rougher than this share of its depth are left out


@dataclass(frozen=True)
class Background:
    """Depth and spread of the clean background by sector, (K,) each, and where it can be used."""

    depth_m: Array
    spread_m: Array
    usable: npt.NDArray[np.bool_]

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
