"""The laws that the made truth keeps, and the errors that the made scans have."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
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
from tests.support.paths import ROOT
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.parameters import Beam, Grid, ScannerFile, VehicleFile
from wheelplane_synth.parameters.plate_file import DiscFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.scanner.echoes import Echoes, trace
from wheelplane_synth.scanner.footprint import spot_pattern
from wheelplane_synth.scanner.noise import gaussian_field
from wheelplane_synth.scanner.raycast import RayCaster
from wheelplane_synth.scanner.scanner import directions, draw_stand, range_sigma_m, scan
from wheelplane_synth.scanner.spot import BEND_M, near_edges, spot_echoes
from wheelplane_synth.scanner.spot_average import average
from wheelplane_synth.scene.form import draw_form
from wheelplane_synth.scene.obstacle import draw_board
from wheelplane_synth.scene.scene import Scene, build_scene
from wheelplane_synth.scene.target import Mount, draw_mount
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

COARSE = {"grid.spacing_m": 0.004, "grid.half_width_m": 0.2}


def make(out: Path, *, scanner: Path, vehicle: Path = SALOON, seed: int = 7, trials: int = 2):
    return write_capture(
        out, seed=seed, vehicle=vehicle, scanner=scanner, target=DISC, trials=trials
    )


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noisy")
    scanner = changed(DEFAULT, folder, COARSE)
    make(folder / "capture", scanner=scanner)
    return folder / "capture", scanner


def staged(
    scanner: Path,
    *,
    seed: int = 3,
    vehicle: Path = SALOON,
    wheel: str = "RL",
    mount: Mount | None = None,
    hidden: float = 0.0,
):
    """One wheel before one scanner: what `scan` needs, and the truth in its coordinates."""
    rng = np.random.default_rng(seed)
    recipe, device = read_recipe(vehicle, VehicleFile), read_recipe(scanner, ScannerFile)
    car = draw_vehicle(recipe, rng)
    truth = draw_wheel(car, recipe, wheel, rng)
    stand = draw_stand(car, truth, device, rng)
    plate, place = read_target(DISC), stand.position_vehicle_m
    before = [draw_board(plate, truth.to_target(place), hidden, rng)] if hidden else []
    scene = build_scene(car, truth, plate, place, mount or Mount(), before)
    R = car.T_site_vehicle[:3, :3]
    centre = R @ (truth.centre_vehicle_m - stand.position_vehicle_m)
    normal = R @ truth.normal_vehicle
    return scene, centre, normal, device.draw("grid", Grid, rng), device.draw("beam", Beam, rng)


def site_truth(capture: Path):
    return json.loads((capture / "truth.json").read_text())


@pytest.mark.slow
def test_same_seed_same_bytes_and_another_seed_others(noisy, tmp_path):
    capture, scanner = noisy
    make(tmp_path / "again", scanner=scanner)
    make(tmp_path / "other", scanner=scanner, seed=8)
    names = sorted(p.name for p in capture.iterdir())
    assert names == sorted(p.name for p in (tmp_path / "again").iterdir())
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (capture / name).read_bytes()
    assert (tmp_path / "other" / "rr.ply").read_bytes() != (capture / "rr.ply").read_bytes()


# Of captures made before whole vehicles and other targets were, with spots of 500 rays at plates'
# edges since: scan, points, on the target, mean of the points from the station, of the intensities.
AS_BEFORE = [
    ("plain", "rr.ply", 10100, 2959, [2.003930979, 1.00052861, -0.565889332], 0.079412918),
    ("plain", "rl.ply", 9908, 2969, [-2.716790411, -0.907662296, -0.298940068], 0.053499787),
    ("plain", "fr.ply", 9893, 2731, [2.131929347, -0.001132229, -0.200635393], 0.086461832),
    ("plain", "fl.ply", 10091, 2892, [-2.838910416, -0.415841195, -0.60815152], 0.047685083),
    ("plain", "trial-1.ply", 10094, 2909, [2.083849326, 0.562997554, -0.558490066], 0.083594991),
    ("marred", "rr.ply", 9688, 2320, [2.590994416, 0.972752752, 0.124252043], 0.053975910),
    ("marred", "rl.ply", 9899, 2308, [-2.267414137, -1.183392459, -0.417894809], 0.060291171),
    ("marred", "fr.ply", 9911, 2136, [2.883795351, 0.028194633, -0.448065521], 0.042330298),
    ("marred", "fl.ply", 9911, 2320, [-2.023802607, -0.715568328, -0.175108437], 0.086307820),
    ("marred", "trial-1.ply", 9706, 2316, [2.4149004, 1.091785302, 0.059469742], 0.059066887),
]


@pytest.mark.parametrize("name", ["plain", "marred"])
def test_captures_of_wheels_stay_as_they_were(tmp_path, name):
    """Every draw, in its order, and every surface: else counts and means would be others."""
    values, plate = dict(COARSE), DISC
    if name == "marred":
        values |= {"beam.correlated_sigma_m": 0.0005, "beam.correlation_length_m": 0.01}
        values |= {"scene": {"occluded_fraction": 0.2}}
        marred = {"flatness": 0.0002, "clamp_tilt_deg": 0.1, "clamp_shift": 0.001}
        plate = changed(DISC, tmp_path, marred)
    files = {"vehicle": SALOON, "scanner": changed(DEFAULT, tmp_path, values), "target": plate}
    shown = write_capture(tmp_path / "c", seed=7, trials=1, **files).used["scans"]
    for used, before in zip(shown, [row[1:] for row in AS_BEFORE if row[0] == name], strict=True):
        points, intensity = read_ply(tmp_path / "c" / used["file"])
        assert (used["file"], len(points), used["points_on_target"]) == before[:3]
        assert (points - used["station_m"]).mean(axis=0) == pytest.approx(before[3], abs=1e-9)
        assert intensity.mean(dtype=float) == pytest.approx(before[4], rel=1e-6)


def test_trials_do_not_shift_the_draws_of_the_wheels(noisy, tmp_path):
    capture, scanner = noisy
    make(tmp_path / "none", scanner=scanner, trials=0)
    for wheel in WHEELS:
        name = f"{wheel.lower()}.ply"
        assert (tmp_path / "none" / name).read_bytes() == (capture / name).read_bytes()
    rows = (capture / "five-point.txt").read_text().splitlines()
    assert (tmp_path / "none" / "five-point.txt").read_text().splitlines() == rows[:20]
    assert len(rows) == 30


def test_capture_toml_names_every_scan(noisy):
    capture, _ = noisy
    shown = tomllib.loads((capture / "capture.toml").read_text())
    assert shown["length_unit"] == "m"
    assert shown["target"] == {"shape": "disc", "diameter": 0.25}
    assert shown["reference"] == {"RR": "rr.ply", "RL": "rl.ply", "FR": "fr.ply", "FL": "fl.ply"}
    assert shown["trial"] == [
        {"name": "1", "file": "trial-1.ply", "wheel": "RR"},
        {"name": "2", "file": "trial-2.ply", "wheel": "RL"},
    ]
    assert all((capture / t["file"]).is_file() for t in shown["trial"])


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize(("toe_deg", "camber_deg"), [(2.0, 5.0), (-2.0, 5.0), (3.0, -4.0)])
def test_front_edge_points_inwards_at_toe_in_and_the_top_outwards_at_camber(
    tmp_path, wheel, toe_deg, camber_deg
):
    values = {"wheels.toe_deg": toe_deg, "wheels.camber_deg": camber_deg}
    recipe = read_recipe(changed(SALOON, tmp_path, values), VehicleFile)
    rng = np.random.default_rng(0)
    made = draw_wheel(draw_vehicle(recipe, rng), recipe, wheel, rng)
    across = made.centre_vehicle_m * [0, 1, 0]
    outward = across / np.linalg.norm(across)
    # Points of the wheel's plane, read off its two in-plane axes: its level edge in front of the
    # centre, and its highest edge.
    u, v = made.T_vehicle_target[:3, 0], made.T_vehicle_target[:3, 1]
    level = u * v[2] - v * u[2]
    front = level / np.linalg.norm(level) * np.sign(level[0])
    top = u * u[2] + v * v[2]
    top /= np.linalg.norm(top)
    assert abs(front[2]) < 1e-15
    assert top[2] > 0.9
    assert np.degrees(np.arctan2(-front @ outward, front[0])) == pytest.approx(toe_deg, abs=1e-12)
    lean = np.degrees(np.arctan2(np.hypot(*top[:2]), top[2])) * np.sign(top @ outward)
    assert lean == pytest.approx(camber_deg, abs=1e-12)
    normal = made.normal_vehicle
    assert normal @ outward > 0.9
    assert np.allclose([normal @ u, normal @ v, normal @ normal], [0, 0, 1], atol=1e-15)


def test_truth_frame_is_that_of_the_four_centres(noisy):
    shown = site_truth(noisy[0])
    frame = {k: np.array(v) for k, v in shown["frame"].items()}
    axes = np.array([frame["forward"], frame["left"], frame["up"]])
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-15)
    at = {w["name"]: np.array(w["centre_m"]) for w in shown["wheels"]}
    rear, front = at["RL"] - at["RR"], at["FL"] - at["FR"]
    assert np.allclose((at["RL"] + at["RR"]) / 2, frame["origin_m"], atol=2e-14)
    assert np.allclose(rear, frame["rear_track_m"] * frame["left"], atol=2e-14)
    assert np.linalg.norm(front) == pytest.approx(float(frame["front_track_m"]), abs=2e-14)
    e = frame["origin_m"] + frame["wheelbase_m"] * frame["forward"]
    assert np.linalg.norm(np.cross(e - at["FR"], front)) / np.linalg.norm(front) < 2e-14
    assert np.linalg.norm(np.cross(front, rear)) > 1e-4
    drawn = shown["used"]["axles"]
    offset = ((at["FL"] + at["FR"]) / 2 - e) @ front / np.linalg.norm(front)
    assert offset == pytest.approx(drawn["front_offset_m"], abs=2e-14)
    # Left end up is a positive tilt, left end back a positive yaw.
    tilt = np.arcsin(front @ frame["up"] / np.linalg.norm(front))
    yaw = np.arctan2(-front @ frame["forward"], front @ frame["left"])
    assert np.degrees(tilt) == pytest.approx(drawn["front_tilt_deg"], abs=1e-12)
    assert np.degrees(yaw) == pytest.approx(drawn["front_yaw_deg"], abs=1e-12)


def test_truth_angles_are_those_of_the_site_normals(noisy):
    shown = site_truth(noisy[0])
    left, forward, up = (np.array(shown["frame"][k]) for k in ("left", "forward", "up"))
    for wheel in shown["wheels"]:
        normal = np.array(wheel["normal"])
        outward = left if wheel["wheel"][1] == "L" else -left
        level = normal - (normal @ up) * up
        toe = np.arcsin(level @ forward / np.linalg.norm(level))
        camber = np.arctan2(-normal @ up, np.linalg.norm(level))
        across = normal - (normal @ forward) * forward
        iso = np.arcsin(-across @ up / np.linalg.norm(across))
        assert normal @ outward > 0.9
        found = np.degrees([toe, camber, iso])
        wanted = [wheel["toe_deg"], wheel["camber_deg"], wheel["camber_iso_deg"]]
        assert np.allclose(found, wanted, atol=1e-12)
    toes = {w["name"]: w["toe_deg"] for w in shown["wheels"]}
    # Both rear wheels steered to the right by the same angle thrust to the right.
    assert shown["vehicle"]["thrust_angle_deg"] == (toes["RL"] - toes["RR"]) / 2
    assert shown["vehicle"]["rear_total_toe_deg"] == toes["RL"] + toes["RR"]
    assert shown["vehicle"]["front_total_toe_deg"] == toes["FL"] + toes["FR"]


def test_a_trial_is_its_wheel_a_little_shifted_with_angles_of_its_own(noisy):
    wheels = {w["name"]: w for w in site_truth(noisy[0])["wheels"]}
    for trial, reference in (("1", "RR"), ("2", "RL")):
        assert wheels[trial]["role"] == "trial"
        assert wheels[trial]["wheel"] == reference
        shift = np.subtract(wheels[trial]["centre_m"], wheels[reference]["centre_m"])
        assert 0 < np.linalg.norm(shift) < 0.003 * np.sqrt(3)
        turn = np.cross(wheels[trial]["normal"], wheels[reference]["normal"])
        assert np.linalg.norm(turn) > np.radians(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_stations_stand_where_the_file_allows(tmp_path, seed):
    values = COARSE | {"grid.half_width_m": 0.02}
    make(tmp_path / "c", scanner=changed(DEFAULT, tmp_path, values), seed=seed, trials=4)
    shown = site_truth(tmp_path / "c")
    up = np.array(shown["frame"]["up"])
    floor_m = 0.01 - 0.31
    for wheel, used in zip(shown["wheels"], shown["used"]["scans"], strict=True):
        sight = np.subtract(used["station_m"], wheel["centre_m"])
        distance_m = np.linalg.norm(sight)
        incidence = np.degrees(np.arccos(sight @ wheel["normal"] / distance_m))
        assert 2.0 <= distance_m <= 3.0
        assert 3.0 - 1e-9 <= incidence <= 25.0 + 1e-9
        assert incidence == pytest.approx(used["incidence_deg"], abs=1e-9)
        height_m = (used["station_m"] - np.array(shown["frame"]["origin_m"])) @ up - floor_m
        assert 0.2 <= height_m <= 1.9


@pytest.mark.parametrize("far_m", [0.0, 1e6])
def test_points_of_an_ideal_scan_lie_on_the_true_plane(tmp_path, far_m):
    place = {"placement.x_m": far_m, "placement.y_m": -far_m, "placement.z_m": far_m}
    values = COARSE | {"grid.half_width_m": 0.08}
    make(
        tmp_path / "c",
        scanner=changed(IDEAL, tmp_path, values),
        vehicle=changed(SALOON, tmp_path, place),
    )
    # Point, station and centre are each rounded to half a step of the floats at this place.
    step = np.spacing(far_m + 10.0)
    tolerance = 1e-12 + 3 * np.sqrt(3) * step / 2
    shown = site_truth(tmp_path / "c")
    for wheel, used in zip(shown["wheels"], shown["used"]["scans"], strict=True):
        points, _ = read_ply(tmp_path / "c" / used["file"])
        off_m = (points - wheel["centre_m"]) @ wheel["normal"]
        assert len(points) > 1500
        assert np.abs(off_m).max() < tolerance
        assert used["points_on_target"] == used["points"] == used["beams"]


def test_noise_free_face_is_flat_to_rounding_in_station_coordinates(tmp_path):
    scene, centre, normal, grid, beam = staged(changed(IDEAL, tmp_path, COARSE))
    seen = scan(scene, centre, grid, beam, np.random.default_rng(0))
    face = seen.points_station_m[seen.on_front] - centre
    assert np.abs(face @ normal).max() < 5e-15
    assert np.linalg.norm(face, axis=1).max() <= RADIUS_M
    others = seen.points_station_m[~seen.on_front] - centre
    assert np.abs(others @ normal).max() > 0.04


def test_spot_pattern_has_the_moments_of_a_disc():
    x, y = spot_pattern(of_spot(0.0015)).T
    wanted = {(1, 0): 0, (0, 1): 0, (2, 0): 1 / 4, (0, 2): 1 / 4, (1, 1): 0, (3, 0): 0, (2, 1): 0}
    for (i, j), moment in wanted.items():
        assert np.mean(x**i * y**j) == pytest.approx(moment, abs=1e-15)
    assert len(x) == 19
    assert 0.85 < np.hypot(x, y).max() <= 1.0


def test_away_from_edges_the_average_over_the_spot_is_its_centre():
    scene, centre, _, grid, beam = staged(DEFAULT)
    step, rows = grid.spacing_m / np.linalg.norm(centre), np.arange(-330, 331)
    azimuth = np.arctan2(centre[1], centre[0]) + rows * step
    elevation = np.arcsin(centre[2] / np.linalg.norm(centre)) + rows * step
    beams = directions(*np.meshgrid(azimuth, elevation))
    caster = RayCaster(scene.vertices_m, scene.faces)
    echoes = trace(scene, caster, 0.0, beams.reshape(-1, 3))
    edge = near_edges(scene, echoes, beams, float(step), beam).ravel()
    rng = np.random.default_rng(1)
    inner = rng.choice(np.flatnonzero(~edge), 10_000, replace=False)
    outer = rng.choice(np.flatnonzero(edge), 10_000, replace=False)

    def shift_m(chosen):
        mean = average(scene, caster, beams.reshape(-1, 3)[chosen], beam)
        return np.abs(mean.range_m - echoes.range_m[chosen])

    on_face = echoes.target[inner] >= 0
    assert on_face.sum() > 500
    assert shift_m(inner)[on_face].max() < 1e-14
    pitch_m = step * echoes.range_m[inner] * np.cos(elevation).min()
    bound_m = beam.spot_radius_m**2 * BEND_M / (2 * pitch_m**2)
    assert np.all(shift_m(inner) < bound_m)
    assert np.mean(shift_m(outer) > 0.0005) > 0.1


@pytest.mark.slow
def test_every_beam_whose_spot_straddles_a_step_is_averaged():
    scene, centre, _, grid, beam = staged(DEFAULT)
    step, rows = grid.spacing_m / np.linalg.norm(centre), np.arange(-160, 161)
    azimuth = np.arctan2(centre[1], centre[0]) + rows * step
    elevation = np.arcsin(centre[2] / np.linalg.norm(centre)) + rows * step
    beams = directions(*np.meshgrid(azimuth, elevation))
    caster = RayCaster(scene.vertices_m, scene.faces)
    flat = beams.reshape(-1, 3)
    centres = trace(scene, caster, 0.0, flat)
    thin_m = centres.range_m
    wide_m = average(scene, caster, flat, beam).range_m
    straddles = np.abs(wide_m - thin_m) > 0.0003
    edge = near_edges(scene, centres, beams, float(step), beam).ravel()
    assert straddles.sum() > 1000
    assert not np.any(straddles & ~edge)
    assert edge.mean() < 0.25
    found_m = spot_echoes(scene, caster, beams, float(step), beam).range_m
    assert np.array_equal(found_m[~edge], thin_m[~edge])
    assert np.mean(found_m[straddles] != thin_m[straddles]) > 0.97
    centre_m = spot_echoes(scene, caster, beams, float(step), of_spot(0.0)).range_m
    assert centre_m == pytest.approx(thin_m)


def test_half_a_spot_must_return():
    corners = np.array([[2.0, 0, -1], [2.0, 1, -1], [2.0, 1, 1], [2.0, 0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    both = np.zeros(2, dtype=np.int64)
    plane = np.tile([1.0, 0, 0], (2, 1))
    scene = Scene(corners, faces, plane, both + 2.0, both, both + 0.5, both - 1, both > 0)
    caster = RayCaster(corners, faces)
    sideways_m = np.array([-0.002, -0.0004, 0.0004, 0.002])
    beams = np.column_stack([np.full(4, 2.0), sideways_m, np.zeros(4)])
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    thin = trace(scene, caster, 0.0, beams)
    assert list(thin.facet >= 0) == [False, False, True, True]
    wide_m = average(scene, caster, beams, of_spot(0.0015)).range_m
    assert list(np.isnan(wide_m)) == list(np.isnan(thin.range_m)) == [True, True, False, False]
    assert wide_m[2:] == pytest.approx(2.0, abs=1e-5)


def rim_m(tmp_path, spot_radius_m: float) -> tuple[float, float]:
    """Radius of the outermost points within 2.4 mm of the plane: near side, far side."""
    values = {
        "beam.spot_radius_m": spot_radius_m,
        "station.incidence_deg": 20.0,
        "station.distance_m": 2.5,
        "grid.spacing_m": 0.0005,
        "grid.half_width_m": 0.14,
    }
    scene, centre, normal, grid, beam = staged(changed(IDEAL, tmp_path, values))
    points = scan(scene, centre, grid, beam, np.random.default_rng(0)).points_station_m - centre
    points = points[np.abs(points @ normal) < 0.0024]
    toward = -centre + (centre @ normal) * normal
    toward /= np.linalg.norm(toward)
    flat = points - np.outer(points @ normal, normal)
    radius = np.linalg.norm(flat, axis=1)
    along = flat @ toward / radius
    return radius[along > 0.995].max(), radius[along < -0.995].max()


@pytest.mark.slow
def test_spot_erodes_the_far_edge_and_not_the_near_one(tmp_path):
    near_m, far_m = rim_m(tmp_path, 0.0015)
    # What stands 60 mm behind the far edge takes a beam off when 2.4 mm / 60 mm of its spot fall
    # on it: at 0.77 to 0.89 of the spot's radius, which the slope lengthens by 1 / cos(20 deg). Its
    # point lies those 2.4 mm farther along the beam, and so outwards by their tan(20 deg).
    # One step of the grid, 0.5 mm, may lack at the outermost.
    outwards_m = 0.0024 * np.tan(np.radians(20.0))
    assert -0.89 * 0.0016 - 0.0005 < far_m - outwards_m - RADIUS_M < -0.77 * 0.0015
    assert abs(near_m - RADIUS_M) < 0.0004
    near_m, far_m = rim_m(tmp_path, 0.0)
    assert abs(far_m - RADIUS_M) < 0.0001
    assert abs(near_m - RADIUS_M) < 0.0001


CALM = {"beam.spot_radius_m": 0.0, "beam.dropout_fraction": 0.0, "beam.stray_fraction": 0.0}


def test_noise_across_the_plate_is_the_range_noise_as_set(tmp_path):
    values = CALM | {"beam.angle_sigma_urad": 0.0, "grid.half_width_m": 0.08}
    values |= {"grid.spacing_m": 0.001}
    scene, centre, normal, grid, beam = staged(changed(DEFAULT, tmp_path, values))
    seen = scan(scene, centre, grid, beam, np.random.default_rng(5))
    off = (seen.points_station_m - centre) @ normal / 0.0008
    low, high = chi_square_bounds(len(off))
    assert low < np.sum(off**2) < high
    assert not low < np.sum((off / 1.1) ** 2) < high
    none = np.zeros(3, dtype=np.int64)
    echoes = Echoes(np.full(3, 2.0), np.array([1.0, 0.5, 0.01]), np.full(3, 0.1), none, none)
    sigma_m = range_sigma_m(beam.range_sigma_m, echoes, beam)
    assert sigma_m == pytest.approx([8e-4, 16e-4, 40e-4])


@pytest.mark.parametrize("camber_deg", [0.0, -45.0])
def test_angular_jitter_lifts_points_by_range_times_sine_of_incidence(tmp_path, camber_deg):
    values = CALM | COARSE | {"beam.angle_sigma_urad": 200.0, "beam.range_sigma_m": 0.0}
    values |= {"grid.half_width_m": 0.08, "station.incidence_deg": 25.0}
    values |= {"grid.spacing_m": 0.002, "station.height_max_m": 4.0}
    vehicle = changed(SALOON, tmp_path, {"wheels.camber_deg": camber_deg})
    scanner = changed(DEFAULT, tmp_path, values)
    scene, centre, normal, grid, beam = staged(scanner, vehicle=vehicle)
    points = scan(scene, centre, grid, beam, np.random.default_rng(5)).points_station_m
    # Tilted by delta in the plane of incidence, a ray of range r leaves the plane by
    # r * sin(incidence) * delta to first order.
    sine_m = np.linalg.norm(np.cross(points, normal), axis=1)
    off = (points - centre) @ normal / (sine_m * 200e-6)
    low, high = chi_square_bounds(len(off))
    assert low < np.sum(off**2) < high


def test_drop_outs_and_strays_are_as_many_as_set(tmp_path):
    values = COARSE | {"beam.dropout_fraction": 0.05, "beam.stray_fraction": 0.02}
    values |= {"grid.half_width_m": 0.08, "beam.spot_radius_m": 0.0}
    scene, centre, normal, grid, beam = staged(changed(DEFAULT, tmp_path, values))
    seen = scan(scene, centre, grid, beam, np.random.default_rng(6))
    low, high = stats.binom.ppf([1e-6, 1 - 1e-6], seen.beams, 0.05)
    assert low < seen.beams - len(seen.points_station_m) < high
    low, high = stats.binom.ppf([1e-6, 1 - 1e-6], len(seen.on_front), 0.02)
    assert low < np.sum(~seen.on_front) < high
    off_m = np.abs((seen.points_station_m - centre) @ normal)
    assert off_m[seen.on_front].max() < 6 * 0.0008
    assert np.median(off_m[~seen.on_front]) > 0.1


def test_brighter_is_the_target_than_the_tyre(noisy):
    shown = site_truth(noisy[0])
    points, intensity = read_ply(noisy[0] / "rr.ply")
    wheel = shown["wheels"][0]
    flat = points - wheel["centre_m"]
    off = flat @ wheel["normal"]
    radius = np.linalg.norm(flat - np.outer(off, wheel["normal"]), axis=1)
    target = intensity[(np.abs(off) < 0.004) & (radius < 0.12)]
    assert np.median(target) > 1.2 * np.median(intensity[(radius > 0.2) & (off < -0.03)])


def test_five_points_of_a_faultless_total_station_are_a_pentagon_on_the_face(tmp_path):
    make(tmp_path / "c", scanner=changed(IDEAL, tmp_path, COARSE))
    rows = np.loadtxt(tmp_path / "c" / "five-point.txt", delimiter=",").reshape(-1, 5, 3)
    for five, wheel in zip(rows, site_truth(tmp_path / "c")["wheels"], strict=True):
        flat = five - wheel["centre_m"]
        assert np.abs(flat @ wheel["normal"]).max() < 1e-6
        assert np.linalg.norm(flat, axis=1) == pytest.approx(0.088, abs=1e-6)
        sides = np.linalg.norm(five - np.roll(five, 1, axis=0), axis=1)
        assert sides == pytest.approx(2 * 0.088 * np.sin(np.pi / 5), abs=2e-6)


@pytest.mark.slow
def test_five_points_err_along_the_line_of_sight_as_set(tmp_path):
    values = COARSE | {"grid.half_width_m": 0.02, "total_station.aiming_sigma_m": 0.0}
    scanner = changed(DEFAULT, tmp_path, values)
    off, sigma = [], []
    for seed in range(3):
        make(tmp_path / str(seed), scanner=scanner, seed=seed, trials=4)
        shown = site_truth(tmp_path / str(seed))
        station = np.array(shown["used"]["total_station"]["station_m"])
        rows = np.loadtxt(tmp_path / str(seed) / "five-point.txt", delimiter=",")
        for five, wheel in zip(rows.reshape(-1, 5, 3), shown["wheels"], strict=True):
            sight = five - station
            way = sight / np.linalg.norm(sight, axis=1, keepdims=True)
            along = np.abs(way @ wheel["normal"])
            off += list((five - wheel["centre_m"]) @ wheel["normal"])
            a_ppm_m = 0.0006 + 1e-6 * np.linalg.norm(sight, axis=1)
            arcsecond_m = np.radians(1 / 3600) * np.linalg.norm(sight, axis=1)
            sigma += list(np.hypot(along * a_ppm_m, np.sqrt(1 - along**2) * arcsecond_m))
    low, high = chi_square_bounds(len(off))
    assert low < np.sum((np.array(off) / sigma) ** 2) < high


@pytest.mark.parametrize("length", [(6.0, 3.5), (0.7, 20.0)])
def test_a_field_has_variance_one_and_the_correlation_set(length):
    rng = np.random.default_rng(1)
    draws = np.array([gaussian_field((40, 50), length, rng) for _ in range(2000)])
    for down, across in [(0, 0), (1, 0), (0, 1), (3, 2), (9, 0), (0, 12), (39, 0), (0, 49)]:
        products = draws[:, 39 - down, 49 - across] * draws[:, 39, 49]
        wanted = np.exp(-0.5 * ((down / length[0]) ** 2 + (across / length[1]) ** 2))
        # A mean of n products of unit normals of correlation c scatters by sqrt((1 + c^2) / n).
        assert abs(products.mean() - wanted) < 4.5 * np.sqrt((1 + wanted**2) / len(draws))
    low, high = chi_square_bounds(len(draws))
    corners = np.sum(draws[:, [0, 0, -1, -1], [0, -1, 0, -1]] ** 2, axis=0)
    assert np.all((low < corners) & (corners < high))
    assert not low < np.sum((1.2 * draws[:, 0, 0]) ** 2) < high


@pytest.mark.slow
def test_range_noise_is_alike_over_the_length_set(tmp_path):
    length_m, spacing_m, sigma_m = 0.01, 0.002, 0.0005
    values = CALM | {"beam.angle_sigma_urad": 0.0, "beam.range_sigma_m": 0.0}
    values |= {"grid.half_width_m": 0.07, "grid.spacing_m": spacing_m}
    values |= {"beam.correlated_sigma_m": sigma_m, "beam.correlation_length_m": length_m}
    values |= {"station.incidence_deg": 25.0, "station.height_max_m": 4.0}
    vehicle = changed(SALOON, tmp_path, {"wheels.camber_deg": -45.0})  # seen from steeply above
    pairs = [(1, 0), (0, 1), (3, 0), (0, 5), (4, 4), (0, 20)]
    products = {pair: [] for pair in [(0, 0), *pairs]}
    for seed in range(30):
        scanner = changed(DEFAULT, tmp_path, values)
        scene, centre, normal, grid, beam = staged(scanner, seed=seed % 3, vehicle=vehicle)
        seen = scan(scene, centre, grid, beam, np.random.default_rng(seed))
        columns = np.flatnonzero(np.diff(np.arctan2(*seen.points_station_m[:, 1::-1].T)) < 0)[0] + 1
        off = ((seen.points_station_m - centre) @ normal / sigma_m).reshape(-1, columns)
        level = np.cos(np.arcsin(centre[2] / np.linalg.norm(centre)))
        for (down, across), found in products.items():
            apart_m = spacing_m * np.hypot(down, across * level)
            a, b = off[: len(off) - down, : columns - across], off[down:, across:]
            found.append(np.mean(a * b) - np.exp(-0.5 * (apart_m / length_m) ** 2))
    for found in products.values():
        assert abs(np.mean(found)) < 4.5 * np.std(found) / np.sqrt(len(found))
        assert np.std(found) / np.sqrt(len(found)) < 0.04


FORM_TILT = 0.51  # rms tilt about either axis of the plane that fits a face best, of flatness/D


def test_a_form_fills_its_flatness_and_leans_as_said():
    rng = np.random.default_rng(0)
    turn, reach = rng.uniform(0, 2 * np.pi, 6000), RADIUS_M * np.sqrt(rng.uniform(0, 1, 6000))
    uv = np.column_stack([reach * np.cos(turn), reach * np.sin(turn)])
    fit = np.linalg.pinv(np.column_stack([np.ones(len(uv)), uv]))
    flatness_m, tilts = 5e-5, []
    for _ in range(600):
        height = draw_form(RADIUS_M, flatness_m, rng).height_m(uv)
        assert 0.96 * flatness_m < np.ptp(height) < 1.01 * flatness_m
        assert np.abs(height).max() < 0.505 * flatness_m
        tilts.append((fit @ height)[1:] * 2 * RADIUS_M / flatness_m)
    rms = np.sqrt(np.mean(np.square(tilts)))
    assert rms == pytest.approx(FORM_TILT, rel=4 / np.sqrt(2 * 2 * len(tilts)))


def test_points_lie_on_the_form_and_within_the_flatness(tmp_path):
    target = DiscFile(shape="disc", diameter=0.25, thickness=0.01, flatness=0.0005)
    mount = draw_mount(target, np.random.default_rng(4))
    assert mount.tilt_rad == mount.shift_m == (0.0, 0.0)
    values = COARSE | {"beam.spot_radius_m": 0.0015}
    scene, centre, normal, grid, beam = staged(changed(IDEAL, tmp_path, values), mount=mount)
    seen = scan(scene, centre, grid, beam, np.random.default_rng(0))
    face = seen.points_station_m[seen.on_front] - centre
    off = face @ normal
    assert 0.9 * 0.0005 < np.ptp(off) < 1.001 * 0.0005
    assert np.abs(off).max() < 0.5005 * 0.0005
    uv = face @ scene.targets[0].T_station_target[:3, :2]
    # Slopes reach 6 waves of the flatness over the shortest length; beams lean by up to 25 degrees.
    steepest = 6 * 0.0005 * 2 * np.pi / (0.6 * 0.25)
    assert np.abs(off - mount.form.height_m(uv)).max() < 0.5 * 0.0005 * steepest


def test_a_form_is_seen_as_it_is_at_any_incidence(tmp_path):
    """At 78 degrees 0.5 mm of height are 2.4 mm along the beam."""
    target = DiscFile(shape="disc", diameter=0.25, thickness=0.01, flatness=0.001)
    mount = draw_mount(target, np.random.default_rng(4))
    values = COARSE | {"station.incidence_deg": 78.0}
    values |= {"station.height_min_m": 0.05, "station.height_max_m": 4.0}
    scene, centre, normal, grid, beam = staged(changed(IDEAL, tmp_path, values), mount=mount)
    seen = scan(scene, centre, grid, beam, np.random.default_rng(0))
    face = seen.points_station_m[seen.on_front] - centre
    beams = seen.points_station_m[seen.on_front] @ scene.targets[0].T_station_target[:3, :3]
    off = face @ normal
    on_plane = face @ scene.targets[0].T_station_target[:3, :2]
    on_plane -= beams[:, :2] * (off / beams[:, 2])[:, None]
    assert off == pytest.approx(mount.form.height_m(on_plane), abs=1e-9)
    assert np.ptp(off) > 0.9 * 0.001


@pytest.mark.slow
def test_a_clamp_tilts_and_shifts_the_plate_and_not_the_truth(tmp_path):
    given = {"clamp_tilt_deg": 0.5, "clamp_shift": 0.002}
    values = COARSE | {"grid.half_width_m": 0.08}
    scanner, target = changed(IDEAL, tmp_path, values), changed(DISC, tmp_path, given)
    kit = {"seed": 5, "vehicle": SALOON, "scanner": scanner, "trials": 8}
    write_capture(tmp_path / "c", target=target, **kit)
    shown = site_truth(tmp_path / "c")
    assert shown["used"]["target"]["clamp_tilt_deg"] == 0.5
    capture = tomllib.loads((tmp_path / "c" / "capture.toml").read_text())
    assert capture["target"] == {"shape": "disc", "diameter": 0.25} | given
    normals, tilts, shifts = [], [], []
    for wheel, used in zip(shown["wheels"], shown["used"]["scans"], strict=True):
        points, _ = read_ply(tmp_path / "c" / used["file"])
        local = points - points.mean(axis=0)
        lean = np.linalg.svd(local, full_matrices=False)[2][2]
        sine = np.linalg.norm(np.cross(lean, wheel["normal"]))
        assert np.degrees(np.arcsin(sine)) == pytest.approx(
            np.hypot(*used["clamp_tilt_deg"]), abs=1e-9
        )
        normals.append(sine)
        tilts += used["clamp_tilt_deg"]
        shifts += used["clamp_shift_m"]
    assert np.min(normals) > 1e-4
    assert np.abs(tilts).max() > 0.1
    assert np.abs(shifts).max() > 0.0004


def test_clamps_scatter_as_set():
    given = {"clamp_tilt_deg": 0.5, "clamp_shift": 0.002}
    target = DiscFile(shape="disc", diameter=0.25, thickness=0.01, **given)
    rng = np.random.default_rng(0)
    mounts = [draw_mount(target, rng) for _ in range(300)]
    low, high = chi_square_bounds(2 * len(mounts))
    for drawn, sigma in (("tilt_rad", np.radians(0.5)), ("shift_m", 0.002)):
        total = np.sum(np.square([getattr(mount, drawn) for mount in mounts])) / sigma**2
        assert low < total < high
        assert not low < total * 1.3**2 < high


def test_a_shifted_plate_has_its_rim_where_it_was_clamped(tmp_path):
    values = {"grid.spacing_m": 0.001, "grid.half_width_m": 0.14}
    mount = Mount(shift_m=(0.004, -0.003))
    scene, centre, normal, grid, beam = staged(changed(IDEAL, tmp_path, values), mount=mount)
    seen = scan(scene, centre, grid, beam, np.random.default_rng(0))
    face = seen.points_station_m[seen.on_front] - centre
    middle = scene.targets[0].T_station_target[:3, 3] - centre
    assert np.linalg.norm(middle) == pytest.approx(0.005, abs=1e-12)
    assert abs(middle @ normal) < 1e-12
    assert np.linalg.norm(face - middle, axis=1).max() <= RADIUS_M
    assert np.linalg.norm(face, axis=1).max() > RADIUS_M + 0.004


@pytest.mark.parametrize("seed", range(4))
def test_a_board_before_the_target_hides_its_share(tmp_path, seed):
    values = {"grid.spacing_m": 0.002, "grid.half_width_m": 0.16}
    scanner = changed(IDEAL, tmp_path, values)
    counts = []
    for hidden in (0.0, 0.4):
        scene, centre, normal, grid, beam = staged(scanner, seed=seed, hidden=hidden)
        seen = scan(scene, centre, grid, beam, np.random.default_rng(0))
        counts.append(seen.on_front.sum())
        before = (seen.points_station_m - centre) @ normal > 0.1
        assert before.any() == (hidden > 0.0)
    # The board's own depth of 1 mm and one row of the grid may hide a little more.
    assert counts[1] / counts[0] == pytest.approx(0.6, abs=0.012)


def test_imperfections_are_written_with_the_capture_and_leave_the_wheels_alone(tmp_path):
    values = COARSE | {
        "beam.correlated_sigma_m": 0.0005,
        "beam.correlation_length_m": [0.005, 0.02],
    }
    plain = changed(DEFAULT, tmp_path, COARSE)
    marred = changed(DEFAULT, tmp_path, values | {"scene": {"occluded_fraction": [0.3, 0.4]}})
    flat = changed(DISC, tmp_path, {"flatness": 0.0001})
    make(tmp_path / "plain", scanner=plain, trials=0)
    write_capture(
        tmp_path / "marred", seed=7, vehicle=SALOON, scanner=marred, target=flat, trials=0
    )
    one, other = site_truth(tmp_path / "plain"), site_truth(tmp_path / "marred")
    assert one["wheels"] == other["wheels"]
    assert 0.005 <= other["used"]["beam"]["correlation_length_m"] <= 0.02
    assert "correlated_sigma_m" not in one["used"]["beam"]
    for before, after in zip(one["used"]["scans"], other["used"]["scans"], strict=True):
        assert 0.3 <= after["occluded_fraction"] <= 0.4
        assert after["points_on_target"] < 0.75 * before["points_on_target"]


def test_the_table_of_those_who_measure_is_left_unread(noisy, tmp_path):
    capture, scanner = noisy
    table = {"instrument": {"range_bias_m": 0.001, "kind": "laser-scanner", "pair": [2, 1]}}
    make(tmp_path / "again", scanner=changed(scanner, tmp_path, table))
    for path in capture.iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes()


def refused(*, match: str, out: Path, **changes: object) -> None:
    arguments = {"seed": 1, "vehicle": SALOON, "scanner": DEFAULT, "target": DISC} | changes
    with pytest.raises(SynthError, match=match) as caught:
        write_capture(out, **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"wheels.toe_dge": 1.0}, r"unknown key 'wheels.toe_dge' \(nearest: 'wheels.toe_deg'\)"),
        ({"axles.tyre_radius": 1.0}, r"unknown key 'axles.tyre_radius' \(nearest: '"),
        ({"axles.wheelbase_m": "long"}, r"'axles.wheelbase_m' = 'long'"),
        ({"axles.wheelbase_m": float("inf")}, r"'axles.wheelbase_m' = inf"),
        ({"axles.wheelbase_m": [2.0, 0.5]}, r"'axles.wheelbase_m' = \[2.0, 0.5\]: low is above"),
        ({"axles.wheelbase_m": [0.5, 2.0]}, r"'axles.wheelbase_m' = 0.5"),
        ({"axles.wheelbase_m": [2.0, 2.5, 3.0]}, r"'axles.wheelbase_m' = \[2.0, 2.5, 3.0\]"),
        ({"body.spokes": True}, r"'body.spokes' = True"),
        ({"wheels.stand_off_m": 0.005}, r"thickness 0.01 m: more than the stand-off"),
        ({"body.rim_diameter_m": 0.6}, r"rim_diameter_m 0.6: leaves less than"),
    ],
)
def test_a_wrong_vehicle_is_refused_in_one_line(tmp_path, values, match):
    given = changed(SALOON, tmp_path, values)
    text = given.read_text().replace("Infinity", "inf")
    given.write_text(text)
    refused(match=match, out=tmp_path / "out", vehicle=given)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("path", "values", "match"),
    [
        (DEFAULT, {"beam.correlated_sigma_m": 0.001}, "needs a correlation_length_m above 0"),
        (DEFAULT, {"beam.correlation_length": 0.01}, "nearest: 'beam.correlation_length_m'"),
        (DEFAULT, {"beam.correlated_sigma_m": [-0.1, 0.1]}, "'beam.correlated_sigma_m' = -0.1"),
        (DEFAULT, {"scene": {"occluded_fraction": 1.0}}, "'scene.occluded_fraction' = 1.0"),
        (DEFAULT, {"scene": {"hidden": 0.4}}, "nearest: 'scene.occluded_fraction'"),
        (DISC, {"flatness_m": 0.0001}, "unknown key 'flatness_m' .nearest: 'flatness'"),
        (DISC, {"flatness": 0.01}, "'flatness' = 0.01"),
        (DISC, {"clamp_tilt_deg": -1.0}, "'clamp_tilt_deg' = -1.0"),
    ],
)
def test_a_wrong_imperfection_is_refused_in_one_line(tmp_path, path, values, match):
    given = changed(path, tmp_path, values)
    refused(match=match, out=tmp_path / "o", **{"target" if path == DISC else "scanner": given})


def test_all_wrong_keys_are_named_at_once_with_the_file(tmp_path):
    given = changed(DEFAULT, tmp_path, {"beam.spot": 1, "grid.step_m": 1, "grid.spacing_m": -1.0})
    refused(match=f"{given}.*'grid.spacing_m'.*grid.step_m.*beam.spot", out=tmp_path / "o",
            scanner=given)  # fmt: skip


def test_unusable_files_and_options_are_refused_in_one_line(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "kept.txt").write_text("kept")
    (tmp_path / "broken.toml").write_text("axles = [")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    ring = changed(DISC, tmp_path, {"shape": "ring"})
    low = changed(DEFAULT, tmp_path, {"station.height_max_m": 0.2})
    out = tmp_path / "out"
    refused(match="full: the folder is not empty", out=tmp_path / "full")
    refused(match="a file of that name exists", out=ring)
    refused(match="kept.txt", out=tmp_path / "full" / "kept.txt" / "deeper")
    refused(match="--seed -1", out=out, seed=-1)
    refused(match="--trials -1", out=out, trials=-1)
    refused(match="absent.toml: No such file", out=out, vehicle=tmp_path / "absent.toml")
    refused(match="broken.toml: not valid TOML", out=out, vehicle=tmp_path / "broken.toml")
    refused(match="binary.toml: not UTF-8", out=out, scanner=tmp_path / "binary.toml")
    refused(match="key 'hole_diameter' is missing", out=out, target=ring)
    fine = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.0001})
    refused(match="grid: .* million beams", out=out, scanner=fine)
    refused(match="no position .* m from target RR", out=out, scanner=low)
    assert not out.exists()
    assert (tmp_path / "full" / "kept.txt").read_text() == "kept"


def test_nothing_half_written_stays(tmp_path):
    def stop(_: str) -> None:
        raise KeyboardInterrupt

    scanner = changed(DEFAULT, tmp_path, COARSE)
    before = set(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt):
        write_capture(
            tmp_path / "out", seed=1, vehicle=SALOON, scanner=scanner, target=DISC, progress=stop
        )
    assert set(tmp_path.iterdir()) == before


def test_the_folder_where_one_stands_is_no_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(match=r"^\.: no name of a folder to make; give one, such as capture", out=Path())


def test_an_empty_folder_is_taken_and_no_scratch_is_left(tmp_path):
    scanner = changed(DEFAULT, tmp_path, COARSE)
    out = tmp_path / "deep" / "out"
    out.mkdir(parents=True)
    make(out, scanner=scanner, trials=0)
    assert [p.name for p in out.parent.iterdir()] == ["out"]
    assert len(list(out.iterdir())) == 7


def test_a_missing_open3d_is_told_in_one_line_with_the_fix(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    refused(match="apt install libusb-1.0-0 libgl1 libegl1", out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_the_heavy_libraries_wait_until_they_are_needed():
    code = "import sys, wheelplane_synth.output.archive; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        cwd=ROOT,
    )  # fmt: skip
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"open3d", "trimesh", "scipy", "cv2", "libusb_package", "wheelplane"}
