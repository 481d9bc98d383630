"""The target's face is found amid all else, or the reason why not is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.printing import setup_of
from tests.support.scenes import WHEEL, Setup, Sheet, make, rotation
from tests.support.single_scan import measure_scan
from wheelplane.config import Config, SegmentConfig
from wheelplane.detection.candidates import Candidate
from wheelplane.detection.find_target import (
    LIKELY,
    _is_scrap,
    candidate_near,
    find_candidates,
    find_target,
    rivals,
)
from wheelplane.errors import NotMeasuredError
from wheelplane.readers.scan import Scan
from wheelplane.targets.plates import DiscTarget, RectangleTarget
from wheelplane.targets.registry import load_target

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
COARSE = Setup(spacing_m=0.0025, half_width_m=0.25, pairs=8)


def find(points, target=DISC, seed=0):
    return find_target(points, target, SegmentConfig(), seed)


def status(points, target=DISC, seed=0):
    with pytest.raises(NotMeasuredError) as caught:
        find(points, target, seed)
    assert "\n" not in str(caught.value)
    return caught.value.status


def whole_status(points):
    """Why the scan was not measured, at whichever stage."""
    with pytest.raises(NotMeasuredError) as caught:
        measure_scan(Scan(points, None, "scan", 0), DISC, Config())
    return caught.value.status


def off(patch, cloud):
    """Distance of the patch's origin from the true centre, metres."""
    return float(np.linalg.norm(patch.origin_m - cloud.centre_m))


def tilt(a, b):
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b)))


# A raster cell holds four points, or is a sixtieth of the radius; the start is good to two cells,
# and the band of the face to its half width over the radius.
def start_m(setup):
    return 2.0 * max(2.0 * setup.spacing_m, setup.radius_m / 60.0)


SETUPS = {
    "plain": COARSE,
    "wheel": WHEEL,
    "head-on": COARSE.but(incidence_deg=0.0),
    "60 degrees": COARSE.but(incidence_deg=60.0, spacing_m=0.002),
    "thin": COARSE.but(thickness_m=0.003),
    "thick": COARSE.but(thickness_m=0.02),
    "near background": COARSE.but(background_m=0.02),
    "far background": COARSE.but(background_m=0.3),
    "no background": COARSE.but(background_m=None),
    "sparse": COARSE.but(spacing_m=0.005),
    "filtered": COARSE.but(filtered=True),
    "drop-outs": COARSE.but(dropout=0.4),
    "noisy": COARSE.but(noise_m=0.002),
    "parallel rim": COARSE.but(extra=(Sheet((0, 0, -0.03), inner=0.09, outer=0.2),)),
    "larger panel": COARSE.but(
        extra=(Sheet((0.32, 0.3, -0.03), normal=(0.1, 0.1, 1), half=(0.16, 0.16)),),
        half_width_m=0.45,
        spacing_m=0.003,
    ),
    "strip before it": COARSE.but(extra=(Sheet((0.03, 0, 0.06), half=(0.02, 0.5)),)),
}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", SETUPS)
def test_finds_the_target(name, seed):
    cloud = make(SETUPS[name], seed)
    patch = find(cloud.points_m)
    assert off(patch, cloud) < start_m(cloud.setup)
    assert tilt(patch.basis[2], cloud.normal) < 0.016


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["plain", "wheel", "60 degrees"])
def test_patch_holds_every_point_of_the_target(name, seed):
    cloud = make(SETUPS[name], seed)
    patch = find(cloud.points_m)
    near = {tuple(row) for row in np.round(patch.face_m + patch.origin_m, 9)}
    face = cloud.face_m
    sigma = cloud.setup.noise_m
    clear = face[np.abs((face - cloud.centre_m) @ cloud.normal) < 4.0 * sigma]
    assert len(clear) > 500
    assert all(tuple(row) in near for row in np.round(clear, 9))
    assert len(patch.face_m) < 0.9 * len(cloud.points_m)


@pytest.mark.parametrize("seed", range(6))
def test_normal_points_to_the_scanner(seed):
    cloud = make(WHEEL, seed)
    patch = find(cloud.points_m)
    assert patch.basis[2] @ cloud.normal > 0.99
    assert np.linalg.det(patch.basis) == pytest.approx(1.0, abs=1e-12)


