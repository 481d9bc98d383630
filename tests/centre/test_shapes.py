"""Centres of rings, rectangles and squares: true, alike however they lie, and honest on their u."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from tests.support.plates import Found, fit, found, in_target, patch_of
from tests.support.printing import setup_of
from tests.support.scenes import Setup, Sheet, make, rotation
from wheelplane.centre import edge_centre
from wheelplane.centre.edge.beams import BEAM, INVERSE
from wheelplane.centre.edge.fit_edge import square_on
from wheelplane.centre.edge.stated_size import wider_by_ends_m
from wheelplane.config import CentreConfig, PlaneConfig
from wheelplane.errors import NotMeasuredError
from wheelplane.plane import fit_plane
from wheelplane.targets.plates import DiscTarget, RectangleTarget
from wheelplane.targets.registry import load_target
from wheelplane.vectors import turned

DISC, RING = load_target("disc-250"), load_target("ring-300")
RECTANGLE, SQUARE = load_target("rectangle-360x240"), load_target("square-300")
TARGETS = {"ring": RING, "rectangle": RECTANGLE, "square": SQUARE}
PLAIN = Setup(spacing_m=0.0022, half_width_m=0.24, pairs=12)


@functools.cache
def seen(name, seed, **changes):
    target = TARGETS.get(name, DISC)
    cloud = make(setup_of(target, PLAIN).but(**dict(changes)), seed)
    return cloud, found(cloud, target, seed)


def mean_of_face(cloud):
    return cloud.in_target(cloud.face_m).mean(axis=0)[:2]


VIEWS = {
    "plain": {},
    "head-on": {"incidence_deg": 0.0},
    "30 degrees": {"incidence_deg": 30.0},
    "wide spot": {"spot_m": 0.003},
    "tilted background": {"background_tilt_deg": 15.0},
    "strip before it": {"hidden": 0.25},
    "drop-outs": {"dropout": 0.3},
}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", TARGETS)
def test_centre_is_found_to_hundredths_of_a_millimetre(name, view):
    cloud, result = seen(name, 1, **VIEWS[view])
    assert np.linalg.norm(result.error_m) < 1.2e-4
    # 99.9 % of a normal error in the plane lies within 3.72 u.
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
    assert result.fitted.method == ("rim" if name == "rectangle" else "combined")
    if view == "strip before it":
        assert np.linalg.norm(mean_of_face(cloud)) > 3.72 * result.u_m  # the simple answer fails


@pytest.mark.parametrize("name", TARGETS)
def test_hidden_face_is_measured_too(name):
    errors = [np.linalg.norm(seen(name, seed, hidden=0.4)[1].error_m) for seed in range(4)]
    assert np.sqrt(np.mean(np.square(errors))) < 4e-4


@pytest.mark.parametrize("name", TARGETS)
def test_without_background_the_points_alone_serve_with_a_larger_uncertainty(name):
    _, result = seen(name, 2, background_m=None)
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
    assert 2e-4 < result.u_m < 6e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_without_mixed_pixels_the_gap_serves(name):
    """The outermost points would be 0.5 mm off: as far as backgrounds differ by side."""
    sharp = TARGETS[name].model_copy(update={"chamfer": 0.0})
    setup = setup_of(sharp, PLAIN).but(filtered=True)
    results = [found(make(setup, seed), sharp, seed) for seed in range(4)]
    for result in results:
        assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
        assert result.u_m < 6e-4
    assert np.median([np.linalg.norm(result.error_m) for result in results]) < 2e-4


@pytest.mark.parametrize("name", TARGETS)
def test_turned_shifted_permuted_mirrored(name):
    target = TARGETS[name]
    cloud = make(setup_of(target, PLAIN).but(shift_m=(0.0, 0.0, 0.0)), 3)
    here = found(cloud, target, 3)
    rng = np.random.default_rng(3)
    for move, shift in (
        (rotation(rng), 1e4),
        (np.diag([1.0, -1.0, 1.0]) @ rotation(rng), -100.0),
    ):
        t = shift * np.array([1.0, 0.7, -1.0])
        moved = replace(
            cloud,
            points_m=rng.permutation(cloud.points_m) @ move.T + t,
            R=move @ cloud.R * [1.0, np.linalg.det(move), 1.0],
            shift_m=t,
            centre_m=t,
        )
        rounding = 4 * np.finfo(float).eps * abs(shift)
        centre = fit(moved, target, 4).centre_m
        expected = move @ here.fitted.centre_m + t
        np.testing.assert_allclose(centre, expected, atol=0.5 * here.u_m + rounding)


def nees(name, seeds, **changes):
    return np.array([seen(name, seed, **changes)[1].nees for seed in seeds])


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_stated_uncertainty_of_the_centre_is_what_the_errors_are(name):
    count = 16
    total = nees(name, range(count), spacing_m=0.0035, noise_m=0.0015).sum()
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * count)
    assert low < total < high
    assert total * 4**2 > high  # a quarter of the uncertainty would not do


def arc(degrees):
    """Keeps the beams within an angle about the centre, along no axis."""
    half = np.radians(degrees / 2)

    def keep(u, v):
        turn = np.arctan2(v, u) - 0.4
        return np.abs(np.arctan2(np.sin(turn), np.cos(turn))) < half

    return keep


ARCS = {degrees: arc(degrees) for degrees in (360, 270, 180, 120)}


@pytest.mark.parametrize("seed", range(8))
def test_independent_noise_on_a_ring_is_not_taken_for_correlated(seed):
    """The grid of beams is seen beside its hole: the points about that lie on no patch of it."""
    cloud = make(setup_of(RING, PLAIN), seed)
    plane = fit_plane(patch_of(cloud, RING, seed), RING, PlaneConfig())
    assert not plane.correlated.covariance.any()


@pytest.mark.slow
@pytest.mark.parametrize("background", [0.08, None], ids=["background", "none behind"])
@pytest.mark.parametrize("name", ["disc", "ring", "rectangle"])
def test_partial_arc_gives_a_larger_uncertainty_and_no_wrong_centre(name, background):
    rms, u = {}, {}
    for degrees, keep in ARCS.items():
        results = [seen(name, s, keep=keep, background_m=background)[1] for s in range(3)]
        total = sum(result.nees for result in results)
        assert total < stats.chi2.ppf(0.9999, 2 * len(results)), degrees
        rms[degrees] = np.sqrt(np.mean([r.error_m @ r.error_m for r in results]))
        u[degrees] = np.mean([result.u_m for result in results])
    assert u[120] > u[180] > 0.99 * u[270] > 0.9 * u[360]
    assert u[120] > 1.02 * u[360]
    mean = np.linalg.norm(mean_of_face(seen(name, 0, keep=ARCS[120], background_m=background)[0]))
    assert mean > 0.03 > 10 * rms[120]


def edges_by_scipy(cloud, target):
    """Centre of a rectangle by least squares on the points of its face nearest to each edge.

    Every edge in cells of 8 mm; the outermost point of each, without those near the corners.
    """
    uv = cloud.in_target(cloud.face_m)[:, :2]
    half = np.array([target.width, target.height]) / 2
    rows = []
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            beyond = sign * uv[:, axis] - half[axis]
            along = uv[:, 1 - axis]
            for cell in np.arange(-half[1 - axis] + 0.012, half[1 - axis] - 0.02, 0.008):
                mine = (along >= cell) & (along < cell + 0.008) & (np.abs(beyond) < 0.01)
                if mine.any():
                    best = np.flatnonzero(mine)[np.argmax(beyond[mine])]
                    rows.append((axis, sign, *uv[best]))
    axis, sign, u, v = np.array(rows).T

    def off(p):
        c, s = np.cos(p[2]), np.sin(p[2])
        a, b = c * (u - p[0]) + s * (v - p[1]), c * (v - p[1]) - s * (u - p[0])
        return np.where(axis == 0, sign * a - half[0], sign * b - half[1]) - p[3]

    return optimize.least_squares(off, np.zeros(4), loss="soft_l1", f_scale=1e-3).x[:2]


@pytest.mark.parametrize("seed", range(3))
def test_rectangle_agrees_with_plain_least_squares_on_its_edges(seed):
    """The reference takes the points that lie on the face for certain, so that no edge is mixed."""
    cloud, result = seen("rectangle", seed, background_m=None, filtered=True)
    assert result.fitted.method == "outline"
    reference = edges_by_scipy(cloud, RECTANGLE)
    spacing = PLAIN.spacing_m
    edges = 2 * (RECTANGLE.width + RECTANGLE.height) / 0.008
    # The outermost of the points in a cell lies within about a spacing of the edge.
    sigma = spacing / np.sqrt(edges / 4)
    assert np.linalg.norm(result.error_m - reference) < 3.72 * sigma
    assert np.linalg.norm(reference) < 3.72 * sigma
    assert np.linalg.norm(mean_of_face(cloud)) > 3.72 * sigma


def test_ring_and_square_report_each_way_to_the_centre():
    for name, methods in (("ring", ["rim", "hole"]), ("square", ["rim", "holes"])):
        cloud, result = seen(name, 1)
        assert [other.method for other in result.fitted.others] == methods
        alone = [in_target(cloud, other) for other in result.fitted.others]
        for one in alone:
            assert np.linalg.norm(one.error_m) < 3.72 * one.u_m
        assert result.u_m < min(one.u_m for one in alone)
    assert seen("rectangle", 1)[1].fitted.others == ()


def test_hole_that_is_hidden_leaves_the_outer_edge():
    lid = Sheet((0, 0, 0.02), outer=0.06)
    _, result = seen("ring", 1, extra=(lid,))
    assert result.fitted.method == "rim"
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m


def test_hole_off_its_place_is_no_centre():
    """A hub hole drilled 0.6 mm aside: neither centre may be given for the other's."""
    setup = setup_of(RING, PLAIN)
    cloud = make(setup.but(holes=((0.0006, 0.0, 0.04),)), 1)
    with pytest.raises(NotMeasuredError) as error:
        found(cloud, RING)
    assert error.value.status == "centres-disagree"
    assert "hole" in str(error.value)
    nearly = make(setup.but(holes=((0.00002, 0.0, 0.04),)), 1)
    assert found(nearly, RING).fitted.method == "combined"


