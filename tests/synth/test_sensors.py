"""Triangulating sensors: a regular grid, clean edges, and the shadow of their partner."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.support.made import (
    DEFAULT,
    DISC,
    IDEAL,
    SALOON,
    changed,
    chi_square_bounds,
    of_spot,
    read_ply,
)
from tests.support.paths import CONFIGS
from tests.synth.test_beam import DEEP_M, NEAR_M, half_planes
from tests.synth.test_synth import staged
from wheelplane.config import Config, with_scanner
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.parameters import Grid, ScannerFile, Sensor
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.scanner.sensors import sense
from wheelplane_synth.scene.optics import Optics
from wheelplane_synth.scene.target import Mount, draw_mount

GRID = Grid(spacing_m=0.001, half_width_m=0.1)
COARSE = Grid(spacing_m=0.003, half_width_m=0.14)
CENTRE_M = np.array([NEAR_M, 0.0, 0.0])  # the image's x is -y, its y is z
KINDS = ["structured-light", "line-profile"]


def points_m(kind, baseline_m, turn_deg=0.0):
    sensor = Sensor(kind=kind, baseline_m=baseline_m, turn_deg=turn_deg)
    seen = sense(half_planes(), CENTRE_M, sensor, GRID, of_spot(0.0), np.random.default_rng(1))
    return seen.points_station_m


@pytest.mark.parametrize("kind", KINDS)
def test_points_lie_on_a_surface_or_are_not_there(kind):
    points = points_m(kind, 0.3)
    near = np.abs(points[:, 0] - NEAR_M) < 1e-12
    far = np.abs(points[:, 0] - NEAR_M - DEEP_M) < 1e-12
    assert np.all(near | far)
    assert near.sum() > 10_000
    assert far.sum() > 10_000
    assert points[near, 1].max() < 0 < points[far, 1].min()


@pytest.mark.parametrize("kind", KINDS)
def test_the_grid_is_regular_in_the_image(kind):
    """Spacing in the plane of the centre; a profile sensor's rows are parallel at any depth."""
    points = points_m(kind, 0.0)
    across = points[:, 1] * NEAR_M / points[:, 0]
    along = points[:, 2] * (NEAR_M / points[:, 0] if kind == "structured-light" else 1.0)
    for one in (across, along):
        steps = (one - one.min()) / GRID.spacing_m
        assert steps == pytest.approx(np.rint(steps), abs=1e-7)
        assert len(np.unique(np.rint(steps))) == 201
    assert len(points) == 201**2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("baseline_m", [0.2, 0.5])
def test_the_partner_s_shadow_is_baseline_times_depth_over_distance(kind, baseline_m):
    """The edge at y = 0 cuts the sight of y = -b to the far plane at y < b d / z."""
    for turn_deg, shadow_m in ((0.0, baseline_m * DEEP_M / NEAR_M), (180.0, 0.0)):
        points = points_m(kind, baseline_m, turn_deg)
        nearest_m = points[points[:, 0] > NEAR_M + DEEP_M / 2, 1].min()
        assert shadow_m < nearest_m + 1e-6
        assert nearest_m < shadow_m + 1.1 * GRID.spacing_m


