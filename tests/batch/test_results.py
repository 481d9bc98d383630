"""What the results tell: lists, filters, statistics, drift, tables and SQL."""

from __future__ import annotations

import csv
import hashlib
import html
import io
import json
import math
import os
import re
import shlex
import signal
import sqlite3
import subprocess
import sys
import threading
import zipfile
from contextlib import closing
from pathlib import Path

import duckdb
import numpy as np
import openpyxl
import pytest
from scipy import stats

from tests.support.batches import call
from tests.support.records import add, key_of, result
from wheelplane.batch.catalogue.catalogue import open_catalogue
from wheelplane.batch.catalogue.history import write_removed
from wheelplane.batch.catalogue.schema import number_of
from wheelplane.batch.results import export
from wheelplane.batch.results import query as query_module
from wheelplane.batch.results import trends as trends_module
from wheelplane.batch.results.query import (
    Filter,
    ValueRange,
    by_status,
    captures,
    count,
    doubted,
    failures,
    quantity_units,
)
from wheelplane.batch.results.series import Series, series
from wheelplane.batch.results.sql import ask
from wheelplane.batch.results.trends import drift, drifts, summarised, summary, with_holm, worst
from wheelplane.batch.storage.store import open_store
from wheelplane.errors import Doubt, InputError, MissingDependencyError
from wheelplane.measurement.doubts import COPIED, FLOOR_ABOVE
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.notes import notes_in
from wheelplane.web.archive.views import answer

