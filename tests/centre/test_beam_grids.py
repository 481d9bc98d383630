"""Grids of beams: stations merged into one cloud show, whatever the order of its points."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.merged import STATIONS, merged
from tests.support.plates import patch_of
from wheelplane.centre.beam_grids import BeamGrid, beam_grids, nearest_grid, of_one_scanner
from wheelplane.centre.stations import of_stations
from wheelplane.config import Config
from wheelplane.measure import fit_target
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")
THIRD = STATIONS[0].but(azimuth_deg=290.0, incidence_deg=25.0)
ORDERS = ("shuffled", "along an axis", "by height", "by cells")


def ordered(cloud, order, seed=0):
    local = cloud.in_target(cloud.points_m)
    rng = np.random.default_rng(seed)
    rows = {
        "shuffled": lambda: rng.permutation(len(local)),
        "along an axis": lambda: np.argsort(local[:, 0]),
        "by height": lambda: np.argsort(local[:, 2]),
        "by cells": lambda: np.lexsort(np.floor(cloud.points_m / 0.02).T),
    }[order]()
    return replace(cloud, points_m=cloud.points_m[rows], on_face=cloud.on_face[rows])


def but(setups, **changes):
    return tuple(one.but(**changes) for one in setups)


def parts_of(cloud):
    return of_stations(patch_of(cloud, DISC), DISC.region)


def shuffled_parts(points_m, cloud, seed):
    whole = replace(cloud, points_m=points_m, on_face=np.ones(len(points_m), bool))
    return parts_of(ordered(whole, "shuffled", seed))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("spacing_m", [0.002, 0.004])
def test_each_station_gets_its_own_points_in_any_order(order, spacing_m):
    cloud, counts = merged(2, but(STATIONS, spacing_m=spacing_m), np.array([0.0, 0.0, 0.002]))
    parts = parts_of(ordered(cloud, order))
    assert len(parts) == 2
    owner = {tuple(row): k >= counts[0] for k, row in enumerate(np.round(cloud.points_m, 6))}
    mixed = []
    for part in parts:
        for points in (
            part.face_m,
            part.around_m[np.hypot(*(part.basis @ part.around_m.T)[:2]) < 0.14],
        ):
            rows = np.round(points + part.origin_m, 6)
            known = [owner[tuple(row)] for row in rows if tuple(row) in owner]
            if points is part.face_m:
                assert len(known) > 0.99 * len(rows)
                mixed.append(np.mean(known))
    low, high = sorted(mixed)
    assert low < 0.02
    assert high > 0.98


@pytest.mark.parametrize("count", [3, 4])
def test_more_stations_are_as_many(count):
    fourth = STATIONS[0].but(azimuth_deg=120.0, incidence_deg=45.0)
    cloud, _ = merged(1, (*STATIONS, THIRD, fourth)[:count])
    assert len(parts_of(ordered(cloud, "shuffled"))) == count


@pytest.mark.parametrize(
    "changes",
    [{"distance_m": 1.0}, {"distance_m": 6.0}, {"pointing_m": 4e-4}, {"spacing_m": 0.008}],
)
def test_grids_are_found_near_and_far_and_with_errors_of_the_angles(changes):
    cloud, _ = merged(3, but(STATIONS, **changes))
    assert len(parts_of(ordered(cloud, "shuffled"))) == 2


@pytest.mark.parametrize("seed", range(3))
def test_grids_show_where_their_scanners_stood(seed):
    """Beams meet at the scanner: their slope at the middle and their distance follow from it."""
    cloud, _ = merged(seed)
    patch = patch_of(cloud, DISC, seed)
    face, around = patch.face_m @ patch.basis.T, patch.around_m @ patch.basis.T
    grids = beam_grids(face[DISC.region.holds(face[:, :2])], around)
    assert len(grids) == 2
    found = {}
    for grid in grids:
        axis = patch.basis.T @ np.append(grid.beam, 1.0) / grid.inverse_distance
        found[round(np.degrees(np.arccos(axis @ cloud.normal / np.linalg.norm(axis))))] = axis
    for setup in STATIONS:
        near = min(found, key=lambda angle: abs(angle - setup.incidence_deg))
        assert near == pytest.approx(setup.incidence_deg, abs=2.0)
        assert np.linalg.norm(found[near]) == pytest.approx(setup.distance_m, rel=0.1)
    assert set(np.unique(nearest_grid(grids, face))) == {0, 1}


def in_units_of_u(cloud, fit):
    """Tilts and position of a fit off the truth, by u, and u, in the target's axes."""
    turn = np.kron(np.eye(2), cloud.R)
    side = np.sign(fit.normal @ cloud.normal)
    off = np.append(cloud.R.T @ (side * fit.normal), cloud.in_target(fit.centre_m))
    u = np.sqrt(np.diag(turn.T @ fit.covariance @ turn))
    seen = [0, 1, 3, 4, 5]
    return off[seen] / u[seen], u[seen]


