"""Lines at which a face steps or bends, by plain least squares over the cells of its residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

from wheelplane.plane.correlated_noise import Cells, correlated_noise
from wheelplane.plane.face_break import (
    DIRECTIONS,
    DISTANCES_OF_RADIUS,
    KINDS,
    UNLIKELY,
    Lines,
    _Fits,
    _likely_lines,
    noise_and_break,
)

RADIUS_M, WHITE_M, POINTS = 0.12, 1e-4, 40.0
SQUARE, UP = (12, 12), (24, 5)


def cells(shape=SQUARE, seed=0, noise=1.0, height=None, columns=0):
    """Residuals of a plane in the cells of a disc: noise of the points, and height(u, v).

    noise: its size by that of WHITE_M. columns: fitted besides the plane.
    """
    rng = np.random.default_rng([seed, *shape])
    side = 2.0 * RADIUS_M / np.array(shape)
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape)), axis=-1).reshape(-1, 2)
    uv = (index + 0.5) * side - RADIUS_M
    index, uv = index[np.hypot(*uv.T) < RADIUS_M], uv[np.hypot(*uv.T) < RADIUS_M]
    count = rng.integers(0.5 * POINTS, 1.5 * POINTS, len(uv)) * np.prod(SQUARE) / np.prod(shape)
    mean = noise * WHITE_M * rng.normal(size=len(uv)) / np.sqrt(count)
    mean += 0.0 if height is None else height(*uv.T)
    extra = np.sin(30.0 * uv[:, :1] + np.arange(columns)) if columns else None
    of_square = float(side[0]) if shape[0] == shape[1] else side
    found = Cells(uv, mean, count, index, of_square, WHITE_M**2, extra)
    return replace(found, mean_m=mean - found.slopes @ solved(found, found.slopes)[0])


def solved(known, terms):
    """Coefficients of the cells' means by terms (C, K), and what is left of their squares."""
    root = np.sqrt(known.count)
    found = np.linalg.lstsq(root[:, None] * terms, root * known.mean_m)[0]
    return found, known.count @ (known.mean_m - terms @ found) ** 2


def step(size_m, turn, at_m):
    return lambda u, v: size_m * (u * np.cos(turn) + v * np.sin(turn) > at_m)


@pytest.mark.parametrize("quarter", range(4))
def test_a_cell_steps_by_its_share_beyond_the_line_and_bends_by_its_distance(quarter):
    rng = np.random.default_rng(quarter)
    side, at = 0.02, float(rng.uniform(-0.05, 0.05))
    middles = rng.uniform(-0.1, 0.1, (60, 2))
    turn = quarter * np.pi / 2.0
    ticks = side * ((np.arange(200) + 0.5) / 200 - 0.5)
    inside = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    beyond = (middles[:, None] + inside) @ [np.cos(turn), np.sin(turn)] - at
    found = {
        kind: Lines.of(kind, np.array([turn]), np.array([at]), side).columns(middles)[:, 0]
        for kind in KINDS
    }
    np.testing.assert_allclose(found["step"], np.mean(beyond > 0.0, axis=1), atol=1.01 / 200)
    one_side = np.all(beyond > 0.0, axis=1) | np.all(beyond < 0.0, axis=1)
    assert np.count_nonzero(one_side) > 30
    bent = beyond.clip(min=0.0).mean(axis=1)
    np.testing.assert_allclose(found["bend"][one_side], bent[one_side], atol=1e-12)


def test_lines_lie_at_each_turn_and_distance_and_one_of_them_is_that_alone():
    turns, distances = np.array([0.2, 1.0, 2.5]), np.array([-0.03, 0.01])
    lines = Lines.of("bend", turns, distances, 0.02)
    uv = np.random.default_rng(1).uniform(-0.1, 0.1, (7, 2))
    for index, (turn, at) in enumerate((turn, at) for turn in turns for at in distances):
        one = lines.one(index)
        assert one.directions.shape == (1, 2)
        np.testing.assert_allclose(one.directions[0], [np.cos(turn), np.sin(turn)])
        assert one.distances_m.tolist() == [at]
        found = one.columns(uv)
        assert found.shape == (7, 1)
        np.testing.assert_allclose(found[:, 0], lines.columns(uv)[:, index], atol=1e-15)


