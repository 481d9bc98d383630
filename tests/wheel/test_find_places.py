"""Targets of unlike kinds and bare wheels in one cloud, by their places."""

import numpy as np
import pytest

from tests.support.round_wheels import about_axis, vehicle_points
from wheelplane.config import Config
from wheelplane.targets import load_target
from wheelplane.wheel.places import VehicleScan, find_places

CENTRES = [np.array([x, y, 0.32]) for x in (0.0, 2.6) for y in (-0.75, 0.75)]
AXES = [np.array([0.0, np.sign(y), 0.0]) for _, y, _ in CENTRES]
KINDS = [load_target("wheel"), load_target("disc-250")]
OFF_M = 0.08  # of the disc before the first wheel


@pytest.fixture(scope="module")
def scan():
    """A car with a disc before its first wheel, which still shows beside it."""
    rng = np.random.default_rng(31)
    radius = 0.125 * np.sqrt(rng.random(15_000))
    angle = rng.uniform(0.0, 2.0 * np.pi, len(radius))
    middle = CENTRES[0] + OFF_M * AXES[0]
    disc = about_axis(radius, angle, np.zeros(len(radius)), middle, AXES[0])
    points = vehicle_points(rng, CENTRES, AXES)
    hidden = np.linalg.norm(points - CENTRES[0], axis=1) < 0.13
    points = np.concatenate([points[~hidden], disc + rng.normal(0.0, 0.0005, disc.shape)])
    return VehicleScan(points, None, [(0, len(points))], [None], [None])


def wheel_at(patch):
    away = [np.linalg.norm(patch.origin_m - centre) for centre in CENTRES]
    assert min(away) < 0.12
    return int(np.argmin(away))


def test_a_target_and_the_wheel_behind_it_are_one_place_which_the_target_shows_best(scan):
    places = find_places(scan, KINDS, Config())
    found = {wheel_at(place.best): place for place in places}
    assert len(places) == len(found) == 4
    assert set(found[0].patches) == {0, 1}
    assert found[0].best is found[0].patches[1]
    assert abs((found[0].best.origin_m - CENTRES[0]) @ AXES[0] - OFF_M) < 0.005
    assert all(set(found[number].patches) == {0} for number in (1, 2, 3))


def test_chosen_places_are_in_the_order_of_their_points(scan):
    near = [(0, CENTRES[2]), (1, CENTRES[0] + OFF_M * AXES[0]), (0, CENTRES[1])]
    places = find_places(scan, KINDS, Config(), near)
    assert [wheel_at(place.best) for place in places] == [2, 0, 1]
    assert [set(place.patches) for place in places] == [{0}, {1}, {0}]
