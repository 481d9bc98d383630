"""Cells of residuals by plain loops over their points; degrees of freedom of a mixed variance."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wheelplane.cloud import raster_sums
from wheelplane.plane.correlated_noise import MIN_CELLS, _dof, cells_of, filled
from wheelplane.plane.scan_lines import _cells


def points(seed, across=7, down=5):
    """Points u, v, w of a grid of unit cells about the origin, some cells with few or none."""
    rng = np.random.default_rng(seed)
    column, row = rng.integers(0, across, 3000), rng.integers(0, down, 3000)
    kept = (column != 2) & ((column + row) % 4 != 0) | (rng.uniform(size=3000) < 0.01)
    at = np.stack([column, row], axis=1) + rng.uniform(0.01, 0.99, (3000, 2))
    uv = (at - [across / 2.0, down / 2.0])[kept]
    return np.column_stack([uv, rng.normal(0.3, 1.0, len(uv))]), column[kept], row[kept]


def plain(uvw, column, row):
    """Return cells by row, then column: index, u, v, mean, count; and the variance within them."""
    found, square, dof = [], 0.0, 0
    most = max(np.sum((column == c) & (row == r)) for c in range(7) for r in range(7))
    for r in range(7):
        for c in range(7):
            own = uvw[(column == c) & (row == r)]
            if len(own) > max(2.0, 0.2 * most):
                found.append([c, r, *own.mean(axis=0), len(own)])
                square += np.sum((own[:, 2] - own[:, 2].mean()) ** 2)
                dof += len(own) - 1
    return np.array(found), square / dof


def assert_cells(cells, uvw, column, row):
    wanted, within = plain(uvw, column, row)
    np.testing.assert_array_equal(cells.index, wanted[:, :2])
    np.testing.assert_allclose(cells.uv_m, wanted[:, 2:4], atol=1e-12)
    np.testing.assert_allclose(cells.mean_m, wanted[:, 4], atol=1e-12)
    np.testing.assert_array_equal(cells.count, wanted[:, 5])
    assert cells.white_variance == pytest.approx(within)


@pytest.mark.parametrize("seed", range(2))
def test_cells_of_a_raster_are_the_means_of_their_points(seed):
    uvw, column, row = points(seed, down=7)
    u, v, w = uvw.T
    terms = [np.ones(len(u)), u, v, w, u * u, u * v, v * v, u * w, v * w, w * w]
    sums = np.stack([np.bincount(7 * row + column, term, 49) for term in terms], axis=1)
    assert_cells(cells_of(sums, 7, 1.0), uvw, column, row)


@pytest.mark.parametrize("seed", range(2))
def test_cells_along_scan_lines_are_the_means_of_their_points(seed):
    """A grid is wider than high; points beyond its rim belong to the cells at the rim."""
    uvw, column, row = points(seed)
    along = uvw[:, :2].T.copy()
    along[0, column == 0] -= 3.0
    along[1, row == 4] += 3.0
    side = np.ones(2)
    extra = np.arange(len(uvw)) / 7.0
    cells = _cells(raster_sums(uvw, extra, along, (7, 5), side), (7, 5), side)
    assert_cells(cells, uvw, column, row)
    for (c, r), mean in zip(cells.index, cells.extra[:, 0], strict=True):
        assert mean == pytest.approx(extra[(column == c) & (row == r)].mean())


def test_a_cell_is_filled_by_more_than_two_points_and_a_fifth_of_the_fullest():
    full = np.array([3.0, 2.0, 0.0] + [10.0] * (MIN_CELLS - 1))
    assert filled(full).tolist() == [True, False, False] + [True] * (MIN_CELLS - 1)
    assert filled(full[1:]) is None
    many = np.array([21.0, 19.0] + [100.0] * MIN_CELLS)
    assert filled(many).tolist() == [True, False] + [True] * MIN_CELLS


def mixed(seed, kinds):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(kinds, 4, 4))
    fields = [SimpleNamespace(plane_covariance=root @ root.T) for root in roots]
    fits = [SimpleNamespace(variance=v, dof=n) for v, n in rng.uniform(3.0, 20.0, (kinds, 2))]
    belief = rng.uniform(0.2, 1.0, kinds)
    return fields, fits, belief / belief.sum()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kinds", [1, 3])
def test_degrees_of_freedom_are_those_of_the_moments_of_the_mixture(seed, kinds):
    """One kind has its own; several have 2 E^2 / var of the mixture of their chi-squares."""
    fields, fits, belief = mixed(seed, kinds)
    tilts = [fit.variance * sum(np.diag(f.plane_covariance)[1:3])
             for f, fit in zip(fields, fits, strict=True)]  # fmt: skip
    first = sum(b * t for b, t in zip(belief, tilts, strict=True))
    second = sum(b * t * t * (1.0 + 2.0 / fit.dof)
                 for b, t, fit in zip(belief, tilts, fits, strict=True))  # fmt: skip
    found = _dof(fields, fits, belief)
    assert found == pytest.approx(max(1.0, 2.0 * first**2 / (second - first**2)))
    if kinds == 1:
        assert found == pytest.approx(fits[0].dof)


def test_degrees_of_freedom_are_at_least_one_and_infinite_of_a_variance_that_is_known():
    fields, fits, _ = mixed(1, 2)
    fits[0].variance *= 1e4
    assert _dof(fields, fits, np.array([0.01, 0.99])) == 1.0
    exact = [SimpleNamespace(variance=2.0, dof=math.inf)]
    assert _dof(fields[:1], exact, np.ones(1)) == math.inf
