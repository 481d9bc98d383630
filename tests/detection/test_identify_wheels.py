"""Which face is which wheel: the same in any coordinates and order, or refused with a list."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.scenes import rotation
from wheelplane.capture.front import Front
from wheelplane.detection.identify_wheels import find_axles, wheels_by_markers
from wheelplane.detection.up_direction import stand_on_a_floor
from wheelplane.detection.vehicles import FoundTarget
from wheelplane.errors import InputError

WHEELS = ("RR", "RL", "FR", "FL")
RADIUS_M = 0.125
UP = np.array([0.0, 0.0, 1.0])
FORWARD = np.array([1.0, 0.0, 0.0])


def turned(vector, degrees):
    """About z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ vector


def car(rear=1.5, front=1.5, base=2.7, steered=0.0, camber=0.0, shift=0.0):
    """RR, RL, FR, FL of a car, x forward, y left, z up; front wheels steered to the left, degrees.

    shift: of the front axle to the left.
    """
    faces = []
    for wheel in WHEELS:
        side = 1.0 if wheel[1] == "L" else -1.0
        place = np.array([0.0, side * rear / 2.0, 0.3])
        if wheel[0] == "F":
            place = np.array([base, side * front / 2.0 + shift, 0.3])
        lean = np.radians(camber)
        normal = np.array([0.0, side * np.cos(lean), -np.sin(lean)])
        faces.append(FoundTarget(place, turned(normal, steered if wheel[0] == "F" else 0.0), 0.9))
    return faces


def moved(faces, R, shift):
    return [FoundTarget(R @ face.centre_m + shift, R @ face.normal, face.match) for face in faces]


def named(faces, up, front):
    axles = find_axles(faces, RADIUS_M)
    rear_m, front_m = axles.centres_m(faces).mean(axis=1)
    return axles.named(faces, up, front.is_ahead(rear_m, front_m)), axles.left_out


def towards(direction):
    return Front("--front", tuple(direction))


def refusal(faces):
    with pytest.raises(InputError) as caught:
        find_axles(faces, RADIUS_M)
    return str(caught.value)


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    tracks=st.tuples(st.floats(0.9, 2.5), st.floats(0.75, 1.33)),
    base=st.floats(1.6, 6.9),
    steered=st.floats(-40.0, 40.0),
    camber=st.floats(-6.0, 6.0),
    off=st.floats(-55.0, 55.0),
)
def test_names_are_the_same_under_any_motion_in_any_order(seed, tracks, base, steered, camber, off):
    rear = tracks[0]
    front = float(np.clip(rear * tracks[1], 0.85, 2.55))
    rng = np.random.default_rng(seed)
    R, shift = rotation(rng), rng.uniform(-1e5, 1e5, 3)
    order = rng.permutation(4)
    faces = moved(car(rear, front, base, steered, camber), R, shift)
    shuffled = [faces[i] for i in order]
    way = towards(R @ turned(FORWARD, off) * 10.0 ** rng.uniform(-200, 200))
    by_name, left_out = named(shuffled, R @ UP, way)
    assert {wheel: order[i] for wheel, i in by_name.items()} == dict(
        zip(WHEELS, range(4), strict=True)
    )
    assert left_out == ()


@pytest.mark.parametrize("seed", range(5))
def test_a_point_near_the_front_tells_the_same_as_a_direction(seed):
    rng = np.random.default_rng(seed)
    R, shift = rotation(rng), rng.uniform(-50, 50, 3)
    faces = moved(car(), R, shift)
    for x, expected in ((3.5, WHEELS), (2.2, WHEELS), (-0.8, ("FL", "FR", "RL", "RR"))):
        point = R @ [x, 0.4, 0.9] + shift
        by_name, _ = named(faces, R @ UP, Front("--front-point", None, tuple(point)))
        assert [by_name[wheel] for wheel in expected] == [0, 1, 2, 3]


@pytest.mark.parametrize("axis", range(3))
def test_what_is_up_tells_the_mirror_image(axis):
    """A mirrored car is a car: what is up in it, and what is front, says where its left is."""
    mirror = np.eye(3)
    mirror[axis, axis] = -1.0
    faces = moved(car(steered=20.0), mirror, np.zeros(3))
    by_name, _ = named(faces, mirror @ UP, towards(mirror @ FORWARD))
    assert [by_name[wheel] for wheel in ("RL", "RR", "FL", "FR")] == [0, 1, 2, 3]
    upside_down, _ = named(faces, -(mirror @ UP), towards(mirror @ FORWARD))
    assert [upside_down[wheel] for wheel in WHEELS] == [0, 1, 2, 3]


