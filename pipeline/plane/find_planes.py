"""Planes of any cloud, without a target's size: the points determine the threshold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..cloud import Levels, coordinate_levels, random_rows, within_slab
from ..errors import InputError, NotMeasuredError
from ..system import frozen
from ..vectors import Array
from .least_squares import PlaneMoments, total_least_squares
from .ransac import RansacOptions, ransac
from .sigma_clipping import Clipping, converge

SCORED_POINTS = 2000
SAMPLED_POINTS = 50_000
MIN_SCORE = 6.0  # a plane as good occurs by chance once in e^6 clouds
MIN_CONTRAST = 2.0  # a slab of a curved or solid cloud is as dense as its neighbours: contrast 1
MAX_THICKNESS = 0.05  # rms of a plane's residuals over the spread of its points along it
NO_PLANE = "no plane stands out among the points"
ODDS = f"e^{MIN_SCORE:.0f} needed"
NEIGHBOURS, SEEDS = 24, 48  # for the noise: at first this many points about this many points
MAX_GAP = 0.02  # of the cloud's span: levels farther apart are surfaces, not rounding
STRAY = 0.01  # share of the points beyond which each end of the cloud is that of strays
FAR = 10.0  # spans without these: farther away they make the cloud no larger
SPANNED = 1.5  # distances of levels: no point within them of the plane is clipped
MAX_ROUGHNESS = 0.25  # noise over a neighbourhood's spread: above it larger ones are tried


@frozen(eq=False)
class CloudPlane:
    """Plane of a cloud: normal . x + offset = 0.

    normal: (3,) unit, largest component positive. centroid_m: (3,) mean of its points.
    rms_m: of its points' distances. extents_m: (2,) sides of the smallest rectangle about its
    points, the longer first. level_m: distance across it between the levels of rounded coordinates,
    0 where they are exact.
    """

    normal: Array
    offset_m: float
    centroid_m: Array
    rms_m: float
    points: int
    extents_m: tuple[float, float]
    level_m: float = 0.0


def find_planes(points_m: Array, max_planes: int, seed: int = 0) -> tuple[CloudPlane, ...]:
    """Find at most max_planes planes of points_m (N, 3), largest first.

    Each is found by RANSAC with a threshold from the points themselves (a contrario), fitted by
    total least squares over all its points at 3 sigma, and removed before the next search.
    Levels of equal coordinates, which rounding, a raster or a profile makes, are no planes.
    Raises NotMeasuredError 'no-plane', InputError for fewer than 4 points.
    """
    if len(points_m) < 4:
        raise InputError(f"a plane with a residual needs at least 4 points, got {len(points_m)}")
    some = random_rows(points_m, SAMPLED_POINTS, np.random.default_rng(seed))
    origin, most_m = np.median(some, axis=0), _most_span(some)
    remaining = points_m - origin
    widest = _widest_slab(remaining, most_m, np.random.default_rng(seed))
    levels = coordinate_levels(points_m, MAX_GAP * _span(points_m, most_m))
    found: list[CloudPlane] = []
    while len(found) < max_planes and len(remaining) >= 4:
        rng = np.random.default_rng([seed, len(found)])
        try:
            moments, limit = _next_plane(remaining, origin, most_m, widest, levels, rng)
        except NotMeasuredError as error:
            if found:
                break
            raise NotMeasuredError("no-plane", f"{NO_PLANE}: {error}") from error
        here = within_slab(remaining, moments.centroid_m, moments.normal, limit)
        level = levels.beside(origin + moments.centroid_m, moments.normal)
        found.append(replace(_describe(moments, remaining[here], origin), level_m=level))
        remaining = remaining[
            ~within_slab(remaining, moments.centroid_m, moments.normal, 2.0 * limit)
        ]
    return tuple(sorted(found, key=lambda plane: -plane.points))


def plane_of_all(points_m: Array) -> CloudPlane:
    """Fit the least-squares plane to all of points_m (N, 3), none clipped."""
    if len(points_m) < 3:
        raise InputError(f"a plane needs at least 3 points, got {len(points_m)}")
    origin = points_m[0]
    moments, largest_m = total_least_squares(points_m - origin), float(np.abs(points_m).max())
    long, wide = moments.scatter_m2[:2]
    if wide <= max(len(points_m) * _resolution(largest_m) ** 2, _resolution(float(long))):
        raise InputError("all points lie on one line, or at one place: they show no plane")
    return _describe(moments, points_m - origin, origin)


def _resolution(largest_m: float) -> float:
    """Return the distance that rounding of coordinates up to the largest may hide."""
    return 16.0 * float(np.finfo(float).eps) * largest_m


def _span(points: Array, most_m: float) -> float:
    """Return the diagonal of the box about points (N, 3), most_m at most."""
    return min(float(np.linalg.norm(np.ptp(points, axis=0))), most_m)


def _most_span(points: Array) -> float:
    """Return the span beyond which points (N, 3) are large by single strays; inf at one place."""
    low, high = np.quantile(points, (STRAY, 1.0 - STRAY), axis=0)
    return FAR * float(np.linalg.norm(high - low)) or math.inf


def _next_plane(
    points: Array,
    origin: Array,
    most_m: float,
    widest: float,
    levels: Levels,
    rng: np.random.Generator,
) -> tuple[PlaneMoments, float]:
    """Return the most significant plane and the distance within which points belong to it.

    Raises NotMeasuredError with the test that refused it.
    """
    scored = random_rows(points, SCORED_POINTS, rng)
    largest_m = float(np.abs(origin).max() + np.abs(points).max())
    resolution = _resolution(largest_m)
    problem = _AnyPlane(scored, origin, resolution, widest, levels, most_m)
    result = ransac(problem, RansacOptions(max_proposals=1000), rng)
    if result is None or result.score < MIN_SCORE:
        score = 0.0 if result is None else result.score
        raise _refused(f"the best would occur by chance in one of e^{score:.1f} clouds, {ODDS}")
    scale, _ = problem.best_scale(result.model)
    point, normal = origin + result.model[:3], result.model[3:]
    level = levels.beside(point, normal)
    resolution = max(resolution, SPANNED * level)
    start = Clipping(_basis(result.model[3:]), result.model[:3], scale / 2.0, cap=1.5 * scale)
    first, _ = converge(random_rows(points, SAMPLED_POINTS, rng), start, resolution)
    clipping, moments = converge(points, first, resolution)
    limit = clipping.limit(resolution)
    _check_standing_out(points, moments, limit, level)
    return moments, limit


def _refused(fact: str) -> NotMeasuredError:
    return NotMeasuredError("no-plane", fact)


def _widest_slab(points: Array, most_m: float, rng: np.random.Generator) -> float:
    """Return the largest distance of a plane's points: five times the noise of the cloud, metres.

    The noise is that of the flattest quarter of small neighbourhoods. A cloud too small for
    neighbourhoods gives 2 % of its span. Raises NotMeasuredError 'no-plane' where nothing is flat.
    """
    cloud = random_rows(points, 2 * SAMPLED_POINTS, rng)
    span = _span(cloud, most_m)
    if len(cloud) < 2 * NEIGHBOURS:
        return 0.02 * span
    seeds = cloud[rng.integers(len(cloud), size=SEEDS)]
    count, least = NEIGHBOURS, math.inf
    while 2 * count <= len(cloud):
        noise, roughness = np.array([_flatness(cloud, seed, count) for seed in seeds]).T
        least = min(least, float(np.quantile(roughness, 0.25)))
        if least < MAX_ROUGHNESS:
            return min(5.0 * float(np.quantile(noise, 0.25)), 0.02 * span)
        count *= 4
    raise _refused(
        f"{NO_PLANE}: nothing in it is flat: its flattest parts are {least:.0%} as thick as wide, "
        f"{MAX_ROUGHNESS:.0%} at most"
    )


def _flatness(cloud: Array, seed: Array, count: int) -> tuple[float, float]:
    """Return the noise across the `count` points nearest to seed, metres, and over their spread."""
    square = np.sum((cloud - seed) ** 2, axis=1)
    near = cloud[np.argpartition(square, count)[:count]]
    plane = total_least_squares(near)
    noise = 1.4826 * float(np.median(np.abs((near - plane.centroid_m) @ plane.normal)))
    spread = math.sqrt(2.0 * plane.scatter_m2[1] / count)
    return noise, noise / spread if spread > 0.0 else 0.0


def _basis(normal: Array) -> Array:
    return np.stack([np.zeros(3), np.zeros(3), normal])


def _check_standing_out(points: Array, moments: PlaneMoments, limit: float, level: float) -> None:
    """Raise NotMeasuredError where the slab is no denser than those beside it, or no plane's.

    level: distance between levels of coordinates across it, half of which rounding may move points.
    """
    residual = np.abs((points - moments.centroid_m) @ moments.normal)
    inside = np.count_nonzero(residual < limit)
    beside = np.count_nonzero(residual < 3.0 * limit) - inside
    across, along = np.sqrt(moments.scatter_m2[[2, 1]] / max(moments.count, 1))
    held = f"the best holds {inside} of {len(points)} points"
    if inside < 4 or inside < MIN_CONTRAST * beside / 2.0:
        raise _refused(
            f"{held} within {limit * 1e3:.3g} mm, and as thick slabs beside it {beside / 2.0:.0f} "
            f"each, of which it needs {MIN_CONTRAST:g} times as many"
        )
    if not across - 0.5 * level < MAX_THICKNESS * along:
        raise _refused(
            f"{held}, but their noise across it, {across * 1e3:.3g} mm, is "
            f"{across / max(along, 1e-300):.1%} of their spread along its narrower side, "
            f"{along * 1e3:.3g} mm (both rms), {MAX_THICKNESS:.0%} at most"
        )


def _describe(moments: PlaneMoments, points: Array, origin: Array) -> CloudPlane:
    centroid = origin + moments.centroid_m
    across = (points - moments.centroid_m) @ moments.basis.T
    return CloudPlane(
        normal=moments.normal,
        offset_m=-float(moments.normal @ centroid),
        centroid_m=centroid,
        rms_m=float(np.sqrt(np.mean(across[:, 2] ** 2))),
        points=len(points),
        extents_m=smallest_rectangle(across[:, :2]),
    )


class _AnyPlane:
    """Planes through three points, near or far, each scored at its most significant scale.

    A model is a row (6,): a point on the plane, its unit normal. Score: minus the logarithm of the
    number of false alarms, the expected number of planes as good in a cloud of unrelated points:
    NFA(k) = C(n, k) C(k, 3) (2 e_k / L)^(k - 3), e_k the distance of the k-th nearest point.
    Source: Moisan, Stival, Int. J. Comput. Vision 57 (2004) 201.
    """

    def __init__(
        self,
        points: Array,
        origin: Array,
        resolution: float,
        widest: float,
        levels: Levels,
        most_m: float = math.inf,
    ) -> None:
        self._points, self._span = points, _span(points, most_m)
        self._origin, self._levels = origin, levels
        self._floor = max(resolution, 1e-12 * self._span)
        self._widest = max(widest, self._floor)
        count = np.arange(1, len(points) + 1)
        log_factorial = np.concatenate([[0.0], np.cumsum(np.log(count))])
        choose = log_factorial[-1] - log_factorial[1:] - log_factorial[::-1][1:]
        triples = count * (count - 1.0) * (count - 2.0) / 6.0
        self._log_tests = choose + np.log(np.maximum(triples, 1.0))
        self._powers = np.maximum(count - 3.0, 0.0)

    def propose(self, count: int, rng: np.random.Generator) -> Sequence[Array]:
        """Return planes through triples: half anywhere, half the nearest of 24 random points."""
        first, second, third = self._points[rng.integers(len(self._points), size=(3, count))]
        handful = self._points[rng.integers(len(self._points), size=(count // 2, 24))]
        distance = np.linalg.norm(handful - first[: count // 2, None], axis=2)
        near = np.argsort(distance, axis=1)
        rows = np.arange(count // 2)
        second[: count // 2] = handful[rows, near[:, 1]]
        third[: count // 2] = handful[rows, near[:, 2]]
        normal = np.cross(second - first, third - first)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        good = length[:, 0] > 1e-9 * self._span**2
        return list(np.hstack([first, normal / np.maximum(length, 1e-300)])[good]) or [first[0]]

    def score(self, models: Sequence[Array]) -> Array:
        if len(models[0]) < 6:  # no triple spanned a plane
            return np.zeros(1)
        return np.array([self.best_scale(model)[1] for model in models])

    def best_scale(self, model: Array) -> tuple[float, float]:
        """Return the distance at which a plane is most significant, and its score there."""
        level = self._levels.beside(self._origin + model[:3], model[3:])
        floor, widest = max(self._floor, 0.5 * level), max(self._widest, SPANNED * level)
        residual = np.sort(np.abs((self._points - model[:3]) @ model[3:]))
        share = np.clip(2.0 * np.maximum(residual, floor) / self._span, None, 1.0)
        log_alarms = self._log_tests + self._powers * np.log(share)
        within = max(int(np.searchsorted(residual, widest, side="right")), 4)
        best = int(np.argmin(log_alarms[:within]))
        return float(max(residual[best], floor)), -float(log_alarms[best])

    def refine(self, model: Array) -> Array:
        for _ in range(3):
            scale, _ = self.best_scale(model)
            near = np.abs((self._points - model[:3]) @ model[3:]) <= scale
            if np.count_nonzero(near) < 4:
                return model
            plane = total_least_squares(self._points[near])
            model = np.concatenate([plane.centroid_m, plane.normal])
        return model

    def success_rate(self, model: Array) -> float:
        scale, _ = self.best_scale(model)
        share = float(np.mean(np.abs((self._points - model[:3]) @ model[3:]) <= scale))
        return 0.5 * math.pow(share, 3)


def smallest_rectangle(uv_m: Array) -> tuple[float, float]:
    """Return the sides of the rectangle of least area about points uv_m (N, 2), the longer first.

    One of its sides lies along an edge of the convex hull. The main directions of points are no
    guide: those of a square are arbitrary. Source: Freeman, Shapira, Commun. ACM 18 (1975) 409.
    """
    hull = _hull(uv_m)
    edges = np.roll(hull, -1, axis=0) - hull
    along = np.arctan2(edges[:, 1], edges[:, 0])
    turns = np.mod(along - along[0], 2.0 * np.pi)  # growing: the vertices lie counterclockwise

    def farthest(quarters: int) -> Array:
        """Return the vertex (K, 2) farthest in the direction of each edge, turned by quarters."""
        ahead = np.mod(turns + (quarters + 1) * 0.5 * np.pi, 2.0 * np.pi)
        return np.asarray(hull[np.searchsorted(turns, ahead) % len(hull)])

    units = np.stack([np.cos(along), np.sin(along)], axis=1)
    across = np.stack([-units[:, 1], units[:, 0]], axis=1)
    length = np.sum((farthest(0) - farthest(2)) * units, axis=1)
    width = np.sum((farthest(1) - hull) * across, axis=1)
    best = int(np.argmin(length * width))
    short, long = np.sort(np.maximum([length[best], width[best]], 0.0))
    return float(long), float(short)


def _hull(uv_m: Array) -> Array:
    """Return the vertices of the convex hull (K, 2), counterclockwise; of a line its two ends."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(uv_m[ConvexHull(uv_m).vertices])
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        one = _farthest_from(uv_m[0], uv_m)
        return np.stack([one, _farthest_from(one, uv_m)])


def _farthest_from(point_m: Array, uv_m: Array) -> Array:
    return np.asarray(uv_m[np.argmax(np.linalg.norm(uv_m - point_m, axis=1))])
