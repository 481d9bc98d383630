"""`wheelplane batch`: every capture of an archive, and a catalogue of them."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from ..errors import InputError
from .shared.batch_options import (
    absolute,
    given_options,
    make_engine,
    measuring_options,
    read_settings,
    work_options,
)
from .shared.options import FiniteRange

if TYPE_CHECKING:
    from types import FrameType

    from ..batch.run.work import RunRequest

MOST_SHOWN = 3
HAND_BACK_S = 15.0  # after SIGTERM; machines that are taken back leave 30 s or more


@click.command()
@click.argument("archive", required=False)
@click.option(
    "-o",
    "--output",
    "results",
    metavar="RESULTS",
    help="Folder or URL for the results.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Go on, without asking, in RESULTS created with another archive, settings or version: "
    "what these change is measured anew.",
)
@click.option(
    "--retry",
    is_flag=False,
    flag_value="failed",
    metavar="[failed|STATUS|NAME]",
    help="Measure again what failed before, or has this status, or the capture of this name.",
)
@click.option(
    "--status",
    "watched",
    metavar="RESULTS",
    help="Print what the runs on RESULTS have done, are at, and how fast, from any machine.",
)
@click.option(
    "--metrics",
    metavar="FILE|PORT",
    help="State of the runs as OpenMetrics, for Prometheus: in FILE, renewed every 5 s, or at "
    "http://127.0.0.1:PORT/metrics; HOST:PORT for other machines. With --status without a run.",
)
@click.option(
    "--why",
    metavar="NAME",
    help="Print the status, reason, inputs and log of a capture in RESULTS.",
)
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    metavar="N",
    help="Number of captures to measure now, at most.",
)
@click.option(
    "--inventory",
    metavar="URL",
    help="Manifest of a bucket's inventory (S3 Inventory, CSV or Parquet), read instead of listing "
    "ARCHIVE; it needs duckdb.",
)
@click.option("--shard", metavar="K/N", help="Part K of N, from 1, for array jobs.")
@click.option(
    "--log", type=click.Path(dir_okay=False), help="File to which each event is added, as JSON."
)
@click.option("--watch", is_flag=True, help="Wait for new captures in ARCHIVE until Ctrl-C.")
@click.option(
    "--settle",
    type=FiniteRange(min=0.1),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="Time without change after which files are complete, with --watch.",
)
@work_options
@measuring_options
def batch(archive: str | None, results: str | None, resume: bool, **options: Any) -> int:
    """Measure every capture in ARCHIVE, a folder or URL, each on its own, and catalogue them.

    Captures are folders, zips and tars with a scan of each wheel, clouds of a whole vehicle, and
    five-point files (.txt, .csv), at any depth. RESULTS, a folder or URL, gets one JSON for each,
    measured or failed, and catalogue.sqlite, which `wheelplane results RESULTS` reads.

    The same command again, also after a kill, measures only captures that are new, changed or not
    yet done. If RESULTS were created with another archive, settings or version, it asks first,
    since captures that these change are then measured anew; --resume answers yes.

    Exits with 1 when a capture in ARCHIVE failed, or was measured in part.
    """
    if archive is None and options["retry"] is not None:  # it follows --retry, which takes no value
        archive, options["retry"] = options["retry"], "failed"
    _require_values()
    if options["watched"] is not None:
        _show_status(options["watched"], options["metrics"])
        return 0
    if results is None:
        raise click.UsageError("Missing option '-o' / '--output': a folder or URL for the results")
    if options["why"] is not None:
        from ..batch.operation.why import account
        from ..batch.storage.entry import legible

        click.echo(account(results, legible(options["why"])))
        return 0
    if archive is None:
        raise click.UsageError("Missing argument 'ARCHIVE'.")
    with _ending_in_time():
        return _measure(archive, results, resume, options)


def _require_values() -> None:
    """Raise UsageError for an empty value, as of a variable that is not set."""
    context = click.get_current_context()
    for one in context.command.params:
        if context.params[str(one.name)] == "":
            hint = one.get_error_hint(context)
            raise click.UsageError(f"{hint} is empty: give a value, or leave it out")


def _show_status(results: str, metrics: str | None) -> None:
    """Print the state of the runs; serve it as metrics until Ctrl-C where --metrics is a port."""
    from ..batch.operation.metrics import metrics_at
    from ..batch.operation.run_state import states_text
    from ..batch.storage.store import open_store

    store = open_store(results)
    click.echo(states_text(store))
    if metrics is None:
        return
    with metrics_at(store, metrics) as where:
        click.echo(f"metrics: {where}")
        if where.startswith("http:"):
            with suppress(KeyboardInterrupt):
                threading.Event().wait()


@contextmanager
def _ending_in_time() -> Iterator[None]:
    """Interrupt at SIGTERM, and end HAND_BACK_S later at the latest.

    Whatever is waited for then, such as storage that does not answer, or a large catalogue:
    results are written as they are measured, and processes end with this one.
    """

    def end() -> None:
        fact = "interrupted before the catalogue was updated"
        click.echo(f"wheelplane: {fact}: run the same command to go on", err=True)
        os._exit(2)

    timer = threading.Timer(HAND_BACK_S, end)
    timer.daemon = True

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        with suppress(RuntimeError):  # not the first
            timer.start()
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        timer.cancel()


def _measure(archive: str, results: str, resume: bool, options: dict[str, Any]) -> int:
    """Measure an archive, and print what was done."""
    from ..batch.catalogue.catalogue import open_catalogue
    from ..batch.operation.metrics import metrics_at
    from ..batch.plan.shard import ALL, read_shard
    from ..batch.run.progress import RunReport, progress_listener
    from ..batch.run.run import Batch
    from ..batch.run.summary import summary
    from ..batch.run.watch import watch
    from ..batch.run.work import RunRequest
    from ..batch.storage.entry import legible
    from ..batch.storage.inventory import read_inventory
    from ..batch.storage.scratch import scratch_folder
    from ..batch.storage.store import open_store

    places = absolute(archive), absolute(results)
    request = RunRequest(*places, read_settings(options), retry=legible(options["retry"] or ""))
    shard = read_shard(options["shard"]) if options["shard"] else ALL
    _begin(request, resume, given_options(options), watch=options["watch"])
    interrupted = False
    with ExitStack() as stack:
        scratch = stack.enter_context(scratch_folder())
        engine = make_engine(options, scratch)
        stack.callback(engine.close)
        shown = stack.enter_context(progress_listener())
        log = stack.enter_context(_log(options["log"])) if options["log"] else None
        to = open_store(request.results)
        part = f"{shard.k}/{shard.n}"
        if options["metrics"]:
            stack.enter_context(metrics_at(to, options["metrics"]))
        report = stack.enter_context(RunReport(shown, to, engine, part, log))
        inventory = read_inventory(options["inventory"]) if options["inventory"] else None
        work = Batch(request, engine, scratch, report, shard, inventory)
        try:
            if options["watch"]:
                watch(work, Path(request.archive), options["settle"])
            else:
                work.run(options["limit"])
        except KeyboardInterrupt:
            report.interrupted = True
            interrupted = not options["watch"]
    with ExitStack() as stack:
        whole = None
        if work.holds_results:
            whole = stack.enter_context(open_catalogue(request.results))
        text, fine = summary(work.counts, whole, results, shard)
    click.echo(text)
    if interrupted:
        raise InputError("interrupted: run the same command to go on")
    return 0 if fine else 1


def _log(path: str) -> TextIO:
    try:
        return Path(path).open("a", encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(f"--log {path}: cannot be written ({error.strerror})") from error


def _begin(request: RunRequest, resume: bool, given: dict[str, str], watch: bool) -> None:
    """Check that an equal request created the results folder, or create it."""
    from ..batch.run.run_manifest import differences, write_options, write_run_manifest
    from ..batch.storage.store import open_store

    archive, results = open_store(request.archive), open_store(request.results)
    if archive.local is not None and not archive.local.is_dir():
        raise InputError(f"{request.archive}: no such folder: check the path")
    if archive.local is None and watch:
        raise InputError(f"{request.archive}: --watch needs a folder of this machine")
    if archive.url == results.url:
        raise InputError(
            f"{request.results}: is the archive itself: name another folder for the results"
        )
    others = differences(results, request)
    if others and not resume:
        shown = "; ".join(others[:MOST_SHOWN]) + "; ..." * (len(others) > MOST_SHOWN)
        fact = f"{request.results}: was created with other settings: {shown}"
        if not sys.stdin.isatty():
            raise InputError(
                f"{fact}: add --resume to measure anew what this changes, or name another folder"
            )
        click.confirm(f"{fact}\nMeasure anew what this changes?", abort=True)
    write_run_manifest(results, request)
    write_options(results, given)
