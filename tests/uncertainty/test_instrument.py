"""Errors of range and axes: what they do to a target, against moving every one of its points."""

import json
import math

import numpy as np
import pytest

from tests.support.made import DEFAULT, DISC, SALOON, changed
from tests.support.scenes import rotation
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, InstrumentConfig
from wheelplane.measure import measure_capture
from wheelplane.plane import total_least_squares
from wheelplane.uncertainty.instrument import edge_shift_m, instrument_components
from wheelplane.uncertainty.propagation import effects_of
from wheelplane_synth.output.archive import write_capture

ARCSEC = math.radians(1.0 / 3600.0)
RADIUS = 0.12


def scene(seed):
    """Unit normal towards the scanner, and the vector from the scanner to the centre."""
    rng = np.random.default_rng(seed)
    R, azimuth = rotation(rng), rng.uniform(-np.pi, np.pi)
    sight = 2.5 * np.array([np.cos(azimuth), np.sin(azimuth), rng.uniform(-0.6, 0.3)])
    aside = np.cross(sight, R[0])
    normal = -sight / np.linalg.norm(sight) + 0.5 * aside / np.linalg.norm(aside)
    return normal / np.linalg.norm(normal), sight


def spherical(p):
    x, y, z = p.T
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)), np.linalg.norm(p, axis=1)


def cartesian(a, e, r):
    return np.stack([r * np.cos(e) * np.cos(a), r * np.cos(e) * np.sin(a), r * np.sin(e)], axis=1)


S = 15.0 * ARCSEC
# Of each term: its value in the file, the rows that it gives, the component, and how it moves
# azimuth, elevation and range of one phase (a, e, r, cosine of incidence).
TERMS = {
    "incidence_bias_m": (1e-3, "incidence", lambda a, e, r, c: (a, e, r + 1e-3 * (1.0 / c - 1.0))),
    "range_scale_ppm": (200.0, "range scale", lambda a, e, r, c: (a, e, r * (1.0 + 2e-4))),
    "collimation_arcsec": (15.0, "axes", lambda a, e, r, c: (a + S / np.cos(e), e, r)),
    "trunnion_arcsec": (15.0, "axes", lambda a, e, r, c: (a + S * np.tan(e), e, r)),
    "vertical_index_arcsec": (15.0, "axes", lambda a, e, r, c: (a, e + S, r)),
    "beam_offset_m": (1e-4, "axes", lambda a, e, r, c: (a + 1e-4 / (r * np.cos(e)), e, r)),
}


def change(normal, sight, move):
    """Change of normal and centre (6,) by moving the points of a disc, and its in-plane rotation.

    Every point keeps the incidence that it has; the centre is the point at the centre.
    """
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    u = np.cross(normal, [0.0, 0.0, 1.0])
    u /= np.linalg.norm(u)
    across = np.stack([u, np.cross(normal, u)])
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    points = sight + np.vstack([np.zeros(2), RADIUS * ring, 0.5 * RADIUS * ring]) @ across
    cosine = np.abs(points @ normal) / np.linalg.norm(points, axis=1)
    moved = cartesian(*move(*spherical(points), cosine))
    after = total_least_squares(moved).normal
    away, shift = (points - sight) @ across.T, (moved - points - (moved - points)[0]) @ across.T
    rotated = np.sum(away[:, 0] * shift[:, 1] - away[:, 1] * shift[:, 0]) / np.sum(away**2)
    return np.concatenate([after * np.sign(after @ normal) - normal, moved[0] - points[0]]), rotated


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("key", TERMS)
def test_a_term_moves_the_target_as_it_moves_every_point(key, seed):
    value, name, move = TERMS[key]
    normal, sight = scene(seed)
    (found,) = stated({key: value}, normal, sight)
    assert found.name == name
    column = found.factor[:, np.any(found.factor != 0.0, axis=0)]
    assert column.shape == (6, 1)
    wanted, rotated = change(normal, sight, move)
    if key == "incidence_bias_m":
        wanted[3:] += edge_shift_m(value, sight, normal)
    size = np.linalg.norm(wanted[3:])
    # First order in target over distance.
    np.testing.assert_allclose(column[:3, 0], wanted[:3], atol=0.06 * size / 2.5 + 1e-9)
    np.testing.assert_allclose(column[3:, 0], wanted[3:], atol=1e-3 * size + 1e-10)
    assert np.abs(found.turn).sum() == pytest.approx(abs(rotated), abs=0.06 * size / 2.5 + 1e-9)
    assert np.linalg.norm(wanted[:3]) > 0.2 * size / 2.5 or key in ("range_scale_ppm",)


def stated(values, normal, sight, station=None):
    instrument = InstrumentConfig(**values)
    found = instrument_components(instrument, sight, normal, RADIUS, station)
    return [component for component in found if component.factor.any()]


@pytest.mark.parametrize("seed", [7, 8, 9, 10])
@pytest.mark.parametrize("which", ["azimuth", "elevation"])
def test_an_eccentricity_is_that_of_all_phases(which, seed):
    normal, sight = scene(seed)
    (found,) = stated({f"{which}_eccentricity_arcsec": 15.0}, normal, sight)
    total = np.zeros((6, 6))
    phases = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for phase in phases:

        def move(a, e, r, c, at=phase):
            if which == "azimuth":
                return a + S * np.sin(a - at), e, r
            return a, e + S * np.sin(e - at), r

        moved, _ = change(normal, sight, move)
        total += np.outer(moved, moved) / len(phases)
    for part, within in ((slice(0, 3), 0.1), (slice(3, 6), 1e-3)):
        size = np.trace(total[part, part])
        found_part = found.covariance[part, part] / size
        np.testing.assert_allclose(found_part, total[part, part] / size, atol=within)


