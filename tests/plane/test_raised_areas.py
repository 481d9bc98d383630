"""Areas of a face that are raised or sunk: labels and thin plates, found, noted, and within u."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.config import PlaneConfig
from wheelplane.plane import Patch, fit_plane
from wheelplane.plane.face_break import CLEARER, CLEARER_BY, Areas, _likely_areas, _likely_lines
from wheelplane.targets.plates import DiscTarget, RectangleTarget
from wheelplane_synth.scanner.noise import gaussian_field
from wheelplane_synth.scene.form import draw_form

from .test_break_by_definition import RADIUS_M, cells, solved

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
RECTANGLE = RectangleTarget(shape="rectangle", width=0.3, height=0.2, thickness=0.01)
SPACING_M = 0.002


def rectangle(middle, half, turn=0.0):
    """Share 1 within a rectangle, 0 outside."""
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return lambda uv: np.all(np.abs((uv - middle) @ along.T) < half, axis=1)


def disc(middle, radius):
    return lambda uv: np.hypot(*(uv - np.array(middle)).T) < radius


AREAS = {
    "100 x 120 mm from the middle on": (DISC, rectangle((0.05, 0.0), (0.05, 0.06))),
    "the same, turned": (DISC, rectangle((0.04, -0.03), (0.05, 0.06), 0.7)),
    "110 x 110 mm in a corner": (DISC, rectangle((0.055, 0.055), (0.055, 0.055))),
    "80 x 160 mm": (DISC, rectangle((0.05, 0.0), (0.04, 0.08))),
    "40 x 200 mm": (DISC, rectangle((0.05, 0.0), (0.02, 0.1))),
    "60 x 60 mm": (DISC, rectangle((0.06, 0.0), (0.03, 0.03))),
    "round, 90 mm": (DISC, disc((0.05, -0.02), 0.045)),
    "round, 140 mm": (DISC, disc((-0.04, 0.03), 0.07)),
    "100 x 120 mm on a rectangle": (RECTANGLE, rectangle((0.08, 0.0), (0.05, 0.06))),
    "80 x 60 mm at its corner": (RECTANGLE, rectangle((0.1, 0.06), (0.04, 0.03))),
    "round, 100 mm, on a rectangle": (RECTANGLE, disc((-0.06, 0.02), 0.05)),
}


def plane_of(target, height, seed, sigma_m=0.0004, grid=False):
    """Plane of a face w = height(uv) in noise of sigma_m, at random in a grid's cells, or on it."""
    rng = np.random.default_rng(seed)
    ticks = np.arange(-0.16, 0.16, SPACING_M) + rng.uniform(0.0, SPACING_M)
    uv = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    if not grid:
        uv = uv + rng.uniform(0.0, SPACING_M, uv.shape)
    points = np.column_stack([uv, height(uv) + rng.normal(0.0, sigma_m, len(uv))])
    points = points[target.region.holds(uv)]
    none = np.zeros((0, 3), np.float32)
    return fit_plane(Patch(np.zeros(3), points, none, 1.0, np.eye(3), 1e-3), target, PlaneConfig())


def tilt_by_u(plane):
    """Slopes of the plane, all of which is error, by their covariance with the face's form."""
    slopes = -plane.normal[:2] / plane.normal[2]
    parts = plane.point_covariance + plane.correlated.covariance + plane.correlated.form_covariance
    return float(np.sqrt(slopes @ np.linalg.solve(parts[1:, 1:], slopes)))


@pytest.mark.parametrize("name", AREAS)
def test_the_face_about_a_raised_area_lies_within_the_uncertainty(name):
    """By the noise of the points alone the plane would be 4 u off and more, with either sign."""
    target, inside = AREAS[name]
    found = []
    for seed, height_m in enumerate([2.5e-4, -2.5e-4, 4e-4, -4e-4]):
        plane = plane_of(target, lambda uv: height_m * inside(uv), seed)  # noqa: B023
        assert plane.broken is not None
        assert plane.broken.kind == "area"
        assert plane.broken.is_noted
        assert plane.broken.height_m == pytest.approx(height_m, rel=0.35)
        slopes = -plane.normal[:2] / plane.normal[2]
        by_noise = plane.noise_covariance[1:, 1:]
        assert np.sqrt(slopes @ np.linalg.solve(by_noise, slopes)) > 4.0
        found.append(tilt_by_u(plane))
    assert np.max(found) < 2.45  # 95 % of a normal vector of two
    assert np.sqrt(np.mean(np.square(found))) > 0.8  # nor is u too large: of one tilt or two


def test_u_is_as_large_as_the_tilt_by_the_area():
    """The slope by least squares over the disc, whatever the noise."""
    inside = AREAS["110 x 110 mm in a corner"][1]
    plane = plane_of(DISC, lambda uv: 3e-4 * inside(uv), 0, sigma_m=0.0002)
    ticks = np.arange(-0.125, 0.125, 0.0005)
    uv = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    uv = uv[DISC.region.shrunk(PlaneConfig().edge_margin_m).holds(uv)]
    terms = np.column_stack([np.ones(len(uv)), uv])
    slopes = np.linalg.lstsq(terms, 3e-4 * inside(uv))[0][1:]
    u = np.sqrt(np.trace(plane.correlated.form_covariance[1:, 1:]))
    assert u == pytest.approx(np.linalg.norm(slopes), rel=0.15)


