"""Uncertainty components: each builder against drawn errors of the kind that it describes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.scenes import rotation
from tests.support.single_scan import with_stated
from wheelplane.config import InstrumentConfig
from wheelplane.measurement.observe import noisy
from wheelplane.plane.least_squares import total_least_squares
from wheelplane.targets.plates import DiscTarget
from wheelplane.uncertainty.components import (
    centre_component,
    distance_component,
    flatness_component,
    mounting_component,
    plane_component,
    pointing_component,
    range_bias_component,
    registration_component,
    vertical_component,
)

DRAWS = 4000
# A variance from n draws is known to sqrt(2/n); 4.5 of them.
LIMIT = 4.5 * math.sqrt(2 / DRAWS)


def face(seed, count=400, radius=0.12):
    """Points (N, 3) of a half-hidden disc, its basis (normal last) and the disc's centre."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-radius, radius, (4 * count, 2))
    uv = uv[(np.hypot(*uv.T) < radius) & (uv[:, 0] > -0.02)][:count]
    R = rotation(rng)
    centre = rng.uniform(-3, 3, 3)
    return centre + np.column_stack([uv, np.zeros(len(uv))]) @ R, R, centre


def assert_same(drawn, covariance):
    """Sample covariance (K, 6) against the stated one, relative to its own deviations."""
    scale = np.sqrt(np.diag(covariance))
    used = scale > 1e-9 * scale.max()
    sample = drawn.T @ drawn / len(drawn)
    assert used.sum() >= 3
    ratio = (sample - covariance)[np.ix_(used, used)] / np.outer(scale[used], scale[used])
    assert np.abs(ratio).max() < LIMIT
    assert np.abs((sample - 4 * covariance)[used, used] / scale[used] ** 2).max() > LIMIT


def test_plane_noise_moves_normal_and_centre_together():
    points, R, centre = face(1)
    sigma, rng = 1e-3, np.random.default_rng(2)
    plane = total_least_squares(points)
    basis = plane.basis if plane.normal @ R[2] > 0 else -plane.basis
    centroid = plane.centroid_m
    drawn = []
    for _ in range(DRAWS):
        moved = points + sigma * rng.standard_normal((len(points), 1)) * R[2]
        fit = total_least_squares(moved)
        normal = fit.normal * np.sign(fit.normal @ R[2])
        height = (fit.centroid_m - centre) @ normal / (normal @ R[2])
        drawn.append(np.concatenate([normal - R[2], height * R[2]]))
    covariance = sigma**2 * np.diag([1 / len(points), *(1 / plane.scatter_m2[:2])])
    component = plane_component("plane noise", covariance, basis, centre - centroid)
    assert_same(np.array(drawn), component.covariance)
    cross = component.covariance[:3, 3:]  # the lever of the hidden half ties the two together
    assert np.abs(cross).max() > 0.2 * np.sqrt(
        np.trace(component.covariance[:3, :3]) * np.trace(component.covariance[3:, 3:])
    )


def test_centre_lies_in_its_plane():
    _, R, _ = face(3)
    covariance = np.array([[4e-8, 1e-8], [1e-8, 1e-8]])
    component = centre_component("centre noise", covariance, R)
    np.testing.assert_allclose(
        R @ component.covariance[3:, 3:] @ R.T, np.pad(covariance, (0, 1)), atol=1e-20
    )
    assert not component.covariance[:3].any()
    singular = centre_component("centre noise", np.diag([1e-8, 0.0]), R)
    assert singular.covariance[3:, 3:] @ R[0] == pytest.approx(1e-8 * R[0], abs=1e-20)


def test_flatness_is_a_tilt_anywhere_up_to_the_whole_over_the_diameter():
    _, R, _ = face(4)
    flatness, radius = 5e-5, 0.125
    rng = np.random.default_rng(5)
    size = flatness / (2 * radius) * np.sqrt(rng.random(DRAWS))
    turn = rng.uniform(0, 2 * np.pi, DRAWS)
    height = flatness / 10 * rng.standard_normal(DRAWS)
    tilts = (size * np.cos(turn))[:, None] * R[0] + (size * np.sin(turn))[:, None] * R[1]
    assert_same(
        np.hstack([tilts, height[:, None] * R[2]]),
        flatness_component(flatness, radius, R[2]).covariance,
    )


def test_mounting_tilts_and_shifts_in_the_plane():
    _, R, _ = face(6)
    rng = np.random.default_rng(7)
    tilt, shift = rng.standard_normal((2, DRAWS, 2))
    drawn = np.hstack([2e-4 * tilt @ R[:2], 1e-4 * shift @ R[:2]])
    assert_same(drawn, mounting_component(2e-4, 1e-4, R[2]).covariance)


def scanned_again(points, centre, scanner, move):
    """Change of normal and centre (6,) when `move` takes the points, seen from the scanner."""
    before, after = total_least_squares(points), total_least_squares(move(points))
    normal = before.normal * np.sign(before.normal @ after.normal)
    flat = move(np.vstack([centre]))[0]
    return np.concatenate([after.normal - normal, flat - centre]), normal


