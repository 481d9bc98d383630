"""Axis and centre of a wheel, with their uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tests.support.round_wheels import (
    EDGE_M,
    GROOVE_M,
    MERIDIAN,
    angle_between,
    aside,
    axis_of,
    door_points,
    seen_from,
    wheel_points,
)
from wheelplane.errors import NotMeasuredError
from wheelplane.wheel.find_wheel import find_wheel
from wheelplane.wheel.fit_wheel import fit_wheel

# The outer one of a lorry's twin wheels, of 22.5 inches: the disc of its rim lies far behind.
TWIN = np.array(
    [(0.10, -0.160), (0.22, -0.155), (0.235, -0.12), (0.27, -0.03), (0.283, -0.012),
     (0.290, -0.002), (0.2955, 0.0), (0.2985, -0.001), (0.3005, -0.005), (0.303, -0.009),
     (0.308, -0.004), (0.33, 0.012), (0.37, 0.024), (0.41, 0.026), (0.45, 0.016),
     (0.485, -0.010), (0.497, -0.030), (0.50, -0.070)]
)  # fmt: skip


def scene(seed, **given):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    wheel = wheel_points(rng, centre, direction, **given)
    return np.concatenate([wheel, door_points(rng, centre, direction)]), centre, direction


@pytest.mark.parametrize(
    ("seed", "meridian"), [*((seed, MERIDIAN) for seed in range(4)), (4, TWIN), (5, TWIN)]
)
def test_axis_and_centre_lie_within_their_uncertainty(seed, meridian):
    as_dense = round(60_000 * (meridian[-1, 0] / MERIDIAN[-1, 0]) ** 2)
    points, centre, direction = scene(seed, meridian=meridian, count=as_dense)
    found = fit_wheel(find_wheel(points), None)
    C = found.covariance
    assert found.method == "flange"
    assert angle_between(found.normal, direction) < 4.5 * np.sqrt(np.trace(C[:3, :3]))
    assert aside(found.centre_m, centre, direction) < 4.5 * np.sqrt(np.trace(C[3:, 3:]))
    along = (found.centre_m - centre) @ direction
    assert abs(along) < 4.0 * np.sqrt(direction @ C[3:, 3:] @ direction)
    assert np.sqrt(np.trace(C[:3, :3])) < np.radians(1.5 / 60.0)


def test_a_rim_that_stands_out_and_is_not_the_stated_one_is_refused():
    patch = find_wheel(scene(4)[0])
    assert fit_wheel(patch, 17.5).method == "flange"
    with pytest.raises(NotMeasuredError, match=r"14 inches has it, but that of a rim of 17\."):
        fit_wheel(patch, 14.0)


def test_a_stated_rim_is_believed_where_noise_hides_what_stands_out():
    patch = find_wheel(scene(4, noise_m=0.003, count=15_000)[0])
    assert fit_wheel(patch, 14.0).method == "tyre"


def test_a_moved_wheel_gives_the_moved_result():
    points, _, _ = scene(5)
    one = fit_wheel(find_wheel(points), None)
    shift = np.array([100.0, -50.0, 20.0])
    other = fit_wheel(find_wheel(points + shift), None)
    u = np.sqrt(np.trace(one.covariance[:3, :3]))
    assert angle_between(one.normal, other.normal) < u
    assert np.linalg.norm(other.centre_m - shift - one.centre_m) < 1e-4


def test_more_noise_is_more_uncertainty():
    fits = [fit_wheel(find_wheel(scene(6, noise_m=s)[0]), None) for s in (0.0005, 0.002)]
    size = [np.sqrt(np.trace(fit.covariance[:3, :3])) for fit in fits]
    assert size[1] > 2.0 * size[0]


def test_without_a_flange_it_is_the_tyre_and_its_waves_count():
    smooth = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]
    points, centre, direction = scene(7, meridian=smooth, wave_m=0.0005)
    found = fit_wheel(find_wheel(points), None)
    assert found.method == "tyre"
    runout = next(c for c in found.components if c.name == "tyre run-out")
    assert np.sqrt(np.trace(runout.covariance[:3, :3])) > 0.5 * 0.0005 / 0.285
    assert angle_between(found.normal, direction) < np.radians(3.0 / 60.0)
    assert 0.005 < (found.centre_m - centre) @ direction < 0.015


def test_a_bulge_that_noise_hides_is_in_the_uncertainty_of_a_tyre_s_level():
    """9 mm high on a sixth of the circle, among 4 mm of noise: no cell shows it."""
    smooth = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]
    errors = []
    for seed in range(8, 11):
        points, centre, direction = scene(seed, meridian=smooth, noise_m=0.004)
        local = points - centre
        away = local - (local @ direction)[:, None] * direction
        radius = np.linalg.norm(away, axis=1)
        side = np.cross(direction, [0.3, 0.5, 0.8])
        turn = np.arccos(np.clip(away @ side / radius / np.linalg.norm(side), -1.0, 1.0))
        bulge = np.where(radius > 0.25, 0.009 * np.exp(-0.5 * (turn / 0.33) ** 2), 0.0)
        found = fit_wheel(find_wheel(points + bulge[:, None] * direction), None)
        assert found.method == "tyre"
        u = np.sqrt(direction @ found.covariance[3:, 3:] @ direction)
        errors.append(((found.centre_m - centre) @ direction - MERIDIAN[:, 1].max()) / u)
    assert np.sum(np.square(errors)) < chi2.ppf(0.999, len(errors))


def test_a_tyre_that_is_hidden_in_part_is_no_axis():
    smooth = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]
    points, centre, direction = scene(7, meridian=smooth, wave_m=0.0005)
    side = np.cross(direction, [0.3, 0.5, 0.8])
    up = (points - centre) @ (side / np.linalg.norm(side))
    with pytest.raises(NotMeasuredError, match=r"of the tyre's side wall \d\d% is seen") as error:
        fit_wheel(find_wheel(points[up < 0.2]), None)  # a panel over a quarter of it
    assert error.value.status == "wheel-not-found"


def test_the_outer_flank_of_the_flange_seen_from_one_side_does_not_tilt_the_axis():
    """It moves no axis by 0.3', and the axes are that near to the true ones, rms of four wheels."""
    off_rad = []
    for seed in range(10, 14):
        points, centre, direction = scene(seed)
        local = points - centre
        height = local @ direction
        off = local - height[:, None] * direction
        radius = np.linalg.norm(off, axis=1)
        side = np.cross(direction, [0.3, 0.5, 0.8])
        flank = (radius > EDGE_M + 0.002) & (radius < GROOVE_M) & (np.abs(height) < 0.01)
        plain = fit_wheel(find_wheel(points), None)
        lifted = 0.0004 * (off @ (side / np.linalg.norm(side))) / radius
        points[flank] += lifted[flank, None] * direction
        found = fit_wheel(find_wheel(points), None)
        assert angle_between(found.normal, plain.normal) < np.radians(0.3 / 60.0)
        off_rad.append(angle_between(found.normal, direction))
    assert np.sqrt(np.mean(np.square(off_rad))) < np.radians(0.3 / 60.0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("groove", [True, False])
def test_the_axis_points_outwards_whatever_lies_behind_the_rim(seed, groove):
    """A patch that faces inwards gives what one that faces outwards gives."""
    smooth = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]
    points, _, direction = scene(40 + seed, meridian=MERIDIAN if groove else smooth)
    right, wrong = (fit_wheel(find_wheel(points, outward=s * direction), None) for s in (1, -1))
    assert wrong.normal @ direction > 0.99
    assert right.method == wrong.method == ("flange" if groove else "tyre")
    u = np.sqrt(np.trace(right.covariance[3:, 3:]))
    assert np.linalg.norm(right.centre_m - wrong.centre_m) < 2.0 * u


