"""Two brightnesses of a face by all thresholds, and tests of significance by plain statistics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from wheelplane.plane.brightness import _Brightness, _is_distinct, _is_significant, _threshold
from wheelplane.plane.correlated_noise import Cells


def explained(shade, threshold):
    """Share of the variance between the points above a threshold and the others."""
    above = shade > threshold
    parts = [shade[above], shade[~above]]
    within = sum(len(part) * part.var() for part in parts if len(part))
    return 1.0 - within / (len(shade) * shade.var())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_two_brightnesses_are_parted_where_that_explains_most(seed, share):
    rng = np.random.default_rng(seed)
    dark = rng.uniform(size=4000) < share
    shade = np.where(dark, rng.normal(0.2, 0.05, 4000), rng.normal(0.8, 0.07, 4000)).clip(0, 1)
    found = _threshold(shade)
    best = max(explained(shade, at) for at in np.linspace(0.01, 0.99, 197))
    assert best > 0.8
    assert explained(shade, found) > best - 2e-3  # classes of 1/256 of the range
    moved = _threshold(0.25 + 0.5 * shade)
    assert moved == pytest.approx(0.25 + 0.5 * found, abs=1e-12)


@pytest.mark.parametrize(("spread", "two"), [(0.13, True), (0.18, False)])
def test_two_classes_explain_four_fifths_or_are_not_two(spread, two):
    """Classes 0.6 apart explain 0.09 / (0.09 + spread^2): 0.84 and 0.74."""
    rng = np.random.default_rng(1)
    shade = np.concatenate([rng.normal(at, spread, 40_000) for at in (0.2, 0.8)])
    assert (_threshold(shade) is not None) == two
    assert _threshold(rng.uniform(size=5000)) is None
    assert _threshold(rng.normal(size=5000)) is None


def test_brightness_runs_from_the_5th_to_the_95th_percentile_and_is_the_median_where_unknown():
    values = np.random.default_rng(2).permutation(np.arange(1001.0)).astype(np.float32)
    found = _Brightness.of(values, np.ones(1001, dtype=bool))
    assert (found.dark, found.middle, found.bright) == (50.0, 500.0, 950.0)
    shade = found.shade(np.array([-5.0, 50.0, 275.0, np.nan, 950.0, 2000.0]))
    np.testing.assert_allclose(shade, [0.0, 0.0, 0.25, 0.5, 1.0, 1.0])
    some = values.copy()
    some[:500] = np.nan
    assert _Brightness.of(some, np.ones(1001, dtype=bool)) is not None
    some[500] = np.nan
    assert _Brightness.of(some, np.ones(1001, dtype=bool)) is None  # under half is known
    assert _Brightness.of(np.full(9, 7.0, np.float32), np.ones(9, dtype=bool)) is None


def cells(seed, step=0.0):
    """Cells of a disc of 0.1 m with white residuals of 1e-4 m a point, and a step by brightness."""
    rng = np.random.default_rng(seed)
    index = np.argwhere(np.hypot(*np.indices((11, 11)) - 5.0) < 5.5)
    uv = (index - 5.0) * 0.02 + rng.normal(0, 1e-3, index.shape)
    count = rng.integers(20, 90, len(index)).astype(float)
    shade = rng.uniform(size=len(index))
    design = np.column_stack(
        [np.ones(len(uv)), uv, uv[:, :1] ** 2, uv[:, 0] * uv[:, 1], uv[:, 1:] ** 2]
    )
    root = np.sqrt(count)
    full = np.column_stack([design, shade]) * root[:, None]
    mean = 1e-6 * rng.normal(size=len(uv))
    fitted = np.linalg.lstsq(full, root * mean)[0]
    u = 1e-4 * np.sqrt(np.linalg.inv(full.T @ full)[-1, -1])
    mean = mean - shade * fitted[-1] + shade * step * u
    return Cells(uv, mean, count, index, 0.02, 1e-8, shade[:, None])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_significant_beyond_one_false_alarm_in_a_million(seed, sign):
    """The test is two-sided, whatever tilt and bowl the heights have besides."""
    limit = stats.norm.isf(0.5e-6)
    for share, seen in ((0.97, False), (1.03, True)):
        known = cells(seed, sign * share * limit)
        u, v = known.uv_m.T
        known.mean_m[:] += 3e-5 + 1e-3 * u - 2e-3 * v + 0.02 * u * u - 0.03 * u * v + 0.01 * v * v
        assert _is_significant(known, 0.1, 0.0) == seen


def test_brightness_that_is_a_bowl_shows_no_step():
    known = cells(1)
    u, v = known.uv_m.T
    bowl = 5.0 + u + u * v - 2.0 * v * v + 3.0 * u * u
    known = replace(known, extra=bowl[:, None], mean_m=known.mean_m + 0.1 * bowl)
    assert not _is_significant(known, 0.1, 0.0)


@pytest.mark.parametrize(("share", "distinct"), [(0.08, False), (0.12, True)])
def test_brightness_is_distinct_if_a_tilt_leaves_a_tenth_of_it(share, distinct):
    """By weighted least squares: the part across a tilt is scaled to that share of all."""
    known = cells(4)
    root = np.sqrt(known.count)
    tilt = np.column_stack([np.ones(len(root)), known.uv_m]) * root[:, None]
    mixed = root * np.random.default_rng(1).normal(size=len(root))
    rest = mixed - tilt @ np.linalg.lstsq(tilt, mixed)[0]
    along = tilt @ [0.0, 1.0, 2.0]
    about = along - tilt[:, 0] * (tilt[:, 0] @ along) / (tilt[:, 0] @ tilt[:, 0])
    rest *= np.sqrt(share / (1.0 - share) * (about @ about) / (rest @ rest))
    known.extra[:, 0] = (about + rest + 3.0 * root) / root
    assert _is_distinct(known) == distinct
