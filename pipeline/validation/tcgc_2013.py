"""Estimator of the software of 2013 as a method, its angles with our signs.

It fits z = a x + b y + c in the vehicle frame; azimuth and elevation (down) are those of the normal
that points to the left. On the left side that normal is outward: toe = azimuth, camber =
elevation. On the right it is inward: toe = -azimuth, camber = -elevation. The elevation's
sign, which its tables omit, is that of the fitted plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import Wording
from ..five_point import tcgc_2013
from ..vectors import Array
from .comparison import ComparedMethod

LABEL = "tcgc-2013"
BIAS = (
    "{label}: its signs are converted to ours; it states no uncertainty, so that of total least "
    "squares on the same points is used. Sign aside, its camber is larger than that of total least "
    "squares by {mean}' on average, {worst}' at worst."
)


def by_old_estimator(
    method: ComparedMethod, blocks_m: Array, wheels: Sequence[str]
) -> tuple[ComparedMethod, str]:
    """Evaluate the points of `method` by the estimator of 2013; return a note on its bias."""
    angles = old_angles(blocks_m, wheels)
    camber = slice(len(wheels), None)
    excess = (np.abs(angles) - np.abs(method.angles_rad))[camber]
    mean, worst = (
        np.degrees(float(x)) * 60.0 for x in (excess.mean(), excess[np.argmax(np.abs(excess))])
    )
    note = Wording(BIAS, label=LABEL, mean=f"{mean:+.2f}", worst=f"{worst:+.2f}")
    return replace(method, label=f"{method.label}, {LABEL}", angles_rad=angles), note


def old_angles(blocks_m: Array, wheels: Sequence[str]) -> Array:
    """Return toes, then cambers (2 M,) of blocks (M, 5, 3), the first RR, RL, FR, FL; radians.

    The printed report takes blocks 3 and 4 as the rear axle, so its input has the axles exchanged:
    then its frame equals ours, and only its regression differs.
    """
    order = [2, 3, 0, 1, *range(4, len(blocks_m))]
    result = tcgc_2013(blocks_m[order], "report")
    back = np.argsort(order)
    coefficients = result.plane_coefficients[back]
    side = np.where([wheel.endswith("L") for wheel in wheels], 1.0, -1.0)
    # The normal (a, b, -1), reversed where needed to point to +x, points along z where a < 0.
    down = np.where(coefficients[:, 0] < 0.0, 1.0, -1.0)
    camber = side * down * result.camber_rad[back]
    return np.concatenate([side * result.toe_rad[back], camber])
