"""Planes of rounded coordinates: unbiased where least squares are not, honest, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.bench.rounding import DISC, cell, face
from tests.support.scenes import Setup, make
from wheelplane.cloud.steps import Steps
from wheelplane.config import Config, PlaneConfig
from wheelplane.detection.find_target import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.measure import fit_target
from wheelplane.measurement.observe import rounded as notes_of
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.plane.rounded_plane import fit_rounded, logistic_tail, normal_tail

RADIUS_M, COUNT, STEP_M = 0.12, 5000, 1e-3
TRUST = 1e-4  # probability that a right program fails a test


def disc(seed, tilt_deg, noise_m, count=COUNT, step_m=STEP_M, draw=None):
    """Points of a disc rounded to steps along w: uvw, levels, and the true height and slopes."""
    rng = np.random.default_rng(seed)
    uv = RADIUS_M * np.sqrt(rng.random((count, 1)))
    way = rng.uniform(0.0, 2.0 * np.pi, count)
    uv = uv * np.column_stack([np.cos(way), np.sin(way)])
    turn = rng.uniform(0.0, 2.0 * np.pi)
    slopes = np.tan(np.radians(tilt_deg)) * np.array([np.cos(turn), np.sin(turn)])
    height = rng.uniform(0.0, step_m)
    noise = rng.normal(size=count) if draw is None else draw(rng, count)
    level = np.rint((height + uv @ slopes + noise_m * noise) / step_m).astype(np.int64)
    return np.column_stack([uv, level * step_m]), level, np.array([height, *slopes])


def fit(points, level, step_m=STEP_M):
    return fit_rounded(points - [0.0, 0.0, points[:, 2].mean()], level, step_m, 3e-4, 12, 0.02)


def scores(tilt_deg, noise_m, seeds, **how):
    """Errors of the two slopes over u, (S, 2), by this fit and by least squares; refusals."""
    mine, squares, refused = [], [], 0
    for seed in range(seeds):
        points, level, truth = disc(seed, tilt_deg, noise_m, **how)
        try:
            found = fit(points, level, how.get("step_m", STEP_M))
        except NotMeasuredError as error:
            refused += error.status == "steps-too-coarse"
            continue
        u = np.sqrt(np.diag(found.covariance))[1:]
        mine.append((found.slopes - truth[1:]) / u)
        terms = np.column_stack([np.ones(len(points)), points[:, :2]])
        by_squares = np.linalg.lstsq(terms, points[:, 2], rcond=None)[0]
        off = points[:, 2] - terms @ by_squares
        u = np.sqrt(np.var(off) * np.diag(np.linalg.inv(terms.T @ terms)))[1:]
        squares.append((by_squares[1:] - truth[1:]) / u)
    return np.array(mine).reshape(-1, 2), np.array(squares).reshape(-1, 2), refused


@pytest.mark.parametrize(("tilt", "noise"), [(0.2, 3e-4), (0.6, 5e-5), (0.6, 2e-4), (1.0, 1e-4)])
def test_right_where_least_squares_are_wrong(tilt, noise):
    mine, squares, refused = scores(tilt, noise, 30)
    assert refused < 15
    assert np.sum(mine**2) < stats.chi2.isf(TRUST, mine.size)
    assert np.sum(mine**2) > stats.chi2.ppf(TRUST, mine.size) / 4.0  # the shape of the noise adds
    assert np.sum(squares**2) > stats.chi2.isf(TRUST, squares.size)


def test_fine_steps_are_noise_of_a_twelfth_of_their_square():
    noise = 2.0 * STEP_M
    points, level, _ = disc(1, 0.5, noise)
    found = fit(points, level)
    terms = np.column_stack([np.ones(COUNT), points[:, :2]])
    by_squares = np.linalg.lstsq(terms, points[:, 2], rcond=None)[0]
    wanted = (found.sigma_m**2 + STEP_M**2 / 12.0) * np.linalg.inv(terms.T @ terms)
    # The plane of logistic noise scatters about that of normal noise; its distance is added.
    rate = np.pi / np.sqrt(12.0)
    psi_square = stats.norm.expect(lambda x: np.tanh(rate * x) ** 2)
    scatter = psi_square / (rate * (1.0 - psi_square)) ** 2 - 1.0
    ratio = np.diag(found.covariance) / np.diag(wanted)
    assert ratio.min() > 0.98
    assert ratio.max() < 1.02 + scatter * stats.chi2.isf(TRUST, 1)
    assert found.sigma_m == pytest.approx(noise, rel=5.0 / np.sqrt(2 * COUNT))
    assert np.abs((found.slopes - by_squares[1:]) / np.sqrt(np.diag(wanted)[1:])).max() < 0.1


@pytest.mark.parametrize(("tilt", "noise"), [(0.0, 5e-5), (0.0, 1e-4), (0.05, 5e-5), (0.1, 5e-5)])
def test_an_angle_that_the_steps_hide_is_refused(tilt, noise):
    """All points of a face that spans less than a step lie on two steps, wherever it is."""
    span = 2.0 * RADIUS_M * np.tan(np.radians(tilt)) + 2.0 * noise * stats.norm.isf(1.0 / COUNT)
    assert span < STEP_M
    mine, squares, refused = scores(tilt, noise, 12)
    assert refused == 12
    assert mine.size == squares.size == 0


@pytest.mark.parametrize(
    "draw",
    [
        lambda rng, n: rng.standard_t(5, n) / np.sqrt(5.0 / 3.0),
        lambda rng, n: rng.laplace(0.0, np.sqrt(0.5), n),
    ],
    ids=["t of 5", "Laplace"],
)
def test_another_noise_is_within_four_u(draw):
    for tilt, noise in ((0.1, 4e-4), (0.3, 3e-4), (1.0, 1e-4)):
        mine, _, _ = scores(tilt, noise, 10, draw=draw)
        assert np.abs(mine).max() < 4.5


def test_the_order_of_the_points_and_strays_do_not_matter():
    points, level, _ = disc(4, 0.6, 2e-4)
    found = fit(points, level)
    order = np.random.default_rng(0).permutation(COUNT)
    again = fit(points[order], level[order])
    u = np.sqrt(np.diag(found.covariance))
    assert np.abs((again.slopes - found.slopes) / u[1:]).max() < 0.02
    strays = points[:40] + np.array([0.0, 0.0, 6e-3])
    robust = fit(np.vstack([points, strays]), np.append(level, level[:40] + 6))
    assert robust.kept[-40:].sum() == 0
    assert np.abs((robust.slopes - found.slopes) / u[1:]).max() < 0.1


@pytest.mark.parametrize("tail", [normal_tail, logistic_tail])
def test_tails_are_those_of_unit_variance(tail):
    x = np.linspace(-12.0, 12.0, 24_001)
    beyond, density = tail(x)
    assert np.trapezoid(density, x) == pytest.approx(1.0, abs=1e-6)
    assert np.trapezoid(x * x * density, x) == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(-np.gradient(beyond, x), density, atol=1e-6)


def test_a_face_square_to_an_axis_is_not_the_axis():
    """The fault: the plane of one step, its rms 0, its uncertainty 0, 180 arc seconds off."""
    _, points = face(0.05, 5e-5, 2, 3, (0.0, 0.0, 0.0))
    patch = find_target(np.round(points, 3), DISC, Config().segment, 0)
    np.testing.assert_allclose(patch.steps.step_m, STEP_M, rtol=1e-3)
    with pytest.raises(NotMeasuredError, match=r"steps of 1 mm across .* only \d+ of its \d+ "):
        fit_plane(patch, DISC, PlaneConfig())
    exact = fit_plane(find_target(points, DISC, Config().segment, 0), DISC, PlaneConfig())
    assert exact.rounding is None


def test_rounding_is_a_component_of_its_own_and_noted():
    _, points = face(0.5, 3e-4, 1, 5, (0.0, 0.0, 0.0))
    plain = fit_target(find_target(points, DISC, Config().segment, 0), DISC, Config())
    evidence = {
        step: fit_target(
            find_target(np.round(points / step) * step, DISC, Config().segment, 0), DISC, Config()
        )
        for step in (1e-6, 2e-4, 1e-3)
    }
    assert evidence[1e-6].plane.rounding is None
    for step in (2e-4, 1e-3):
        parts = {c.name: c for c in evidence[step].target.components}
        noise = parts["plane noise"].covariance[:3, :3]
        assert np.trace(parts["rounding"].covariance[:3, :3]) > 0.0
        assert np.trace(noise) == pytest.approx(
            np.trace(plain.target.components[0].covariance[:3, :3]), rel=0.1
        )
    fine, coarse = (
        np.trace(next(c for c in e.target.components if c.name == "rounding").covariance[:3, :3])
        for e in (evidence[2e-4], evidence[1e-3])
    )
    white = {step: step**2 / 12.0 / 3e-4**2 * np.trace(noise) for step in (2e-4, 1e-3)}
    assert fine == pytest.approx(white[2e-4], rel=0.2)
    assert white[1e-3] < coarse < 3.0 * white[1e-3]  # terraces tell less than as much noise would
    seen = [
        type("Seen", (), {"evidence": e, "name": name})()
        for name, e in (("RR", evidence[1e-3]), ("RL", plain), ("FR", evidence[1e-3]))
    ]
    (note,) = notes_of(seen)
    assert "RR, FR lie in steps of 1 mm" in note


def test_steps_of_a_turned_scan_are_along_its_own_axes():
    cloud = make(Setup(spacing_m=0.0025, half_width_m=0.2, pairs=4, noise_m=1e-4, turned=False), 6)
    R = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    points = np.round(cloud.points_m, 3) @ R.T
    patch = find_target(points, DISC, Config().segment, 0, axes=R.T)
    np.testing.assert_allclose(patch.steps.step_m, STEP_M, rtol=1e-3)
    with pytest.raises(NotMeasuredError, match="steps of 1 mm"):
        fit_plane(patch, DISC, PlaneConfig())
    blind = replace(patch, steps=Steps())
    assert fit_plane(blind, DISC, PlaneConfig()).rms_m < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"step_m": 1e-3}, {"offset_m": 5e3}], ids=["1 mm", "float32"])
def test_a_part_of_the_study(how):
    """tests/bench/rounding.py at its hardest: nothing far outside, and as many inside as wanted."""
    inside, total, worst, measured = 0, 0, 0.0, 0
    for tilt, noise in ((0.1, 3e-4), (0.3, 1e-4), (0.3, 6e-4), (1.0, 1e-4)):
        found = cell(tilt, noise, 3, **how)
        assert set(found.refused) <= {"steps-too-coarse"}
        inside, total = inside + found.inside[0], total + found.inside[1]
        measured += len(found.angle)
        worst = max(worst, found.ratio.max(initial=0.0))
    assert measured > 20
    assert worst < 4.0
    assert stats.binom.cdf(inside, total, 0.93) > TRUST


def test_terraces_of_a_raster_are_rounded_too():
    """A disc alone on a raster of 2 mm, its heights in steps of 1 mm: few values, and not exact."""
    column, row = (axis.ravel() for axis in np.meshgrid(*[np.arange(-62, 63) * 2e-3] * 2))
    inside = np.hypot(column, row) < 0.125
    uv, nees, refused = np.column_stack([column, row])[inside], [], 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        slopes = rng.uniform(-0.006, 0.006, 2)
        height = 3.0 + uv @ slopes + 1e-4 * rng.standard_normal(len(uv))
        points = np.column_stack([uv + np.array([1.0, 2.0]), height]).round(3)
        patch = find_target(points, DISC, Config().segment, 0)
        assert patch.steps.step_m == pytest.approx([0.0, 0.0, 1e-3])
        try:
            plane = fit_plane(patch, DISC, PlaneConfig())
        except NotMeasuredError as error:
            refused += error.status == "steps-too-coarse"
            continue
        axes = plane.basis[:2]
        error = axes @ np.append(-slopes, 1.0) / np.hypot(1.0, np.hypot(*slopes))
        u = axes @ plane.normal_covariance @ axes.T
        nees.append(error @ np.linalg.solve(u, error))
    assert 8 < len(nees) == 12 - refused
    dof = 2 * len(nees)
    assert stats.chi2.ppf(TRUST, dof) / 4.0 < np.sum(nees) < stats.chi2.isf(TRUST, dof)
