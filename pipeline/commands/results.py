"""`wheelplane results`: lists, statistics, tables and SQL of a folder of results."""

from __future__ import annotations

import csv
import math
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import click
from click.core import ParameterSource

from ..batch.catalogue.catalogue import FILE as CATALOGUE
from ..batch.catalogue.catalogue import Catalogue, open_catalogue, rebuild
from ..batch.catalogue.rows import STATUSES
from ..batch.operation import times
from ..batch.results import calibrations, export, listing, page, trends
from ..batch.results.calibration_list import (
    calibration_columns,
    calibrations_text,
    serials,
    trees_of,
)
from ..batch.results.calibration_list import calibrations as list_calibrations
from ..batch.results.query import (
    ALL,
    Filter,
    ValueRange,
    by_status,
    captures,
    copies,
    count,
    doubted,
    failures,
    known_quantity,
    quantities_of,
    removed,
    verticals,
    wheels_of,
)
from ..batch.results.sql import ask
from ..batch.storage.entry import legible
from ..batch.storage.store import open_store
from ..config import load_config
from ..errors import InputError, printable
from ..measurement import VerticalKind
from ..report.format.report_options import ReportOptions
from ..report.format.view import AngleStyle, DigitStyle, View
from ..report.format.writer import Writer
from ..report.json.text import json_text
from ..report.write import ReportFiles, document_files, keep_inputs, write_whole
from ..system import frozen
from .shared.capture_options import config_option
from .shared.limits import SECONDS, within
from .shared.progress import Reading
from .shared.reporting import report_options
from .shared.view_options import digits_option, language_option

SCHEMA = "wheelplane/results/1"
WRITERS = {
    "csv": export.write_csv,
    "xlsx": export.write_xlsx,
    "parquet": export.write_parquet,
}
FILE = click.Path(path_type=Path, dir_okay=False)
PIPE = Path("-")
FILTERS = ("text", "vehicle", "since", "until", "status", "gone", "spans", "vertical")