@pytest.mark.parametrize("seed", range(20, 26))
def test_few_points_seen_aslant_lie_within_their_uncertainty(seed):
    """A flange bends within rings that are wide enough for few points; each side shows less."""
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    across = np.cross(direction, rng.normal(size=3))
    across /= np.linalg.norm(across)
    sight = np.cos(np.radians(40.0)) * direction + np.sin(np.radians(40.0)) * across
    points = wheel_points(rng, centre, direction, count=16_000)
    points = seen_from(rng, points, centre, direction, sight)
    found = fit_wheel(find_wheel(points, outward=direction), None)
    C = found.covariance
    assert found.method == "flange"
    assert angle_between(found.normal, direction) < 4.5 * np.sqrt(np.trace(C[:3, :3]))
    assert aside(found.centre_m, centre, direction) < 4.5 * np.sqrt(np.trace(C[3:, 3:]))
    assert angle_between(found.normal, direction) < np.radians(6.0 / 60.0)
    assert abs((found.centre_m - centre) @ direction) < 0.0005


def started_far(patch):
    """The patch with its start 5 degrees and 35 mm off."""
    tilt = np.radians(5.0)
    a, b, c = patch.basis
    basis = np.stack([a, np.cos(tilt) * b - np.sin(tilt) * c, np.sin(tilt) * b + np.cos(tilt) * c])
    shift = 0.035 * a
    return replace(patch, origin_m=patch.origin_m + shift, face_m=patch.face_m - shift, basis=basis)


def test_a_far_start_leads_to_the_same_axis():
    rng = np.random.default_rng(30)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, count=25_000, noise_m=0.003)
    patch = find_wheel(points, outward=direction)
    near, far = fit_wheel(patch, None), fit_wheel(started_far(patch), None)
    u = np.sqrt(np.trace(near.covariance[:3, :3]))
    assert angle_between(near.normal, direction) < 4.5 * u
    assert angle_between(far.normal, near.normal) < 2.0 * u


def test_an_axis_that_still_moves_is_not_stated(monkeypatch):
    points, _, _ = scene(31, noise_m=0.003)
    patch = started_far(find_wheel(points))
    fit_wheel(patch, None)
    for bound in ("ROUNDS", "STARTS"):
        monkeypatch.setattr(f"wheelplane.wheel.fit_axis.{bound}", 1)
    with pytest.raises(NotMeasuredError, match="the axis still moves by") as caught:
        fit_wheel(patch, None)
    assert caught.value.status == "wheel-not-found"


def test_a_patch_without_a_point_on_the_wheel_is_refused():
    patch = find_wheel(scene(0)[0])
    with pytest.raises(NotMeasuredError, match="no point") as caught:
        fit_wheel(replace(patch, face_m=patch.face_m[:0]), None)
    assert caught.value.status == "wheel-not-found"


def test_half_a_wheel_is_not_measured():
    points, centre, direction = scene(8)
    side = np.cross(direction, [0.3, 0.5, 0.8])
    half = points[(points - centre) @ side > 0.05]
    with pytest.raises(NotMeasuredError) as caught:
        fit_wheel(find_wheel(half), None)
    assert caught.value.status in ("wheel-not-found", "too-few-points")
