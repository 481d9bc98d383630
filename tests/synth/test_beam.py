"""The beam of the synthetic scanner: profile, power, returns and biases, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

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
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.parameters import ScannerFile, Surfaces, VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.scanner.echoes import Echoes
from wheelplane_synth.scanner.footprint import extent_m, spot_pattern
from wheelplane_synth.scanner.raycast import RayCaster
from wheelplane_synth.scanner.scanner import at_edges
from wheelplane_synth.scanner.spot_average import average
from wheelplane_synth.scanner.systematic import biased
from wheelplane_synth.scene.scene import Scene, build_scene
from wheelplane_synth.vehicle.vehicle import draw_vehicle, draw_wheel

NEAR_M, DEEP_M, W_M = 2.0, 0.05, 0.0015
BEAMS = 4000  # numbered on, so that their patterns are rotated


def half_planes(albedos=(0.8, 0.8), deep_m=DEEP_M, tilt_rad=0.0) -> Scene:
    """A plate's y < 0 at x = 2 m; y > 0 `deep_m` behind, which reaches under it; tilted about z."""
    quads = []
    for low, high, x in ((-1.0, 0.0, NEAR_M), (-0.5 if deep_m else 0.0, 1.0, NEAR_M + deep_m)):
        quads += [[x, low, -1.0], [x, high, -1.0], [x, high, 1.0], [x, low, 1.0]]
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    pivot = np.array([NEAR_M, 0.0, 0.0])
    corners = (np.array(quads) - pivot) @ turn.T + pivot
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    normals = np.tile(turn[:, 0], (4, 1))
    offsets = np.einsum("ij,ij->i", normals, corners[faces[:, 0]])
    number = np.array([0, 0, 1, 1])
    albedo = np.array(albedos)[number]
    return Scene(corners, faces, normals, offsets, number, albedo, number - 2, number == 0)


def swept(scene, beam, aside_m):
    """Mean and scatter of range, and of power, of beams whose axis passes the edge by `aside_m`."""
    aim = np.array([NEAR_M, aside_m, 0.0])
    aim /= np.linalg.norm(aim)
    echoes = average(scene, caster_of(scene), np.tile(aim, (BEAMS, 1)), beam, np.arange(BEAMS))
    power = echoes.reflectance * echoes.cosine
    return echoes.range_m.mean(), echoes.range_m.std(), power.mean()


def caster_of(scene):
    return RayCaster(scene.vertices_m, scene.faces)


def beyond(aside_m, w_m):
    """Share of a Gaussian beam's power at y > 0: its axis lies at `aside_m`."""
    return 0.5 * (1 + erf(np.sqrt(2) * aside_m / w_m))


@pytest.mark.parametrize("aside", [-1.0, -0.5, -0.2, 0.0, 0.3, 0.6, 1.2])
def test_mixed_pixels_of_a_gaussian_spot_follow_the_error_function(aside):
    """The mean to 0.1 % of the step, of which 0.02 % is cut off; each beam to 0.4 %."""
    gaussian = of_spot(W_M, spot_profile="gaussian")
    mean_m, scatter_m, _ = swept(half_planes(), gaussian, aside * W_M)
    expected_m = NEAR_M + DEEP_M * beyond(aside * W_M, W_M)
    assert mean_m == pytest.approx(expected_m, abs=0.001 * DEEP_M)
    assert scatter_m < 0.004 * DEEP_M
    uniform_m, _, _ = swept(half_planes(), of_spot(W_M), aside * W_M)
    if abs(aside) in (0.5, 0.6, 1.2):
        assert abs(uniform_m - expected_m) > 0.005 * DEEP_M


@pytest.mark.parametrize("aside", [-1.05, -0.99, -0.7, -0.2, 0.0, 0.4, 0.95])
def test_mixed_pixels_of_a_uniform_spot_follow_the_segment_of_a_disc(aside):
    """Each beam to 0.5 % of the step, of a spot that the edge only touches as well."""
    mean_m, scatter_m, _ = swept(half_planes(), of_spot(W_M), aside * W_M)
    inside = np.clip(aside, -1.0, 1.0)
    share = 0.5 + (inside * np.sqrt(1.0 - inside**2) + np.arcsin(inside)) / np.pi
    assert mean_m == pytest.approx(NEAR_M + DEEP_M * share, abs=0.001 * DEEP_M)
    assert scatter_m < 0.005 * DEEP_M


