"""Made targets of every shape: where their edges are, and what is printed on them."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.support.made import DEFAULT, DISC, IDEAL, SALOON, changed
from tests.support.paths import CONFIGS
from wheelplane.targets.registry import parse_target
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.parameters import Beam, Grid, ScannerFile, VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.scanner.scanner import draw_stand, scan
from wheelplane_synth.scene.pattern import DARK, LIGHT, pattern_on
from wheelplane_synth.scene.scene import build_scene
from wheelplane_synth.scene.target import Mount, draw_mount, target_solid
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

SIZES = {"spacing_m": 0.0015, "half_width_m": 0.26}
FINE = {f"grid.{key}": value for key, value in SIZES.items()}
THICK_M = 0.01
RING = {"shape": "ring", "diameter": 0.3, "hole_diameter": 0.12}
RECTANGLE = {"shape": "rectangle", "width": 0.36, "height": 0.2}
SQUARE = {"shape": "square", "side": 0.3, "hole_diameter": 0.06, "hole_spacing": 0.18}
BOARD = {"shape": "pattern", "width": 0.4, "height": 0.3, "pitch": 0.05}
CIRCLES = BOARD | {"kind": "circles", "rows": 3, "columns": 5, "circle_diameter": 0.03}
CHECKERS = BOARD | {"kind": "checkerboard", "rows": 4, "columns": 5}
MARKERS = BOARD | {"kind": "aruco", "rows": 2, "columns": 2, "pitch": 0.12, "marker_size": 0.09}
MARKERS |= {"dictionary": "DICT_4X4_50", "ids": [3, 17, 8, 40]}
ALL = [RING, RECTANGLE, SQUARE, CIRCLES, CHECKERS, MARKERS]


def target_file(folder: Path, table: dict[str, object], **more: object) -> Path:
    path = folder / f"target-{len(list(folder.iterdir()))}.toml"
    shown = {"thickness": THICK_M} | table | more
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in shown.items()))
    return path


def seen(folder: Path, target: Path, *, scanner: Path | None = None, seed: int = 3):
    """One wheel's scan in the axes u, v, n of its target, the scan, and the station there."""
    rng = np.random.default_rng(seed)
    recipe = read_recipe(SALOON, VehicleFile)
    device = read_recipe(scanner or changed(IDEAL, folder, FINE), ScannerFile)
    car = draw_vehicle(recipe, rng)
    wheel = draw_wheel(car, recipe, "RL", rng)
    stand = draw_stand(car, wheel, device, rng)
    plate = read_target(target)
    scene = build_scene(car, wheel, plate, stand.position_vehicle_m, Mount())
    R = car.T_site_vehicle[:3, :3]
    centre = R @ (wheel.centre_vehicle_m - stand.position_vehicle_m)
    grid, beam = device.draw("grid", Grid, rng), device.draw("beam", Beam, rng)
    found = scan(scene, centre, grid, beam, np.random.default_rng(0))
    axes = R @ wheel.T_vehicle_target[:3, :3]
    return (found.points_station_m - centre) @ axes, found, -centre @ axes