def test_only_the_front_that_is_reported_decides_not_the_steering():
    by_name, _ = named(car(steered=35.0), UP, towards(-FORWARD))
    assert [by_name[wheel] for wheel in ("FL", "FR", "RL", "RR")] == [0, 1, 2, 3]


@pytest.mark.parametrize("missing", range(4))
def test_three_faces_are_listed_and_none_is_guessed(missing):
    faces = [face for i, face in enumerate(car()) if i != missing]
    text = refusal(faces)
    assert text.startswith("3 targets found, four are needed: target 1 at (")
    for face in faces:
        x, y, z = face.centre_m
        assert f"({x:.3f}, {y:.3f}, {z:.3f}) m (match 0.90, " in text
    assert "1.50 m from the next" in text
    assert "check --target" in text
    assert refusal([]).startswith("no target found, four are needed: none")
    assert refusal(faces[:1]).startswith("1 target found")


def test_a_target_that_is_shown_twice_is_not_measured():
    ghost = car()[2]
    faces = [*car(), FoundTarget(ghost.centre_m + 0.02 * UP, ghost.normal, 0.75)]
    assert refusal(faces).startswith("targets 3 and 5 lie 20 mm apart, so one target")


@pytest.mark.parametrize("place", range(5))
def test_a_face_that_overlaps_with_a_much_better_one_is_none(place):
    """Two targets cannot overlap: what looks a little like one there, nearer out or in, is none."""
    ghost = car()[2]
    false = FoundTarget(ghost.centre_m + np.array([0.2, -0.1, 0.0]), ghost.normal, 0.7)
    faces = car()
    faces.insert(place, false)
    by_name, left_out = named(faces, UP, towards(FORWARD))
    assert left_out == (place,)
    assert [faces[by_name[wheel]].match for wheel in WHEELS] == [0.9] * 4
    far = FoundTarget(ghost.centre_m + np.array([0.3, -0.1, 0.0]), ghost.normal, 0.7)
    assert find_axles([*car(), far], RADIUS_M).left_out == (4,)  # no axle in line with the rear one


BESIDE = [
    moved(car(), np.eye(3), np.array([0.0, 2.6, 0.0])),
    moved(car(), np.eye(3), np.array([0.0, 4.0, 0.0])),
    moved(car(), np.eye(3), np.array([7.0, 0.3, 0.0])),
    moved(car(), np.diag([-1.0, -1.0, 1.0]), np.array([9.0, 6.0, 0.0])),
    moved(car(), np.eye(3), np.array([-5.7, 0.2, 0.0])),  # behind it: its front axle 3 m away
]


@pytest.mark.parametrize("other", BESIDE)
def test_two_vehicles_are_refused_with_the_option_that_chooses(other):
    text = refusal([*car(), *other])
    assert text.startswith("8 targets found, on 2 vehicles (targets ")
    for pair in ("1, 2", "3, 4", "5, 6", "7, 8"):
        assert re.search(rf"targets [^;)]*{pair}[^;)]*[;)]", text)
    assert "add --front-point X,Y,Z near the front of the one to measure" in text
    assert "crop the cloud" in text
    assert text.count(" m (match ") == 8


@pytest.mark.parametrize("other", BESIDE)
def test_a_point_near_its_front_chooses_one_of_two_vehicles(other):
    faces = [*car(), *other]
    for own in (faces[:4], faces[4:]):
        rear, front = (np.mean([one.centre_m for one in two], axis=0) for two in (own[:2], own[2:]))
        near = front + 0.35 * (front - rear)
        axles = find_axles(faces, RADIUS_M, near_front_m=near)
        assert {id(faces[i]) for axle in axles.ends for i in axle} == set(map(id, own))
        assert len(axles.left_out) == 4


@pytest.mark.parametrize("lost", range(4))
def test_a_vehicle_of_which_one_wheel_is_not_found_is_not_mistaken_for_the_one_beside(lost):
    """The one that is complete may not be the one that is meant; a point near its front says so."""
    mine = [one for i, one in enumerate(car()) if i != lost]
    for other in BESIDE:
        faces = [*mine, *other]
        assert refusal(faces).startswith("7 targets found, on 2 vehicles")
        front = np.array([3.5, 0.0, 0.5])
        with pytest.raises(InputError, match="that do not show which two"):
            find_axles(faces, RADIUS_M, near_front_m=front)
        near = np.mean([one.centre_m for one in other[2:]], axis=0) + other[2].normal
        axles = find_axles(faces, RADIUS_M, near_front_m=near)
        assert {i for axle in axles.ends for i in axle} == {3, 4, 5, 6}


