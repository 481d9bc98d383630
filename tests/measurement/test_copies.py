"""Points that stand in a scan more than once show nothing of their own."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.support.made import read_ply, write_small_capture
from tests.support.scenes import Setup, make
from wheelplane.config import Config
from wheelplane.detection.find_target import find_target
from wheelplane.measure import fit_target
from wheelplane.measurement.observe import notes_on_copies
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250").model_copy(update={"chamfer": 0.0})  # sharp: u of one is random


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    return read_ply(write_small_capture(folder / "capture", trials=0) / "rr.ply")[0]


def found(points):
    patch = find_target(points, DISC, Config().segment, 0)
    return patch, fit_target(patch, DISC, Config()).target


def u_of(fitted):
    covariance = sum(part.covariance for part in fitted.components)
    return np.sqrt([np.trace(covariance[:3, :3]), np.trace(covariance[3:, 3:])])


@pytest.mark.parametrize("times", [2, 3, 4])
@pytest.mark.parametrize("off_m", [0.0, 1e-8])
@pytest.mark.parametrize("mixed", [False, True])
def test_a_scan_merged_with_itself_is_that_scan(scanned, times, off_m, mixed):
    """u fell by the root of the number of copies."""
    rng = np.random.default_rng(times)
    copies = [scanned, *(scanned + off_m for _ in range(times - 1))]
    points = np.vstack(copies)
    points = rng.permutation(points) if mixed else points
    patch, fitted = found(points)
    plain, expected = found(scanned)
    assert patch.copies > 0.9 * (times - 1) * len(plain.face_m)
    np.testing.assert_allclose(u_of(fitted), u_of(expected), rtol=0.05)
    turned = np.linalg.norm(fitted.normal - expected.normal)  # its points are of another place
    assert turned < 0.3 * u_of(expected)[0]
    (note,) = notes_on_copies(patch, "FL")
    share = int(re.match(r"(\d+) % of the points on the target of FL are", str(note)).group(1))
    assert share == pytest.approx(100 - 100 / times, abs=2)
    assert not plain.copies
    assert not notes_on_copies(plain, "FL")


NEAR = {
    "rounded to 0.1 mm": lambda p, rng: np.round(p, 4),
    "rounded to 1 mm": lambda p, rng: np.round(p, 3),
    "single precision": lambda p, rng: p.astype(np.float32),
    "shifted": lambda p, rng: p + np.array([3e-5, -4e-5, 5e-5]),
    "off by 0.1 mm": lambda p, rng: p + rng.normal(0.0, 1e-4, p.shape),
}


@pytest.mark.parametrize("times", [2, 4])
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("kind", NEAR)
def test_copies_that_miss_their_places_count_once(scanned, kind, mixed, times):
    """As of one scan that was exported twice; u was 0.7 of what it is, and 0.5 of four."""
    rng = np.random.default_rng(times)
    points = np.vstack([scanned, *(NEAR[kind](scanned, rng) for _ in range(times - 1))])
    points = rng.permutation(points) if mixed else points
    patch, fitted = found(points)
    plain, expected = found(scanned)
    assert patch.copies == pytest.approx((times - 1) * len(plain.face_m), rel=0.02)
    assert np.all(u_of(fitted) > 0.95 * u_of(expected))


@pytest.mark.parametrize("noise_m", [3e-5, 8e-4])
def test_a_second_scan_by_the_same_beams_is_no_copy(noise_m):
    """Its points lie close to the first one's where noise is small, and show as much again."""
    true = make(Setup(spacing_m=1.3e-3, noise_m=0.0), 0).points_m
    rng = np.random.default_rng(1)
    range_m = np.linalg.norm(true, axis=1, keepdims=True)
    one, other = (true * (1.0 + rng.normal(0.0, noise_m, range_m.shape) / range_m) for _ in "ab")
    patch, both = found(np.vstack([one, other]))
    _, single = found(one)
    assert patch.copies == 0
    assert u_of(both)[0] < 0.8 * u_of(single)[0]


@pytest.mark.parametrize("share", [0.005, 0.04])
def test_a_part_that_stands_twice_is_counted_once(scanned, share):
    some = scanned[np.random.default_rng(1).random(len(scanned)) < share]
    patch, _ = found(np.vstack([scanned, some]))
    assert (patch.copies > 0) == (share > 0.02)


def test_points_in_one_place_by_coarse_steps_are_no_copies():
    """A millimetre apart, and rounded to it: many share places, and each is one of its own."""
    points = make(Setup(spacing_m=6e-4, incidence_deg=15.0, noise_m=4e-4), 0).points_m
    points = np.round(points, 3)
    assert len(np.unique(points, axis=0)) < 0.9 * len(points)
    assert not find_target(points, DISC, Config().segment, 0).copies
