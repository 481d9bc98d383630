"""Control charts: a published example, the rules by another way, and their rates of false alarm."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest

from tests.support.records import add, result
from wheelplane.batch.catalogue.catalogue import open_catalogue, rebuild
from wheelplane.batch.results.control_chart import (
    RULES,
    ControlLimits,
    broken_rules,
    control_chart,
    control_limits,
)
from wheelplane.batch.results.query import Filter
from wheelplane.batch.storage.store import open_store

# NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2: flow rates of ten batches.
FLOW = np.array([49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1])
STANDARD = ControlLimits(0.0, 1.0, -3.0, 3.0, 1.128, 3.686)


def test_the_limits_are_those_of_the_handbook():
    """Its limits, 45.8159 and 55.8041, have d2 rounded to 1.128."""
    found = control_limits(FLOW)
    assert found.mean == pytest.approx(50.81, abs=1e-9)
    assert found.range_mean == pytest.approx(1.8778, abs=5e-5)
    half = 3.0 * 1.8778 / 1.128
    rounding = half * 0.0005 / 1.128 + 1e-4
    assert found.upper == pytest.approx(55.8041, abs=rounding)
    assert found.lower == pytest.approx(45.8159, abs=rounding)
    assert found.range_upper == pytest.approx(3.267 * found.range_mean, rel=2e-4)
    assert broken_rules(FLOW, found) == [()] * 10  # as the handbook says: in control


def test_the_standard_deviation_is_that_of_normal_values():
    x = np.random.default_rng(1).normal(5.0, 2.0, 40_000)
    found = control_limits(x)
    assert found.sigma == pytest.approx(2.0, abs=4.0 * 2.0 * 0.83 / math.sqrt(len(x)))


def zones(z):
    """Letters by zone: A, B, C above the mean outwards to D, and a, b, c, d below."""
    names = "ABCD"
    letters = [names[min(int(abs(v)), 3)] for v in z]
    return "".join(c if v > 0 else c.lower() for c, v in zip(letters, z, strict=True))


def by_patterns(z):
    """The rules as patterns of the text that ends at a point."""
    text = zones(z)
    steps = "".join("+-"[b < a] for a, b in itertools.pairwise(z))
    patterns = {
        1: "[Dd]$",
        2: "([A-D]{9}|[a-d]{9})$",
        5: "([CD][CD]|[CD].[CD]|[cd][cd]|[cd].[cd])$",
        6: "|".join(
            f"({''.join(c if i != hole else '.' for i, c in enumerate(['[' + s + ']'] * 5))})$"
            for s in ("BCD", "bcd")
            for hole in range(4)
        )
        + "|[BCD]{4}$|[bcd]{4}$",
        7: "[Aa]{15}$",
        8: "[B-Db-d]{8}$",
    }
    moves = {3: r"(\+{5}|-{5})$", 4: r"((\+-){6}\+|(-\+){6}-)$"}
    found = []
    for i in range(len(z)):
        here = {n for n, pattern in patterns.items() if re.search(pattern, text[: i + 1])}
        here |= {n for n, pattern in moves.items() if re.search(pattern, steps[:i])}
        found.append(tuple(sorted(here)))
    return found


def test_the_rules_are_those_of_nelson_by_patterns():
    rng = np.random.default_rng(3)
    seen = set()
    for scale, drift in ((1.0, 0.0), (0.4, 0.0), (2.0, 0.0), (1.0, 0.05), (0.6, 0.3)):
        z = rng.normal(0.0, scale, 1500)
        z = z + drift * (np.arange(1500) % 40 - 20)
        z[700:760] = np.abs(z[700:760]) * (-1.0) ** np.arange(60)
        found = broken_rules(z, STANDARD)
        assert found == by_patterns(z.tolist())
        seen |= {rule for rules in found for rule in rules}
    assert seen == set(RULES)


def test_false_alarms_are_as_frequent_as_nelson_states():
    """False alarms of independent normal values with known sigma: by orders and the normal law."""
    count = 400_000
    z = np.random.default_rng(5).normal(size=count)
    found = broken_rules(z, STANDARD)
    beyond, inside = math.erfc(3.0 / math.sqrt(2.0)), math.erf(1.0 / math.sqrt(2.0))
    expected = {1: beyond, 2: 2 * 0.5**9, 3: 2 / math.factorial(6), 7: inside**15,
                4: 2 * 199_360_981 / math.factorial(14), 8: (1.0 - inside) ** 8}  # fmt: skip
    for rule, p in expected.items():
        rate = np.mean([rule in rules for rules in found])
        clustered = 15.0  # patterns overlap: one follows another
        assert rate == pytest.approx(p, abs=4.0 * math.sqrt(clustered * p / count)), rule


def test_a_chart_is_in_the_order_of_dates_and_of_one_vehicle(tmp_path):
    store = open_store(str(tmp_path))
    values = [0.10, 0.11, 0.09, 0.10, 0.30, 0.10]
    for i, value in enumerate(values):
        date = f"2026-0{6 - i}-01"
        add(store, result(f"c{i}", date=date, vehicle=f"v{i % 2}", RR_toe=value))
    add(store, result("undated", RR_toe=5.0))
    rebuild(store)
    with open_catalogue(str(tmp_path)) as catalogue:
        chart = control_chart(catalogue, "RR toe")
        one = control_chart(catalogue, "RR toe", Filter(vehicle="v0"))
        nothing = control_chart(catalogue, "RR toe", Filter(text="c0"))
    assert [point.value for point in chart.points] == values[::-1]
    assert chart.left_out == 1
    assert [point.name for point in one.points] == ["c4", "c2", "c0"]
    assert nothing is None
    assert [point.jumps for point in chart.points] == [False] * 6
    assert chart.points[0].moving_range is None
    assert chart.points[1].moving_range == pytest.approx(0.20)


@pytest.mark.parametrize("dates", [(None, None, None), (None, "2026-01-01", None)])
def test_fewer_than_two_dates_are_no_order_and_the_names_are(tmp_path, dates):
    trees = [result(f"c{i}", date=date, RR_toe=i / 10.0) for i, date in enumerate(dates)]
    add(open_store(str(tmp_path)), *trees)
    with open_catalogue(str(tmp_path)) as catalogue:
        chart = control_chart(catalogue, "RR toe")
    assert [point.name for point in chart.points] == ["c0", "c1", "c2"]
    assert chart.left_out == 0


def test_equal_values_break_no_rule():
    x = np.full(30, 0.1)
    assert broken_rules(x, control_limits(x)) == [()] * 30
