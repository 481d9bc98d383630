"""Floors and pads of few points with known truth: exact heights, and how far chance goes."""

import numpy as np
import pytest
from scipy import stats

from wheelplane.vehicle.contact import CUT, GAIN, PAD_M, STEP, find_contact
from wheelplane.vehicle.vertical import CHANCE, LEAST_M, fit_floor

WHEELS = np.array([[-1.1, 0.1, 0.0], [1.1, 0.1, 0.0], [-1.1, 3.1, 0.0], [1.1, 3.1, 0.0]])
LEVEL, SLOPES = -0.31, np.array([0.002, -0.0035])
TWIST = np.array([1.0, -1.0, -1.0, 1.0])  # of four heights: no plane takes part in it
MIDDLES = WHEELS[:, :2] - [0.16, 0.0] * np.sign(WHEELS[:, :1])  # no sidewall is seen
OF_HEIGHTS = np.diag([1 / (4 * 1.1**2), 1 / (4 * 1.5**2)])  # (2, 2) of slopes, by four of unit sd
OF_MIDDLES = np.diag([1 / (4 * 0.94**2), 1 / (4 * 1.5**2)])


def floor_of(patches_m=(0.0, 0.0, 0.0, 0.0), scatter_m=0.0, noise_m=0.0, centre=False):
    """Points of 16 cells about each wheel, four in each: plane, patch, and two saddles.

    Neither saddle takes part in a plane or a patch: the means of cells are scatter_m above and
    below it, the points of a cell noise_m above and below their mean. centre: with a cell in the
    middle of the first wheel's, in the plane.
    """
    across, along = (0.2 * one.ravel() for one in np.meshgrid([-2, -1, 1, 2], [-2, -1, 1, 2]))
    x, y = (0.05 * np.array(one) for one in ([-1, 1, -1, 1], [-1, -1, 1, 1]))
    points = []
    for i, (wheel, patch_m) in enumerate(zip(WHEELS, patches_m, strict=True)):
        with_centre = [0.0] * (centre and i == 0)
        a, b = np.append(across, with_centre)[:, None], np.append(along, with_centre)[:, None]
        z = patch_m + scatter_m * np.sign(a) * np.sign(b) + noise_m * np.sign(x) * np.sign(y)
        xy = np.stack([wheel[0] + a + x, wheel[1] + b + y], axis=-1).reshape(-1, 2)
        points.append(np.column_stack([xy, LEVEL + xy @ SLOPES + z.ravel()]))
    return np.concatenate(points)


def above_wheel(wheel, out_m, heights_m, patch_m=0.0):
    """Points outwards from a wheel's centre, at heights above the floor."""
    x = wheel[0] + np.sign(wheel[0]) * np.asarray(out_m)
    y = np.full(len(x), wheel[1])
    return np.column_stack([x, y, LEVEL + x * SLOPES[0] + y * SLOPES[1] + patch_m + heights_m])


def test_a_floor_without_steps_is_a_plane():
    floor = fit_floor(floor_of(), WHEELS)
    assert floor.dof == 64 - 3
    np.testing.assert_allclose(floor.slopes, SLOPES, atol=1e-12)
    assert floor.twist_covariance.shape == (2, 2)
    assert not floor.twist_covariance.any()


@pytest.mark.parametrize("patches_mm", [TWIST, [3.0, 1.0, -2.0, 0.0], [0.0, 0.0, 0.0, 4.0]])
def test_wheels_stand_on_the_floors_of_their_own_heights(patches_mm):
    """The plane nearest to four heights, and a step of one wheel above that of the others."""
    patches_m = 1e-3 * np.array(patches_mm)
    floor = fit_floor(floor_of(patches_m), WHEELS)
    terms = np.column_stack([np.ones(4), MIDDLES])
    plane = np.linalg.lstsq(terms, patches_m, rcond=None)[0]
    np.testing.assert_allclose(floor.slopes, SLOPES + plane[1:], atol=1e-12)
    others = np.linalg.solve(terms[1:], patches_m[1:])
    twist_m = abs(patches_m[0] - terms[0] @ others)
    assert floor.twist_m == pytest.approx(twist_m, rel=1e-9)
    between = np.linalg.lstsq(terms, patches_m - plane[0], rcond=None)[0][1:] - others[1:]
    np.testing.assert_allclose(np.diag(floor.twist_covariance), between**2, rtol=1e-9)
    assert not floor.pads_m.any()
    assert floor.dof == 64 - 6


def test_heights_of_one_plane_are_no_twist():
    """Both front wheels 3 mm higher: the floors differ, and one plane holds them."""
    floor = fit_floor(floor_of([0.0, 0.0, 3e-3, 3e-3]), WHEELS)
    assert floor.dof == 64 - 6
    np.testing.assert_allclose(floor.slopes, SLOPES + np.array([0.0, 1e-3]), atol=1e-12)
    assert floor.twist_m == 0.0


