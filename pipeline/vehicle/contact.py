"""What a wheel stands on: the floor beside it, or a turn plate, a shim or a block upon that."""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array

ALONG_M = 0.12  # from the wheel's centre to the front and rear: beside the contact patch
TYRES_M = ((0.11, 0.2), (0.06, 0.15))  # heights of the sidewall: on a high pad, and on a low one
TYRE_POINTS, OUTERMOST = 10, 95  # least on the sidewall; their percentile that is its outermost
REACH_M = 0.4  # of a wheel's sidewall from its centre, across
HALF_M, STAND_OFF_M = 0.1, 0.06  # half a tyre's width; of the sidewall from the centre if unseen
FROM_M, TO_M = 0.01, 0.3  # outwards from the sidewall
PAD_M = 0.1  # up to this height above the floor beside it
CUT, STEP = 3.0, 0.5  # standard deviations: of outliers; between the heights that are tried
GAIN, FEWEST = 20.0, 3  # least of a pad: by how much it lessens the squares; points on it


@frozen
class Contact:
    """Middle (2,) of a wheel's contact patch, left and forward, and the pad that it stands on.

    pad_m: height of the pad above the floor beside the wheel, 0 where no step is seen; u_m: its
    standard deviation.
    """

    middle_m: Array
    pad_m: float = 0.0
    u_m: float = 0.0


def find_contact(points_m: Array, above_m: Array, wheel_m: Array, sigma_m: float) -> Contact:
    """Find what a wheel stands on, by the points from its sidewall outwards.

    points_m: (N, 3) about the vehicle, left, forward, up; above_m: (N,) their heights above the
    floor beside the wheel, of standard deviation sigma_m; wheel_m: (3,) centre. The top of a high
    pad lies where the sidewall of a wheel on the floor does: such a pad is looked for first.
    """
    side = np.sign(wheel_m[0])
    out_m = side * (points_m[:, 0] - wheel_m[0])
    near = (np.abs(points_m[:, 1] - wheel_m[1]) < ALONG_M) & (np.abs(out_m) < REACH_M)
    found = Contact(_middle(wheel_m, -STAND_OFF_M))
    for low_m, high_m in TYRES_M:
        tyre = near & (above_m > low_m) & (above_m < high_m)
        if np.count_nonzero(tyre) < TYRE_POINTS:
            continue
        sidewall_m = float(np.percentile(out_m[tyre], OUTERMOST))
        aside_m = out_m - sidewall_m
        beside = near & (aside_m > FROM_M) & (aside_m < TO_M)
        beside &= np.abs(above_m) < PAD_M + CUT * sigma_m
        outwards = np.argsort(aside_m[beside], kind="stable")
        pad_m, u_m = _innermost(above_m[beside][outwards], sigma_m)
        found = Contact(_middle(wheel_m, sidewall_m), pad_m, u_m)
        if pad_m > TYRES_M[-1][0] - CUT * sigma_m:
            break
    return found


def _middle(wheel_m: Array, sidewall_m: float) -> Array:
    out_m = np.sign(wheel_m[0]) * (sidewall_m - HALF_M)
    return np.array([wheel_m[0] + out_m, wheel_m[1]])


def _innermost(above_m: Array, sigma_m: float) -> tuple[float, float]:
    """Return the height of the first of points (N,) if it is not the floor's, and its u; else 0, 0.

    The first points lie on a pad, the others on the floor: how many, and how high it is, by the
    least sum of squares, each cut at CUT standard deviations. Those of the first that do not lie on
    the pad count twice, as its wall has points at every height; of the FEWEST next to the tyre it
    may be one: what lies beside the wheel, with floor between, is no pad.
    """
    if len(above_m) < FEWEST:
        return 0.0, 0.0
    z = above_m[:, None] / sigma_m
    heights = np.arange(STEP, PAD_M / sigma_m, STEP)
    off = (z - heights) ** 2
    gain = np.minimum(z**2, CUT**2) - np.where(off < CUT**2, off, 2.0 * CUT**2)
    gain = np.cumsum(gain, axis=0)
    last, best = np.unravel_index(int(np.argmax(gain)), gain.shape)
    on = off[: last + 1, best] < CUT**2
    if gain[last, best] < GAIN or on.sum() < FEWEST or on[:FEWEST].sum() < FEWEST - 1:
        return 0.0, 0.0
    return float(above_m[: last + 1][on].mean()), sigma_m / float(np.sqrt(on.sum()))