def wall_scan(kind, grid=GRID, **values):
    """Points of a wall at 2 m, square to the sensor, with these errors of the beam, and with none.

    Grids (H, W, 3), rows along the image's x.
    """
    side, scans = 2 * int(grid.half_width_m / grid.spacing_m) + 1, []
    for beam in (of_spot(0.0, **values), of_spot(0.0)):
        sensor, rng = Sensor(kind=kind, baseline_m=0.0), np.random.default_rng(5)
        found = sense(half_planes(deep_m=0.0), CENTRE_M, sensor, grid, beam, rng)
        scans.append(found.points_station_m.reshape(side, side, 3))
    return scans


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("lines", "axis"), [("rows", 1), ("columns", 0)])
def test_such_a_sensor_s_lines_have_offsets_of_the_stated_deviation(kind, lines, axis):
    seen, true = wall_scan(kind, line_sigma_m=0.0002, scan_lines=lines)
    error_m = np.linalg.norm(seen - true, axis=2)  # without a sense
    assert np.ptp(error_m, axis=axis).max() < 1e-9
    offset = error_m.mean(axis=axis) / 0.0002
    low, high = chi_square_bounds(len(offset))
    assert low < np.sum(offset**2) < high


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("aspect", [1.0, 3.0])
def test_such_a_sensor_s_noise_is_alike_over_the_stated_lengths(kind, aspect):
    length_m, grid = 0.004, Grid(spacing_m=0.002, half_width_m=0.4)
    values = {"correlated_sigma_m": 0.0005, "correlation_length_m": length_m}
    seen, true = wall_scan(kind, grid, **values, correlation_aspect=aspect)
    field = (seen - true)[:, :, 0] / 0.0005  # across the wall
    independent = field.size * grid.spacing_m**2 / (np.pi * length_m**2 * aspect)
    for axis, own_m in ((0, length_m), (1, aspect * length_m)):
        one, other = (np.delete(field, cut, axis) for cut in ([0, 1], [-2, -1]))
        wanted = np.exp(-0.5 * (2 * grid.spacing_m / own_m) ** 2)
        assert np.mean(one * other) == pytest.approx(wanted, abs=5 / np.sqrt(independent))


@pytest.mark.parametrize("kind", KINDS)
def test_such_a_sensor_s_pixels_look_aside_by_the_stated_angle(kind):
    """The range of a wall 45 degrees aside changes by the distance times the angle."""
    angle_rad, scans = 2e-4, []
    scene = half_planes(deep_m=0.0, tilt_rad=np.pi / 4)
    aside = of_spot(0.0).model_copy(update={"angle_sigma_urad": 1e6 * angle_rad})
    for beam in (aside, of_spot(0.0)):
        sensor, rng = Sensor(kind=kind, baseline_m=0.0), np.random.default_rng(5)
        grid = Grid(spacing_m=0.0002, half_width_m=0.01)
        scans.append(sense(scene, CENTRE_M, sensor, grid, beam, rng).points_station_m)
    error_m = np.linalg.norm(scans[0], axis=1) - np.linalg.norm(scans[1], axis=1)
    low, high = chi_square_bounds(len(error_m))
    assert 0.97 * low < np.sum((error_m / (NEAR_M * angle_rad)) ** 2) < 1.03 * high


def test_such_a_sensor_s_software_may_filter_edges():
    """Beside the step of 50 mm no point is left, and elsewhere every one."""
    beams = of_spot(0.0, edge_filter_m=0.01), of_spot(0.0)
    sensor = Sensor(kind="structured-light", baseline_m=0.0)
    kept, every = (
        sense(half_planes(), CENTRE_M, sensor, GRID, beam, np.random.default_rng(1))
        for beam in beams
    )
    assert kept.beams == every.beams == 201**2
    assert len(every.points_station_m) - len(kept.points_station_m) == 2 * 201
    near = kept.points_station_m[:, 0] < NEAR_M + DEEP_M / 2
    assert kept.points_station_m[near, 1].max() < -0.5 * GRID.spacing_m


