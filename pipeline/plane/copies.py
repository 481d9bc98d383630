"""Points that a scan holds more than once, as where it was merged with itself or exported again.

They show nothing of their own, and would count as further points: u falls with the root of their
number. Copies lie in one another's places; or close by, where one was rounded or shifted.
"""

from __future__ import annotations

import numpy as np

from ..cloud import coordinate_hash, nearest_points, sample
from ..vectors import Array, Array32, Rows

# Share of points in other points' places, to the micrometre, from which a cloud holds copies; and
# the number of points that are looked at.
COPIES, LOOKED_AT = 0.02, 4000
# Near copies: points about one place that are looked at; most copies of a point; by how much the
# next point is farther than a copy; the share of points of which that holds; distance of copies
# along the normal, median, over the noise (of independent points 0.95).
ABOUT, MOST_COPIES, FARTHER, SHARE, ALIKE = 200, 8, 3.0, 0.4, 0.3
LEAST_M = 1e-6  # distance up to which copies are in one place


def some_of(points_m: Array) -> Array:
    """Return LOOKED_AT of points_m (N, 3), the same in any order of them."""
    return sample(points_m, LOOKED_AT)


def places_shared(some_m: Array) -> bool:
    """Return whether a cloud holds copies in one another's places, by some of its points (N, 3)."""
    places = coordinate_hash(some_m)
    return len(np.unique(places)) <= (1.0 - COPIES) * len(places)


def first_in_places(points_m: Array | Array32) -> Rows:
    """Return the rows of points_m (N, 3) before which none is in the same place."""
    _, first = np.unique(coordinate_hash(points_m.astype(np.float64)), return_index=True)
    return np.sort(first)


def copies_within_m(points_m: Array, place_m: Array, normal: Array, sigma_m: float) -> float:
    """Return the distance within which points_m (N, 3) of a plane hold near copies; 0 without.

    place_m: (3,) about which they are looked at. sigma_m: noise across the plane, in which copies
    agree. Two beams of a scanner may lie close together, but each point then has neighbours at any
    distance: copies are followed by none up to FARTHER times theirs.
    """
    some = nearest_points(points_m, place_m, ABOUT)
    if len(some) < 3 * MOST_COPIES:
        return 0.0
    offset = some[:, None] - some
    apart_m = np.linalg.norm(offset, axis=2)
    nearest = np.argsort(apart_m, axis=1)[:, 1 : MOST_COPIES + 2]
    nearest_m = np.take_along_axis(apart_m, nearest, axis=1)
    gap = nearest_m[:, 1:] > FARTHER * np.maximum(nearest_m[:, :-1], LEAST_M)
    rows = np.nonzero(gap.any(axis=1))[0]
    if len(rows) < SHARE * len(some):
        return 0.0
    last = MOST_COPIES - 1 - np.argmax(gap[rows, ::-1], axis=1)  # of a point's copies
    across_m = np.abs(offset[rows, nearest[rows, last]] @ normal)
    if np.median(across_m) > ALIKE * sigma_m:
        return 0.0
    copy_m, next_m = (np.median(nearest_m[rows, last + k]) for k in (0, 1))
    return float(np.sqrt(max(copy_m, LEAST_M) * next_m))


def first_within(points_m: Array | Array32, reach_m: float) -> Rows:
    """Return the rows of points_m (N, 3) before which none that is kept lies within reach_m."""
    from scipy.spatial import KDTree

    pairs = KDTree(points_m).query_pairs(reach_m, output_type="ndarray")
    kept = np.ones(len(points_m), bool)
    for earlier, later in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist():
        if kept[earlier]:
            kept[later] = False
    return np.nonzero(kept)[0]
