"""Two methods on the same wheels: agreement, errors that are seen, frame apart from planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.scenes import rotation
from tests.support.validation_cars import TM30, Car, points
from wheelplane.errors import Doubt, InputError
from wheelplane.report.text.validation import validation_text
from wheelplane.validation.comparison import ComparedMethod, check_alike, compare
from wheelplane.validation.five_point import FivePointOptions
from wheelplane.validation.frame_effect import rigid_rotation, shape_of
from wheelplane.validation.statistics.joint_test import ErrorSource, Spread
from wheelplane.validation.statistics.power import (
    captures_needed,
    detectable_alone,
    detectable_jointly,
)
from wheelplane.validation.tcgc_2013 import old_angles
from wheelplane.vehicle.angles import wheel_angles
from wheelplane.vehicle.frame import build_reference_frame

CARS = 150
DRAWS = 300
FINE = TM30.model_copy(update={"range_sigma_m": 3e-5, "aiming_sigma_m": 0.0})


def passed(found):
    """How many of them agree."""
    return sum(one.joint.agrees for one in found)


def bounds(share, count=CARS):
    """Counts outside which one of a thousand honest runs falls on either side."""
    return stats.binom.ppf([0.001, 0.999], count, share)


@pytest.mark.slow
def test_right_methods_agree_in_95_percent():
    low, high = bounds(0.95)
    assert low <= passed([Car(seed).compare() for seed in range(CARS)]) <= high
    for wrong in (0.5, 2.0):  # an instrument that is not what it is said to be
        count = passed([Car(seed).compare(scale=wrong) for seed in range(CARS)])
        assert not low <= count <= high


def test_a_scale_that_was_estimated_is_allowed_for():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(8, 8))
    values, known = [], []
    for _ in range(2000):
        source = ErrorSource(root * np.sqrt(rng.chisquare(6) / 6), 6.0)
        test = Spread.of(np.eye(8), [source]).test(root @ rng.normal(size=8))
        values.append(test.probability)
        known.append(stats.chi2.sf(test.chi_square, 8))
        assert test.dof == pytest.approx(6.0)
    assert stats.kstest(values, "uniform").pvalue > 1e-3
    assert stats.kstest(known, "uniform").pvalue < 1e-9


def test_several_estimated_scales_keep_the_level():
    rng = np.random.default_rng(1)
    roots = [rng.normal(size=(8, k)) * s for k, s in ((6, 0.7), (20, 1.0), (10, 1.0))]
    dofs = (np.inf, 8.0, 30.0)
    wrong = 0
    for _ in range(2000):
        difference = sum(r @ rng.normal(size=r.shape[1]) for r in roots)
        scales = [1.0 if np.isinf(f) else np.sqrt(rng.chisquare(f) / f) for f in dofs]
        sources = [ErrorSource(r * s, f) for r, s, f in zip(roots, scales, dofs, strict=True)]
        wrong += not Spread.of(np.eye(8), sources).test(difference).agrees
    # the match is of the first order in 1/nu: 5 % may come out as 7
    assert stats.binom.ppf(0.001, 2000, 0.05) <= wrong <= stats.binom.ppf(0.999, 2000, 0.07)


@pytest.mark.parametrize(("dof", "share"), [(np.inf, 1.0), (7.0, 1.0)])
def test_an_error_of_the_smallest_visible_size_is_seen_in_99_percent(dof, share):
    rng = np.random.default_rng(2)
    root = rng.normal(size=(6, 6))
    runs, alone, joint = 3000, 0, 0
    exact = Spread.of(np.eye(6), [ErrorSource(root, dof)])
    one = np.eye(6)[:, :1]
    size = exact.detectable_jointly(one)
    single = detectable_alone(float(exact.u[0]), dof)
    for _ in range(runs):
        scale = 1.0 if np.isinf(dof) else np.sqrt(rng.chisquare(dof) / dof)
        spread = Spread.of(np.eye(6), [ErrorSource(root * scale, dof)])
        noise = root @ rng.normal(size=6)
        joint += not spread.test(noise + size * one[:, 0]).agrees
        alone += noise[0] + single > spread.expanded[0]
    low, high = stats.binom.ppf([0.001, 0.999], runs, 0.99)
    assert low <= joint <= high
    assert low <= alone <= high


def test_what_is_seen_alone_is_the_sum_of_two_quantiles():
    assert detectable_alone(2.0) == pytest.approx(
        2 * (stats.norm.ppf(0.975) + stats.norm.ppf(0.99))
    )
    limit = stats.t.ppf(0.975, 5)
    assert stats.nct.sf(limit, 5, detectable_alone(1.0, 5)) == pytest.approx(0.99, abs=1e-9)
    assert detectable_jointly(1.0, 1) == pytest.approx(detectable_alone(1.0), rel=1e-6)
    assert detectable_jointly(0.0, 3) == np.inf


def test_captures_needed_are_the_fewest_that_see_it():
    for size, deviation in ((1.0, 1.0), (0.3, 1.0), (5.0, 1.0)):
        count = captures_needed(size, deviation)
        for n, enough in ((count, True), (count - 1, False)):
            if n >= 2:
                limit = stats.t.ppf(0.975, n - 1)
                power = stats.nct.sf(limit, n - 1, size / deviation * np.sqrt(n))
                assert (power >= 0.99) == enough


def test_a_planted_error_is_caught_where_the_tool_says_it_would_be():
    error = np.radians(0.1)
    toe = np.array([0.0, 0.0, error, 0.0])
    found = [Car(seed).compare(station=FINE, toe_error=toe) for seed in range(100)]
    detectable = [one for one in found if one.detectable_in_one_rad < error]
    assert len(detectable) > 90  # where the scatter is by chance beyond what is stated, it is not
    assert passed(detectable) <= stats.binom.ppf(0.999, len(detectable), 0.01)
    assert all(one.difference_rad[2] == pytest.approx(error, abs=error / 2) for one in found)
    # the instrument of the paper cannot see it, and says so
    coarse = [Car(seed).compare(toe_error=toe) for seed in range(10)]
    assert min(one.detectable_in_one_rad for one in coarse) > 2 * error
    blind = replace(coarse[0], to_detect_rad=error)
    assert blind.verdict == ("cannot tell" if blind.joint.agrees else "disagree")
    assert replace(found[0], to_detect_rad=error).verdict == "disagree"
    assert {*replace(Car(3).compare(station=FINE), to_detect_rad=error).verdicts} == {"agree"}


def test_methods_that_agree_on_scans_in_doubt_cannot_tell():
    found = Car(3).compare(station=FINE)
    assert (found.verdict, {*found.verdicts}) == ("agree", {"agree"})
    doubted = replace(found, notes=("A note.", Doubt("All are in doubt.")))
    assert (doubted.verdict, {*doubted.verdicts}) == ("cannot tell", {"cannot tell"})
    trial = replace(found, notes=(Doubt("Trial {trial}.", trial=found.names[-1]),))
    assert trial.verdict == "cannot tell"
    n = len(found.names)
    assert [i % n for i, verdict in enumerate(trial.verdicts) if verdict != "agree"] == [n - 1] * 2
    assert "In doubt: All are in doubt." in validation_text(doubted)
    assert "In doubt" not in validation_text(found)
    wrong = replace(doubted, first=Car(4).compare(station=FINE).first)
    assert wrong.verdict == "disagree"


def turned(method, R, shift):
    """The method in other coordinates."""
    lift = np.kron(np.eye(2), R)
    targets = tuple(
        replace(
            t,
            centre_m=R @ t.centre_m + shift,
            normal=-R @ t.normal,
            components=tuple(replace(c, factor=flip(lift @ c.factor)) for c in t.components),
        )
        for t in method.targets
    )
    return replace(method, targets=targets)


def flip(factor):
    """For a normal of the other sense."""
    return np.vstack([-factor[:3], factor[3:]])


def test_no_choice_of_coordinates_changes_anything():
    car = Car(5, trials=2)
    first, second = car.dense(), car.five()
    moved = turned(second, rotation(np.random.default_rng(3)), np.array([300.0, -20.0, 5.0]))
    one = compare("", car.names, car.wheels, first, second)
    other = compare("", car.names, car.wheels, first, moved)
    for name in ("difference_rad", "frame_rad", "planes_rad", "shape", "en"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=1e-10, rtol=1e-6)
    np.testing.assert_allclose(
        other.planes.covariance, one.planes.covariance, rtol=1e-4, atol=1e-12
    )
    assert other.joint.probability == pytest.approx(one.joint.probability, rel=1e-5)


def tilted(method, wheels, index=None, lean=0.0, shift=None):
    """The method with one plane tilted, or with its centres shifted (4, 3), angles anew."""
    targets = list(method.targets)
    if index is not None:
        axis = np.cross(targets[index].normal, [0.1, 0.2, 0.97])
        normal = targets[index].normal + lean * axis / np.linalg.norm(axis)
        targets[index] = replace(targets[index], normal=normal / np.linalg.norm(normal))
    for i in range(4 if shift is not None else 0):
        targets[i] = replace(targets[i], centre_m=targets[i].centre_m + shift[i])
    frame = build_reference_frame(np.stack([t.centre_m for t in targets[:4]]))
    angles = [wheel_angles(frame, t.normal, w) for t, w in zip(targets, wheels, strict=True)]
    return ComparedMethod(
        method.label,
        tuple(targets),
        np.array([a.toe_rad for a in angles] + [a.camber_rad for a in angles]),
    )


def test_planes_and_frame_are_reported_apart():
    car = Car(6)
    first = tilted(car.dense(normal=0.0, centre=0.0), car.wheels)
    lean = compare("", car.names, car.wheels, first, tilted(first, car.wheels, 1, 1e-3))
    np.testing.assert_allclose(lean.frame_rad, 0.0, atol=1e-12)
    np.testing.assert_allclose(lean.planes_rad[[0, 2, 3, 4, 6, 7]], 0.0, atol=1e-12)
    assert np.hypot(*lean.planes_rad[[1, 5]]) == pytest.approx(1e-3, rel=0.01)
    # front left centre 3 mm forward: a new shape; the planes hold still up to the fitted motion
    forward = build_reference_frame(car.centres[:4]).forward
    shift = np.zeros((4, 3))
    shift[1] = 3e-3 * forward
    bent = compare("", car.names, car.wheels, first, tilted(first, car.wheels, shift=shift))
    yaw = 3e-3 / bent.first.state[1, 3:].dot(bent.first.state[1, 3:]) ** 0.5
    assert np.abs(bent.difference_rad[:4]).min() > 1e-3
    np.testing.assert_allclose(bent.frame_rad + bent.planes_rad, bent.difference_rad, atol=1e-15)
    assert np.abs(bent.planes_rad).max() < yaw < np.abs(bent.frame_rad[:4]).max() * 2
    R = rigid_rotation(car.centres[:4] + shift, car.centres[:4])
    seen = Rotation.align_vectors(
        car.centres[:4] - car.centres[:4].mean(axis=0),
        car.centres[:4] + shift - (car.centres[:4] + shift).mean(axis=0),
    )[0].as_matrix()
    np.testing.assert_allclose(R, seen, atol=1e-9)


def test_shape_is_that_of_the_centres():
    yaw, tilt = np.radians([0.4, -0.3])
    left, forward, up = np.eye(3)
    across = np.cos(tilt) * (np.cos(yaw) * left + np.sin(yaw) * forward) + np.sin(tilt) * up
    start = 2.6 * forward - 0.012 * across  # where the front axle's line meets the thrust axis
    local = np.array([-0.75 * left, 0.75 * left, start - 0.73 * across, start + 0.77 * across])
    mirror = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])  # left, forward, up is left-handed
    shape = shape_of(local @ mirror)
    offset = (start + 0.02 * across) @ left
    np.testing.assert_allclose(shape, [1.5, 1.5, 2.6, offset, yaw, tilt], atol=1e-12)


@pytest.mark.slow
def test_uncertainties_of_the_parts_are_those_of_draws():
    car = Car(7)
    first, second = car.dense(), car.five()
    found = compare("", car.names, car.wheels, first, second)
    rng = np.random.default_rng(4)
    draws = []
    for _ in range(DRAWS):
        pair = [moved(method, car.wheels, rng) for method in (first, second)]
        one = compare("", car.names, car.wheels, *pair)
        draws.append(np.concatenate([one.difference_rad, one.planes_rad, one.shape]))
    u = np.concatenate([found.spread.u, found.planes.u, found.shape_spread.u])
    ratio = np.std(draws, axis=0) / u
    np.testing.assert_allclose(ratio, 1.0, atol=4.5 / np.sqrt(2 * DRAWS))


def moved(method, wheels, rng):
    targets = []
    for t in method.targets:
        step = sum(c.factor @ rng.standard_normal(c.factor.shape[1]) for c in t.components)
        targets.append(replace(t, normal=t.normal + step[:3], centre_m=t.centre_m + step[3:]))
    return tilted(replace(method, targets=tuple(targets)), wheels)


def test_the_old_estimator_is_ours_where_there_is_no_noise():
    still = {"range_sigma_m": 0.0, "range_sigma_ppm": 0.0, "angle_sigma_arcsec": 0.0}
    for seed in range(4):
        car = Car(seed, trials=3)
        blocks, _ = car.blocks(TM30.model_copy(update=still))
        exact = points(blocks)
        assert np.abs(exact.angles_rad).min() > 1e-6  # so that signs tell
        np.testing.assert_allclose(old_angles(blocks, car.wheels), exact.angles_rad, atol=1e-9)


def test_the_old_estimator_makes_camber_too_large():
    """Noise e across the plane makes sum (c z + e)^2 / sum (c z + e) z of the camber c.

    To second order its mean is c + (n - 3) sigma^2 / (c sum z^2), n = 5 points.
    """
    sigma, excess, expected = 3e-4, [], []
    noisy = TM30.model_copy(update={"range_sigma_m": sigma, "aiming_sigma_m": 0.0})
    for seed in range(250):
        car = Car(seed)
        blocks, place = car.blocks(noisy)
        camber = points(blocks).angles_rad[4:]
        old = old_angles(blocks, car.wheels)[4:]
        keep = np.abs(camber) > np.radians(0.8)
        across = np.array([abs(n @ (c - place)) / np.linalg.norm(c - place)
                           for n, c in zip(car.normals, car.centres, strict=True)])  # fmt: skip
        excess += list((np.abs(old) - np.abs(camber))[keep])
        expected += list(((sigma * across) ** 2 / (np.abs(camber) * 5 * 0.088**2 / 2))[keep])
    error = 3.3 * np.std(excess) / np.sqrt(len(excess))
    assert np.mean(excess) == pytest.approx(2 * np.mean(expected), abs=error)
    assert np.mean(excess) > 2 * error


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c * 1000, "check the length units"),
        (lambda c: c[[2, 3, 0, 1]], "lie at FR,FL,RR,RL"),
        (lambda c: c[[1, 0, 3, 2]], "lie at RL,RR,FL,FR"),
    ],
)
def test_another_unit_or_order_is_refused(change, said):
    car = Car(8)
    first = car.dense()
    centres = change(np.stack([t.centre_m for t in first.targets]))
    targets = tuple(replace(t, centre_m=c) for t, c in zip(first.targets, centres, strict=True))
    with pytest.raises(InputError, match=said) as error:
        check_alike(first, replace(first, label="five points", targets=targets), "five.txt")
    assert "\n" not in str(error.value)
    check_alike(first, car.dense(), "")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"coordinates": "spherical", "angle_unit": "deg"}, r"the angle unit \(--angle-unit deg\)"),
        ({}, "--coordinates spherical"),
    ],
)
def test_five_points_of_another_size_name_the_units_of_their_file(options, said):
    """Angles in gon that are read as degrees move the centres by some percent."""
    car = Car(8)
    first = car.dense()
    targets = tuple(replace(t, centre_m=1.06 * t.centre_m) for t in first.targets)
    units = FivePointOptions(**options).units
    with pytest.raises(InputError, match=f"check .*{said}.*, and that both are of this vehicle"):
        check_alike(first, replace(first, targets=targets), "five.txt", units)