@pytest.mark.parametrize("aside", [-0.6, 0.0, 0.5])
def test_each_part_of_the_spot_counts_with_the_power_that_it_returns(aside):
    """Closed form of the range, (a f n + b g d) / (a f + b g), and of the power, a f + b g."""
    near, far = 0.8, 0.2
    beam = of_spot(W_M, spot_profile="gaussian", power_weighted=True)
    mean_m, _, power = swept(half_planes((near, far)), beam, aside * W_M)
    g = beyond(aside * W_M, W_M)
    depth_m = DEEP_M * far * g / (near * (1 - g) + far * g)
    assert mean_m == pytest.approx(NEAR_M + depth_m, abs=0.001 * DEEP_M)
    assert power == pytest.approx(near * (1 - g) + far * g, abs=0.001)
    alike_m, _, _ = swept(half_planes((near, far)), of_spot(W_M, spot_profile="gaussian"), 0.0)
    assert alike_m == pytest.approx(NEAR_M + DEEP_M / 2, abs=0.001 * DEEP_M)


@pytest.mark.parametrize("tilt_deg", [0.0, 60.0])
def test_incidence_stretches_the_spot_on_the_surface_and_dims_it(tilt_deg):
    """Over the step of a print, in the plane of incidence: w / cos on the surface, power * cos."""
    cos = np.cos(np.radians(tilt_deg))
    beam = of_spot(W_M, spot_profile="gaussian", power_weighted=True)
    scene = half_planes((0.8, 0.2), deep_m=0.0, tilt_rad=np.radians(tilt_deg))
    for along_m in (-0.001, 0.0005, 0.002):  # on the surface
        _, _, power = swept(scene, beam, along_m * cos)
        g = beyond(along_m, W_M / cos)
        assert power == pytest.approx(cos * (0.8 * (1 - g) + 0.2 * g), abs=0.001)


def test_the_spot_diverges_and_may_be_elliptic():
    values = {"spot_profile": "gaussian", "spot_divergence_mrad": 0.3}
    wide_m = W_M + 0.3e-3 * NEAR_M
    mean_m, _, _ = swept(half_planes(), of_spot(W_M, **values), 0.001)
    share = beyond(0.001, wide_m)
    assert mean_m == pytest.approx(NEAR_M + DEEP_M * share, abs=0.001 * DEEP_M)
    assert abs(share - beyond(0.001, W_M)) > 0.02
    turned = half_planes()  # its edge level: what was y is z
    swap = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    level = Scene(turned.vertices_m @ swap.T, turned.faces, turned.normals @ swap.T,
                  turned.offsets_m, turned.surface, turned.reflectance, turned.target,
                  turned.plate)  # fmt: skip
    aim = np.array([NEAR_M, 0.0, 0.001])
    aims = np.tile(aim / np.linalg.norm(aim), (BEAMS, 1))
    for aspect in (0.5, 2.0):
        beam = of_spot(W_M, spot_profile="gaussian", spot_aspect=aspect)
        mean_m = average(level, caster_of(level), aims, beam, np.arange(BEAMS)).range_m.mean()
        expected_m = NEAR_M + DEEP_M * beyond(0.001, aspect * W_M)
        assert mean_m == pytest.approx(expected_m, abs=0.001 * DEEP_M)
        assert extent_m(beam, 2.0) >= max(aspect, 1.0) * 1.4 * W_M


@pytest.mark.parametrize("truncation", [1.0, 2.0])
def test_gaussian_pattern_has_the_moments_of_the_cut_gaussian(truncation):
    """Second moment by quadrature of rho^3 exp(-2 rho^2)."""
    x, y = spot_pattern(of_spot(W_M, spot_profile="gaussian", spot_truncation=truncation)).T
    rho = (np.arange(20_000) + 0.5) / 20_000 * truncation
    density = rho * np.exp(-2 * rho**2)
    second = np.sum(density * rho**2 / 2) / np.sum(density)
    wanted = {(1, 0): 0, (0, 1): 0, (2, 0): second, (0, 2): second, (1, 1): 0}
    for (i, j), moment in wanted.items():
        assert np.mean(x**i * y**j) == pytest.approx(moment, abs=1e-8)
    # The outermost of 121 rays stands for the outermost 121st of the power; mean and second
    # moment were then set, by 1 %.
    lost = np.exp(-2 * truncation**2)
    inner = np.sqrt(-np.log(lost + (1 - lost) / 121) / 2)
    assert 0.98 * inner < np.hypot(x, y).max() < truncation


