"""Edges with a chamfer: real plates are hardly ever sharp.

A chamfer of 0.3 mm, which deburring leaves, moved centres by 0.07 mm at 15 and 0.13 mm at 35
degrees, by 7 of their standard uncertainties: it faces the scanner on one side only.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.support.plates import found
from tests.support.scenes import Setup, make
from wheelplane.centre.edge import mixed_fit, solution
from wheelplane.centre.edge.beams import CENTRE, CHAMFER, MODULATION, STATE, U_CHAMFER_M, Prior
from wheelplane.centre.edge.mixed_pixel import TAKEN_FOR
from wheelplane.centre.edge.solution import _without
from wheelplane.centre.edge_centre import BY_THICKNESS, _by_form
from wheelplane.targets import parse_target
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")
SEEDS = 6
SHARP = Prior(np.zeros(STATE), np.full(STATE, 1e24))  # all is known beforehand


def results(chamfer_m, incidence_deg, noise_m=2e-4, rounded=False, **stated):
    target = DISC.model_copy(update=stated)
    for seed in range(SEEDS):
        scene = Setup(
            chamfer_m=chamfer_m,
            rounded=rounded,
            noise_m=noise_m,
            incidence_deg=incidence_deg,
            azimuth_deg=60.0 * seed,
        )
        yield found(make(scene, seed), target, seed)


@pytest.mark.slow
@pytest.mark.parametrize("incidence_deg", [15.0, 35.0])
@pytest.mark.parametrize("chamfer_m", [0.0, 3e-4, 6e-4])
def test_a_chamfer_that_is_not_stated_is_found_and_moves_no_centre(chamfer_m, incidence_deg):
    squares, off_m, u_m, widths = [], [], [], []
    for result in results(chamfer_m, incidence_deg):
        squares.append(result.nees)
        off_m.append(np.linalg.norm(result.error_m))
        u_m.append(result.u_m)
        widths.append(result.fitted.edge_fit.chamfer_m)
    assert np.mean(squares) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert np.sqrt(np.mean(np.square(off_m))) < 5e-5
    assert np.median(u_m) < 4e-5
    assert np.mean(widths) == pytest.approx(chamfer_m, abs=1.5e-4)
    assert min(widths) >= 0.0


@pytest.mark.slow
@pytest.mark.parametrize("incidence_deg", [8.0, 20.0, 35.0])
@pytest.mark.parametrize("radius_m", [3e-4, 7e-4])
def test_a_rounded_edge_is_in_the_uncertainty(radius_m, incidence_deg):
    """The fit is that of an edge between both: 0.03 mm off at 0.015 as of a chamfer alone."""
    found_all = list(results(radius_m, incidence_deg, rounded=True))
    assert np.mean([one.nees for one in found_all]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert np.median([one.u_m for one in found_all]) < 4e-5


@pytest.mark.slow
@pytest.mark.parametrize("incidence_deg", [8.0, 20.0, 35.0])
@pytest.mark.parametrize("radius_m", [7e-4, 1.4e-3])
def test_a_stated_edge_radius_is_used(radius_m, incidence_deg):
    """As well as a sharp edge is: a chamfer instead is 0.02 to 0.05 mm off."""
    found_all = list(
        results(radius_m, incidence_deg, noise_m=1e-4, rounded=True, edge_radius=radius_m)
    )
    off_m = [np.linalg.norm(one.error_m) for one in found_all]
    assert np.sqrt(np.mean(np.square(off_m))) < 1.6e-5
    assert np.mean([one.nees for one in found_all]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    widths = [one.fitted.edge_fit.chamfer_m for one in found_all]
    assert np.mean(widths) == pytest.approx(TAKEN_FOR * radius_m, abs=5e-5)


@pytest.mark.parametrize("stated_m", [0.0, 5e-4])
def test_a_stated_chamfer_is_used(stated_m):
    for result in results(stated_m, 25.0, noise_m=8e-4, chamfer=stated_m):
        assert result.fitted.edge_fit.chamfer_m == pytest.approx(stated_m, abs=1.5e-4)
        assert result.nees < stats.chi2.isf(1e-4, 2)
        assert result.u_m < 3e-5


CLEAN = Setup(noise_m=3e-4, spot_m=0.0, spacing_m=0.0008, incidence_deg=28.0)
PROFILED = CLEAN.but(noise_m=5e-5, spacing_m=0.0005, incidence_deg=18.0, radius_m=0.125 - 8.5e-5)


def clean(chamfer_m, rounded=False, scene=CLEAN, seeds=range(SEEDS), **stated):
    """Beams of no footprint, each of which returns one surface, from all around."""
    target = DISC.model_copy(update=stated)
    for seed in seeds:
        seen = scene.but(chamfer_m=chamfer_m, rounded=rounded, azimuth_deg=60.0 * seed)
        yield found(make(seen, seed), target, seed)


@pytest.mark.parametrize("stated_m", [None, pytest.param(5e-4, marks=pytest.mark.slow)])
def test_a_chamfer_moves_a_clean_edge_within_its_uncertainty(stated_m):
    """It hides nothing on the near side; on the far side the edge lies inside by its slope."""
    results = list(clean(5e-4, chamfer=stated_m))
    assert np.mean([one.nees for one in results]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert all(one.fitted.edge_fit.is_clean for one in results)


@pytest.mark.parametrize(
    "chamfer_m", [2e-4, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.0, 5e-4))]
)
def test_depths_of_a_clean_edge_show_its_chamfer_and_its_size(chamfer_m):
    """As of a laser profile, of a plate 0.17 mm smaller than stated.

    Taken for sharp and of the stated size, such edges were off by up to 0.1 mm at a u of 0.01.
    """
    results = list(clean(chamfer_m, scene=PROFILED))
    assert np.mean([one.nees for one in results]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    assert np.sqrt(np.mean([np.sum(one.error_m**2) for one in results])) < 2e-5
    assert np.median([one.u_m for one in results]) < 2e-5
    for one in results:
        edge_fit = one.fitted.edge_fit
        assert edge_fit.chamfer_m == pytest.approx(chamfer_m, abs=6e-5)
        assert abs(edge_fit.growth_m + 8.5e-5) < 4.0 * edge_fit.growth_u_m


@pytest.mark.parametrize("chamfer_m", [1e-4, 2e-4])
def test_a_wide_footprint_passes_for_no_narrow_chamfer(chamfer_m):
    """Beams so placed that it explained their depths too, 0.06 to 0.07 mm off."""
    (seen,) = clean(chamfer_m, scene=PROFILED, seeds=[12])
    assert np.linalg.norm(seen.error_m) < 2e-5
    assert seen.fitted.edge_fit.chamfer_m == pytest.approx(chamfer_m, abs=6e-5)


def test_of_a_clean_edge_a_stated_radius_is_used():
    """As the chamfer for which it is taken: where beams touch it, it returns hardly any light."""
    results = list(clean(1e-3, rounded=True, edge_radius=1e-3))
    assert all(one.fitted.edge_fit.is_clean for one in results)
    assert np.mean([one.nees for one in results]) < stats.chi2.ppf(0.999, 2 * SEEDS) / SEEDS
    off_m = [np.linalg.norm(one.error_m) for one in results]
    assert np.sqrt(np.mean(np.square(off_m))) < 3e-5


def test_a_smaller_plate_is_no_chamfer():
    """1.5 mm smaller all round: it is refused as before."""
    with pytest.raises(Exception, match="inside that of a disc of 250 mm"):
        found(make(Setup(radius_m=0.1235, noise_m=2e-4), 0), DISC, 0)


@pytest.mark.parametrize("below", [0.0, 0.3, 0.7, 1.0])
def test_no_chamfer_is_below_nothing(below):
    """A normal distribution, of which only what is above 0 is left: its mean square about 0."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(STATE, STATE)) * 1e-4
    covariance = root @ root.T
    u = np.sqrt(covariance[CHAMFER, CHAMFER])
    state = rng.normal(size=STATE)
    state[CHAMFER] = -below * u
    by_plane = rng.normal(size=(STATE, 3))
    way = covariance[CHAMFER] / u**2
    found_state, left, moved = _without(CHAMFER, way, 1.0, state, covariance, by_plane)
    assert found_state[CHAMFER] == pytest.approx(0.0, abs=1e-18)
    above = stats.truncnorm(below, np.inf, loc=-below)
    assert left[CHAMFER, CHAMFER] == pytest.approx(above.moment(2) * u**2, rel=1e-6)
    np.testing.assert_allclose(moved[CHAMFER], 0.0, atol=1e-12)
    # What does not go with the chamfer is as certain as it was.
    aside = np.eye(STATE) - np.outer(way, np.eye(STATE)[CHAMFER])
    np.testing.assert_allclose(aside @ left @ aside.T, aside @ covariance @ aside.T, atol=1e-20)
    np.testing.assert_allclose(aside @ (found_state - state), 0.0, atol=1e-12)