def test_candidates_are_ordered_and_in_scanner_coordinates():
    cloud = make(SETUPS["strip before it"], 2)
    candidates = find_candidates(cloud.points_m, DISC, SegmentConfig(), 0)
    matches = [candidate.match for candidate in candidates]
    assert matches == sorted(matches, reverse=True)
    assert len(candidates) > 1
    assert matches[0] > 0.7 > matches[1]
    assert np.linalg.norm(candidates[0].centre_m - cloud.centre_m) < start_m(cloud.setup)


def test_same_seed_same_patch_and_other_seeds_agree():
    cloud = make(WHEEL, 3)
    first, again = find(cloud.points_m, seed=5), find(cloud.points_m, seed=5)
    np.testing.assert_array_equal(first.face_m, again.face_m)
    np.testing.assert_array_equal(first.basis, again.basis)
    for seed in range(6, 10):
        assert off(find(cloud.points_m, seed=seed), cloud) < start_m(cloud.setup)


@pytest.mark.parametrize("shift", [0.0, 1e4, 1e7])
def test_rotated_shifted_permuted_mirrored(shift):
    cloud = make(WHEEL, 4)
    rng = np.random.default_rng(11)
    R, t = rotation(rng), shift * np.array([1.0, 0.7, -1.0])
    for move in (np.eye(3), R, np.diag([1.0, 1.0, -1.0])):
        points = rng.permutation(cloud.points_m) @ move.T + t
        patch = find(points)
        assert np.linalg.norm(patch.origin_m - (move @ cloud.centre_m + t)) < start_m(WHEEL)
        assert tilt(patch.basis[2], move @ cloud.normal) < 0.016


@pytest.mark.parametrize("scale", [0.32, 2.4])
def test_scaled_with_its_target(scale):
    cloud = make(WHEEL, 5)
    target = DiscTarget(shape="disc", diameter=0.25 * scale)
    patch = find(cloud.points_m * scale, target)
    assert np.linalg.norm(patch.origin_m - cloud.centre_m * scale) < start_m(WHEEL) * scale


NOTHING = {
    "uniform": lambda rng: rng.uniform(-0.5, 0.5, (3000, 3)),
    "sphere": lambda rng: 0.3 * _unit(rng.normal(size=(20_000, 3))),
    "cylinder": lambda rng: np.column_stack(
        [0.125 * _unit(rng.normal(size=(5000, 2))), rng.uniform(-0.5, 0.5, 5000)]
    ),
    "line": lambda rng: np.outer(np.linspace(0, 1, 5000), [1.0, 2.0, 3.0]),
    "fuzzy line": lambda rng: (
        np.outer(np.linspace(0, 1, 5000), [1.0, 2.0, 3.0]) + rng.normal(0, 1e-3, (5000, 3))
    ),
    "one point": lambda rng: np.ones((5000, 3)),
    "large plane": lambda rng: np.column_stack(
        [rng.uniform(-1, 1, (20_000, 2)), rng.normal(0, 8e-4, 20_000)]
    ),
}
REFUSED = ("too-few-points", "no-plane", "no-target", "ambiguous-target")


