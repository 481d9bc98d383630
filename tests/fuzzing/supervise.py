"""Run the child, tell a crash from a refusal, end a hang, and go on with the next file."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from tests.fuzzing.mutations import mutant
from tests.fuzzing.samples import samples
from tests.fuzzing.worker import SECONDS
from tests.support.paths import FORMATS, ROOT

START_SECONDS = 120.0
WORKER = ["-m", "tests.fuzzing.worker"]


@dataclass(frozen=True)
class Outcome:
    """What became of one mutant: 'read', 'refused', or in what way it failed."""

    index: int
    format: str
    sample: str
    how: str
    verdict: str
    seconds: float
    peak_mb: float

    @property
    def failed(self) -> bool:
        return self.verdict not in ("read", "refused")


def fuzz(first: int, stop: int, seed: int, folder: Path = FORMATS) -> Iterator[Outcome]:
    """Outcomes of mutants first:stop, in order; the samples are those of `folder` and our own."""
    pool = samples(folder)
    while first < stop:
        for index, outcome in _one_worker(first, stop, seed, folder):
            damaged = mutant(pool, index, seed)
            sample = damaged.sample
            yield Outcome(index, sample.format, sample.name, damaged.how, **outcome)
            first = index + 1


def _one_worker(
    first: int, stop: int, seed: int, folder: Path
) -> Iterator[tuple[int, dict[str, object]]]:
    """What a worker says of its mutants until it has done all, crashes, or is ended for a hang."""
    shown, tells = os.pipe()
    arguments = [str(word) for word in (first, stop, seed, folder, tells)]
    with tempfile.TemporaryFile() as output, os.fdopen(shown, "rb", buffering=0) as pipe:
        worker = subprocess.Popen(
            [sys.executable, *WORKER, *arguments],
            **{"cwd": ROOT, "stdout": output, "stderr": output, "pass_fds": [tells]},
            start_new_session=True,
        )
        os.close(tells)
        started = None
        try:
            for line in _lines(pipe):
                word, number, *outcome = line.split(" ", 2)
                started = int(number) if word == "begin" else None
                if started is None:
                    yield int(number), json.loads(outcome[0])
            failure = f"crash: the process ended with {worker.wait()}"
        except TimeoutError:
            failure = f"hang: nothing after {SECONDS:.0f} s"
        finally:
            _end(worker)
        output.seek(0)
        words = output.read()[-300:]
    if started is not None:
        verdict = f"{failure}; its last words: {words!r}"
        yield started, {"verdict": verdict, "seconds": SECONDS, "peak_mb": 0.0}
    elif worker.returncode != 0:
        raise RuntimeError(f"the worker did not work: {words.decode(errors='replace')}")


def _lines(pipe: FileIO) -> Iterator[str]:
    """Lines from the worker until it closes the pipe; TimeoutError when it is silent too long."""
    buffer, limit = b"", START_SECONDS
    while True:
        if not select.select([pipe], [], [], limit)[0]:
            raise TimeoutError
        piece = pipe.read(1 << 16)
        if not piece:
            return
        *lines, buffer = (buffer + piece).split(b"\n")
        yield from (line.decode() for line in lines)
        limit = 1.5 * SECONDS


def _end(worker: subprocess.Popen[bytes]) -> None:
    """The worker and the children it may have left, by its session's group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(worker.pid, signal.SIGKILL)
    worker.wait()