@pytest.mark.slow
@pytest.mark.parametrize("noise_m", [2e-4, 8e-4])
@pytest.mark.parametrize(
    ("shift_mm", "tilt_deg"),
    [
        ((0, 0, 0), 0.0),
        ((2, 0, 0), 0.0),
        ((0, 0, 0.5), 0.0),
        ((0, 0, 1), 0.0),
        ((0, 0, 4), 0.0),
        ((0, 0, 0), 0.1),
    ],
)
def test_what_shuffled_stations_disagree_by_is_in_the_uncertainty(shift_mm, tilt_deg, noise_m):
    """Registration errors of one of two stations; u follows them, and is no wider without any."""
    shift_m = np.array(shift_mm) * 1e-3
    for seed in range(2):
        setups = but(STATIONS, noise_m=noise_m)
        cloud, _ = merged(seed, setups, shift_m, np.radians(tilt_deg))
        patch = patch_of(ordered(cloud, "shuffled", seed), DISC, seed)
        fit = fit_target(patch, DISC, Config()).target
        assert fit.stations.count == 2
        off, u = in_units_of_u(cloud, fit)
        assert (np.abs(off) < 3.0).all()
        assert u[2:].max() < 6e-5 + 0.75 * np.linalg.norm(shift_m)


@pytest.mark.parametrize("share", [0.5, 0.2])
def test_grids_are_found_in_clouds_thinned_at_random(share):
    cloud, _ = merged(4, but(STATIONS, spacing_m=0.002))
    kept = np.random.default_rng(4).random(len(cloud.points_m)) < share
    assert len(shuffled_parts(cloud.points_m[kept], cloud, 4)) == 2


def test_a_station_of_few_points_is_found():
    few = STATIONS[1].but(spacing_m=0.0098)
    for seed in range(2):
        cloud, counts = merged(seed, (STATIONS[0].but(spacing_m=0.003), few))
        assert counts[1] < 0.1 * counts[0]
        assert len(parts_of(ordered(cloud, "shuffled", seed))) == 2


def grid_with(steps, phase=(0.0, 0.0)):
    numbers = np.vstack([phase, np.transpose(steps)])
    return BeamGrid(numbers, 1.0, np.zeros(2), 0.0)


def test_every_other_beam_is_of_the_same_scanner():
    steps = np.array([[250.0, 10.0], [-20.0, 240.0]])
    one = grid_with(steps)
    for part in ([[0.5, 0.5], [0.5, -0.5]], [[1.0, 0.0], [0.0, 1.0]], [[2.0, 1.0], [1.0, 1.0]]):
        assert of_one_scanner([one, grid_with(part @ steps, (0.3, 0.7))])
    c, s = np.cos(0.05), np.sin(0.05)
    assert not of_one_scanner([one, grid_with(steps @ [[c, -s], [s, c]])])
    assert not of_one_scanner([one, grid_with(1.05 * steps)])