@frozen
class Query:
    """Selection of captures and quantities, and the form of the answer."""

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
    epilog="Exit codes: 0 all selected captures are measured in full; 1 some are not; "
    "2 unusable results or arguments. --sql: 0 or 2. --calibrations: 0 every machine is shown to "
    "conform, or has no MPE; 1 some are not.",
)
@click.argument("results")
@click.option(
    "--name",
    "text",
    type=legible,
    default="",
    metavar="TEXT",
    help="Text that the captures' names contain.",
)
@click.option("--vehicle", type=legible, metavar="NAME", help="Vehicle of the captures.")
@click.option("--since", metavar="DATE", help="First date of the captures (ISO 8601).")
@click.option("--until", metavar="DATE", help="Last date of the captures.")
@click.option(
    "--status",
    multiple=True,
    type=click.Choice(STATUSES),
    help="Status of the captures. May be repeated.",
)
@click.option(
    "--gone/--no-gone",
    default=None,
    help="Select captures that were no longer, or still, in the archive at the last `batch` run.",
)
@click.option(
    "--where",
    "spans",
    multiple=True,
    nargs=2,
    type=legible,
    metavar="QUANTITY MIN..MAX",
    help="Quantity ('RR toe', '1 camber', wheelbase ...) and its range, in degrees or metres; "
    "either end may be left out. May be repeated.",
)
@click.option(
    "--vertical",
    type=click.Choice(get_args(VerticalKind)),
    help="Vertical from which the captures' cambers were measured.",
)
@click.option("--summary", is_flag=True, help="Print statistics of each quantity.")
@click.option("--drift", is_flag=True, help="Print the slope over time of each quantity.")
@click.option(
    "--item",
    "serial",
    type=legible,
    metavar="SERIAL",
    help="Serial number of a machine, whose calibrations in RESULTS, or below that folder, --drift "
    "takes instead of captures; proposes an interval.",
)
@click.option(
    "--calibrations",
    "calibrated",
    is_flag=True,
    help="List the calibrations of machines; with --csv, --xlsx, --parquet: export them.",
)
@click.option("--failures", "failing", is_flag=True, help="List what was not measured, and why.")
@click.option(
    "--worst",
    type=click.IntRange(1),
    metavar="N",
    help="Number of outliers to list, largest first.",
)
@click.option(
    "--slow",
    type=click.IntRange(1),
    metavar="N",
    help="Number of captures to list that took longest to measure, with the seconds of each stage.",
)
@click.option(
    "--sql",
    type=legible,
    metavar="SELECT",
    help="SQL query of the tables captures, wheels, quantities and calibrations.",
)
@click.option(
    "--timeout",
    type=SECONDS,
    default=600.0,
    show_default=True,
    metavar="SECONDS",
    help="Time limit of --sql, after which it ends.",
)
@click.option(
    "--memory",
    metavar="SIZE",
    help="Memory limit of --sql, such as 4G; by default, nine tenths of the machine's.",
)
@click.option(
    "--quantity",
    "quantities",
    multiple=True,
    type=legible,
    metavar="NAME",
    help="Quantity for --summary, --drift and --worst; all by default. May be repeated.",
)
@click.option(
    "--limit", type=click.IntRange(1), metavar="N", help="Number of captures to list, at most."
)
@click.option(
    "--angles",
    type=click.Choice(["dms", "deg", "mm/m"]),
    default="dms",
    show_default=True,
    help="Angle format of the text: deg-min-sec, degrees; toe in mm/m.",
)
@digits_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else.")
@click.option(
    "--csv", "csv_file", type=FILE, help="CSV file for the captures and all numbers; - prints it."
)
@click.option("--xlsx", "xlsx_file", type=FILE, help="Excel file for the same table.")
@click.option("--parquet", "parquet_file", type=FILE, help="Parquet file for the same table.")
@click.option(
    "--html", "html_file", type=FILE, help="HTML file for a report of the lists, or of all."
)
@click.option("--pdf", "pdf_file", type=FILE, help="PDF file for the same report.")
@language_option
@config_option
@click.option("--rebuild", "anew", is_flag=True, help="Rebuild the catalogue from the JSON files.")
def results(
    results: str,
    text: str,
    vehicle: str | None,
    since: str | None,
    until: str | None,
    status: tuple[str, ...],
    gone: bool | None,
    spans: tuple[tuple[str, str], ...],
    vertical: str | None,
    summary: bool,
    drift: bool,
    serial: str | None,
    calibrated: bool,
    failing: bool,
    worst: int | None,
    slow: int | None,
    sql: str | None,
    timeout: float,
    memory: str | None,
    quantities: tuple[str, ...],
    limit: int | None,
    angles: AngleStyle,
    digits: DigitStyle,
    as_json: bool,
    csv_file: Path | None,
    xlsx_file: Path | None,
    parquet_file: Path | None,
    html_file: Path | None,
    pdf_file: Path | None,
    language: str | None,
    config: Path | None,
    anew: bool,
) -> int:
    """Query the catalogue of RESULTS."""
    if slow is not None:
        _require_alone("--slow", "slow", "as_json")
        return _slowest(results, slow, as_json)
    given = {"summary": summary, "drift": drift, "failures": failing, "worst": worst is not None}
    modes = [mode for mode, chosen in given.items() if chosen]
    if serial is not None:
        if modes != ["drift"]:
            raise click.UsageError("--item is of --drift: add it, and leave out other lists")
        _require_alone("--item", "serial", "drift", "as_json")
        return _of_machine(results, serial, as_json)
    if calibrated and (modes or worst or sql or html_file or pdf_file):
        raise click.UsageError("--calibrations is a list of its own: leave out other lists")
    if as_json and len(modes) > 1:
        raise click.UsageError(
            "--json with several lists: choose one of --summary, --drift, --failures, --worst"
        )
    which = Filter(
        text,
        vehicle,
        status=status,
        ranges=tuple(_range(*span) for span in spans),
        removed=gone,
        vertical=vertical,
        **_period(since, until),
    )
    query = Query(which, quantities or None, View(angles=angles, digits=digits), limit, as_json)
    files = {"csv": csv_file, "xlsx": xlsx_file, "parquet": parquet_file}
    written = [*files.values(), html_file, pdf_file]
    if sql is not None and (modes or any(written) or quantities or limit or which != ALL):
        raise click.UsageError("--sql stands alone: write the selection into the SELECT")
    if PIPE in (xlsx_file, parquet_file, html_file, pdf_file):
        raise InputError(
            "--xlsx -, --parquet -, --html -, --pdf -: only --csv is printed: give a file"
        )
    keep_inputs(written, [Path(results) / CATALOGUE])
    reports = {"html": html_file, "pdf": pdf_file}
    options = report_options(load_config(config).report, language, query.view)
    if csv_file == PIPE and (modes or as_json):
        raise click.UsageError("--csv - is printed alone: give a file")
    with Reading("the results") as progress:
        if anew:
            rebuild(open_store(results), progress)
        catalogue = open_catalogue(results, progress)
    with catalogue:
        if sql is not None:
            with within(timeout, memory, "select fewer rows"):
                return _answer(catalogue, sql, as_json)
        for name in quantities:
            known_quantity(catalogue, name)
        if calibrated:
            return _show_calibrations(catalogue, query, files)
        exported = _export(catalogue, which, files)
        exported |= _report(catalogue, results, query, modes, worst, reports, options)
        listed = [] if exported and not as_json else ["list"]
        for number, mode in enumerate(modes or listed):
            if number:
                click.echo()
            _list(catalogue, query, mode, worst or 0)
        _warn_undated(catalogue, which)
        _warn_of_verticals(catalogue, which)
        if {"summary", "drift", "worst"} & set(modes):
            _warn_of_doubts(catalogue, which)
            _warn_of_counted(catalogue, which)
        return int(set(by_status(catalogue, which)) - {"ok"} != set())


