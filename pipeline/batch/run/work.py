"""Task of a worker process: captures to be identified, measured and written."""

from __future__ import annotations

import os
import pickle
import tempfile
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from ... import __version__
from ...errors import WheelplaneError
from ...system import frozen, peak_bytes, taken
from ..catalogue.history import is_retried
from ..catalogue.load_records import json_name
from ..catalogue.rows import read_record
from ..plan.discover import FoundCapture
from ..plan.identity import (
    Identity,
    identify,
    is_incomplete,
    listed,
    local_copy,
    unchanged,
    unreadable,
)
from ..plan.settings import BatchSettings
from ..storage.entry import Entry, legible
from ..storage.store import Store, open_store
from .measure_one import (
    Outcome,
    Result,
    Subject,
    TransientError,
    failed,
    measure_bytes,
)

WRITERS = 16  # simultaneous syncs to disk, or requests to storage
LATEST_S = 1.0  # after which a result is written while others of its task are measured
RECOGNISED = Outcome("recognised")
VANISHED = Outcome("vanished")


@frozen
class RunRequest:
    """Request of a run, common to all its tasks.

    archive, results: URLs, or absolute paths. retry: which results are replaced, see `is_retried`.
    """

    archive: str
    results: str
    settings: BatchSettings
    version: str = __version__
    retry: str = ""


@frozen
class Task:
    """One capture, or several small ones.

    attempts: how earlier attempts ended. outcome: if given, write this failure without measuring;
    blind: without reading the files.
    """

    request: RunRequest
    captures: tuple[FoundCapture, ...]
    attempts: tuple[str, ...] = ()
    outcome: Outcome | None = None
    blind: bool = False


class ArchiveError(TransientError):
    """Files of a capture that cannot be read from the archive."""


@frozen
class CompletedCapture:
    """Capture with its outcome.

    Status "recognised": its result existed before. "vanished": a file of it is no longer in the
    archive, and it has no result.

    fingerprint: of its files as listed, None if it does not identify the capture reliably.
    record: of a new result, pickled, and stamp of its file in a folder: so that the catalogue need
    not read it back. seconds: by stage, see `times.HEADS`. memory_bytes: the most that its worker
    process has held. expected_s: that of `FoundCapture`.
    """

    name: str
    key: str
    outcome: Outcome
    fingerprint: str | None
    elsewhere: tuple[Entry, ...]
    record: bytes = b""
    stamp: str = ""
    seconds: tuple[tuple[str, float], ...] = ()
    memory_bytes: int = 0
    expected_s: float = 0.0


def work(task: Task) -> list[CompletedCapture]:
    """Run the task; all its results are written when this returns.

    Raises TransientError and MemoryError; captures without a result are then still to be done.
    """
    if task.request.version != __version__:
        raise TransientError(
            f"worker of wheelplane {__version__} got a task of {task.request.version}"
        )
    try:
        results = _store(task.request.results)
        measured = threading.Event()
        try:
            worked = [_one(found, task, results, measured) for found in task.captures]
        finally:
            measured.set()
        return [done if to is None else replace(done, stamp=to.result()) for done, to in worked]
    except WheelplaneError as error:
        raise TransientError(str(error)) from error


def _one(
    found: FoundCapture, task: Task, results: Store, measured: threading.Event
) -> tuple[CompletedCapture, Future[str] | None]:
    """Measure a capture; return it with its outcome, and the pending write of a new result."""
    watch = _Stopwatch()
    with ExitStack() as stack:
        archive, known, folder = _known(found, task, stack, watch)
        if known.vanished:
            return _done(found, known, VANISHED), None
        exists = results.exists(json_name(known.key))
        if exists and not _is_retried(results, known.key, task.request.retry):
            return _done(found, known, RECOGNISED), None
        taken()  # of a measurement that ended in an error of the machine
        result = _result(found, known, folder, task)
        watch.lap_by_stage(taken())
        if not task.blind and not unchanged(archive, known):
            raise TransientError(f"{found.name}: changed while it was measured")
        if not Path(tempfile.gettempdir()).is_dir():
            raise TransientError(f"{found.name}: the folder of temporary files was removed")
    writing = _writers().submit(_write, measured, results, known.key, result, exists)
    done = _done(found, known, result.outcome)
    done = replace(done, seconds=tuple(watch.laps), memory_bytes=peak_bytes())
    record = read_record(known.key, result.data, result.tree)
    return replace(done, record=pickle.dumps(record)), writing


