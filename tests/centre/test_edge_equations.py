"""Normal equations of an edge, against dense matrices with an unknown for each zone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize, stats
from scipy.linalg import block_diag, sqrtm

from wheelplane.centre.edge.beams import GROWTH, INVERSE, RATIO, SIZE_M, STATE, Background, Prior
from wheelplane.centre.edge.edge_residuals import (
    ALIKE_LOG,
    CHANCE,
    GAMMA_SIGMA,
    LEAST_CHANGE,
    LEAST_SHOWN,
    LEAST_UNEVEN,
    LIMIT,
    LIT_LOG,
    SECTORS,
    UNEVEN_MEAN,
    UNEVEN_SECTORS,
    UNEVEN_SHARE,
    ZONE_LOG,
    ZONES,
    EdgeProblem,
    Equations,
    Zones,
    _variance,
    power_of_light,
    robust_weight,
    spread,
    step,
    stretched,
    zone_scatter,
)
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, rectangle

POINTS, STATES = 1500, STATE


def drawn(seed=0, scatter=0.5, share=None, size=1.0):
    """Equations of random slopes, weights and residuals; prior and state."""
    rng = np.random.default_rng(seed)
    weight = rng.uniform(0.2, 1.5, POINTS)
    linear = Equations(
        q_m=rng.normal(size=(POINTS, 2)),
        share=rng.random(POINTS) if share is None else share,
        residual_m=size * rng.normal(size=POINTS),
        slopes=rng.normal(size=(POINTS, STATES)) + 0.3,
        weight=weight,
        change=weight * rng.uniform(0.7, 1.0, POINTS),
        by_height=rng.uniform(0.2, 1.0, POINTS),
        zones=Zones(0.1 * rng.normal(size=ZONES), scatter),
        depths=POINTS,
    )
    prior = Prior(0.01 * rng.normal(size=STATES), rng.uniform(10.0, 60.0, STATES))
    state = 0.01 * rng.normal(size=STATES)
    for at in (prior.mean, state):
        at[INVERSE] += 2.0  # the scanner is before the plane
    return linear, prior, state


def dense(linear, prior):
    """Slopes (N, 12 + ZONES) by the state and by each zone, and the diagonal of the prior."""
    zone = np.floor(linear.share * ZONES).astype(int)
    by_zone = linear.slopes[:, RATIO, None] * (zone[:, None] == np.arange(ZONES))
    known = np.append(prior.weight, np.full(ZONES, 1.0 / linear.zones.sigma**2))
    return np.column_stack([linear.slopes, by_zone]), known


def of_sectors(off, variance=1e-6):
    """Equations of rows of residuals over their standard uncertainties, by sector: K lists."""
    share = np.concatenate([np.full(len(z), (k + 0.5) / UNEVEN_SECTORS) for k, z in enumerate(off)])
    z = np.concatenate(off)
    linear, _, _ = drawn()
    weight, change = robust_weight(z**2, converged=True)
    values = {
        "share": share,
        "residual_m": z * variance**0.5,
        "weight": weight / variance,
        "change": change / variance,
        "slopes": np.ones((len(z), STATES)),
    }
    return replace(linear, **values, depths=len(z))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_sectors_off_on_one_side_or_with_outliers_are_uneven(sign):
    """Whatever the scale; where enough points show it."""
    some, few = 5 * LEAST_UNEVEN, LEAST_UNEVEN - 1
    wide = sign * np.linspace(-3.0, 3.0, some)  # symmetrical
    one = 1.01 / some
    lost = [round((UNEVEN_SHARE + by) * some) for by in (-one, one)]
    cases = [
        (wide, False),
        (wide + sign * 0.9 * UNEVEN_MEAN, False),
        (wide + sign * 1.1 * UNEVEN_MEAN, True),
        (np.full(few, sign), False),
        (np.full(few + 1, sign), True),
        (np.append(wide[lost[0] :] - wide[lost[0] :].mean(), [9.0] * lost[0]), False),
        (np.append(wide[lost[1] :] - wide[lost[1] :].mean(), [9.0] * lost[1]), True),
        (np.zeros(0), False),
    ]
    off = [z for z, _ in cases] + [np.zeros(some)] * (UNEVEN_SECTORS - len(cases))
    expected = [uneven for _, uneven in cases] + [False] * (UNEVEN_SECTORS - len(cases))
    for variance in (1e-8, 1.0):
        np.testing.assert_array_equal(of_sectors(off, variance).uneven(), expected)
    held = replace(of_sectors(off), slopes=np.zeros((sum(map(len, off)), STATES)))
    assert not held.uneven().any()  # points that depend on nothing show nothing


@pytest.mark.parametrize("size", [0.003, 20.0])
def test_a_step_is_that_of_all_unknowns_at_once_and_of_limited_length(size):
    linear, prior, state = drawn(seed=2, size=size)
    slopes, known = dense(linear, prior)
    here = np.append(state - prior.mean, linear.zones.log)
    gradient = slopes.T @ (linear.weight * linear.residual_m) - known * here
    whole = np.linalg.solve((slopes.T * linear.weight) @ slopes + np.diag(known), gradient)
    moved, zones = step(linear, state, prior)
    length = min(1.0, np.min(LIMIT / np.abs(whole[:STATES])))
    assert (length < 1.0) == (size > 1.0)
    np.testing.assert_allclose(moved, length * whole[:STATES], rtol=1e-9)
    left = gradient[STATES:] - slopes[:, STATES:].T @ (linear.weight * (linear.slopes @ moved))
    own = np.sum(linear.weight[:, None] * slopes[:, STATES:] ** 2, axis=0) + known[STATES:]
    by_step = np.clip(left / own, -0.5, 0.5)
    assert (np.abs(left / own).max() > 0.5) == (size > 1.0)
    np.testing.assert_allclose(zones.log - linear.zones.log, by_step, atol=1e-12)
    assert zones.sigma == linear.zones.sigma
    if size < 1.0:
        np.testing.assert_allclose(by_step, whole[STATES:], atol=1e-12)


@pytest.mark.parametrize("pull", [0.0, -0.003])
def test_a_step_keeps_the_scanner_before_the_plane(pull):
    """It ends at parallel beams then, and all else goes where it would with these."""
    linear, prior, state = drawn(seed=2, size=1e-4)
    state[INVERSE], prior.mean[INVERSE] = 0.001, 0.002
    beyond = linear.residual_m + pull * linear.slopes[:, INVERSE]
    linear = replace(linear, residual_m=beyond, zones=Zones.alike())
    moved, _ = step(linear, state, prior, ahead=True)
    held = np.arange(STATES) == INVERSE
    expected = moved[INVERSE] if pull == 0.0 else -0.001
    assert moved[INVERSE] == pytest.approx(expected, rel=1e-9)
    assert state[INVERSE] + moved[INVERSE] >= 0.0
    slopes, known = linear.slopes[:, ~held], np.diag(prior.weight[~held])
    left = linear.residual_m - linear.slopes[:, INVERSE] * moved[INVERSE]
    gradient = slopes.T @ (linear.weight * left) - known @ (state - prior.mean)[~held]
    others = np.linalg.solve((slopes.T * linear.weight) @ slopes + known, gradient)
    np.testing.assert_allclose(moved[~held], others, rtol=2e-3, atol=1e-7)


def test_a_step_of_nothing_is_no_step():
    linear, prior, _ = drawn(size=0.0)
    linear = replace(linear, zones=Zones.alike())
    moved, zones = step(linear, prior.mean, prior)
    assert not moved.any()
    assert not zones.log.any()


def test_newton_steps_end_where_the_estimating_equations_do_and_sooner():
    """Residuals are straight lines here: only the weights of Tukey's function change."""
    drawn_once, prior, _ = drawn(size=1.5)
    first = replace(drawn_once, zones=Zones.alike())

    def at(state):
        residual_m = first.residual_m - first.slopes @ (state - prior.mean)
        weight, change = robust_weight(residual_m**2, True)
        return replace(first, residual_m=residual_m, weight=weight, change=change)

    root = prior.mean
    for _ in range(200):
        root = root + step(at(root), root, prior, newton=True)[0]
    linear = at(root)
    gradient = linear.slopes.T @ (linear.weight * linear.residual_m)
    np.testing.assert_allclose(gradient, prior.weight * (root - prior.mean), rtol=1e-4)
    assert np.count_nonzero(linear.weight == 0.0) > 0
    left = {}
    begin = root + 1e-4 * np.random.default_rng(1).normal(size=STATES)
    for newton in (False, True):
        moved, _ = step(at(begin), begin, prior, newton=newton)
        left[newton] = np.abs(begin + moved - root).max() / np.abs(begin - root).max()
    assert left[True] < 0.01
    assert left[False] > 0.1