def inside(table: dict[str, object], uv: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
    """Which places are on the face, from the sizes alone."""
    u, v = uv.T
    if table["shape"] == "ring":
        radius = np.hypot(u, v)
        return (radius < 0.15 + margin_m) & (radius > 0.06 - margin_m)
    if table["shape"] == "square":
        free = np.maximum(abs(u), abs(v)) < 0.15 + margin_m
        return free & (np.hypot(abs(u) - 0.09, abs(v) - 0.09) > 0.03 - margin_m)
    half = np.array([table["width"], table["height"]]) / 2 + margin_m
    return (abs(u) < half[0]) & (abs(v) < half[1])


AREA_M2 = {
    "ring": np.pi * (0.15**2 - 0.06**2),
    "square": 0.3**2 - 4 * np.pi * 0.03**2,
    "rectangle": 0.36 * 0.2,
    "pattern": 0.4 * 0.3,
}


@pytest.mark.parametrize("table", ALL, ids=lambda t: t.get("kind", t["shape"]))
def test_the_face_is_exactly_its_plane_within_its_outline(tmp_path, table):
    points, found, station = seen(tmp_path, target_file(tmp_path, table))
    face = points[found.on_front]
    assert np.abs(face[:, 2]).max() < 5e-15
    assert inside(table, face[:, :2], 1e-6).all()
    # Whatever crosses the plane within the outline is on the face: nothing leaks through it.
    share = station[2] / (station[2] - points[:, 2])
    crossing = station[:2] + share[:, None] * (points[:, :2] - station[:2])
    through = inside(table, crossing, -1e-6) & (points[:, 2] < 0.5 * station[2])
    assert np.array_equal(through & ~found.on_front, np.zeros(len(points), dtype=bool))
    # The density there times the area of the shape is the count.
    middle = np.linalg.norm(station)
    cell = (SIZES["spacing_m"] / middle) ** 2 * middle**3 / station[2]
    assert len(face) * cell == pytest.approx(AREA_M2[table["shape"]], rel=0.05)


def test_the_walls_of_holes_go_through_the_plate(tmp_path):
    for table, middles, radius_m in (
        (RING, [(0.0, 0.0)], 0.06),
        (SQUARE, [(a, b) for a in (-0.09, 0.09) for b in (-0.09, 0.09)], 0.03),
    ):
        points, _, station = seen(tmp_path, target_file(tmp_path, table, thickness=0.03))
        for middle in middles:
            away = points[:, :2] - middle
            near = np.linalg.norm(away, axis=1)
            # The chord of the coarsest polygon lies radius * (1 - cos(pi / 360)) inside.
            wall = (abs(near - radius_m) < radius_m * 4e-5) & (points[:, 2] < -1e-5)
            wall &= points[:, 2] > -0.0299
            assert np.sum(wall) > 20
            # Only the side that faces the scanner is seen, and no deeper than the sight goes.
            lean = station[:2] - middle
            assert (away[wall] @ lean < radius_m**2).all()
            assert not np.any((near < radius_m - 1e-4) & (abs(points[:, 2]) < 1e-6))


DISC_SIZES = {"shape": "disc", "diameter": 0.25}
# What they take, of their square, and how far from the wall the middle of that lies.
OF_AREA = {"chamfer": 0.5, "edge_radius": 1.0 - np.pi / 4.0}
OF_SIZE = {"chamfer": 1.0 / 3.0, "edge_radius": 1.0 - 1.0 / (6.0 * (1.0 - np.pi / 4.0))}


@pytest.mark.parametrize("edge", [{"chamfer": 1e-5}, {"chamfer": 5e-4}, {"edge_radius": 1e-4},
                                  {"edge_radius": 1e-3}], ids=str)  # fmt: skip
@pytest.mark.parametrize("table", [DISC_SIZES, RING, RECTANGLE, SQUARE], ids=lambda t: t["shape"])
def test_an_eased_edge_takes_its_section_along_all_edges(tmp_path, table, edge):
    """By the divergence theorem, of a closed surface: no facet is lost, however small."""
    volumes = []
    for more in ({}, edge):
        corners = target_solid(read_target(target_file(tmp_path, table, **more))).corners_m
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        open_m2 = [math.fsum(column) for column in normals.T.tolist()]
        np.testing.assert_allclose(open_m2, 0.0, atol=1e-15)
        volumes.append(np.sum(corners[:, 0] * normals) / 6.0)
    ((key, size),) = edge.items()
    around = {"disc": 0.25 * np.pi, "ring": 0.42 * np.pi, "rectangle": 1.12, "square": 1.2}[
        table["shape"]
    ]
    if table["shape"] == "square":  # shorter along the sides, longer about the holes
        middle = OF_SIZE[key] * size
        around += -8.0 * middle + 4.0 * np.pi * (0.06 + 2.0 * middle)
    taken = around * OF_AREA[key] * size**2
    assert volumes[0] - volumes[1] == pytest.approx(taken, rel=0.012)  # of a round of 12 facets


def test_points_on_a_round_lie_on_it(tmp_path):
    round_m = 0.003
    device = changed(IDEAL, tmp_path, FINE | {"grid.spacing_m": 0.0005})
    table = DISC_SIZES | {"edge_radius": round_m}
    points, found, _ = seen(tmp_path, target_file(tmp_path, table), scanner=device)
    out = np.hypot(*points[:, :2].T) - (0.125 - round_m)
    on_round = (out > 1e-5) & (points[:, 2] < -1e-9) & (points[:, 2] > -round_m)
    assert np.count_nonzero(on_round) > 2000
    assert not found.on_front[on_round].any()
    off = np.hypot(out, points[:, 2] + round_m)[on_round] - round_m
    assert off.max() < 1e-6
    assert off.min() > -0.0025 * round_m  # chords of 7.5 degrees


def test_sides_lie_along_the_axes_named(tmp_path):
    points, found, _ = seen(tmp_path, target_file(tmp_path, RECTANGLE))
    reach = np.abs(points[found.on_front, :2]).max(axis=0)
    assert reach == pytest.approx([0.18, 0.1], abs=0.002)
    assert (reach < [0.18 + 1e-6, 0.1 + 1e-6]).all()


def test_u_points_right_and_v_up_as_seen_from_outside(tmp_path):
    for name in WHEELS:
        values = {"wheels.spin_deg": 0.0, "wheels.toe_deg": 0.0, "wheels.camber_deg": 0.0}
        recipe = read_recipe(changed(SALOON, tmp_path, values), VehicleFile)
        rng = np.random.default_rng(0)
        wheel = draw_wheel(draw_vehicle(recipe, rng), recipe, name, rng)
        u, v, outwards = wheel.T_vehicle_target[:3, :3].T
        assert v == pytest.approx([0, 0, 1], abs=1e-12)
        # Who looks at the car's left side has its front on the left.
        assert u[0] == pytest.approx(-1.0 if name[1] == "L" else 1.0)
        assert outwards[1] == pytest.approx(1.0 if name[1] == "L" else -1.0)


def reflectance(points, found, station, axes_normal=(0, 0, 1)):
    """Of the points on the face, from intensity, range and incidence."""
    away = points[found.on_front] - station
    far = np.linalg.norm(away, axis=1)
    cosine = np.abs(away @ axes_normal) / far
    return found.intensity[found.on_front] * far**2 / cosine


def circle_centres(turn_deg: float = 0.0, offset=(0.0, 0.0)) -> np.ndarray:
    """Three rows of five at 50 mm, from the upper left, drawn by hand."""
    places = [(x, y) for y in (0.05, 0.0, -0.05) for x in (-0.1, -0.05, 0.0, 0.05, 0.1)]
    return np.array(
        [
            (np.hypot(x, y) * np.cos(np.arctan2(y, x) + np.radians(turn_deg)) + offset[0],
             np.hypot(x, y) * np.sin(np.arctan2(y, x) + np.radians(turn_deg)) + offset[1])
            for x, y in places
        ]
    )  # fmt: skip


@pytest.mark.parametrize(("turn_deg", "offset"), [(0.0, (0.0, 0.0)), (25.0, (0.03, -0.02))])
def test_circles_are_dark_where_they_must_be(tmp_path, turn_deg, offset):
    path = target_file(tmp_path, CIRCLES, turn_deg=turn_deg, offset=list(offset))
    points, found, station = seen(tmp_path, path)
    seen_dark = reflectance(points, found, station)
    centres = circle_centres(turn_deg, offset)
    uv = points[found.on_front, None, :2]
    near = np.linalg.norm(uv - centres, axis=2).min(axis=1)
    clear = abs(near - 0.015) > 1e-9
    wanted = np.where(near < 0.015, 0.1, 0.8)
    assert seen_dark[clear] == pytest.approx(wanted[clear], rel=1e-6)
    assert 0.05 < np.mean(near < 0.015) < 0.2
    elsewhere = np.linalg.norm(uv - circle_centres(-turn_deg - 5.0, offset), axis=2).min(axis=1)
    assert np.any(abs(seen_dark - np.where(elsewhere < 0.015, 0.1, 0.8)) > 0.5)


def test_the_first_square_of_a_checkerboard_is_dark(tmp_path):
    points, found, station = seen(tmp_path, target_file(tmp_path, CHECKERS))
    got = reflectance(points, found, station)
    u, v = points[found.on_front, :2].T
    wanted = np.full(len(u), 0.8)
    for row in range(5):
        for column in range(6):
            left, top = -0.15 + 0.05 * column, 0.125 - 0.05 * row
            here = (u > left) & (u < left + 0.05) & (v < top) & (v > top - 0.05)
            wanted[here] = 0.1 if (row + column) % 2 == 0 else 0.8
    clear = np.all(abs((np.array([u + 0.15, v + 0.125]) / 0.05) % 1 - 0.5) < 0.5 - 1e-7, axis=0)
    assert got[clear] == pytest.approx(wanted[clear], rel=1e-6)
    upper_left = (u < -0.1) & (u > -0.15) & (v > 0.075) & (v < 0.125)
    assert np.median(got[upper_left]) == pytest.approx(0.1)


def test_another_library_finds_the_markers_where_they_must_be(tmp_path):
    cv2 = pytest.importorskip("cv2")
    scanner = changed(IDEAL, tmp_path, FINE | {"grid.spacing_m": 0.001})  # none of its pixels empty
    points, found, station = seen(tmp_path, target_file(tmp_path, MARKERS), scanner=scanner)
    got, uv = reflectance(points, found, station), points[found.on_front, :2]
    pixel_m = 0.002
    picture = np.full((150, 200), 200, dtype=np.uint8)
    column = ((uv[:, 0] + 0.2) / pixel_m).astype(int)
    row = ((0.15 - uv[:, 1]) / pixel_m).astype(int)
    picture[row, column] = (got * 250).astype(np.uint8)
    table = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    corners, ids, _ = cv2.aruco.ArucoDetector(table).detectMarkers(picture)
    found_ids = dict(zip(ids.ravel().tolist(), corners, strict=True))
    assert sorted(found_ids) == [3, 8, 17, 40]
    for number, (u, v) in zip((3, 17, 8, 40), [(-1, 1), (1, 1), (-1, -1), (1, -1)], strict=True):
        # Corners come from the upper left, clockwise.
        square = 0.06 * np.array([u, v]) + 0.045 * np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)])
        at = found_ids[number][0] * pixel_m - [0.2, 0.15]
        assert np.abs(at * [1, -1] - square).max() < 2 * pixel_m


