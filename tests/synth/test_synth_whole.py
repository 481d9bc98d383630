"""Made clouds of whole vehicles: what is true of them, beam by beam, and what they cost."""

from __future__ import annotations

import json
import sys
import tracemalloc
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.support.made import (
    DEFAULT,
    DISC,
    IDEAL,
    RADIUS_M,
    SALOON,
    changed,
    chi_square_bounds,
    of_spot,
    read_ply,
)
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.instruments import draw_instruments
from wheelplane_synth.parameters.parameters import Beam, VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.scanner.echoes import trace
from wheelplane_synth.scanner.lattice import draw_lattice, preview_scene
from wheelplane_synth.scanner.noise import correlated_rows, margin
from wheelplane_synth.scanner.panorama import scan_rows
from wheelplane_synth.scanner.scanner import directions
from wheelplane_synth.scanner.spot import BEND_M
from wheelplane_synth.scanner.spot_average import average
from wheelplane_synth.scene.bay import bay_solids, ground_solids
from wheelplane_synth.scene.scene import around
from wheelplane_synth.scene.site import draw_site
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

pytestmark = pytest.mark.slow

NARROW = {"panorama.window_deg": 110.0, "panorama.lowest_deg": -45.0, "panorama.highest_deg": 15.0}
POINTS = 400_000


def make(out: Path, *, scanner: Path, seed: int = 5, vehicle: Path = SALOON, **more):
    files = {"vehicle": vehicle, "scanner": scanner, "target": DISC}
    write_whole(out, **({"seed": seed, "points": POINTS} | files | more))
    return json.loads((out / "truth.json").read_text())


def by_station(folder: Path, shown):
    """Points of each station relative to it, and what is reported of it."""
    points, intensity = read_ply(folder / "vehicle.ply")
    for used in shown["used"]["scans"]:
        rows = slice(*used["rows"])
        yield points[rows] - used["station_m"], intensity[rows], used