def test_incidence_tilts_a_target_as_the_opposite_range_bias():
    """1 / cos - 1 along the beam is one along the normal less one along the beam."""
    from wheelplane.uncertainty.components import range_bias_component

    normal, sight = scene(3)
    (found,) = stated({"incidence_bias_m": 1e-3}, normal, sight)
    bias = range_bias_component(1e-3, sight, normal)
    np.testing.assert_allclose(
        found.factor[:3, 0], -bias.factor[:3, 0], atol=1e-3 * np.abs(bias.factor[:3]).max()
    )
    assert np.abs(bias.factor[:3]).max() > 1e-5


def test_what_is_not_stated_is_nothing_and_twice_the_value_is_twice_the_movement():
    normal, sight = scene(1)
    assert stated({}, normal, sight) == []
    once = {key: value for key, (value, _, _) in TERMS.items()}
    for one, two in zip(
        stated(once, normal, sight),
        stated({key: 2.0 * value for key, value in once.items()}, normal, sight),
        strict=True,
    ):
        np.testing.assert_allclose(two.factor, 2.0 * one.factor, rtol=1e-12)


def test_ranges_are_shared_by_the_scanner_and_axes_by_the_station():
    values = {key: value for key, (value, _, _) in TERMS.items()}
    normal, sight = scene(2)
    ranges = {"incidence": "scanner", "range scale": "scanner"}
    for station in (None, "station 0 0 0"):
        found = {c.name: c.shared for c in stated(values, normal, sight, station)}
        assert found == {**ranges, "axes": station}

    class Target:
        def __init__(self, station):
            self.components = stated(values, normal, sight, station)

    (same,) = [c for c in stated({**values, "same_face": True}, normal, sight) if c.name == "axes"]
    assert same.shared == "scanner"

    two = effects_of([Target("station 0 0 0"), Target("station 0 0 0")])
    assert [effect.name for effect in two] == ["incidence", "range scale", "axes"]
    apart = effects_of([Target("station 0 0 0"), Target("station 5 0 0")])
    assert [effect.name for effect in apart].count("axes") == 2


@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_error_by_incidence_moves_centres_as_far_as_stated(tmp_path, sign):
    """Edges included: errors in the plane are of the size of u, and far beyond u without it.

    Of a target with sharp edges that are stated: an unknown chamfer moves centres along the beams.
    """
    values = {
        "station.incidence_deg": [30.0, 40.0],
        "beam.incidence_bias_m": sign * 1e-3,
        "beam.range_sigma_m": 4e-4,
        "grid.spacing_m": 0.0026,
        "grid.half_width_m": 0.17,
    }
    scanner = changed(DEFAULT, tmp_path, values)
    folder, sharp = tmp_path / "capture", changed(DISC, tmp_path, {"chamfer": 0.0})
    write_capture(folder, seed=3, vehicle=SALOON, scanner=scanner, target=sharp, trials=0)
    truth = {w["name"]: w for w in json.loads((folder / "truth.json").read_text())["wheels"]}
    ratios = {}
    for stated in (0.0, 1e-3):
        config = Config(instrument=InstrumentConfig(incidence_bias_m=stated))
        with open_capture(folder, str(sharp)) as capture:
            wheels = measure_capture(capture, config).wheels
        ratios[stated] = [ratio_of(wheel.observation, truth) for wheel in wheels]
    assert np.all(np.abs(ratios[1e-3]) > 0.4)
    assert np.all(np.abs(ratios[1e-3]) < 2.0)
    assert np.all(np.abs(ratios[0.0]) > 3.0)


def ratio_of(observation, truth):
    """Error of a centre in its plane, along the beams, over u."""
    fitted, true = observation.fitted, truth[observation.name]
    normal = np.array(true["normal"])
    beam = fitted.sight_m(2.5, None, observation.evidence.plane)
    along = beam - (beam @ normal) * normal
    along /= np.linalg.norm(along)
    return (
        along
        @ (fitted.centre_m - true["centre_m"])
        / np.sqrt(along @ fitted.centre_covariance_m2 @ along)
    )


def test_a_centre_shifts_within_its_plane_along_the_sight_by_the_sine_of_incidence():
    normal, sight = scene(3)
    sine = np.linalg.norm(np.cross(normal, sight)) / np.linalg.norm(sight)
    for away in (0.1, 1.0, 7.0):
        shift = edge_shift_m(1e-3, away * sight, normal)
        assert shift @ normal == pytest.approx(0.0, abs=1e-18)
        assert np.linalg.norm(shift) == pytest.approx(4e-4 * sine)
        assert shift @ sight > 0.9 * np.linalg.norm(shift) * np.linalg.norm(sight) * sine


@pytest.mark.parametrize("axis", range(6))
def test_a_target_square_to_an_axis_is_like_any_other(axis):
    """Its components are those of one turned by a nanoradian."""
    normal = np.vstack([np.eye(3), -np.eye(3)])[axis]
    sight = -2.0 * normal + np.array([0.3, 0.4, 0.5])
    near = normal + 1e-9 * np.array([1.0, -1.0, 1.0])
    values = {"collimation_arcsec": 15.0, "vertical_index_arcsec": 9.0, "range_scale_ppm": 50.0}
    pair = [stated(values, n / np.linalg.norm(n), sight) for n in (normal, near)]
    for one, other in zip(*pair, strict=True):
        np.testing.assert_allclose(one.factor, other.factor, atol=1e-12)