def test_the_spot_averages_what_is_printed_and_leaves_the_ranges(tmp_path):
    """Across a straight edge at x from the middle of a spot of radius r, in units of r, the share
    1/2 + (x sqrt(1 - x^2) + asin x) / pi of a disc lies on one side."""
    spot_m = 0.004
    values = {"grid.spacing_m": 0.003, "grid.half_width_m": 0.26, "beam.spot_radius_m": spot_m}
    values |= {"station.incidence_deg": 3.0}
    scanner = changed(IDEAL, tmp_path, values)
    plain = {"shape": "rectangle", "width": 0.4, "height": 0.3}
    board, found, station = seen(tmp_path, target_file(tmp_path, CHECKERS), scanner=scanner)
    bare, other, _ = seen(tmp_path, target_file(tmp_path, plain), scanner=scanner)
    assert np.array_equal(found.on_front, other.on_front)
    assert np.abs(board[found.on_front] - bare[found.on_front]).max() < 1e-14
    got, (u, v) = reflectance(board, found, station), board[found.on_front, :2].T
    # The vertical edge between the two middle squares of the middle row: light on the left.
    edge = (abs(v) < 0.02) & (abs(u) < 2 * spot_m)
    x = np.clip(u[edge] / spot_m, -1, 1)
    dark = 0.5 + (x * np.sqrt(1 - x**2) + np.arcsin(x)) / np.pi
    wanted = np.where(np.median(got[edge & (u < -spot_m)]) > 0.5, dark, 1 - dark)
    # Nineteen sub-rays count in steps of a nineteenth; two of them may fall either way.
    assert np.abs(got[edge] - (0.8 - 0.7 * wanted)).max() < 0.7 * 2.5 / 19
    assert np.sum((got[edge] > 0.2) & (got[edge] < 0.7)) > 20


