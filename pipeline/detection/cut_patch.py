"""A target and its surroundings, cut out of a cloud."""

from __future__ import annotations

import numpy as np

from ..cloud import Slab, surroundings
from ..errors import NotMeasuredError
from ..plane import Patch
from ..targets import Target
from ..vectors import Array, Array32
from .candidates import MIN_POINTS, Candidate

CLOSE_ASIDE, CLOSE_DEPTH = 1.6, 2.0  # of the radius: a wheel behind its target, not the floor
MAX_DEPTH_M = 0.8  # background further behind the target carries no more information
BEAM_SLOPE = 3.3  # beams up to 73 degrees carry the background this far sideways per depth
MOST_ASIDE_M = 1.2  # however deep
FACE_REACH, AROUND_REACH = 1.8, 1.25  # of the radius


def cut_patch(
    points_m: Array,
    intensity: Array32 | None,
    candidate: Candidate,
    target: Target,
    most_around: int,
) -> Patch:
    """Cut a candidate and its surroundings out of points_m (N, 3).

    The normal is flipped, if necessary, away from the side with more points.
    intensity: (N,) or None. most_around: number of points kept off the target.
    Raises NotMeasuredError 'too-few-points'.
    """
    near = surroundings(
        points_m,
        candidate.centre_m,
        candidate.normal,
        Slab(FACE_REACH * target.radius_m, candidate.band_m),
        around_slab(target),
        most_around,
        intensity,
    )
    if len(near.face_m) < MIN_POINTS:
        raise NotMeasuredError(
            "too-few-points", f"{len(near.face_m)} points on the target, {MIN_POINTS} needed"
        )
    patch = Patch(
        origin_m=candidate.centre_m,
        face_m=near.face_m,
        around_m=near.around_m,
        around_after=near.after,
        around_share=near.share,
        match=candidate.match,
        basis=candidate.basis,
        sigma_m=candidate.sigma_m,
        face_intensity=near.face_intensity,
        around_intensity=near.around_intensity,
        elsewhere=candidate.elsewhere,
    )
    if _points_backwards(candidate.basis.astype(np.float32) @ near.around_m.T, target.radius_m):
        patch = patch.turned_round()
    return patch


def _points_backwards(uvw_m: Array32, radius_m: float) -> bool:
    """Return whether more points uvw_m (3, N), in a target's axes, lie in front of it than behind.

    Only close points count, those of the wheel: the floor in front of a target has more points.
    """
    u, v, depth = uvw_m
    close = u * u + v * v < (CLOSE_ASIDE * radius_m) ** 2
    close &= np.abs(depth) < CLOSE_DEPTH * radius_m
    depth = depth[close] if close.any() else depth
    return bool(np.count_nonzero(depth > 0.0) > np.count_nonzero(depth < 0.0))


def around_slab(target: Target) -> Slab:
    """Return the slab of a target's surroundings, about its centre along its normal."""
    reach = AROUND_REACH * target.radius_m
    return Slab(reach, MAX_DEPTH_M, BEAM_SLOPE, reach + MOST_ASIDE_M)
