"""Boards with a printed pattern: its centre, its markers, and what contradicts it."""

from __future__ import annotations

import functools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.support.plates import found, in_target
from tests.support.printing import brightness, setup_of
from tests.support.scenes import Setup, make
from wheelplane.centre.locate_centre import _by_pattern
from wheelplane.centre.pattern.detect import find_circles, find_corners, find_markers
from wheelplane.centre.pattern.fit_pattern import PatternFit
from wheelplane.centre.pattern.image import target_image
from wheelplane.centre.pattern.pose import rigid
from wheelplane.errors import NotMeasuredError
from wheelplane.targets.registry import load_target, parse_target
from wheelplane.vectors import turned

CIRCLES, BOARD = load_target("pattern-circles"), load_target("pattern-checkerboard")
MARKERS = load_target("pattern-aruco")
TARGETS = {"circles": CIRCLES, "checkerboard": BOARD, "aruco": MARKERS}
PLAIN = Setup(spacing_m=0.002, half_width_m=0.24, pairs=12)
FIRST_OR_SLOW = [
    name if k == 0 else pytest.param(name, marks=pytest.mark.slow) for k, name in enumerate(TARGETS)
]


def changed(target, **changes):
    """The target with other values, checked like a file's."""
    table = {k: v for k, v in target.model_dump().items() if v is not None}
    return parse_target({k: v for k, v in (table | changes).items() if v is not None}, "t")


@functools.cache
def seen(name, seed, **changes):
    target = TARGETS[name]
    cloud = make(setup_of(target, PLAIN).but(**dict(changes)), seed)
    return cloud, found(cloud, target, seed)


def by(result, cloud, method):
    """The result of one way to the centre."""
    return next(in_target(cloud, o) for o in result.fitted.others if o.method == method)


@pytest.mark.parametrize("changes", [{}, {"background_m": None}, {"incidence_deg": 30.0}])
@pytest.mark.parametrize("name", TARGETS)
def test_print_gives_the_centre_to_hundredths_of_a_millimetre(name, changes):
    cloud, result = seen(name, 1, **changes)
    assert result.fitted.method == "combined"
    printed = by(result, cloud, "pattern")
    assert np.linalg.norm(printed.error_m) < 6e-5
    assert np.linalg.norm(result.error_m) < 1.2e-4
    assert np.linalg.norm(result.error_m) < 3.72 * result.u_m


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_uncertainty_of_the_print_is_what_its_errors_are(name):
    exact = changed(TARGETS[name], print_shift=0.0)
    values = []
    for seed in range(10):
        cloud = make(setup_of(exact, PLAIN).but(background_m=None), seed)
        values.append(by(found(cloud, exact, seed), cloud, "pattern").nees)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * len(values))
    assert low < sum(values) < high
    assert sum(values) * 4**2 > high  # a quarter of the uncertainty would not do


@pytest.mark.parametrize("background", [0.08, None])
@pytest.mark.parametrize("name", FIRST_OR_SLOW)
def test_print_off_the_middle_and_turned_is_found_where_the_file_has_it(name, background):
    outline = {"width": 0.46, "height": 0.42}
    target = changed(TARGETS[name], offset=[0.031, -0.017], turn_deg=12.0, **outline)
    cloud = make(setup_of(target, PLAIN).but(background_m=background, half_width_m=0.28), 2)
    result = found(cloud, target, 2)
    assert np.linalg.norm(by(result, cloud, "pattern").error_m) < 1e-4
    assert result.fitted.method == "combined"


@pytest.mark.parametrize("turn", [0.03, 2.0, np.pi])
def test_a_wrong_plane_moves_the_print_and_the_board_about_it(turn):
    """Features lie where their beams meet the plane: to first order, as when they are fitted so."""
    target = changed(BOARD, width=None, height=None, diameter=0.6, offset=[0.06, -0.02])
    beam, local = np.array([0.5, -0.2]), target.places_m
    exact = PatternFit(
        np.zeros(2), turn, 1e-10 * np.eye(2), 20.0, 1e-5, 35, 35, (), None, np.zeros(3)
    )
    found = _by_pattern(exact, target, SimpleNamespace(beam=beam))
    places, slopes = turned(local, turn), []
    for height, *tilt in 1e-6 * np.eye(3):
        centre, rotation = rigid(local, places - np.outer(height + places @ tilt, beam))
        rotated = np.remainder(rotation - turn + np.pi, 2.0 * np.pi) - np.pi
        slopes.append([*(centre / 1e-6), rotated / 1e-6])
    expected = np.array(slopes).T
    np.testing.assert_allclose(found.by_plane, expected[:2], atol=1e-5)
    np.testing.assert_allclose(found.rotation.by_plane, expected[2], atol=1e-5)


@pytest.mark.parametrize("name", FIRST_OR_SLOW)
def test_round_board_needs_no_axes_of_its_own(name):
    target = changed(TARGETS[name], width=None, height=None, diameter=0.46, offset=[0.02, 0.01])
    cloud = make(setup_of(target, PLAIN).but(half_width_m=0.28), 3)
    for seed in (3, 4):  # at different turns of the first look
        assert np.linalg.norm(by(found(cloud, target, seed), cloud, "pattern").error_m) < 1e-4


@pytest.mark.parametrize("name", TARGETS)
def test_ink_that_shines_serves_as_well(name):
    target = TARGETS[name]
    printed = brightness(target, inverted=True)
    cloud = make(setup_of(target, PLAIN).but(printed=printed), 1)
    assert np.linalg.norm(by(found(cloud, target), cloud, "pattern").error_m) < 8e-5


