"""The score of a plane by binomial coefficients, and the least rectangle by the convex hull."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.spatial import ConvexHull

from wheelplane.errors import NotMeasuredError
from wheelplane.plane.find_planes import (
    MAX_THICKNESS,
    SPANNED,
    _AnyPlane,
    _check_standing_out,
    _flatness,
    smallest_rectangle,
)
from wheelplane.plane.least_squares import total_least_squares


class Level:
    """Steps of the coordinates of one size in any direction, at one point alone."""

    def __init__(self, origin, step):
        self.origin, self.step = origin, step

    def beside(self, point, normal):
        np.testing.assert_allclose(point - self.origin, MODEL[:3], atol=1e-12)
        np.testing.assert_array_equal(normal, MODEL[3:])
        return self.step


ORIGIN = np.array([5.0, -7.0, 3.0])
MODEL = np.array([0.1, 0.2, 0.3, 0.0, 0.6, 0.8])
OFF = np.array([0.002, -0.001, 0.003, 0.004, 0.0, 0.0])


def problem(seed, count=40, widest=0.05, resolution=1e-9, step=0.0, share=0.5):
    """Points of a slab about MODEL, that share of all, among others."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    slab = points[: int(share * count)]
    slab -= np.outer((slab - MODEL[:3]) @ MODEL[3:] - rng.normal(0, 0.01, len(slab)), MODEL[3:])
    return points, _AnyPlane(points, ORIGIN, resolution, widest, Level(ORIGIN, step))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("widest", "resolution", "step", "of_slab"),
    [
        (0.05, 1e-9, 0.0, 0.5),
        (10.0, 1e-9, 0.0, 0.5),
        (10.0, 1e-9, 0.0, 1.0),
        (0.02, 0.015, 0.0, 0.5),
        (0.005, 1e-9, 0.04, 0.5),
        (1e-6, 1e-9, 0.0, 0.5),
    ],
)
def test_a_plane_is_scored_by_its_least_number_of_false_alarms(
    seed, widest, resolution, step, of_slab
):
    """NFA(k) = C(n, k) C(k, 3) (2 e_k / L)^(k - 3) of the k nearest, k to the widest slab."""
    points, any_plane = problem(seed, 40, widest, resolution, step, of_slab)
    span, n = np.linalg.norm(points.max(axis=0) - points.min(axis=0)), len(points)
    away = sorted(abs(float((p - MODEL[:3]) @ MODEL[3:])) for p in points)
    floor = max(resolution, step / 2.0)
    within = max(sum(e <= max(widest, floor, SPANNED * step) for e in away), 4)
    scores = []
    for k in range(1, within + 1):
        share = min(2.0 * max(away[k - 1], floor) / span, 1.0)
        tests = math.log(math.comb(n, k)) + math.log(max(math.comb(k, 3), 1))
        scores.append(-tests - max(k - 3, 0) * math.log(share))
    scale, score = any_plane.best_scale(MODEL)
    assert score == pytest.approx(max(scores))
    assert scale == pytest.approx(max(away[int(np.argmax(scores))], floor))
    assert any_plane.score([MODEL, MODEL]).tolist() == [score, score]
    share = sum(e <= scale * (1.0 + 1e-9) for e in away) / n  # the last one is the scale
    assert any_plane.success_rate(MODEL) == pytest.approx(0.5 * share**3)


def test_planes_are_proposed_through_points_half_of_them_near():
    points, any_plane = problem(5, 400)
    proposed = np.array(any_plane.propose(600, np.random.default_rng(1)))
    assert np.all(np.isin(proposed[:, 0], points[:, 0]))
    np.testing.assert_allclose(np.linalg.norm(proposed[:, 3:], axis=1), 1.0)
    away = np.abs(np.einsum("mi,nmi->mn", proposed[:, 3:], points[:, None] - proposed[:, :3]))
    assert np.sort(away, axis=1)[:, 2].max() < 1e-12  # three points lie on each
    triples = points[np.argsort(away, axis=1)[:, :3]]
    size = np.ptp(triples, axis=1).max(axis=1)
    assert np.median(size[:300]) < 0.5 * np.median(size[300:])
    line = _AnyPlane(np.outer(np.arange(5.0), [1, 2, 3]), ORIGIN, 1e-9, 0.1, Level(ORIGIN, 0.0))
    models = line.propose(20, np.random.default_rng(1))
    assert len(models) == 1
    assert line.score(models).tolist() == [0.0]


class Exact:
    """Coordinates that lie on no levels."""

    def beside(self, point, normal):
        return 0.0