ROOT = Path(__file__).resolve().parents[2]
DAYS = [f"2026-{month:02d}-{day:02d}" for month in (9, 10) for day in (1, 6, 11, 16, 21, 26)]
TRUE_TREND = 0.002  # degrees a day, of RR toe


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Twelve dated captures of two vehicles, with a drift and an outlier, and five failures."""
    folder = tmp_path_factory.mktemp("results")
    rng = np.random.default_rng(1)
    trees = []
    for i, day in enumerate(DAYS):
        toe = 0.1 + TRUE_TREND * 5 * i + rng.normal(0.0, 0.003)
        camber = -1.0 + rng.normal(0.0, 0.003) + (0.5 if i == 7 else 0.0)
        trees.append(
            result(
                f"site/{i:02d}",
                date=day,
                vehicle=f"car {i % 2}",
                status="part" if i == 4 else "ok",
                stage="plane" if i == 4 else "",
                reason="trial 3: too few points" if i == 4 else "",
                RR_toe=toe,
                RL_camber=camber,
                wheelbase_left_m=(2.6 + 0.001 * i, 1e-5),
            )
        )
    for i in range(4):
        why = f"site/bad {i}/rr.ply: a target of {i}.5 mm is none: see to it"
        trees.append(result(f"site/bad {i}", status="failed", stage="segment", reason=why))
    trees.append(
        result("=site/formula", status="quarantined", stage="child", reason="crashed\x1b[2J twice")
    )
    add(open_store(str(folder)), *trees)
    return folder


@pytest.fixture
def catalogue(results):
    with open_catalogue(str(results)) as opened:
        yield opened


def names(catalogue, **filters):
    return [row.name for row in captures(catalogue, Filter(**filters))]


def test_filters_hold_all_at_once(catalogue):
    assert count(catalogue) == 17
    assert names(catalogue, vehicle="car 1", status=("ok",)) == [
        f"site/{i:02d}" for i in range(1, 12, 2)
    ]
    assert names(catalogue, text="bad") == [f"site/bad {i}" for i in range(4)]
    assert names(catalogue, status=("failed", "part")) == ["site/04", *names(catalogue, text="bad")]
    (toes,) = series(catalogue, ["RR toe"])
    low, high = np.sort(toes.values)[[3, 8]]
    within = set(toes.numbers[(toes.values >= low) & (toes.values <= high)].tolist())
    expected = [
        row.name
        for row in captures(catalogue)
        if number_of(row.key) in within and int(row.name[-2:]) >= 4  # 2.604 m and more
    ]
    spans = (ValueRange("RR toe", low, high), ValueRange("wheelbase_left", 2.6035))
    assert names(catalogue, ranges=spans) == expected
    assert 0 < len(expected) < len(within) == 6
    trial = names(catalogue, ranges=(ValueRange("1 camber", -90.0, 90.0),))
    assert trial == [f"site/{i:02d}" for i in range(12)]


def test_pages_join_to_the_whole_list_in_every_order(catalogue):
    for order in ("name", "date", "vehicle", "status"):
        whole = list(captures(catalogue, order=order))
        pages = [
            list(captures(catalogue, order=order, limit=5, offset=at)) for at in range(0, 20, 5)
        ]
        assert [row for page in pages for row in page] == whole
        assert [len(page) for page in pages] == [5, 5, 5, 2]
    dated = [row.day for row in captures(catalogue, Filter(status=("ok",)), order="date")]
    assert dated == sorted(dated)


def test_a_quantity_that_is_unknown_is_reported_with_the_nearest(catalogue):
    with pytest.raises(InputError, match=r"'RR tow'.*did you mean 'RR toe'"):
        count(catalogue, Filter(ranges=(ValueRange("RR tow"),)))
    with pytest.raises(InputError, match=r"'wheelbase_lefd'.*did you mean 'wheelbase_left'"):
        series(catalogue, ["wheelbase_lefd"])


def test_failures_are_grouped_by_reason_and_not_by_its_numbers(catalogue):
    groups = failures(catalogue)
    assert [(g.count, g.status, g.stage) for g in groups] == [
        (4, "failed", "segment"),
        (1, "part", "plane"),
        (1, "quarantined", "child"),
    ]
    assert groups[0].examples == ("site/bad 0", "site/bad 1", "site/bad 2")
    assert groups[0].reason.startswith("site/bad 0/rr.ply: a target of 0.5 mm")
    assert [g.count for g in failures(catalogue, Filter(text="bad"))] == [4]


def made(values, u=0.0, day=None, quantity="RR toe"):
    values = np.asarray(values, float)
    day = np.arange(len(values), dtype=float) if day is None else np.asarray(day, float)
    numbers = np.arange(len(values))
    return Series(
        quantity, "deg", numbers, day, values, np.broadcast_to(u, values.shape).astype(float)
    )


def test_statistics_agree_with_scipy():
    values = np.random.default_rng(2).standard_t(3, 501) * 0.02 - 1.0
    done = summarised(made(values, 0.003))
    reference = stats.describe(values)
    assert done.n == reference.nobs
    assert (done.low, done.high) == reference.minmax
    assert done.mean == pytest.approx(reference.mean, rel=1e-12)
    assert done.sd == pytest.approx(math.sqrt(reference.variance), rel=1e-12)
    mad = stats.median_abs_deviation(values, scale="normal")
    assert done.robust_sd == pytest.approx(mad, rel=1e-9)
    assert done.median == np.median(values)
    assert done.u_rms == pytest.approx(0.003, rel=1e-12)
    assert abs(done.robust_sd / done.sd - 1.0) > 0.1  # the tails tell one from the other


@pytest.mark.parametrize("u", [0.003, math.nan])
def test_one_capture_shows_no_deviation(u):
    """Neither the one with the divisor n - 1 nor that of medians, which would be 0."""
    done = summarised(made([0.1], u))
    assert math.isnan(done.sd)
    assert math.isnan(done.robust_sd)
    ((_, outlier),) = trends_module._outliers(made([0.1], u), 3)
    assert outlier.score == 0.0


def test_the_summary_has_every_quantity_of_the_captures_that_have_it(catalogue):
    done = {row.quantity: row for row in summary(catalogue)}
    assert list(done)[:8] == [
        f"{w} {a}" for w in ("RR", "RL", "FR", "FL") for a in ("toe", "camber")
    ]
    assert set(done) == set(quantity_units(catalogue))
    assert {row.n for row in done.values()} == {12}
    left = done["wheelbase_left"]
    assert (left.unit, left.low, left.high) == ("m", 2.6, 2.611)
    assert left.sd == pytest.approx(0.001 * np.std(np.arange(12), ddof=1), rel=1e-9)
    one_car = summary(catalogue, ["RR toe"], Filter(vehicle="car 0"))
    assert [(row.quantity, row.n) for row in one_car] == [("RR toe", 6)]


def test_without_stated_uncertainty_the_drift_is_scipys_regression():
    rng = np.random.default_rng(3)
    day = np.sort(rng.uniform(20000.0, 20300.0, 40))
    values = 0.1 + 3e-5 * day + rng.normal(0.0, 0.02, 40)
    done = drift(made(values, 0.0, day))
    reference = stats.linregress(day - day.mean(), values)
    assert done.slope == pytest.approx(reference.slope, rel=1e-9)
    assert done.u_slope == pytest.approx(reference.stderr, rel=1e-6)
    assert done.p == pytest.approx(reference.pvalue, rel=1e-5)
    width = stats.t.ppf(0.975, 38) * reference.stderr
    assert done.expanded == pytest.approx(width, rel=1e-6)
    assert done.at_mean == pytest.approx(reference.intercept, rel=1e-9)


def test_where_u_explains_the_scatter_the_drift_is_the_weighted_fit():
    rng = np.random.default_rng(4)
    day, u = np.arange(30.0), rng.uniform(0.01, 0.1, 30)
    values = 1.0 + 0.002 * day + 0.5 * u * rng.normal(size=30)
    done = drift(made(values, u, day))
    slope, at_zero = np.polyfit(day, values, 1, w=1 / u)
    covariance = np.polyfit(day, values, 1, w=1 / u, cov="unscaled")[1]
    assert done.scatter == 0.0
    assert done.slope == pytest.approx(slope, rel=1e-9)
    assert done.u_slope == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-9)
    assert done.at_mean == pytest.approx(at_zero + slope * done.mean_day, rel=1e-9)
    assert abs(slope / np.polyfit(day, values, 1)[0] - 1.0) > 0.01  # weights matter here


def test_the_scatter_solves_its_equation():
    rng = np.random.default_rng(5)
    u = rng.uniform(0.001, 0.05, 25)
    values = rng.normal(0.0, 0.03, 25) + u * rng.normal(size=25)
    done = drift(made(values, u))
    variance = u**2 + done.scatter**2
    residuals = values - done.at_mean - done.slope * (np.arange(25.0) - done.mean_day)
    assert done.scatter > 0.01
    assert float(residuals**2 @ (1 / variance)) == pytest.approx(23.0, rel=1e-8)


@pytest.mark.parametrize(("n", "scatter"), [(8, 0.0), (8, 0.01), (40, 0.03)])
def test_the_interval_holds_the_true_drift_as_often_as_it_says(n, scatter):
    """Between binomial limits at 1 in 10,000; an interval of k = 1 would hold it in two thirds."""
    rng = np.random.default_rng(6)
    trials, slope = 1500, 0.001
    held = 0
    for _ in range(trials):
        day = rng.uniform(0.0, 90.0, n)
        u = rng.uniform(0.003, 0.02, n)
        values = slope * day + rng.normal(0.0, np.hypot(u, scatter))
        done = drift(made(values, u, day))
        held += abs(done.slope - slope) <= done.expanded
    low = stats.binom.ppf(0.5e-4, trials, 0.95)
    high = stats.binom.ppf(1 - 0.5e-4, trials, 0.99 if scatter == 0.0 else 0.95)
    # where u alone explains the scatter, Student's t of n - 2 is a little too wide
    assert low <= held <= high


def test_a_planted_drift_is_found_and_the_rest_is_not(catalogue):
    done = {row.quantity: row for row in drifts(catalogue)}
    assert done["RR toe"].significant
    assert abs(done["RR toe"].slope - TRUE_TREND) <= done["RR toe"].expanded < TRUE_TREND / 2
    assert done["wheelbase_left"].slope == pytest.approx(0.001 / 5, rel=0.05)
    assert {name for name, row in done.items() if row.significant} == {"RR toe", "wheelbase_left"}
    assert (done["RR toe"].first_day, done["RR toe"].last_day) == (20697.0, 20752.0)


def test_too_little_for_a_drift_says_so():
    assert drift(made([1.0, 2.0])).reason == "fewer than three dated values"
    assert drift(made([1.0, 2.0, 3.0], day=[5, 5, 5])).reason == "all on one date"
    assert drift(made([1.0, 2.0, 3.0], day=[1, 2, math.nan])).n == 2
    flat = drift(made([1.0] * 5, 0.0))
    assert (flat.slope, flat.significant) == (0.0, False)


def test_holm_asks_more_of_one_among_many():
    rng = np.random.default_rng(7)
    noise = [made(rng.normal(size=10), 0.0, quantity=f"q{i}") for i in range(19)]
    slight = next(
        one
        for one in (made(0.12 * np.arange(10) + rng.normal(size=10), 0.0) for _ in range(500))
        if 0.02 < drift(one).p < 0.04
    )
    assert with_holm([drift(slight)])[0].significant
    assert not with_holm([drift(slight), *map(drift, noise)])[0].significant
    strong = made(10.0 * np.arange(10) + rng.normal(size=10), 0.0)
    assert with_holm([drift(strong), *map(drift, noise)])[0].significant


def test_the_outlier_is_the_worst(catalogue):
    first, second = worst(catalogue, 2)
    assert (first.name, first.quantity) == ("site/07", "RL camber")
    assert first.key == key_of("site/07")
    done = {row.quantity: row for row in summary(catalogue)}["RL camber"]
    width = max(done.robust_sd, done.u_rms)
    assert first.score == pytest.approx(abs(first.value - done.median) / width, rel=1e-12)
    assert first.score > 10.0
    assert second.score < first.score
    assert worst(catalogue, 1, ["wheelbase_left"])[0].name in ("site/00", "site/11")


@pytest.mark.parametrize("few", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("low", [-9.0, 2.6005, 2.6035, 2.6085, 2.6105, 9.0])
def test_ranges_choose_what_a_loop_chooses(catalogue, monkeypatch, few, low):
    """Ranges that hold all captures, most, some, one, and none, by each way of looking them up."""
    monkeypatch.setattr(query_module, "FEW", few)
    which = Filter(ranges=(ValueRange("wheelbase_left", low), ValueRange("RR toe", 0.05, 0.18)))
    toes, lengths = series(catalogue, ["RR toe", "wheelbase_left"])
    inside = (lengths.values >= low) & (toes.values >= 0.05) & (toes.values <= 0.18)
    expected = set(toes.numbers[inside].tolist())
    found = list(captures(catalogue, which))
    assert {number_of(row.key) for row in found} == expected
    assert count(catalogue, which) == sum(by_status(catalogue, which).values()) == len(expected)
    (one, *_) = series(catalogue, ["RR toe"], which) or (None,)
    assert (set() if one is None else set(one.numbers.tolist())) == expected


def test_columns_are_the_rows_of_the_tables(catalogue):
    """Columns hold the captures, days, values and u of the tables, for each quantity and angle."""
    of_wheel = "SELECT id, day, {0}_deg, u_{0}_deg FROM wheel_rows JOIN captures USING(id)"
    of_kind = "SELECT id, day, value, q.u FROM quantity_rows AS q JOIN captures USING(id)"
    for name in quantity_units(catalogue):
        wheel, _, angle = name.rpartition(" ")
        rows = catalogue.connection.execute(
            f"{of_wheel.format(angle)} WHERE wheel_rows.name = ? AND role = 'reference' ORDER BY id"
            if wheel
            else f"{of_kind} JOIN kinds USING(kind_id) WHERE kinds.kind = ? ORDER BY id",
            (wheel or name,),
        )
        expected = [row for row in rows if row[2] is not None]
        (one,) = series(catalogue, [name])
        assert one.numbers.tolist() == [row[0] for row in expected]
        shown = np.array([(row[1:]) for row in expected], float)
        np.testing.assert_array_equal(np.column_stack([one.day, one.values, one.u]), shown)


@pytest.mark.parametrize("n", [1, 3, 12, 40])
def test_the_worst_are_the_first_of_all_sorted(catalogue, n):
    found = worst(catalogue, n)
    every = worst(catalogue, 10**6)
    assert found == every[:n]
    assert len({one.key for one in every}) == len(every) == 12


def test_a_drift_of_many_values_is_that_of_its_parts_together(monkeypatch):
    rng = np.random.default_rng(5)
    one = made(rng.normal(size=1000), 0.1 + rng.random(1000))
    whole = drift(one)
    monkeypatch.setattr(trends_module, "BLOCK", 37)
    in_blocks = drift(one)
    for name in ("slope", "u_slope", "at_mean", "mean_day", "scatter", "p"):
        assert getattr(in_blocks, name) == pytest.approx(getattr(whole, name), rel=1e-9)


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM captures",
        "UPDATE captures SET name = 'x'",
        "DROP TABLE captures",
        "CREATE TABLE x(y)",
        "CREATE TEMP TABLE x(y)",
        "ATTACH '/tmp/elsewhere.sqlite' AS x",
        "PRAGMA journal_mode = WAL",
        "VACUUM",
        "SELECT load_extension('x')",
        "BEGIN",
        "SELECT 1; SELECT 2",
        "SELECT * FROM nothing",
        "SELEC name",
        "SELECT name FROM sqlite_dbpage",
        "",
        "SELECT 'a\0b'",
    ],
)
def test_sql_that_does_not_read_is_refused_in_a_line(catalogue, results, statement):
    before = hashlib.sha256((results / "catalogue.sqlite").read_bytes()).digest()
    with pytest.raises(InputError, match="--sql: ") as done:
        list(ask(catalogue, statement).rows)
    assert "\n" not in str(done.value)
    assert hashlib.sha256((results / "catalogue.sqlite").read_bytes()).digest() == before


# In {other} a table of SQLite, in {csv} text, at {new} nothing: each means that SQLite, its command
# line program or DuckDB has to write, or to read another file.
REACHING = [
    "ATTACH '{other}' AS x",
    "ATTACH DATABASE 'file:{other}?mode=rwc' AS x",
    "ATTACH ':memory:' AS x",
    "DETACH main",
    "SELECT * FROM x.secrets",
    "VACUUM INTO '{new}'",
    "PRAGMA writable_schema = 1",
    "PRAGMA query_only = 0",
    "PRAGMA temp_store_directory = '{folder}'",
    "PRAGMA database_list",
    "SELECT * FROM pragma_database_list",
    "SELECT * FROM pragma_table_info('captures')",
    "SELECT * FROM pragma_journal_mode('wal')",
    "SELECT * FROM dbstat",
    "UPDATE sqlite_master SET sql = 'x'",
    "INSERT INTO sqlite_schema VALUES ('table', 'a', 'a', 1, '')",
    "INSERT INTO captures(key) VALUES ('a') RETURNING key",
    "REPLACE INTO kinds VALUES (1, 'a', 'm')",
    "WITH a AS (SELECT 1) DELETE FROM captures RETURNING key",
    "EXPLAIN DELETE FROM captures",
    "ALTER TABLE captures ADD COLUMN a",
    "CREATE VIEW temp.captures AS SELECT 1",
    "CREATE TRIGGER a AFTER INSERT ON captures BEGIN SELECT 1; END",
    "CREATE VIRTUAL TABLE a USING fts5(b)",
    "CREATE VIRTUAL TABLE temp.a USING csv(filename = '{csv}')",
    "REINDEX",
    "ANALYZE",
    "SAVEPOINT a",
    "SELECT load_extension('{other}')",
    "SELECT load_extension('{other}', 'entry')",
    "SELECT fts3_tokenizer('simple')",
    "SELECT readfile('{csv}')",
    "SELECT writefile('{new}', 'a')",
    "SELECT edit('a', 'touch {new}')",
    "SELECT * FROM fsdir('{folder}')",
    "SELECT * FROM zipfile('{csv}')",
    ".read {csv}",
    ".import {csv} captures",
    "COPY captures TO '{new}'",
    "COPY captures FROM '{csv}'",
    "EXPORT DATABASE '{folder}'",
    "INSTALL httpfs",
    "LOAD '{other}'",
    "SET enable_external_access = true",
    "SELECT * FROM read_csv('{csv}')",
    "SELECT * FROM read_text('{csv}')",
    "SELECT * FROM read_blob('{csv}')",
    "SELECT * FROM read_parquet('{other}')",
    "SELECT * FROM glob('{folder}/*')",
    "SELECT * FROM sqlite_scan('{other}', 'secrets')",
    "SELECT * FROM '{csv}'",
    "FROM '{csv}'",
    "SELECT getenv('HOME')",
]


@pytest.mark.parametrize("statement", REACHING)
def test_sql_neither_writes_nor_reads_another_file(catalogue, results, tmp_path, statement):
    with closing(sqlite3.connect(tmp_path / "other")) as other:
        other.execute("CREATE TABLE secrets AS SELECT 4711")
        other.commit()
    (tmp_path / "csv").write_text("secret\n4711\n")
    named = {name: str(tmp_path / name) for name in ("other", "csv", "new")}

    def contents() -> dict[str, bytes]:
        files = [*tmp_path.iterdir(), *filter(Path.is_file, results.rglob("*"))]
        return {str(path): path.read_bytes() for path in files}

    before = contents()
    with pytest.raises(InputError, match=r"^--sql: "):
        list(ask(catalogue, statement.format(**named, folder=tmp_path)).rows)
    assert contents() == before
    assert list(ask(catalogue, "SELECT count(*) > 0 FROM captures").rows) == [(1,)]


def test_sql_reads_the_tables_of_the_contract(catalogue):
    question = """
    SELECT c.name, w.toe_deg, q.value FROM captures AS c JOIN wheels AS w USING(key)
    JOIN quantities AS q USING(key) WHERE w.name = 'RR' AND q.kind = 'wheelbase_left'
    ORDER BY c.name LIMIT 2"""
    answer = ask(catalogue, question)
    assert answer.columns == ("name", "toe_deg", "value")
    rows = list(answer.rows)
    assert [(row[0], row[2]) for row in rows] == [("site/00", 2.6), ("site/01", 2.601)]
    toes = series(catalogue, ["RR toe"])[0]
    by_number = dict(zip(toes.numbers.tolist(), toes.values.tolist(), strict=True))
    assert [row[1] for row in rows] == [
        by_number[number_of(key_of(name))] for name in ("site/00", "site/01")
    ]


ENDLESS = "WITH RECURSIVE a(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM a) SELECT "


class RaisedError(BaseException):
    """Exception of a signal, as the command line and its limit of time raise it."""


@pytest.mark.parametrize("end", ["count(*) FROM a", "0 UNION ALL SELECT count(*) FROM a"])
def test_an_endless_query_ends_by_what_a_signal_raises(catalogue, end):
    def ended(*_: object) -> None:
        raise RaisedError

    before = signal.signal(signal.SIGUSR1, ended)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGUSR1)).start()
    with pytest.raises(RaisedError):
        list(ask(catalogue, ENDLESS + end).rows)
    signal.signal(signal.SIGUSR1, before)
    assert list(ask(catalogue, "SELECT count(*) > 0 FROM captures").rows) == [(1,)]


@pytest.mark.parametrize(
    ("limit", "reason"),
    [
        (("--timeout", "1"), "it takes more than 1 s: allow more by --timeout"),
        (("--memory", "60M"), "it needs more than 60 MB of memory: allow more by --memory, or"),
    ],
)
def test_an_endless_query_ends_at_its_limits_in_a_line(results, limit, reason):
    done = run(results, "--sql", f"{ENDLESS}x FROM a ORDER BY x", *limit)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"wheelplane: {reason}")
    assert done.stderr.count("\n") == 1


def test_sql_as_json_is_json_of_any_cell(results):
    cells = "NULL, 7, 0.5, 'a\"\n\x1bé', 1e999, -1e999, x'0a'"
    done = run(results, "--json", "--sql", f"SELECT {cells} UNION ALL SELECT {cells}")
    tree = json.loads(done.stdout, parse_constant=lambda name: pytest.fail(name))
    assert tree["rows"] == 2 * [[None, 7, 0.5, 'a"\n\x1bé', "inf", "-inf", "b'\\n'"]]
    assert len(tree["columns"]) == 7
    empty = json.loads(run(results, "--json", "--sql", "SELECT 1 AS a WHERE FALSE").stdout)
    assert (empty["columns"], empty["rows"]) == (["a"], [])


@pytest.mark.parametrize("kind", ["csv", "xlsx", "parquet"])
def test_a_pipe_gets_the_table_and_stays_a_pipe(results, tmp_path, kind):
    pipe, file = tmp_path / "pipe", tmp_path / "file"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    assert run(results, f"--{kind}", pipe).returncode == 1
    reader.join()
    run(results, f"--{kind}", file)
    assert pipe.is_fifo()
    assert read == [file.read_bytes()]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "pipe"]


def run(*arguments) -> subprocess.CompletedProcess[str]:
    """Run `wheelplane results` in this process."""
    return call("results", *arguments)


def run_process(*arguments) -> subprocess.CompletedProcess[str]:
    """Run `wheelplane results` in a process of its own."""
    command = [sys.executable, "-m", "wheelplane", "results", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_the_list_has_signs_units_reasons_and_totals(results):
    done = run_process(results)
    assert (done.returncode, done.stderr) == (1, "")
    lines = done.stdout.splitlines()
    assert lines[0].split()[:5] == ["capture", "date", "vehicle", "status", "wheels"]
    assert len(lines) == 1 + 17 + 3
    by_name = {line.split("  ")[0]: line for line in lines}
    assert "+00°06'" in by_name["site/00"]
    assert "-00°5" in by_name["site/00"] or "-01°00'" in by_name["site/00"]
    assert "segment: site/bad 0/rr.ply" in by_name["site/bad 0"]
    assert "\x1b" not in done.stdout
    assert "\\x1b[2J" in by_name["=site/formula"]
    assert lines[-1] == "17 captures: 4 failed, 11 ok, 1 part, 1 quarantined."
    assert "Toe-in and camber with the top outward are positive" in lines[-2]


def test_exit_codes_and_filters_of_the_command(results):
    ok = run(results, "--status", "ok", "--since", "2026-09-16", "--until", "2026-10-11")
    assert ok.returncode == 0
    named = [line.split()[0] for line in ok.stdout.splitlines() if line.startswith("site/")]
    assert named == ["site/03", "site/05", "site/06", "site/07", "site/08"]
    span = run(results, "--where", "RL camber", "-0.9..", "--json")
    assert [c["name"] for c in json.loads(span.stdout)["captures"]] == ["site/07"]
    nothing = run(results, "--vehicle", "none such")
    assert (nothing.returncode, nothing.stdout.splitlines()[-1]) == (0, "0 captures.")
    asked = ["--summary", "--drift", "--failures"]
    alone = [run(results, one).stdout for one in asked]
    assert run(results, *asked).stdout == "\n".join(alone)


def test_angles_of_statistics_are_in_the_unit_of_the_list(tmp_path):
    """Toe in mm/m, the tangent; camber, which is customary in neither, in degrees."""
    trees = [
        result(name, RR_toe=math.degrees(math.atan(toe / 1e3)), RR_camber=-1.0, date=date)
        for name, toe, date in (("a", 2.0, "2026-01-01"), ("b", 3.0, "2026-01-31"),
                                ("c", 4.0, "2026-03-02"))
    ]  # fmt: skip
    add(open_store(str(tmp_path)), *trees)
    asked = ("--angles", "mm/m", "--digits", "full")
    chosen = ("--quantity", "RR toe", "--quantity", "RR camber")
    (_, first, *_) = run(tmp_path, *asked).stdout.splitlines()
    assert "+2.000 mm/m" in first
    assert "-01°00'00" in first
    summed, over_time, farthest = (
        run(tmp_path, *lists, *asked, *chosen).stdout
        for lists in (["--summary"], ["--drift"], ["--worst", "1"])
    )
    toe, camber = (line for line in summed.splitlines() if line.startswith("  RR"))
    assert re.findall(r"\S+ mm/m", toe)[:2] == ["+3.000 mm/m", "1.000 mm/m"]
    assert "mm/m" not in camber
    assert "+1.000 mm/m" in over_time
    assert "mm/m" in farthest


def test_a_report_says_what_is_selected(results, tmp_path):
    """'Every selected capture is measured in full' is of those that these options choose."""
    shown = tmp_path / "report.html"
    run(results, "--html", shown)
    title = f">{load_translations('en')('listing.selection')}<"
    assert title not in shown.read_text(encoding="utf-8")
    asked = ["--name", "site", "--vehicle", "car 0", "--since", "2026-09-01", "--status", "ok",
             "--status", "part", "--no-gone", "--where", "RL camber", "-2..",
             "--quantity", "RR toe", "--quantity", "RL toe"]  # fmt: skip
    run(results, *asked, "--summary", "--html", shown)
    text = html.unescape(shown.read_text(encoding="utf-8"))
    assert title in text
    assert shlex.join(asked) in text


@pytest.mark.parametrize(
    ("name", "headline"),
    [("none such", "none_chosen"), ("site/00", "all_well"), ("site", "not_all")],
)
def test_the_headline_is_of_the_captures_that_are_chosen(results, tmp_path, name, headline):
    run(results, "--name", name, "--html", tmp_path / "report.html")
    shown = (tmp_path / "report.html").read_text(encoding="utf-8")
    words = load_translations("en")
    said = {one: words(f"listing.{one}") in shown for one in ("none_chosen", "all_well", "not_all")}
    assert said == {one: one == headline for one in said}


def test_days_are_those_of_the_clock_of_each_capture(tmp_path):
    """Evenings in the west and nights in the east lie on other days of UTC than their own."""
    dates = {
        "west": "2026-11-20T17:00:00-08:00",
        "east": "2026-11-21T00:30:00+02:00",
        "plain": "2026-11-20",
        "utc": "2026-11-20T23:59:59",
        "far": "2026-11-22T00:00:01+14:00",
    }
    add(open_store(str(tmp_path)), *[result(name, date=date) for name, date in dates.items()])
    for day in ("2026-11-19", "2026-11-20", "2026-11-21", "2026-11-22", "2026-11-23"):
        whole = run(tmp_path, "--since", day, "--until", day, "--json").stdout
        found = {one["name"] for one in json.loads(whole)["captures"]}
        assert found == {name for name, date in dates.items() if date.startswith(day)}
        before = json.loads(run(tmp_path, "--until", day, "--json").stdout)["captures"]
        assert {one["name"] for one in before} == {n for n, d in dates.items() if d[:10] <= day}
    moment = ("--since", "2026-11-21T01:00:00", "--until", "2026-11-21T01:00:00")  # UTC
    exact = json.loads(run(tmp_path, *moment, "--json").stdout)["captures"]
    assert [one["name"] for one in exact] == ["west"]


def test_captures_without_a_date_are_reported_where_dates_are_asked_for(results, catalogue):
    undated = sum(row.day is None for row in captures(catalogue))
    done = run(results, "--since", "2000-01-01")
    assert undated > 0
    assert done.stderr.startswith(f"{undated} captures without a date are left out")
    assert f"{17 - undated} captures" in done.stdout
    assert run(results).stderr == ""


def test_unlike_verticals_are_named_and_selected(tmp_path):
    """A result from before there were others has its cambers from the wheels' centres."""
    trees = [result(name) for name in ("a", "b", "c", "d")]
    trees[1]["vertical_in_use"] = "gravity"
    del trees[2]["vertical_in_use"]
    trees[3] = result("d", status="failed", stage="segment", reason="no target")
    add(open_store(str(tmp_path)), *trees)
    with open_catalogue(str(tmp_path)) as catalogue:
        verticals = [row.vertical for row in captures(catalogue)]
        assert verticals == ["wheels", "gravity", "wheels", ""]
        assert names(catalogue, vertical="wheels") == ["a", "c"]
    said = "cambers are from unlike verticals (1 from gravity, 2 from wheels): choose by --vertical"
    assert run(tmp_path).stderr.strip() == said
    for lists in ([], ["--summary"], ["--drift"], ["--worst", "2"]):
        run(tmp_path, *lists, "--html", tmp_path / "report.html")
        report = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "from unlike verticals (gravity: 1; plane of the wheel centres: 2)" in report
    chosen = run(tmp_path, "--vertical", "gravity", "--json")
    assert chosen.stderr == ""
    assert [row["name"] for row in json.loads(chosen.stdout)["captures"]] == ["b"]


