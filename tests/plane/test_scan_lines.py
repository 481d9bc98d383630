"""Scan lines: found whatever the order of the points, and tilts by their offsets as u states."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from wheelplane.plane.correlated_noise import cells_of, correlated_noise
from wheelplane.plane.scan_lines import cells_along_lines, grid_of

RADIUS, PITCH, WHITE = 0.12, 0.0013, 8e-4  # cells hold no whole number of lines


def lattice(rng, first_deg=7.0, between_deg=84.0, aspect=1.0):
    """Points (N, 2) of a disc on an oblique grid, the lines (N, 2) of both kinds that each is on.

    Lines of the first kind run along first_deg.
    """
    first, second = np.radians([first_deg, first_deg + between_deg])
    steps = PITCH * np.array([[np.cos(first), np.sin(first)], [np.cos(second), np.sin(second)]])
    steps[1] *= aspect
    reach = int(2.0 * RADIUS / PITCH)
    number = np.stack(np.meshgrid(*[np.arange(-reach, reach)] * 2), axis=-1).reshape(-1, 2)
    uv = (number + rng.uniform(-0.5, 0.5, 2)) @ steps
    kept = (np.hypot(*uv.T) < RADIUS) & (rng.random(len(uv)) > 0.02)
    return uv[kept], number[kept, ::-1] + reach


def scanned(rng, offset=0.0, kind=0, beam=(0.3, -0.2), **grid):
    """Points uvw (N, 3), noise w, moved along the beam; lines of one kind are offset as well."""
    uv, line = lattice(rng, **grid)
    noise = WHITE * rng.standard_normal(len(uv))
    noise += offset * rng.standard_normal(line.max() + 1)[line[:, kind]]
    return np.column_stack([uv + noise[:, None] * np.array(beam), noise])


def blocks_of(uvw, extra=None, size=5000):
    """Points in blocks of that size, as cells_along_lines takes them."""
    parts = [slice(k, k + size) for k in range(0, len(uvw), size)]
    return lambda work: [work(uvw[p], None if extra is None else extra[p]) for p in parts]


def fitted(uvw, step_m=0.0):
    """Error of a plane's slopes (2,) and their covariance by lines and by squares alone."""
    uvw[:, :2] -= uvw[:, :2].mean(axis=0)
    terms = np.column_stack([np.ones(len(uvw)), uvw[:, :2]])
    wrong = np.linalg.lstsq(terms, uvw[:, 2], rcond=None)[0]
    residual = np.column_stack([uvw[:, :2], uvw[:, 2] - terms @ wrong])
    side = 2.0 * RADIUS / 12
    index = (residual[:, :2] / side + 6.0).astype(int).clip(0, 11) @ [1, 12]
    terms_of = (np.ones(len(uvw)), *residual.T, *np.zeros((5, len(uvw))), residual[:, 2] ** 2)
    sums = np.stack([np.bincount(index, one, 144) for one in terms_of], axis=1)
    cells = cells_of(sums, 12, side)
    white = np.linalg.inv(terms.T @ terms)
    found = []
    for lined in (list(cells_along_lines(blocks_of(residual), step_m)), []):
        noise = correlated_noise(cells, RADIUS, WHITE, lined=lined)
        whole = white * noise.white_sigma_m**2 + noise.covariance + noise.form_covariance
        found.append(whole[1:, 1:])
    return wrong[1:], *found


def off_deg(direction, degrees):
    return abs((np.degrees(np.arctan2(*direction[::-1])) - degrees + 90.0) % 180.0 - 90.0)


@pytest.mark.parametrize("between", [70.0, 84.0, 90.0])
@pytest.mark.parametrize("first", [0.0, 33.0, 125.0])
@pytest.mark.parametrize("beam", [(0.0, 0.0), (0.6, 0.2), (-0.3, 0.7)])
def test_lines_are_found_under_noise_that_moves_the_points_along_the_beams(between, first, beam):
    rng = np.random.default_rng(5)
    uvw = scanned(rng, beam=beam, first_deg=first, between_deg=between)
    for points in (uvw, rng.permutation(uvw)):
        directions = grid_of(points).directions
        assert grid_of(points).beam == pytest.approx(beam, abs=0.1)
        assert np.linalg.norm(directions, axis=1) == pytest.approx([1.0, 1.0])
        for wanted in (first, first + between):
            assert min(off_deg(direction, wanted) for direction in directions) < 0.5


def test_lines_twice_as_far_apart_as_their_points():
    uvw = scanned(np.random.default_rng(6), aspect=2.0)
    directions = grid_of(uvw).directions
    for wanted in (7.0, 91.0):
        assert min(off_deg(direction, wanted) for direction in directions) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("kind", [0, 1])