def scene_of(surfaces: Surfaces):
    rng = np.random.default_rng(3)
    recipe = read_recipe(SALOON, VehicleFile)
    car = draw_vehicle(recipe, rng)
    wheel = draw_wheel(car, recipe, "RL", rng)
    position = wheel.centre_vehicle_m + np.array([0.3, 2.4, 0.2])
    return build_scene(car, wheel, read_target(DISC), position, surfaces=surfaces)


def test_every_surface_has_the_albedo_that_the_scanner_file_states():
    built = scene_of(Surfaces())
    facets = {}
    for name in ("face", "wall", "rim", "tyre", "floor"):
        painted = scene_of(Surfaces(**{name: 0.123}))
        facets[name] = np.flatnonzero(painted.reflectance != built.reflectance)
        assert set(painted.reflectance[facets[name]]) == {0.123}
    assert all(len(one) for one in facets.values())
    assert len(np.unique(np.concatenate(list(facets.values())))) == sum(map(len, facets.values()))
    assert set(built.target[facets["face"]]) == {0}
    assert set(built.target[facets["wall"]]) == {-1}
    off_m = built.vertices_m[built.faces[facets["wall"]]] @ built.normals[facets["face"][0]]
    assert off_m.max() < built.offsets_m[facets["face"][0]] + 1e-9


def test_a_capture_states_its_surfaces_and_profile(tmp_path):
    coarse = {"grid.spacing_m": 0.006, "grid.half_width_m": 0.15}
    values = coarse | {"beam.spot_profile": "gaussian", "beam.power_weighted": True}
    values |= {"surfaces": {"rim": [0.3, 0.6], "wall": 0.4}}
    scanner = changed(DEFAULT, tmp_path, values)
    used = write_capture(
        tmp_path / "c", seed=1, vehicle=SALOON, scanner=scanner, target=DISC, trials=0
    ).used
    assert used["surfaces"]["wall"] == 0.4
    assert 0.3 < used["surfaces"]["rim"] < 0.6
    assert used["beam"]["spot_profile"] == "gaussian"


def test_a_wrong_profile_or_surface_is_named_in_one_line(tmp_path):
    values = {"beam.spot_profile": "square", "surfaces": {"tire": 0.1, "rim": 1.5}}
    with pytest.raises(SynthError) as error:
        read_recipe(changed(DEFAULT, tmp_path, values), ScannerFile)
    text = str(error.value)
    assert "\n" not in text
    assert "beam.spot_profile" in text
    assert "nearest: 'surfaces.tyre'" in text
    assert "surfaces.rim" in text


LEVEL = {"grid.spacing_m": 0.004, "grid.half_width_m": 0.15, "station.incidence_deg": 30.0}


def heights_m(tmp_path, values, target=DISC):
    """Return points of one scan on the face in its axes, without noise, and their range errors."""
    scanner = changed(IDEAL, tmp_path, LEVEL | values)
    files = {"vehicle": SALOON, "scanner": scanner, "target": target}
    truth = write_capture(tmp_path / "c", seed=4, trials=0, **files)
    wheel, used = truth.to_json()["wheels"][0], truth.used["scans"][0]
    points, intensity = read_ply(tmp_path / "c" / used["file"])
    off = points - wheel["centre_m"]
    sight = points - used["station_m"]
    cosine = -sight @ wheel["normal"] / np.linalg.norm(sight, axis=1)
    error_m = -(off @ wheel["normal"]) / cosine
    face = (np.abs(error_m) < 0.01) & (np.linalg.norm(off, axis=1) < 0.12)
    level = np.array(truth.wheels[0].T_vehicle_target[:3, :2])
    axes = truth.vehicle.T_site_vehicle[:3, :3] @ level
    return (off @ axes)[face], error_m[face], cosine[face], intensity[face]


