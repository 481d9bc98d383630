"""`wheelplane results`: what a folder of results holds, in lists, statistics, tables and SQL."""

from __future__ import annotations

import csv
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import click

from ..batch.catalogue.catalogue import Catalogue, open_catalogue, rebuild
from ..batch.results import export, listing, trends
from ..batch.results.query import (
    ALL,
    STATUSES,
    Filter,
    Range,
    captures,
    count,
    failures,
    known_quantity,
    quantities_of,
    wheels_of,
)
from ..batch.results.sql import ask
from ..batch.storage.store import open_store
from ..errors import InputError
from ..report.format.view import AngleStyle, View
from .progress import Reading

SCHEMA = "wheelplane/results/1"
WRITERS = {
    "csv": export.write_csv,
    "xlsx": export.write_xlsx,
    "parquet": export.write_parquet,
}
FILE = click.Path(path_type=Path, dir_okay=False)
PIPE = Path("-")


@dataclass(frozen=True)
class Query:
    """Which captures, which quantities, and how to tell it."""

    which: Filter
    quantities: tuple[str, ...] | None
    view: View
    limit: int | None
    as_json: bool


HELP = """List, filter and summarise the results that `wheelplane batch` wrote to RESULTS.

RESULTS is a folder or a URL such as s3://bucket/results.

\b
wheelplane results RESULTS --where 'RR toe' -0.2..0.1 --since 2026-11-01
wheelplane results RESULTS --drift --vehicle AA-00-BB --quantity 'RR toe'
wheelplane results RESULTS --sql "SELECT name FROM captures WHERE kind = 'zip'"
"""


@click.command(
    help=HELP,
    epilog="Exit codes: 0 all captures that were asked about are measured in full; 1 some are not; "
    "2 unusable results or arguments. --sql: 0 or 2.",
)
@click.argument("results")
@click.option("--name", "text", default="", metavar="TEXT", help="Captures with this in the name.")
@click.option("--vehicle", metavar="NAME", help="Captures of this vehicle.")
@click.option("--since", metavar="DATE", help="Captures of this day (ISO 8601) or later.")
@click.option("--until", metavar="DATE", help="Captures of this day or earlier.")
@click.option("--status", multiple=True, type=click.Choice(STATUSES), help="May be repeated.")
@click.option(
    "--gone/--no-gone",
    default=None,
    help="Captures that were no longer, or still, in the archive at the last run of `batch`.",
)
@click.option(
    "--where",
    "spans",
    multiple=True,
    nargs=2,
    metavar="QUANTITY MIN..MAX",
    help="Captures whose 'RR toe', '1 camber', wheelbase ... lies there, in degrees or metres; "
    "either end may be left out. May be repeated.",
)
@click.option("--summary", is_flag=True, help="Statistics of each quantity.")
@click.option("--drift", is_flag=True, help="Slope over time of each quantity.")
@click.option("--failures", "failing", is_flag=True, help="What was not measured, and why.")
@click.option("--worst", type=click.IntRange(1), metavar="N", help="The N that stand out most.")
@click.option("--sql", metavar="SELECT", help="Ask the tables captures, wheels and quantities.")
@click.option(
    "--quantity",
    "quantities",
    multiple=True,
    metavar="NAME",
    help="Only this, with --summary, --drift and --worst. May be repeated.",
)
@click.option("--limit", type=click.IntRange(1), metavar="N", help="List no more than N captures.")
@click.option(
    "--angles",
    type=click.Choice(["dms", "deg", "mm/m"]),
    default="dms",
    show_default=True,
    help="Angles of the text: deg-min-sec, degrees; toe in mm/m.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, only.")
@click.option(
    "--csv", "csv_file", type=FILE, help="Write the captures and all numbers as CSV; - prints."
)
@click.option("--xlsx", "xlsx_file", type=FILE, help="The same for Excel.")
@click.option("--parquet", "parquet_file", type=FILE, help="The same as Parquet.")
@click.option("--rebuild", "anew", is_flag=True, help="Make the catalogue anew from the JSONs.")
def results(
    results: str,
    text: str,
    vehicle: str | None,
    since: str | None,
    until: str | None,
    status: tuple[str, ...],
    gone: bool | None,
    spans: tuple[tuple[str, str], ...],
    summary: bool,
    drift: bool,
    failing: bool,
    worst: int | None,
    sql: str | None,
    quantities: tuple[str, ...],
    limit: int | None,
    angles: AngleStyle,
    as_json: bool,
    csv_file: Path | None,
    xlsx_file: Path | None,
    parquet_file: Path | None,
    anew: bool,
) -> int:
    """Ask the catalogue of RESULTS."""
    told = {"summary": summary, "drift": drift, "failures": failing, "worst": worst is not None}
    modes = [mode for mode, wanted in told.items() if wanted]
    if as_json and len(modes) > 1:
        raise click.UsageError("--json: of --summary, --drift, --failures, --worst choose one")
    which = Filter(
        text,
        vehicle,
        None if since is None else _day("--since", since, False),
        None if until is None else _day("--until", until, True),
        status,
        tuple(_range(*span) for span in spans),
        gone,
    )
    asked = Query(which, quantities or None, View(angles=angles), limit, as_json)
    files = {"csv": csv_file, "xlsx": xlsx_file, "parquet": parquet_file}
    if sql is not None and (modes or any(files.values()) or quantities or limit or which != ALL):
        raise click.UsageError("--sql stands alone: write what is wanted into the SELECT")
    if PIPE in (xlsx_file, parquet_file):
        raise InputError("--xlsx -, --parquet -: only --csv is printed: name a file")
    if csv_file == PIPE and (modes or as_json):
        raise click.UsageError("--csv - is printed alone: name a file")
    with Reading("the results") as progress:
        if anew:
            rebuild(open_store(results), progress)
        catalogue = open_catalogue(results, progress)
    with catalogue:
        if sql is not None:
            return _answer(catalogue, sql, as_json)
        for name in quantities:
            known_quantity(catalogue, name)
        written = _export(catalogue, which, files)
        for number, mode in enumerate(modes or ([] if written else ["list"])):
            if number:
                click.echo()
            _tell(catalogue, asked, mode, worst or 0)
        _tell_undated(catalogue, which)
        return int(set(listing.by_status(catalogue, which)) - {"ok"} != set())


