"""Services of the system, and the fall-back where there are none."""

from __future__ import annotations

import ctypes
import os
import platform
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from wheelplane.errors import InputError
from wheelplane.readers.sandbox import worker
from wheelplane.system import files_in_memory, folders, locks, memory, processes, waiting

GIB = 1 << 30


class Kernel32:
    """As Windows' library: it fills a MEMORYSTATUSEX."""

    def GlobalMemoryStatusEx(self, reference):
        status = ctypes.cast(reference, ctypes.POINTER(ctypes.c_uint32))
        if status[0] != 64:
            return 0
        status = ctypes.cast(reference, ctypes.POINTER(ctypes.c_uint64))
        status[1], status[2] = 8 * GIB, 3 * GIB
        return 1


@pytest.fixture
def no_proc(monkeypatch):
    """No file of /proc or /sys is there."""

    def read(_path):
        raise FileNotFoundError

    monkeypatch.setattr(memory.Path, "read_text", read)


def test_memory_is_told_by_proc_then_sysconf_then_windows_then_nobody(no_proc, monkeypatch):
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert (memory.machine_bytes(), memory.free_bytes()) == (physical, physical)
    monkeypatch.delattr(os, "sysconf")
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=Kernel32()), raising=False)
    assert (memory.machine_bytes(), memory.free_bytes()) == (8 * GIB, 3 * GIB)
    monkeypatch.delattr(ctypes, "windll")
    assert (memory.machine_bytes(), memory.free_bytes()) == (memory.UNKNOWN, memory.UNKNOWN)


def test_what_is_unknown_limits_nothing(no_proc, monkeypatch):
    limits = memory.resource.getrlimit(memory.resource.RLIMIT_DATA)
    with memory.memory_limit(1):
        assert memory.resource.getrlimit(memory.resource.RLIMIT_DATA) == limits
    monkeypatch.setattr(memory, "resource", None)
    with memory.memory_limit(1):
        assert memory.unlimited_bytes() == memory.UNKNOWN


def test_proc_is_the_first_to_tell():
    assert 0 < memory.free_bytes() < memory.machine_bytes()
    with memory.memory_limit(GIB):
        assert 0 < memory.unlimited_bytes() <= GIB


class Msvcrt:
    """As Windows' module, by the locks of POSIX, which belong to processes."""

    LK_LOCK, LK_NBLCK = 1, 2

    def locking(self, handle, mode, count):
        kind = os.F_LOCK if mode == self.LK_LOCK else os.F_TLOCK
        os.lockf(handle, kind, count)


HOLD = """
import sys
from pathlib import Path
from tests.system.test_system import Msvcrt, locks
if {windows}:
    locks.fcntl, locks.msvcrt = None, Msvcrt()
with open(sys.argv[1], "w") as file:
    print(locks.acquire(file.fileno()), flush=True)
    sys.stdin.read()
"""


