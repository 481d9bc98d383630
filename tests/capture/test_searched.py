"""Hints on a scan: a box leaves what is used, a region what is searched, each part its own rows."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.capture.hints import Hint
from wheelplane.capture.searched import searched
from wheelplane.errors import InputError
from wheelplane.readers import Part, Scan

LEFT_HALF = ((0.0, 0.0, 0.5), (0.5, 0.0, 0.5), (0.5, 1.0, 0.5), (0.0, 1.0, 0.5))


@pytest.fixture
def scan():
    points = np.random.default_rng(0).uniform(0.0, 1.0, (3000, 3))
    parts = (Part("one", 0, 1000, None), Part("two", 1000, 3000, None))
    return Scan(points, np.arange(3000, dtype=np.float32), "scan.ply", 0, parts=parts)


def check_rows(kept, scan, inside):
    """The points inside, with their intensities, each in the part that it was in."""
    np.testing.assert_array_equal(kept.points_m, scan.points_m[inside])
    np.testing.assert_array_equal(kept.intensity, scan.intensity[inside])
    for part, before in zip(kept.parts, scan.parts, strict=True):
        rows = kept.points_m[part.start : part.stop]
        own = slice(before.start, before.stop)
        np.testing.assert_array_equal(rows, scan.points_m[own][inside[own]])


def test_a_region_leaves_all_to_be_used_and_its_own_to_be_searched(scan):
    within = searched(scan, Hint(region_m=LEFT_HALF), "car")
    assert within.used is scan
    assert within.by_region
    check_rows(within.points, scan, scan.points_m[:, 0] < 0.5)
    assert within.shows(np.array([0.2, 0.9, 44.0]))
    assert not within.shows(np.array([0.7, 0.9, 0.5]))


def test_a_box_cuts_off_and_a_region_chooses_of_the_rest(scan):
    hint = Hint(None, (0.0, 0.0, 0.0), (1.0, 0.5, 1.0), region_m=LEFT_HALF)
    within = searched(scan, hint, "car")
    in_box = scan.points_m[:, 1] <= 0.5
    check_rows(within.used, scan, in_box)
    check_rows(within.points, scan, in_box & (scan.points_m[:, 0] < 0.5))


def test_without_a_hint_or_with_a_point_all_is_searched(scan):
    for hint in (None, Hint((0.5, 0.5, 0.5))):
        within = searched(scan, hint, "car")
        assert within.used is within.points is scan
        assert not within.by_region
        assert within.shows(np.zeros(3))
    assert within.near_m.tolist() == [0.5, 0.5, 0.5]


@pytest.mark.parametrize(
    "hint",
    [
        Hint(region_m=tuple((x + 5.0, y, z) for x, y, z in LEFT_HALF)),
        Hint(None, (5.0, 0.0, 0.0), (6.0, 1.0, 1.0)),
    ],
)
def test_where_no_point_is_left_the_scan_is_refused(scan, hint):
    with pytest.raises(InputError, match=r"^car: The operator .* none of its 3000 points"):
        searched(scan, hint, "car")