@pytest.mark.parametrize("wheel", range(4))
def test_a_pad_stands_on_the_floor_beside_its_wheel(wheel):
    """Floors 9 mm higher and lower; a sidewall 50 mm from the centre, a pad of 30 mm from it on."""
    patches_m, pad_m = 9e-3 * TWIST, 0.03 * np.eye(4)[wheel]
    tyre_m = 0.03 + np.linspace(0.065, 0.09, 12)
    tyre = above_wheel(WHEELS[wheel], [-0.05] * 12, tyre_m, patches_m[wheel])
    pad = above_wheel(WHEELS[wheel], [0.0, 0.02, 0.04, 0.06], 0.03, patches_m[wheel])
    wheels_m = WHEELS + [0.0, 0.0, 1.0] * (WHEELS[:, :2] @ SLOPES + patches_m + pad_m)[:, None]
    floor = fit_floor(np.concatenate([floor_of(patches_m), tyre, pad]), wheels_m)
    np.testing.assert_allclose(floor.pads_m, pad_m, atol=1e-12)
    middles = MIDDLES.copy()
    middles[wheel, 0] += 0.01 * np.sign(middles[wheel, 0])
    terms = np.column_stack([np.ones(4), middles])
    plane = np.linalg.lstsq(terms, patches_m + floor.pads_m, rcond=None)[0]
    np.testing.assert_allclose(floor.slopes, SLOPES + plane[1:], atol=1e-12)


@pytest.mark.parametrize("scatter_m", [0.0, 1e-4, 1e-3])
def test_floors_are_alike_within_the_chance_of_their_scatter(scatter_m):
    """Squares of three more heights are of a chi-square; no scatter is below LEAST_M."""
    chance = stats.chi2(3)
    variance_m2 = 64 * scatter_m**2 / (64 - 6) + LEAST_M**2
    twist_m = np.sqrt((chance.mean() + CHANCE * chance.std()) * variance_m2 / 64)
    for step, dof in ((0.98, 64 - 3), (1.02, 64 - 6)):
        assert fit_floor(floor_of(step * twist_m * TWIST, scatter_m), WHEELS).dof == dof


@pytest.mark.parametrize("patches_m", [np.zeros(4), 4e-3 * TWIST])
@pytest.mark.parametrize("centre", [False, True])
def test_a_floor_is_uneven_where_it_is_hidden_unless_noise_explains_its_cells(patches_m, centre):
    """Cells 1 mm above and below; the noise is that of means of four points each."""
    scatter_m, lower = 1e-3, stats.chi2(32)
    noise_m2 = 32 * scatter_m**2 / (lower.mean() + CHANCE * lower.std())
    of_points_m = np.sqrt(noise_m2 * 4) * np.sqrt(3 / 4)  # three are free of four
    plain, noisy = (
        fit_floor(floor_of(patches_m, scatter_m, step * of_points_m, centre), WHEELS).covariance
        for step in (0.98, 1.02)
    )
    of_slopes = OF_MIDDLES if patches_m.any() else OF_HEIGHTS
    np.testing.assert_allclose(plain - noisy, scatter_m**2 * of_slopes, rtol=1e-6, atol=1e-14)


def contact_of(heights_m, sigma_m, sidewall=12):
    """Find the contact of points from 20 mm beside a sidewall outwards."""
    out_m = np.append([-0.06] * sidewall, -0.04 + 0.01 * np.arange(len(heights_m)))
    heights_m = np.append(np.linspace(0.07, 0.14, sidewall), heights_m)
    points = above_wheel(WHEELS[1], out_m, heights_m)
    return find_contact(points, heights_m, WHEELS[1], sigma_m)


def pad_by_trial(z):
    """Return the height of a pad by all numbers of its points and heights; 0 where there is none.

    A sum of squares in variances: of the floor's points their own, of the pad's that about it, of
    what lies on neither the squared cut; twice if a pad is before it.
    """
    level = [min(one * one, CUT * CUT) for one in z]
    least = (sum(level) - GAIN, 0, 0.0)
    best = (np.inf, 0, 0.0)
    for height in np.arange(1, round(PAD_M / 0.01 / STEP)) * STEP:
        squares = sum(level)
        for number, one in enumerate(z):
            apart = abs(one - height)
            squares += (apart * apart if apart < CUT else CUT * CUT * 2) - level[number]
            best = min(best, (squares, number + 1, height))
    on = [abs(one - best[2]) < CUT for one in z[: best[1]]]
    if best[0] > least[0] or sum(on) < 3 or sum(on[:3]) < 2:
        return 0.0
    return np.mean([one for one, is_on in zip(z, on, strict=False) if is_on])