@pytest.fixture(scope="module")
def ideal(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ideal")
    shown = make(folder / "car", scanner=changed(IDEAL, folder, NARROW))
    return folder / "car", shown


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noisy")
    return folder / "car", make(folder / "car", scanner=DEFAULT, points=60_000)


def staged(scanner: Path, seed: int = 1):
    """A site before anything is scanned, and the instruments."""
    rng = np.random.default_rng(seed)
    kit = draw_instruments(SALOON, scanner, DISC, rng)
    draws = [np.random.default_rng([seed, k]) for k in range(len(WHEELS))]
    return draw_site(draw_vehicle(kit.vehicle_recipe, rng), kit, seed, None, draws), kit


def scanned(site, station, beam: Beam, step_rad: float, block: int):
    grid = draw_lattice(site.panorama, site.middle_m(station), step_rad, (9, station.number))
    scene = site.scene(station)
    caster = site.caster(station)
    nearest_m = preview_scene(scene, caster, site.panorama, site.middle_m(station)).nearest_m
    target_m = site.nearest_target_m(station)
    return scan_rows(scene, caster, grid, beam, target_m, nearest_m, (9, station.number), block)


def on_face(points, wheel, radius_m: float = RADIUS_M):
    """Which points lie on a wheel's true face, to what rounding allows."""
    away = points - wheel["centre_m"]
    off_m = away @ wheel["normal"]
    radius = np.linalg.norm(away - np.outer(off_m, wheel["normal"]), axis=1)
    return (np.abs(off_m) < 1e-12) & (radius <= radius_m)


def test_points_on_a_target_lie_on_its_true_plane_and_are_counted(ideal):
    folder, shown = ideal
    points, _ = read_ply(folder / "vehicle.ply")
    for used in shown["used"]["scans"]:
        mine = points[slice(*used["rows"])]
        for wheel in shown["wheels"]:
            found = on_face(mine, wheel).sum()
            assert found == used["points_on_target"][wheel["name"]]
        assert sum(used["points_on_target"].values()) > 300


def off_the_grid(values, step: float) -> float:
    """By how many steps values lie off a grid whose phase is their own."""
    phase = np.exp(2j * np.pi * values / step)
    return float(np.abs(np.angle(phase / phase[0])).max() / (2 * np.pi))


def test_every_point_lies_on_a_beam_of_its_station(ideal):
    folder, shown = ideal
    for away, _, used in by_station(folder, shown):
        columns = np.ceil(np.radians(110.0) / used["step_rad"])
        steps = {"row": used["step_rad"], "column": np.radians(110.0) / columns}
        for shift_m, fits in ((0.0, True), (1e-4, False)):
            x, y, z = (away + shift_m).T
            row = off_the_grid(np.arctan2(z, np.hypot(x, y)), steps["row"])
            turn = np.angle((x + 1j * y) / (x[0] + 1j * y[0]))
            column = off_the_grid(turn, steps["column"])
            assert (max(row, column) < 1e-9) == fits


def test_a_target_holds_as_many_points_as_its_solid_angle(ideal):
    _, shown = ideal
    ring = np.sqrt((np.arange(60) + 0.5) / 60)[:, None]
    turn = 2 * np.pi * np.arange(60) / 60
    places = RADIUS_M * np.stack([ring * np.cos(turn), ring * np.sin(turn)], axis=-1).reshape(-1, 2)
    for number, (wheel, used) in enumerate(
        zip(shown["wheels"], shown["used"]["scans"], strict=True)
    ):
        u, v, normal = (np.array(wheel[k]) for k in ("u", "v", "normal"))
        away = wheel["centre_m"] + places @ np.array([u, v]) - used["station_m"]
        far = np.linalg.norm(away, axis=1)
        level = np.hypot(away[:, 0], away[:, 1]) / far
        cosine = np.abs(away @ normal) / far
        columns = np.ceil(np.radians(110.0) / used["step_rad"])
        beam = used["step_rad"] * np.radians(110.0) / columns
        wanted = np.pi * RADIUS_M**2 * np.mean(cosine / far**2 / level) / beam
        # Of a lattice within a convex outline, the count errs as the root of the cells it cuts.
        cut = 2 * np.pi * RADIUS_M / (np.mean(far) * used["step_rad"])
        found = used["points_on_target"][WHEELS[number]]
        assert abs(found - wanted) < 2.0 * np.sqrt(cut)
        assert 2.0 * np.sqrt(cut) < 0.1 * wanted


def test_the_cloud_has_as_many_points_as_asked_for(ideal, noisy):
    for (folder, shown), asked in ((ideal, POINTS), (noisy, 60_000)):
        points, intensity = read_ply(folder / "vehicle.ply")
        ends = [used["rows"] for used in shown["used"]["scans"]]
        assert ends[0][0] == 0
        assert ends[-1][1] == len(points) == len(intensity)
        assert all(one[1] == other[0] for one, other in pairwise(ends))
        assert abs(len(points) / asked - 1.0) < 0.02
        assert np.isfinite(points).all()
        assert (intensity >= 0.0).all()


def seen_in_vehicle(folder, shown):
    points, _ = read_ply(folder / "vehicle.ply")
    frame = shown["frame"]
    axes = np.array([frame["forward"], frame["left"], frame["up"]])
    return (points - frame["origin_m"]) @ axes.T


def test_it_is_a_car_in_a_bay(ideal):
    """Closed forms: the floor, the walls, doors larger than targets, the lift, and air between."""
    folder, shown = ideal
    x, y, z = seen_in_vehicle(folder, shown).T
    floor_m, base = 0.01 - 0.31, shown["frame"]["wheelbase_m"]
    half = max(shown["frame"]["rear_track_m"], shown["frame"]["front_track_m"]) / 2
    targets = sum(sum(used["points_on_target"].values()) for used in shown["used"]["scans"])
    assert np.sum(np.abs(z - floor_m) < 1e-9) > 0.1 * len(z)
    assert z.min() > floor_m - 1e-9
    for wall_m in (half + 3.65, -half - 3.65):
        assert np.sum(np.abs(y - wall_m) < 1e-9) > 100
    assert np.sum(np.abs(x + 3.9) < 1e-9) > 100
    between = (x > 0.45) & (x < base - 0.45) & (z > floor_m + 0.3) & (z < floor_m + 0.9)
    for side in (1, -1):
        door = y[between & (side * y > 0.5) & (side * y < 0.9)]
        level, count = np.unique(np.round(door, 9), return_counts=True)
        assert count.max() > targets / 2
        assert abs(side * level[count.argmax()] - half) < 0.2
        lift = (np.abs(x - base / 2) < 0.3) & (side * y > half + 0.4) & (side * y < half + 1.4)
        assert np.sum(lift & (z > floor_m + 1.6)) > 100
    roof = (np.abs(y) < 0.4) & (x > 0.2) & (x < base - 1.0) & (z > floor_m + 1.44)
    assert np.sum(roof & (z < floor_m + 1.48)) > 100
    air = (side * y > half + 0.2) & (np.abs(x) < 0.3) & (z > floor_m + 0.05) & (z < floor_m + 2)
    assert not np.any(air & (side * y < half + 0.4))


@pytest.mark.parametrize("seed", range(6))
def test_every_target_is_seen_from_the_stand_at_its_corner(tmp_path, seed):
    shown = make(tmp_path / "car", scanner=DEFAULT, seed=seed, points=60_000)
    frame = {k: np.array(v) for k, v in shown["frame"].items()}
    assert frame["up"][2] > np.cos(np.radians(4.5))
    for wheel, used in zip(shown["wheels"], shown["used"]["scans"], strict=False):
        sight = np.subtract(used["station_m"], wheel["centre_m"])
        assert 2.0 < np.linalg.norm(sight) < 4.0
        ahead = sight @ frame["forward"] * (1 if wheel["name"][0] == "F" else -1)
        aside = sight @ frame["left"] * (1 if wheel["name"][1] == "L" else -1)
        up = (used["station_m"] - frame["origin_m"]) @ frame["up"] - (0.01 - 0.31)
        assert 0.7 <= ahead <= 1.5
        assert 1.7 <= aside <= 2.6
        assert 1.2 <= up <= 1.7
        mine = used["points_on_target"]
        assert mine[wheel["name"]] > 3
        assert mine[wheel["name"]] == max(mine.values())


def test_vehicle_and_five_points_are_those_of_the_wheel_scans_of_the_seed(noisy, tmp_path):
    folder, shown = noisy
    coarse = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.02, "grid.half_width_m": 0.05})
    files = {"vehicle": SALOON, "scanner": coarse, "target": DISC}
    write_capture(tmp_path / "wheels", seed=5, trials=0, **files)
    other = json.loads((tmp_path / "wheels" / "truth.json").read_text())
    for one, two in zip(shown["wheels"], other["wheels"], strict=True):
        assert {key: one[key] for key in two} == two
        u, v, normal = (np.array(one[key]) for key in ("u", "v", "normal"))
        assert np.allclose(np.cross(u, v), normal, atol=1e-12)
    assert (shown["frame"], shown["vehicle"]) == (other["frame"], other["vehicle"])
    text = (tmp_path / "wheels" / "five-point.txt").read_bytes()
    assert (folder / "five-point.txt").read_bytes() == text