def _require_alone(option: str, *beside: str) -> None:
    """Raise UsageError where options are given that this one does not heed."""
    context = click.get_current_context()
    for one in context.command.params:
        given = context.get_parameter_source(str(one.name)) is ParameterSource.COMMANDLINE
        if given and one.name not in ("results", *beside):
            raise click.UsageError(f"{option} does not go with {one.opts[0]}: leave one out")


def _slowest(results: str, number: int, as_json: bool) -> int:
    """Print the captures that took longest."""
    found = times.slowest(open_store(results), number)
    if as_json:
        rows = [listing.plain(one) | {"total_s": one.total_s} for one in found]
        click.echo(json_text({"schema": SCHEMA, "slow": rows}))
    else:
        click.echo(times.slow_text(found))
    return 0


def _of_machine(folder: str, serial: str, as_json: bool) -> int:
    """Print the drift of a machine over its calibrations, and the interval that it proposes."""
    listed: list[tuple[str, dict[str, Any]]] = []
    others: set[str] = set()
    local = open_store(folder).local
    if local is None or (local / "measurements").is_dir():
        with Reading("the results") as progress, open_catalogue(folder, progress) as catalogue:
            listed, others = list(trees_of(catalogue, serial)), serials(catalogue)
    found = calibrations.machine_history(local, serial, listed, others)
    if as_json:
        tree = {
            "schema": SCHEMA,
            "item": found.serial,
            "files": list(found.files),
            "drift": [listing.plain(row) for row in found.drifts],
            "intervals": [listing.plain(row) for row in found.intervals],
        }
        click.echo(json_text(tree))
    else:
        click.echo(calibrations.history_text(found), nl=False)
    return 0


def _show_calibrations(catalogue: Catalogue, query: Query, files: dict[str, Path | None]) -> int:
    """Print or export the calibrations; return 0 if each machine is shown to conform."""
    found = list_calibrations(catalogue, query.which)
    exported = _export_columns(calibration_columns(found), files, "calibrations")
    if query.as_json or not exported:
        listed = found[: query.limit]
        if query.as_json:
            rows = [listing.plain(one) for one in listed]
            tree = {"schema": SCHEMA, "calibrations": rows}
            click.echo(json_text(tree))
        else:
            click.echo(calibrations_text(listed, query.view))
    return int(any(one.error or one.decision not in (None, "conform") for one in found))


def _list(catalogue: Catalogue, query: Query, mode: str, worst: int) -> None:
    """Print one list or table, as text or JSON."""
    which, quantities, view = query.which, query.quantities, query.view
    if mode == "summary":
        _print("summary", trends.summary(catalogue, quantities, which), listing.summary_text, query)
    elif mode == "drift":
        _print("drift", trends.drifts(catalogue, quantities, which), listing.drift_text, query)
    elif mode == "worst":
        found = trends.worst(catalogue, worst, quantities, which)
        _print("worst", found, listing.worst_text, query)
    elif mode == "failures":
        _print("failures", failures(catalogue, which), listing.failures_text, query)
    elif query.as_json:
        _print_captures(catalogue, query)
    else:
        for line in listing.capture_table(catalogue, which, view, query.limit):
            click.echo(line)
        click.echo(f"\n{listing.captures_note()}")
        gone = 0 if which.removed is False else count(catalogue, replace(which, removed=True))
        click.echo(listing.totals(by_status(catalogue, which), gone))