def axle(x, y=0.0, track=1.5, yaw=0.0):
    """Right and left end of an axle."""
    two = car(rear=track)[:2]
    about = [replace(one, centre_m=turned(one.centre_m, yaw), normal=turned(one.normal, yaw))
             for one in two]  # fmt: skip
    return moved(about, np.eye(3), np.array([x, y, 0.0]))


def test_a_strange_axle_that_is_not_in_line_is_left_out():
    """Part of another car: with an axle of this one it could be a vehicle, but is not in line."""
    for other in (axle(-3.1, y=0.1), axle(-3.1, yaw=3.0), axle(5.6, track=1.9), axle(5.6, y=-0.2)):
        axles = find_axles([*other, *car()], RADIUS_M)
        assert axles.left_out == (0, 1)
        assert {i for one in axles.ends for i in one} == {2, 3, 4, 5}


@pytest.mark.parametrize("base", [2.2, 3.2, 5.0])
@pytest.mark.parametrize("apart", [0.8, 1.1, 1.4])
def test_of_axles_closer_than_a_wheelbase_the_one_nearest_to_the_other_end_counts(base, apart):
    for more in (axle(-apart), axle(base + apart)):
        faces = [*car(base=base), *more]
        rng = np.random.default_rng(1)
        order = rng.permutation(6)
        axles = find_axles([faces[i] for i in order], RADIUS_M)
        assert {order[i] for one in axles.ends for i in one} == {0, 1, 2, 3}
        assert {order[i] for i in axles.further} == {4, 5}
        assert axles.left_out == ()


def test_axles_that_do_not_show_which_two_are_refused():
    undecided = "that do not show which two are one vehicle's"
    lorry = [*axle(0.0), *axle(2.0), *axle(5.0)]
    assert undecided in refusal(lorry)  # a car with a trailer, or one of two cars in a row
    assert "(targets 5, 6 and 3, 4 and 1, 2)" in refusal(lorry)
    for x, own in ((5.9, (2, 3, 4, 5)), (-0.8, (0, 1, 2, 3))):  # its front: the two at that end
        axles = find_axles(lorry, RADIUS_M, near_front_m=np.array([x, 0.1, 0.5]))
        assert {i for one in axles.ends for i in one} == set(own)
    with pytest.raises(InputError, match=undecided):
        find_axles(lorry, RADIUS_M, near_front_m=np.array([2.4, 0.1, 0.5]))
    trailer = [*axle(0.0), *axle(1.3), *axle(2.6)]  # alone
    assert "add --front-point X,Y,Z near the front, or choose the four" in refusal(trailer)
    with pytest.raises(InputError, match=undecided) as refused:  # nor does a point decide
        find_axles(trailer, RADIUS_M, near_front_m=np.array([3.5, 0.1, 0.5]))
    assert "front-point" not in str(refused.value)
    assert "choose the four by --hint RR=X,Y,Z" in str(refused.value)
    for lost in (2, 3):  # the nearer of two rear axles, of which one wheel is not found
        faces = [one for i, one in enumerate([*axle(0.0), *axle(1.1), *axle(4.0)]) if i != lost]
        assert undecided in refusal(faces)
    bent = [*axle(0.0), *axle(2.6, yaw=4.0), *axle(-3.0, yaw=4.0)]  # none in line
    assert "6 targets found, of which 3 sets of four could be a vehicle's wheels" in refusal(bent)


def test_wheels_on_one_side_are_of_a_vehicle_in_front_of_the_complete_one():
    """Where tracks differ, wheels of one side are up to some 70 mm off one line."""
    behind = [*axle(-5.6), *axle(-3.0)]

    def bodied(rear_m, front_m, across_m):
        return abs(abs(front_m[0] - rear_m[0]) - 2.6) < 0.01  # not the 3.0 m between the cars

    for mine in ((axle(0.0)[1], axle(2.6, track=1.64)[1]), (*axle(0.0), axle(2.6, track=1.64)[0])):
        with pytest.raises(InputError, match="targets found, on 2 vehicles"):
            find_axles([*mine, *behind], RADIUS_M, bodied=bodied)