def test_same_seed_same_bytes_and_another_seed_others(noisy, tmp_path):
    folder, _ = noisy
    make(tmp_path / "again", scanner=DEFAULT, points=60_000)
    make(tmp_path / "other", scanner=DEFAULT, points=60_000, seed=6)
    names = ["five-point.txt", "truth.json", "vehicle.ply"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()
        assert (tmp_path / "other" / name).read_bytes() != (folder / name).read_bytes()


def test_an_e57_holds_the_same_points_in_the_scanners_own_coordinates(noisy, tmp_path):
    pye57 = pytest.importorskip("pye57")
    folder, shown = noisy
    for name in ("one", "two"):
        again = make(tmp_path / name, scanner=DEFAULT, points=60_000, form="e57")
    file = tmp_path / "one" / "vehicle.e57"
    assert file.read_bytes() == (tmp_path / "two" / "vehicle.e57").read_bytes()
    assert again["used"].pop("file") == "vehicle.e57"
    assert again["used"] == {k: v for k, v in shown["used"].items() if k != "file"}
    cloud = pye57.E57(str(file))
    assert cloud.scan_count == len(shown["used"]["scans"])
    for k, (away, intensity, used) in enumerate(by_station(folder, shown)):
        raw = cloud.read_scan_raw(k)
        own = np.column_stack([raw[f"cartesian{axis}"] for axis in "XYZ"])
        header = cloud.get_header(k)
        assert np.array_equal(header.translation, used["station_m"])
        turn = np.radians(used["turn_deg"])
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        assert header.rotation_matrix[:2, :2] == pytest.approx(R, abs=1e-14)
        # The PLY's coordinates are rounded at 20 m, these are not.
        assert np.abs(own[:, :2] @ R.T - away[:, :2]).max() < 1e-14
        assert np.abs(own[:, :2] - away[:, :2]).max() > 0.01
        assert np.array_equal(raw["intensity"].astype(np.float32), intensity)
    cloud.close()


def rows_of(scans):
    blocks = list(scans)
    whole = [np.concatenate([getattr(b, k) for b in blocks])
             for k in ("points_station_m", "intensity", "target")]  # fmt: skip
    return len(blocks), whole


@pytest.mark.parametrize("window_deg", [360.0, 90.0])
def test_points_do_not_depend_on_how_many_rows_are_made_at_a_time(tmp_path, window_deg):
    values = {"panorama.window_deg": window_deg, "beam.spot_radius_m": 0.02}
    values |= {"beam.correlated_sigma_m": 0.001, "beam.correlation_length_m": 0.05}
    site, kit = staged(changed(DEFAULT, tmp_path, values))
    station = site.stations[0]
    few, one = rows_of(scanned(site, station, kit.beam, 0.012, 9_000))
    many, other = rows_of(scanned(site, station, kit.beam, 0.012, 1))
    assert few < 10 < 100 < many
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a, b)