@pytest.mark.parametrize("columns", [0, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_each_line_is_one_more_unknown_of_least_squares(kind, columns):
    """Its size, its gain in likelihood, and the plane's height and slopes without it and with."""
    known = cells(height=step(4e-5, 0.7, 0.02), columns=columns)
    turns, distances = np.linspace(0.0, 3.0, 7), RADIUS_M * np.array([-0.6, -0.1, 0.3, 2.0, -2.0])
    lines = Lines.of(kind, turns, distances, known.side_m)
    found = _Fits.of(lines, known)
    plane, square = solved(known, known.slopes)
    assert found.by_shape.shape == (3, 35)
    assert found.covariance.shape == (3, 3)
    for index, column in enumerate(lines.columns(known.uv_m).T):
        all_of, left = solved(known, np.column_stack([known.slopes, column]))
        if abs(lines.distances_m[index]) > RADIUS_M:  # all cells on one side: nothing is seen
            all_of, left = np.append(plane, 0.0), square
        assert found.size[index] == pytest.approx(all_of[-1], rel=1e-6, abs=1e-15)
        gain = 0.5 * (square - left) / WHITE_M**2
        assert found.gain[index] == pytest.approx(gain, rel=1e-6, abs=1e-9)
        moved = plane[:3] - all_of[:3]
        np.testing.assert_allclose(found.by_shape[:, index], moved, rtol=1e-6, atol=1e-12)
    assert found.most == found.gain.max() == found.gain[found.best]


@pytest.mark.parametrize("seed", range(12))
def test_a_clear_step_is_found_nearer_than_between_the_lines_first_tried(seed):
    """Within a quarter of their distance; halfway between two of them it is a half."""
    rng = np.random.default_rng(seed)
    turn, at = rng.uniform(0.0, 2.0 * np.pi), RADIUS_M * rng.uniform(-0.6, 0.6)
    clear = Lines.of("step", np.array([turn]), np.array([at]), 2.0 * RADIUS_M / SQUARE[0])
    known = cells(
        seed=seed, height=lambda u, v: 3e-4 * clear.columns(np.column_stack([u, v]))[:, 0]
    )
    likely = _likely_lines(known, RADIUS_M)
    line = likely.shapes.one(likely.best)
    assert line.kind == "step"
    cosine = float(line.directions[0] @ clear.directions[0])
    assert np.arccos(min(1.0, abs(cosine))) < 0.25 * np.pi / DIRECTIONS
    apart_m = RADIUS_M * float(DISTANCES_OF_RADIUS[1] - DISTANCES_OF_RADIUS[0])
    assert abs(np.sign(cosine) * line.distances_m[0] - at) < 0.25 * apart_m
    if abs(at) > apart_m:  # the smaller part lies beyond
        assert np.sign(cosine) == np.sign(at)


def believed(known, lined):
    """Probability of the likeliest line, by the kind of cells that shows the most, and the noises.

    The noise of the cells as they are, and without what the line leaves in them.
    """
    likely = _likely_lines(known, RADIUS_M)
    line, size = likely.shapes.one(likely.best), likely.size[likely.best]
    less, gains = [], []
    for one in (known, *lined):
        rest = replace(one, mean_m=one.mean_m - size * line.columns(one.uv_m)[:, 0])
        rest = replace(rest, mean_m=rest.mean_m - rest.slopes @ solved(rest, rest.slopes)[0])
        gains.append(one.count @ (one.mean_m**2 - rest.mean_m**2) / (2.0 * WHITE_M**2))
        less.append(rest)
    plain = correlated_noise(known, RADIUS_M, WHITE_M, 0.0, lined)
    rest = correlated_noise(less[0], RADIUS_M, WHITE_M, 0.0, less[1:])
    with_line, without = max(zip(np.add(gains, rest.gains), plain.gains, strict=True), key=max)
    return special.expit(with_line - without - UNLIKELY), plain, rest


def assert_belief(known, lined):
    """Check belief and noise of noise_and_break; return the belief, of a line that it leaves too.

    Left out are lines of a belief that counts for nothing.
    """
    belief, plain, rest = believed(known, lined)
    noise, found = noise_and_break(known, RADIUS_M, WHITE_M, 0.0, lined)
    if found is None:
        assert belief < 0.15
        np.testing.assert_array_equal(noise.form_covariance, plain.of_plane.form_covariance)
        return belief
    assert found.belief == pytest.approx(belief, rel=1e-6)
    likelier = (rest if belief > 0.5 else plain).of_plane
    scale = np.abs(found.covariance).max() + np.abs(plain.covariance).max()
    np.testing.assert_allclose(noise.covariance, likelier.covariance, atol=1e-9 * scale)
    form = likelier.form_covariance + belief * _likely_lines(known, RADIUS_M).covariance
    np.testing.assert_allclose(noise.form_covariance, form, rtol=1e-6, atol=1e-9 * scale)
    assert noise.sigma_m == pytest.approx(likelier.sigma_m, rel=1e-6)
    return belief


def test_where_no_noise_is_clear_a_line_is_believed_by_its_gain_alone():
    """A probability of a third counts in the plane's form."""
    known = cells(height=step(2.8e-5, 0.7, 0.02))
    likely = _likely_lines(known, RADIUS_M)
    noise, found = noise_and_break(known, RADIUS_M, WHITE_M, 0.0)
    assert noise.sigma_m == 0.0
    assert found is not None
    assert 0.3 < found.belief < 0.45
    assert found.belief == pytest.approx(special.expit(likely.most - UNLIKELY), rel=1e-9)
    form = found.belief * likely.covariance
    np.testing.assert_allclose(noise.form_covariance, form, rtol=1e-9)


BELIEFS = {
    2.2e-5: (0.0, 0.1),
    2.8e-5: (0.3, 0.45),
    3.4e-5: (0.0, 0.1),  # here the noise is clear as well
    4.0e-5: (0.5, 0.6),
    4.2e-5: (0.6, 0.75),
    4.6e-5: (0.9, 0.95),
    6.0e-5: (0.999, 1.0),
}


@pytest.mark.parametrize("size_m", BELIEFS)
def test_belief_in_a_line_is_its_probability_from_doubt_to_certainty(size_m):
    """Steps of growing height; the noise is that of the likelier of both explanations."""
    least, most = BELIEFS[size_m]
    assert least < assert_belief(cells(height=step(size_m, 0.7, 0.02)), []) < most


@pytest.mark.parametrize(
    ("size", "seen", "waves_m"),
    [(2.8e-5, 0.0, 1.4e-5), (3e-5, 1.0, 3e-5), (4e-5, 1.0, 0.0)],
    ids=["in squares", "along lines, in noise", "along lines"],
)
def test_belief_is_that_of_the_cells_that_show_noise_or_line_the_clearest(size, seen, waves_m):
    """Cells along lines that show the step or not, and noise of that size from line to line."""
    known, line = cells(height=step(size, 0.7, 0.02)), step(seen * size, 0.7, 0.02)
    lined = cells(UP, height=lambda u, v: line(u, v) + waves_m * np.sin(200.0 * u))
    assert 0.3 < assert_belief(known, [lined]) < 0.95


def test_a_line_in_cells_of_more_columns_counts_for_the_plane_alone():
    known = cells(height=step(6e-5, 0.7, 0.02), columns=1)
    assert assert_belief(known, []) > 0.9