def test_brightness_bias_moves_the_dark_half_by_exactly_b(tmp_path):
    turn = np.radians(30.0)
    values = {"surfaces": {"dark_part": "half", "dark": 0.1, "dark_turn_deg": 30.0}}
    uv, error_m, _, intensity = heights_m(tmp_path, values | {"beam.brightness_bias_m": 0.0003})
    dark = uv @ [np.cos(turn), np.sin(turn)] > 0
    assert 0.45 < dark.mean() < 0.55
    assert error_m[dark] == pytest.approx(0.0003, abs=1e-12)
    assert error_m[~dark] == pytest.approx(0.0, abs=1e-12)
    assert intensity[dark].max() < intensity[~dark].min() / 4


@pytest.mark.parametrize("power", [0.5, 1.0])
def test_dark_parts_have_more_noise_by_their_brightness(tmp_path, power):
    values = {"surfaces": {"dark_part": "half", "dark": 0.1}, "beam.noise_by_brightness": power}
    _, error_m, cosine, intensity = heights_m(tmp_path, values | {"beam.range_sigma_m": 0.0002})
    dark = intensity < 0.35 * intensity.max()
    for part, sigma_m in ((dark, 0.0002 * 8.0**power), (~dark, 0.0002)):
        low, high = chi_square_bounds(np.count_nonzero(part))
        assert low < np.sum((error_m * cosine)[part] ** 2) / sigma_m**2 < high


def test_dark_squares_lie_where_the_file_states(tmp_path):
    values = {"surfaces": {"dark_part": "squares", "dark": 0.45, "dark_pitch_m": 0.04}}
    uv, error_m, _, _ = heights_m(tmp_path, values | {"beam.brightness_bias_m": -0.001})
    dark = np.floor(uv / 0.04).sum(axis=1) % 2 == 0
    # The bias moves a point along its ray, by 0.5 mm * sin 30 deg on the face.
    inside = np.all(np.abs(uv / 0.04 - np.rint(uv / 0.04)) * 0.04 > 0.0003, axis=1)
    assert inside.mean() > 0.9
    assert error_m[inside] == pytest.approx(np.where(dark, -0.0005, 0.0)[inside], abs=1e-12)


def test_incidence_bias_is_b_times_secant_minus_one(tmp_path):
    _, error_m, cosine, _ = heights_m(tmp_path, {"beam.incidence_bias_m": 0.001})
    assert np.ptp(np.degrees(np.arccos(cosine))) > 3
    assert error_m == pytest.approx(0.001 * (1 / cosine - 1), abs=1e-12)
    steep = biased(echoes_of([2.0, np.nan], [0.05, 0.5]), of_spot(0.0, incidence_bias_m=0.001))
    assert steep.range_m == pytest.approx([2.009, np.nan], nan_ok=True)


def echoes_of(range_m, cosine) -> Echoes:
    none = np.zeros(len(range_m), dtype=np.int64)
    return Echoes(np.array(range_m), np.array(cosine), np.full(len(none), 0.8), none, none)


def test_a_printed_target_takes_no_dark_part(tmp_path):
    values = {"surfaces": {"dark_part": "half"}}
    with pytest.raises(SynthError, match="the target has a print of its own"):
        heights_m(tmp_path, values, CONFIGS / "targets" / "pattern-circles.toml")


MODES = {"spot_profile": "gaussian", "power_weighted": True, "range_gate_m": 0.02}


def one_return(mode, aside_m, scene, **more):
    """Ranges of beams past the edge: 2 m and 2.05 m, or between."""
    beam = of_spot(W_M, **(MODES | {"return_mode": mode} | more))
    aim = np.array([NEAR_M, aside_m, 0.0])
    aims = np.tile(aim / np.linalg.norm(aim), (BEAMS, 1))
    return average(scene, caster_of(scene), aims, beam, np.arange(BEAMS))


