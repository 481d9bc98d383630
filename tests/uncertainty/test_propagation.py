"""Uncertainty of every quantity: against Monte Carlo, and with the right derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.support.given import components
from tests.support.plain_geometry import all_plain
from tests.support.scenes import rotation
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.uncertainty.components import UncertaintyComponent
from wheelplane.uncertainty.propagation import effective_dof, effects_of, propagate
from wheelplane.vehicle.definitions import VEHICLE, WHEEL
from wheelplane.vehicle.frame import REFERENCE_WHEELS
from wheelplane.vehicle.jacobian import jacobian

ARCSEC = np.pi / 648_000
WHEELS = [*REFERENCE_WHEELS, "FR", "RL"]
NAMES = [f"{index}.{entry.name}" for entry in WHEEL for index in range(len(WHEELS))]
NAMES += [entry.name for entry in VEHICLE]
BY_CENTRES = np.array(  # alone: lengths, but those along the thrust line, and axes through centres
    [
        ("thrust" not in name and "." not in name and unit == "m")
        or name in ("centreline_angle", "side_bisector_angle", "rear_squareness")
        for name, unit in zip(
            NAMES, ["rad"] * 6 * len(WHEEL) + [e.unit for e in VEHICLE], strict=True
        )
    ]
)


def spread(rng, scale):
    """A covariance (3, 3) of unequal axes, about scale^2."""
    R = rotation(rng)
    return (R * (scale * rng.uniform(0.3, 2.0, 3)) ** 2) @ R.T


def car(seed, centre_m=1e-4, normal_rad=20 * ARCSEC):
    """Six targets, the last two trials, on a car in a random pose, each with its own covariance."""
    rng = np.random.default_rng(seed)
    R, t = rotation(rng), rng.uniform(-9, 9, 3)
    positions = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.74, 0.01], [2.62, 0.76, 0.0]])
    positions = np.concatenate([positions, positions[[2, 1]] + 0.003]) + rng.uniform(
        -0.01, 0.01, (6, 3)
    )
    fitted = []
    for position, wheel in zip(positions, WHEELS, strict=True):
        out = 1.0 if wheel.endswith("L") else -1.0
        normal = np.array([rng.uniform(-0.3, 0.3), out, rng.uniform(-0.06, 0.06)])
        normal = R @ (normal / np.linalg.norm(normal))
        across = np.eye(3) - np.outer(normal, normal)
        fitted.append(
            TargetFit(
                centre_m=R @ position + t,
                normal=normal * rng.choice([-1, 1]),
                components=components(
                    spread(rng, centre_m), across @ spread(rng, normal_rad) @ across
                ),
                plane_rms_m=8e-4,
                points_on_target=1000,
                method="rim",
            )
        )
    return fitted


def values(targets):
    """All quantities (Q,), by plain geometry."""
    centres = np.stack([target.centre_m for target in targets])
    centres = centres[:4] - centres[:4].mean(axis=0)
    return all_plain(centres, np.stack([target.normal for target in targets]), WHEELS)


def stated(targets):
    return propagate(targets, WHEELS).standard


def perturbed(targets, rng):
    moved = []
    for target in targets:
        shift = rng.multivariate_normal(np.zeros(3), target.centre_covariance_m2)
        tilt = rng.multivariate_normal(np.zeros(3), target.normal_covariance, check_valid="ignore")
        moved.append(replace(target, centre_m=target.centre_m + shift, normal=target.normal + tilt))
    return moved


DRAWS = 1500


def scatter(seed, centre_m, normal_rad):
    """Standard deviations over draws about the truth."""
    targets = car(seed, centre_m, normal_rad)
    rng = np.random.default_rng([seed, 1])
    truth = values(targets)
    errors = np.array([values(perturbed(targets, rng)) - truth for _ in range(DRAWS)])
    return targets, np.sqrt(np.mean(errors**2, axis=0))


# A standard deviation from n draws is known to 1/sqrt(2 n); 4.5 of them: 83 quantities, 3 cases.
LIMIT = 4.5 / np.sqrt(2 * DRAWS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "centre_m", "normal_rad"),
    [(0, 1e-4, 20 * ARCSEC), (1, 5e-4, 1 * ARCSEC), (2, 1e-6, 60 * ARCSEC)],
)
def test_formula_and_monte_carlo_agree(seed, centre_m, normal_rad):
    targets, deviation = scatter(seed, centre_m, normal_rad)
    ratio = stated(targets) / deviation
    np.testing.assert_allclose(ratio, 1.0, rtol=0, atol=LIMIT)
    for factor in (0.5, 2.0):
        wrong = [
            replace(
                t,
                components=components(
                    t.centre_covariance_m2 * factor**2, t.normal_covariance * factor**2
                ),
            )
            for t in targets
        ]
        assert np.all(np.abs(stated(wrong) / deviation - 1.0) > LIMIT)


def test_zero_input_gives_zero_and_each_part_counts():
    targets = car(3)
    np.testing.assert_array_equal(stated([replace(t, components=()) for t in targets]), 0.0)
    whole = stated(targets) ** 2
    centres = stated([replace(t, components=t.components[1:]) for t in targets]) ** 2
    normals = stated([replace(t, components=t.components[:1]) for t in targets]) ** 2
    np.testing.assert_allclose(centres + normals, whole, rtol=1e-9)
    assert np.all(normals[BY_CENTRES] == 0.0)
    assert np.all(normals[~BY_CENTRES] > 0.0)
    assert np.count_nonzero(BY_CENTRES) == 6 + 3 + 6
    assert np.all(centres > 0.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_rotation_and_shift_change_nothing(seed, shift):
    targets = car(seed)
    R = rotation(np.random.default_rng(seed + 50))
    moved = [
        replace(
            t,
            centre_m=R @ t.centre_m + shift,
            normal=R @ t.normal,
            components=components(R @ t.centre_covariance_m2 @ R.T, R @ t.normal_covariance @ R.T),
        )
        for t in targets
    ]
    # The centres' rounding moves the point where the slopes are taken by 2 nm in a metre or two.
    np.testing.assert_allclose(stated(moved), stated(targets), rtol=1e-6)


def test_sign_of_a_normal_does_not_matter():
    targets = car(5)
    flipped = [replace(t, normal=-t.normal) for t in targets]
    np.testing.assert_allclose(stated(flipped), stated(targets), rtol=1e-9)


def test_centres_alone_by_hand():
    """DOMAIN: yaw and roll of the frame are sqrt(2) s / track; the other axle does not matter."""
    s, track = 1e-4, 1.5
    places = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.75, 0], [2.6, 0.75, 0]])
    targets = [
        TargetFit(
            p,
            np.array([0.0, np.sign(p[1]), 0.0]),
            components(s**2 * np.eye(3), np.zeros((3, 3))),
            0.0,
            1,
            "rim",
        )
        for p in places
    ]
    u = propagate(targets, list(REFERENCE_WHEELS))
    of = u.vehicle_standard
    np.testing.assert_allclose(u.toe_rad, np.sqrt(2) * s / track, rtol=1e-6)
    np.testing.assert_allclose(u.camber_rad, np.sqrt(2) * s / track, rtol=1e-6)
    assert of["rear_total_toe"] < 1e-6 * s  # yaw changes left and right by opposite signs
    assert of["front_total_toe"] < 1e-6 * s
    assert of["thrust_angle"] == pytest.approx(np.sqrt(2) * s / track, rel=1e-6)
    assert of["rear_track"] == pytest.approx(np.sqrt(2) * s, rel=1e-6)
    assert of["wheelbase"] == pytest.approx(s, rel=1e-6)
    # Two centres; two more turn the axle that it is counted from, over as long a front axle.
    assert of["front_setback"] == pytest.approx(2 * s, rel=1e-6)
    assert of["wheelbase_difference"] == pytest.approx(2 * s, rel=1e-6)
    assert of["axle_offset"] == pytest.approx(s * np.sqrt(1 + 2 * (2.6 / track) ** 2), rel=1e-6)
    # The middles of both axles, s / sqrt(2) each, and the rear axle that it is compared with.
    squareness = s * np.sqrt((0.5 + 0.5) / 2.6**2 + 2 / track**2)
    assert of["rear_squareness"] == pytest.approx(squareness, rel=1e-6)


def by_differences(targets, step=1e-6):
    """Derivatives (Q, 6 W) of all quantities by every normal and centre."""
    columns = []
    for index, target in enumerate(targets):
        for part in ("normal", "centre_m"):
            for axis in range(3):
                ends = []
                for sign in (1.0, -1.0):
                    moved = getattr(target, part).copy()
                    moved[axis] += sign * step
                    there = [*targets]
                    there[index] = replace(target, **{part: moved})
                    ends.append(values(there))
                columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_jacobian_is_that_of_central_differences(seed):
    targets = car(seed)
    centres = np.stack([target.centre_m for target in targets[:4]])
    J = jacobian(centres, np.stack([target.normal for target in targets]), WHEELS)
    wanted = by_differences(targets)
    # A third derivative of order 1 times step^2, and rounding of 1e-15 over the step.
    np.testing.assert_allclose(J, wanted, rtol=0, atol=1e-8)
    assert np.abs(wanted).max(axis=1).min() > 0.1  # every quantity moves
    assert np.count_nonzero(np.abs(wanted).max(axis=0) > 0.1) == 6 * 3 + 4 * 3


def covariance_by_differences(targets):
    J = by_differences(targets)
    whole = np.zeros((6 * len(targets), 6 * len(targets)))
    for index, target in enumerate(targets):
        rows = slice(6 * index, 6 * index + 6)
        whole[rows, rows] = target.covariance
    return J @ whole @ J.T


def test_covariance_is_complete_and_its_budget_adds_up():
    targets = car(7)
    known = propagate(targets, WHEELS)
    wanted = covariance_by_differences(targets)
    scale = np.sqrt(np.diag(wanted))
    difference = (known.covariance - wanted) / np.outer(scale, scale)
    assert np.abs(difference).max() < 1e-6
    assert np.abs(wanted / np.outer(scale, scale) - np.diag(np.ones(len(scale)))).max() > 0.3
    np.testing.assert_allclose(
        known.contributions.sum(axis=1), np.diag(known.covariance), rtol=1e-12
    )
    assert known.components == ("plane noise", "centre noise")
    np.testing.assert_allclose(known.through_frame, known.contributions[:, 1], rtol=1e-12)


def test_total_toe_depends_less_on_the_frame_than_its_toes():
    """DOMAIN: an error of the frame adds to one toe what it subtracts from the other."""
    targets = car(8)
    known = propagate(targets, WHEELS)
    share = known.through_frame / np.diag(known.covariance)
    for total, pair in (
        (NAMES.index("rear_total_toe"), (0, 1)),
        (NAMES.index("front_total_toe"), (2, 3)),
    ):
        assert known.through_frame[total] < 1e-3 * known.through_frame[list(pair)].min()
        assert share[total] < 1e-3
        assert share[list(pair)].min() > 0.05
        # Independent toes would add up; the shared frame makes them cancel.
        apart = known.standard[list(pair)] @ known.standard[list(pair)]
        assert known.standard[total] ** 2 < 0.95 * apart


def test_shared_components_act_on_all_targets_at_once():
    """The same shift of all four centres moves no angle; four apart do."""
    shift = np.vstack([np.zeros((3, 3)), 1e-3 * np.eye(3)])
    together = [
        replace(t, components=(UncertaintyComponent("shift", shift, shared="s"),)) for t in car(9)
    ]
    apart = [replace(t, components=(UncertaintyComponent("shift", shift),)) for t in together]
    assert stated(together).max() < 1e-12
    assert stated(apart).min() > 1e-6  # rear toe to the thrust line is half a total: 9e-6


def test_degrees_of_freedom_by_welch_and_satterthwaite():
    targets = car(10)
    noisy = [
        replace(t, components=(replace(t.components[0], dof=8.0), t.components[1])) for t in targets
    ]
    known = propagate(noisy, WHEELS)
    own = known.contributions[0, 0] / known.contributions[0].sum()
    assert known.dof[0] == pytest.approx(8.0 / own**2, rel=1e-9)  # one plane of 8 degrees
    total = NAMES.index("rear_total_toe")
    assert 8.0 < known.dof[total] <= 16.0  # two planes, of 8 degrees each
    pooled = [
        replace(t, components=(replace(t.components[0], pooled=True), t.components[1]))
        for t in noisy
    ]
    assert propagate(pooled, WHEELS).dof[total] == pytest.approx(8.0, rel=1e-3)
    assert np.all(np.isinf(propagate(targets, WHEELS).dof))
    np.testing.assert_allclose(known.coverage_factor, stats.t.ppf(0.975, known.dof), rtol=1e-9)
    assert propagate(targets, WHEELS).coverage_factor == pytest.approx(stats.norm.ppf(0.975))


@pytest.mark.parametrize("seed", range(3))
def test_the_contributions_of_all_components_are_the_variance(seed):
    known = propagate(car(seed), WHEELS)
    assert known.contributions.min() >= 0.0
    variance = np.diag(known.covariance)
    np.testing.assert_allclose(known.contributions.sum(axis=1), variance, rtol=1e-12, atol=1e-30)


@pytest.mark.parametrize(("pooled", "dof"), [(None, 16.0), (False, 16.0), (True, 8.0)])
def test_a_pooled_estimate_is_one_and_two_of_one_size_have_twice_its_dof(pooled, dof):
    """Noise of two targets, each with 8 degrees of freedom, independent unless it is stated."""
    choice = {} if pooled is None else {"pooled": pooled}
    noise = UncertaintyComponent("noise", np.eye(6)[:, :1], 8.0, **choice)
    targets = [replace(car(1)[i], components=(noise,)) for i in range(2)]
    effects = effects_of(targets)
    found = effective_dof(effects, [np.ones(1), np.ones(1)], np.array([2.0]))
    assert found == pytest.approx([dof])
