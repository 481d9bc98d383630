"""The likelihood of correlated noise in cells, by dense matrices, quadrature and scipy's search."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize

from wheelplane.plane.correlated_noise import (
    SUSPECT,
    Cells,
    _averaged_kernel,
    _Field,
    _Maximum,
    _Whitened,
)


def cells(seed, side=(0.01, 0.02), sigma=0.0):
    """Cells of unlike counts on a raster with gaps; white residuals of 1e-4 m and a field."""
    rng = np.random.default_rng(seed)
    index = np.argwhere(rng.uniform(size=(6, 5)) < 0.8)
    uv = (index + 0.5 - [3.0, 2.5]) * side + rng.normal(0, 1e-3, index.shape)
    count = rng.integers(5, 60, len(index)).astype(float)
    mean = 1e-4 * rng.normal(size=len(index)) / np.sqrt(count)
    empty = Cells(uv, mean, count, index, np.array(side), 1e-8)
    field = np.linalg.cholesky(_averaged_kernel(empty, (0.02, 0.03)) + 1e-9 * np.eye(len(index)))
    return replace(empty, mean_m=mean + sigma * field @ rng.normal(size=len(index)))


@pytest.mark.parametrize("lengths", [(0.004, 0.01), (0.05, 0.02), (math.inf, 0.02)])
def test_the_kernel_is_the_mean_over_two_cells(lengths):
    known = cells(1)
    found = _averaged_kernel(known, lengths)
    for one, other in ((0, 0), (0, 1), (2, 9), (3, len(found) - 1)):
        wanted = 1.0
        for axis in range(2):
            side, length = known.side_m[axis], lengths[axis]
            apart = side * (known.index[one, axis] - known.index[other, axis])
            mean, _ = integrate.dblquad(
                lambda x, y, a=apart, L=length: math.exp(-((x - y + a) ** 2) / (2.0 * L * L)),
                0.0, side, 0.0, side, epsabs=1e-15,
            )  # fmt: skip
            wanted *= mean / side**2
        assert found[one, other] == pytest.approx(wanted, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_a_field_moves_residuals_and_plane_as_weighted_least_squares_does(seed):
    known = cells(seed, sigma=1e-4)
    white = _Whitened.of(known)
    field = _Field.of(known, white, (0.02, 0.03))
    kernel = _averaged_kernel(known, (0.02, 0.03))
    root = np.sqrt(known.count / 1e-8)
    design = root[:, None] * np.column_stack([np.ones(len(root)), known.uv_m])
    solve = np.linalg.pinv(design)
    left = np.eye(len(root)) - design @ solve
    np.testing.assert_allclose(field.residual, left @ (root * known.mean_m), atol=1e-9)
    wanted = left @ (np.outer(root, root) * kernel) @ left
    np.testing.assert_allclose(field.kernel, wanted, atol=1e-9 * np.abs(wanted).max())
    by_means = solve * root
    np.testing.assert_allclose(field.plane_covariance, by_means @ kernel @ by_means.T, rtol=1e-9)


def planted(seed, variance):
    """A field of that variance in residuals that no fit has touched; its kernel is of rank 20."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(30, 20)) * np.exp(rng.uniform(-2.0, 1.0, 20))
    drawn = rng.normal(size=30) + math.sqrt(variance) * root @ rng.normal(size=20)
    return _Field((1.0, 1.0), drawn, root @ root.T, np.eye(3), 1.0)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("variance", [1e-3, 0.1, 30.0])