def test_axles_out_of_line_are_one_vehicle_s_where_bodywork_joins_them():
    """Else they may be the rear axle of one and the front axle of another, the others hidden."""
    bent = car(shift=0.3)
    assert find_axles(bent, RADIUS_M, bodied=lambda *_: True).left_out == ()
    assert find_axles(bent, RADIUS_M, bodied=lambda *_: None).left_out == ()  # wheels alone
    for near in (None, np.array([3.5, 0.0, 0.3])):
        with pytest.raises(InputError, match=r"4 targets found, on axles .* which two are one"):
            find_axles(bent, RADIUS_M, near_front_m=near, bodied=lambda *_: False)
    assert find_axles(car(), RADIUS_M, bodied=lambda *_: False).left_out == ()


def test_vehicles_in_line_are_parted_where_there_is_no_body_between_them():
    front_car = [*axle(0.0), *axle(2.6)]
    behind = [*axle(-5.6), *axle(-3.0)]

    def bodied(rear_m, front_m, across_m):
        return abs(abs(front_m[0] - rear_m[0]) - 2.6) < 0.01  # not the 3.0 m between the cars

    for more in (behind[2:], behind[2:3], behind[3:]):
        faces = [*front_car, *more]
        assert "that do not show which two" in refusal(faces)
        axles = find_axles(faces, RADIUS_M, bodied=bodied)
        assert {i for one in axles.ends for i in one} == {0, 1, 2, 3}
        assert len(axles.left_out) == len(more)
    both = [*front_car, *behind]
    with pytest.raises(InputError, match="8 targets found, on 2 vehicles"):
        find_axles(both, RADIUS_M, bodied=bodied)
    near = np.array([-2.0, 0.0, 0.5])
    axles = find_axles(both, RADIUS_M, near_front_m=near, bodied=bodied)
    assert {i for one in axles.ends for i in one} == {4, 5, 6, 7}
    with pytest.raises(InputError, match="that do not show which two"):
        find_axles(both, RADIUS_M, bodied=lambda *_: False)  # nothing but wheels in the cloud


def test_of_two_sets_the_one_that_stands_on_the_floor_is_the_vehicle():
    up = np.array([0.1, 0.0, 0.7])
    doors = [replace(face, centre_m=face.centre_m + up) for face in car()[:2]]
    faces = [*car(), *doors]
    assert "do not show which two" in refusal(faces)
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-3.0, 6.0, (200_000, 2)), np.zeros(200_000)])
    axles = find_axles(faces, RADIUS_M, partial(stand_on_a_floor, floor))
    assert {i for axle in axles.ends for i in axle} == {0, 1, 2, 3}
    assert set(axles.left_out) == {4, 5}
    above = floor + np.array([0.0, 0.0, 5.0])  # none stands on that, so nothing is reported
    with pytest.raises(InputError, match="do not show which two"):
        find_axles(faces, RADIUS_M, partial(stand_on_a_floor, above))


@pytest.mark.parametrize(
    "stray",
    [
        FoundTarget(np.array([1.3, 4.0, 0.3]), np.array([0.0, -1.0, 0.0]), 0.7),
        FoundTarget(np.array([1.3, -0.8, 1.0]), np.array([0.0, -1.0, 0.0]), 0.7),
        FoundTarget(np.array([-3.0, 0.7, 1.5]), np.array([1.0, 0.0, 0.0]), 0.7),
    ],
)
@pytest.mark.parametrize("place", range(5))
def test_a_face_that_makes_no_other_vehicle_is_left_out(stray, place):
    faces = [*car(steered=10.0)]
    faces.insert(place, stray)
    by_name, left_out = named(faces, UP, towards(FORWARD))
    assert left_out == (place,)
    assert sorted(by_name.values()) == [i for i in range(5) if i != place]
    assert [faces[by_name[wheel]].centre_m[0] for wheel in WHEELS] == [0.0, 0.0, 2.7, 2.7]


def test_a_fifth_face_that_nearly_makes_another_vehicle_is_not_left_out():
    """A rival need not keep the limits: 2.65 m is wider than any track, but not by much."""
    fifth = FoundTarget(np.array([0.0, 1.9, 0.3]), np.array([0.0, 1.0, 0.0]), 0.7)
    bent = car(shift=0.3)  # a damaged car is not in line either
    assert "of which" in refusal([*bent, fifth])
    far = FoundTarget(np.array([0.0, 3.05, 0.3]), np.array([0.0, 1.0, 0.0]), 0.7)
    assert find_axles([*bent, far], RADIUS_M).left_out == (4,)
    weak = FoundTarget(fifth.centre_m, fifth.normal, 0.6)  # less than 0.7 of the others' 0.9
    assert find_axles([*bent, weak], RADIUS_M).left_out == (4,)
    assert find_axles([*car(), fifth], RADIUS_M).left_out == (4,)  # one that is in line decides


