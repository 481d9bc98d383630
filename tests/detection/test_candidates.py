"""Candidate planes: whole targets score high, parts of other surfaces low, bent walls nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.config import SegmentConfig
from wheelplane.detection.candidates import (
    FACE_BAND,
    MIN_POINTS,
    ransac_candidates,
    score_candidate,
    threshold_m,
)
from wheelplane.targets.plates import DiscTarget, RectangleTarget

DISC = DiscTarget(shape="disc", diameter=0.25)
OBLONG = RectangleTarget(shape="rectangle", width=0.36, height=0.24)
SIGMA, DENSITY = 0.0008, 60_000  # per square metre
CONFIG = SegmentConfig()
LIMIT = threshold_m(DISC, CONFIG)
CENTRE = np.array([0.4, -0.3, 2.0])


def sheet(half, seed, inside=None):
    """Points of z = 0 within half widths, and within a shape, with noise across."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-1.0, 1.0, (int(4.0 * half[0] * half[1] * DENSITY), 2)) * half
    points = np.column_stack([uv, rng.normal(0.0, SIGMA, len(uv))])
    return points if inside is None else points[inside(uv)]


def disc(seed, hidden=-np.inf):
    return sheet((0.125, 0.125), seed, lambda uv: (np.hypot(*uv.T) < 0.125) & (uv[:, 0] > hidden))


def score(points, R, target=DISC, aside=(0.02, -0.015, 0.001)):
    """The candidate found from a point some millimetres off and a normal tilted by 2 degrees."""
    normal = R @ np.array([np.sin(0.035), 0.0, np.cos(0.035)])
    start = CENTRE + R @ np.array(aside)
    return score_candidate(points @ R.T + CENTRE, start, normal, target, LIMIT)


@pytest.mark.parametrize("seed", range(4))
def test_a_whole_disc_is_centred_whatever_its_pose(seed):
    R = rotation(np.random.default_rng(seed))
    points = disc(seed)
    found = score(points, R)
    cell = 2.0 / np.sqrt(DENSITY)
    assert found.match > 0.8
    assert np.linalg.norm(found.centre_m - CENTRE) < cell < 0.025  # the start is 25 mm off
    assert abs(found.normal @ R[:, 2]) > np.cos(5.0 * 2.0 * SIGMA / 0.0875 / np.sqrt(1000))
    assert found.sigma_m == pytest.approx(SIGMA, rel=0.1)
    assert found.band_m == pytest.approx(max(6.0 * found.sigma_m, FACE_BAND * 0.125))
    assert 0.95 * len(points) < found.points <= len(points)


@pytest.mark.parametrize("angle", [0.2, 1.0, 2.5])
def test_axes_of_a_rectangle_are_those_of_its_sides(angle):
    c, s = np.cos(angle), np.sin(angle)
    R = rotation(np.random.default_rng(1)) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = score(sheet((0.18, 0.12), 2), R, OBLONG)
    assert found.match > 0.7
    assert abs(found.basis[0] @ R[:, 0]) > np.cos(np.radians(4.0))
    np.testing.assert_allclose(found.basis @ found.basis.T, np.eye(3), atol=1e-12)


def test_match_falls_with_what_is_hidden_and_with_what_surrounds_it():
    R = rotation(np.random.default_rng(3))
    whole, half = score(disc(4), R), score(disc(4, hidden=0.0), R)
    wall = score(sheet((0.4, 0.4), 4), R)
    assert whole.match > half.match + 0.2 > 0.4
    assert wall.match < 0.1


def test_a_ball_s_cap_is_no_plane():
    points = disc(5)
    bent = points + [0.0, 0.0, 1.0] * (np.sum(points[:, :2] ** 2, axis=1) / 0.6)[:, None]
    R = np.eye(3)
    assert score(points, R).match > 0.8
    rejected = score(bent, R)
    assert (rejected.match, rejected.points) == (0.0, 0)


@pytest.mark.parametrize("count", [0, 1, 9])
def test_a_handful_of_points_is_rejected(count):
    found = score(disc(6)[:count], np.eye(3))
    assert (found.match, found.points) == (0.0, 0)


def test_order_of_the_points_is_of_no_account():
    points = disc(7)
    one, other = score(points, np.eye(3)), score(points[::-1], np.eye(3))
    np.testing.assert_allclose(other.centre_m, one.centre_m, atol=1e-9)
    assert other.points == one.points


@pytest.mark.parametrize("seed", range(3))
def test_ransac_finds_both_of_two_sheets_once(seed):
    rng = np.random.default_rng(seed)
    R = rotation(rng)
    near, wall = disc(seed), sheet((0.5, 0.5), seed + 10) - [0.0, 0.0, 0.3]
    points = rng.permutation(np.vstack([near, wall])) @ R.T + CENTRE
    found = ransac_candidates(points, DISC, CONFIG, np.random.default_rng(seed))
    depth = [(c.centre_m - CENTRE) @ R[:, 2] for c in found if abs(c.normal @ R[:, 2]) > 0.999]
    assert sum(abs(d) < 0.01 for d in depth) == 1
    assert sum(abs(d + 0.3) < 0.01 for d in depth) == 1
    best = max(found, key=lambda c: c.match)
    assert np.linalg.norm(best.centre_m - CENTRE) < 0.01


def test_ransac_is_repeatable_and_stops_without_points():
    points = disc(8) + CENTRE
    one, other = (
        ransac_candidates(points, DISC, CONFIG, np.random.default_rng(1)) for _ in range(2)
    )
    np.testing.assert_array_equal(one[0].basis, other[0].basis)
    few = points[: MIN_POINTS - 1]
    assert ransac_candidates(few, DISC, CONFIG, np.random.default_rng(1)) == []