def test_tilts_by_offsets_of_scan_lines_are_as_uncertain_as_stated(kind):
    count = 40
    found = [fitted(scanned(np.random.default_rng([s, 3]), 2e-4, kind)) for s in range(count)]
    nees, squares = (
        sum(tilt @ np.linalg.solve(one[k], tilt) for tilt, *one in found) for k in (0, 1)
    )
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * count)
    assert 0.8 * low < nees < 1.1 * high  # the offsets' size is an estimate of 25 dof
    assert squares > 1.5 * nees
    _, line = lattice(np.random.default_rng([0, 3]))
    uvw = scanned(np.random.default_rng([0, 3]))
    slope = np.linalg.pinv(uvw[:, :2] - uvw[:, :2].mean(axis=0))
    by_line = np.stack([np.bincount(line[:, kind], one) for one in slope])
    wanted = WHITE**2 * slope @ slope.T + 2e-4**2 * by_line @ by_line.T
    mean = np.mean([one for _, one, _ in found], axis=0)
    u, wanted_u = np.sqrt(np.linalg.eigvalsh(mean)), np.sqrt(np.linalg.eigvalsh(wanted))
    np.testing.assert_allclose(u, wanted_u, rtol=0.15)
    assert wanted_u[1] > 2.0 * wanted_u[0]


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0.6, 0.3])
def test_tilts_of_a_thinned_scan_with_offsets_are_as_uncertain_as_stated(kept):
    """Squares alone stated 0.8 of the errors here, and so did lines across a lattice not found."""
    count, total = 80, 0.0
    for seed in range(count):
        rng = np.random.default_rng([seed, 21])
        uvw = scanned(rng, 1.5e-4)
        wrong, lined, _ = fitted(uvw[rng.random(len(uvw)) < kept])
        total += wrong @ np.linalg.solve(lined, wrong)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * count)
    assert 0.8 * low < total < 1.1 * high


@pytest.mark.slow
def test_tilts_by_ranges_that_drift_during_a_scan_are_as_uncertain_as_stated():
    """Offsets that change over a third of the radius: a plane absorbs the most of them."""
    squares = []
    for seed in range(30):
        rng = np.random.default_rng([seed, 8])
        uvw = scanned(rng, beam=(0.0, 0.0), first_deg=0.0, between_deg=90.0)
        apart = (uvw[:, 1] - uvw[:, 1].min()) / (0.3 * RADIUS)
        places = np.arange(-4.0, 12.0, 0.5)  # white noise smoothed: its correlation is Gaussian
        bells = np.exp(-((apart[:, None] - places) ** 2))
        uvw[:, 2] += (
            2e-4 * bells @ rng.standard_normal(len(places)) / np.sqrt(np.sqrt(np.pi / 2) * 2)
        )
        tilt, lined, _ = fitted(uvw)
        squares.append(tilt @ np.linalg.solve(lined, tilt))
    assert 0.4 < np.mean(squares) / 2.0 < 2.5  # their variance is an estimate of 6 dof


@pytest.mark.parametrize("beam", [(0.0, 0.0), (0.3, -0.2), (-0.1, 0.6)])
def test_independent_noise_is_left_alone(beam):
    """Noise that moves points along oblique beams also parts those of a line at a cell's side."""
    found = [fitted(scanned(np.random.default_rng([s, 4]), beam=beam)) for s in range(40)]
    changed = sum(not np.array_equal(lined, squares) for _, lined, squares in found)
    assert changed <= stats.binom.ppf(0.999, 40, 0.015)


@pytest.mark.parametrize("step_m", [0.1e-3, 0.3e-3, 0.38e-3, 0.5e-3, 1e-3, 1.5e-3])
def test_rounded_coordinates_are_no_lines(step_m):
    """Steps as long as the beams are apart sorted the noise: u a thousand times too wide."""
    changed = []
    for seed in range(24):
        rng = np.random.default_rng([seed, 9])
        turn = Rotation.random(random_state=seed).as_matrix()
        uvw = np.rint(scanned(rng) @ turn.T / step_m) * step_m @ turn
        _, lined, squares = fitted(uvw, step_m)
        changed.append(np.trace(lined) / np.trace(squares))
    changed = np.array(changed)
    assert np.count_nonzero(changed != 1.0) <= stats.binom.ppf(0.999, len(changed), 0.05)
    assert changed.max() < 3.0


@pytest.mark.parametrize("count", [0, 3, 600])
def test_few_points_show_no_lines(count):
    assert (
        list(cells_along_lines(blocks_of(np.random.default_rng(1).normal(size=(count, 3))))) == []
    )


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, WHITE, 3e-3])
def test_points_on_no_grid_show_no_lines(noise):
    """A beam invented for them sorted their noise: u up to 409 times too wide."""
    for seed in range(40):
        rng = np.random.default_rng([seed, 8])
        away, angle = RADIUS * np.sqrt(rng.random(8000)), rng.uniform(0.0, 2.0 * np.pi, 8000)
        heights = noise * rng.standard_normal(8000)
        uvw = np.column_stack([away * np.cos(angle), away * np.sin(angle), heights])
        assert grid_of(uvw) is None
        assert list(cells_along_lines(blocks_of(uvw))) == []


@pytest.mark.parametrize("kept", [0.5, 0.3, 0.15])
def test_lines_are_found_in_a_thinned_scan(kept):
    for seed in range(10):
        rng = np.random.default_rng([seed, 6])
        uvw = scanned(rng)
        grid = grid_of(uvw[rng.random(len(uvw)) < kept])
        assert min(off_deg(one, 7.0) for one in grid.directions) < 2.0
        assert min(off_deg(one, 91.0) for one in grid.directions) < 2.0
        assert grid.beam == pytest.approx((0.3, -0.2), abs=0.15)


def test_points_in_any_blocks_give_the_same_cells():
    uvw = scanned(np.random.default_rng(5))
    whole, parts = (list(cells_along_lines(blocks_of(uvw, size=size))) for size in (len(uvw), 777))
    assert len(whole) == len(parts) == 2
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one.count, other.count)
        np.testing.assert_allclose(one.mean_m, other.mean_m, rtol=0, atol=1e-15)


def test_a_column_fitted_besides_the_plane_is_averaged_likewise():
    uvw = scanned(np.random.default_rng(3))
    for cells in cells_along_lines(blocks_of(uvw, 2.0 * uvw[:, 2])):
        np.testing.assert_allclose(cells.extra[:, 0], 2.0 * cells.mean_m, rtol=1e-9)
