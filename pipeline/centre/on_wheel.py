"""Centre of the wheel behind a target that stands off, and targets that stand off unlike distances.

The frame stands on four wheel centres. A bare wheel's centre lies in the plane of the flange's
edge, a target's own in its face, d before it. Where the two targets of an axle stand off d and d',
the rear-axle normal turns by (d - d') sin(toe) / track, up by (d - d') sin(camber) / track, and the
line through the middles of both axles by (d - d') / (2 wheelbase). So does the bulge of a tyre, the
widest ring of which takes the place of a flange that is not seen on one side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..targets import Target, WheelTarget
from ..uncertainty import UncertaintyComponent
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .locate_centre import TargetFit

MOST_M = 0.15  # that a target stands off, where that is not stated
MOST_BULGE_M = 0.025  # of a tyre over its flange's edge, where no wheel of the axle shows it
BULGE_U_M = 0.0015  # of one seen: tyres alike, and rings and edges among noise of 3 mm


def on_wheel(fit: TargetFit, target: Target | None, outward: Array) -> TargetFit | None:
    """Return a fitted target carried to its wheel's centre; None where no stand-off is stated.

    outward: (3,) its unit normal, away from the car. All components act on the carried centre,
    which moves with the normal.
    """
    if target is None or target.stand_off is None or target.stand_off_u is None:
        return None
    to_wheel_m = -target.stand_off * math.copysign(1.0, outward @ fit.normal)
    carried = _carried(fit, to_wheel_m)
    if target.stand_off_u == 0.0:
        return carried
    component = _along(outward, target.stand_off_u)
    return replace(carried, components=(*carried.components, component))


def _carried(fit: TargetFit, way_m: float) -> TargetFit:
    """Return a fit whose centre is moved along its normal, on which all components then act."""
    moved = np.eye(6)
    moved[3:, :3] = way_m * np.eye(3)
    components = tuple(replace(one, factor=moved @ one.factor) for one in fit.components)
    return replace(fit, centre_m=fit.centre_m + way_m * fit.normal, components=components)


def off_tyre(fit: TargetFit, bulge_m: float | None, outward: Array, wheel: str) -> TargetFit:
    """Return a bare wheel by its tyre carried inwards to the level of its flange's edge.

    bulge_m: of the tyres of its axle; None where that is not seen: half of MOST_BULGE_M then.
    outward: (3,) its unit normal. wheel: whose scans share the error of this.
    """
    u_m = BULGE_U_M
    if bulge_m is None:
        bulge_m, u_m = MOST_BULGE_M / 2.0, MOST_BULGE_M / math.sqrt(12.0)
    carried = _carried(fit, -bulge_m * math.copysign(1.0, outward @ fit.normal))
    component = replace(_along(outward, u_m), shared=f"tyre of {wheel}")
    return replace(carried, components=(*carried.components, component))


def lies_on_wheel(target: Target | None) -> bool:
    """Return whether a centre is the wheel's: of a bare wheel, or carried there."""
    return isinstance(target, WheelTarget) or (target is not None and target.stand_off is not None)


def unlike_wheels(targets: Sequence[Target | None]) -> tuple[str, ...]:
    """Return the wheels with a target unlike that on the other side, at a distance not stated.

    targets: of RR, RL, FR, FL.
    """
    unlike = []
    for right, left in ((0, 1), (2, 3)):
        places = [None if lies_on_wheel(targets[i]) else targets[i] for i in (right, left)]
        if places[0] == places[1]:
            continue
        pair = zip((right, left), places, strict=True)
        unlike += [REFERENCE_WHEELS[i] for i, place in pair if place is not None]
    return tuple(unlike)


def with_unstated(fit: TargetFit, target: Target, outward: Array) -> TargetFit:
    """Return the fit with the uncertainty of a stand-off between 0 and MOST_M.

    Its root mean square, as the centre is not carried; alike on all wheels with this target.
    """
    component = _along(outward, MOST_M / math.sqrt(3.0))
    component = replace(component, shared=f"on {target!r}")  # two may be described alike
    return replace(fit, components=(*fit.components, component))


def _along(outward: Array, u_m: float) -> UncertaintyComponent:
    return UncertaintyComponent("stand-off", np.concatenate([np.zeros(3), u_m * outward])[:, None])