def test_captures_in_doubt_are_listed_and_left_out_of_statistics(tmp_path):
    """A doubt about a trial, not the vehicle, leaves the wheels' numbers in."""
    trees = [result(name) for name in ("a", "b", "c", "d")]
    trees[1]["doubts"] = [{"trial": None, "note": "mirrored"}]
    trees[2]["doubts"] = [{"trial": "1", "note": "a copy"}]
    trees[1]["wheels"][0]["toe_deg"] = 20.0
    add(open_store(str(tmp_path)), *trees)
    with open_catalogue(str(tmp_path)) as catalogue:
        assert [row.doubted for row in captures(catalogue)] == [0, 1, 0, 0]
        assert doubted(catalogue) == 1
        for one in summary(catalogue):
            assert one.n == 3
            assert one.high < 20.0
        assert {row.name for row in worst(catalogue, 9)} <= {"a", "c", "d"}
    for option in ("--summary", "--drift", "--worst"):
        said = run(tmp_path, option, *["3"] * (option == "--worst")).stderr
        assert "1 capture in doubt is left out of statistics" in said
    assert run(tmp_path).stderr == ""
    assert len(json.loads(run(tmp_path, "--json").stdout)["captures"]) == 4


DOUBTS = (
    Doubt(FLOOR_ABOVE, height="0.31", names="RR, RL, FR, FL"),
    Doubt(COPIED, trial="1", name="RR"),
)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_report_says_which_captures_are_in_doubt_and_how_many_statistics_leave_out(
    tmp_path, language
):
    """In the report's language: both notes that were joined, and the same count in each list."""
    trees = [result(name, vehicle=f"car {name}") for name in ("a", "b", "c")]
    trees[1]["doubts"] = [{"trial": None, "note": DOUBTS[0]}, {"trial": "1", "note": DOUBTS[1]}]
    trees[1]["batch"]["reason"] = " ".join(DOUBTS)
    add(open_store(str(tmp_path / "results")), *trees)
    words = load_translations(language)
    left_out = words("listing.doubted", count="1")
    marked = words("listing.in_doubt", status=words("page.ok"))

    def report(*lists: str) -> str:
        shown = tmp_path / "report.html"
        run(tmp_path / "results", *lists, "--html", shown, "--language", language)
        return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", shown.read_text())).split())

    usual = report()
    assert f"b: {' '.join(notes_in(DOUBTS, words))}" in usual
    assert (language == "en") == (DOUBTS[0] in usual)
    assert (usual.count(marked), usual.count(left_out)) == (1, 2)  # of statistics, and of drift
    assert report("--worst", "3").count(left_out) == 1
    assert report("--summary", "--vehicle", "car a").count(left_out) == 0