class _Stopwatch:
    """Seconds of the stages of one capture, by name."""

    def __init__(self) -> None:
        self.laps: list[tuple[str, float]] = []
        self._last_s = time.monotonic()

    def lap(self, stage: str) -> None:
        """End a stage."""
        now_s = time.monotonic()
        self.laps.append((stage, now_s - self._last_s))
        self._last_s = now_s

    def lap_by_stage(self, stages: dict[str, float]) -> None:
        """End a measurement, divided by the seconds of its stages; scaled if of several threads."""
        self.lap("other")
        _, whole_s = self.laps.pop()
        share = min(1.0, whole_s / max(sum(stages.values()), 1e-9))
        self.laps += [(name, share * seconds) for name, seconds in stages.items()]
        self.laps.append(("other", max(0.0, whole_s - sum(stages.values()))))


def _known(
    found: FoundCapture, task: Task, stack: ExitStack, watch: _Stopwatch
) -> tuple[Store, Identity, Path]:
    """Return the capture's archive, its identity, and the local folder. Raises ArchiveError."""
    settings = task.request.settings
    try:
        archive = _store(task.request.archive, confined=True)
        if task.blind:
            return archive, unreadable(found, settings), Path()
        try:
            folder = stack.enter_context(local_copy(archive, found))
        except WheelplaneError:
            now = listed(archive, [file.name for file in found.files])
            if not is_incomplete(now):
                raise
            return archive, unreadable(replace(found, files=now), settings), Path()
        watch.lap("copy")
        known = identify(archive, found, folder, settings)
        watch.lap("identify")
        return archive, known, folder
    except WheelplaneError as error:
        raise ArchiveError(str(error)) from error


def _result(found: FoundCapture, known: Identity, folder: Path, task: Task) -> Result:
    settings = task.request.settings
    name = legible(found.name)
    source = Path(os.devnull) if task.blind else folder / found.name
    subject = Subject(source, name, found.kind, settings, known.key, known.inputs, folder)
    if task.outcome is not None:
        return failed(subject, task.outcome, "\n".join(task.attempts) + "\n")
    return measure_bytes(subject)


def _done(found: FoundCapture, known: Identity, outcome: Outcome) -> CompletedCapture:
    fingerprint = found.fingerprint if known.lasting else None
    done = CompletedCapture(found.name, known.key, outcome, fingerprint, known.elsewhere)
    return replace(done, expected_s=found.expected_s)


def _is_retried(results: Store, key: str, retry: str) -> bool:
    if not retry:
        return False
    return is_retried(read_record(key, results.read(json_name(key))).capture, retry)


def _write(
    measured: threading.Event, results: Store, key: str, result: Result, replace_failure: bool
) -> str:
    """Write the log of a failure, then the result, whose presence means done.

    Return the stamp of its file, unless another process was faster, or it is in object storage.
    replace_failure: replace the result of a failure and remove its log. measured: whether all of
    the task is, which files wait for, at most LATEST_S: beside a measurement, which holds the
    interpreter's lock, each call that writes one waits. Objects do not, as requests take longer.
    """
    if results.local is not None:
        measured.wait(LATEST_S)
    log = f"logs/{key}.log"
    if result.log:
        results.write(log, result.log.encode(errors="replace"))
    if not replace_failure:
        is_ours = results.write_new(json_name(key), result.data)
    else:
        results.write(json_name(key), result.data)
        is_ours = True
        if not result.log:
            results.remove(log)
    written = results.stat(json_name(key)) if is_ours and results.local is not None else None
    return "" if written is None else written.stamp


@lru_cache(maxsize=1)
def _writers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(WRITERS)


@lru_cache(maxsize=4)
def _store(url: str, confined: bool = False) -> Store:
    return open_store(url, confined)