@pytest.mark.parametrize("ambiguity_m", [0.2, 0.6])
def test_phases_add_as_complex_numbers(ambiguity_m):
    """Two planes 50 mm apart, by the share of the farther one, which the mean range shows."""
    scene = half_planes((0.8, 0.4))
    at = {"range_gate_m": 0.0}
    mean_m = one_return("average", 0.1 * W_M, scene, **at).range_m
    phase_m = one_return("average", 0.1 * W_M, scene, ambiguity_m=ambiguity_m, **at).range_m
    near_m, far_m = (
        one_return(mode, 0.1 * W_M, scene).range_m.mean() for mode in ("first", "last")
    )
    share = (mean_m - near_m) / (far_m - near_m)
    assert 0.05 < share.min() < share.max() < 0.95
    turn = 2j * np.pi / ambiguity_m
    vector = 1.0 - share + share * np.exp(turn * (far_m - near_m))
    expected_m = near_m + np.angle(vector) / turn.imag
    np.testing.assert_allclose(phase_m, expected_m, atol=2e-5)
    assert np.abs(phase_m - mean_m).max() > 1e-4


@pytest.mark.parametrize(
    ("aside", "far_albedo"), [(-0.2, 0.8), (0.2, 0.8), (-0.2, 0.2), (0.2, 0.2)]
)
def test_returns_further_apart_than_the_gate_are_never_mixed(aside, far_albedo):
    """First and last are the near and the far plane; the strongest, the brighter part of both."""
    scene, g = half_planes((0.8, far_albedo)), beyond(aside, 1.0)
    stronger = 0.8 * (1 - g) < far_albedo * g
    for mode, is_far in (("first", False), ("last", True), ("strongest", stronger)):
        echoes = one_return(mode, aside * W_M, scene)
        wanted_m = NEAR_M + DEEP_M * is_far
        assert echoes.range_m == pytest.approx(wanted_m, abs=1e-5)
        share = far_albedo * g if is_far else 0.8 * (1 - g)
        power = (echoes.reflectance * echoes.cosine).mean()
        assert power == pytest.approx(share, abs=0.001)
    mixed_m = one_return("first", aside * W_M, scene, range_gate_m=0.06).range_m
    total = 0.8 * (1 - g) + far_albedo * g
    assert mixed_m.mean() == pytest.approx(NEAR_M + DEEP_M * far_albedo * g / total, abs=1e-4)


@pytest.mark.parametrize(("threshold", "far"), [(0, False), (0.05, False), (0.1, True), (1, None)])
def test_the_first_return_is_the_first_that_the_detector_sees(threshold, far):
    """With 42 % of the spot on the near plane: 0.8 * 0.42 / 2^2 = 0.084 of power, beyond 0.116."""
    g = beyond(0.1, 1.0)
    assert 0.8 * (1 - g) / 4 == pytest.approx(0.084, abs=0.001)
    echoes = one_return("first", 0.1 * W_M, half_planes(), detector_threshold=float(threshold))
    wanted_m = np.nan if far is None else NEAR_M + DEEP_M * far
    assert np.mean(np.isclose(echoes.range_m, wanted_m, atol=1e-5, equal_nan=True)) > 0.98


@pytest.mark.parametrize("albedos", [(0.8, 0.8), (0.3, 0.8), (0.1, 0.8)])
def test_the_strongest_return_is_the_one_of_the_higher_intensity(albedos):
    """Two metres behind, where a quarter of the power arrives."""
    scene, aside_m = half_planes(albedos, deep_m=NEAR_M), 0.1 * W_M
    found = {mode: one_return(mode, aside_m, scene) for mode in ("first", "last", "strongest")}
    of = {m: (e.reflectance * e.cosine / e.range_m**2).mean() for m, e in found.items()}
    higher = "first" if of["first"] > of["last"] else "last"
    assert found["strongest"].range_m.mean() == pytest.approx(found[higher].range_m.mean())
    assert (higher == "first") == (albedos[0] > 0.2)


def test_a_last_return_that_the_detector_misses_leaves_the_one_before():
    """58 % of the spot are 4 m off: 0.8 * 0.58 / 4^2 = 0.029 of power; the near 42 %: 0.084."""
    scene, least = half_planes(deep_m=NEAR_M), {"detector_threshold": 0.035}
    for mode in ("last", "strongest"):
        echoes = one_return(mode, 0.1 * W_M, scene, **least)
        assert np.mean(np.isclose(echoes.range_m, NEAR_M, atol=1e-5)) > 0.98
        power = echoes.reflectance * echoes.cosine / echoes.range_m**2
        assert power.min() >= least["detector_threshold"]