@pytest.mark.parametrize(
    "faces",
    [
        car(rear=0.7, front=0.7),
        car(rear=2.7, front=2.7),
        car(base=1.4),
        car(base=7.2),
        car(rear=2.4, front=1.5),
        car(shift=0.8),
        [
            FoundTarget(f.centre_m, -f.normal, f.match) for f in car()
        ],  # seen from between two vehicles
        [
            FoundTarget(f.centre_m, turned(f.normal, 25.0), f.match) for f in car()
        ],  # no axle is straight
        moved(car()[:2], np.eye(3), np.zeros(3))
        + moved(car()[2:], np.eye(3), np.array([0.0, 0.0, 0.0]))[:1]
        + [FoundTarget(np.array([2.7, 0.75, 0.3]), np.array([1.0, 0.0, 0.0]), 0.9)],
    ],
)
def test_four_faces_that_stand_as_no_vehicle_does_are_refused(faces):
    text = refusal(faces)
    assert text.startswith("4 targets found, but no four are arranged as a vehicle's wheels")
    assert text.count(" m (match ") == 4


def test_many_faces_are_listed_in_part():
    rng = np.random.default_rng(0)
    faces = [FoundTarget(rng.uniform(-20, 20, 3), rotation(rng)[0], 0.5) for _ in range(40)]
    text = refusal(faces)
    assert "32 more" in text
    assert len(text) < 1200


@pytest.mark.parametrize(
    ("front", "says"),
    [
        (towards([0.0, 1.0, 0.0]), "it runs 90° off the line"),
        (towards([0.0, 0.0, -1.0]), "it runs 90° off"),
        (towards(turned(FORWARD, 65.0)), "it runs 65° off"),
        (Front("--front-point", None, (1.35, 0.0, 0.5)), "it lies midway between the axles"),
        (Front("--front-point", None, (1.6, 5.0, 0.5)), "midway"),
        (Front("--front-point", None, (2700.0, 0.0, 0.0)), "2697.3 m from the nearer axle"),
    ],
)
def test_a_front_that_tells_nothing_is_refused_with_what_would(front, says):
    faces = car()
    axles = find_axles(faces, RADIUS_M)
    with pytest.raises(InputError) as caught:
        front.is_ahead(*axles.centres_m(faces).mean(axis=1))
    text = str(caught.value)
    assert text.startswith(front.note)
    assert says in text
    if front.direction:
        assert re.search(r"axles, (-?)1\.000,0\.000,0\.000 or (-?)1\.000,0\.000,0\.000", text)


def ways(faces):
    axles = find_axles(faces, RADIUS_M)
    return [axles.named(faces, UP, ahead) for ahead in (True, False)]


@pytest.mark.parametrize(
    "shown", [{0: "RR"}, {3: "FL"}, {0: "RR", 2: "FR"}, dict(enumerate(WHEELS))]
)
def test_markers_tell_the_front(shown):
    faces = car()
    by_name = wheels_by_markers(ways(faces), shown, faces)
    assert [by_name[wheel] for wheel in WHEELS] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("shown", "says"),
    [
        ({}, "no board's markers identify its wheel, so the front is unknown"),
        (
            {0: "RR", 1: "FR"},
            "target 1 is RR, target 2 is FR, which contradicts the targets' positions",
        ),
        ({0: "RL", 1: "RR"}, "which contradicts"),
        ({0: "FR"}, "which contradicts"),  # on the right, but the way round has FL there
    ],
)
def test_markers_that_tell_nothing_or_contradict_are_refused(shown, says):
    faces = car()
    with pytest.raises(InputError, match=re.escape(says)):
        wheels_by_markers(ways(faces), shown, faces)


def test_markers_check_the_front_that_is_reported():
    faces = car()
    shown_way = ways(faces)[:1]
    shown = {index: wheel for wheel, index in ways(faces)[1].items()}
    with pytest.raises(InputError, match="check which board is on which wheel, and --front"):
        wheels_by_markers(shown_way, shown, faces)
    assert wheels_by_markers(shown_way, {}, faces) == shown_way[0]