def test_statistics_say_how_many_captures_are_no_longer_in_the_archive(tmp_path):
    """A renamed capture has two results: as it was called, which is kept, and as it is."""
    add(open_store(str(tmp_path)), *[result(name, date="2026-01-01") for name in ("a", "b", "c")])
    write_removed(open_store(str(tmp_path)), ["b"])
    words = load_translations("en")
    note = words("listing.removed_counted", count="1")
    for option in ("--summary", "--drift", "--worst"):
        given = [option, *["3"] * (option == "--worst")]
        said = run(tmp_path, *given).stderr
        assert said.startswith("1 capture no longer in the archive counted too")
        assert run(tmp_path, *given, "--no-gone").stderr == ""
        run(tmp_path, *given, "--html", tmp_path / "report.html")
        assert note in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert run(tmp_path).stderr == ""
    for question, asked in (("trends", {}), ("chart", {"quantity": "RR toe"})):
        assert answer(question, tmp_path, asked, words)["notice"] == note


def test_statistics_say_how_many_captures_are_copies(tmp_path):
    """By the same files, whatever they are called; those that count nowhere are none."""
    trees = {name: result(name, date="2026-01-01") for name in "abcdef"}
    trees["e"] = result("e", status="failed", date="2026-01-01")
    trees["f"]["doubts"] = [{"trial": None, "note": "mirrored"}]
    for name in "bef":
        known = trees["a"]["provenance"]["inputs"].values()
        trees[name]["provenance"]["inputs"] = {f"{k}.txt": one for k, one in enumerate(known)}
    add(open_store(str(tmp_path)), *trees.values())
    words = load_translations("en")
    note = words("listing.copies_counted", count="1")
    for option in ("--summary", "--drift", "--worst"):
        given = [option, *["3"] * (option == "--worst")]
        assert "1 capture of the same files as another counted too" in run(tmp_path, *given).stderr
        assert "same files" not in run(tmp_path, *given, "--name", "c").stderr
        run(tmp_path, *given, "--html", tmp_path / "report.html")
        assert note in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert run(tmp_path).stderr == ""
    for question, asked in (("trends", {}), ("chart", {"quantity": "RR toe"})):
        assert note in answer(question, tmp_path, asked, words)["notice"]


