"""How much noise that is alike from point to point widens the uncertainty of a plane."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels import Array

BLOCKS_OF_RADIUS = (0.125, 0.25, 0.4)  # edges of the blocks whose means are compared
SIGNIFICANT = 3.0  # standard deviations above 1 before an inflation is believed


def variance_inflation(uv_m: Array, residual_m: Array, sigma_m: float, radius_m: float) -> float:
    """Factor by which the variance of a plane exceeds that of independent noise; at least 1.

    uv_m: (N, 2) in the plane, residual_m: (N,) across it, from its fit. N over the factor is the
    effective number of points. Means over blocks of n points scatter by sigma^2/n if the noise is
    independent, by more if it is correlated over lengths up to a block's; the largest ratio over
    three sizes of block counts. Longer waves bend the plate itself: that is flatness, not noise.
    Source: batch means, Conway, Management Science 10 (1963) 47.
    """
    if not sigma_m > 0.0:
        return 1.0
    worst = 1.0
    for share in BLOCKS_OF_RADIUS:
        column, row = ((uv_m - uv_m.min(axis=0)) / (share * radius_m)).astype(np.int64).T
        block = row * (int(column.max()) + 1) + column
        count = np.bincount(block)
        total = np.bincount(block, residual_m)
        full = count > 0.3 * count.max()
        freedom = int(np.count_nonzero(full)) - 3  # the fit took three
        if freedom < 5 or count.max() < 8:
            continue
        ratio = float(np.sum(total[full] ** 2 / count[full])) / (freedom * sigma_m**2)
        if ratio > 1.0 + SIGNIFICANT * math.sqrt(2.0 / freedom):
            worst = max(worst, ratio)
    return worst