def test_what_is_held_in_memory_does_not_grow_with_the_cloud():
    """Ten times the points, the same peak; all rows at once would not keep that law."""
    site, kit = staged(IDEAL)
    peaks, counts = {}, {}
    fine_rad = 0.02 / np.sqrt(10.0)
    small = 3_000  # with a row on either side as many beams as 4,000 of the coarse grid
    for step_rad, block in ((0.02, 4_000), (fine_rad, small), (fine_rad, 10**9)):
        blocks = scanned(site, site.stations[1], kit.beam, step_rad, block)
        tracemalloc.start()
        counts[step_rad, block] = sum(len(block.intensity) for block in blocks)
        peaks[step_rad, block] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    coarse, fine, at_once = peaks.values()
    assert counts[fine_rad, small] > 9 * counts[0.02, 4_000]
    assert counts[fine_rad, small] == counts[fine_rad, 10**9]
    assert fine < 1.2 * coarse
    assert at_once > 2.0 * coarse


@pytest.mark.parametrize("closed", [True, False])
def test_rows_of_noise_have_variance_one_and_the_correlation_set(closed):
    length, rows, width = (3.0, 5.0), range(4), 40
    draws = []
    for seed in range(2000):

        def white(row: int, seed: int = seed) -> np.ndarray:
            rng = np.random.default_rng([seed, row + margin(length[0])])
            return rng.standard_normal(width + (0 if closed else 2 * margin(length[1])))

        draws.append(correlated_rows(white, rows, length, closed=closed))
    field = np.array(draws)
    assert field.shape == (2000, 4, width)
    for down, across in [(0, 0), (1, 0), (3, 0), (0, 4), (2, 6), (0, 39), (3, 37)]:
        round_m = min(across, width - across) if closed else across
        products = field[:, 3 - down, width - 1 - across] * field[:, 3, width - 1]
        wanted = np.exp(-0.5 * ((down / length[0]) ** 2 + (round_m / length[1]) ** 2))
        assert abs(products.mean() - wanted) < 4.5 * np.sqrt((1 + wanted**2) / len(field))
    low, high = chi_square_bounds(len(field))
    assert low < np.sum(field[:, 0, 0] ** 2) < high
    assert not low < np.sum((1.2 * field[:, 0, 0]) ** 2) < high


