"""Differences between systems, each with a fall-back: memory, locks, memory files, processes.

Frozen dataclasses, and a stopwatch for the stages of a measurement in this process.
"""

from .files_in_memory import MemoryFile, memory_file
from .folders import sync_folder
from .frozen import frozen
from .lazily import loader
from .locks import acquire
from .mapping import lent
from .memory import (
    free_bytes,
    give_back,
    hold_freed,
    machine_bytes,
    memory_limit,
    peak_bytes,
    share_memory,
    unlimited_bytes,
)
from .processes import (
    apart,
    check_temporary_folder,
    end_with_children,
    give_way,
    inherits_descriptors,
    signals,
    start_method,
)
from .stopwatch import STAGES, add_taken, stage, taken
from .waiting import read_within, time_limit

__all__ = [
    "STAGES",
    "MemoryFile",
    "acquire",
    "add_taken",
    "apart",
    "check_temporary_folder",
    "end_with_children",
    "free_bytes",
    "frozen",
    "give_back",
    "give_way",
    "hold_freed",
    "inherits_descriptors",
    "lent",
    "loader",
    "machine_bytes",
    "memory_file",
    "memory_limit",
    "peak_bytes",
    "read_within",
    "share_memory",
    "signals",
    "stage",
    "start_method",
    "sync_folder",
    "taken",
    "time_limit",
    "unlimited_bytes",
]
