"""Stations merged into one cloud: found where their points follow each other."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.merged import STATIONS, merged
from tests.support.plates import patch_of
from tests.support.scenes import make
from wheelplane.centre.stations import of_stations
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")


def parts_of(cloud, target=DISC):
    return of_stations(patch_of(cloud, target), target.region)


def from_station(cloud, patch, first, last):
    """How many of a patch's points on the target are these rows of the cloud, and how many all."""
    inside = np.linalg.norm(patch.face_m @ patch.basis[:2].T, axis=1) < 0.12
    points = patch.face_m[inside] + patch.origin_m
    near = cloud.points_m[first:last]
    own = {tuple(row) for row in np.round(near, 9)}
    return sum(tuple(row) in own for row in np.round(points, 9)), len(points)


@pytest.mark.parametrize("shares", [(1.0, 1.0), (1.0, 0.25), (0.25, 1.0), (1.0, 0.08)])
@pytest.mark.parametrize("shift_mm", [0.0, 4.0])
def test_each_station_gets_its_own_points(shares, shift_mm):
    setups = [
        one.but(spacing_m=one.spacing_m / np.sqrt(share))
        for one, share in zip(STATIONS, shares, strict=True)
    ]
    cloud, counts = merged(0, setups, np.array([0.0, 0.0, shift_mm * 1e-3]))
    parts = parts_of(cloud)
    assert len(parts) == 2
    ends = np.append(0, np.cumsum(counts))
    for part, first, last in zip(parts, ends[:-1], ends[1:], strict=True):
        own, of_all = from_station(cloud, part, first, last)
        assert own >= 0.99 * of_all
    assert sum(len(part.around_m) for part in parts) == len(patch_of(cloud, DISC).around_m)


def test_three_stations_are_three():
    third = STATIONS[0].but(azimuth_deg=290.0, incidence_deg=25.0)
    cloud, _ = merged(1, (*STATIONS, third))
    assert len(parts_of(cloud)) == 3


def test_stations_that_see_a_half_each_are_two():
    halves = [
        one.but(keep=lambda u, v, side=side: side * u > -0.005)
        for one, side in zip(STATIONS, (1.0, -1.0), strict=True)
    ]
    found = [len(parts_of(merged(seed, halves)[0])) for seed in range(6)]
    # Where both pass along the line between the halves in one sense, they are as one scan.
    assert set(found) <= {1, 2}
    assert found.count(2) >= 3


@pytest.mark.parametrize("seed", range(3))
def test_points_of_one_scan_are_of_one_station(seed):
    """Whatever the direction of its lines, and however few; hidden in part, or serpentine."""
    for setup in (
        STATIONS[seed % 2],
        STATIONS[0].but(spacing_m=0.012),
        STATIONS[1].but(keep=lambda u, v: u + v > 0.0),
        STATIONS[1].but(keep=lambda u, v: np.hypot(u, v) > 0.06),
    ):
        cloud, _ = merged(seed, (setup,), of=0)
        assert len(parts_of(cloud)) == 1


def test_layers_of_voxels_are_no_stations():
    """One scan, thinned to the means of voxels in the order of their layers along the face."""
    setup = STATIONS[0].but(spacing_m=0.002, turned=False)
    cloud = make(setup, 5)
    local = cloud.points_m - cloud.centre_m
    _, voxel, count = np.unique(
        np.floor(local[:, ::-1] / 0.005), axis=0, return_inverse=True, return_counts=True
    )
    sums = [np.bincount(voxel.ravel(), column) for column in local.T]
    thinned = cloud.centre_m + np.stack(sums, axis=1) / count[:, None]
    found = replace(cloud, points_m=thinned, on_face=np.ones(len(thinned), bool))
    assert len(parts_of(found)) == 1


def test_many_passes_are_no_stations():
    """More than six parts of one slope each are an order by something else."""
    lines = [STATIONS[k % 2].but(spacing_m=0.007, azimuth_deg=40.0 * k) for k in range(7)]
    assert len(parts_of(merged(4, lines[:6])[0])) == 6
    assert len(parts_of(merged(4, lines)[0])) == 1
