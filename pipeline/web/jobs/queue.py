"""Queue of jobs in processes of their own, limited in time and memory."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ...errors import WheelplaneError
from ..security import RefusedError
from ..settings import PageSettings
from .kept import keep, kept_jobs
from .process import (
    FINISHED,
    LONGEST_LINE,
    MEASURED,
    SHOWN,
    PageJob,
    discard_upload,
    end,
    fail,
    kill,
    receive,
    send,
    start_process,
)
from .turns import Turns

OF_ANOTHER = ("report", "table")  # tasks that write into the folder of a measurement
LONG = ("measure", "explain")  # tasks that read scans
POINTS = "points.bin"  # file of a result that may be large
NOT_KEPT = "this result is no longer kept: measure again"
KEPT_UPLOADS = 2  # of failed measurements, for another try


class Jobs:
    """Jobs of a server; closing ends them all."""

    def __init__(self, settings: PageSettings) -> None:
        self._settings = settings
        kept = [] if settings.results is None else kept_jobs(settings.results)
        self._jobs: dict[str, PageJob] = {job.id: job for job in kept}
        self._lock = threading.Lock()
        self._turns = Turns(settings.workers)
        self._pool = ThreadPoolExecutor(self._turns.most, thread_name_prefix="job")
        self._quick = ThreadPoolExecutor(2, thread_name_prefix="report")

    def start(
        self, task: str, name: str, given: dict[str, Any], uses: tuple[PageJob, ...] = ()
    ) -> PageJob:
        """Queue a task.

        given: plan for the process; the folder given["owned"], an upload, is removed when the job
        has its result; after a failure it is kept for another try, and the latest few of such.
        uses: jobs whose results it reads; of OF_ANOTHER its measurement. Raises RefusedError while
        too many jobs wait, if a used one is no longer kept, or where no folder can be made.
        """
        is_long = task in LONG
        with self._lock:
            for used in uses:
                self.found(used.id)
            alike = [job for job in self._jobs.values() if (job.task in LONG) == is_long]
            waiting = sum(job.state == "waiting" for job in alike)
            if waiting >= self._settings.waiting:
                raise RefusedError(503, f"{waiting} jobs are waiting: wait for one to end")
            new = f"{time.strftime('%Y%m%d_%H%M%S')}_{secrets.token_hex(6)}"
            kept = task == "measure" and self._settings.results is not None
            own = self._settings.results if kept else None
            folder = self._settings.scratch / f"job-{new}" if own is None else own / new
            folder = uses[0].folder if task in OF_ANOTHER else folder
            job = PageJob(new, task, name, folder, uses, given, at=given.get("at", ""), kept=kept)
            if task not in OF_ANOTHER:
                _make_folder(folder)
            elif not folder.is_dir():  # removed by hand
                raise RefusedError(404, NOT_KEPT)
            self._jobs[new] = job
        (self._pool if is_long else self._quick).submit(self._run, job, given)
        self._forget_old()
        return job

    def measured(self) -> list[PageJob]:
        """Return the measurements whose results are available, the latest first."""
        with self._lock:
            known = list(self._jobs.values())
        return [job for job in known[::-1] if job.task in MEASURED and job.state in SHOWN]

    def running(self) -> PageJob | None:
        """Return the latest measurement that is at work or waits."""
        with self._lock:
            known = list(self._jobs.values())
        at_work = (job for job in known[::-1] if job.task == "measure")
        return next((job for job in at_work if job.state in ("waiting", "running")), None)

    def found(self, name: str) -> PageJob:
        """Return the job of that id. Raises RefusedError."""
        job = self._jobs.get(name)
        if job is None:
            raise RefusedError(404, NOT_KEPT)
        return job

    def shown(self, name: str) -> PageJob:
        """Return the job of that id if its results are available. Raises RefusedError."""
        job = self.found(name)
        if job.state not in SHOWN:
            raise RefusedError(409, f"{job.name}: no result yet")
        return job

    def again(self, job: PageJob, options: dict[str, Any]) -> PageJob:
        """Queue the measurement of a job again, with other options, from what it was given.

        Raises RefusedError where that is no longer kept.
        """
        plan = self._kept(job)
        new = self.start("measure", job.name, plan | {"options": options}, (job,))
        if job.plan.pop("owned", None) is not None:
            job.plan["discarded"] = True  # the new job owns the upload now
        return new

    def explain(self, job: PageJob, language: str) -> PageJob:
        """Queue the explanation of a measurement. Raises RefusedError, as `again`."""
        plan = {key: value for key, value in self._kept(job).items() if key != "owned"}
        return self.start("explain", job.name, plan | {"language": language}, (job,))

    def _kept(self, job: PageJob) -> dict[str, Any]:
        """Return the plan of a measurement whose files are kept. Raises RefusedError."""
        if job.task != "measure" or job.plan.get("discarded"):
            raise RefusedError(409, f"{job.name}: its files are no longer kept: open it again")
        return dict(job.plan)

    def cancel(self, job: PageJob) -> None:
        """End a job, running or waiting."""
        end(job, "cancelled")
        kill(job)

    def remove(self, job: PageJob) -> None:
        """Remove a kept result with its files. Raises RefusedError while it is at work or read."""
        with self._lock:
            read = {used.id for one in self._jobs.values() if not one.finished.is_set()
                    for used in one.uses}  # fmt: skip
            if not (job.kept and job.state in SHOWN):
                raise RefusedError(409, f"{job.name}: it is not in the folder of results")
            if not job.finished.is_set() or job.id in read:
                raise RefusedError(409, f"{job.name}: still at work: wait for its end, or cancel")
            try:
                shutil.rmtree(job.folder)
            except FileNotFoundError:
                pass  # removed by hand
            except OSError as error:
                reason = error.strerror or str(error)
                raise RefusedError(409, f"{job.name}: cannot be removed ({reason})") from error
            self._jobs.pop(job.id, None)

    def close(self) -> None:
        """End all jobs and start no more."""
        pools = (self._pool, self._quick)
        for pool in pools:
            pool.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            known = list(self._jobs.values())
        for job in known:
            self.cancel(job)
        for pool in pools:
            pool.shutdown(wait=True)
        for job in known:
            job.finished.set()  # also of jobs that never started
            _discard_unless_shown(job)

    def _forget_old(self) -> None:
        """Drop finished reports and the oldest results, except those that a job reads."""
        with self._lock:
            ended = [job for job in self._jobs.values() if job.finished.is_set()]
            for job in ended:
                if job.task in OF_ANOTHER:
                    del self._jobs[job.id]
            known = [job for job in self._jobs.values() if job.task not in OF_ANOTHER]
            known = [job for job in known if not (job.kept and job.state in SHOWN)]
            read = {used.id for job in self._jobs.values() if job not in ended for used in job.uses}
            free = [job for job in known if job in ended and job.id not in read]
            for job in free[: max(0, len(known) - self._settings.jobs)]:
                del self._jobs[job.id]
                shutil.rmtree(job.folder, ignore_errors=True)
                discard_upload(job)
            failed = [job for job in ended if "owned" in job.plan and job.id not in read]
            for job in failed[:-KEPT_UPLOADS]:
                discard_upload(job)

    def _run(self, job: PageJob, given: dict[str, Any]) -> None:
        try:
            turn = self._turns.taken() if job.task in LONG else nullcontext(_stay)
            with turn as leave:
                if job.state == "waiting":
                    self._work(job, given, leave)
        except OSError as error:
            fail(job, f"the measuring process cannot be started ({error.strerror})")
        finally:
            shutil.rmtree(job.scratch, ignore_errors=True)
            if job.state not in ("failed", "cancelled"):
                discard_upload(job)
                self._keep(job)
            _discard_unless_shown(job)
            job.finished.set()
            self._drop_old_points()

    def _keep(self, job: PageJob) -> None:
        """Make a result last, as soon as there is one; the note says where it does not."""
        if job.kept and job.state in SHOWN:
            try:
                keep(job)
            except WheelplaneError as error:
                job.note = str(error)

    def _drop_old_points(self) -> None:
        """Remove the points of the oldest results, so that those of all have room."""
        with self._lock:
            trees = [
                (job, job.folder / POINTS) for job in self._jobs.values() if job.task in MEASURED
            ]
            kept = [(job, path, path.stat().st_size) for job, path in trees if path.is_file()]
            size = sum(part for *_, part in kept)
            for job, path, part in kept[:-1]:
                if size <= self._settings.tree_bytes:
                    break
                path.unlink()
                job.note, size = "its points gave way to those of later results", size - part
                self._keep(job)

    def _work(self, job: PageJob, given: dict[str, Any], leave: Callable[[], None]) -> None:
        settings = self._settings
        config = None if settings.config is None else str(settings.config)
        limits = {
            "memory_bytes": settings.memory_bytes,
            "tree_bytes": settings.tree_bytes,
            "parent": os.getpid(),
            "config": config,
        }
        plan = {"task": job.task, "out": str(job.folder), **limits, **given}
        with start_process(job) as process:
            self._begin(job, process)
            alarm = threading.Timer(self._settings.seconds, self._stop_late, [job])
            alarm.daemon = True
            alarm.start()
            try:
                assert process.stdin is not None
                assert process.stdout is not None
                send(process.stdin, json.dumps(plan))
                while line := process.stdout.readline(LONGEST_LINE):
                    receive(job, line)
                    if job.state == "ready":
                        self._keep(job)
                        leave()  # the next one need not wait for the points
            finally:
                alarm.cancel()
                kill(job)
        if job.state not in FINISHED:
            code = process.returncode
            how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            fail(job, f"the measuring process ended early ({how}): measure fewer points")

    def _begin(self, job: PageJob, process: subprocess.Popen[str]) -> None:
        with job.lock:
            job.process = process
            if job.state == "waiting":
                job.state = "running"
                return
        kill(job)  # cancelled meanwhile

    def _stop_late(self, job: PageJob) -> None:
        fail(
            job,
            f"measuring took longer than {self._settings.seconds:g} s and was stopped: measure "
            "fewer points, or start the page with a larger --time-limit",
        )
        kill(job)


def _make_folder(folder: Path) -> None:
    """Create the folder of a job. Raises RefusedError where that of all results was removed."""
    try:
        folder.mkdir()
    except OSError as error:
        fact = f"no result can be stored ({error.strerror}): create the folder again"
        raise RefusedError(507, f"{folder.parent}: {fact}") from error


def _stay() -> None:
    """Leave no turn, where none is held."""


def _discard_unless_shown(job: PageJob) -> None:
    """Leave nothing in the folder of results of a measurement that has none."""
    if job.kept and job.state not in SHOWN:
        shutil.rmtree(job.folder, ignore_errors=True)
