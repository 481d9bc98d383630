"""Five points of a scan: where they lie, and that they share it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.support.paths import CONFIGS
from tests.support.scenes import Setup, make
from wheelplane.config import Config
from wheelplane.detection.find_target import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.measure import fit_target
from wheelplane.plane.correlated_noise import CorrelatedNoise
from wheelplane.plane.fit_plane import PlaneFit
from wheelplane.targets.plates import DiscTarget
from wheelplane.targets.registry import load_target
from wheelplane.validation.virtual_five_point import added_components, aimed, pick_five

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
SIGMA = 8e-4
RING = 0.088
NONE = np.zeros((3, 3))
FLAT = sorted({path.stem for path in (CONFIGS / "targets").glob("*.toml")} - {"wheel"})
SCENE = Setup(spacing_m=0.002, half_width_m=0.18, noise_m=SIGMA, pairs=6)


def face(count=60, seed=0):
    """Points (count, 2) over a disc about the centre, five of them near a ring."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(5) / 5 + 0.3
    five = RING * np.column_stack([np.cos(turn), np.sin(turn)])
    rest = rng.normal(size=(count - 5, 2))
    rest *= (0.12 * np.sqrt(rng.random(count - 5)) / np.hypot(*rest.T))[:, None]
    return np.vstack([five, rest])


def plane_of(uv, correlated=0.0, length=0.0):
    """The fit of all points, level and without tilt; its noise is known."""
    local = uv - uv.mean(axis=0)
    values, axes = np.linalg.eigh(local.T @ local)
    basis = np.eye(3)
    basis[:2, :2] = axes.T
    noise = CorrelatedNoise(correlated, length, NONE, NONE, np.inf, SIGMA)
    fit = PlaneFit(np.zeros(3), basis, SIGMA, SIGMA, np.diag(values), len(uv), 1, noise)
    centre = np.append(-uv.mean(axis=0), 0.0)  # the origin of uv, from the centroid
    return fit, SimpleNamespace(centre_m=centre)


def of_plane(components):
    """Covariance (3, 3): normal's two slopes, then the height; the causes' own axes are x, y, z."""
    whole = sum(component.covariance for component in components)
    return whole[np.ix_([0, 1, 5], [0, 1, 5])]


def fits(heights, uv):
    """Slopes of the normal and height at the origin, by least squares of heights (R, N)."""
    X = np.column_stack([-uv, np.ones(len(uv))])
    return heights @ np.linalg.pinv(X).T


def chi(values, covariance):
    return np.einsum("ri,ij,rj->r", values, np.linalg.inv(covariance), values)


def is_chi_square(values, dof=3):
    return stats.kstest(values, stats.chi2(dof).cdf).pvalue > 1e-3


def test_the_difference_has_less_variance_and_a_plain_sum_is_wrong():
    """Var(five - all) = Var(five) - Var(all): Hausman (1978)."""
    uv = face(14)
    plane, fitted = plane_of(uv)
    local = uv @ plane.basis[:2, :2].T
    stated = of_plane(added_components(local[:5], local, plane, fitted, 0.0))
    heights = SIGMA * np.random.default_rng(1).standard_normal((4000, len(uv)))
    five, everything = fits(heights[:, :5], uv[:5]), fits(heights, uv)
    difference = five - everything
    assert is_chi_square(chi(difference, stated))
    X = np.column_stack([-uv, np.ones(len(uv))])
    of_all = SIGMA**2 * np.linalg.inv(X.T @ X)
    of_five = SIGMA**2 * np.linalg.inv(X[:5].T @ X[:5])
    np.testing.assert_allclose(stated, of_five - of_all, rtol=1e-6, atol=1e-15)
    assert not is_chi_square(chi(difference, of_five + of_all))  # a plain En
    assert np.mean(chi(difference, of_five + of_all)) < 2.0
    # nothing in common between the cloud's fit and what the five add to it
    R = np.corrcoef(np.hstack([everything, difference]).T)[:3, 3:]
    assert np.abs(R).max() < 4.5 / np.sqrt(4000)


def test_correlated_noise_takes_its_kernel():
    uv = face(300, 2)
    length = 0.03
    plane, fitted = plane_of(uv, correlated=SIGMA, length=length)
    local = uv @ plane.basis[:2, :2].T
    components = added_components(local[:5], local, plane, fitted, 0.0)
    apart = np.sum((uv[:, None] - uv[None]) ** 2, axis=2)
    K = SIGMA**2 * np.exp(-apart / (2 * length**2)) + 1e-15 * np.eye(len(uv))
    rng = np.random.default_rng(3)
    field = rng.standard_normal((4000, len(uv))) @ np.linalg.cholesky(K).T
    heights = field + plane._white_variance**0.5 * rng.standard_normal((4000, len(uv)))
    difference = fits(heights[:, :5], uv[:5]) - fits(heights, uv)
    assert is_chi_square(chi(difference, of_plane(components)))
    assert not is_chi_square(chi(difference, of_plane(components[:1])))