def test_prints_lie_off_as_set(tmp_path):
    target = read_target(target_file(tmp_path, CIRCLES, print_shift=0.0005))
    rng = np.random.default_rng(0)
    shifts = np.array([draw_mount(target, rng).print_shift_m for _ in range(400)])
    assert np.std(shifts) == pytest.approx(0.0005, rel=4 / np.sqrt(2 * shifts.size))
    shift = (0.002, -0.001)
    printed = pattern_on(target, "RR", shift)
    assert printed is not None
    centre = np.array([[0.002, -0.001], [0.002 + 0.0149, -0.001], [0.0152 + 0.002, -0.001]])
    assert list(printed.reflectance(centre)) == [DARK, DARK, LIGHT]


def test_truth_and_capture_tell_axes_ids_and_sizes(tmp_path):
    ids = {wheel: [4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3] for k, wheel in enumerate(WHEELS)}
    table = {key: value for key, value in MARKERS.items() if key != "ids"} | {"print_shift": 0.001}
    path = target_file(tmp_path, table | {"thickness": 0.008})
    lines = "".join(f"{wheel} = {json.dumps(own)}\n" for wheel, own in ids.items())
    path.write_text(path.read_text() + "[wheels]\n" + lines)
    coarse = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.01, "grid.half_width_m": 0.2})
    files = {"vehicle": SALOON, "scanner": coarse, "target": path}
    write_capture(tmp_path / "c", seed=2, trials=1, **files)
    shown = json.loads((tmp_path / "c" / "truth.json").read_text())
    for wheel in shown["wheels"]:
        assert wheel["ids"] == ids[wheel["wheel"]]
        axes = np.array([wheel["u"], wheel["v"], wheel["normal"]])
        assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-12
        assert np.linalg.det(axes) == pytest.approx(1.0)
    assert all("print_shift_m" in used for used in shown["used"]["scans"])
    table = tomllib.loads((tmp_path / "c" / "capture.toml").read_text())["target"]
    assert table == tomllib.loads(path.read_text())
    assert parse_target(table, "capture.toml") == parse_target(
        tomllib.loads(path.read_text()), "target"
    )