def _print(name: str, found: tuple[Any, ...], text: Callable[..., str], query: Query) -> None:
    if query.as_json:
        rows = [listing.plain(row) for row in found]
        click.echo(json_text({"schema": SCHEMA, name: rows}))
    else:
        click.echo(text(found, query.view))


def _print_captures(catalogue: Catalogue, query: Query) -> None:
    found = captures(catalogue, query.which, limit=query.limit)
    trees = (
        listing.plain(row)
        | {
            "wheels": [listing.plain(wheel) for wheel in wheels_of(catalogue, row.key)],
            "quantities": [listing.plain(q) for q in quantities_of(catalogue, row.key)],
        }
        for row in found
    )
    _print_rows('"captures"', trees)


def _print_rows(head: str, rows: Iterable[Any]) -> None:
    """Print JSON of a list one by one, so that a million of them need no memory."""
    click.echo(f'{{"schema": "{SCHEMA}", {head}: [', nl=False)
    between = "\n"
    for row in rows:
        click.echo(between + json_text(row, indent=None), nl=False)
        between = ",\n"
    click.echo("\n]}")


def _answer(catalogue: Catalogue, question: str, as_json: bool) -> int:
    """Print the answer to an SQL query as CSV or JSON."""
    answer = ask(catalogue, question)
    if as_json:
        columns = json_text(answer.columns, indent=None)
        _print_rows(f'"columns": {columns}, "rows"', ([*map(_in_json, row)] for row in answer.rows))
    else:
        shown = SimpleNamespace(write=lambda lines: sys.stdout.write(_shown(lines)))
        out = shown if sys.stdout.isatty() else sys.stdout
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
    return 0


def _shown(csv_lines: str) -> str:
    """Return lines of CSV for a terminal: what could control it is escaped."""
    return "\n".join(map(printable, csv_lines.split("\n")))


def _in_json(cell: object) -> object:
    """Return a cell as JSON holds it: bytes, and infinity, which JSON has not, as text."""
    is_infinite = isinstance(cell, float) and not math.isfinite(cell)
    return repr(cell) if isinstance(cell, bytes) or is_infinite else cell


def _export(catalogue: Catalogue, which: Filter, files: dict[str, Path | None]) -> bool:
    """Write the tables that the options name; return whether there were any."""
    columns = export.table(catalogue, which) if any(files.values()) else {}
    return _export_columns(columns, files, "captures")


def _export_columns(
    columns: export.ExportColumns, files: dict[str, Path | None], what: str
) -> bool:
    """Write columns to the named files; return whether there were any."""
    named = {kind: path for kind, path in files.items() if path is not None}
    for kind, path in named.items():
        if path == PIPE:
            content = export.as_csv(columns)
            click.echo(_shown(content.decode()) if sys.stdout.isatty() else content, nl=False)
            continue
        export.export(path, columns, WRITERS[kind])
        click.echo(f"wrote {path} ({len(columns['key']):,} {what})", err=True)
    return bool(named)


def _report(
    catalogue: Catalogue,
    source: str,
    query: Query,
    modes: list[str],
    worst: int | None,
    files: dict[str, Path | None],
    options: ReportOptions,
) -> bool:
    """Write the report to the named files; return whether there were any."""
    if not any(files.values()):
        return False
    lists = modes or [name for name in page.LISTS if name != "worst"]
    limit = query.limit or page.MOST_CAPTURES
    which, quantities = query.which, query.quantities
    chosen = page.Selection(source, which, quantities, lists, limit, worst or 0, _selecting())
    writer = Writer(options.words, options.view)
    document = page.results_document(catalogue, chosen, writer)
    for kind, path in files.items():
        if path is not None:
            wanted = ReportFiles(html=kind == "html", pdf=kind == "pdf")
            (content,) = document_files("results", document, options, wanted).values()
            write_whole(path, content)
            click.echo(f"wrote {path}", err=True)
    return True