def _unit(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", NOTHING)
def test_no_target_in(name, seed):
    points = NOTHING[name](np.random.default_rng(seed))
    assert status(points, seed=seed) in REFUSED


@pytest.mark.parametrize("count", [1, 2, 3, 4, 10, 14])
def test_a_handful_of_points(count):
    face = make(COARSE.but(background_m=None), 0).face_m
    points = face[:: len(face) // count][:count]
    assert status(points) in REFUSED


def test_no_points():
    assert status(np.zeros((0, 3))) == "too-few-points"


@pytest.mark.parametrize("diameter", [0.2, 0.3, 0.35])
def test_target_of_another_size_is_refused(diameter):
    for seed in range(2):
        cloud = make(COARSE, seed)
        target = DiscTarget(shape="disc", diameter=diameter)
        assert status(cloud.points_m, target) in REFUSED


def double(apart, depth, setup=COARSE):
    cloud = make(setup, 6)
    return np.concatenate([cloud.points_m, cloud.points_m + cloud.R @ [apart, 0.0, depth]])


def test_two_equal_targets_are_ambiguous():
    assert status(double(0.9, 0.3)) == "ambiguous-target"


@pytest.mark.parametrize("apart", [0.35, 0.9])
def test_two_equal_targets_in_one_plane_are_ambiguous(apart):
    assert status(double(apart, 0.0)) == "ambiguous-target"


BESIDE = COARSE.but(half_width_m=0.42, spacing_m=0.003)


def test_panel_in_the_plane_of_the_target():
    wrong = []
    for seed in range(4):
        panel = Sheet((0.32, 0.0, 0.0), half=(0.15, 0.3))
        cloud = make(BESIDE.but(extra=(panel,)), seed)
        try:
            wrong.append(off(find(cloud.points_m), cloud) > start_m(cloud.setup))
        except NotMeasuredError:
            wrong.append(True)
    assert not any(wrong)


def test_panel_alone_is_no_target():
    for seed in range(4):
        panel = Sheet((0.0, 0.0, 0.0), half=(0.15, 0.3))
        setup = BESIDE.but(extra=(panel,), radius_m=0.001, thickness_m=1e-4)
        assert whole_status(make(setup, seed).points_m) in (*REFUSED, "wrong-outline", "no-outline")


def test_thinly_scanned_sphere_is_no_target():
    for seed in range(4):
        points = 0.3 * _unit(np.random.default_rng(seed).normal(size=(5000, 3)))
        assert status(points, seed=seed) in REFUSED


@pytest.mark.slow
def test_wheel_without_a_target():
    for seed in range(8):
        azimuth = np.random.default_rng([seed, 5]).uniform(20, 160)
        bare = WHEEL.but(radius_m=0.001, thickness_m=1e-4, azimuth_deg=azimuth)
        assert whole_status(make(bare, seed).points_m) in (*REFUSED, "wrong-outline")


@pytest.mark.parametrize(
    ("match", "points", "kept"),
    [(0.47, 151, False), (0.8, 151, True), (0.47, 1000, True), (0.2, 4000, True)],
)
def test_a_scrap_of_few_points_is_no_rival_of_a_target_of_many(match, points, kept):
    many = Candidate(np.zeros(3), np.eye(3), 0.45, 0.001, 0.005, 4114)
    other = replace(many, centre_m=np.full(3, 0.2), match=match, points=points)
    of = load_target("disc-250"), SegmentConfig()
    assert _is_scrap(other, [many, other], *of) is not kept
    assert not _is_scrap(many, [many, other], *of)


@pytest.mark.parametrize(
    ("match", "points", "kept"), [(1.0, 997, True), (0.8, 997, False), (1.0, 1300, True)]
)
def test_a_whole_target_that_is_far_off_is_no_scrap_beside_one_hidden_in_part(match, points, kept):
    """It has fewer points for its distance: that of the next wheel, or the one that is meant."""
    hidden = Candidate(np.zeros(3), np.eye(3), 0.67, 0.0005, 0.005, 6778)
    whole = replace(hidden, centre_m=np.array([1.0, 0.0, 0.0]), match=match, points=points)
    assert _is_scrap(whole, [hidden, whole], load_target("disc-250"), SegmentConfig()) is not kept


def test_a_whole_target_far_off_is_not_passed_over_for_one_hidden_in_part():
    rng = np.random.default_rng(0)
    parts = []
    for x_m, count, end_m in ((0.0, 1000, 1.0), (1.0, 8000, 0.075)):
        radius, angle = 0.125 * np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * np.pi, count)
        face = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)])
        behind = np.column_stack([rng.uniform(-0.2, 0.2, (count, 2)), np.full(count, -0.05)])
        parts.append(np.vstack([face[face[:, 0] < end_m], behind]))
        parts[-1][:, 0] += x_m
    points = np.vstack(parts)
    points[:, 2] += rng.normal(0.0, 0.0005, len(points))
    with pytest.raises(NotMeasuredError, match=r"two planes .* 99\d mm apart") as error:
        find_target(points, load_target("disc-250"), SegmentConfig(), 0)
    assert error.value.status == "ambiguous-target"


@pytest.mark.parametrize(
    ("aside_m", "match", "is_rival"),
    [(0.0, 0.9, False), (0.0, 0.97, True), (0.3, 0.9, True), (0.3, 0.7, False)],
)
def test_what_a_target_leaves_of_the_background_beside_it_is_no_rival(aside_m, match, is_rival):
    """Such a piece lies behind it, within a radius; elsewhere, another surface may match less."""
    best = Candidate(np.zeros(3), np.eye(3), 0.68, 0.00075, 0.005, 9400)
    other = replace(best, centre_m=np.array([aside_m, 0.0, 0.08]), match=0.68 * match, points=8000)
    assert rivals(best, other, PLATE, SegmentConfig()) is is_rival


PLATE = RectangleTarget(shape="rectangle", width=0.36, height=0.24, thickness=0.01)
BEFORE_M = 0.06  # distance of a panel before the plate
BOARD = Setup(spacing_m=0.002, half_width_m=0.26, pairs=4)
HIDDEN = (BOARD.but(hidden=0.3), BOARD.but(hidden=0.4, strip_m=0.12))