def weighed_by_cauchy(linear, scatter):
    """The same points, whose residuals are Gaussian, of that scatter, and weighed by Cauchy's."""
    z = scatter * np.random.default_rng(5).normal(size=POINTS)
    weight = linear.weight / (1.0 + z**2 / 4.0)
    return replace(linear, residual_m=z / np.sqrt(linear.weight), weight=weight, change=weight)


def gaussian_loss(scatter):
    """Expected loss 2 log(1 + z^2 / 4) of Gaussian residuals, by quadrature."""

    def part(z):
        return stats.norm.pdf(z, scale=scatter) * 2.0 * math.log1p(z**2 / 4.0)

    return integrate.quad(part, -12.0 * scatter, 12.0 * scatter, points=[0.0])[0]


@pytest.mark.parametrize("scatter", [0.3, 1.0, 4.0])
def test_the_loss_is_cauchy_s(scatter):
    """Points without weight do not count, and no residual is infinitely many."""
    linear = weighed_by_cauchy(drawn()[0], scatter)
    z = scatter * np.random.default_rng(5).normal(size=POINTS)
    assert linear.loss == pytest.approx(np.mean(2.0 * np.log1p(z**2 / 4.0)))
    left = replace(linear, weight=np.where(np.arange(POINTS) < 20, linear.weight, 0.0))
    assert left.loss == pytest.approx(np.mean(2.0 * np.log1p(z[:20] ** 2 / 4.0)))
    far = replace(linear, residual_m=np.full(POINTS, 2.0), weight=np.ones(POINTS))
    assert 20.0 < far.loss < 100.0


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("outline", [Circle(0.125), rectangle(0.3, 0.2)], ids=["disc", "plate"])
def test_few_points_have_the_covariance_of_all_unknowns_and_of_student_s_t(outline, mixed):
    linear, prior, _ = drawn(size=1.7)
    linear = replace(linear, change=linear.weight, depths=POINTS if mixed else POINTS - 5)
    if mixed:
        linear = weighed_by_cauchy(linear, 1.7)
    slopes, known = dense(linear, prior)
    data = (slopes.T * linear.weight) @ slopes
    inverse = np.linalg.inv(data + np.diag(known))
    covariance, by_plane, dof = spread(linear, outline, prior, few=True)
    assert dof == pytest.approx(outline.axis_share * (SECTORS - 2 - outline.shows_rotation))
    square = np.sum(linear.weight * linear.residual_m**2) / (POINTS - STATES)
    if mixed:
        of_loss = optimize.brentq(lambda scatter: gaussian_loss(scatter) - linear.loss, 0.5, 10.0)
        square = of_loss**2
    assert square > 1.5
    scale = square * dof / (dof - 2.0)
    expected = inverse @ (np.diag(known) + scale * data) @ inverse
    rtol = 2e-4 if mixed else 1e-7  # by a table
    np.testing.assert_allclose(covariance, expected[:STATES, :STATES], rtol=rtol, atol=1e-11)
    lift = linear.by_height[:, None] * np.column_stack([np.ones(POINTS), linear.q_m])
    expected = inverse @ (slopes.T * linear.weight) @ lift
    np.testing.assert_allclose(by_plane, expected[:STATES], rtol=1e-7, atol=1e-12)