def test_waves_of_the_face_count_where_they_are_stated():
    uv = face()
    plane, fitted = plane_of(uv)
    flat, wavy = (added_components(uv[:5], uv, plane, fitted, f) for f in (0.0, 1e-3))
    assert [c.name for c in wavy] == [*(c.name for c in flat), "flatness"]
    height = wavy[-1].covariance[5, 5]
    assert height == pytest.approx(1e-6 / 12 / 5, rel=1e-3)  # five heights, each within 1 mm


def scan(seed, keep=None):
    """A scanned plate: its patch and what was fitted to it."""
    cloud = make(SCENE.but(keep=keep), seed)
    patch = find_target(cloud.points_m, DISC, Config().segment, 0)
    return cloud, patch, fit_target(patch, DISC, Config())


def test_the_points_are_of_the_scan_and_near_a_regular_pentagon():
    cloud, patch, evidence = scan(4)
    picked = pick_five(patch, evidence, DISC, RING, np.random.default_rng(0))
    points = {tuple(np.round(p, 9)) for p in cloud.points_m}
    assert all(tuple(np.round(p, 9)) in points for p in picked.points_m)
    local = cloud.in_target(picked.points_m)
    assert np.abs(local[:, 2]).max() < 4 * SIGMA
    spacing = SCENE.spacing_m / np.cos(np.radians(SCENE.incidence_deg))
    assert np.abs(np.hypot(local[:, 0], local[:, 1]) - RING).max() < spacing
    turn = np.sort(np.arctan2(local[:, 1], local[:, 0]))
    gaps = np.diff(np.append(turn, turn[0] + 2 * np.pi))
    assert np.abs(gaps - 2 * np.pi / 5).max() < 2 * spacing / RING
    assert np.abs(picked.missed_m).max() < spacing
    again = pick_five(patch, evidence, DISC, RING, np.random.default_rng(0))
    np.testing.assert_array_equal(again.points_m, picked.points_m)
    other = pick_five(patch, evidence, DISC, RING, np.random.default_rng(1))
    assert not np.array_equal(other.points_m, picked.points_m)
    default = pick_five(patch, evidence, DISC, None, np.random.default_rng(0))
    assert np.hypot(*default.uv_m.T).mean() == pytest.approx(RING, abs=spacing)


@pytest.mark.parametrize("name", FLAT)
def test_a_pentagon_fits_on_every_known_target_unless_another_is_asked_for(name):
    """Whatever its turn, every corner has points of a scan with 3 mm of spacing beside it."""
    target = load_target(name)
    steps = np.arange(-0.2, 0.2, 0.003)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + 0.001
    uv = grid[target.region.shrunk(0.005).holds(grid)]
    face_m = np.column_stack([uv, np.zeros(len(uv))])
    middle_m = np.append(uv.mean(axis=0), 0.0)
    plane = replace(plane_of(uv)[0], basis=np.eye(3), centroid_m=middle_m)
    fitted = SimpleNamespace(centre_m=np.zeros(3))
    patch = SimpleNamespace(face_m=face_m, origin_m=np.zeros(3))
    evidence = SimpleNamespace(plane=plane, target=fitted)
    for seed in range(10):
        picked = pick_five(patch, evidence, target, None, np.random.default_rng(seed))
        assert np.hypot(*picked.missed_m.T).max() < 0.015


def test_a_hidden_pentagon_is_not_made_up():
    _, patch, evidence = scan(5, keep=lambda u, v: ~((u > 0.02) & (np.hypot(u, v) < 0.112)))
    with pytest.raises(NotMeasuredError, match="no pentagon of 88 mm"):
        pick_five(patch, evidence, DISC, RING, np.random.default_rng(0))


@pytest.mark.slow
def test_planes_of_picked_points_differ_as_stated():
    squares = []
    for seed in range(40):
        _, patch, evidence = scan(100 + seed)
        picked = pick_five(patch, evidence, DISC, RING, np.random.default_rng(seed))
        (delta,) = aimed([picked], [evidence.target])
        centre = picked.points_m.mean(axis=0)
        normal = np.linalg.svd(picked.points_m - centre)[2][2]
        normal *= np.sign(normal @ evidence.target.normal)
        basis = evidence.plane.basis
        seen = [*(basis[:2] @ (normal - evidence.target.normal))]
        seen += [*(basis @ (centre - evidence.target.centre_m))]
        turn = np.zeros((5, 6))
        turn[:2, :3], turn[2:, 3:] = basis[:2], basis
        squares.append(seen @ np.linalg.solve(turn @ delta.covariance @ turn.T, seen))
    low, high = stats.chi2.ppf([0.001, 0.999], 5 * 40) / 40
    assert low < np.mean(squares) < high
    assert not low < np.mean(squares) / 2.0 < high  # a variance that is twice as large
