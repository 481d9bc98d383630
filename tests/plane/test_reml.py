"""Correlated noise by dense matrices: REML of all lengths, averaged by their likelihoods."""

import math

import numpy as np
import pytest
from scipy import linalg, optimize, special

from wheelplane.plane.correlated_noise import (
    ACROSS_OF_RADIUS,
    ALONG_OF_RADIUS,
    CELLS,
    FORM_OF_RADIUS,
    LENGTHS_OF_RADIUS,
    LEVELS,
    POINTS_A_CELL,
    SIGNIFICANT,
    SIGNIFICANT_LINED,
    Cells,
    _Field,
    cells_across,
    correlated_noise,
)

RADIUS, WHITE = 0.12, 1e-4


def cells(seed, shape, waves_m=(), size=3e-5, columns=0):
    """Cells on a disc, of unlike counts, with white noise and a field of those lengths.

    columns: fitted besides the plane.
    """
    rng = np.random.default_rng(seed)
    side = 2.0 * RADIUS / np.array(shape)
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape)), axis=-1).reshape(-1, 2)
    uv = (index + 0.5) * side - RADIUS
    index, uv = index[np.hypot(*uv.T) < RADIUS], uv[np.hypot(*uv.T) < RADIUS]
    count = rng.integers(20, 90, len(uv)).astype(float)
    mean = WHITE * rng.normal(size=len(uv)) / np.sqrt(count)
    if waves_m:
        apart = (uv[:, None] - uv) / waves_m
        field = np.exp(-0.5 * np.sum(apart**2, axis=2)) + 1e-9 * np.eye(len(uv))
        mean += size * np.linalg.cholesky(field) @ rng.normal(size=len(uv))
    extra = np.sin(30.0 * uv[:, :1] + np.arange(columns)) if columns else None
    of_square = float(side[0]) if shape[0] == shape[1] else side
    found = Cells(uv, mean, count, index, of_square, WHITE**2, extra)
    root = np.sqrt(count)[:, None]
    fitted = np.linalg.lstsq(root * found.slopes, root[:, 0] * mean)[0]
    found.mean_m[:] -= found.slopes @ fitted
    return found


def kernel(found, lengths):
    """Covariances of the cells' means of a field of unit variance: the overlap of two sides."""
    nodes, weight = np.polynomial.legendre.leggauss(60)
    whole = np.ones((len(found.count),) * 2)
    for at, side, length in zip(found.index.T, found.sides_m, lengths, strict=True):
        if length < math.inf:
            within = 0.5 * side * (nodes + 1.0)  # a triangle about the distance of the cells
            share = 0.5 * side * weight * (side - within) / side**2
            apart = side * np.arange(at.max() + 1.0)[:, None]
            both = (np.exp(-0.5 * ((apart + x) / length) ** 2) for x in (within, -within))
            whole *= (sum(both) @ share)[np.abs(at[:, None] - at)]
    return whole


def by_matrices(found, lengths):
    """Return s^2, gain, degrees of freedom and covariance of the fit, by a field of these lengths.

    The likelihood of contrasts of the means that no fitted column changes.
    """
    field = kernel(found, lengths)
    root = np.sqrt(found.count) / WHITE
    free = linalg.null_space((found.slopes * root[:, None]).T)
    of_contrasts = free.T @ (root[:, None] * field * root) @ free
    values, vectors = np.linalg.eigh(of_contrasts)
    square = (vectors.T @ free.T @ (root * found.mean_m)) ** 2

    def gain(level):
        share = math.exp(level) * values.clip(min=0.0)
        return 0.5 * float(np.sum(square * share / (1.0 + share) - np.log1p(share)))

    start = max(np.arange(-60.0, 0.0), key=gain)
    best = optimize.minimize_scalar(
        lambda x: -gain(x), bounds=(start - 1, start + 1), method="bounded", options={"xatol": 1e-9}
    )
    share = math.exp(best.x) * values.clip(min=0.0)
    terms = found.slopes * found.count[:, None]
    solve = np.linalg.solve(terms.T @ found.slopes, terms.T)
    covariance = math.exp(best.x) * solve @ field @ solve.T
    return math.exp(best.x), gain(best.x), np.sum((share / (1.0 + share)) ** 2), covariance


def lengths_of(shape):
    """Pairs of lengths along columns and rows: a square has one length, lines the long one."""
    if shape[0] == shape[1]:
        return [(RADIUS * share,) * 2 for share in LENGTHS_OF_RADIUS]
    pairs = [(RADIUS * a, RADIUS * b) for a in ACROSS_OF_RADIUS for b in ALONG_OF_RADIUS]
    return pairs if shape[0] > shape[1] else [pair[::-1] for pair in pairs]


SQUARE, UP, ACROSS = (12, 12), (40, 5), (5, 40)
LINES = {UP: (0.004, 1.0), ACROSS: (1.0, 0.004)}