def test_a_pad_is_that_of_the_least_squares_of_all():
    rng, found = np.random.default_rng(4), 0
    for _ in range(400):
        count, on = rng.integers(3, 12), rng.integers(0, 8)
        z = rng.normal(size=count) + np.where(np.arange(count) < on, rng.uniform(1.0, 5.0), 0.0)
        z = np.where(rng.random(count) < 0.15, rng.uniform(-9.0, 5.9, count), z).clip(-9.9, 5.9)
        expected = 0.01 * pad_by_trial(z)
        assert contact_of(0.01 * z, 0.01).pad_m == pytest.approx(expected, abs=1e-12)
        found += expected > 0.0
    assert 100 < found < 300


@pytest.mark.parametrize(("count", "pad_m"), [(2, 0.0), (3, 0.02), (4, 0.02)])
@pytest.mark.parametrize("beyond", [0, 5])
def test_a_pad_has_three_points(count, pad_m, beyond):
    seen = contact_of([0.02] * count + [0.0] * beyond, 1e-3)
    assert seen.pad_m == pytest.approx(pad_m, abs=1e-12)
    assert seen.u_m == pytest.approx(1e-3 / np.sqrt(3) if count == 3 else seen.u_m)


@pytest.mark.parametrize(("before", "pad_m"), [(0, 0.02), (1, 0.02), (2, 0.0), (4, 0.0)])
@pytest.mark.parametrize("other_m", [[0.0] * 4, [0.03, 0.04, 0.05, 0.055]])
def test_one_point_of_the_tyre_may_lie_before_a_pad(before, pad_m, other_m):
    """Two or more, on the floor or not, show the wall of what lies beside the wheel."""
    seen = contact_of(other_m[:before] + [0.02] * 8, 1e-3)
    assert seen.pad_m == pytest.approx(pad_m, abs=1e-12)


def test_points_within_three_standard_deviations_of_a_pad_are_its_own():
    pad = [0.02] * 6
    for off_m, is_on in ((2.9e-3, True), (4e-3, False)):
        seen = contact_of([*pad, 0.02 + off_m, *pad], 1e-3)
        assert seen.pad_m == pytest.approx(0.02 + is_on * off_m / 13, abs=1e-12)
        assert seen.u_m == pytest.approx(1e-3 / np.sqrt(12 + is_on))


@pytest.mark.parametrize("sidewall", [9, 10])
def test_a_sidewall_has_ten_points(sidewall):
    assert (contact_of([0.02] * 8, 1e-3, sidewall).pad_m > 0.0) == (sidewall >= 10)


def test_a_target_and_what_stands_beside_the_wheel_are_no_sidewall():
    """A plate in front of the wheel, 0.16 m above the floor, and a post half a metre beside it."""
    heights_m, wheel = np.linspace(0.07, 0.14, 12), WHEELS[1]
    pad = above_wheel(wheel, [-0.04, -0.02, 0.0, 0.02], 0.03)
    alone = np.concatenate([above_wheel(wheel, [-0.06] * 12, heights_m), pad])
    plate = above_wheel(wheel, [-0.03] * 40, np.linspace(0.16, 0.4, 40))
    post = above_wheel(wheel, [0.5] * 12, heights_m)
    for points in (alone, np.concatenate([alone, plate, post])):
        above_m = points[:, 2] - LEVEL - points[:, :2] @ SLOPES
        seen = find_contact(points, above_m, wheel, 1e-3)
        assert seen.middle_m == pytest.approx(MIDDLES[1], abs=1e-12)
        assert seen.pad_m == pytest.approx(0.03, abs=1e-12)


@pytest.mark.parametrize("pad_m", [0.0, 0.04, 0.059, 0.061, 0.08, 0.1])
def test_the_sidewall_is_above_a_pad(pad_m):
    """20 to 140 mm above pads of up to 100 mm, whose top lies where other wheels' sidewalls do.

    A target before the wheel, 210 mm above the floor, is not the sidewall.
    """
    wheel = WHEELS[1]
    heights_m = np.concatenate([pad_m + np.linspace(0.02, 0.14, 30), np.full(8, pad_m)])
    out_m = [-0.06] * 30 + [0.0, 0.02, 0.04, 0.06] * 2
    with_target = np.append(heights_m, np.linspace(0.21, 0.29, 200)), [*out_m, *[0.09] * 200]
    for above_m, aside_m in ((heights_m, out_m), with_target):
        points = above_wheel(wheel, aside_m, above_m)
        seen = find_contact(points, above_m, wheel, 1e-3)
        assert seen.middle_m == pytest.approx(MIDDLES[1], abs=1e-12)
        assert seen.pad_m == pytest.approx(pad_m, abs=1e-12)