@pytest.mark.parametrize(
    ("name", "board", "seed", "found"),
    [
        ("rectangle-360x240", HIDDEN[0], 9, True),
        ("rectangle-360x240", HIDDEN[0], 17, True),
        ("rectangle-360x240", HIDDEN[1], 6, False),
        ("rectangle-360x240", HIDDEN[1], 9, False),
        ("square-300", HIDDEN[1], 3, False),
    ],
)
def test_mixed_pixels_at_a_board_before_a_target_are_no_target(name, board, seed, found):
    """They lie about the planes through its edges and the scanner, sparse, or deep in noise.

    What is seen of the background beside the board may be a rival as well.
    """
    target = load_target(name)
    cloud = make(setup_of(target, board), seed)
    if not found:
        assert status(cloud.points_m, target) == "ambiguous-target"
    near_m = None if found else cloud.centre_m
    patch = find_target(cloud.points_m, target, SegmentConfig(), 0, near_m=near_m)
    assert tilt(patch.basis[2], cloud.normal) < 0.01
    assert off(patch, cloud) < 0.01


def behind_a_panel(rng, end_m, spacing_m=0.003):
    """A plate at the origin, normal z, of which a large panel before it hides 58 or 42 percent."""
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.arange(-0.35, 0.35, spacing_m)] * 2))
    x, y = (axis + rng.uniform(0.0, spacing_m, axis.size) for axis in (x, y))
    panel = (x > -0.36) & (x < end_m) & (np.abs(y) < 0.18)
    plate = ~panel & (np.abs(x) < 0.18) & (np.abs(y) < 0.12)
    z = np.where(panel, BEFORE_M, 0.0) + rng.normal(0.0, 0.0005, x.size)
    return np.column_stack([x, y, z])[panel | plate]


@pytest.mark.parametrize("end_m", [-0.03, 0.03])
@pytest.mark.parametrize("seed", range(3))
def test_a_point_on_a_target_is_not_that_on_what_hides_it(seed, end_m):
    """Whichever of the two surfaces matches better, the nearer one is meant."""
    rng = np.random.default_rng(seed)
    R, shift = rotation(rng), rng.uniform(-3.0, 3.0, 3)
    points = behind_a_panel(rng, end_m) @ R.T + shift
    found = find_candidates(points, PLATE, SegmentConfig(), 0)
    depth_m = [float((one.centre_m - shift) @ R[:, 2]) for one in found]
    assert {round(depth / BEFORE_M) for depth in depth_m} == {0, 1}
    own = next(one for one, at in zip(found, depth_m, strict=True) if at < 0.5 * BEFORE_M)
    seen = np.array([0.12, -0.05, 0.0]) @ R.T + shift
    for place in (shift, seen, own.centre_m):
        near = candidate_near(points, place, PLATE, SegmentConfig(), 0)
        assert abs(float((near.centre_m - shift) @ R[:, 2])) < 0.003
    if found[0].match < own.match / LIKELY and found[0] is not own:
        near = candidate_near(points, found[0].centre_m, PLATE, SegmentConfig(), 0)
        assert abs(float((near.centre_m - found[0].centre_m) @ R[:, 2])) < 0.003


def test_of_one_surface_a_point_takes_the_best_match_wherever_it_lies():
    """A whole target: a point half a radius off its middle moves nothing."""
    cloud = make(COARSE, 5)
    best = find(cloud.points_m)
    for way in (cloud.R[:, 0], -cloud.R[:, 1]):
        near = candidate_near(
            cloud.points_m, cloud.centre_m + 0.5 * DISC.radius_m * way, DISC, SegmentConfig(), 0
        )
        assert np.linalg.norm(near.centre_m - best.origin_m) < start_m(COARSE)


@pytest.mark.parametrize("places", [1, 3])
@pytest.mark.parametrize("seed", range(3))
def test_many_points_at_few_places_are_too_few_or_show_no_plane(places, seed):
    """A sample by coordinates holds all points of a place, or none."""
    some = np.random.default_rng(seed).normal(size=(places, 3))
    assert status(np.repeat(some, 300_000 // places, axis=0)) in ("too-few-points", "no-plane")


def test_a_sample_without_a_point_is_named_with_what_it_was_drawn_from():
    with pytest.raises(NotMeasuredError, match="its 300000 points lie at so few places") as caught:
        find(np.tile([1.0, 2.0, 3.0], (300_000, 1)))
    assert caught.value.status == "too-few-points"