@pytest.mark.parametrize("length", [20.0, 60.0, 200.0])
def test_noise_that_is_alike_all_round_has_variance_one(length):
    rng, width = np.random.default_rng(0), 60
    field = correlated_rows(
        lambda _: rng.standard_normal(width), range(6000), (0.5, length), closed=True
    )
    means = np.mean(field**2, axis=1)  # rows are independent at 0.5 steps, to 2 %
    assert means.mean() == pytest.approx(1.0, abs=5 * means.std() / np.sqrt(len(means)))


def residuals(folder: Path, shown):
    """Of each target well seen from its corner: distances from its true plane along it, in metres,
    in the order of the beams, and the distance of the station."""
    by_scan = zip(shown["wheels"], by_station(folder, shown), strict=True)
    for wheel, (away, _, used) in by_scan:
        centre = np.subtract(wheel["centre_m"], used["station_m"])
        height = centre @ wheel["normal"]
        foot = away * (height / (away @ wheel["normal"]))[:, None]
        off = (away - foot) @ wheel["normal"]
        inside = np.linalg.norm(foot - centre, axis=1) < 0.9 * RADIUS_M
        yield off[inside & (np.abs(off) < 6 * 0.0008)], float(np.linalg.norm(centre))


QUIET = NARROW | {"beam.angle_sigma_urad": 0.0, "beam.stray_fraction": 0.0}
QUIET |= {"beam.spot_radius_m": 0.0, "beam.dropout_fraction": 0.0}


@pytest.mark.parametrize("alike_m", [0.0, 0.004])
def test_noise_across_the_plates_is_the_range_noise_as_set(tmp_path, alike_m):
    values = dict(QUIET)
    if alike_m:  # over half a step only: next to independent
        values |= {"beam.range_sigma_m": 0.0, "beam.correlated_sigma_m": 0.0008}
        values |= {"beam.correlation_length_m": alike_m}
    shown = make(tmp_path / "car", scanner=changed(DEFAULT, tmp_path, values))
    for off, _ in residuals(tmp_path / "car", shown):
        assert len(off) > 200
        low, high = chi_square_bounds(len(off))
        assert low < np.sum((off / 0.0008) ** 2) < high
        assert not low < np.sum((off / 0.0008 / 1.4) ** 2) < high


def test_noise_is_alike_over_the_length_set_where_the_target_is(tmp_path):
    """Neighbours d apart differ by 2 sigma^2 (1 - exp(-d^2 / (2 L^2))) in the mean square."""
    length_m, sigma_m = 0.02, 0.0008
    values = QUIET | {"beam.range_sigma_m": 0.0, "beam.correlated_sigma_m": sigma_m}
    values |= {"beam.correlation_length_m": length_m}
    shown = make(tmp_path / "car", scanner=changed(DEFAULT, tmp_path, values))
    for twice, fits in ((1.0, True), (2.0, False)):
        ratios = []
        used = shown["used"]["scans"]
        for (off, far_m), scan in zip(residuals(tmp_path / "car", shown), used, strict=True):
            apart_m = scan["step_rad"] * far_m
            wanted = 1.0 - np.exp(-0.5 * (apart_m / (twice * length_m)) ** 2)
            # Where one row ends and the next begins neighbours are farther apart: a tenth of them.
            found = np.sort(np.diff(off) ** 2)[: int(0.9 * len(off))].mean()
            ratios.append(found / (2 * sigma_m**2 * wanted))
        assert (0.4 < np.mean(ratios) < 1.1) == fits