def test_tables_and_ranges_hold_the_numbers_of_captures_in_doubt(tmp_path):
    """Every list of captures gives the numbers that stand in the JSON of each."""
    trees = [result(name, RR_toe=toe) for name, toe in (("a", 0.1), ("b", 20.0), ("c", 0.2))]
    trees[1]["doubts"] = [{"trial": None, "note": "mirrored"}]
    add(open_store(str(tmp_path)), *trees)
    with open_catalogue(str(tmp_path)) as catalogue:
        table = export.table(catalogue)
        assert dict(zip(table["name"], table["RR_toe_deg"], strict=True)) == {
            "a": 0.1,
            "b": 20.0,
            "c": 0.2,
        }
        assert not any(np.isnan(column[1]) for name, column in table.items() if "_m" in name)
        for low, found in ((19.0, "b"), (0.0, "abc")):
            which = Filter(ranges=(ValueRange("RR toe", low, 21.0),))
            assert [row.name for row in captures(catalogue, which)] == list(found)
        assert [len(one.values) for one in series(catalogue, ["RR toe"])] == [2]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_quantity_has_one_name_in_tables_choices_and_pictures(results, tmp_path, language):
    words = load_translations(language)
    named = dict(answer("overview", results, {}, words)["quantities"])
    assert named["RR toe"] == f"{words.wheel('RR')} {words.known('quantity', 'toe')}"
    trends = answer("trends", results, {}, words)
    rows = [row[0] for row in trends["table"]["rows"]]
    assert rows == [named[quantity] for quantity in trends["quantities"]]
    assert answer("chart", results, {"quantity": "RR toe"}, words)["name"] == named["RR toe"]
    key = answer("captures", results, {"status": "ok"}, words)["keys"][0]
    wheels = answer("capture", results, {"key": key}, words)["tables"][0]["rows"]
    assert [row[:2] for row in wheels[:4]] == [
        2 * [words.wheel(name)] for name in ("RR", "RL", "FR", "FL")
    ]
    report = tmp_path / "report.html"
    run(results, "--drift", "--quantity", "RR toe", "--html", report, "--language", language)
    assert f"<title>{words('page.drift')}: {named['RR toe']}</title>" in report.read_text("utf-8")