@pytest.mark.parametrize("seed", range(3))
def test_range_bias_by_moving_every_point_along_its_beam(seed):
    rng = np.random.default_rng(seed + 20)
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    R, centre = rotation(rng), rng.uniform(-3, 3, 3)
    points = np.vstack([centre + ring @ R[:2], centre + 0.5 * ring @ R[:2]])
    scanner = centre + 2.0 * (R[2] + rng.uniform(-0.6, 0.6, 2) @ R[:2])
    bias = 1e-4

    def move(p):
        away = p - scanner
        return p + bias * away / np.linalg.norm(away, axis=1)[:, None]

    change, normal = scanned_again(points, centre, scanner, move)
    component = range_bias_component(bias, centre - scanner, normal)
    # To first order in target over distance, 0.1/2, of a tilt b/D.
    np.testing.assert_allclose(component.factor[:3, 0], change[:3], atol=0.05 * bias / 2.0)
    np.testing.assert_allclose(component.factor[3:, 0], change[3:], atol=1e-3 * bias)
    assert np.linalg.norm(change[:3]) > 0.1 * bias / 2.0
    assert component.shared == "scanner"


def test_what_a_least_distance_pulls_moves_centres_along_their_normals_alike():
    normal = np.array([0.6, 0.0, 0.8])
    component = distance_component(-1e-4, normal)
    expected = np.zeros((6, 6))
    expected[3:, 3:] = 1e-8 * np.outer(normal, normal)
    np.testing.assert_allclose(component.covariance, expected, atol=1e-20)
    other = distance_component(1e-4, -normal)  # seen from behind, and pulled there
    np.testing.assert_allclose(component.factor, other.factor)
    assert component.shared == other.shared is not None


@pytest.mark.parametrize("axis", range(3))
def test_pointing_rotates_the_scan_about_the_scanner(axis):
    points, R, centre = face(30)
    scanner = centre + 2.0 * R[2] + 0.4 * R[0]
    angle = 1e-5
    turn = np.zeros(3)
    turn[axis] = angle

    def move(p):
        return p + np.cross(turn, p - scanner)

    change, normal = scanned_again(points, centre, scanner, move)
    component = pointing_component(angle, centre - scanner, normal)
    np.testing.assert_allclose(component.factor[:, axis], change, atol=1e-4 * angle)
    assert np.linalg.norm(change) > angle


def test_registration_shifts_all_alike():
    component = registration_component(2e-4)
    np.testing.assert_array_equal(component.covariance, np.diag([0, 0, 0, *[4e-8] * 3]))


PLATE = DiscTarget(shape="disc", diameter=0.25)
STATED = PLATE.model_copy(update={"flatness": 5e-5, "clamp_tilt_deg": 0.01, "clamp_shift": 1e-4})


@pytest.fixture(scope="module")
def evidence():
    from tests.support.scenes import Setup, make
    from tests.support.single_scan import measure_scan
    from wheelplane.config import Config
    from wheelplane.readers import Scan

    cloud = make(Setup(spacing_m=0.003), 4)
    return cloud, measure_scan(Scan(cloud.points_m, None, "memory", 0), PLATE, Config())


def test_stated_components_enter_and_others_do_not(evidence):
    _, found = evidence
    names = [component.name for component in found.target.components]
    assert names == ["plane noise", "centre noise", "centre model"]
    instrument = InstrumentConfig(range_bias_m=1e-3, pointing_urad=20.0, registration_m=1e-4)
    more = with_stated(found.target, found.plane, STATED, instrument)
    assert [component.name for component in more.components[3:]] == [
        "flatness",
        "clamp",
        "range bias",
        "pointing",
        "registration",
    ]
    added = more.covariance - found.target.covariance
    assert np.linalg.eigvalsh(added).min() > -1e-18
    assert np.trace(added[:3, :3]) > 0.0
    plain = PLATE.model_copy(update={"flatness": 5e-5})
    again = with_stated(more, found.plane, plain, InstrumentConfig())
    assert [component.name for component in again.components].count("flatness") == 1


def test_the_line_of_sight_comes_from_the_edge(evidence):
    cloud, found = evidence
    instrument = InstrumentConfig(range_bias_m=1e-3)
    more = with_stated(found.target, found.plane, PLATE, instrument)
    beam = more.components[-1].factor[3:, 0] / 1e-3
    away = cloud.centre_m - cloud.viewpoint_m
    true = away / np.linalg.norm(away)
    assert np.linalg.norm(np.cross(beam, true)) < 0.02
    assert beam @ true > 0.0
    assert np.linalg.norm(np.cross(cloud.normal, true)) > 0.2  # the normal itself fails


def test_a_scan_noisier_than_its_scanner_gives_a_note(evidence):
    _, found = evidence
    seen = type("Seen", (), {"evidence": found, "name": "RR"})()
    sigma = found.plane.sigma_m
    (note,) = noisy([seen], InstrumentConfig(range_sigma_m=sigma / 3))
    assert "RR" in note
    assert "3.0 times" in note
    assert not list(noisy([seen], InstrumentConfig(range_sigma_m=sigma)))
    assert not list(noisy([seen], InstrumentConfig()))