def test_few_quiet_points_are_no_better_than_their_stated_noise():
    linear, prior, _ = drawn()
    outline = Circle(0.1)
    for share in (linear.share, np.full(POINTS, 0.3)):  # all sectors, and one
        quiet = replace(linear, residual_m=0.1 * linear.residual_m, share=share)
        quiet = replace(quiet, change=quiet.weight)
        slopes, known = dense(quiet, prior)
        data = (slopes.T * quiet.weight) @ slopes
        covariance, _, dof = spread(quiet, outline, prior, few=True)
        free = max(dof, 3.0)  # fewer have no variance
        scale = free / (free - 2.0)
        inverse = np.linalg.inv(data + np.diag(known))
        expected = inverse @ (np.diag(known) + scale * data) @ inverse
        np.testing.assert_allclose(covariance, expected[:STATES, :STATES], rtol=1e-7, atol=1e-12)


def test_a_point_without_weight_is_none():
    linear, prior, _ = drawn(size=2.0)
    rng = np.random.default_rng(5)
    left = np.sort(rng.permutation(POINTS)[:400])  # all sectors hold some
    weight = np.zeros(POINTS)
    weight[left] = linear.weight[left]
    shown = replace(linear, weight=weight, change=weight)
    alone = replace(
        shown,
        depths=len(left),
        **{
            name: getattr(shown, name)[left]
            for name in ("q_m", "share", "residual_m", "slopes", "weight", "change", "by_height")
        },
    )
    for few in (False, True):
        both = (spread(one, Circle(0.1), prior, few)[0] for one in (shown, alone))
        np.testing.assert_allclose(*both, rtol=1e-9, atol=1e-15)
    assert zone_scatter(shown, prior) == pytest.approx(zone_scatter(alone, prior), rel=1e-9)