def test_a_beam_gives_one_point():
    grid = grid_with(np.diag([250.0, 250.0]))
    i, j = np.divmod(np.arange(2500), 50)
    points = np.column_stack([i, j, 0.0 * i]) / 250.0
    assert grid.is_seen_once(points)
    assert not grid.is_seen_once(np.concatenate([points, points[::2] + 1e-4]))


@pytest.mark.parametrize("seed", [19, 27])
def test_lines_of_a_drive_with_play_are_of_one_scan(seed):
    """They lie on two grids, but each line's points beside those of its own."""
    cloud, _ = merged(seed, STATIONS[1:], of=0)
    points_m = of_a_drive_with_play(cloud, None)
    assert len(shuffled_parts(points_m, cloud, seed)) == 1


def of_cells(cloud, rng):
    """One point of each voxel of 5 mm."""
    _, first = np.unique(np.floor(cloud.points_m / 0.005), axis=0, return_index=True)
    return cloud.points_m[first]


def of_cells_along_the_face(cloud, rng):
    """The first point of each voxel of 6 mm: the face runs along their layers."""
    _, first = np.unique(
        np.floor(cloud.in_target(cloud.points_m) / 6e-3), axis=0, return_index=True
    )
    return cloud.points_m[first]


def of_a_drive_with_play(cloud, rng):
    """Every other line moved along the lines."""
    ends = np.linalg.norm(np.diff(cloud.points_m, axis=0), axis=1) > 0.1
    line = np.append(0, np.cumsum(ends))
    return cloud.points_m + np.outer(line % 2, 0.0012 * cloud.R[:, 0])


def rounded(cloud, rng):
    return 2e-3 * np.rint(cloud.points_m / 2e-3)


def of_a_hand(cloud, rng):
    """Passes of lines in all directions."""
    passes = []
    for turn in rng.uniform(0.0, np.pi, 12):
        a = np.arange(-0.17, 0.17, 0.004) + rng.uniform(0.0, 0.004)
        b = np.arange(-0.17, 0.17, 0.010) + rng.uniform(0.0, 0.010)
        lines = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
        c, s = np.cos(turn), np.sin(turn)
        passes.append(lines @ np.array([[c, s], [-s, c]]))
    return on_plate(cloud, rng, np.concatenate(passes))


def at_random(cloud, rng):
    return on_plate(cloud, rng, rng.uniform(-0.17, 0.17, (7000, 2)))


def on_plate(cloud, rng, uv):
    depth = np.where(np.hypot(*uv.T) < 0.125, 0.0, -0.08) + rng.normal(0.0, 8e-4, len(uv))
    return np.column_stack([uv, depth]) @ cloud.R.T + cloud.shift_m


SINGLE = {
    "as scanned": ({}, lambda cloud, rng: cloud.points_m),
    "angles 5 % of a step off": ({"pointing_m": 2e-4}, lambda cloud, rng: cloud.points_m),
    "angles 20 % of a step off": ({"pointing_m": 8e-4}, lambda cloud, rng: cloud.points_m),
    "few": ({"spacing_m": 0.012}, lambda cloud, rng: cloud.points_m),
    "clean edges": ({"spot_m": 0.0}, lambda cloud, rng: cloud.points_m),
    "half of them": (
        {"spacing_m": 0.002},
        lambda cloud, rng: cloud.points_m[rng.random(len(cloud.points_m)) < 0.5],
    ),
    "of voxels": ({"spacing_m": 0.002}, of_cells),
    "of voxels along the face": ({"spacing_m": 0.003}, of_cells_along_the_face),
    "of a drive with play": ({}, of_a_drive_with_play),
    "rounded": ({}, rounded),
    "of a hand": ({}, of_a_hand),
    "at random": ({}, at_random),
}


@pytest.mark.parametrize("points", SINGLE)
def test_a_single_scan_in_another_order_stays_whole(points):
    changes, taken = SINGLE[points]
    for seed in range(4):
        cloud, _ = merged(seed, (STATIONS[seed % 2].but(**changes),), of=0)
        assert len(shuffled_parts(taken(cloud, np.random.default_rng(seed)), cloud, seed)) == 1