def test_part_of_the_print_serves_with_a_larger_uncertainty():
    whole_cloud, whole = seen("circles", 5, background_m=None)
    keep = lambda u, v: u + 0.3 * v > -0.03  # noqa: E731
    cloud, part = seen("circles", 5, background_m=None, keep=keep)
    assert np.linalg.norm(cloud.in_target(cloud.face_m).mean(axis=0)[:2]) > 0.03
    exact = part.fitted.others[-1], whole.fitted.others[-1]
    assert [other.method for other in exact] == ["pattern", "pattern"]
    assert np.linalg.norm(in_target(cloud, exact[0]).error_m) < 2e-4
    assert in_target(cloud, exact[0]).u_m > in_target(whole_cloud, exact[1]).u_m


@pytest.mark.parametrize("wheel", ["RR", "RL", "FR", "FL"])
def test_markers_name_the_wheel(wheel):
    cloud = make(setup_of(MARKERS, PLAIN).but(printed=brightness(MARKERS, wheel)), 1)
    result = found(cloud, MARKERS)
    assert result.fitted.wheel == wheel
    assert result.fitted.marker_ids == MARKERS.wheels[wheel]
    assert np.linalg.norm(by(result, cloud, "pattern").error_m) < 8e-5


def test_strange_markers_and_blank_boards_name_none():
    other = changed(MARKERS, wheels={"RR": [20, 21, 22, 23]})
    for printed in (brightness(other), lambda u, v: np.ones_like(u)):
        cloud = make(setup_of(MARKERS, PLAIN).but(printed=printed), 1)
        fitted = found(cloud, MARKERS).fitted
        assert (fitted.method, fitted.wheel, fitted.marker_ids) == ("rim", None, ())
        assert fitted.print_missed == "not-found"


def test_without_intensities_the_outline_alone_serves():
    cloud = make(setup_of(CIRCLES, PLAIN).but(printed=None), 1)
    fitted = found(cloud, CIRCLES).fitted
    assert (fitted.method, fitted.others) == ("rim", ())
    assert fitted.print_missed == "no-intensity"


def test_nothing_is_missed_where_a_print_is_read_or_none_is_stated():
    assert seen("circles", 1)[1].fitted.print_missed is None
    plain = load_target("rectangle-360x240")
    assert found(make(setup_of(plain, PLAIN), 1), plain).fitted.print_missed is None


@pytest.mark.parametrize("name", FIRST_OR_SLOW)
def test_print_that_lies_elsewhere_is_no_centre(name):
    """Printed 2 mm aside, where the file allows for 0.2 mm: neither centre may be given."""
    target = TARGETS[name]
    aside = changed(target, offset=[0.002, 0.0])
    cloud = make(setup_of(target, PLAIN).but(printed=brightness(aside)), 1)
    with pytest.raises(NotMeasuredError) as error:
        found(cloud, target)
    assert error.value.status == "centres-disagree"
    assert "pattern" in str(error.value)
    nearly = changed(target, offset=[0.0003, 0.0])
    cloud = make(setup_of(target, PLAIN).but(printed=brightness(nearly)), 1)
    assert found(cloud, target).fitted.method == "combined"


def test_rigid_fit_is_that_of_the_singular_value_decomposition():
    rng = np.random.default_rng(0)
    for _ in range(20):
        local = rng.normal(size=(7, 2))
        turn, shift = rng.uniform(-np.pi, np.pi), rng.normal(size=2)
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        there = local @ R.T + shift + rng.normal(0, 0.1, local.shape)
        p, q = local - local.mean(axis=0), there - there.mean(axis=0)
        U, _, Vt = np.linalg.svd(p.T @ q)
        best = Vt.T @ np.diag([1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T
        moved, angle = rigid(local, there)
        np.testing.assert_allclose([np.cos(angle), np.sin(angle)], best[:, 0], atol=1e-12)
        expected = there.mean(axis=0) - best @ local.mean(axis=0)
        np.testing.assert_allclose(moved, expected, atol=1e-12)


def test_picture_lies_as_the_plane_does():
    """A bright spot right of and above the middle is there in the picture, and comes back."""
    rng = np.random.default_rng(0)
    uv = rng.uniform(-0.1, 0.1, (40_000, 2))
    place = np.array([0.05, 0.03])
    intensity = (np.hypot(*(uv - place).T) < 0.01).astype(float)
    image = target_image(uv, intensity, 0.001)
    row, column = np.nonzero(image.grey > 128)
    assert column.mean() > image.grey.shape[1] / 2
    assert row.mean() < image.grey.shape[0] / 2
    back = image.places_m(np.array([column.mean(), row.mean()]))
    np.testing.assert_allclose(back, place, atol=0.1 * image.pixel_m)
    spots = image.places_m(find_circles(image.grey, 0.02 / image.pixel_m))
    np.testing.assert_allclose(spots, [place], atol=0.3 * image.pixel_m)


def test_features_of_nothing_are_none():
    grey = np.full((80, 80), 128, dtype=np.uint8)
    assert find_circles(grey, 12.0).shape == (0, 2)
    assert find_corners(grey, 4, 5).shape == (0, 2)
    assert find_markers(grey, "DICT_4X4_50").corners.shape == (0, 4, 2)