def test_csv_is_printed_as_it_is_written(results, tmp_path):
    run(results, "--csv", tmp_path / "table.csv")
    assert run(results, "--csv", "-").stdout == (tmp_path / "table.csv").read_text(encoding="utf-8")


def test_two_tables_do_not_go_into_one_file(results, tmp_path):
    done = run(results, "--csv", tmp_path / "table", "--parquet", tmp_path / "." / "table")
    assert (done.returncode, done.stdout) == (2, "")
    assert "two outputs go to this file: give a path for each" in done.stderr
    assert not (tmp_path / "table").exists()


@pytest.mark.parametrize("option", ["--csv", "--html"])
def test_json_is_printed_beside_a_file(results, tmp_path, option):
    alone = run(results, "--json", "--status", "ok").stdout
    beside = run(results, "--json", "--status", "ok", option, tmp_path / "file")
    assert json.loads(beside.stdout) == json.loads(alone)
    assert (tmp_path / "file").stat().st_size > 0
    both = run(results, "--calibrations", "--json", "--csv", tmp_path / "list.csv")
    assert json.loads(both.stdout)["calibrations"] == []
    assert run(results, option, tmp_path / "file").stdout == ""


@pytest.mark.parametrize("kind", ["csv", "xlsx", "html"])
def test_no_table_replaces_the_index(results, kind):
    catalogue = Path(results) / "catalogue.sqlite"
    before = catalogue.read_bytes()
    assert "this command reads it" in run(results, f"--{kind}", catalogue).stderr
    assert catalogue.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--xlsx", "-"], "only --csv is printed"),
        (["--csv", "-", "--json"], "printed alone"),
        (["--csv", "-", "--summary"], "printed alone"),
        (["--since", "yesterday"], "--since yesterday: is not a date"),
        (["--since", "2026-11-02", "--until", "2026-11-01"], "is after --until 2026-11-01"),
        (["--since", "2026-11-02T08:00", "--until", "2026-11-02T08:00+01:00"], "exchange the two"),
        (["--where", "RR toe", "1"], "write the range as MIN..MAX"),
        (["--where", "RR toe", "2..1"], "write the range as MIN..MAX"),
        (["--where", "RR tow", "1.."], "did you mean 'RR toe'"),
        (["--quantity", "x", "--drift"], "quantity 'x'"),
        (["--summary", "--worst", "3", "--json"], "choose one"),
        (["--sql", "SELECT 1", "--csv", "x.csv"], "stands alone"),
        (["--sql", "SELECT 1", "--status", "ok"], "stands alone"),
        (["--worst", "0"], "--worst"),
        (["--sql", "DROP TABLE captures"], "read-only: write a SELECT"),
        (["--csv", "/nowhere/at/all.csv"], "/nowhere/at/all.csv: cannot be written"),
        (
            ["--parquet", "/nowhere/all.parquet"],
            "/nowhere/all.parquet: cannot be written (No such file or directory)",
        ),
        (["--status", "good"], "--status"),
        (["--since", "2026-W05"], "--since 2026-W05: is not a date"),
        (["--slow", "2", "--name", "x"], "--slow does not go with --name"),
        (["--item", "7", "--drift", "--csv", "x.csv"], "--item does not go with --csv"),
        (["--csv", "x.csv", "--parquet", "./x.csv"], "x.csv: two outputs go to this file"),
        (["--sql", "SELECT 1", "--timeout", "inf"], "not in the range"),
        (["--sql", "\udcff"], "check the statement"),
        (["--quantity", "\udcff"], r"quantity '\xff': not in these results"),
    ],
)
def test_a_bad_argument_is_one_line(results, arguments, text):
    done = run(results, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert text in done.stderr


def test_until_the_last_day_that_a_date_can_name_is_all(results):
    whole = run(results, "--until", "9999-12-31", "--since", "0001-01-01")
    assert "12 captures: 11 ok, 1 part" in whole.stdout


def test_no_results_is_one_line(tmp_path):
    for where in (tmp_path, tmp_path / "nowhere", __file__, "", "s3://"):
        done = run(where)
        assert done.returncode == 2
        assert done.stderr.startswith("wheelplane: ")
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("mode", ["--summary", "--drift", "--failures", "--worst=3"])
def test_text_and_json_of_a_mode_agree(results, mode):
    text, tree = run(results, mode).stdout, json.loads(run(results, mode, "--json").stdout)
    (name,) = set(tree) - {"schema"}
    assert name in mode
    for row in tree[name]:
        assert row.get("quantity", row.get("stage")) in text
        if "unit" in row:
            assert row["unit"] in ("deg", "m")
    assert len(tree[name]) > 2


def spreadsheet(results, tmp_path, kind):
    path = tmp_path / f"table.{kind}"
    done = run(results, f"--{kind}", path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"wrote {path} (17 captures)\n"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    first = path.read_bytes()
    assert run(results, f"--{kind}", path).returncode == 1
    assert path.read_bytes() == first
    return path


def cells(path: Path) -> list[dict]:
    """The rows of an exported file, by independent readers."""
    if path.suffix == ".csv":
        with path.open(newline="", encoding="utf-8") as stream:
            return list(csv.DictReader(stream))
    if path.suffix == ".xlsx":
        head, *rows = openpyxl.load_workbook(path)["captures"].iter_rows()
        assert {cell.data_type for row in rows for cell in row} <= {"s", "inlineStr", "n"}
        names = [cell.value for cell in head]
        return [dict(zip(names, (cell.value for cell in row), strict=True)) for row in rows]
    found = duckdb.connect().execute("SELECT * FROM read_parquet(?)", [str(path)])
    names = [column[0] for column in found.description]
    return [dict(zip(names, row, strict=True)) for row in found.fetchall()]


@pytest.mark.parametrize("kind", ["csv", "xlsx", "parquet"])
def test_an_exported_table_holds_every_number(results, catalogue, tmp_path, kind):
    rows = cells(spreadsheet(results, tmp_path, kind))
    assert [str(row["name"]).lstrip("'") for row in rows] == [r.name for r in captures(catalogue)]
    assert rows[0]["name"] == ("'=site/formula" if kind == "csv" else "=site/formula")
    assert rows[0]["RR_toe_deg"] in (None, "")
    toes = series(catalogue, ["RR toe", "wheelbase_left"])
    keys = [number_of(row["key"]) for row in rows]
    for one, column in zip(toes, ("RR_toe_deg", "wheelbase_left_m"), strict=True):
        for number, value, u in zip(one.numbers, one.values, one.u, strict=True):
            row = rows[keys.index(number)]
            exact = 0.0 if kind != "xlsx" else 1e-14  # a workbook's numbers have 15 digits
            assert float(row[column]) == pytest.approx(value, rel=exact, abs=0.0)
            assert float(row[f"u_{column}"]) == pytest.approx(u, rel=exact, abs=0.0)


def test_a_column_of_parquet_has_the_same_type_whatever_is_in_it(tmp_path):
    """Exports of several results are read as one table, in any order."""
    kinds = {
        "dated": [result("a", date="2026-11-20")],
        "undated": [result("b")],
        "failed": [result("c", status="failed", reason="no target")],
        "none": [],
    }
    paths = []
    for kind, trees in kinds.items():
        add(open_store(str(tmp_path / kind)), result("other"), *trees)
        paths.append(str(tmp_path / f"{kind}.parquet"))
        with open_catalogue(str(tmp_path / kind)) as catalogue:
            named = "none at all" if kind == "none" else trees[0]["capture"]
            columns = export.table(catalogue, Filter(text=named))
            export.export(Path(paths[-1]), columns, export.write_parquet)
    read = "SELECT name, date, doubted FROM read_parquet(?) ORDER BY name"
    for order in (paths, paths[::-1]):
        assert duckdb.connect().execute(read, [order]).fetchall() == [
            ("a", "2026-11-20", 0),
            ("b", None, 0),
            ("c", None, 0),
        ]
    for path in paths:
        described = duckdb.connect().execute("DESCRIBE SELECT * FROM read_parquet(?)", [path])
        types = {name: kind for name, kind, *_ in described.fetchall()}
        assert (types["name"], types["date"], types["doubted"]) == ("VARCHAR", "VARCHAR", "BIGINT")


def test_what_excel_does_not_take_is_reported(monkeypatch, catalogue, tmp_path):
    monkeypatch.setattr(export, "EXCEL_ROWS", 17)
    with pytest.raises(InputError, match=r"17 captures exceed the 16 rows.*--parquet"):
        export.export(tmp_path / "t.xlsx", export.table(catalogue), export.write_xlsx)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(export, "EXCEL_ROWS", 18)
    export.export(tmp_path / "t.xlsx", export.table(catalogue), export.write_xlsx)
    table = {"name": np.array(["\x07" + "x" * 40_000], object)}
    export.export(tmp_path / "u.xlsx", table, export.write_xlsx)
    cell = cells(tmp_path / "u.xlsx")[0]["name"]
    assert len(cell) == export.EXCEL_CHARACTERS
    assert cell.startswith("\\x07xx")
    assert cell.endswith("x…")


def test_a_missing_library_is_reported_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[tables\]'"):
        export.write_parquet(tmp_path / "t.parquet", {"name": np.array(["a"], object)})


def test_a_workbook_names_no_time_of_day(results, tmp_path):
    path = spreadsheet(results, tmp_path, "xlsx")
    with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as book:
        assert {info.date_time for info in book.infolist()} == {export.EPOCH}
        assert b"2026" not in book.read("docProps/core.xml")


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 100, 1001, 5000])
def test_the_median_is_that_of_numpy_to_the_last_bit(n):
    rng = np.random.default_rng(n)
    for x in (rng.normal(size=n), rng.integers(0, 3, n).astype(float), np.full(n, -0.1)):
        before = x.copy()
        assert trends_module.median_of(x) == np.median(x)
        assert np.array_equal(x, before)