def test_refining_fits_the_points_of_the_most_significant_slab():
    points, _ = problem(6, 400)
    any_plane = _AnyPlane(points, ORIGIN, 1e-9, 0.05, Exact())
    model = MODEL + OFF
    model[3:] /= np.linalg.norm(model[3:])
    for _ in range(3):
        scale, _ = any_plane.best_scale(model)
        own = points[np.abs((points - model[:3]) @ model[3:]) < scale * (1.0 + 1e-12)]
        normal = np.linalg.svd(own - own.mean(axis=0))[2][2]
        model = np.append(own.mean(axis=0), normal * np.sign(normal[np.argmax(np.abs(normal))]))
    found = any_plane.refine(MODEL + OFF)
    np.testing.assert_allclose(found, model, atol=2e-3)
    start = any_plane.best_scale(MODEL + OFF)[1]
    assert any_plane.best_scale(found)[1] > start
    assert any_plane.best_scale(found)[1] == pytest.approx(any_plane.best_scale(model)[1], rel=0.01)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("count", [8, 24])
def test_flatness_is_that_of_the_nearest_points(seed, count):
    """Noise by their median distance from their plane; over sqrt 2 times their narrower rms."""
    rng = np.random.default_rng(seed)
    cloud = rng.normal(size=(300, 3)) * [1.0, 0.7, 0.05] + [4.0, -2.0, 9.0]
    at = cloud[seed]
    own = np.array(sorted(cloud.tolist(), key=lambda p: math.dist(p, at))[:count])
    local = own - own.mean(axis=0)
    _, size, rows = np.linalg.svd(local)
    noise = np.median(np.abs(local @ rows[2])) / stats.norm.ppf(0.75)
    found = _flatness(cloud, at, count)
    assert found[0] == pytest.approx(noise, rel=1e-4)
    assert found[1] == pytest.approx(noise / (math.sqrt(2.0 / count) * size[1]), rel=1e-4)
    assert _flatness(np.ones((50, 3)), np.ones(3), count) == (0.0, 0.0)


def slab_with(inside, beside, limit, noise=0.0):
    """Points of a square of 1 m at that distance, and others at twice it; their moments."""
    rng = np.random.default_rng(1)
    near = np.column_stack(
        [rng.uniform(-0.5, 0.5, (inside, 2)), noise * (-1.0) ** np.arange(inside)]
    )
    far = np.column_stack([rng.uniform(-0.5, 0.5, (beside, 2)), np.full(beside, 2.9 * limit)])
    beyond = far + np.array([0.0, 0.0, 0.2 * limit])
    return np.vstack([near, far, beyond]), total_least_squares(near)


@pytest.mark.parametrize(("beside", "stands_out"), [(40, True), (42, False)])
def test_a_slab_must_hold_twice_as_many_points_as_one_beside_it(beside, stands_out):
    points, moments = slab_with(40, beside, 0.01)
    if stands_out:
        _check_standing_out(points, moments, 0.01, 0.0)
        return
    with pytest.raises(NotMeasuredError, match=r"holds 40 of 124 .* beside it 21 each"):
        _check_standing_out(points, moments, 0.01, 0.0)


@pytest.mark.parametrize("level", [0.0, 0.01])
@pytest.mark.parametrize(("share", "stands_out"), [(0.97, True), (1.03, False)])
def test_a_plane_is_thinner_than_a_twentieth_of_its_narrower_side(level, share, stands_out):
    """Both rms; half the distance of levels counts as rounding alone."""
    rng = np.random.default_rng(2)
    uv = rng.uniform(-0.5, 0.5, (5000, 2)) * [1.0, 0.4]
    noise = share * MAX_THICKNESS * 0.4 / math.sqrt(12.0) + 0.5 * level
    points = np.column_stack([uv, noise * rng.choice([-1.0, 1.0], 5000)])
    moments = total_least_squares(points)
    if stands_out:
        _check_standing_out(points, moments, 0.05, level)
        return
    with pytest.raises(NotMeasuredError, match="of their spread along its narrower side"):
        _check_standing_out(points, moments, 0.05, level)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
@pytest.mark.parametrize("seed", range(8))
def test_the_least_rectangle_has_a_side_along_one_of_the_convex_hull(seed, scale):
    """Freeman and Shapira, Comm. ACM 18 (1975) 409: exact."""
    rng = np.random.default_rng(seed)
    uv = rng.normal(size=(int(rng.integers(3, 300)), 2)) @ rng.normal(size=(2, 2)) + 7.0
    uv *= scale
    corners = uv[ConvexHull(uv).vertices]
    sides = []
    for edge in np.roll(corners, -1, axis=0) - corners:
        along = edge / np.linalg.norm(edge)
        extents = np.ptp(uv @ np.column_stack([along, [-along[1], along[0]]]), axis=0)
        sides.append(sorted(extents.tolist(), reverse=True))
    found = smallest_rectangle(uv)
    # Local minima have a side along the hull; steps of a degree may take one nearly as small.
    assert min(np.abs(np.array(sides) / found - 1.0).max(axis=1)) < 1e-5
    assert np.prod(found) < 1.002 * np.prod(sides, axis=1).min()