@pytest.mark.parametrize(
    ("waves_m", "size", "lined", "columns"),
    [
        ((0.02, 0.02), 3e-5, None, 0),
        ((0.02, 0.02), 3e-5, None, 2),
        ((0.06, 0.06), 2e-4, None, 0),
        ((0.002, 0.002), 4e-5, None, 0),
        ((), 0.0, UP, 0),
        ((), 0.0, ACROSS, 1),
        ((0.02, 0.02), 3e-5, ACROSS, 0),
    ],
)
def test_fields_of_all_lengths_are_averaged_by_their_likelihoods(waves_m, size, lined, columns):
    shapes = {SQUARE: cells(1, SQUARE, waves_m, size, columns=columns)}
    if lined:
        shapes[lined] = cells(2, lined, LINES[lined], 6e-5, columns=columns)
    fields = []
    for shape, found in shapes.items():
        own = [(pair, *by_matrices(found, pair)) for pair in lengths_of(shape)]
        if (
            2.0 * max(gain for _, _, gain, *_ in own)
            > (SIGNIFICANT, SIGNIFICANT_LINED)[shape != SQUARE]
        ):
            fields += own
    assert fields
    belief = special.softmax([gain for _, _, gain, *_ in fields])
    noise, form = (
        sum(
            b * covariance
            for b, (pair, *_, covariance) in zip(belief, fields, strict=True)
            if (min(pair) > FORM_OF_RADIUS * RADIUS) == long
        )
        for long in (False, True)
    )
    seen = correlated_noise(shapes[SQUARE], RADIUS, WHITE, 0.0, [shapes[s] for s in [lined] if s])
    assert seen.sigma_m**2 == pytest.approx(belief @ [s2 for _, s2, *_ in fields], rel=1e-5)
    reach = [np.log(np.minimum(pair, RADIUS)).mean() for pair, *_ in fields]
    assert math.log(seen.length_m) == pytest.approx(belief @ reach, rel=1e-5)
    most = np.abs(noise + form).max(axis=0)
    scale = np.sqrt(np.outer(most, most)) * 1e-5
    assert np.all(np.abs(seen.covariance - noise) <= scale)
    assert np.all(np.abs(seen.form_covariance - form) <= scale)
    assert seen.white_sigma_m == pytest.approx(WHITE)
    # Of the tilt's variance, a mixture of scaled chi-squares: 2 E^2 / var.
    tilt = np.array([covariance[1, 1] + covariance[2, 2] for *_, covariance in fields])
    dof = np.maximum([dof for *_, dof, _ in fields], 1.0)
    mean = belief @ tilt
    spread = belief @ (tilt**2 * (1.0 + 2.0 / dof)) - mean**2
    assert seen.dof == pytest.approx(max(1.0, 2.0 * mean**2 / spread), rel=1e-3)
    plane = seen.of_plane
    np.testing.assert_array_equal(plane.covariance, seen.covariance[:3, :3])
    np.testing.assert_array_equal(plane.form_covariance, seen.form_covariance[:3, :3])


@pytest.mark.parametrize(
    ("lined", "limit", "waves_m"),
    [
        (None, SIGNIFICANT, (0.015, 0.015)),
        (None, SIGNIFICANT, (0.003, 0.003)),
        (None, SIGNIFICANT, (0.06, 0.06)),
        (UP, SIGNIFICANT_LINED, LINES[UP]),
    ],
)
def test_noise_is_believed_from_twice_a_gain_in_likelihood(lined, limit, waves_m):
    """Cells of the same field, the larger the clearer: nothing below the limit, all above."""
    shape = lined or SQUARE
    known = cells(3, shape, waves_m, 1e-4)
    plain, mean = cells(5, SQUARE), known.mean_m.copy()

    def twice_gain(size):
        known.mean_m[:] = size * mean
        return 2.0 * max(by_matrices(known, pair)[1] for pair in lengths_of(shape)[::2])

    for share, found in ((0.8, False), (1.2, True)):
        twice_gain(optimize.brentq(lambda x, g=share * limit: twice_gain(x) - g, 0.02, 1.0))
        if lined:
            seen = correlated_noise(plain, RADIUS, WHITE, 0.0, [known])
        else:
            seen = correlated_noise(known, RADIUS, WHITE)
        assert (seen.sigma_m > 0.0, seen.length_m > 0.0) == (found, found)
        assert seen.covariance.any() == found
        assert found or (seen.white_sigma_m, seen.dof) == (pytest.approx(WHITE), math.inf)


def test_noise_below_the_resolution_is_none():
    known = cells(1, SQUARE, (0.02, 0.02), 1e-4)
    assert correlated_noise(known, RADIUS, 2.0, 0.9 * WHITE).sigma_m > 0.0
    for nothing in (
        correlated_noise(known, RADIUS, 2.0, 1.1 * WHITE),
        correlated_noise(None, 1, 2),
    ):
        assert (nothing.sigma_m, nothing.length_m, nothing.white_sigma_m) == (0.0, 0.0, 2.0)
        np.testing.assert_array_equal(nothing.covariance, np.zeros((3, 3)))
        np.testing.assert_array_equal(nothing.form_covariance, np.zeros((3, 3)))


def test_a_field_of_any_size_is_found():
    """Residuals of no noise but form: far beyond the sizes at which a maximum is sought."""
    known = _Field((1.0, 1.0), np.full(4, 1e15), np.diag([1.0, 2.0, 3.0, 4.0]), np.eye(3), 1.0)
    assert math.log(known.maximise().variance * 4.0) == pytest.approx(LEVELS[-1])


@pytest.mark.parametrize("points", [0, 7, 8, 31, 32, 33, 500, 1151, 1152, 10**6])
def test_cells_hold_enough_points_on_average(points):
    across = cells_across(points)
    assert 1 <= across <= CELLS
    assert across == 1 or across**2 * POINTS_A_CELL <= points
    assert across == CELLS or (across + 1) ** 2 * POINTS_A_CELL > points
