"""A task: a few captures to be identified, measured and written down; what a child does."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from ... import __version__
from ...errors import WheelplaneError
from ..catalogue.gather import name_of
from ..catalogue.rows import FAILED, Record, read_record
from ..plan.discover import Found
from ..plan.identity import Identity, at_hand, identify, unchanged, unreadable
from ..plan.settings import Settings
from ..storage.entry import Entry, legible
from ..storage.store import Store, open_store
from .measure_one import (
    PassingError,
    Result,
    Subject,
    Verdict,
    failed,
    measure_bytes,
)

WRITERS = 16  # syncs to disk, or requests to storage, at the same time
THERE = Verdict("there")


@dataclass(frozen=True)
class Request:
    """What all tasks of a run share.

    archive, results: URLs, or absolute paths. retry: what failed before is measured again.
    """

    archive: str
    results: str
    settings: Settings
    version: str = __version__
    retry: bool = False


@dataclass(frozen=True)
class Task:
    """A capture, or several small ones.

    attempts: how earlier attempts ended. verdict: by which it is not to be measured any more, but
    written down as failed; blind: without a look at its files.
    """

    request: Request
    captures: tuple[Found, ...]
    attempts: tuple[str, ...] = ()
    verdict: Verdict | None = None
    blind: bool = False


class ArchiveError(PassingError):
    """The files of a capture cannot be had from the archive."""


@dataclass(frozen=True)
class Done:
    """What became of one capture; the status "there" is of one that was done before.

    fingerprint: of its files as they were listed, where it is enough to know the capture again.
    record: of a new result in object storage, from which it is costly to read.
    """

    name: str
    key: str
    verdict: Verdict
    fingerprint: str | None
    elsewhere: tuple[Entry, ...]
    record: Record | None = None


def work(task: Task) -> list[Done]:
    """Do the task, whose results are all written when this returns.

    Raises PassingError and MemoryError, which leave undone what was not written before.
    """
    if task.request.version != __version__:
        raise PassingError(f"wheelplane {__version__} is given the work of {task.request.version}")
    try:
        results = _store(task.request.results)
        worked = [_one(found, task, results) for found in task.captures]
        for _, writing in worked:  # which goes on while the next are measured
            if writing is not None:
                writing.result()
    except WheelplaneError as error:
        raise PassingError(str(error)) from error
    return [done for done, _ in worked]


def _one(found: Found, task: Task, results: Store) -> tuple[Done, Future[None] | None]:
    """What became of a capture, and the writing of it where that is new."""
    with ExitStack() as stack:
        archive, known, source = _known(found, task, stack)
        there = results.exists(name_of(known.key))
        if there and not (task.request.retry and _failed_before(results, known.key)):
            return _done(found, known, THERE), None
        result = _result(found, known, source, task)
        if not task.blind and not unchanged(archive, known):
            raise PassingError(f"{found.name}: it was changed while it was measured")
    writing = _writers().submit(_write, results, known.key, result, there)
    done = _done(found, known, result.verdict)
    if results.local is None:
        done = replace(done, record=read_record(known.key, result.data))
    return done, writing


def _known(found: Found, task: Task, stack: ExitStack) -> tuple[Store, Identity, Path]:
    """The capture's archive, its identity, and where it is at hand. Raises ArchiveError."""
    try:
        archive = _store(task.request.archive)
        if task.blind:
            return archive, unreadable(found, task.request.settings), Path(found.name)
        source = stack.enter_context(at_hand(archive, found))
        return archive, identify(archive, found, source, task.request.settings), source
    except WheelplaneError as error:
        raise ArchiveError(str(error)) from error


def _result(found: Found, known: Identity, source: Path, task: Task) -> Result:
    settings = task.request.settings
    name = legible(found.name)
    subject = Subject(source, name, found.kind, settings, known.key, known.inputs)
    if task.verdict is not None:
        return failed(subject, task.verdict, "\n".join(task.attempts) + "\n")
    return measure_bytes(subject)


def _done(found: Found, known: Identity, verdict: Verdict) -> Done:
    fingerprint = found.fingerprint if known.lasting else None
    return Done(found.name, known.key, verdict, fingerprint, known.elsewhere)


def _failed_before(results: Store, key: str) -> bool:
    return read_record(key, results.read(name_of(key))).capture.status in FAILED


def _write(results: Store, key: str, result: Result, anew: bool) -> None:
    """The log of a failure, then the result, which tells that it was done.

    anew: in place of the result of a failure, whose log goes with it.
    """
    log = f"logs/{key}.log"
    if result.log:
        results.write(log, result.log.encode(errors="replace"))
    if not anew:
        results.write_new(name_of(key), result.data)
        return
    results.write(name_of(key), result.data)
    if not result.log:
        results.remove(log)


@lru_cache(maxsize=1)
def _writers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(WRITERS)


@lru_cache(maxsize=4)
def _store(url: str) -> Store:
    return open_store(url)
