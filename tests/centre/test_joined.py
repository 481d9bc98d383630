"""Fits of one target by several stations: their mean, its uncertainty, and the note on it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.centre.joined import joined
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.config import InstrumentConfig
from wheelplane.uncertainty import UncertaintyComponent

NOTHING = InstrumentConfig()
NORMAL = np.array([0.0, 0.0, 1.0])
NOISE_RAD, NOISE_M = 1e-4, 2e-5


def fit_at(pose, u_rad=NOISE_RAD, u_m=NOISE_M, aside_m=None, points=1000):
    """A fit of the pose (6,): a small turn of NORMAL, and a centre."""
    factor = np.diag([u_rad, u_rad, 0.0, *2 * [u_m if aside_m is None else aside_m], u_m])
    normal = NORMAL + np.append(pose[:2], 0.0)
    parts = (UncertaintyComponent("plane noise", factor),)
    return TargetFit(
        np.asarray(pose[3:]), normal / np.linalg.norm(normal), parts, 8e-4, points, "rim"
    )


def moved(fit, R, shift_m):
    parts = tuple(
        replace(p, factor=np.vstack([R @ p.factor[:3], R @ p.factor[3:]])) for p in fit.components
    )
    return replace(
        fit, normal=R @ fit.normal, centre_m=R @ fit.centre_m + shift_m, components=parts
    )


def test_one_station_is_as_it_was():
    fit = fit_at(np.zeros(6))
    assert joined([fit], NOTHING) is fit


def test_stations_that_agree_are_weighted_by_their_noise():
    fits = [fit_at(np.zeros(6)), fit_at(np.zeros(6), 2 * NOISE_RAD, 2 * NOISE_M)]
    found = joined(fits, NOTHING)
    assert [part.name for part in found.components] == ["plane noise"]
    expected = fits[0].covariance * (1.0 / (1.0 + 1.0 / 4.0))
    np.testing.assert_allclose(found.covariance, expected, atol=1e-18)
    assert not found.stations.significant
    assert found.points_on_target == 2000


@pytest.mark.parametrize("row", [0, 3, 5])
def test_half_of_a_clear_difference_of_two_is_uncertain(row):
    """Of the mean, in the quantity in which they differ; of two axes together where it has two."""
    pose = np.zeros(6)
    pose[row] = 0.002
    found = joined([fit_at(np.zeros(6)), fit_at(pose)], NOTHING)
    mean = np.append(found.normal[:2], np.append(0.0, found.centre_m))
    np.testing.assert_allclose(mean, pose / 2, atol=0.002**3)
    block = {0: [0, 1], 3: [3, 4], 5: [5]}[row]
    total = np.trace(found.covariance[np.ix_(block, block)])
    assert total == pytest.approx(0.001**2, rel=0.02)
    assert found.stations.significant
    assert (found.stations.tilt_rad if row == 0 else found.stations.shift_m) == pytest.approx(
        0.002, rel=1e-3
    )


def test_what_a_fit_hides_of_the_shift_is_taken_from_that_along_the_normal():
    other = fit_at(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.002]), aside_m=0.1)
    found = joined([fit_at(np.zeros(6)), other], NOTHING)
    s = 0.002 / np.sqrt(2.0)
    u = np.sqrt(np.diag(found.covariance)[3:5])
    np.testing.assert_allclose(u, s, rtol=0.05)
    blind = joined([fit_at(np.zeros(6)), fit_at(np.zeros(6), aside_m=0.1)], NOTHING)
    assert np.sqrt(blind.covariance[3, 3]) == pytest.approx(NOISE_M, rel=0.01)


@pytest.mark.parametrize("stations", [2, 3])
def test_errors_are_as_large_as_stated_on_average(stations):
    """Registration errors drawn for every station; squares of errors and of u, 600 draws."""
    rng = np.random.default_rng(stations)
    square, stated = np.zeros(3), np.zeros(3)
    s_rad, s_m = 8e-4, 1e-3
    for _ in range(600):
        size = np.array([s_rad, s_rad, 0.0, s_m, s_m, s_m])
        noise = np.array([NOISE_RAD, NOISE_RAD, 0.0, NOISE_M, NOISE_M, NOISE_M])
        draws = rng.normal(size=(2, stations, 6))
        found = joined([fit_at(size * a + noise * b) for a, b in zip(*draws, strict=True)], NOTHING)
        error = np.append(found.normal, found.centre_m) - [0, 0, 1, 0, 0, 0]
        u2 = np.diag(found.covariance)
        for k, rows in enumerate(([0, 1], [3, 4], [5])):
            square[k] += np.sum(error[rows] ** 2)
            stated[k] += np.sum(u2[rows])
    # Variance of the mean of squares of 600 draws: 2 / 600, and of s^2 by one degree of freedom.
    np.testing.assert_allclose(square / stated, 1.0, atol=4.0 * np.sqrt(4.0 / 600))


def test_what_a_file_states_is_no_disagreement():
    pose = np.array([0.0, 0.0, 0.0, 0.0007, 0.0, 0.0006])
    fits = [fit_at(np.zeros(6)), fit_at(pose)]
    assert joined(fits, NOTHING).stations.significant
    found = joined(fits, InstrumentConfig(registration_m=0.0005))
    assert not found.stations.significant
    assert [part.name for part in found.components] == ["plane noise"]
    assert found.stations.share == pytest.approx(np.sqrt(0.5))


def test_small_differences_are_noted_once_in_thousands():
    rng = np.random.default_rng(0)
    noise = np.array([NOISE_RAD, NOISE_RAD, 0.0, NOISE_M, NOISE_M, NOISE_M])
    found = [
        joined([fit_at(noise * rng.normal(size=6)) for _ in range(2)], NOTHING).stations
        for _ in range(1000)
    ]
    assert sum(one.significant for one in found) <= 1


def test_sign_order_and_place_do_not_matter():
    rng = np.random.default_rng(1)
    poses = [rng.normal(size=6) * [1e-3, 1e-3, 0, 1e-3, 1e-3, 1e-3] for _ in range(3)]
    fits = [fit_at(pose, u_m=NOISE_M * (1 + k)) for k, pose in enumerate(poses)]
    found = joined(fits, NOTHING)
    flipped = [fits[0], replace(fits[1], normal=-fits[1].normal), fits[2]]
    others = joined([fits[0], fits[2], fits[1]], NOTHING)
    R, shift = rotation(rng), np.array([5.0, -3.0, 2.0])
    there = joined([moved(fit, R, shift) for fit in fits], NOTHING)
    expected = moved(found, R, shift)
    for one, other in ((joined(flipped, NOTHING), found), (others, found), (there, expected)):
        np.testing.assert_allclose(one.normal, other.normal, atol=1e-12)
        np.testing.assert_allclose(one.centre_m, other.centre_m, atol=1e-12)
        np.testing.assert_allclose(one.covariance, other.covariance, atol=1e-14)


def test_a_form_of_the_target_is_not_averaged():
    parts = (UncertaintyComponent("flatness", np.diag([1e-4, 1e-4, 0.0, 0.0, 0.0, 1e-5]), 8.0),)
    fits = [replace(fit_at(np.zeros(6)), components=parts) for _ in range(2)]
    found = joined(fits, NOTHING)
    np.testing.assert_allclose(found.covariance, fits[0].covariance, atol=1e-18)
    assert found.components[0].dof == 8.0