WRONG = {
    "ring without its hole": (RING, {"holes": ()}),
    "square without holes": (SQUARE, {"holes": ()}),
    "square for a ring": (RING, {"half_m": (0.15, 0.15)}),
    "disc for a square": (SQUARE, {"half_m": None, "radius_m": 0.15}),
    "rectangle 2 % wider": (RECTANGLE, {"half_m": (0.1836, 0.12)}),
    "rectangle 2 % lower": (RECTANGLE, {"half_m": (0.18, 0.1176)}),
    "rectangle 2 % smaller": (RECTANGLE, {"half_m": (0.1764, 0.1176)}),
    "ring 2 % larger": (RING, {"radius_m": 0.153}),
    "nothing but a wall": (RECTANGLE, {"half_m": (0.5, 0.5)}),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG)
def test_wrong_plate_is_refused_or_harmless(case):
    target, changes = WRONG[case]
    cloud = make(setup_of(target, PLAIN).but(**changes), 1)
    try:
        result = found(cloud, target)
    except NotMeasuredError as refused:
        status = refused.status
    else:
        status = ""
    if "2 %" not in case or status:
        assert status in ("wrong-outline", "no-outline", "centres-disagree")
        return
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("width_mm", "height_mm"), [(0.2, 0.0), (0.0, -0.3), (-0.4, 0.3)])
def test_a_width_within_its_tolerance_is_in_the_uncertainty(width_mm, height_mm, seed):
    """SIZE_M of half of it (k = 1). It moved the centre as a thicker wall does, by 3 to 20 u."""
    half_m = (0.18 + width_mm / 2e3, 0.12 + height_mm / 2e3)
    plain = found(make(setup_of(RECTANGLE, PLAIN), seed), RECTANGLE, seed)
    other = found(make(setup_of(RECTANGLE, PLAIN).but(half_m=half_m), seed), RECTANGLE, seed)
    moved_m = other.error_m - plain.error_m
    assert np.all(np.abs(moved_m) < 2.5 * np.sqrt(np.diag(other.covariance_m2)))
    thickness_m = other.fitted.edge_fit.thickness_m
    assert thickness_m == pytest.approx(RECTANGLE.thickness, rel=0.1)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("target", "incidence_deg", "stated"),
    [(RECTANGLE, 35.0, 0.7), (RECTANGLE, 35.0, 0.8), (DISC, 50.0, 0.8), (DISC, 55.0, 0.8)],
)
def test_a_contradicted_thickness_is_as_if_the_right_one_were_stated(
    target, incidence_deg, stated, seed
):
    """A rectangle's u lacked its width then, by up to 0.4 of it; beyond 45 degrees none was found.

    Centres were 0.02 to 0.05 mm farther off.
    """
    setup = setup_of(target, PLAIN).but(incidence_deg=incidence_deg, azimuth_deg=30.0)
    cloud, wrong_m = make(setup, seed), stated * target.thickness
    right = found(cloud, target, seed)
    other = found(cloud, target.model_copy(update={"thickness": wrong_m}), seed)
    assert other.fitted.edge_fit.stated_thickness_m == wrong_m
    u_m = np.sqrt(np.diag(right.covariance_m2))
    np.testing.assert_allclose(np.sqrt(np.diag(other.covariance_m2)), u_m, rtol=0.03)
    assert np.all(np.abs(other.error_m - right.error_m) < 0.15 * u_m)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("width_mm", "height_mm"), [(3, 0), (-3, 0), (0, 3), (0, -3)])