def _selecting() -> str:
    """Return the options by which captures and quantities are chosen, as a shell takes them."""
    context = click.get_current_context()
    chosen = [
        one
        for one in context.command.params
        if one.name in (*FILTERS, "quantities")
        and context.get_parameter_source(one.name) is ParameterSource.COMMANDLINE
    ]
    words = (word for one in chosen for word in _as_given(one, context.params[str(one.name)]))
    return printable(shlex.join(words))


def _as_given(option: click.Parameter, value: Any) -> Iterator[str]:
    """Yield the words of an option and its value, of each where it may be repeated."""
    if isinstance(value, bool):
        yield option.opts[0] if value else option.secondary_opts[0]
        return
    for each in value if option.multiple else [value]:
        yield option.opts[0]
        yield from [each] if isinstance(each, str) else each


def _warn_of_verticals(catalogue: Catalogue, which: Filter) -> None:
    """Note captures whose cambers are from unlike verticals, which are not to be compared."""
    found = verticals(catalogue, which)
    if len(found) > 1:
        each = ", ".join(f"{number:,} from {vertical}" for vertical, number in found.items())
        click.echo(f"cambers are from unlike verticals ({each}): choose by --vertical", err=True)


def _warn_of_doubts(catalogue: Catalogue, which: Filter) -> None:
    """Note how many captures statistics leave out, as their scans contradict their names."""
    if found := doubted(catalogue, which):
        captures_are = "1 capture in doubt is" if found == 1 else f"{found:,} captures in doubt are"
        click.echo(
            f"{captures_are} left out of statistics: see the list, without options", err=True
        )


def _warn_of_counted(catalogue: Catalogue, which: Filter) -> None:
    """Note how many captures statistics count that show nothing new: removed ones, and copies."""
    for counted, note in (
        (
            removed,
            "no longer in the archive counted too, a renamed one twice: --no-gone leaves them out",
        ),
        (
            copies,
            "of the same files as another counted too, as if measured again: the column scans of "
            "--sql shows which",
        ),
    ):
        if found := counted(catalogue, which):
            captures_are = "1 capture" if found == 1 else f"{found:,} captures"
            click.echo(f"{captures_are} {note}", err=True)


def _warn_undated(catalogue: Catalogue, which: Filter) -> None:
    """Note how many captures have no date, where --since or --until selects by date."""
    anytime = replace(which, since_day=None, until_day=None, since_date=None, until_date=None)
    if which == anytime:
        return
    undated = count(catalogue, anytime) - count(catalogue, replace(anytime, since_day=-math.inf))
    if undated:
        captures_are = (
            "1 capture without a date is"
            if undated == 1
            else (f"{undated} captures without a date are")
        )
        advice = "give it in capture.toml, or by batch --date-in-name"
        click.echo(f"{captures_are} left out: {advice}", err=True)


def _period(since: str | None, until: str | None) -> dict[str, Any]:
    """Return what a filter holds of both. Raises InputError where the first is after the last."""
    period = _bound("since", since) | _bound("until", until)
    for of in ("date", "day"):
        first, last = (period.get(f"{end}_{of}") for end in ("since", "until"))
        if first is not None and last is not None and first > last:
            raise InputError(f"--since {since}: is after --until {until}: exchange the two")
    return period


def _bound(end: str, text: str | None) -> dict[str, Any]:
    """Return what a filter holds of `since` or `until`: a date, or days since 1970-01-01 of a time.

    A date is by the clock of each capture, a time by UTC unless it has a zone.
    """
    if text is None:
        return {}
    try:
        moment = datetime.fromisoformat("" if "W" in text else text)  # a week is no day
    except ValueError as error:
        raise InputError(f"--{end} {text}: is not a date: write it as 2026-11-20") from error
    if len(text) <= len(date.min.isoformat()):
        return {f"{end}_date": moment.date().isoformat()}
    zoned = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    after = timedelta(microseconds=1) if end == "until" else timedelta(0)
    return {f"{end}_day": (zoned.timestamp() + after.total_seconds()) / 86400.0}


def _range(quantity: str, text: str) -> ValueRange:
    low, dots, high = text.partition("..")
    try:
        span = ValueRange(quantity, float(low or "-inf"), float(high or "inf"))
    except ValueError:
        dots = ""
    if not dots or not span.low <= span.high:
        raise InputError(
            f"--where '{quantity}' {text}: write the range as MIN..MAX, such as -0.2..0.1"
        )
    return span