def test_the_covariance_is_that_of_bell_and_mccaffrey_with_the_zones_as_unknowns():
    """Scores of a sector over the symmetric root of 1 - H, H its share of the information."""
    linear, prior, _ = drawn(1)
    slopes, known = dense(linear, prior)
    full = (slopes.T * linear.weight) @ slopes + np.diag(known)
    cross = full[:STATES, STATES:] @ np.linalg.inv(full[STATES:, STATES:])
    free = slopes[:, :STATES] - slopes[:, STATES:] @ cross.T
    apart = block_diag(np.diag(known[:STATES])) + cross @ np.diag(known[STATES:]) @ cross.T
    information = (free.T * linear.weight) @ free + apart
    np.testing.assert_allclose(np.linalg.inv(full)[:STATES, :STATES], np.linalg.inv(information))
    root = np.linalg.cholesky(information)
    squares = apart.copy()
    for k in range(SECTORS):
        rows = np.floor(linear.share * SECTORS) == k
        taken = (free[rows].T * linear.weight[rows]) @ free[rows]
        within = np.linalg.inv(root) @ taken @ np.linalg.inv(root).T
        assert np.linalg.eigvalsh(within).max() < 0.5
        over = np.linalg.inv(np.real(sqrtm(np.eye(STATES) - within)))
        pull = free[rows].T @ (linear.weight * linear.residual_m)[rows]
        score = root @ over @ np.linalg.inv(root) @ pull
        squares += np.outer(score, score)
    change = (free.T * linear.change) @ free + apart
    inverse = np.linalg.inv(change)
    covariance, by_plane, _ = spread(linear, Circle(0.125), prior)
    np.testing.assert_allclose(covariance, inverse @ squares @ inverse, rtol=1e-6, atol=1e-10)
    lift = linear.by_height[:, None] * np.column_stack([np.ones(POINTS), linear.q_m])
    expected = inverse @ (free.T * linear.change) @ lift
    np.testing.assert_allclose(by_plane, expected, rtol=1e-6, atol=1e-10)


def test_a_sector_that_shows_all_alone_has_no_endless_uncertainty():
    linear, prior, _ = drawn(2, share=np.full(POINTS, 0.3))
    prior = replace(prior, weight=np.full(STATES, 1e-9))
    covariance, _, dof = spread(linear, Circle(0.125), prior)
    assert dof == Circle(0.125).axis_share  # one sector less two, at least 1
    few, _, _ = spread(replace(linear, change=linear.weight), Circle(0.125), prior, few=True)
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-12)
    assert np.trace(covariance) < 1.0
    assert np.trace(few) < 1.0


def test_slopes_of_the_influence_keep_a_share_of_the_information():
    """Without any slope that share is left; the reflectance ratio is partly that of the zones."""
    linear, prior, _ = drawn(3)
    prior, others = replace(prior, weight=np.full(STATES, 1e-9)), np.arange(STATES) != RATIO
    whole, none = (
        spread(replace(linear, change=change), Circle(0.1), prior)[0][others][:, others]
        for change in (linear.weight, 0.0 * linear.weight)
    )
    np.testing.assert_allclose(np.diag(none) * LEAST_CHANGE**2, np.diag(whole), rtol=1e-3)