def test_every_spot_that_straddles_a_step_is_averaged(tmp_path):
    """Against the average of all beams; spots here reach over several steps of the grid."""
    values = {"panorama.window_deg": 60.0, "panorama.lowest_deg": -20.0}
    values |= {"panorama.highest_deg": 0.0, "beam.spot_radius_m": 0.02}
    site, kit = staged(changed(IDEAL, tmp_path, values))
    station = site.stations[0]
    _, (points, _, _) = rows_of(scanned(site, station, kit.beam, 0.002, 30_000))
    grid = draw_lattice(site.panorama, site.middle_m(station), 0.002, (9, station.number))
    beams = directions(*np.meshgrid(grid.azimuth_rad, grid.elevation_rad)).reshape(-1, 3)
    scene, caster = site.scene(station), site.caster(station)
    wide_m = average(scene, caster, beams, of_spot(0.02), np.arange(len(beams))).range_m
    thin_m = trace(scene, caster, 0.0, beams).range_m
    wide_m, thin_m = wide_m[~np.isnan(wide_m)], thin_m[~np.isnan(wide_m)]
    range_m = np.linalg.norm(points, axis=1)
    assert len(range_m) == len(wide_m)
    # Elsewhere it is off by what spot.near_edges() says.
    pitch_m = 0.002 * np.nanmin(thin_m) * np.cos(np.radians(20.0))
    bound_m = 0.02**2 * BEND_M / (2 * pitch_m**2)
    assert np.abs(range_m - wide_m).max() < bound_m
    assert np.nanmean(np.abs(thin_m - wide_m) > 5 * bound_m) > 0.02


def test_drop_outs_are_as_many_as_set(tmp_path):
    counts = {}
    for share in (0.0, 0.2):
        site, kit = staged(changed(IDEAL, tmp_path, {"beam.dropout_fraction": share}))
        blocks = scanned(site, site.stations[2], kit.beam, 0.01, 50_000)
        counts[share] = sum(len(block.intensity) for block in blocks)
    low, high = stats.binom.ppf([1e-6, 1 - 1e-6], counts[0.0], 0.8)
    assert low < counts[0.2] < high


def test_mixed_pixels_hang_between_the_plate_and_what_is_behind(tmp_path):
    """With a spot, ranges between the face and the rim behind it; without one, none."""
    share = []
    for spot_m in (0.0, 0.008):
        values = NARROW | {"beam.spot_radius_m": spot_m}
        shown = make(tmp_path / f"{spot_m}", scanner=changed(IDEAL, tmp_path, values))
        points, _ = read_ply(tmp_path / f"{spot_m}" / "vehicle.ply")
        hanging = 0
        for wheel in shown["wheels"]:
            away = points - wheel["centre_m"]
            off = away @ wheel["normal"]
            radius = np.linalg.norm(away - np.outer(off, wheel["normal"]), axis=1)
            hanging += np.sum((off < -0.012) & (off > -0.035) & (abs(radius - 0.126) < 0.002))
        share.append(hanging)
    assert share[0] == 0
    assert share[1] > 5


def test_a_place_far_away_costs_no_more_than_the_rounding_of_its_numbers(tmp_path):
    far_m = 1e6
    place = {"placement.x_m": far_m, "placement.y_m": -far_m, "placement.z_m": far_m}
    vehicle = changed(SALOON, tmp_path, place)
    shown = make(tmp_path / "car", scanner=changed(IDEAL, tmp_path, NARROW), vehicle=vehicle)
    tolerance = 1e-12 + 3 * np.sqrt(3) * np.spacing(far_m + 10.0) / 2
    points, _ = read_ply(tmp_path / "car" / "vehicle.ply")
    for wheel, used in zip(shown["wheels"], shown["used"]["scans"], strict=True):
        away = points[slice(*used["rows"])] - wheel["centre_m"]
        near = np.linalg.norm(away, axis=1) < 0.9 * RADIUS_M
        off = np.abs(away[near] @ wheel["normal"])
        assert off[off < 0.01].max() < tolerance
        assert np.sum(off < tolerance) > 0.7 * used["points_on_target"][wheel["name"]]


def test_clamps_boards_and_more_stations_are_reported(tmp_path):
    target = changed(DISC, tmp_path, {"clamp_tilt_deg": 0.5, "clamp_shift": 0.002})
    values = NARROW | {"panorama.stations": 6}
    hidden = values | {"scene": {"occluded_fraction": 0.5}}
    counts = []
    for given in (values, hidden):
        scanner = changed(IDEAL, tmp_path, given)
        out = tmp_path / f"car-{len(counts)}"
        shown = make(out, scanner=scanner, target=target, points=120_000)
        scans = shown["used"]["scans"]
        assert len(scans) == 6
        assert sorted(shown["used"]["mounts"]) == sorted(WHEELS)
        counts.append([scans[k]["points_on_target"][w] for k, w in enumerate(WHEELS)])
    assert shown["used"]["mounts"]["RR"]["occluded_fraction"] == 0.5
    assert np.abs(shown["used"]["mounts"]["RR"]["clamp_tilt_deg"]).max() > 1e-3
    # Along a slanting grid a row of points at either edge of the shadow may come or go.
    assert np.array(counts[1]) / counts[0] == pytest.approx(0.5, abs=0.08)