def _tell(catalogue: Catalogue, asked: Query, mode: str, worst: int) -> None:
    """Print what was asked, as text or JSON."""
    which, quantities, view = asked.which, asked.quantities, asked.view
    if mode == "summary":
        _print("summary", trends.summary(catalogue, quantities, which), listing.summary_text, asked)
    elif mode == "drift":
        _print("drift", trends.drifts(catalogue, quantities, which), listing.drift_text, asked)
    elif mode == "worst":
        found = trends.worst(catalogue, worst, quantities, which)
        _print("worst", found, listing.worst_text, asked)
    elif mode == "failures":
        _print("failures", failures(catalogue, which), listing.failures_text, asked)
    elif asked.as_json:
        _print_captures(catalogue, asked)
    else:
        for line in listing.capture_table(catalogue, which, view, asked.limit):
            click.echo(line)
        click.echo(f"\n{listing.SIGNS} {listing.K1}, the largest of the capture's angles.")
        gone = 0 if which.gone is False else count(catalogue, replace(which, gone=True))
        click.echo(listing.totals(listing.by_status(catalogue, which), gone))


def _print(name: str, found: tuple[Any, ...], text: Callable[..., str], asked: Query) -> None:
    if asked.as_json:
        rows = [listing.plain(row) for row in found]
        click.echo(json.dumps({"schema": SCHEMA, name: rows}, indent=1, ensure_ascii=False))
    else:
        click.echo(text(found, asked.view))


def _print_captures(catalogue: Catalogue, asked: Query) -> None:
    """A list as it comes, so that a million captures need no memory."""
    click.echo(f'{{"schema": "{SCHEMA}", "captures": [', nl=False)
    between = "\n"
    for row in captures(catalogue, asked.which, limit=asked.limit):
        tree = listing.plain(row) | {
            "wheels": [listing.plain(wheel) for wheel in wheels_of(catalogue, row.key)],
            "quantities": [listing.plain(q) for q in quantities_of(catalogue, row.key)],
        }
        click.echo(between + json.dumps(tree, ensure_ascii=False), nl=False)
        between = ",\n"
    click.echo("\n]}")


def _answer(catalogue: Catalogue, question: str, as_json: bool) -> int:
    """Print the answer to SQL as CSV, or as JSON."""
    answer = ask(catalogue, question)
    if as_json:
        rows = [[f"{x!r}" if isinstance(x, bytes) else x for x in row] for row in answer.rows]
        tree = {"schema": SCHEMA, "columns": answer.columns, "rows": rows}
        click.echo(json.dumps(tree, indent=1, ensure_ascii=False))
    else:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
    return 0


def _export(catalogue: Catalogue, which: Filter, files: dict[str, Path | None]) -> bool:
    """Write the tables that are asked for; whether any is."""
    wanted = {kind: path for kind, path in files.items() if path is not None}
    columns = export.table(catalogue, which) if wanted else {}
    for kind, path in wanted.items():
        if path == PIPE:
            click.echo(export.as_csv(columns), nl=False)
            continue
        export.export(path, columns, WRITERS[kind])
        click.echo(f"wrote {path} ({len(columns['key']):,} captures)", err=True)
    return bool(wanted)


def _tell_undated(catalogue: Catalogue, which: Filter) -> None:
    """Say of how many captures no date is known, where dates were asked for."""
    if which.since_day is None and which.until_day is None:
        return
    anytime = replace(which, since_day=None, until_day=None)
    undated = count(catalogue, anytime) - count(catalogue, replace(anytime, since_day=-math.inf))
    if undated:
        captures_are = (
            "1 capture without a date is"
            if undated == 1
            else (f"{undated} captures without a date are")
        )
        mend = "tell it in capture.toml, or by batch --date-in-name"
        click.echo(f"{captures_are} left out: {mend}", err=True)


def _day(option: str, text: str, end: bool) -> float:
    """Days since 1970-01-01, UTC where no zone is given; of `end`, just after what it names."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise InputError(f"{option} {text}: is no date: write it as 2026-11-20") from error
    zoned = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    whole_day = len(text) <= len(date.min.isoformat())
    after = timedelta(days=1) if whole_day else timedelta(microseconds=1)
    return (zoned + after * end).timestamp() / 86400.0


def _range(quantity: str, text: str) -> Range:
    low, dots, high = text.partition("..")
    try:
        span = Range(quantity, float(low or "-inf"), float(high or "inf"))
    except ValueError:
        dots = ""
    if not dots or not span.low <= span.high:
        raise InputError(
            f"--where '{quantity}' {text}: write the range as MIN..MAX, such as -0.2..0.1"
        )
    return span