def test_the_maximum_is_that_of_the_restricted_likelihood(seed, variance):
    field = planted(seed, variance)

    def log_likelihood(s2):
        whole = np.eye(30) + s2 * field.kernel
        return -0.5 * (
            np.linalg.slogdet(whole)[1] + field.residual @ np.linalg.solve(whole, field.residual)
        )

    found = field.maximise()
    assert isinstance(found, _Maximum)
    assert found.gain == pytest.approx(
        max(log_likelihood(found.variance) - log_likelihood(0.0), 0.0), abs=1e-9
    )
    if found.variance == 0.0:
        assert log_likelihood(1e-6 / np.trace(field.kernel)) < log_likelihood(0.0)
        return
    near = optimize.minimize_scalar(
        lambda level: -log_likelihood(math.exp(level)),
        bounds=(math.log(found.variance) - 0.7, math.log(found.variance) + 0.7),
        method="bounded",
        options={"xatol": 1e-9},
    )
    if found.gain > 0.01:
        assert math.exp(near.x) == pytest.approx(found.variance, rel=1e-5)
    share = np.linalg.solve(
        np.eye(30) + found.variance * field.kernel, found.variance * field.kernel
    )
    assert found.dof == pytest.approx(max(1.0, np.trace(share @ share)))


def spectrum(*groups):
    """A field of eigenvalues, each so many times, and residuals of that mean square: triples."""
    values, squares = (
        np.concatenate([np.full(count, one[k]) for count, *one in groups]) for k in (0, 1)
    )
    return _Field((1.0, 1.0), np.sqrt(squares), np.diag(values), np.eye(3), 1.0)


@pytest.mark.parametrize("value", [1e-9, 3.0, 1e6])
@pytest.mark.parametrize("count", [2, 12, 90])
@pytest.mark.parametrize("excess", [0.03, 0.4, 7.0, 1e4])
def test_the_maximum_of_one_eigenvalue_is_what_squares_exceed_noise_by(value, count, excess):
    found = spectrum((count, value, 1.0 + excess)).maximise()
    assert found.variance == pytest.approx(excess / value, rel=1e-11)
    assert found.gain == pytest.approx(0.5 * count * (excess - math.log1p(excess)), rel=1e-9)
    assert found.dof == pytest.approx(max(1.0, count * (excess / (1.0 + excess)) ** 2))


@pytest.mark.parametrize(
    "groups",
    [
        [(1, 0.0889, 86.5), (27, 1.0, 1.2175)],
        [(1, 0.0743, 90.0), (26, 1.0, 1.2)],
        [(1, 0.0415, 116.0), (34, 1.0, 2.6)],
        [(1, 0.0142, 138.0), (22, 1.0, 2.87)],
    ],
    ids=["steep", "again", "again nearby", "again far away"],
)
def test_of_several_maxima_the_least_is_taken_and_a_steep_slope_misleads_no_step(groups):
    """One small eigenvalue holds much: the slope rises soon before or after the maximum."""
    field = spectrum(*groups)
    values, square = np.diag(field.kernel), field.residual**2

    def slope(level):
        share = 1.0 / (1.0 + math.exp(level) * values)
        return float(np.sum(values * share * (square * share - 1.0)))

    levels = np.arange(-20.0, 20.0, 0.01)
    falls = next(high for high in levels if slope(high) <= 0.0)
    wanted = optimize.brentq(slope, falls - 0.01, falls, xtol=1e-14)
    assert math.log(field.maximise().variance) == pytest.approx(wanted, abs=1e-11)


def test_no_field_has_no_gain_and_one_degree_of_freedom():
    field = planted(1, 0.0)
    found = replace(field, residual=1e-3 * field.residual).maximise()
    assert (found.gain, found.dof) == (pytest.approx(0.0, abs=1e-9), 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_score_is_suspect_beyond_so_many_deviations_of_white_residuals(seed):
    """Mean tr K and variance 2 tr K^2 of z'Kz are those of draws."""
    field = planted(seed, 0.0)
    z = np.random.default_rng(seed).normal(size=(20_000, 30))
    drawn = np.einsum("ni,ij,nj->n", z, field.kernel, z, optimize=True)
    limit = drawn.mean() + SUSPECT * drawn.std()
    now = float(field.residual @ field.kernel @ field.residual)
    for share, suspect in ((0.93, False), (1.07, True)):
        scaled = replace(field, residual=field.residual * math.sqrt(share * limit / now))
        assert scaled.is_suspect() == suspect
