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

DISC = load_target("disc-250")


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