def test_one_dimension_3_mm_wrong_is_refused_or_harmless(width_mm, height_mm, seed):
    """A side that lies elsewhere was left out, and the centre off by 1.5 mm at u 0.15."""
    result = _unless_refused(width_mm, height_mm, seed, PLAIN.spacing_m)
    if result is not None:
        assert np.all(np.abs(result.error_m) < 2.0 * np.sqrt(np.diag(result.covariance_m2)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("spacing_m", [0.0018, 0.003, 0.006])
@pytest.mark.parametrize(
    ("width_mm", "height_mm"),
    [(3, 0), (-3, 0), (0, 3), (0, -3), (-6, 0), (-2, 0), (10, 0)],
)
def test_one_dimension_wrong_is_refused_or_harmless_at_any_spacing(
    width_mm, height_mm, spacing_m, seed
):
    """By 10 mm, 5 mm off; at 6 mm of spacing no side seemed lost, and centres were 1.7 mm off."""
    result = _unless_refused(width_mm, height_mm, seed, spacing_m)
    if result is not None:
        assert np.linalg.norm(result.error_m) < 3.72 * result.u_m


def _unless_refused(width_mm, height_mm, seed, spacing_m):
    """Find a plate that is wider and higher than stated; None if its outline is refused."""
    half_m = (0.18 + width_mm / 2e3, 0.12 + height_mm / 2e3)
    setup = setup_of(RECTANGLE, PLAIN).but(half_m=half_m, spacing_m=spacing_m)
    try:
        return found(make(setup, seed), RECTANGLE, seed)
    except NotMeasuredError as refused:
        if refused.status != "wrong-outline":
            raise
        return None


@pytest.mark.parametrize("spacing_mm", [1.0, 4.0])
@pytest.mark.parametrize(
    ("width_mm", "height_mm"), [(0, 0), (3, 0), (-10, 0), (0, -6), (2, 2), (-3, -3)]
)
def test_where_points_end_tells_the_width_against_the_height(width_mm, height_mm, spacing_mm):
    """Footprints end a target inside all of its sides alike: only the difference shows."""
    rng, half_mm = np.random.default_rng(1), np.array([180.0 + width_mm / 2, 120.0 + height_mm / 2])
    ticks = np.arange(-200.0, 200.0, spacing_mm)
    q_mm = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    q_mm = turned(q_mm + rng.uniform(0.0, spacing_mm, 2), 0.1)
    depth_m = np.where(np.all(np.abs(q_mm) < half_mm - 0.7, axis=1), 0.0, 0.08)
    state = square_on(RECTANGLE.thickness, CentreConfig(), (np.zeros(2), 0.0)).state
    state[BEAM] = 0.2, -0.1
    plane_m = (
        q_mm / 1e3 * (1.0 + depth_m * state[INVERSE])[:, None] + depth_m[:, None] * state[BEAM]
    )
    near = np.column_stack([plane_m, -depth_m])
    wider_m = wider_by_ends_m(near, RECTANGLE.edge, state, 0.002)
    assert wider_m == pytest.approx((width_mm - height_mm) / 2e3, abs=0.2e-3 * spacing_mm)


@pytest.mark.parametrize("width_mm", [3, -3])
def test_no_other_size_than_the_true_one_is_fitted_to_its_end(width_mm, monkeypatch):
    """Where the points end, and a rough fit, tell which: four times as fast."""
    half_m, whole = (0.18 + width_mm / 2e3, 0.12), edge_centre._by_mixed_pixels
    fitted_m = []

    def counted(view, outline, *rest, **named):
        fitted_m.append(outline.half_m)
        return whole(view, outline, *rest, **named)

    monkeypatch.setattr(edge_centre, "_by_mixed_pixels", counted)
    with pytest.raises(NotMeasuredError, match="across u are not as far apart"):
        found(make(setup_of(RECTANGLE, PLAIN).but(half_m=half_m), 1), RECTANGLE, 1)
    np.testing.assert_allclose(fitted_m, [(0.18, 0.12), half_m], atol=2e-4)


def test_plain_holes_of_the_target_need_to_be_there():
    cloud = make(setup_of(RING, PLAIN).but(holes=()), 1)
    with pytest.raises(NotMeasuredError, match="beyond the edge of the hole"):
        found(cloud, RING)
    plain = DiscTarget(shape="disc", diameter=RING.diameter, thickness=RING.thickness)
    assert found(cloud, plain).u_m < 1e-4


def test_parallel_edges_alone_are_no_centre():
    target = RectangleTarget(shape="rectangle", width=0.36, height=0.24, thickness=0.01)
    band = setup_of(target, PLAIN).but(background_m=None, keep=lambda u, v: np.abs(u) < 0.12)
    with pytest.raises(NotMeasuredError):
        found(make(band, 1), target)


STEEP = {
    f"{incidence} degrees, {thickness * 1e3:g} mm": (incidence, thickness)
    for incidence in (60.0, 70.0)
    for thickness in (0.003, 0.01, 0.02)
}


@pytest.mark.parametrize("case", STEEP)
def test_steep_beams_find_the_centre_and_know_how_well(case):
    """Beams that graze the face carry what lies behind it as far aside as thrice its depth."""
    incidence, thickness = STEEP[case]
    disc = DISC.model_copy(update={"thickness": thickness})
    setup = setup_of(disc, PLAIN).but(
        incidence_deg=incidence, spacing_m=0.00127, half_width_m=0.32, azimuth_deg=30.0
    )
    result = found(make(setup, 0), disc)
    assert result.fitted.method == "rim"
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
    assert np.linalg.norm(result.error_m) < 4e-4
    assert result.u_m < 1e-3


@pytest.mark.parametrize("seed", [1, 3])
def test_steep_beams_and_a_thick_wall_do_not_diverge(seed):
    """All unknowns free from the start run away along the wall's brightness, or find no edge."""
    disc = DISC.model_copy(update={"thickness": 0.02})
    setup = setup_of(disc, PLAIN).but(
        incidence_deg=70.0, spacing_m=0.00127, half_width_m=0.32, azimuth_deg=30.0
    )
    result = found(make(setup, seed), disc)
    assert result.fitted.method == "rim"
    assert np.linalg.norm(result.error_m) < 4e-4


def test_steep_beams_use_what_lies_far_aside_where_it_was_kept(monkeypatch):
    setup = setup_of(DISC, PLAIN).but(incidence_deg=65.0, half_width_m=0.32, spacing_m=0.0015)
    cloud = make(setup, 1)
    wide = found(cloud, DISC)
    monkeypatch.setattr("wheelplane.detection.cut_patch.BEAM_SLOPE", 1.2)
    narrow = found(cloud, DISC)
    assert wide.fitted.edge_fit.covered > 1.2 * narrow.fitted.edge_fit.covered
    for result in (narrow, wide):
        assert np.linalg.norm(result.error_m) < 3.72 * result.u_m


def from_two_places(name: str, apart_deg: float, seed: int) -> Found:
    """A plate scanned from two places, both scans in one cloud."""
    target = TARGETS.get(name, DISC).model_copy(update={"chamfer": 0.0})
    setup = setup_of(target, PLAIN)
    first = make(setup, [seed, 1])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = first.R, first.shift_m
    incidence = setup.incidence_deg - apart_deg
    second = make(
        setup.but(
            incidence_deg=abs(incidence),
            azimuth_deg=setup.azimuth_deg + (180.0 if incidence < 0 else 0.0),
        ),
        [seed, 2],
        pose,
    )
    points = np.concatenate([first.points_m, second.points_m])
    return found(replace(first, points_m=points), target, seed)


@pytest.mark.slow
@pytest.mark.parametrize("apart_deg", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("name", ["disc", "rectangle"])
def test_two_viewpoints_in_one_cloud_are_seen_and_doubted(name, apart_deg):
    result = from_two_places(name, apart_deg, 1)
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m
    assert result.u_m > 3e-4  # no single viewpoint explains what is seen
    assert from_two_places(name, 0.0, 1).u_m < 3e-5


@pytest.mark.slow
def test_square_whose_edges_rows_of_few_points_run_along_is_measured_and_knows_how_well():
    """Points 13.7 mm apart: their last row lies up to 13 mm inside an edge that it runs along."""
    scattered = []
    for seed in range(24):
        view = Setup(spacing_m=0.0137, half_width_m=0.26, pairs=12, incidence_deg=5.0 + seed % 20)
        result = found(make(setup_of(SQUARE, view), seed), SQUARE, seed)
        scattered.append(result.nees)
    assert max(scattered) < stats.chi2.isf(1e-3 / 24, 2)
    assert np.mean(scattered) > 0.2