def test_scans_of_one_station_share_its_errors_where_its_position_is_stated(evidence):
    from tests.support.single_scan import patch_of
    from wheelplane.config import Config
    from wheelplane.measure import fit_target
    from wheelplane.readers import Scan

    cloud, _ = evidence
    stated = {"collimation_arcsec": 10.0, "pointing_urad": 20.0, "registration_m": 1e-4}
    config = Config(instrument=InstrumentConfig(**stated))
    patch = patch_of(Scan(cloud.points_m, None, "memory", 0), PLATE, config)
    for station_m, shared in ((None, False), (cloud.viewpoint_m, True)):
        target = fit_target(replace(patch, station_m=station_m), PLATE, config).target
        of_station = {c.name: c.shared for c in target.components if c.name in NAMES}
        assert set(of_station) == NAMES
        assert all((key is not None) == shared for key in of_station.values())
        assert len(set(of_station.values())) == 1


NAMES = {"axes", "pointing", "registration"}


def test_the_line_of_sight_without_mixed_pixels_is_that_from_the_stated_station(evidence):
    """And along the normal where the station is unknown, or lies behind the target."""
    from tests.support.single_scan import patch_of
    from wheelplane.config import Config
    from wheelplane.measure import fit_target
    from wheelplane.readers import Scan

    cloud, _ = evidence
    patch = patch_of(Scan(cloud.face_m, None, "memory", 0), PLATE, Config())
    pointing_rad, distance_m = 1e-3, 2.0
    instrument = InstrumentConfig(pointing_urad=1e6 * pointing_rad, distance_m=distance_m)
    behind = 2.0 * cloud.centre_m - cloud.viewpoint_m
    lengths = {}
    for name, station_m in (("front", cloud.viewpoint_m), ("behind", behind), ("none", None)):
        here = replace(patch, station_m=station_m)
        found = fit_target(here, PLATE, Config(instrument=instrument)).target
        assert found.edge_fit is None
        (pointing,) = (c for c in found.components if c.name == "pointing")
        # three independent rotations move a centre at r by sqrt(2) |r| in all
        lengths[name] = np.sqrt(np.trace(pointing.covariance[3:, 3:]) / 2.0) / pointing_rad
    true_m = np.linalg.norm(cloud.viewpoint_m - cloud.centre_m)
    assert lengths["front"] == pytest.approx(true_m, abs=0.005)
    assert lengths["behind"] == lengths["none"] == pytest.approx(distance_m, abs=1e-9)


def joint(component):
    """Return the covariance (7, 7) of normal, centre and in-plane rotation."""
    whole = np.vstack([component.factor, component.turn])
    return whole @ whole.T


@pytest.mark.parametrize("seed", range(3))
def test_a_plane_component_is_its_jacobian_between_covariances(seed):
    """Height and slopes at the centroid move normal, centre and rotation, all correlated."""
    rng = np.random.default_rng(seed)
    basis, lever, root = rotation(rng), rng.normal(size=3), rng.normal(size=(3, 3))
    by_plane, by_turn = rng.normal(size=(2, 3)), rng.normal(size=3)
    at_centre = np.eye(3)
    at_centre[0, 1:] = basis[:2] @ lever
    of_normal = np.hstack([np.zeros((3, 1)), -basis[:2].T])
    of_centre = np.outer(basis[2], [1.0, 0.0, 0.0]) + basis[:2].T @ by_plane
    J = np.vstack([of_normal, of_centre, by_turn]) @ at_centre
    found = plane_component("p", root @ root.T, basis, lever, by_plane, turn_by_plane=by_turn)
    np.testing.assert_allclose(joint(found), J @ root @ root.T @ J.T, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_centre_component_carries_position_and_rotation_together(seed):
    rng = np.random.default_rng(seed)
    basis, root = rotation(rng), rng.normal(size=(3, 3))
    J = np.zeros((7, 3))
    J[3:6, :2], J[6, 2] = basis[:2].T, 1.0
    wanted = J @ root @ root.T @ J.T
    np.testing.assert_allclose(
        joint(centre_component("c", root @ root.T, basis)), wanted, atol=1e-12
    )
    alone = centre_component("c", (root @ root.T)[:2, :2], basis)
    assert alone.turn is None
    np.testing.assert_allclose(alone.factor @ alone.factor.T, wanted[:6, :6], atol=1e-12)


def test_a_direction_moves_across_itself_alone():
    """A vertical by two columns of tilt; a pointed station rotates a target by the axis' share."""
    normal, tilt = np.array([2.0, -1.0, 2.0]) / 3.0, np.random.default_rng(1).normal(size=(3, 2))
    found = vertical_component("v", normal, tilt, 7.0).factor
    np.testing.assert_allclose(found[:3], tilt - np.outer(normal, normal @ tilt), atol=1e-15)
    assert not found[3:].any()
    turn = pointing_component(1e-3, np.array([3.0, 0.0, 1.0]), normal).turn
    np.testing.assert_allclose(turn, 1e-3 * normal, atol=1e-18)