@pytest.mark.parametrize("kind", KINDS)
def test_such_a_sensor_sees_tyres_as_noisy_as_they_are_stated(kind):
    optics = Optics(*(np.full(4, x) for x in (3.0, 0.25, 0.0, 0.0)))
    scene = replace(half_planes(deep_m=0.0), optics=optics)
    beam = of_spot(0.0).model_copy(update={"range_sigma_m": 0.0005})
    sensor = Sensor(kind=kind, baseline_m=0.0)
    points = sense(scene, CENTRE_M, sensor, GRID, beam, np.random.default_rng(2)).points_station_m
    assert len(points) == pytest.approx(0.75 * 201**2, abs=5 * np.sqrt(201**2 * 0.25 * 0.75))
    assert np.std(points[:, 0]) == pytest.approx(0.0015, rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_a_face_of_any_form_is_lit_where_a_flat_one_is(kind, tmp_path):
    """Lowest parts of a form lie 0.5 mm behind the plane of the facets that cast shadows."""
    sensor, target = Sensor(kind=kind, baseline_m=0.25), read_target(DISC)
    waved = draw_mount(target.model_copy(update={"flatness": 0.001}), np.random.default_rng(4))
    counts = []
    for mount in (Mount(), waved):
        values = {"station.incidence_deg": 30.0, "station.distance_m": 1.0}
        scanner = changed(IDEAL, tmp_path, values)
        scene, centre_m, *_ = staged(scanner, mount=mount)
        seen = sense(scene, centre_m, sensor, COARSE, of_spot(0.0), np.random.default_rng(1))
        counts.append(seen.on_front.sum())
    assert counts[0] == counts[1] > 1000


@pytest.mark.parametrize("kind", KINDS)
def test_a_capture_of_such_a_sensor_shows_its_discs_to_the_edge(tmp_path, kind):
    values = {"sensor": {"kind": kind}, "beam.spot_radius_m": 0.0, "beam.range_sigma_m": 0.0}
    values |= {"beam.stray_fraction": 0.0, "grid.spacing_m": 0.002, "grid.half_width_m": 0.18}
    values |= {"beam.angle_sigma_urad": 0.0}
    scanner = changed(DEFAULT, tmp_path, values)
    files = {"vehicle": SALOON, "scanner": scanner, "target": DISC}
    write_capture(tmp_path / "c", seed=2, trials=0, **files)
    truth = json.loads((tmp_path / "c" / "truth.json").read_text())
    assert truth["used"]["sensor"] == {"kind": kind}
    for wheel, used in zip(truth["wheels"], truth["used"]["scans"], strict=True):
        off = read_ply(tmp_path / "c" / used["file"])[0] - wheel["centre_m"]
        height = off @ wheel["normal"]
        on_face = np.abs(height) < 1e-9
        radius = np.linalg.norm(off[on_face], axis=1)
        assert on_face.sum() == used["points_on_target"] > 5000
        assert 0.1235 < radius.max() < 0.125
        beside = (np.abs(height) > 1e-9) & (np.abs(height) < 0.005)
        assert np.linalg.norm(off[beside], axis=1).max(initial=0.1249) < 0.1256  # the wall


def test_what_such_a_sensor_has_not_is_refused(tmp_path):
    values = {"sensor": {"kind": "line-profile"}}
    with pytest.raises(SynthError, match=r"it has no spot; set beam\.spot_radius_m to 0"):
        read_recipe(changed(DEFAULT, tmp_path, values), ScannerFile)
    values |= {"beam.spot_radius_m": 0.0}
    turned = changed(DEFAULT, tmp_path, values | {"calibration": {"range_offset_m": 0.001}})
    with pytest.raises(SynthError, match=r"\[calibration\] is of laser scanners"):
        read_recipe(turned, ScannerFile)
    scanner = changed(DEFAULT, tmp_path, values)
    with pytest.raises(SynthError, match="scans wheel by wheel"):
        write_whole(tmp_path / "w", seed=1, vehicle=SALOON, scanner=scanner, target=DISC)


SHIPPED = ["phase-shift", "pulse", "structured-light", "line-profile"]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scanner_is_valid_for_scans_and_for_their_measurement(name):
    recipe = read_recipe(CONFIGS / "scanners" / f"{name}.toml", ScannerFile)
    stated = with_scanner(Config(), name).instrument
    assert stated.range_sigma_m == recipe.tree["beam"]["range_sigma_m"]
    assert recipe.tree.get("sensor", {}).get("kind", name) == name
