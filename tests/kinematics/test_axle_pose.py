"""Poses of axles in all quantities: truth, covariance, repeats, and wheels without a run-out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.kinematics.test_runout import (
    CAMBER,
    ECCENTRIC,
    HALF,
    TOE,
    WHEELS,
    WOBBLE,
    all_round,
)
from tests.support.turning import PLACES, Scene, facing, mounted, rolled, swept
from wheelplane.kinematics.axle_pose import mounting_scatter
from wheelplane.kinematics.sweep import sweep_scans
from wheelplane.kinematics.wheel_axis import fit_axles, on_axles
from wheelplane.measurement.evaluate import check_by_monte_carlo
from wheelplane.measurement.quantities import by_name
from wheelplane.uncertainty.components import mounting_component

SAI = np.radians(12.0)


def test_a_repeat_scan_shows_the_axle_too_and_a_trial_its_target():
    scene = all_round(13, 0.0, ECCENTRIC)
    for name, repeats in (("RR again", "RR"), ("1", None)):
        again = replace(scene.seen[0], name=name, role="trial", source=f"{name}.ply")
        scene.seen.append(replace(again, repeats=repeats))
    result = scene.measure()
    repeat, trial = result.wheels[-2:]
    assert (repeat.compensated, trial.compensated) == (True, False)
    assert repeat.angles.toe_rad == pytest.approx(TOE, abs=2e-7)
    assert repeat.angles.camber_rad == pytest.approx(CAMBER, abs=2e-7)
    assert abs(trial.angles.toe_rad - TOE) > 0.5 * WOBBLE[0]


def test_quantities_of_the_vehicle_are_those_of_its_axles_and_agree_with_random_draws():
    result = all_round(14, 0.0, ECCENTRIC).measure()
    assert result.vehicle["rear_total_toe"] == pytest.approx(2 * TOE, abs=2e-7)
    assert result.vehicle["thrust_angle"] == pytest.approx(0.0, abs=2e-7)
    assert result.vehicle["front_cross_camber"] == pytest.approx(0.0, abs=2e-7)
    assert result.vehicle["rear_track"] == pytest.approx(1.5, abs=1e-8)
    assert abs(result.plates.vehicle["rear_total_toe"] - 2 * TOE) > WOBBLE[0]
    drawn = check_by_monte_carlo(result, 30_000, 1).monte_carlo
    np.testing.assert_allclose(drawn.standard, result.uncertainty.standard, rtol=0.02)


@pytest.mark.slow
def test_covariance_of_axles_is_that_of_errors_over_many_captures():
    """Whitened errors of all wheels and the vehicle together: chi-square of their number."""
    names = ("rear_track", "front_track", "wheelbase", "front_setback")
    sizes = []
    for seed in range(60):
        result = all_round(300 + seed, 1.0, ECCENTRIC).measure()
        true = all_round(300 + seed, 0.0, ECCENTRIC).measure()
        known = by_name(result)
        keys = [f"{w}.{k}" for w in ("RR", "RL", "FR", "FL") for k in ("toe", "camber")]
        rows = [list(known).index(key) for key in (*keys, *names)]
        errors = result.uncertainty.values[rows] - true.uncertainty.values[rows]
        block = result.uncertainty.covariance[np.ix_(rows, rows)]
        if result.complete:
            sizes.append(errors @ np.linalg.solve(block, errors))
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(sizes) * len(rows)) / len(sizes)
    assert low < np.mean(sizes) < high


def test_a_wheel_without_run_out_is_as_uncertain_as_the_others_are_mounted():
    """Half a degree and 2.2 mm: 0.35 degrees and 1.6 mm per axis, by 6 degrees of freedom."""
    result = all_round(15, 1.0, ECCENTRIC, wheels=("RR", "RL", "FR")).measure()
    known, without = by_name(result), result.wheels[3]
    plates = result.plates
    scans = sweep_scans(plates)
    scatter = mounting_scatter(on_axles(scans, fit_axles(scans, plates)))
    assert scatter.dof == 6
    assert scatter.tilt_rad == pytest.approx(np.radians(0.5) / np.sqrt(2.0), rel=0.02)
    assert (without.compensated, without.plate.compensated) == (False, False)
    assert without.u_toe_rad == pytest.approx(np.radians(0.5) / np.sqrt(2.0), rel=0.05)
    assert abs(without.angles.toe_rad - TOE) < known["FL.toe"].expanded
    assert without.dof_toe == pytest.approx(6.0, rel=0.1)
    assert result.plates.wheels[3].u_toe_rad < 0.1 * without.u_toe_rad
    assert known["RR.toe"].u < 0.1 * without.u_toe_rad
    shift_m = np.sqrt(np.mean(np.sum(np.square(ECCENTRIC[:3]), axis=1)) / 2.0)
    assert known["wheelbase_left"].u == pytest.approx(shift_m, rel=0.05)


def test_what_a_target_file_states_of_mounting_is_not_counted_twice():
    scene = all_round(16, 1.0, ECCENTRIC, wheels=("RR", "RL", "FR"))
    fitted = scene.seen[3].fitted
    normal = mounting_component(np.radians(2.0), 0.01, fitted.normal)
    target = replace(fitted, components=(*fitted.components, normal))
    scene.seen[3] = replace(scene.seen[3], evidence=replace(scene.seen[3].evidence, target=target))
    u_toe = scene.measure().wheels[3].u_toe_rad
    assert u_toe == pytest.approx(np.radians(2.0), rel=0.01)


def off_centre(seed, wheels, shift=5e-3):
    """Targets off their axles by a normal scatter, run-outs of some, front wheels swept."""
    off = np.random.default_rng([seed, 22]).normal(0.0, shift, (4, 2))
    scene = all_round(400 + seed, 0.0, off, wheels=wheels)
    for wheel in ("FR", "FL"):
        swept(scene, wheel, np.radians(4.0), SAI, np.radians([-20.0, 0.0, 20.0]))
    return scene.measure()


@pytest.mark.parametrize("seed", range(4))
def test_the_frame_of_caster_and_sai_counts_how_targets_without_run_out_are_mounted(seed):
    """The height of the left rear centre over the track leans the frame sideways."""
    result, all_known = off_centre(seed, ("RR", "FR")), off_centre(seed, WHEELS)
    scans = sweep_scans(result.plates)
    scatter = mounting_scatter(on_axles(scans, fit_axles(scans, result.plates)))
    for found, known in zip(result.steering_axes, all_known.steering_axes, strict=True):
        share = np.sqrt(found.inclination.u**2 - known.inclination.u**2)
        assert share == pytest.approx(scatter.shift_m / 1.5, rel=0.1)
        assert found.caster.u > known.caster.u


@pytest.mark.slow
def test_u_of_sai_holds_where_the_targets_of_the_other_side_lean_the_frame():
    """Right run-outs: of 4 degrees of freedom; without that share, 70 % are inside U."""
    inside = []
    for seed in range(100):
        found = off_centre(seed, ("RR", "FR")).steering_axes[0].inclination
        inside.append(abs(found.value - SAI) < found.expanded)
    low, high = stats.binom.ppf([0.0005, 0.9995], len(inside), 0.95)
    assert low <= sum(inside) <= high, sum(inside)


@pytest.mark.slow
def test_the_included_angle_counts_the_mounting_that_camber_has_and_sai_has_not():
    """Rear run-outs, a swept front wheel without: Student's 95 % of 4 degrees of freedom."""
    tilt, sai, camber, inside = np.radians(0.4), np.radians(12.0), -0.01, []
    for seed in range(120):
        rng = np.random.default_rng([seed, 21])
        scene = Scene(seed).references()
        for wheel in ("RR", "RL"):
            off = {"wobble": rng.normal(0.0, tilt, 2), "eccentric_m": rng.normal(0.0, 1e-3, 2)}
            mounted(scene, wheel, **off)
            rolled(scene, wheel, HALF, u_turn=1e-3, **off)
        plate = Rotation.from_rotvec(rng.normal(0.0, tilt, 3))
        normal = plate.apply(facing("FL", 0.0, camber))
        front = Scene(seed + 1000)
        front.R, front.shift = scene.R, scene.shift
        front.look("FL", "reference", "FL", PLACES["FL"], normal)
        scene.seen[3] = front.seen[0]
        swept(scene, "FL", np.radians(4.0), sai, np.radians([-20.0, 0.0, 20.0]), camber=camber,
              plate=plate)  # fmt: skip
        found = scene.measure().steering_axes[0]
        assert found.included_angle.dof < 30.0
        inside.append(
            abs(found.included_angle.value - sai - camber) < found.included_angle.expanded
        )
    low, high = stats.binom.ppf([0.0005, 0.9995], len(inside), 0.95)
    assert low <= sum(inside) <= high, sum(inside)