def test_a_surface_that_returns_less_than_the_threshold_is_not_there(tmp_path):
    """Albedos of 0.05 and 0.8 at 2 to 3 m: at most 0.0125 and at least 0.07 of power."""
    values = {"surfaces": {"dark_part": "half", "dark": 0.05}, "beam.detector_threshold": 0.02}
    uv, _, _, intensity = heights_m(tmp_path, values)
    assert intensity.min() >= 0.02
    assert uv[:, 0].max() < 0.0
    assert uv[:, 0].min() < -0.11


@pytest.mark.slow
def test_two_returns_are_the_points_of_the_first_and_of_the_last(tmp_path):
    """Beams that meet two surfaces give two points, all others one."""
    points = {}
    for mode in ("first", "last", "two"):
        beam = MODES | {"spot_radius_m": W_M, "return_mode": mode}
        values = {f"beam.{k}": v for k, v in beam.items()} | {"grid.spacing_m": 0.009}
        scanner = changed(IDEAL, tmp_path, values)
        files = {"vehicle": SALOON, "scanner": scanner, "target": DISC}
        write_capture(tmp_path / mode, seed=4, trials=0, **files)
        found, _ = read_ply(tmp_path / mode / "fr.ply")
        points[mode] = {row.tobytes() for row in found}
        assert len(points[mode]) == len(found)
    assert points["two"] == points["first"] | points["last"]
    assert 5 < len(points["first"] - points["last"]) < len(points["first"]) / 4


def test_two_returns_are_for_scans_of_single_wheels(tmp_path):
    beam = MODES | {"return_mode": "two"}
    scanner = changed(DEFAULT, tmp_path, {f"beam.{k}": v for k, v in beam.items()})
    with pytest.raises(SynthError, match="return_mode 'two' scans wheel by wheel"):
        write_whole(tmp_path / "w", seed=1, vehicle=SALOON, scanner=scanner, target=DISC)


@pytest.mark.slow
def test_edge_points_are_left_out_where_a_beam_beside_them_differs(tmp_path):
    """No two points of the filtered scan that are neighbours differ by more than the step."""
    step_m, points = 0.01, {}
    for limit_m in (0.0, step_m):
        scanner = changed(DEFAULT, tmp_path, {"beam.edge_filter_m": limit_m})
        files = {"vehicle": SALOON, "scanner": scanner, "target": DISC}
        write_capture(tmp_path / f"{limit_m}", seed=4, trials=0, **files)
        points[limit_m], _ = read_ply(tmp_path / f"{limit_m}" / "fr.ply")
    rows = {row.tobytes() for row in points[0.0]}
    assert {row.tobytes() for row in points[step_m]} < rows
    assert 0.5 * len(rows) < len(points[step_m]) < 0.98 * len(rows)


@pytest.mark.parametrize("missing", [False, True])
def test_edges_are_where_one_of_eight_beside_differs(missing):
    range_m = np.full((5, 6), 2.0)
    range_m[2, 3] = np.nan if missing else 2.02
    seen = at_edges(range_m, 0.01)
    wanted = np.zeros((5, 6), bool)
    wanted[1:4, 2:5] = not missing
    assert np.array_equal(seen, wanted)
    assert not at_edges(range_m, 0.03).any()


def test_edges_are_filtered_in_scans_of_single_wheels(tmp_path):
    scanner = changed(DEFAULT, tmp_path, {"beam.edge_filter_m": 0.01})
    with pytest.raises(SynthError, match="edge_filter_m filters scans of single wheels"):
        write_whole(tmp_path / "w", seed=1, vehicle=SALOON, scanner=scanner, target=DISC)


def test_a_return_mode_needs_its_gate(tmp_path):
    with pytest.raises(SynthError, match="return_mode 'last' needs a range_gate_m above 0"):
        read_recipe(changed(DEFAULT, tmp_path, {"beam.return_mode": "last"}), ScannerFile)
