"""The script of the child process: it decodes one file into shared memory.

It is run by its path and imports one native library and little of the standard library (no
pathlib), nothing of the project and no numpy, so that it is ready in about 0.03 s.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import json
import mmap
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

resource: Any
try:
    import resource
except ImportError:  # Windows
    resource = None

MESSAGE = struct.Struct("<cIQ")
READY, BLOCK, DONE, MEMORY, ERROR = b"R", b"B", b"D", b"M", b"E"
PR_SET_PDEATHSIG = 1


class Slots:
    """Shared memory, filled slot after slot; a byte from the parent frees the oldest."""

    def __init__(self, area: mmap.mmap, count: int, size: int, outbox: int) -> None:
        view = memoryview(area)
        self._slots = [view[i * size : (i + 1) * size] for i in range(count)]
        self._outbox = outbox
        self._filled = 0

    def next(self) -> memoryview:
        """Return the slot to fill, once it is free."""
        if self._filled >= len(self._slots) and not os.read(0, 1):
            os._exit(0)  # the parent is gone
        return self._slots[self._filled % len(self._slots)]

    def filled(self, part: int, rows: int) -> None:
        """Hand the slot to the parent."""
        self._filled += 1
        self.send(BLOCK, part, rows)

    def send(self, kind: bytes, part: int = 0, rows: int = 0, text: bytes = b"") -> None:
        """Send one message; it is shorter than a pipe writes at once."""
        os.write(self._outbox, MESSAGE.pack(kind, part, rows) + text)


def load_e57() -> ModuleType:
    """Import pye57's binding without the package's modules, which import numpy (0.1 s)."""
    spec = importlib.util.find_spec("pye57")
    if spec is None:
        raise ImportError("no pye57")
    sys.modules["pye57"] = importlib.util.module_from_spec(spec)
    return importlib.import_module("pye57.libe57")


def fill_e57(libe57: ModuleType, plan: SimpleNamespace, slots: Slots) -> None:
    """Decode each scan's fields as columns of 8 bytes a value, column after column in the slot."""
    image = libe57.ImageFile(os.fsencode(plan.path), "r")
    scans, rows = image.root()["data3D"], plan.slot_rows
    for part, fields in enumerate(plan.scans):
        if not fields:
            continue
        # A reader keeps the buffers that it was created with, so they cannot be the slots.
        columns = memoryview(bytearray(len(fields) * rows * 8))
        buffers = libe57.VectorSourceDestBuffer()
        for i, (field, form) in enumerate(fields):
            column = columns[i * rows * 8 : (i + 1) * rows * 8].cast(form)
            buffers.append(libe57.SourceDestBuffer(image, field, column, rows, True, True, 0))
        reader = scans[part]["points"].reader(buffers)
        while count := reader.read():
            slots.next()[: len(columns)] = columns
            slots.filled(part, count)
        reader.close()


def load_laz() -> ModuleType:
    """Import the binding of laz-rs."""
    return importlib.import_module("lazrs")


def fill_laz(lazrs: ModuleType, plan: SimpleNamespace, slots: Slots) -> None:
    """Decode whole point records, as LAS holds them."""
    selection = lazrs.DecompressionSelection(
        lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL
        | lazrs.SELECTIVE_DECOMPRESS_Z
        | lazrs.SELECTIVE_DECOMPRESS_INTENSITY
        | (lazrs.SELECTIVE_DECOMPRESS_RGB if plan.colour else 0)
    )
    kind = lazrs.ParLasZipDecompressor if plan.parallel else lazrs.LasZipDecompressor
    with open(plan.path, "rb") as stream:  # noqa: PTH123
        stream.seek(plan.offset)
        decompressor = kind(stream, bytes.fromhex(plan.laszip), selection)
        left = plan.rows
        while left:
            rows = min(left, plan.slot_rows)
            decompressor.decompress_many(slots.next()[: rows * plan.record_bytes])
            slots.filled(0, rows)
            left -= rows


Load = Callable[[], ModuleType]
Fill = Callable[[ModuleType, SimpleNamespace, Slots], None]
TASKS: dict[str, tuple[Load, Fill]] = {
    "e57": (load_e57, fill_e57),
    "laz": (load_laz, fill_laz),
}


def confine(memory_bytes: int) -> None:
    """Allow no core file, and only `memory_bytes` beyond what the process holds now.

    Where the system does not report what it holds, or has no limits, memory is not limited.
    """
    if resource is None:
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        with open("/proc/self/statm") as pages:  # noqa: PTH123
            held = int(pages.read().split()[5]) * resource.getpagesize()
    except OSError:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (held + memory_bytes, held + memory_bytes))


def die_with(parent: int) -> None:
    """End this process when the one that started it ends, however it ends.

    On Linux the kernel kills it, elsewhere a thread looks every second. Windows reports
    neither, and its processes end with their input.
    """
    if not hasattr(os, "fork"):
        return
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is None:
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    else:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)


def opened(memory: str) -> int:
    """Return the shared memory's descriptor, which is inherited, or opened by its path."""
    return int(memory) if memory.isdigit() else os.open(memory, os.O_RDWR)


def claimed(outbox: str) -> int:
    """Return the descriptor for messages; standard output is left to the noise of libraries."""
    descriptor = int(outbox)
    if descriptor == 1:
        descriptor = os.dup(1)
        os.dup2(2, 1)
    return descriptor


def main(parent: int, memory: int, outbox: int, plan_bytes: int) -> None:
    """Run the task of the plan, and report how it ended."""
    die_with(parent)
    area = mmap.mmap(memory, 0)
    job = json.loads(area[:plan_bytes], object_hook=lambda table: SimpleNamespace(**table))
    slots = Slots(area, job.slots, job.slot_bytes, outbox)
    sys.path.append(job.library)
    load, fill = TASKS[job.task]
    try:
        library = load()
        confine(job.memory_bytes)
        slots.send(READY)
        fill(library, job.plan, slots)
        slots.send(DONE)
    except MemoryError:
        slots.send(MEMORY)
    except BaseException as error:  # a Rust panic is no Exception
        text = f"{type(error).__name__}: {error}".encode(errors="replace")[:400]
        slots.send(ERROR, rows=len(text), text=text)
    os._exit(0)


if __name__ == "__main__":
    main(int(sys.argv[1]), opened(sys.argv[2]), claimed(sys.argv[3]), int(sys.argv[4]))