def refused(match: str, out: Path, **changes: object) -> None:
    arguments = {"seed": 1, "vehicle": SALOON, "scanner": DEFAULT, "target": DISC} | changes
    with pytest.raises(SynthError, match=match) as caught:
        write_whole(out, **arguments)
    assert "\n" not in str(caught.value)
    assert not out.exists()


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"panorama.points": 5}, "'panorama.points' = 5"),
        ({"panorama.stations": 3}, "'panorama.stations' = 3"),
        ({"panorama.window_deg": 400.0}, "'panorama.window_deg' = 400.0"),
        ({"panorama.lowest_deg": -90.0}, "'panorama.lowest_deg' = -90.0"),
        (
            {"panorama.window": 90.0},
            "unknown key 'panorama.window' .nearest: 'panorama.window_deg'",
        ),
        ({"corner.aside_m": [0.1, 2.0]}, "'corner.aside_m' = 0.1"),
        ({"corner.aside_m": [2.5, 2.0]}, "'corner.aside_m' = .2.5, 2.0.: low is above high"),
    ],
)
def test_a_wrong_panorama_is_refused_in_one_line(tmp_path, values, match):
    refused(match, tmp_path / "out", scanner=changed(DEFAULT, tmp_path, values))


def test_wrong_options_are_refused_in_one_line(tmp_path):
    turning = SALOON.with_name("saloon-turning.toml")
    refused("--points 5: give a number from 10000", tmp_path / "o", points=5)
    refused("--seed -1: negative", tmp_path / "o", seed=-1)
    refused("form 'pcd': not known; give one of ply, e57", tmp_path / "o", form="pcd")
    refused("saloon-turning.toml: .sweep. and .runout.", tmp_path / "o", vehicle=turning)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "kept.txt").write_text("kept")
    with pytest.raises(SynthError, match="full: the folder is not empty"):
        write_whole(tmp_path / "full", seed=1, vehicle=SALOON, scanner=DEFAULT, target=DISC)
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


def test_a_missing_pye57_is_told_in_one_line_with_the_fix(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pye57", None)
    refused(r"vehicle.e57: pye57 does not load .*pip install 'wheelplane\[e57\]'",
            tmp_path / "o", form="e57")  # fmt: skip
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", ["ply", "e57"])
def test_nothing_half_written_stays(tmp_path, form):
    def stop(_: str) -> None:
        raise KeyboardInterrupt

    files = {"vehicle": SALOON, "scanner": DEFAULT, "target": DISC}
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "o", seed=1, points=20_000, form=form, progress=stop, **files)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["bay", "out of doors", "scan of one wheel"])
def test_left_wheels_stand_farther_above_the_floor_as_stated(tmp_path, place):
    recipe = read_recipe(changed(SALOON, tmp_path, {"body.left_rise_m": 0.02}), VehicleFile)
    rng = np.random.default_rng(3)
    car = draw_vehicle(recipe, rng)
    wheels = [draw_wheel(car, recipe, name, rng) for name in WHEELS]
    solids = {
        "bay": lambda: bay_solids(car, rng),
        "out of doors": lambda: ground_solids(car),
        "scan of one wheel": lambda: around(car, wheels[3]),
    }[place]()
    (floor,) = (solid for solid in solids if solid.material == "floor")
    a, b, c = np.moveaxis(floor.corners_m, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    top = int(np.argmax(normals[:, 2]))
    right, left = ((w.centre_vehicle_m - a[top]) @ normals[top] for w in wheels[:2])
    assert left - right == pytest.approx(0.02, abs=1e-5)
    assert (left + right) / 2 == pytest.approx(car.body.tyre_radius_m - 0.01, abs=1e-4)
