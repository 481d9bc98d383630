"""Missing returns that are written as points are dropped and counted; no surface ever is."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.support.scenes import WHEEL, Setup, make
from wheelplane.diagnostics.scan_summary import summarise_scan
from wheelplane.errors import InputError
from wheelplane.plane.find_planes import find_planes
from wheelplane.readers import read_scan
from wheelplane.readers.blocks import read_blocks
from wheelplane.readers.missing import Markers, find_markers, is_huge

SCAN = make(WHEEL.but(spacing_m=0.004), 1).points_m
LEVEL = Setup(turned=False, incidence_deg=5.0, half_width_m=0.2, spacing_m=0.004, pairs=4)


def mixed(extra, points=SCAN, seed=2):
    return np.random.default_rng(seed).permutation(np.vstack([points, extra]))


def on_plane(value, count=3000):
    """Some points of the scan with their third coordinate lost."""
    points = SCAN[:count].copy()
    points[:, 2] = value
    return points


MARKED = {
    "origin": np.zeros((3000, 3)),
    "few at the origin": np.zeros((40, 3)),
    "most at the origin": np.zeros((4 * len(SCAN), 3)),
    "-9999": np.full((3000, 3), -9999.0),
    "5": np.full((3000, 3), 5.0),
    "two places": np.repeat([[0.0, 0.0, 0.0], [-1.0, -1.0, -1.0]], [4000, 700], axis=0),
    "height -9999": on_plane(-9999.0),
    "end of the range": on_plane(SCAN[:, 2].max() + 0.5),
    "height within the scan": on_plane(float(np.median(SCAN[:, 2])) + 1e-7),
}


@pytest.mark.parametrize("step", [None, 1e-3])
@pytest.mark.parametrize("name", MARKED)
def test_all_of_them_and_nothing_else(tmp_path, name, step):
    points = mixed(MARKED[name])
    if step is not None:
        if name in ("end of the range", "height within the scan"):
            pytest.skip("a surface on one step of rounded coordinates looks alike")
        points = np.round(points / step) * step
    np.save(tmp_path / "a.npy", points)
    scan = read_scan(tmp_path / "a.npy")
    assert scan.invalid_points == len(MARKED[name])
    assert len(scan.points_m) == len(SCAN)
    survey = summarise_scan(tmp_path / "a.npy", "m")
    assert (survey.points, survey.invalid_points) == (len(SCAN), len(MARKED[name]))
    assert survey.low_m.tolist() == scan.points_m.min(axis=0).tolist()
    assert survey.high_m.tolist() == scan.points_m.max(axis=0).tolist()


@pytest.mark.parametrize("count", [20, 60, 120, 240, 300, 480, 600])
def test_measure_and_inspect_count_alike_however_few_of_many_are_missing(tmp_path, count):
    """Among 200,000 points; from some 0.2 per cent on, all are found."""
    points = np.random.default_rng(3).normal(size=(200_000, 3))
    points[np.random.default_rng(count).choice(len(points), count, replace=False)] = 0.0
    np.save(tmp_path / "a.npy", points)
    found = read_scan(tmp_path / "a.npy").invalid_points
    assert summarise_scan(tmp_path / "a.npy", "m").invalid_points == found
    assert sum(len(block.points_m) for block in read_blocks(tmp_path / "a.npy")) == (
        len(points) - found
    )
    assert found == count if count >= 0.0024 * len(points) else found in (0, count)


def walls(seed, count=8000):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 1.0, (3 * count, 3))
    for axis in range(3):
        points[axis * count : (axis + 1) * count, axis] = 0.5 * axis
    return points


def ball(seed, count=8000):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return 0.3 * points / np.linalg.norm(points, axis=1, keepdims=True) + [0.5, 0.5, 1.6]


SURFACES = {
    "a scan": SCAN,
    "its scan of 1 mm": np.round(SCAN, 3),
    "its scan of 10 mm": np.round(SCAN, 2),
    "exact walls": walls(1),
    "one exact wall": walls(1)[:8000],
    "exact wall and ball": np.vstack([ball(3), walls(2)[:8000]]),
    "one place": np.ones((500, 3)),
    "a line": np.outer(np.linspace(0.0, 1.0, 500), [1.0, 0.0, 0.0]),
    **{
        f"square to z, {noise:g} in steps of {step:g}": (
            np.round(make(LEVEL.but(noise_m=noise), 3).points_m / step) * step
        )
        for noise in (0.0, 1e-5, 1e-3)
        for step in (1e-4, 1e-3, 1e-2)
    },
}


@pytest.mark.parametrize("name", SURFACES)
def test_no_surface_is_taken_for_missing_returns(name):
    assert not find_markers(SURFACES[name])


def test_numbers_that_stand_for_none(tmp_path):
    values = np.array([1e30, -1e30, 1e10, 1e38, np.finfo(np.float32).max, -np.finfo(float).max])
    assert is_huge(values).all()
    assert is_huge(values[:4].astype(np.float32).astype(float)).all()
    assert not is_huge(np.array([1e9, 5e30, 1.0001e30, 0.0, 3.4e38])).any()
    points = SCAN.copy()
    points[::7, 2] = 1e30
    points[3] = np.finfo(np.float32).max
    np.save(tmp_path / "a.npy", points)
    for unit in ("m", "mm"):
        scan = read_scan(tmp_path / "a.npy", unit)
        assert scan.invalid_points == len(points[::7]) + 1
        assert summarise_scan(tmp_path / "a.npy", unit).invalid_points == scan.invalid_points
    points[5, 0] = 3.7e21
    np.save(tmp_path / "a.npy", points)
    with pytest.raises(InputError, match="beyond any site"):
        read_scan(tmp_path / "a.npy")


def test_those_of_a_posed_part_lie_at_its_station(tmp_path):
    """An E57 or PTX of scans whose reader lets 0 0 0 pass: here two PTS runs have no pose."""
    points = mixed(np.zeros((2000, 3)))
    lines = [f"{x:.17g} {y:.17g} {z:.17g} 5" for x, y, z in points.tolist()]
    text = "\n".join([str(len(lines)), *lines]) + "\n"
    (tmp_path / "a.pts").write_text(text * 2)
    scan = read_scan(tmp_path / "a.pts")
    assert scan.invalid_points == 4000
    assert [part.stop - part.start for part in scan.parts] == [len(SCAN)] * 2
    assert len(scan.points_m) == len(scan.intensity) == 2 * len(SCAN)


def test_corners_of_a_mesh_are_no_returns(tmp_path):
    """A fan of triangles has its apex as often as it has triangles."""
    turn = np.linspace(0.0, 2.0 * np.pi, 101)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(101)])
    apex = np.broadcast_to([0.0, 0.0, 1.0], (100, 3))
    corners = np.stack([apex, ring[:-1], ring[1:]], axis=1).reshape(-1, 3)
    assert find_markers(corners)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners.tolist()]
    (tmp_path / "a.obj").write_text("\n".join(lines) + "\n")
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in facet)
        + "endloop\nendfacet\n"
        for facet in corners.reshape(-1, 3, 3).tolist()
    )
    (tmp_path / "a.stl").write_text(f"solid fan\n{facets}endsolid fan\n")
    for name in ("a.obj", "a.stl"):
        assert read_scan(tmp_path / name).invalid_points == 0
        assert summarise_scan(tmp_path / name, "m").invalid_points == 0


def test_the_plane_that_they_would_make_is_not_listed(tmp_path):
    """A board of an organised cloud, a third of which is 0 0 0, and another third -1 -1 -1."""
    rng = np.random.default_rng(5)
    board = rng.uniform(-0.5, 0.5, (4000, 3)) * [1.0, 0.7, 0.0] + [0.0, 0.0, 1.1]
    board += rng.normal(0.0, 1e-3, board.shape)
    lost = np.repeat([[0.0, 0.0, 0.0], [-1.0, -1.0, -1.0]], [16000, 4000], axis=0)
    np.save(tmp_path / "a.npy", mixed(lost, board))
    (plane,) = find_planes(read_scan(tmp_path / "a.npy").points_m, 3)
    assert abs(plane.normal[2]) > 0.9999
    assert plane.points > 3900
    assert json.dumps(plane.extents_m)


def test_a_mark_is_one_place_or_one_value_of_an_axis():
    markers = Markers(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]), ((2, 7.0),))
    inside = [[1.0, 2.0, 3.0], [1.0 + 5e-7, 2.0, 3.0 - 5e-7], [0.0, 0.0, 0.0], [4.0, 5.0, 7.0]]
    outside = [[1.0, 2.0, 3.1], [1.0, 2.1, 3.0], [1.1, 2.0, 3.0], [-1.0, 2.0, 3.0]]
    outside += [[2.0, 1.0, 3.0], [7.0, 7.0, 6.0], [0.0, 0.0, 1e-5], [1.0, 2.0 + 2e-6, 3.0]]
    assert markers.mask(np.array(inside)).tolist() == [True] * len(inside)
    assert markers.mask(np.array(outside)).tolist() == [False] * len(outside)


FEW = np.random.default_rng(11).normal(size=(1500, 3))


@pytest.mark.parametrize("place", [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [-9999.0, 5.0, 0.0]])
@pytest.mark.parametrize("count", [9, 10, 11, 400])
def test_ten_points_at_one_place_are_missing(place, count):
    markers = find_markers(mixed(np.tile(place, (count, 1)), FEW))
    if count < 10:
        assert not markers
    else:
        np.testing.assert_allclose(markers.places_m, [place], rtol=0, atol=1e-6)
        assert markers.planes == ()


@pytest.mark.parametrize("lines", [2, 10])
def test_places_that_many_points_share_by_and_by_are_no_marks(lines):
    """A coarse surface: each place has fewer than four times the points of the next."""
    counts = [90, 60, 40, 25, 15, 10, 7, 5, 3, 2]
    grid = np.column_stack([np.arange(10) % lines, np.arange(10) // 2, FEW[:10, 2]])
    steps = np.repeat(grid, counts, axis=0)
    assert not find_markers(mixed(steps, FEW))
    assert not find_markers(mixed(steps - grid[0], FEW))  # the most of them at the origin
    one_more = np.vstack([np.tile([50.0, 50.0, 50.0], (400, 1)), steps])
    places = find_markers(mixed(one_more, FEW)).places_m
    np.testing.assert_allclose(places, [[50.0, 50.0, 50.0]], rtol=0, atol=1e-6)


def plane_of(value, count, axis=2, seed=12):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points[:, axis] = value
    return points


@pytest.mark.parametrize("axis", range(3))
def test_a_value_far_from_all_others_is_no_surface(axis):
    flat = plane_of(0.0, 100, axis)
    assert find_markers(mixed(plane_of(-9999.0, 500, axis, 13), flat)).planes == ((axis, -9999.0),)
    other = np.vstack([plane_of(0.0, 200, axis), plane_of(1.0, 5, axis)])
    assert not find_markers(mixed(plane_of(-9999.0, 500, axis, 13), other))
    assert not find_markers(mixed(plane_of(-9999.0, 12, axis), np.vstack([FEW, 1.0 + FEW])))
    assert find_markers(mixed(plane_of(-9999.0, 40, axis), np.vstack([FEW, 1.0 + FEW])))


def sphere(count, radius, seed=3):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.parametrize("size", [0.01, 0.1, 10.0])
def test_far_is_three_times_as_far_as_a_smooth_scene_reaches(size):
    """A sphere without noise spans 2 of its radii along each axis, 3.5 in all."""
    scene = sphere(1000, size)
    for distance, marked in ((15.0 * size, True), (8.0 * size, False)):
        extra = plane_of(distance, 300)
        extra[:, :2] *= size
        assert bool(find_markers(mixed(extra, scene))) == marked


def test_an_exact_plane_within_a_noisy_scene_is_a_mark_and_within_an_exact_one_a_surface():
    wide = np.random.default_rng(5).uniform(0.0, 1.0, (2000, 2))
    x, y = wide.T
    exact = np.column_stack([x, y, 0.3 * x + 0.1 * y + 0.5])
    noisy = exact + [0.0, 0.0, 1.0] * np.random.default_rng(6).normal(0.0, 1e-3, (2000, 1))
    level = plane_of(0.7, 600)
    level[:, :2] = np.random.default_rng(7).uniform(0.0, 1.0, (600, 2))
    assert find_markers(mixed(level, noisy)).planes == ((2, 0.7),)
    assert not find_markers(mixed(level, exact))
    away = np.array([1e5, 2e5, 0.0])  # where coordinates have fewer decimals
    assert not find_markers(mixed(level + away, exact + away))
    further = np.array([1e7, 2e7, -0.5])  # and one coordinate near 0
    assert not find_markers(mixed(level + further, exact + further))
    shift = np.ones(3)
    strip = np.where(x[:, None] < 0.1, exact, noisy)  # a tenth without noise
    assert find_markers(mixed(level + shift, strip + shift)).planes != ()


@pytest.mark.parametrize("others", [1, 3, 13, 14, 15, 20])
@pytest.mark.parametrize("marked", [10, 300])
def test_few_points_beside_those_of_one_value_are_read(others, marked):
    points = mixed(plane_of(0.5, marked), np.random.default_rng(others).normal(size=(others, 3)))
    markers = find_markers(points)
    assert markers.planes in ((), ((2, 0.5),))
    if others > 1 and len(points) <= 24:
        assert not markers
