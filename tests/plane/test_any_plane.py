"""The score of a plane by binomial coefficients, and the least rectangle by the convex hull."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from wheelplane.plane.extents import smallest_rectangle
from wheelplane.plane.find_planes import SPANNED, _AnyPlane


class Level:
    """Steps of the coordinates of one size in any direction, at one point alone."""

    def __init__(self, origin, step):
        self.origin, self.step = origin, step

    def beside(self, point, normal):
        assert np.linalg.norm(point - self.origin) < 1.0
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        return self.step


ORIGIN = np.array([5.0, -7.0, 3.0])
MODEL = np.array([0.1, 0.2, 0.3, 0.0, 0.6, 0.8])


def problem(seed, count=40, widest=0.05, resolution=1e-9, step=0.0):
    """Points of a slab about MODEL among others."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    slab = points[: count // 2]
    slab -= np.outer((slab - MODEL[:3]) @ MODEL[3:] - rng.normal(0, 0.01, len(slab)), MODEL[3:])
    return points, _AnyPlane(points, ORIGIN, resolution, widest, Level(ORIGIN, step))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("widest", "resolution", "step"),
    [
        (0.05, 1e-9, 0.0),
        (10.0, 1e-9, 0.0),
        (0.02, 0.015, 0.0),
        (0.005, 1e-9, 0.04),
        (1e-6, 1e-9, 0.0),
    ],
)
def test_a_plane_is_scored_by_its_least_number_of_false_alarms(seed, widest, resolution, step):
    """NFA(k) = C(n, k) C(k, 3) (2 e_k / L)^(k - 3) of the k nearest, k to the widest slab."""
    points, any_plane = problem(seed, 40, widest, resolution, step)
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
    line = _AnyPlane(np.outer(np.arange(5.0), [1, 2, 3]), ORIGIN, 1e-9, 0.1, Level(ORIGIN, 0.0))
    models = line.propose(20, np.random.default_rng(1))
    assert len(models) == 1
    assert line.score(models).tolist() == [0.0]


@pytest.mark.parametrize("seed", range(8))
def test_the_least_rectangle_has_a_side_along_one_of_the_convex_hull(seed):
    """Freeman and Shapira, Comm. ACM 18 (1975) 409: exact."""
    rng = np.random.default_rng(seed)
    uv = rng.normal(size=(int(rng.integers(3, 300)), 2)) @ rng.normal(size=(2, 2)) + 7.0
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
