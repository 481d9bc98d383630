"""Tests of gauge R&R against the worked example of AIAG, and on known variance components."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.calibration.gauge_rr import gauge_rr

# AIAG, Measurement Systems Analysis, 4th edition (2010): readings of the gauge repeatability and
# reproducibility data sheet (figure III-B 15), appraisers A, B, C, three trials of ten parts.
A = [[0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
     [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
     [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31]]  # fmt: skip
B = [[0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
     [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
     [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50]]  # fmt: skip
C = [[0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
     [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
     [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16]]  # fmt: skip
AIAG = np.array([A, B, C]).transpose(2, 0, 1)


def test_the_anova_table_of_aiag_to_its_printed_digits():
    """Its table of the analysis of variance: DF, SS, MS and F over equipment."""
    printed = {
        "appraiser": (2, "3.1673", "1.58363", "34.44"),
        "part": (9, "88.3619", "9.81799", "213.52"),
        "appraiser by part": (18, "0.3590", "0.01994", "0.434"),
        "equipment": (60, "2.7589", "0.04598", None),
        "total": (89, "94.6471", None, None),
    }
    rows = {row.source: row for row in gauge_rr(AIAG, ("A", "B", "C")).rows}
    assert list(rows) == list(printed)
    for source, (dof, squares, mean, f) in printed.items():
        row = rows[source]
        assert row.dof == dof
        assert f"{row.sum_of_squares:.4f}" == squares
        if mean:
            assert f"{row.mean_square:.5f}" == mean
        if f:
            assert f"{row.f:.{len(f.partition('.')[2])}f}" == f


def test_the_components_of_aiag_to_their_printed_digits():
    """Its table of variation: standard deviations, % of total variation, % contribution, ndc."""
    found = gauge_rr(AIAG, ("A", "B", "C"))
    printed = {
        found.ev: (0.199933, 18.4, 3.4),
        found.av: (0.226838, 20.9, 4.4),
        found.interaction: (0.0, 0.0, 0.0),
        found.grr: (0.302373, 27.9, 7.8),
        found.pv: (1.042327, 96.0, 92.2),
    }
    assert found.pooled
    for size, (deviation, of_total, contribution) in printed.items():
        # The manual adds up rounded squares: its GRR differs from the root by 1.5e-6.
        assert size == pytest.approx(deviation, abs=2e-6)
        assert round(100 * size / found.tv, 1) == of_total
        assert round(100 * (size / found.tv) ** 2, 1) == contribution
    assert round(found.tv, 3) == 1.085
    assert found.distinct_categories == 4


def test_planted_components_are_found_and_a_real_interaction_is_kept():
    rng = np.random.default_rng(5)
    P, K, R = 60, 40, 4
    values = (
        rng.normal(0.0, 3.0, (P, 1, 1)) + rng.normal(0.0, 0.8, (1, K, 1))
        + rng.normal(0.0, 0.5, (P, K, 1)) + rng.normal(0.0, 0.3, (P, K, R))
    )  # fmt: skip
    found = gauge_rr(values, tuple(map(str, range(K))))
    assert not found.pooled
    for size, true, dof in ((found.ev, 0.3, P * K * (R - 1)), (found.interaction, 0.5, P * K),
                            (found.av, 0.8, K - 1), (found.pv, 3.0, P - 1)):  # fmt: skip
        assert size == pytest.approx(true, rel=4.0 / np.sqrt(2.0 * dof))


def test_the_table_does_not_depend_on_order_or_offset_and_scales():
    rng = np.random.default_rng(6)
    known = gauge_rr(AIAG, ("A", "B", "C"))
    mixed = AIAG[rng.permutation(10)][:, rng.permutation(3)][:, :, rng.permutation(3)]
    found = gauge_rr(7.0 * (mixed + 3.0), ("A", "B", "C"))
    for name in ("ev", "av", "pv", "grr", "tv"):
        assert getattr(found, name) == pytest.approx(7.0 * getattr(known, name), rel=1e-9)
    assert sum(row.sum_of_squares for row in known.rows[:-1]) == pytest.approx(
        float(np.sum((AIAG - AIAG.mean()) ** 2))
    )


@pytest.mark.parametrize("seed", range(8))
def test_readings_that_differ_from_part_to_part_alone_have_no_limit_of_categories(seed):
    """Means of equal numbers differ by rounding, which is neither equipment nor appraiser."""
    rng = np.random.default_rng(seed)
    of_parts = np.radians(rng.integers(-60, 60, 12) / 60.0)
    found = gauge_rr(np.tile(of_parts[:, None, None], (1, 2, 3)), ("A", "B"))
    assert (found.ev, found.av, found.interaction, found.grr) == (0.0, 0.0, 0.0, 0.0)
    assert found.pv == pytest.approx(np.std(of_parts, ddof=1))
    assert found.distinct_categories is None
    assert [row.f for row in found.rows] == [None] * 5


def test_readings_without_any_scatter_have_no_test_and_no_components():
    found = gauge_rr(np.zeros((3, 2, 2)), ("A", "B"))
    assert (found.ev, found.av, found.pv, found.distinct_categories) == (0.0, 0.0, 0.0, 1)
    assert [row.f for row in found.rows] == [None] * 5