@pytest.mark.parametrize("unlike", [0.0, 0.8])
def test_the_scatter_of_zones_is_that_of_moments_from_two_fits(unlike):
    """Chi-squares of all residuals with and without zones, by least squares of numpy."""
    linear, prior, _ = drawn(4, scatter=1.0)
    rng = np.random.default_rng(6)
    share = rng.random(POINTS) * (1.0 - 1.5 / ZONES)  # the last zone is empty
    linear = replace(linear, share=share, zones=Zones(np.zeros(ZONES), 1.0))
    slopes, known = dense(linear, prior)
    weak = slopes[:, STATES:].any(axis=0)
    root = np.sqrt(linear.weight)
    residual = linear.residual_m / root + slopes[:, STATES:] @ (unlike * rng.normal(size=ZONES))
    A = np.vstack([root[:, None] * slopes, np.diag(np.sqrt(known))])
    b = np.append(root * residual, np.zeros(STATES + ZONES))
    plain = np.r_[0:POINTS, POINTS : POINTS + STATES]
    first = A[plain][:, :STATES]
    solved = np.linalg.lstsq(first, b[plain], rcond=None)[0]
    # At the solution without zones; the prior's pull is part of it.
    left = b[plain] - first @ solved
    linear = replace(linear, residual_m=left[:POINTS] / root)
    with_zones = A[plain][:, np.append(np.ones(STATES, bool), weak)]
    rest = left - with_zones @ np.linalg.lstsq(with_zones, left, rcond=None)[0]
    explained = left @ left - rest @ rest
    variance = np.mean(left[:POINTS] ** 2)
    inverse = np.linalg.inv(with_zones.T @ with_zones)[STATES:, STATES:]
    count = int(np.count_nonzero(weak))
    beyond = explained - (count + CHANCE * math.sqrt(2.0 * count)) * variance
    expected = math.sqrt(max(beyond, 0.0) / np.trace(np.linalg.inv(inverse)))
    assert zone_scatter(linear, prior) == pytest.approx(expected, rel=1e-3, abs=1e-9)
    assert (0.5 < expected < 1.1) if unlike else expected < 0.1


def test_a_zone_that_hardly_shows_its_reflectance_does_not_count():
    linear, prior, _ = drawn(4)
    zone = np.floor(linear.share * ZONES).astype(int)
    there, unlike = zone == 7, np.random.default_rng(7).normal(size=ZONES)[zone]
    assert LEAST_SHOWN > 0.03**2
    scatters = []
    for size in (0.0, 0.03):
        slopes = np.where(there[:, None], 0.0, linear.slopes)
        slopes[there, RATIO] = size
        residual = linear.residual_m + np.where(there, 5.0, unlike * slopes[:, RATIO])
        scatters.append(zone_scatter(replace(linear, slopes=slopes, residual_m=residual), prior))
    assert scatters[0] == pytest.approx(scatters[1], rel=1e-3)
    assert scatters[0] > 0.5


@pytest.mark.parametrize(("converged", "width"), [(True, 4.0), (False, 2.0)])
def test_influence_and_its_slope_are_tukey_s_and_cauchy_s(converged, width):
    r = np.linspace(-6.0, 6.0, 241) + 0.011
    weight, change = robust_weight(r**2, converged)
    if converged:
        np.testing.assert_allclose(weight, np.where(abs(r) < 4, (1 - (r / width) ** 2) ** 2, 0))
    else:
        np.testing.assert_allclose(weight, 1.0 / (1.0 + (r / width) ** 2))
    ahead, behind = (x * robust_weight(x**2, converged)[0] for x in (r + 1e-6, r - 1e-6))
    np.testing.assert_allclose(change, (ahead - behind) / 2e-6, atol=1e-8)


def test_zones_that_are_free_scatter_by_a_factor_and_those_alike_do_not():
    assert not Zones.alike().log.any()
    assert not Zones.free().log.any()
    assert len(Zones.alike().log) == len(Zones.free().log) == ZONES
    assert Zones.free().weight == ZONE_LOG**-2
    assert Zones.free(lit=True).weight == LIT_LOG**-2
    assert Zones.free().weight < Zones.free(lit=True).weight < Zones.alike().weight
    assert Zones.alike().weight > 1e6 * Zones.free().weight


def test_the_prior_of_a_problem_looks_from_its_station():
    prior, station = Prior.of(0.01, CentreConfig()), np.array([0.4, -0.3, 2.0])
    problem = EdgeProblem(np.zeros((3, 2)), np.zeros(3), prior, Circle(0.1), 1e-3)
    assert problem.about(prior.mean) is problem
    assert not problem.few
    seen = replace(problem, station=station).about(prior.mean).prior
    np.testing.assert_array_equal(seen.mean, prior.seen_from(station, prior.mean).mean)
    state = prior.mean.copy()
    first = problem.beams(state)
    assert problem.beams(state) is first
    state[0] = 0.01
    assert problem.beams(state).x_m is not first.x_m
    np.testing.assert_allclose(problem.beams(state).q_m[:, 0], -0.01)


