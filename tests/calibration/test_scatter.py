"""Tests of the scatter of readings: variances of means by simulation, rounding, single ones."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from wheelplane.calibration.evaluate import factors_of
from wheelplane.calibration.scatter import (
    REPRODUCIBILITY,
    RESOLUTION,
    deviation_with,
    rounding_variance,
    scatter_of,
)
from wheelplane.measurement import estimate
from wheelplane.uncertainty import Effect


def cells(values):
    """Cells by point, level and direction of an array (P, L, D, n)."""
    return values.tolist()


def variance(scatter, resolution=0.0):
    return sum(effect.factor @ effect.factor.T for effect in scatter.effects(resolution))


def test_pooled_deviation_and_means_are_those_of_the_cells():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(4, 1, 2, 5))
    found = scatter_of(cells(values))
    np.testing.assert_allclose(found.errors, values.mean(axis=(1, 2, 3)))
    assert found.deviation == pytest.approx(math.sqrt(values.var(axis=3, ddof=1).mean()))
    assert found.dofs.sum() == 4 * 2 * 4
    (repeatability, _) = found.effects(0.0)
    np.testing.assert_allclose(
        np.diag(repeatability.factor) ** 2, found.deviation**2 / 10, rtol=1e-12
    )


@pytest.mark.parametrize(
    ("points", "levels", "ways", "count", "sigma", "step"),
    [(10, 1, 2, 3, 1.0, 0.0), (10, 1, 2, 3, 1.0, 3.0), (12, 3, 1, 1, 1.0, 0.0),
     (3, 2, 2, 2, 1.0, 0.0), (12, 1, 1, 20, 0.02, 1.0), (12, 1, 2, 5, 0.2, 1.0)],
)  # fmt: skip
def test_points_that_scatter_alike_are_hardly_ever_set_aside(
    points, levels, ways, count, sigma, step
):
    """One table in a thousand, by chance; of readings that lie on one step or two, none."""
    rng, tables = np.random.default_rng(3), 1000
    values = sigma * rng.normal(size=(tables, points, levels, ways, count))
    values += rng.uniform(0.0, 9.0, (tables, points, 1, 1, 1))
    values += (levels > 1) * rng.normal(size=(tables, 1, levels, 1, 1))
    if step:
        values = np.rint(values / step) * step
    alike = [scatter_of(cells(one), 0.0, step).alike for one in values]
    assert sum(not one.all() for one in alike) <= 5


@pytest.mark.parametrize(
    ("points", "levels", "ways", "count"), [(6, 1, 2, 3), (10, 1, 1, 3), (8, 6, 1, 1), (8, 3, 2, 3)]
)
def test_a_reading_far_off_is_set_aside_with_its_point_and_spoils_no_other(
    points, levels, ways, count
):
    """Two of them, too: what all others show is as without these points, but for a share 1/P."""
    rng = np.random.default_rng(4)
    values = rng.normal(size=(points, levels, ways, count))
    spoilt = values.copy()
    spoilt[[1, 4], 0, 0, 0] += 60.0
    found = scatter_of(cells(spoilt), 0.0, 0.1)
    assert np.flatnonzero(~found.alike).tolist() == [1, 4]
    kept = np.delete(np.arange(points), [1, 4])
    alone = scatter_of(cells(values[kept]), 0.0, 0.1)
    np.testing.assert_allclose(
        variance(found, 0.1)[np.ix_(kept, kept)], variance(alone, 0.1), rtol=1e-9, atol=1e-15
    )
    for point in (1, 4):
        shift = 60.0 / (levels * ways * count)
        assert variance(found, 0.1)[point, point] > 0.5 * shift**2
    if ways == 2:
        (found_of, effects), (alone_of, others) = (one.hysteresis(0.1) for one in (found, alone))
        np.testing.assert_allclose(found_of, alone_of)
        for one, other in zip(effects, others, strict=True):
            np.testing.assert_allclose(one.factor, other.factor)


def test_a_machine_without_scatter_keeps_its_resolution_beside_a_misread_value():
    values = np.full((12, 1, 2, 3), 5.0)
    values[3, 0, 0, 1] = 19.0
    found = scatter_of(cells(values), 0.0, 1.0)
    assert np.sqrt(variance(found, 1.0)[0, 0]) == pytest.approx(math.sqrt(1.0 / 12.0))


CROSSED = {
    (series, operators): [(str(s), str(o)) for s in range(series) for o in range(operators)]
    for series, operators in ((3, 3), (4, 2), (2, 4))
}
NESTED = [("0", "0"), ("1", "0"), ("2", "1"), ("3", "1")]  # each series by one operator


@pytest.mark.parametrize(
    ("levels", "of_series", "of_operators", "least"),
    [
        (CROSSED[3, 3], 1.0, 1.0, 0.95),
        (CROSSED[3, 3], 0.0, 0.0, 0.95),
        (CROSSED[4, 2], 0.0, 1.0, 0.87),  # nearly all from one degree of freedom
        (CROSSED[2, 4], 1.0, 0.0, 0.87),
        (NESTED, 0.0, 1.0, 0.87),
    ],
)
def test_what_series_and_operators_share_is_covered(levels, of_series, of_operators, least):
    """An operator's share does not average out over series, nor a series' over operators."""
    rng, count, points = np.random.default_rng(1), 300, 3
    series, operators = np.array(levels, int).T
    covered, squares = [], []
    for _ in range(count):
        shared = of_series * rng.normal(size=9)[series]
        shared = shared + of_operators * rng.normal(size=9)[operators]
        values = 0.2 * rng.normal(size=(points, len(levels), 1, 3)) + shared[:, None, None]
        found = scatter_of(values.tolist(), 0.0, 0.0, factors_of(levels))
        known = estimate(0.0, np.eye(points)[0], found.effects(0.0))
        covered.append(abs(found.errors[0]) <= known.expanded)
        squares.append((known.u**2, found.errors[0] ** 2))
    spread = 3.0 * math.sqrt(least * (1.0 - least) / count)
    assert np.mean(covered) > least - spread
    stated, seen = np.mean(squares, axis=0)
    assert 0.75 < stated / seen < 1.7


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ([("1", "")], ()),
        ([("1", ""), ("2", "")], ()),
        ([("1", "a"), ("1", "b")], ()),
        ([("1", "a"), ("2", "b")], ()),
        ([("1", "a"), ("2", "a"), ("3", "b")], ((0, 0, 1),)),
        ([("1", "a"), ("1", "b"), ("2", "c")], ((0, 0, 1),)),
        ([("1", "a"), ("1", "b"), ("2", "a"), ("2", "b")], ((0, 0, 1, 1), (0, 1, 0, 1))),
    ],
)
def test_levels_share_what_several_of_them_have_in_common(levels, expected):
    assert factors_of(levels) == expected


def test_two_crossed_factors_without_effect_state_the_repeatability_once():
    rng, points = np.random.default_rng(2), 300
    found = scatter_of(
        rng.normal(size=(points, 9, 1, 2)).tolist(), 0.0, 0.0, factors_of(CROSSED[3, 3])
    )
    own = sum(np.sum(e.factor[0] ** 2) for e in found.effects(0.0) if e.name != REPRODUCIBILITY)
    assert own == pytest.approx(1.0 / 18.0, rel=5.0 * math.sqrt(2.0 / 600.0))


def test_a_point_that_scatters_alone_has_the_scatter_between_its_operators():
    levels = CROSSED[4, 2]
    values = np.random.default_rng(3).normal(scale=1e-3, size=(8, 8, 1, 2))
    values[2, [int(o) == 1 for _, o in levels]] += 1.0
    found = scatter_of(values.tolist(), 0.0, 0.0, factors_of(levels))
    assert np.flatnonzero(~found.alike).tolist() == [2]
    assert math.sqrt(variance(found)[2, 2]) == pytest.approx(0.5, rel=0.01)  # 1/2 to each side


@pytest.mark.slow
@pytest.mark.parametrize("levels", [1, 4])
def test_the_stated_covariance_of_means_is_that_of_many_experiments(levels):
    rng = np.random.default_rng(1)
    points, count = 5, 4000
    common = rng.normal(0.0, 0.7 * (levels > 1), (count, 1, levels, 1, 1))
    own = rng.normal(0.0, 0.4 * (levels > 1), (count, points, levels, 1, 1))
    values = common + own + rng.normal(0.0, 1.0, (count, points, levels, 2, 3))
    found = [scatter_of(cells(one)) for one in values]
    stated = np.mean([variance(one) for one in found], axis=0)
    seen = np.cov([one.errors for one in found], rowvar=False)
    bound = 5.0 * math.sqrt(2.0 / count) * np.diag(seen).mean()
    np.testing.assert_allclose(stated, seen, atol=bound)
    if levels > 1:
        assert seen[0, 1] > 0.05  # what is common to a series does not average out over points


def test_one_point_in_several_series_has_the_scatter_of_their_means():
    values = np.array([[[[1.0, 2.0]], [[4.0, 5.0]], [[2.0, 2.0]]]])
    found = scatter_of(cells(values))
    assert variance(found)[0, 0] == pytest.approx(np.var([1.5, 4.5, 2.0], ddof=1) / 3)


def test_single_readings_in_one_series_have_no_deviation():
    assert math.isnan(scatter_of([[[[1.0]]], [[[2.0]]]]).deviation)


@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.2, 0.35, 0.5, 1.0, 3.0])
def test_rounding_leaves_the_variance_that_simulation_finds(sigma):
    rng = np.random.default_rng(2)
    phases, count = 4000, 400
    true = rng.uniform(-0.5, 0.5, phases)
    seen = np.round(true[:, None] + sigma * rng.normal(size=(phases, count)))
    scatter = seen.var(axis=1, ddof=1)
    left = np.mean((seen.mean(axis=1) - true) ** 2) - np.mean(scatter) / count
    found = rounding_variance(math.sqrt(np.mean(scatter)), 1.0)
    assert found == pytest.approx(left, abs=0.003)
    assert rounding_variance(7.0 * math.sqrt(np.mean(scatter)), 7.0) == pytest.approx(49.0 * found)


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.2])
@pytest.mark.parametrize(("weights", "name"), [([0.5, 0.5], "mean"), ([1.0, -1.0], "difference")])
def test_rounding_of_two_directions_depends_on_the_part_of_a_step_between_them(
    sigma, weights, name
):
    """A mean is rounded less, a difference more, the nearer the directions lie to half a step."""
    rng = np.random.default_rng(6)
    phases, count, found = 4000, 400, []
    true = rng.uniform(-0.5, 0.5, (phases, 1, 1))
    for apart in (0.0, 0.3, 0.5):
        ways = np.array([[0.5 * apart], [-0.5 * apart]])
        seen = np.round(true + ways + sigma * rng.normal(size=(phases, 2, count)))
        scatter = seen.var(axis=2, ddof=1)
        off = (seen.mean(axis=2) - true[:, :, 0] - ways.T) @ weights
        left = np.mean(off**2) - np.mean(scatter) * np.sum(np.square(weights)) / count
        deviation = math.sqrt(np.mean(scatter))
        offsets = np.array([apart, 0.0])
        found.append(rounding_variance(deviation, 1.0, np.array(weights), offsets))
        assert found[-1] == pytest.approx(left, abs=0.004)
    assert found == sorted(found, reverse=name == "mean")
    if sigma == 0.0:
        known = {"mean": 1.0 / 48.0, "difference": 1.0 / 4.0}[name]
        assert found[-1] == pytest.approx(known)


@pytest.mark.parametrize("hysteresis", [0.0, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("scatter", [0.0, 0.1, 0.2])
def test_means_of_two_directions_are_covered_whatever_the_hysteresis(hysteresis, scatter):
    """Twelve points, three readings each way in whole steps, u of the reference 0.13 of them."""
    rng, count, covered, whole = np.random.default_rng(7), 150, [], []
    own = Effect("reference", 0.13 * np.eye(12), math.inf, False)
    for _ in range(count):
        true = rng.uniform(0.0, 1.0, (12, 1, 1, 1))
        ways = np.array([0.5, -0.5]).reshape(1, 1, 2, 1) * hysteresis
        seen = np.round(true + ways + scatter * rng.standard_normal((12, 1, 2, 3)))
        references = true[:, :, 0, 0] + 0.13 * rng.standard_normal((12, 1))
        found = scatter_of(seen.tolist(), references, 1.0)
        effects = [own, *found.effects(1.0)]
        bound = estimate(0.0, np.eye(12)[0], effects).expanded
        covered.append(np.mean(np.abs(found.errors) <= bound))
        plain = math.hypot(0.13, found.deviation / math.sqrt(6.0), math.sqrt(1.0 / 12.0))
        whole.append(np.mean(np.abs(found.errors) <= 1.96 * plain))
    spread = 3.0 * np.std(covered, ddof=1) / math.sqrt(count)
    assert 0.94 - spread < np.mean(covered) < 0.97 + spread
    assert hysteresis == 0.0 or np.mean(whole) > 0.98


def test_rounding_that_differs_from_series_to_series_counts_once():
    """Its scatter is that of the series already; counted besides, it would be twice as much."""
    rng, stated, seen, points = np.random.default_rng(8), [], [], 60
    for _ in range(100):
        true = rng.uniform(0.0, 1.0, (points, 1, 1, 1))
        offsets = rng.uniform(0.0, 3.0, (1, 6, 1, 1))
        values = np.round(true + offsets + np.zeros((points, 6, 1, 2)))
        found = scatter_of(cells(values), true[:, :, 0, 0] * np.ones((1, 6)), 1.0)
        effects = [e for e in found.effects(1.0) if e.name != REPRODUCIBILITY]
        stated.append(sum(np.sum(e.factor[0] ** 2) for e in effects))
        seen.append(np.var(found.errors, ddof=1))
    assert np.mean(seen) == pytest.approx(1.0 / 12.0 / 6.0, rel=0.15)
    assert 0.95 < np.mean(stated) / np.mean(seen) < 1.5


def test_rounding_that_all_series_share_stays_whole():
    true = np.linspace(0.0, 0.9, 10).reshape(10, 1, 1, 1)
    found = scatter_of(cells(np.round(true + np.zeros((10, 4, 1, 2)))), 0.0, 1.0)
    (rounded,) = (e for e in found.effects(1.0) if e.name == RESOLUTION)
    assert rounded.factor[0, 0] ** 2 == pytest.approx(1.0 / 12.0)


def test_four_differences_of_half_a_step_cover_it_unless_all_are_alike():
    """Each is shown as none or a step with equal chance: 14 of 16 ways are covered, 87.5 %."""
    covered = []
    for shown in itertools.product((0.0, 1.0), repeat=4):
        values = np.array([[[[way, way], [0.0, 0.0]]] for way in shown])
        differences, effects = scatter_of(cells(values), 0.0, 1.0).hysteresis(1.0)
        known = estimate(float(differences.mean()), np.full(4, 0.25), effects)
        covered.append(abs(known.value - 0.5) <= known.expanded)
        assert covered[-1] == (0.0 < known.value < 1.0)
    assert sum(covered) == 14


def test_rounding_without_scatter_is_a_twelfth_and_without_a_step_nothing():
    assert rounding_variance(0.0, 2.0) == pytest.approx(4.0 / 12.0)
    assert rounding_variance(math.nan, 2.0) == pytest.approx(4.0 / 12.0)
    assert rounding_variance(1.0, 0.0) == 0.0


def test_hysteresis_is_the_mean_difference_of_directions():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(6, 2, 2, 3))
    values[:, :, 0] += 2.0
    found = scatter_of(cells(values))
    differences, effects = found.hysteresis(0.0)
    np.testing.assert_allclose(
        differences, (values[:, :, 0] - values[:, :, 1]).mean(axis=(1, 2)), rtol=1e-12
    )
    of_levels = (values[:, :, 0] - values[:, :, 1]).mean(axis=(0, 2))
    known = estimate(0.0, np.full(6, 1.0 / 6.0), effects)
    assert known.u == pytest.approx(of_levels.std(ddof=1) / math.sqrt(2.0))
    assert known.dof == pytest.approx(1.0)
    alone = scatter_of(cells(values[:, :1]))
    known = estimate(0.0, np.full(6, 1.0 / 6.0), alone.hysteresis(0.0)[1])
    assert known.u == pytest.approx(alone.deviation * math.sqrt(2.0 / 18.0))


@pytest.mark.parametrize(
    ("common", "own", "count"), [(0.0, 0.0, 3), (0.5, 0.0, 3), (0.0, 0.5, 3), (0.5, 0.5, 1)]
)
def test_a_hysteresis_that_differs_from_series_to_series_is_covered(common, own, count):
    """All points alike, and each alone; single readings as well, which nothing else shows."""
    rng, covered, draws = np.random.default_rng(13), [], 300
    half = np.array([0.5, -0.5]).reshape(1, 1, 2, 1)
    for _ in range(draws):
        apart = 1.0 + common * rng.normal(size=(1, 3, 1, 1)) + own * rng.normal(size=(6, 3, 1, 1))
        values = half * apart + 0.2 * rng.normal(size=(6, 3, 2, count))
        differences, effects = scatter_of(cells(values)).hysteresis(0.0)
        mean = np.full(len(differences), 1.0 / len(differences))
        known = estimate(float(differences.mean()), mean, effects)
        covered.append(abs(known.value - 1.0) <= known.expanded)
    assert abs(np.mean(covered) - 0.95) < 3.0 * math.sqrt(0.95 * 0.05 / draws)


def test_rounded_hystereses_that_are_alike_by_chance_keep_their_rounding():
    """Three series that show the same in whole steps do not show the part of one beyond it."""
    found = scatter_of(np.ones((1, 3, 2, 2)).tolist(), 0.0, 1.0)
    known = estimate(0.0, np.ones(1), found.hysteresis(1.0)[1])
    assert known.u == pytest.approx(math.sqrt(2.0 / 12.0))


@pytest.mark.parametrize("own", [0.0, 0.1, 0.3])
def test_u_of_rounded_readings_covers_95_percent_of_all_phases(own):
    """A machine without scatter, own: u of the reference in steps; k is that of the convolution."""
    phases, rng = 4000, np.random.default_rng(4)
    true = (np.arange(phases) + 0.5) / phases
    shown = np.round(true) - true + own * rng.standard_normal(phases)
    effects = scatter_of([[[[1.0, 1.0, 1.0]]]]).effects(1.0)
    effects.append(Effect("reference", np.array([[own]]), math.inf, False))
    found = estimate(0.0, np.ones(1), effects)
    spread = 2.6 * math.sqrt(0.95 * 0.05 / phases)
    assert np.mean(np.abs(shown) <= found.expanded) == pytest.approx(0.95, abs=spread)
    k = found.expanded / found.u
    assert 0.95 * math.sqrt(3.0) * (1 - 1e-9) <= k < 1.94
    if own < 0.2:
        assert np.mean(np.abs(shown) <= 1.96 * found.u) > 0.95 + 2 * spread


def test_the_hysteresis_of_one_point_has_two_rectangles():
    _, effects = scatter_of([[[[1.0, 1.0], [2.0, 2.0]]]]).hysteresis(1.0)
    found = estimate(1.0, np.ones(1), effects)
    assert found.u == pytest.approx(math.sqrt(2.0 / 12.0))
    assert found.expanded == pytest.approx((1.0 - math.sqrt(0.05)) * 1.0, rel=0.01)  # triangle


@pytest.mark.parametrize("hysteresis", [0.5, 1.3, 1.8])
def test_a_hysteresis_that_is_no_whole_step_is_covered_at_several_points(hysteresis):
    """Twelve points without scatter: all share the part of a step by which it is rounded."""
    rng, covered, plain, count = np.random.default_rng(5), 0, 0, 400
    for _ in range(count):
        true = rng.uniform(0.0, 1.0, (12, 1, 1, 1))
        ways = np.array([0.5, -0.5]).reshape(1, 1, 2, 1) * hysteresis
        found = scatter_of(np.repeat(np.round(true + ways), 2, axis=3).tolist(), 0.0, 1.0)
        differences, effects = found.hysteresis(1.0)
        known = estimate(float(differences.mean()), np.full(12, 1.0 / 12.0), effects)
        covered += abs(known.value - hysteresis) <= known.expanded
        plain += abs(known.value - hysteresis) <= 1.96 * math.sqrt(1.0 / 6.0 / 12.0)
    spread = 3.0 * math.sqrt(0.95 * 0.05 / count)
    assert covered / count > 0.95 - spread
    if hysteresis == 0.5:
        assert plain / count < 0.95 - spread


@pytest.mark.slow
@pytest.mark.parametrize(
    ("levels", "hysteresis"),
    [(10, 0.0), (10, None), (4, 0.0), (1, None)],
)
@pytest.mark.parametrize("scatter", [0.0, 0.1])
def test_few_points_of_an_exact_reference_are_covered(levels, hysteresis, scatter):
    """Twelve points show the rounding that all series share by the few near the edge of a step."""
    rng, count, covered, bounds = np.random.default_rng(9), 200, [], []
    for _ in range(count):
        apart = rng.uniform(0.0, 2.0) if hysteresis is None else hysteresis
        true = rng.uniform(0.0, 1.0, (12, 1, 1, 1))
        ways = np.array([0.5, -0.5]).reshape(1, 1, 2, 1) * apart
        seen = np.round(true + ways + scatter * rng.standard_normal((12, levels, 2, 3)))
        found = scatter_of(seen.tolist(), true[:, :, 0, 0] * np.ones((1, levels)), 1.0)
        bound = estimate(0.0, np.eye(12)[0], found.effects(1.0)).expanded
        covered.append(np.mean(np.abs(found.errors) <= bound))
        bounds.append(bound)
    spread = 3.0 * np.std(covered, ddof=1) / math.sqrt(count)
    assert np.mean(covered) > 0.94 - spread
    assert scatter == 0.0 or np.mean(bounds) < 0.42  # whole, it would be 0.475


def test_the_variance_over_all_series_is_that_of_single_readings():
    rng = np.random.default_rng(10)
    shifts = 0.7 * rng.normal(size=(3000, 5, 1, 1))
    found = scatter_of((shifts + rng.normal(size=(3000, 5, 2, 2))).tolist())
    assert found.variances.mean() == pytest.approx(1.49, abs=5.0 * 1.49 / math.sqrt(3000))


def test_directions_half_a_step_apart_do_not_hide_the_variance_of_readings():
    """Their mean is rounded less than each, so that it differs less between series."""
    rng, points = np.random.default_rng(12), 3000
    true, shifts = rng.uniform(0.0, 1.0, (points, 1, 1, 1)), rng.normal(size=(points, 4, 1, 1))
    ways = np.array([0.25, -0.25]).reshape(1, 1, 2, 1)
    found = scatter_of(
        np.round(true + 0.3 * shifts + ways + np.zeros((1, 1, 1, 2))).tolist(), 0.0, 1.0
    )
    known, bound = deviation_with(0.0, 1.0, 0.3) ** 2, 5.0 / math.sqrt(points)
    assert abs(found.variances.mean() - known) < bound * found.variances.std(ddof=1)
    of_means = np.var(found.means.mean(axis=2), axis=1, ddof=1)
    assert abs(of_means.mean() - known) > bound * of_means.std(ddof=1)


@pytest.mark.parametrize("between", [0.0, 0.3])
def test_the_planned_deviation_is_that_of_rounded_readings_of_all_series(between):
    rng = np.random.default_rng(11)
    spread = math.hypot(0.2, between)
    true, noise = rng.uniform(0.0, 1.0, (20000, 1)), rng.standard_normal((20000, 20))
    one, all_of = (np.round(true + sigma * noise).var(axis=1, ddof=1).mean()
                   for sigma in (0.2, spread))  # fmt: skip
    found = deviation_with(math.sqrt(one), 1.0, between)
    assert found == pytest.approx(math.sqrt(all_of), rel=0.01)
    assert deviation_with(3.0, 0.0, 4.0) == 5.0


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_equal_readings_do_not_scatter_by_the_rounding_of_their_means(levels):
    """Without a resolution, nothing else hides that the mean of three equal numbers is another."""
    rng = np.random.default_rng(levels)
    for _ in range(100):
        values = np.radians(rng.integers(-60, 60, 6) / 60.0)
        cells = [[[[value] * 3] for _ in range(levels)] for value in values]
        assert scatter_of(cells).alike.all()
        cells[2][0][0][1] += math.radians(0.1 / 60.0)
        assert not scatter_of(cells).alike[2]
