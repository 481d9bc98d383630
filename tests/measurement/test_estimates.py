"""Sums of estimates: u by the dense covariance, and errors of differences as large as stated."""

import math

import numpy as np
import pytest
from scipy import stats

from tests.support.turning import WHEELS, Scene, mounted, rolled, swept
from wheelplane.measurement.estimates import estimate, joint_covariance, weighted_sum
from wheelplane.measurement.quantities import by_name
from wheelplane.uncertainty.propagation import Effect

STEERS = np.radians([-20.0, -10.0, 0.0, 10.0, 20.0])
CARS = 80


def effects(rng, count):
    shapes = ((1, math.inf), (3, 9.0), (2, 40.0))
    return [Effect(str(k), rng.normal(size=(count, k)), dof, pooled=False) for k, dof in shapes]


@pytest.mark.parametrize("seed", range(3))
def test_a_sum_has_the_u_of_the_dense_covariance(seed):
    rng = np.random.default_rng(seed)
    known = effects(rng, 7)
    covariance = sum(effect.factor @ effect.factor.T for effect in known)
    slopes, weights, own = rng.normal(size=(3, 7)), rng.normal(size=3), rng.uniform(0.0, 2.0, 3)
    terms = [
        (w, estimate(float(i), slope, known, u))
        for i, (w, slope, u) in enumerate(zip(weights, slopes, own, strict=True))
    ]
    total = weights @ slopes
    found = weighted_sum(terms)
    expected = math.sqrt(total @ covariance @ total + np.sum((weights * own) ** 2))
    assert found.value == pytest.approx(weights @ [0.0, 1.0, 2.0])
    assert found.u == pytest.approx(expected, rel=1e-12)
    assert found.u != pytest.approx(np.sqrt(sum((w * t.u) ** 2 for w, t in terms)), rel=0.01)
    assert 9.0 < found.dof < math.inf


def test_what_both_sides_share_cancels_and_a_difference_with_itself_is_certain():
    known = effects(np.random.default_rng(4), 5)
    slope = np.arange(5.0)
    one = estimate(0.3, slope, known)
    assert weighted_sum([(1.0, one), (-1.0, one)]).u == 0.0
    again = estimate(0.3, slope, known, 0.7)
    alone = weighted_sum([(1.0, again), (-1.0, again)])
    assert alone.u == pytest.approx(0.7 * math.sqrt(2.0))
    assert alone.dof == math.inf
    twice = weighted_sum([(1.0, one), (1.0, one)])
    assert twice.u == pytest.approx(2.0 * one.u)


def car(seed: int, *, axles: bool) -> dict[str, tuple[float, float, float]]:
    """Measure a car whose reference centres are uncertain; errors, u and u in quadrature."""
    rng = np.random.default_rng([seed, 5])
    true = {
        wheel: np.radians(rng.uniform((2.0, 8.0, -2.0), (6.0, 15.0, 1.0))) for wheel in ("FR", "FL")
    }
    camber = {wheel: float(true.get(wheel, (0, 0, -0.01))[2]) for wheel in WHEELS}
    scene = Scene(seed, normal_rad=1e-5, centre_m=1e-3)
    scene.references({wheel: (0.002, camber[wheel]) for wheel in WHEELS})
    for wheel, (caster, inclination, _) in true.items():
        swept(scene, wheel, caster, inclination, STEERS, camber=camber[wheel])
    if axles:
        for wheel in WHEELS:
            rolled(scene, wheel, np.array([0.0, np.pi]), toe=0.002, camber=camber[wheel],
                   u_turn=1e-3, with_reference=True)  # fmt: skip
    measured = scene.measure()
    right, left = measured.steering_axes
    cambers = {w.observation.name: w.u_camber_rad for w in measured.wheels}
    found = {}
    for k, name in enumerate(("caster", "inclination")):
        sides = getattr(left, name), getattr(right, name)
        cross = weighted_sum([(1.0, sides[0]), (-1.0, sides[1])])
        error = cross.value - (true["FL"][k] - true["FR"][k])
        found[f"cross {name}"] = error, cross.u, math.hypot(sides[0].u, sides[1].u)
    error = left.included_angle.value - true["FL"][1] - true["FL"][2]
    apart = math.hypot(left.inclination.u, cambers["FL"])
    return found | {"included": (error, left.included_angle.u, apart)}


@pytest.mark.slow
@pytest.mark.parametrize("axles", [False, True])
def test_cross_and_included_angles_err_as_their_covariance_states(axles):
    """Both sides share the frame: its roll acts on SAI left and right with opposite signs.

    u by quadrature, which knows nothing of this, fails: too small for cross SAI, too large for
    cross caster and for the included angle.
    """
    rows = [car(seed, axles=axles) for seed in range(CARS)]
    low, high = stats.chi2.ppf([0.0005, 0.9995], CARS) / CARS
    ratios = {}
    for name in rows[0]:
        error, u, apart = np.array([row[name] for row in rows]).T
        assert low < np.mean((error / u) ** 2) < high, name
        ratios[name] = float(np.mean(u / apart))
        if not axles:
            assert not low < np.mean((error / apart) ** 2) < high, name
    assert ratios["cross inclination"] > 1.1
    assert max(ratios["cross caster"], ratios["included"]) < 0.8


@pytest.mark.parametrize("rolls", [(), ("RR",), ("FL",), tuple(WHEELS)])
def test_estimates_covary_with_the_wheels_angles(rolls):
    """SAI plus camber is the included angle, whose u counts what both share."""
    scene, turns = Scene(3, centre_m=3e-4).references(), np.array([0.0, np.pi])
    for wheel in ("FR", "FL"):
        swept(scene, wheel, 0.07, 0.2, STEERS, camber=-0.012)
    for wheel in rolls:
        plate = {"wobble": (0.004, 0.002), "eccentric_m": (0.001, 0.002), "camber": -0.012}
        rolled(mounted(scene, wheel, **plate), wheel, turns, u_turn=1e-3, **plate)
    measured = scene.measure()
    known, kingpins = by_name(measured), {axis.wheel: axis for axis in measured.steering_axes}
    for wheel in ("FR", "FL"):
        axis = kingpins[wheel]
        V = joint_covariance(
            measured,
            [axis.inclination, known[f"{wheel}.camber"].row, axis.caster, axis.inclination],
        )
        assert np.sqrt(V[0, 0]) == pytest.approx(axis.inclination.u, rel=1e-12)
        assert np.sqrt(V[1, 1]) == pytest.approx(known[f"{wheel}.camber"].u, rel=1e-12)
        assert V[0, 3] == pytest.approx(V[0, 0], rel=1e-12)
        both = V[0, 0] + V[1, 1] + 2.0 * V[0, 1]
        assert np.sqrt(both) == pytest.approx(axis.included_angle.u, rel=1e-6)
        assert abs(V[0, 1]) > 1e-3 * both  # they share the frame
        assert np.linalg.eigvalsh(V[:3, :3]).min() > -1e-12 * V.max()