def test_a_zone_lies_within_one_sector():
    """So that the sum of squares by sectors holds each zone's reflectance once."""
    assert ZONES % SECTORS == 0


def test_without_a_point_zones_do_not_differ():
    """As where nothing behind an edge seen from a known station can be used; it ended in 0 / 0."""
    linear, prior, _ = drawn()
    nothing = {"weight": np.zeros(POINTS), "change": np.zeros(POINTS)}
    assert zone_scatter(replace(linear, **nothing), prior) == 0.0


def test_fewer_sectors_are_never_surer():
    """Down to one: below 3 degrees of freedom, u of few points fell with them, to a sixth."""
    linear, _, _ = drawn()
    found = [_variance(linear, dof) for dof in (14.0, 6.0, 3.0, 2.67, 2.0, 1.33, 0.5)]
    assert np.all(np.diff(found) >= 0.0)
    assert found[2] > 2.0 * found[0]


@pytest.mark.parametrize("scatter", [0.5, ALIKE_LOG])
def test_a_width_s_score_is_that_of_all_unknowns_at_once(scatter):
    """With the zones' reflectances among them, which had no prior in it: 2 to 5 um of u 16."""
    plate, (linear, prior, state) = rectangle(0.3, 0.2), drawn(scatter=scatter, size=0.01)
    prior.weight[GROWTH], prior.mean[GROWTH], state[GROWTH] = SIZE_M**-2, 0.0, 2e-5
    by_zones = linear.zones.weight * linear.zones.log.sum()  # as much as their sum, the ratio
    prior.mean[RATIO] = state[RATIO] - by_zones / prior.weight[RATIO]
    linear = replace(linear, change=linear.weight)
    slopes, known = dense(linear, prior)
    here = np.append(state - prior.mean, linear.zones.log)
    solved = np.linalg.lstsq(  # residuals that make this the solution
        slopes.T * linear.weight,
        known * here - slopes.T @ (linear.weight * linear.residual_m),
        rcond=None,
    )
    linear = replace(linear, residual_m=linear.residual_m + solved[0])
    way = plate.stretch(linear.share) * linear.slopes[:, GROWTH]
    slopes = np.column_stack([slopes, way])
    known = np.append(known, 2.0 / SIZE_M**2)
    known[GROWTH] = 2.0 / SIZE_M**2
    gradient = slopes.T @ (linear.weight * linear.residual_m) - known * np.append(here, 0.0)
    whole = np.linalg.solve((slopes.T * linear.weight) @ slopes + np.diag(known), gradient)
    _, _, shown = stretched(linear, plate, prior, state)
    np.testing.assert_allclose(shown[-1], whole[-1], rtol=1e-6)
    np.testing.assert_allclose(shown[:-1], state + whole[:STATES], atol=1e-9)


@pytest.mark.parametrize("gamma", [0.0, 0.7])
def test_the_power_of_light_is_that_of_all_unknowns_at_once(gamma):
    """From any state: with the power's score alone, far from a solution, 1 seemed 3."""
    linear, prior, state = drawn(seed=4, size=0.01)
    linear = replace(linear, change=linear.weight)
    light = 0.5 * np.random.default_rng(4).normal(size=12)
    none = np.zeros(12)
    background = Background(none, none, none, none, np.ones(12, bool), light)
    lighter = light[np.floor(linear.share * 12).astype(int)]
    slopes, known = dense(linear, prior)
    slopes = np.column_stack([slopes, lighter * linear.slopes[:, RATIO]])
    known, here = np.append(known, GAMMA_SIGMA**-2), np.append(state - prior.mean, linear.zones.log)
    gradient = slopes.T @ (linear.weight * linear.residual_m) - known * np.append(here, gamma)
    whole = np.linalg.solve((slopes.T * linear.weight) @ slopes + np.diag(known), gradient)
    assert abs(whole[:STATES]).max() > 1e-4  # not at a solution
    found, _ = power_of_light(linear, background, prior, state, gamma)
    assert found == pytest.approx(gamma + whole[-1], rel=1e-9)