@pytest.mark.parametrize("u_m", [1e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("below", [2.0, 6.0, 90.0, 1e4])
def test_a_chamfer_far_below_nothing_contradicts_its_uncertainty(below, u_m):
    """It is `below` times as large then, up to what is known beforehand."""
    covariance = np.diag(np.full(STATE, u_m**2))
    state = np.zeros(STATE)
    state[CHAMFER] = -below * u_m
    way = np.eye(STATE)[CHAMFER]
    _, left, _ = _without(CHAMFER, way, U_CHAMFER_M**2, state, covariance, np.zeros((STATE, 3)))
    wider_m = max(min(below**2 * u_m, U_CHAMFER_M), u_m)
    at = below * u_m / wider_m
    if at < 10.0:
        above = stats.truncnorm(at, np.inf, loc=-at)
        assert left[CHAMFER, CHAMFER] == pytest.approx(above.moment(2) * wider_m**2, rel=1e-4)
    else:
        assert 0.0 < left[CHAMFER, CHAMFER] < 2.0 * (wider_m / at) ** 2 * 1.01
    others = np.delete(np.diag(left), CHAMFER)
    np.testing.assert_allclose(others, u_m**2)


def test_neither_a_chamfer_nor_a_modulation_below_nothing_hides_the_other(monkeypatch):
    """Independent ones, each one standard deviation below 0: both lose the same share of u."""
    u = np.full(STATE, 1e-4)
    spread = np.diag(u**2), np.zeros((STATE, 3)), 20.0
    monkeypatch.setattr(solution, "spread", lambda *_: spread)
    monkeypatch.setattr(solution, "along", lambda _linear, _prior, which: np.eye(STATE)[which])
    state = np.zeros(STATE)
    state[[CHAMFER, MODULATION]] = -1e-4
    problem = SimpleNamespace(outline=None, few=False)
    found = solution._estimates(state, None, problem, SHARP)
    left = math.sqrt(stats.truncnorm(1.0, np.inf, loc=-1.0).moment(2)) * 1e-4
    assert found["chamfer_m"] == found["modulation"] == 0.0
    assert found["chamfer_u_m"] == pytest.approx(left, rel=1e-6)
    assert found["modulation_u"] == pytest.approx(left, rel=1e-6)


def test_where_one_is_held_the_other_moves_with_it_alone(monkeypatch):
    """Both below 0, and dependent: held at 0 together, as the normal equations solve them."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(STATE, STATE))
    inverse = root @ root.T * 1e-8
    monkeypatch.setattr(solution, "spread", lambda *_: (inverse, np.zeros((STATE, 3)), 20.0))
    way = {k: inverse[k] / inverse[k, k] for k in (CHAMFER, MODULATION)}
    monkeypatch.setattr(solution, "along", lambda _linear, _prior, which: way[which])
    state = rng.normal(size=STATE) * 1e-4
    both = [CHAMFER, MODULATION]
    state[both] = -3e-4
    # below 0 still after the other is held
    state[MODULATION] += min(way[CHAMFER][MODULATION], 0.0) * 3e-4
    found = solution._estimates(state, None, SimpleNamespace(outline=None, few=False), SHARP)
    together = state - inverse[:, both] @ np.linalg.solve(inverse[np.ix_(both, both)], state[both])
    assert (state - way[CHAMFER] * state[CHAMFER])[MODULATION] < 0.0  # it is held, too
    np.testing.assert_allclose(found["centre_m"], together[:2], atol=1e-15)


@pytest.mark.parametrize("key", ["chamfer", "edge_radius"])
def test_an_edge_wider_than_the_plate_is_refused(key):
    plate = {"shape": "disc", "diameter": 0.25, "thickness": 0.002, key: 0.003}
    with pytest.raises(Exception, match=f"{key} 0.003 is wider than the plate is thick"):
        parse_target(plate, "a test")


def test_an_edge_has_a_chamfer_or_a_radius():
    plate = {"shape": "disc", "diameter": 0.25, "chamfer": 0.0, "edge_radius": 0.001}
    with pytest.raises(Exception, match="chamfer and edge_radius: state one of them"):
        parse_target(plate, "a test")


@pytest.mark.parametrize("seed", [0, 2])
def test_a_chamfer_is_fitted_before_the_background_of_its_own_solution(monkeypatch, seed):
    """Before that of a sharp edge a fit has not ended: at a wheel it is up to 0.06 mm off."""
    fits = []

    def kept(*given):
        fits.append(with_light(*given))
        return fits[-1]

    with_light = mixed_fit._with_light
    monkeypatch.setattr(mixed_fit, "_with_light", kept)
    scene = Setup(chamfer_m=4e-4, incidence_deg=20.0, azimuth_deg=60.0 * seed)
    found(make(scene, seed), DISC, seed)
    problem, ended = fits[-1]
    again = mixed_fit._again(problem, ended, 40)
    assert ended.state[CHAMFER] > 1e-4
    np.testing.assert_allclose(again.state[CENTRE], ended.state[CENTRE], atol=4e-7)


@pytest.mark.slow
def test_edges_as_deburring_leaves_them_move_no_centre_one_way():
    """Square on, little is shown of a chamfer: what is taken for it then is the likeliest one."""
    along_m = []
    for chamfer_m, rounded in ((1e-4, False), (2e-4, False), (4e-4, True), (6e-4, True)):
        for seed, one in enumerate(results(chamfer_m, 6.0, rounded=rounded)):
            towards = np.radians(60.0 * seed)
            along_m.append(one.error_m @ [np.cos(towards), np.sin(towards)])
    assert abs(np.mean(along_m)) < 3.0 * np.std(along_m) / np.sqrt(len(along_m))


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_a_thickness_in_doubt_moves_the_centre_along_the_beams_alone(turn):
    along = np.array([np.cos(turn), np.sin(turn)])
    edge = SimpleNamespace(by_thickness_m=3e-5 * along, by_chamfer_m=None, by_round=None)
    variances, axes = np.linalg.eigh(_by_form(edge))
    assert variances[0] == pytest.approx(0.0, abs=1e-20)
    assert abs(axes[:, 1] @ along) == pytest.approx(1.0)
    assert variances[1] == pytest.approx((BY_THICKNESS * 3e-5) ** 2)
