"""Processes: how they are started, what they inherit, how they end."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from subprocess import Popen

NICER = 10
LONGEST_TEMPORARY_FOLDER = 107 - len("/pymp-12345678/listener-12345678")


def inherits_descriptors() -> bool:
    """Return whether a child process can be given open files by their numbers."""
    return hasattr(os, "fork")


def give_way() -> None:
    """Leave the processor to other processes that need it, where the system can."""
    if hasattr(os, "nice"):
        os.nice(NICER)


def start_method() -> str:
    """Return how multiprocessing starts workers: by a fork server, where forks are safe."""
    return "forkserver" if hasattr(os, "fork") and sys.platform != "darwin" else "spawn"


def check_temporary_folder() -> None:
    """Raise InputError where the fork server's socket would get too long a path."""
    folder = tempfile.gettempdir()
    length = len(os.fsencode(folder))
    if start_method() == "forkserver" and length > LONGEST_TEMPORARY_FOLDER:
        raise InputError(
            f"{folder}: the temporary folder's path has {length} bytes, at most "
            f"{LONGEST_TEMPORARY_FOLDER} leave room for a socket: set TMPDIR to a shorter one"
        )


def apart() -> dict[str, Any]:
    """Return the options of Popen for a child that Ctrl-C does not reach: its parent handles it."""
    if hasattr(os, "setpgid"):
        return {"process_group": 0}
    return {"creationflags": 0x200}  # CREATE_NEW_PROCESS_GROUP of Windows


def end_with_children(process: Popen[Any]) -> None:
    """Kill a process that leads its group, and its children; Windows' end as their input ends."""
    if not hasattr(os, "killpg"):
        process.kill()
        return
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return those of the named signals that the system has."""
    return tuple(signal.Signals[name] for name in names if name in signal.Signals.__members__)