def test_a_disc_tells_nothing_more_than_before(tmp_path):
    coarse = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.02, "grid.half_width_m": 0.2})
    write_capture(tmp_path / "c", seed=2, vehicle=SALOON, scanner=coarse, target=DISC, trials=0)
    shown = json.loads((tmp_path / "c" / "truth.json").read_text())
    assert list(shown["wheels"][0]) == [
        "name", "role", "wheel", "toe_deg", "camber_deg", "camber_iso_deg", "centre_m", "normal"
    ]  # fmt: skip


def test_a_plate_as_made_is_scanned_on_its_wheel_alone_and_none_is_stated(tmp_path):
    coarse = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.005, "grid.half_width_m": 0.2})
    larger = changed(DISC, tmp_path, {"diameter": 0.27})
    files = {"seed": 2, "vehicle": SALOON, "scanner": coarse, "target": DISC, "trials": 0}
    plain = write_capture(tmp_path / "plain", **files)
    truth = write_capture(tmp_path / "made", made={"FL": larger}, **files)
    for used, other in zip(truth.used["scans"], plain.used["scans"], strict=True):
        scans = [(tmp_path / folder / used["file"]).read_bytes() for folder in ("plain", "made")]
        assert (scans[0] == scans[1]) == ("fl" not in used["file"])
        grown = used["points_on_target"] / other["points_on_target"]
        assert grown == pytest.approx(1.08**2 if "fl" in used["file"] else 1.0, abs=0.04)
    declared = [(tmp_path / folder / "capture.toml").read_text() for folder in ("plain", "made")]
    assert declared[0] == declared[1]


