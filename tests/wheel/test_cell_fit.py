"""Least squares over cells: derivatives, rejection, uncertainty."""

import numpy as np

from wheelplane.wheel.cell_fit import _columns, fit_cells, positive, root_of
from wheelplane.wheel.cells import Grid, Heights
from wheelplane.wheel.meridian import Meridian

GRID = Grid(0.2, 0.002, 20, 72)
HEIGHT_M = 0.004 * np.sin((GRID.radius_m - 0.2) * 90.0)
MERIDIAN = Meridian(GRID, HEIGHT_M, np.full(GRID.rings, 0.001))
USED = MERIDIAN.usable
COUNT = np.full(GRID.shape, 10.0)


def simulated(rng, step, noise_m=0.001):
    rows = _columns(MERIDIAN, np.ones(GRID.rings, dtype=bool))
    return rows @ step + rng.normal(0.0, noise_m / np.sqrt(10.0), GRID.shape)


def test_columns_are_the_derivatives_of_heights_about_a_moved_axis():
    """A point of the surface, seen about an axis tilted and shifted by little."""
    slope = 0.3
    plane = Meridian(GRID, slope * GRID.radius_m, MERIDIAN.noise_m)
    rows = _columns(plane, np.ones(GRID.rings, dtype=bool))
    ring, sector = 7, 11
    radius, angle = GRID.radius_m[ring], GRID.angle[sector]
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6
        # the point at (radius, angle) of the old axis, at the height where the new cone is
        q = np.array([radius * np.cos(angle), radius * np.sin(angle)])
        z = slope * radius
        for _ in range(5):
            along = z + step[:2] @ q
            away = np.hypot(*(q - step[2:] - step[:2] * z))
            z += slope * away - along
        assert abs((z - slope * radius) / 1e-6 - rows[ring, sector, k]) < 1e-4


def test_the_step_is_found_and_its_covariance_is_that_of_many_fits():
    """It is the larger of two that scatter, so that it is too large on average, by half at most."""
    rng = np.random.default_rng(3)
    step = np.array([1e-3, -5e-4, 2e-4, 1e-4, *(1e-4 * rng.normal(size=8))])
    fits = [fit_cells(Heights(simulated(rng, step), COUNT), MERIDIAN, USED) for _ in range(60)]
    off = np.stack([fit.step - step for fit in fits])[:, :4]
    stated = np.mean([np.diag(fit.covariance) for fit in fits], axis=0)
    ratio = np.mean(off**2, axis=0) / stated
    assert np.all(np.abs(off.mean(axis=0)) < 4.0 * np.sqrt(stated / 60))
    assert np.all(ratio < 1.0 + 4.0 * np.sqrt(2.0 / 60))
    assert np.mean(ratio) > 0.6


def test_a_part_that_is_not_round_is_rejected_and_waves_are_not_taken_for_tilt():
    rng = np.random.default_rng(4)
    y = simulated(rng, np.zeros(12))
    y[:, 20:26] += 0.02
    fit = fit_cells(Heights(y, COUNT), MERIDIAN, USED)
    u = np.sqrt(np.diag(fit.covariance))
    assert np.all(fit.weight[:, 20:26] == 0.0)
    assert np.all(np.abs(fit.step[:4]) < 4.0 * u[:4])
    assert np.all(fit.kept[USED] > 0.85)


def test_correlated_residuals_make_the_uncertainty_larger():
    rng = np.random.default_rng(5)
    alike = np.repeat(rng.normal(0.0, 0.0006, (1, 24)), 3, axis=1)
    plain = fit_cells(Heights(simulated(rng, np.zeros(12)), COUNT), MERIDIAN, USED)
    waved = fit_cells(Heights(simulated(rng, np.zeros(12)) + alike, COUNT), MERIDIAN, USED)
    size = [np.sqrt(np.trace(f.covariance[:2, :2])) for f in (plain, waved)]
    assert size[1] > 3.0 * size[0]
    assert waved.dof < 24.0


def test_no_fit_states_much_less_than_its_cells_scatter():
    """The jackknife scatters itself: alone, with few cells, it states 0.4 of some variances."""
    rng = np.random.default_rng(8)
    grid = Grid(0.2, 0.004, 6, 36)
    meridian = Meridian(grid, np.interp(grid.radius_m, GRID.radius_m, HEIGHT_M), np.full(6, 1e-4))
    fits = []
    for _ in range(60):
        y = rng.normal(0.0, 0.001, grid.shape)
        fits.append(fit_cells(Heights(y, np.full(grid.shape, 10.0)), meridian, meridian.usable))
    off = np.stack([fit.step[:2] for fit in fits])
    stated = np.stack([np.diag(fit.covariance)[:2] for fit in fits])
    assert np.all(stated.min(axis=0) > 0.5 * off.var(axis=0))


def test_roots_of_covariances():
    rng = np.random.default_rng(6)
    A = rng.normal(size=(4, 4))
    C = A @ A.T
    assert np.allclose(root_of(C) @ root_of(C).T, C)
    assert np.all(np.linalg.eigvalsh(positive(C - 2.0 * np.eye(4))) > -1e-9)
