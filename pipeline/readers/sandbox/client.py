"""Decoding of untrusted files by native libraries, in a child with bounds on memory and time.

The child decodes into shared memory, slot after slot; a pipe carries only short messages of fixed
size, which are checked as the file is. Whatever ends the child becomes one InputError.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Generator, Iterator
from itertools import count
from pathlib import Path

from ...errors import MissingDependencyError
from ...system import frozen
from ..faults import too_long, too_short
from ..source import Source
from .process import SLOTS, Job, started
from .worker import BLOCK, DONE, READY

START_S = 60.0  # the interpreter and the library come from a disk that may be slow
IDLE_S, IDLE_BYTES_PER_S = 7.0, 20e6


@frozen
class Filled:
    """Decoded rows of one part; the memory is overwritten after the next one."""

    part: int
    rows: int
    memory: memoryview


def find_library(package: str, what: str, extra: str, source: Source) -> str:
    """Return the folder that holds the package, without importing it.

    Raises MissingDependencyError, with what to install, when it is not installed.
    """
    try:
        spec = importlib.util.find_spec(package)
    except ImportError:
        spec = None
    if spec is None or spec.origin is None:
        raise MissingDependencyError(
            f"{source.name}: reading {what} needs the library {package}: "
            f"pip install 'wheelplane[{extra}]', or wheelplane[all]"
        )
    return str(Path(spec.origin).parents[1])


def run_child(job: Job, source: Source) -> Iterator[Filled]:
    """Decode the file in a child, block by block.

    Raises InputError when the child crashes, hangs, asks for too much memory, finds the file
    damaged, or delivers other than `job.rows`. The child ends with the iterator or the source.
    """
    filled = _draw(job, source)
    source.stack.callback(filled.close)
    return filled


def _draw(job: Job, source: Source) -> Generator[Filled]:
    with started(job, source) as child:
        child.receive(READY, START_S)
        due = list(job.rows)
        part = 0
        for serial in count():
            kind, at, rows = child.receive(BLOCK + DONE, IDLE_S + source.size / IDLE_BYTES_PER_S)
            if kind == DONE:
                break
            if not (part <= at < len(due) and 0 < rows <= job.slot_rows):
                raise child.protocol_error()
            part = at
            due[part] -= rows
            if due[part] < 0:
                raise too_long(source, job.rows[part], "more points")
            start = serial % SLOTS * job.slot_bytes
            yield Filled(part, rows, child.memory[start : start + job.slot_bytes])
            child.release()
        if any(due):
            raise too_short(source, sum(job.rows), sum(job.rows) - sum(due))