@pytest.mark.parametrize("table", [RING, RECTANGLE, SQUARE, CIRCLES], ids=lambda t: t["shape"])
def test_a_face_of_any_shape_fills_its_flatness(tmp_path, table):
    flatness_m, rng = 0.0005, np.random.default_rng(1)
    target = read_target(target_file(tmp_path, table, flatness=flatness_m))
    uv = rng.uniform(-0.2, 0.2, (40_000, 2))
    uv = uv[inside(table, uv)]
    for _ in range(40):
        height_m = draw_mount(target, rng).form.height_m(uv)
        assert 0.9 * flatness_m < np.ptp(height_m) < 1.01 * flatness_m
        assert np.abs(height_m).max() < 0.505 * flatness_m


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=[pytest.mark.slow] if path.stem == "wheel" else [])
        for path in sorted((CONFIGS / "targets").glob("*.toml"))
    ],
)
def test_every_known_target_can_be_made(tmp_path, name):
    coarse = changed(DEFAULT, tmp_path, {"grid.spacing_m": 0.01, "grid.half_width_m": 0.2})
    target = CONFIGS / "targets" / f"{name}.toml"
    files = {"vehicle": SALOON, "scanner": coarse, "target": target}
    truth = write_capture(tmp_path / "c", seed=2, trials=0, **files)
    shown = "points" if name == "wheel" else "points_on_target"  # nothing is mounted on a wheel
    assert all(used[shown] > 100 for used in truth.used["scans"])


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({"shape": "star"}, "'shape' = 'star'; known are disc, ring, rectangle, square, pattern"),
        ({"diameter": 0.3}, "key 'shape' is missing; known are disc"),
        (RING | {"hole_diameter": 0.3}, "hole_diameter 0.3 is not below the diameter"),
        (RING | {"hole_diametre": 0.1}, "unknown key 'hole_diametre' .nearest: 'hole_diameter'"),
        (RECTANGLE | {"width": -1.0}, "'width' = -1.0"),
        (SQUARE | {"hole_spacing": 0.25}, "the holes reach beyond the side"),
        (SQUARE | {"hole_spacing": 0.06}, "the holes touch each other"),
        (CIRCLES | {"diameter": 0.3}, "a board has a diameter, or a width and a height"),
        (CIRCLES | {"circle_diameter": 0.06}, "circle_diameter 0.06 is more than the pitch 0.05"),
        (CHECKERS | {"kind": "chess"}, "'kind' = 'chess'"),
        (BOARD | {"kind": "circles", "rows": 2, "columns": 2}, "needs a circle_diameter"),
        (MARKERS | {"ids": [1, 2]}, "RR has 2 markers for 2 rows of 2"),
        (MARKERS | {"ids": [1, 2, 3, 50]}, "DICT_4X4_50 has markers 0 to 49, not 50"),
        (MARKERS | {"dictionary": "DICT_NONE"}, "dictionary 'DICT_NONE': not known"),
    ],
)
def test_a_wrong_target_is_refused_in_one_line(tmp_path, table, match):
    path = target_file(tmp_path, table)
    with pytest.raises(SynthError, match=match) as caught:
        write_capture(tmp_path / "o", seed=1, vehicle=SALOON, scanner=DEFAULT, target=path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "o").exists()
