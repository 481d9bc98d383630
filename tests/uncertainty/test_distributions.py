"""Distributions: probabilities and quantiles are those of scipy.stats, limits keep their level."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from scipy import integrate, special, stats

from wheelplane.uncertainty.distributions import (
    binomial_tail,
    chi_square_beyond,
    chi_square_limits,
    coverage_factor,
    f_beyond,
    f_sum_limits,
    least_tail,
    power_of_f,
    power_of_t,
    quantile,
    share_limits,
    tail,
    tails,
)

DOF = [1.0, 2.5, 8.0, 300.0, math.inf]
LEVELS = [0.68, 0.95, 0.999]


def student(dof):
    return stats.norm() if math.isinf(dof) else stats.t(dof)


@pytest.mark.parametrize("dof", DOF)
def test_tail_and_quantile_are_those_of_students_t(dof):
    for x in (-3.0, 0.0, 0.7, 6.0):
        assert tail(x, dof) == pytest.approx(student(dof).sf(x), rel=1e-12)
    for probability in (0.001, 0.5, 0.9, 0.9999):
        found = quantile(probability, dof)
        assert found == pytest.approx(student(dof).ppf(probability), rel=1e-9, abs=1e-12)
        assert tail(found, dof) == pytest.approx(1.0 - probability, rel=1e-9)


def test_tails_of_an_array_are_those_of_its_elements():
    x = np.array([[-2.0, 0.3, 7.0, 1.0, 30.0]] * 2)
    expected = [tail(a, dof) for a, dof in zip(x[0], DOF, strict=True)]
    np.testing.assert_allclose(tails(x, np.array([DOF] * 2)), [expected] * 2, rtol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_the_least_tail_is_that_of_all(seed):
    """The largest x has it only where it has the degrees of freedom as well."""
    rng = np.random.default_rng(seed)
    x, dof = rng.uniform(0.0, 6.0, 15), rng.choice([*DOF, 2.0, 4.0, math.inf], 15)
    assert least_tail(x, dof) == pytest.approx(tails(x, dof).min(), rel=1e-9)
    assert least_tail(x[:1], dof[:1]) == pytest.approx(tail(x[0], dof[0]), rel=1e-12)


@pytest.mark.parametrize("level", LEVELS)
def test_coverage_factors_hold_the_level_at_every_dof(level):
    k = coverage_factor(level, np.array(DOF))
    inside = [student(dof).cdf(x) - student(dof).cdf(-x) for dof, x in zip(DOF, k, strict=True)]
    np.testing.assert_allclose(inside, level, rtol=1e-9)
    assert np.all(np.diff(k) < 0.0)  # fewer degrees of freedom, wider interval


@pytest.mark.parametrize(("level", "digits"), [(0.9, 1e-11), (0.95, 1e-11), (0.99, 1e-9)])
def test_coverage_factors_are_quantiles_of_students_t(level, digits):
    dof = np.concatenate([np.geomspace(1.0, 1e9, 301), np.arange(1.0, 40.0)])
    expected = stats.t(dof).ppf(0.5 + level / 2.0)
    np.testing.assert_allclose(coverage_factor(level, dof), expected, rtol=digits)
    assert coverage_factor(level, dof[:0]).shape == (0,)


def test_what_every_result_needs_is_there_without_scipy():
    code = (
        "import sys, numpy as np\n"
        "from wheelplane.uncertainty import distributions as known\n"
        "known.coverage_factor(0.95, np.array([4.0])), known.chi_square_beyond(3.0, 2)\n"
        "known.f_beyond(3.0, 2, 8.0), known.tail(1.3, 4.0), known.quantile(0.95, 4.0, 0.5)\n"
        "assert 'scipy' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("dof", [1, 4, 90, 2001])
def test_chi_square_and_its_limits(dof):
    for value in (0.0, 0.5, 30.0, 1600.0):
        assert chi_square_beyond(value, dof) == pytest.approx(stats.chi2.sf(value, dof), rel=1e-10)
    for level in LEVELS:
        low, high = chi_square_limits(level, dof)
        assert stats.chi2.cdf(low, dof) == pytest.approx((1.0 - level) / 2.0, rel=1e-9)
        assert stats.chi2.sf(high, dof) == pytest.approx((1.0 - level) / 2.0, rel=1e-9)


@pytest.mark.parametrize("count", [1, 5])
def test_f_is_scipys_and_becomes_chi_square(count):
    for value in (0.2, 1.0, 7.0):
        assert f_beyond(value, count, 6.5) == pytest.approx(
            stats.f.sf(value, count, 6.5), rel=1e-12
        )
        limit = f_beyond(value, count, math.inf)
        assert limit == pytest.approx(f_beyond(value, count, 1e9), rel=1e-6)
        assert limit != pytest.approx(f_beyond(value, count, 6.5), rel=0.01)


@pytest.mark.parametrize("dof", [1.0, 2.5, 30.0, 300.0, 1e4])
@pytest.mark.parametrize("count", [1, 2, 3, 10, 1001])
def test_f_is_scipys_to_twelve_digits(count, dof):
    value = np.array([1e-6, 0.01, 0.2, 0.7, 1.0, 1.3, 2.0, 7.0, 50.0, 1e4])
    expected = special.fdtrc(count, dof, value)
    found = np.array([f_beyond(each, count, dof) for each in value])
    seen = expected > 1e-280
    np.testing.assert_allclose(found[seen], expected[seen], rtol=1e-12)
    assert f_beyond(0.0, count, dof) == 1.0
    assert f_beyond(math.inf, count, dof) == 0.0


def test_f_of_two_counts_has_a_closed_form_for_any_dof():
    for dof in (1.0, 1e3, 1e7):
        closed = math.exp(-0.5 * dof * math.log1p(3.0 / (0.5 * dof)))
        assert f_beyond(3.0, 2, dof) == pytest.approx(closed, rel=1e-9)


def test_f_of_one_count_is_a_two_sided_t():
    for x in (0.3, 1.0, 4.0):
        assert f_beyond(x * x, 1, 7.0) == pytest.approx(2.0 * tail(x, 7.0), rel=1e-12)


@pytest.mark.parametrize("dof", DOF)
@pytest.mark.parametrize("shift", [0.0, 1.5, 4.0])
def test_power_of_t_is_the_probability_beyond_the_critical_value(dof, shift):
    critical = student(dof).ppf(0.975)
    shifted = stats.norm(shift) if math.isinf(dof) else stats.nct(dof, shift)
    assert power_of_t(shift, 0.95, dof) == pytest.approx(shifted.sf(critical), rel=1e-7)


@pytest.mark.parametrize("dof", [3.0, 40.0, math.inf])
@pytest.mark.parametrize("count", [1, 6])
def test_power_of_f_is_that_of_the_noncentral_distribution(dof, count):
    """At no noncentrality it is the size of the test; it grows with it."""
    assert power_of_f(0.0, 0.95, count, dof) == pytest.approx(0.05, rel=1e-7)
    found = [power_of_f(square, 0.95, count, dof) for square in (2.0, 10.0)]
    for square, power in zip((2.0, 10.0), found, strict=True):
        if math.isinf(dof):
            wanted = stats.ncx2.sf(stats.chi2.ppf(0.95, count), count, square)
        else:
            wanted = stats.ncf.sf(stats.f.ppf(0.95, count, dof), count, dof, square)
        assert power == pytest.approx(wanted, rel=1e-6)
    assert 0.05 < found[0] < found[1]


@pytest.mark.parametrize(("hits", "total"), [(0, 7), (3, 7), (7, 7), (188, 200)])
@pytest.mark.parametrize("level", LEVELS)
def test_limits_of_a_proportion_are_those_of_clopper_and_pearson(hits, total, level):
    low, high = share_limits(hits, total, level)
    wanted = stats.binomtest(hits, total).proportion_ci(level, method="exact")
    assert (low, high) == pytest.approx((wanted.low, wanted.high), rel=1e-9, abs=1e-12)
    assert low <= hits / total <= high


def test_binomial_tail_by_adding_up():
    for hits in range(6):
        added = sum(math.comb(5, k) * 0.2**k * 0.8 ** (5 - k) for k in range(hits, 6))
        assert binomial_tail(hits, 5, 0.2) == pytest.approx(added, rel=1e-12)


def test_limits_of_a_sum_of_f_keep_their_level():
    """One F by its quantiles, known ones by the chi-square, several by other draws."""
    for count, dof in ((8, 9.0), (12, 30.0), (1, 3.0)):
        low, high = f_sum_limits(0.95, [count], [dof])
        levels = stats.f.cdf(np.array([low, high]) / count, count, dof)
        np.testing.assert_allclose(levels, [0.025, 0.975], atol=5 * 0.0011)
    known = f_sum_limits(0.95, [8, 12], [math.inf, math.inf])
    assert known == pytest.approx(chi_square_limits(0.95, 20))
    assert f_sum_limits(0.95, [], []) == (0.0, 0.0)
    rng = np.random.default_rng(1)
    total = rng.chisquare(5, 100_000)
    for count, dof in ((8, 8.5), (8, 14.0)):
        total += count * rng.f(count, dof, 100_000)
    low, high = f_sum_limits(0.95, [8, 8, 5], [8.5, 14.0, math.inf])
    for limit, level in ((low, 0.025), (high, 0.975)):
        assert np.mean(total < limit) == pytest.approx(level, abs=5 * 0.0012)


@pytest.mark.parametrize("own", [1.0, 2.0, 6.5, math.inf])
@pytest.mark.parametrize("share", [0.2, 0.7, 0.99])
def test_a_sum_with_a_rectangle_has_the_tails_of_the_convolution(own, share):
    """The tail of Student's t averaged over the rectangle by scipy's quadrature."""
    scale, half = math.sqrt(1.0 - share**2), math.sqrt(3.0) * share
    dof = own / scale**4
    for x in (0.3, 1.0, 1.9, 4.0):
        averaged, _ = integrate.quad(
            lambda r, x=x: student(own).sf((x - r) / scale) / (2.0 * half),
            -half, half, points=[min(half, x)], epsrel=1e-11,
        )  # fmt: skip
        assert tail(x, dof, share) == pytest.approx(averaged, rel=1e-7)
        assert tail(-x, dof, share) == pytest.approx(1.0 - averaged, rel=1e-7)
    k = quantile(0.975, dof, share)
    assert tail(k, dof, share) == pytest.approx(0.025, rel=1e-9)
    assert quantile(0.025, dof, share) == pytest.approx(-k)
    assert abs(k - quantile(0.975, dof)) > 1e-4


def test_a_rectangle_alone_has_k_of_1_65_and_none_that_of_students_t():
    assert quantile(0.975, math.inf, 1.0) == pytest.approx(0.95 * math.sqrt(3.0), rel=1e-6)
    assert quantile(0.975, 7.0, 0.0) == pytest.approx(stats.t.ppf(0.975, 7.0))
    # Two alike, one of them counted as normal: EA-4/02, S9.14 has 1.90 for the triangle.
    assert quantile(0.975, math.inf, math.sqrt(0.5)) == pytest.approx(1.902, rel=0.01)


@pytest.mark.parametrize("own", [4.0, math.inf])
def test_power_with_a_rectangle_is_the_rate_of_detection(own):
    rng, count, share, shift = np.random.default_rng(3), 200_000, 0.8, 2.0
    scale = math.sqrt(1.0 - share**2)
    drawn = np.sqrt(rng.chisquare(own, count) / own) if math.isfinite(own) else 1.0
    seen = scale * rng.standard_normal(count) + math.sqrt(3.0) * share * rng.uniform(-1, 1, count)
    dof = own / scale**4
    power = power_of_t(shift, 0.95, dof, share)
    rate = np.mean(shift + seen > quantile(0.975, dof, share) * drawn)
    assert power == pytest.approx(rate, abs=0.005 if math.isinf(own) else 0.06)
    assert abs(power_of_t(shift, 0.95) - rate) > 0.01


@pytest.mark.parametrize("uniform", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("dof", [1.0, 3.0, 40.0, math.inf])
@pytest.mark.parametrize("probability", [0.3, 0.6, 0.975])
def test_quantiles_lie_on_both_sides_of_the_median(probability, dof, uniform):
    """That of 1 - p is the opposite of that of p, and below zero only under a half."""
    dof = dof / (1.0 - uniform**2) ** 2
    one, other = quantile(probability, dof, uniform), quantile(1.0 - probability, dof, uniform)
    assert one == pytest.approx(-other, rel=1e-12)
    assert (one > 0.0) == (probability > 0.5)
    assert quantile(0.5, dof, uniform) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("shift", [0.5, 2.5])
@pytest.mark.parametrize("uniform", [0.2, 0.8])
def test_power_with_a_rectangle_is_its_mean_over_the_rectangle(uniform, shift):
    """By adaptive quadrature of the noncentral t; 200 nodes leave some 1e-5."""
    scale = math.sqrt(1.0 - uniform**2)
    dof = 6.0 / scale**4
    limit = quantile(0.975, dof, uniform) / scale
    half = math.sqrt(3.0) * uniform

    def detected(inside):
        return stats.nct.sf(limit, 6.0, (shift + inside) / scale)

    wanted = integrate.quad(detected, -half, half, epsabs=1e-9)[0] / (2.0 * half)
    assert power_of_t(shift, 0.95, dof, uniform) == pytest.approx(wanted, abs=3e-5)
