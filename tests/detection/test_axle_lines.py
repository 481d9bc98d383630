"""Axles in line: the same vehicles in any coordinates and order."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.detection.axle_lines import axle_lines
from wheelplane.detection.identify_wheels import find_axles
from wheelplane.detection.vehicles import RIVAL, FoundTarget, vehicles


def axle(x, y=0.0):
    """Right and left end of an axle, x forward and y left."""
    return [
        FoundTarget(np.array([x, y + side * 0.75, 0.3]), np.array([0.0, side, 0.0]), 0.9)
        for side in (-1.0, 1.0)
    ]


def lines_of(targets):
    among = list(range(len(targets)))
    return axle_lines(targets, among, vehicles(targets, among, RIVAL))


HIGH = replace(axle(1)[0], centre_m=np.array([1.0, -0.75, 2.0]))
SCENES = {
    "lorry and car": ([*axle(0), *axle(1.2), *axle(4.5), *axle(0, 6), *axle(2.6, 6)], [6, 4]),
    "an axle seen in part": ([*axle(0), *axle(1.2)[:1], *axle(4.5)], [5]),
    "a wheel of another car": ([*axle(0), *axle(2.6), *axle(2.6, 5)[:1]], [4]),
    "one that hangs": ([*axle(0), *axle(2.6), HIGH], [5]),
}


@pytest.mark.parametrize("name", SCENES)
def test_vehicles_are_the_same_under_any_motion_in_any_order(name):
    targets, sizes = SCENES[name]
    known = lines_of(targets)
    assert sorted(len(line.targets) for line in known) == sorted(sizes)
    rng = np.random.default_rng(3)
    for _ in range(3):
        R, shift, order = rotation(rng), rng.uniform(-100, 100, 3), rng.permutation(len(targets))
        moved = [
            FoundTarget(R @ targets[i].centre_m + shift, R @ targets[i].normal, 0.9) for i in order
        ]
        again = lines_of(moved)
        own = {(frozenset(x.targets), x.ends is None) for x in known}
        assert {(frozenset(int(order[i]) for i in x.targets), x.ends is None) for x in again} == own
        for line in again:
            places = [moved[axle[0]].centre_m @ R[:, 0] for axle in line.axles]
            assert places in (sorted(places), sorted(places, reverse=True))


@pytest.mark.parametrize(
    ("axles_m", "front_m", "measured_m"),
    [((0.0, 4.0, 5.2, 9.6), -1.0, (0.0, 4.0)), ((0.0, 2.7, 7.5, 8.3), 9.0, (2.7, 7.5))],
)
def test_the_axles_at_one_end_are_the_same_in_any_order(axles_m, front_m, measured_m):
    """A lorry and its trailer, without a gap: of a tandem, the axle nearest to the other end."""
    targets = [end for x in axles_m for end in axle(x)]
    front = np.array([front_m, 0.0, 0.3])
    rng = np.random.default_rng(5)
    for _ in range(8):
        some = [targets[i] for i in rng.permutation(len(targets))]
        found = find_axles(some, 0.125, near_front_m=front, bodied=lambda *_: True)
        assert sorted(found.centres_m(some)[:, 0, 0]) == list(measured_m)
