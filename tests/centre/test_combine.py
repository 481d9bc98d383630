"""Centres by several methods: their weighted mean, and the test of their agreement."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from wheelplane.centre.combine import (
    DISAGREE,
    UNLIKELY,
    CentreEstimate,
    check_agreement,
    combined,
    reconciled,
)
from wheelplane.centre.edge.beams import STATE
from wheelplane.centre.edge.solution import INHERITED, common_m2
from wheelplane.errors import NotMeasuredError

NO_PLANE = np.zeros((3, 3))


def covariance(rng):
    A = rng.normal(size=(2, 2)) * 1e-4
    return A @ A.T + 1e-10 * np.eye(2)


def estimate(rng, method="rim", **changes):
    made = CentreEstimate(
        method=method,
        centre_m=rng.normal(size=2) * 1e-4,
        noise_m2=covariance(rng),
        model_m2=covariance(rng),
        by_plane=rng.normal(size=(2, 3)),
        dof=float(rng.integers(5, 40)),
    )
    return replace(made, **changes)


@pytest.mark.parametrize("seed", range(3))
def test_the_mean_is_that_of_generalised_least_squares(seed):
    rng = np.random.default_rng(seed)
    parts = [estimate(rng) for _ in range(3)]
    result = combined(parts)
    A = np.tile(np.eye(2), (3, 1))
    C = np.zeros((6, 6))
    for k, part in enumerate(parts):
        C[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = part.covariance_m2
    W = np.linalg.inv(C)
    expected = np.linalg.solve(A.T @ W @ A, A.T @ W @ np.concatenate([p.centre_m for p in parts]))
    np.testing.assert_allclose(result.centre_m, expected, rtol=1e-9)
    np.testing.assert_allclose(result.covariance_m2, np.linalg.inv(A.T @ W @ A), rtol=1e-9)
    assert np.linalg.norm(expected - np.mean([p.centre_m for p in parts], axis=0)) > 1e-6


def test_the_mean_does_not_depend_on_the_order_and_moves_with_its_parts():
    rng = np.random.default_rng(5)
    parts = [estimate(rng) for _ in range(3)]
    here, back = combined(parts), combined(parts[::-1])
    np.testing.assert_allclose(back.centre_m, here.centre_m, rtol=1e-9)
    np.testing.assert_allclose(back.by_plane, here.by_plane, rtol=1e-9)
    assert back.dof == pytest.approx(here.dof)
    shift = np.array([0.3, -0.2])
    moved = combined([replace(p, centre_m=p.centre_m + shift) for p in parts])
    np.testing.assert_allclose(moved.centre_m, here.centre_m + shift, rtol=1e-12)


def test_what_the_plane_moves_alike_the_mean_moves_with_it():
    rng = np.random.default_rng(6)
    by_plane = rng.normal(size=(2, 3))
    parts = [estimate(rng, by_plane=by_plane) for _ in range(3)]
    np.testing.assert_allclose(combined(parts).by_plane, by_plane, rtol=1e-9)


def test_equal_parts_halve_the_variance_and_add_their_degrees_of_freedom():
    part = estimate(np.random.default_rng(7), dof=12.0)
    two = combined([part, part])
    np.testing.assert_allclose(two.noise_m2, part.noise_m2 / 2.0, rtol=1e-9)
    assert two.dof == pytest.approx(24.0)
    assert combined([part]) is part
    endless = replace(part, dof=math.inf)
    assert combined([endless, endless]).dof == math.inf


def test_what_two_estimates_have_in_common_stays_in_their_mean():
    """Half of the variance of each is one error of both: the mean keeps it."""
    part = estimate(np.random.default_rng(9))
    two = combined([part, part], (0.5 * part.noise_m2, 0.5 * part.model_m2))
    np.testing.assert_allclose(two.noise_m2, 0.75 * part.noise_m2, rtol=1e-9)
    np.testing.assert_allclose(two.model_m2, 0.75 * part.model_m2, rtol=1e-9)
    np.testing.assert_allclose(two.centre_m, part.centre_m, rtol=1e-9)


def test_errors_that_oppose_each_other_make_no_mean_more_certain():
    part = estimate(np.random.default_rng(11))
    opposed = (-0.9 * part.noise_m2, -0.9 * part.model_m2)
    two = combined([part, part], opposed)
    np.testing.assert_allclose(two.noise_m2, combined([part, part]).noise_m2, rtol=1e-9)


def test_an_edge_that_begins_with_what_another_shows_shares_its_errors():
    """Both fits by plain least squares, 4,000 times: their centres vary together as stated."""
    rng, of_plate, draws = np.random.default_rng(10), len(INHERITED), 4000
    shown = np.zeros((STATE, STATE))
    plate = [0, 1, *INHERITED]
    first_rows, other_rows = rng.normal(size=(2, 20, 2 + of_plate))
    known = np.full(STATE, 1e-9)
    known[list(INHERITED)] = 30.0
    covariance = []
    for rows, before in ((first_rows, 0.0), (other_rows, 30.0)):
        prior = np.diag([0.0, 0.0, *np.full(of_plate, before)])
        found = shown.copy()
        found[np.ix_(plate, plate)] = np.linalg.inv(rows.T @ rows + prior)
        covariance.append(found)
    first = SimpleNamespace(covariance=covariance[0])
    other = SimpleNamespace(covariance=covariance[1], known=known)
    noise = rng.normal(size=(2, draws, 20))
    of_first = noise[0] @ first_rows @ covariance[0][np.ix_(plate, plate)]
    pulls = noise[1] @ other_rows
    pulls[:, 2:] += 30.0 * of_first[:, 2:]
    of_other = pulls @ covariance[1][np.ix_(plate, plate)]
    seen = of_other[:, :2].T @ of_first[:, :2] / draws
    stated = common_m2(other, first)
    scale = np.sqrt(np.outer(np.var(of_other[:, :2], axis=0), np.var(of_first[:, :2], axis=0)))
    assert np.abs((seen - stated) / scale).max() < 3.5 / np.sqrt(draws)
    assert np.abs(stated / scale).max() > 0.1


@pytest.mark.parametrize("dof", [8.0, 30.0])
@pytest.mark.parametrize(("factor", "agrees"), [(0.98, True), (1.02, False)])
def test_disagreement_begins_at_the_quantile_of_fisher_s_distribution(dof, factor, agrees):
    rng = np.random.default_rng(8)
    one, other = estimate(rng, dof=50.0), estimate(rng, "outline", dof=dof)
    joint = one.covariance_m2 + other.covariance_m2
    way = np.array([0.6, -0.8])
    unit = way / math.sqrt(way @ np.linalg.solve(joint, way))  # of T^2 = 1
    apart = math.sqrt(2.0 * stats.f.isf(DISAGREE, 2, dof)) * factor * unit
    one = replace(one, centre_m=other.centre_m + apart)
    if agrees:
        check_agreement([other, one], NO_PLANE)
        return
    with pytest.raises(NotMeasuredError, match="by outline and by rim") as error:
        check_agreement([other, one], NO_PLANE)
    assert error.value.status == "centres-disagree"
    assert f"{np.hypot(*apart) * 1e3:.2f} mm" in str(error.value)


def test_the_plane_excuses_only_what_it_moves_differently():
    rng = np.random.default_rng(9)
    one = estimate(rng, centre_m=np.array([0.01, 0.0]))
    other = estimate(rng, "outline", centre_m=np.zeros(2), by_plane=one.by_plane)
    unsure = np.diag([1.0, 1.0, 1.0])
    with pytest.raises(NotMeasuredError):
        check_agreement([other, one], unsure)
    check_agreement([replace(other, by_plane=-one.by_plane), one], unsure)


def test_a_doubtful_centre_disagrees_with_none_and_counts():
    rng = np.random.default_rng(9)
    one, far = estimate(rng), estimate(rng, "hole", centre_m=np.array([0.01, 0.0]))
    doubtful = replace(far, doubtful=True)
    with pytest.raises(NotMeasuredError):
        check_agreement([one, far], NO_PLANE)
    check_agreement([one, doubtful], NO_PLANE)
    with pytest.raises(NotMeasuredError):
        check_agreement([one, doubtful, replace(far, centre_m=np.array([0.0, 0.02]))], NO_PLANE)
    mean = combined(reconciled([one, doubtful], NO_PLANE))
    assert np.sqrt(np.linalg.eigvalsh(mean.covariance_m2)[-1]) > 0.003


def weighted_square(parts, plane_covariance):
    """Square of the distances from the weighted mean, and its degrees of freedom, by definition."""
    by_plane = np.mean([p.by_plane for p in parts], axis=0)
    C = [
        p.covariance_m2 + (p.by_plane - by_plane) @ plane_covariance @ (p.by_plane - by_plane).T
        for p in parts
    ]
    W = [np.linalg.inv(one) for one in C]
    mean = np.linalg.solve(sum(W), sum(w @ p.centre_m for w, p in zip(W, parts, strict=True)))
    off = [p.centre_m - mean for p in parts]
    return sum(o @ w @ o for o, w in zip(off, W, strict=True)), 2 * (len(parts) - 1)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize(("factor", "as_they_are"), [(0.99, True), (1.01, False), (3.0, False)])
def test_what_centres_differ_by_beyond_their_uncertainties_is_in_these(count, factor, as_they_are):
    rng = np.random.default_rng(11)
    plane_covariance = np.diag([1e-10, 2e-10, 3e-10])
    parts = [estimate(rng, dof=20.0 + k) for k in range(count)]
    square, dof = weighted_square(parts, plane_covariance)
    scale = math.sqrt(dof * stats.f.isf(UNLIKELY, dof, 20.0) / square) * factor
    parts = [replace(p, centre_m=scale * p.centre_m) for p in parts]
    found = reconciled(parts, plane_covariance)
    if as_they_are:
        assert found is parts
        return
    added = [after.model_m2 - before.model_m2 for after, before in zip(found, parts, strict=True)]
    for one in added:
        np.testing.assert_allclose(one, added[0][0, 0] * np.eye(2), atol=1e-12 * added[0][0, 0])
    assert weighted_square(found, plane_covariance)[0] == pytest.approx(dof, rel=1e-9)
    assert [p.noise_m2 for p in found] == [p.noise_m2 for p in parts]


def test_one_centre_is_as_certain_as_it_is():
    parts = [estimate(np.random.default_rng(12))]
    assert reconciled(parts, NO_PLANE) is parts


def test_a_mean_of_methods_with_errors_of_their_own_is_honest():
    """Each off by three times its u besides: their mean was as certain as if none were."""
    rng = np.random.default_rng(13)
    u_m, squares, plain = 1e-5, [], []
    for _ in range(400):
        at = rng.normal(0.0, math.sqrt(10.0) * u_m, (2, 2))
        parts = [
            estimate(rng, centre_m=c, noise_m2=u_m**2 * np.eye(2), model_m2=NO_PLANE[:2, :2])
            for c in at
        ]
        parts = [replace(p, by_plane=np.zeros((2, 3)), dof=100.0) for p in parts]
        for out, mean in (
            (squares, combined(reconciled(parts, NO_PLANE))),
            (plain, combined(parts)),
        ):
            out.append(mean.centre_m @ np.linalg.solve(mean.covariance_m2, mean.centre_m) / 2.0)
    assert np.mean(plain) > 8.0
    assert np.median(squares) < 1.2