NEW_PAGES = """
import resource, sys
import numpy as np
from wheelplane.system import hold_freed

def arrays():
    kept = [np.ones(400_000) for _ in range(9)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

if sys.argv[1:]:
    hold_freed()
first = arrays()
print([arrays() for _ in range(10)][-1] - first)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="it gives memory back in its own way")
def test_memory_that_was_freed_serves_the_arrays_that_follow():
    """Nine of 3 MB, ten times: without it each page of theirs is new."""
    plain, held = (
        int(subprocess.check_output([sys.executable, "-c", NEW_PAGES, *given], text=True))
        for given in ([], ["held"])
    )
    assert held < 0.1 * plain


@pytest.mark.parametrize("windows", [False, True])
def test_a_lock_is_held_by_one_process_until_it_ends(tmp_path, monkeypatch, windows):
    if windows:
        monkeypatch.setattr(locks, "fcntl", None)
        monkeypatch.setattr(locks, "msvcrt", Msvcrt())
    path = tmp_path / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLD.format(windows=windows), str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout.readline() == "True\n"
        with path.open("w") as file:
            assert not locks.acquire(file.fileno(), wait=False)
            threading.Timer(0.3, other.stdin.close).start()
            assert locks.acquire(file.fileno())
            assert other.wait(30) == 0


def test_without_locks_only_those_who_wait_go_on(monkeypatch):
    monkeypatch.setattr(locks, "fcntl", None)
    assert locks.acquire(0)
    assert not locks.acquire(0, wait=False)


@pytest.mark.parametrize("hidden", [False, True])
def test_a_memory_file_is_opened_by_its_path_and_leaves_nothing(tmp_path, monkeypatch, hidden):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    if hidden:
        monkeypatch.delattr(os, "memfd_create")
    with files_in_memory.memory_file() as file:
        for content in (b"a longer one", b"short"):
            file.write(content)
            with open(file.path, "rb") as opened:  # noqa: PTH123
                assert opened.read() == content
        assert len(list(tmp_path.iterdir())) == hidden
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OSError, match="descriptor"):
        os.fstat(file.descriptor)


def test_a_file_that_is_still_mapped_is_removed_at_the_end(monkeypatch):
    """As on Windows, which removes no mapped file."""
    due = []
    monkeypatch.delattr(os, "memfd_create")
    monkeypatch.setattr("atexit.register", lambda call, **options: due.append((call, options)))
    with monkeypatch.context() as patch:

        def unlink(_path, **_options):
            raise PermissionError

        with files_in_memory.memory_file() as file:
            patch.setattr(files_in_memory.Path, "unlink", unlink)
    assert os.path.exists(file.path)  # noqa: PTH110
    monkeypatch.undo()
    os.unlink(file.path)  # noqa: PTH108
    assert len(due) == 1


@pytest.mark.parametrize("hidden", [False, True])
def test_a_pipe_is_read_within_a_time(monkeypatch, hidden):
    if hidden:
        monkeypatch.delattr(select, "poll")
    inbox, outbox = os.pipe()
    os.write(outbox, b"abcd")
    assert waiting.read_within(inbox, 3, 60.0) == b"abc"
    assert waiting.read_within(inbox, 3, 60.0) == b"d"
    with pytest.raises(TimeoutError):
        waiting.read_within(inbox, 3, 0.1)
    os.close(outbox)
    if not hidden:  # the thread that was left waiting has taken the end
        assert waiting.read_within(inbox, 3, 60.0) == b""
    os.close(inbox)


class OverError(BaseException):
    """The end of the time."""


def work(seconds):
    for _ in range(int(seconds / 0.01)):
        time.sleep(0.01)


@pytest.mark.parametrize("hidden", [False, True])
def test_work_ends_with_its_time(monkeypatch, hidden):
    if hidden:
        monkeypatch.delattr(signal, "setitimer")
    with pytest.raises(OverError), waiting.time_limit(0.1, OverError):
        work(60.0)
    with waiting.time_limit(0.2, OverError):
        pass
    time.sleep(0.4)


def test_processes_start_and_end_without_posix(monkeypatch):
    assert processes.start_method() == "forkserver"
    assert processes.inherits_descriptors()
    assert processes.apart() == {"process_group": 0}
    monkeypatch.setattr(sys, "platform", "darwin")
    assert processes.start_method() == "spawn"
    monkeypatch.delattr(os, "fork")
    monkeypatch.delattr(os, "setpgid")
    assert processes.start_method() == "spawn"
    assert not processes.inherits_descriptors()
    assert set(processes.apart()) == {"creationflags"}


@pytest.mark.parametrize("hidden", [False, True])
def test_a_process_is_ended(monkeypatch, hidden):
    if hidden:
        monkeypatch.delattr(os, "killpg")
    code = "import time; time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code], start_new_session=True) as process:
        processes.end_with_children(process)
        assert process.wait(30) == -signal.SIGKILL
    processes.end_with_children(process)


def test_signals_are_those_that_there_are():
    assert processes.signals("SIGTERM", "SIGNONE") == (signal.SIGTERM,)


def test_a_folder_that_cannot_be_opened_is_not_synced(tmp_path, monkeypatch):
    folders.sync_folder(tmp_path)
    with pytest.raises(FileNotFoundError):
        folders.sync_folder(tmp_path / "none")
    monkeypatch.delattr(os, "O_DIRECTORY")
    folders.sync_folder(tmp_path / "none")


ORPHAN = """
import ctypes, os, sys, time
sys.path.insert(0, sys.argv[1])
import worker
worker.ctypes.CDLL = lambda _name: object()
worker.die_with(os.getppid())
print(os.getpid(), flush=True)
time.sleep(60)
"""


def test_a_child_ends_with_its_parent_where_no_kernel_kills_it(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    folder = os.path.dirname(worker.__file__)  # noqa: PTH120
    code = (
        "import subprocess, sys\n"
        "child = subprocess.Popen([sys.executable, *sys.argv[1:]], stdout=subprocess.PIPE)\n"
        "child.stdout.readline()\n"
    )
    arguments = [sys.executable, "-W", "ignore", "-c", code, str(script), folder]
    started = time.monotonic()
    with subprocess.Popen(arguments, stderr=subprocess.PIPE) as parent:
        parent.stderr.read()  # which the orphan holds open
    assert time.monotonic() - started < 50.0


def test_a_worker_without_limits_goes_on(monkeypatch):
    monkeypatch.setattr(worker, "resource", None)
    worker.confine(1)


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="a system without such sockets")
def test_the_longest_temporary_folder_just_leaves_room_for_a_socket(tmp_path, monkeypatch):
    """The kernel says how long a path may be: one character more than is allowed fails there."""
    end = "/pymp-12345678/listener-12345678"
    for length, fits in ((processes.LONGEST_TEMPORARY_FOLDER, True), (76, False)):
        base = tempfile.mkdtemp(prefix="w", dir="/tmp")
        folder = base + "/" + "x" * (length - len(base) - 1)
        Path(folder + end).parent.mkdir(parents=True)
        monkeypatch.setattr(tempfile, "tempdir", folder)
        with closing(socket.socket(socket.AF_UNIX)) as one:
            if fits:
                processes.check_temporary_folder()
                one.bind(folder + end)
            else:
                with pytest.raises(InputError, match=r"has 76 bytes, at most 75 .*TMPDIR"):
                    processes.check_temporary_folder()
                with pytest.raises(OSError, match="too long"):
                    one.bind(folder + end)
        shutil.rmtree(base)