@pytest.mark.parametrize("seed", range(4))
def test_an_area_on_the_grid_of_the_beams_is_found_as_well(seed):
    """There the noise along scan lines is tried besides."""
    inside = rectangle((0.03, 0.02), (0.05, 0.04), seed)
    plane = plane_of(DISC, lambda uv: 3e-4 * inside(uv), seed, grid=True)
    assert plane.broken is not None
    assert plane.broken.kind == "area"
    assert plane.broken.is_noted
    assert tilt_by_u(plane) < 2.45


def smooth(length_m, size_m, seed):
    """A height by a stationary field, on a fine lattice."""
    step = SPACING_M / 2.0
    count = round(0.34 / step)
    field = gaussian_field((count, count), (length_m / step,) * 2, np.random.default_rng(seed))

    def height(uv):
        row, column = np.clip(((uv + 0.17) / step).astype(int), 0, count - 1).T
        return size_m * field[row, column]

    return height


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("length_m", [0.01, 0.02, 0.03])
def test_correlated_noise_shows_no_area(length_m, seed):
    found = plane_of(DISC, smooth(length_m, 2e-4, seed), seed).broken
    assert found is None or found.kind != "area" or not found.is_noted


@pytest.mark.parametrize("seed", range(10))
def test_the_form_of_a_face_shows_no_area(seed):
    form = draw_form(0.125, 6e-4, np.random.default_rng(seed))
    found = plane_of(DISC, form.height_m, seed).broken
    assert found is None or found.kind != "area" or not found.is_noted


@pytest.mark.parametrize("seed", range(10))
def test_a_step_along_a_line_stays_one(seed):
    """It bounds an area as well, which explains it hardly better."""
    rng = np.random.default_rng(seed)
    across, at = rng.normal(size=2), rng.uniform(-0.05, 0.05)
    across /= np.linalg.norm(across)
    found = plane_of(DISC, lambda uv: 3e-4 * (uv @ across > at), seed).broken
    assert found is not None
    assert found.kind == "step"


def test_a_cell_has_the_share_of_it_that_lies_in_a_rectangle_along_the_cells():
    rng = np.random.default_rng(3)
    side, uv = 0.02, rng.uniform(-0.1, 0.1, (80, 2))
    middle, half = np.array([0.013, -0.027]), np.array([0.006, 0.05])
    ticks = side * ((np.arange(200) + 0.5) / 200 - 0.5)
    inside = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    for quarter in range(4):
        turn = quarter * np.pi / 2.0
        found = Areas(middle[None], half[None], np.array([turn]), side).columns(uv)[:, 0]
        sides = half[::-1] if quarter % 2 else half
        share = np.mean(np.all(np.abs(uv[:, None] + inside - middle) < sides, axis=2), axis=1)
        np.testing.assert_allclose(found, share, atol=2.1 / 200)


def test_areas_turn_with_the_face_and_one_of_them_is_that_alone():
    rng = np.random.default_rng(4)
    uv, turn = rng.uniform(-0.1, 0.1, (50, 2)), 0.9
    middles, halves = rng.uniform(-0.05, 0.05, (6, 2)), rng.uniform(0.02, 0.06, (6, 2))
    areas = Areas(middles, halves, rng.uniform(0.0, 3.0, 6), 0.02)
    way = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    turned = Areas(middles @ way, halves, areas.turns + turn, 0.02)
    expected = areas.columns(uv)
    assert expected.shape == (50, 6)
    np.testing.assert_allclose(turned.columns(uv @ way), expected, atol=1e-12)
    for index in range(6):
        np.testing.assert_allclose(
            areas.one(index).columns(uv)[:, 0], expected[:, index], atol=1e-15
        )


@pytest.mark.parametrize("seed", range(6))
def test_the_likeliest_area_explains_what_the_true_one_does(seed):
    """Nearly as much of the residuals, and the same tilt of the plane; a line explains less."""
    rng = np.random.default_rng(seed)
    true = Areas(
        RADIUS_M * rng.uniform(-0.4, 0.4, (1, 2)),
        RADIUS_M * rng.uniform(0.3, 0.6, (1, 2)),
        rng.uniform(0.0, np.pi, 1),
        2.0 * RADIUS_M / 12,
    )
    known = cells(seed=seed, height=lambda u, v: 3e-4 * true.columns(np.column_stack([u, v]))[:, 0])
    found, column = _likely_areas(known, RADIUS_M), true.columns(known.uv_m)
    with_true, left = solved(known, np.column_stack([known.slopes, column]))
    _, square = solved(known, known.slopes)
    gain = 0.5 * (square - left) / known.white_variance
    assert found.most > 0.9 * gain
    assert found.size[found.best] == pytest.approx(with_true[3], rel=0.1)
    plane, _ = solved(known, known.slopes)
    moved = plane[:3] - with_true[:3]
    scale = np.array([1.0, RADIUS_M, RADIUS_M])
    apart = scale * (found.by_shape[:, found.best] - moved)
    assert np.linalg.norm(apart) < 0.15 * np.linalg.norm(scale * moved)
    line = _likely_lines(known, RADIUS_M)
    assert found.most > max(CLEARER * line.most, line.most + CLEARER_BY)
