"""The child process: its start, its messages, and the error that its end stands for.

`worker.py` is the other side.
"""

from __future__ import annotations

import json
import mmap
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from ...errors import InputError, MissingDependencyError
from ...system import MemoryFile, apart, frozen, inherits_descriptors, memory_file, read_within
from ..faults import fault
from ..source import Source, shown
from .environment import child_environment
from .worker import ERROR, MEMORY, MESSAGE

SCRIPT = Path(__file__).with_name("worker.py")
SLOTS = 3  # one is filled, one is read, one is ready
ENDING_S = 2.0
LONGEST_TEXT = 400
DAMAGED = "the file is damaged; copy or export it again"


@frozen
class Job:
    """Task of a child, and its limits.

    task: a key of `worker.TASKS`. plan: its arguments, ready for JSON.
    library: the folder that its library is imported from.
    rows: points of each part; the child must deliver exactly these, part after part.
    slot_rows, slot_bytes: what it decodes at a time. memory_bytes: beyond those at its start.
    """

    task: str
    library: str
    plan: Mapping[str, Any]
    rows: tuple[int, ...]
    slot_rows: int
    slot_bytes: int
    memory_bytes: int
    script: Path = SCRIPT


@frozen
class Child:
    """A running child, the pipe of its messages, and the slots it fills."""

    process: subprocess.Popen[bytes]
    inbox: int
    memory: memoryview
    source: Source

    def receive(self, expected: bytes, timeout_s: float) -> tuple[bytes, int, int]:
        """Return the next message of an expected kind; otherwise raise the error it stands for."""
        deadline = time.monotonic() + timeout_s
        kind, part, rows = MESSAGE.unpack(self._read(MESSAGE.size, deadline))
        if kind == MEMORY:
            fact = "decoding it takes more memory than its points can need"
            raise fault(self.source, fact, DAMAGED)
        if kind == ERROR and rows <= LONGEST_TEXT:
            raise self._error(self._read(rows, deadline).decode(errors="replace"))
        if kind not in expected:
            raise self.protocol_error()
        return kind, part, rows

    def release(self) -> None:
        """Free the oldest slot of the child, if it still runs."""
        try:
            os.write(self.process.stdin.fileno(), b".")  # type: ignore[union-attr]
        except OSError:  # EPIPE, or on Windows EINVAL
            return

    def protocol_error(self) -> InputError:
        """Return the error for a child that breaks the protocol: its memory was overwritten."""
        return fault(self.source, "it corrupts the memory of the library that reads it", DAMAGED)

    def _error(self, text: str) -> InputError | MissingDependencyError:
        first = text.partition("\n")[0]
        if first.startswith(("ImportError", "ModuleNotFoundError")):
            return MissingDependencyError(
                f"{self.source.name}: the library that reads it does not load ({shown(first)}): "
                "install wheelplane[all] again"
            )
        message = first.partition(": ")[2] or first
        return fault(self.source, f"it cannot be decoded ({shown(message)})", DAMAGED)

    def _read(self, size: int, deadline: float) -> bytes:
        data = b""
        while len(data) < size:
            try:
                more = read_within(self.inbox, size - len(data), deadline - time.monotonic())
            except TimeoutError:
                raise fault(self.source, "decoding it makes no progress", DAMAGED) from None
            if not more:
                raise self._ended()
            data += more
        return data

    def _ended(self) -> InputError:
        try:
            code = self.process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            return self.protocol_error()
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return fault(self.source, f"it crashes the library that reads it ({how})", DAMAGED)


@contextmanager
def started(job: Job, source: Source) -> Iterator[Child]:
    """Run a child on the job; kill it and wait for it at the end."""
    plan = json.dumps(
        {
            "task": job.task,
            "plan": {**job.plan, "path": str(source.path), "slot_rows": job.slot_rows},
            "slots": SLOTS,
            "slot_bytes": job.slot_bytes,
            "memory_bytes": job.memory_bytes,
            "library": job.library,
        }
    ).encode()
    with ExitStack() as stack:
        memory = stack.enter_context(memory_file())
        os.ftruncate(memory.descriptor, max(SLOTS * job.slot_bytes, len(plan)))
        area = mmap.mmap(memory.descriptor, 0)  # unmapped with the last view of it
        area[: len(plan)] = plan
        process, inbox = _start(job, memory, len(plan), stack)
        yield Child(process, inbox, memoryview(area), source)


def _start(
    job: Job, memory: MemoryFile, plan_bytes: int, stack: ExitStack
) -> tuple[subprocess.Popen[bytes], int]:
    """Start the child, until `stack` closes; return it and the pipe of its messages."""
    arguments = [sys.executable, "-P", "-S", str(job.script), str(os.getpid())]
    options: dict[str, Any] = {
        "stdin": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
        "bufsize": 0,
        "env": child_environment(),
        **apart(),  # the parent handles Ctrl-C
    }
    if inherits_descriptors():
        inbox, outbox = os.pipe()
        stack.callback(os.close, inbox)
        arguments += [str(memory.descriptor), str(outbox), str(plan_bytes)]
        options |= {"pass_fds": (memory.descriptor, outbox), "stdout": subprocess.DEVNULL}
        try:
            process = subprocess.Popen(arguments, **options)  # noqa: S603 - a script of ours
        finally:
            os.close(outbox)
    else:
        arguments += [memory.path, "1", str(plan_bytes)]
        process = subprocess.Popen(arguments, stdout=subprocess.PIPE, **options)  # noqa: S603
        inbox = process.stdout.fileno()  # type: ignore[union-attr]
    stack.enter_context(process)
    stack.callback(process.kill)
    return process, inbox
