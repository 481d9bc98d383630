"""The child that runs a native reader: whatever it does ends in its blocks or in one clear line."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import FORMATS, ROOT
from wheelplane.errors import InputError, MissingDependencyError
from wheelplane.readers import read_scan
from wheelplane.readers.sandbox import client as child
from wheelplane.readers.sandbox import process as child_process
from wheelplane.readers.sandbox import worker as child_main
from wheelplane.readers.sandbox.client import find_library, run_child
from wheelplane.readers.sandbox.process import SLOTS, Job
from wheelplane.readers.source import Source

LAZ = FORMATS / "simple.laz"
ROWS, SLOT_BYTES = 4, 64

SPEAK = f"""
import os, signal, struct, sys, time
parent, memory, said, plan = map(int, sys.argv[1:])
def say(kind, part=0, rows=0, text=b""):
    os.write(said, struct.pack({child_main.MESSAGE.format!r}, kind, part, rows) + text)
say(b"R")
"""
MAIN = f"""
import importlib.util, sys, time
spec = importlib.util.spec_from_file_location("child_main", {child_main.__file__!r})
m = importlib.util.module_from_spec(spec)
spec.loader.exec_module(m)
def task(library, plan, slots):
{{body}}
m.TASKS["test"] = (lambda: None, task)
m.main(*map(int, sys.argv[1:]))
"""


def indented(body):
    return "".join(f"    {line}\n" for line in body.splitlines())


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "rr.laz"
    path.write_bytes(b"?")
    with ExitStack() as stack:
        yield Source.open(path, "rr.laz", stack)
    assert living() == []


def living():
    """Children of this process that are alive or were not waited for, workers of pools apart."""
    pids = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    commands = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in pids}
    return [pid for pid, line in commands.items() if b"child.py" in line or b"worker.py" in line]


def open_files():
    return len(list(Path("/proc/self/fd").iterdir()))


def job(tmp_path, script, rows=(ROWS,)):
    path = tmp_path / "child.py"
    path.write_text(script)
    return Job("test", "", {}, rows, ROWS, SLOT_BYTES, 1 << 26, path)


def refused(made, source, error=InputError):
    descriptors = open_files()
    with pytest.raises(error) as caught:
        list(run_child(made, source))
    text = str(caught.value)
    assert text.startswith("rr.laz: ")
    assert text.isprintable()
    del caught  # its traceback holds on to the memory, which has a descriptor of its own
    gc.collect()
    assert open_files() == descriptors
    assert living() == []
    return text


DEATHS = {
    "os.abort()": "crashes the library that reads it (SIGABRT)",
    "os.kill(os.getpid(), signal.SIGSEGV)": "crashes the library that reads it (SIGSEGV)",
    "os.kill(os.getpid(), signal.SIGKILL)": "crashes the library that reads it (SIGKILL)",
    "os._exit(3)": "crashes the library that reads it (exit code 3)",
    "sys.exit()": "crashes the library that reads it (exit code 0)",
    "say(b'B', 0, 4); os.abort()": "SIGABRT",
    "os.write(said, b'R')": "exit code 0",
    "os.write(said, b'\\xff' * 100)": "corrupts the memory",
    "say(b'R')": "corrupts the memory",
    "say(b'B', 0, 5)": "corrupts the memory",
    "say(b'B', 0, 0)": "corrupts the memory",
    "say(b'B', 0, 2**63)": "corrupts the memory",
    "say(b'B', 1, 4)": "corrupts the memory",
    "say(b'E', 0, 2**40)": "corrupts the memory",
    "os.close(said); time.sleep(60)": "corrupts the memory",
    "say(b'B', 0, 3); say(b'D')": "declares 4 points, the file holds 3",
    "say(b'D')": "declares 4 points, the file holds 0",
    "say(b'B', 0, 4); say(b'B', 0, 1)": "declares 4 points, but more points follow",
    "say(b'M')": "takes more memory than its points can need",
    "say(b'E', 0, 12, b'Bad: \\n\\x1b[0m\\xff.')": "cannot be decoded ('Bad:')",
}


@pytest.mark.parametrize("deed", DEATHS)
def test_however_the_child_ends_it_is_one_line(tmp_path, source, monkeypatch, deed):
    monkeypatch.setattr(child_process, "ENDING_S", 0.2)
    assert DEATHS[deed] in refused(job(tmp_path, SPEAK + deed), source)


@pytest.mark.parametrize(
    "deed",
    [
        "while True: time.sleep(60)",
        "while True: pass",
        "for n in range(1, 65): n in (9, 19, 32, 33) or signal.signal(n, lambda *_: 0)\n"
        "time.sleep(60)",
        "say(b'B', 0, 1); time.sleep(60)",
        "os.write(said, b'B123'); time.sleep(60)",
    ],
)
def test_a_child_that_hangs_is_killed(tmp_path, source, monkeypatch, deed):
    monkeypatch.setattr(child, "IDLE_S", 0.3)
    assert "makes no progress" in refused(job(tmp_path, SPEAK + deed), source)


def test_a_child_that_never_starts_is_killed(tmp_path, source, monkeypatch):
    monkeypatch.setattr(child, "START_S", 0.3)
    assert "makes no progress" in refused(job(tmp_path, "import time; time.sleep(60)"), source)


@pytest.mark.parametrize(
    ("body", "fact"),
    [
        ("eaten = bytearray(1 << 30)", "takes more memory than its points can need"),
        ("eaten = [bytearray(1 << 20) for _ in range(1 << 10)]", "takes more memory than"),
        ("raise ValueError('no\\nsuch page')", "cannot be decoded ('no')"),
        ("raise type('PanicException', (BaseException,), {})('mid')", "decoded ('mid')"),
        ("raise KeyboardInterrupt", "decoded ('KeyboardInterrupt:')"),
        ("raise ValueError(chr(0xD800) * 9000)", "decoded ('????"),
        ("m.os.write(1, b'noise'); m.os.write(2, b'noise')", "the file holds 0"),
    ],
)
def test_what_a_library_raises_or_eats_is_reported(tmp_path, source, capfd, body, fact):
    script = MAIN.format(body=indented(body))
    assert fact in refused(job(tmp_path, script), source)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("size_b", [1 << 25, 60 << 20])
def test_memory_within_the_allowance_is_granted(tmp_path, source, size_b):
    """The allowance is 64 MiB beyond what the child held before."""
    script = MAIN.format(body=indented(f"eaten = bytearray({size_b})\nslots.filled(0, 4)"))
    assert [filled.rows for filled in run_child(job(tmp_path, script), source)] == [4]


def test_a_library_that_does_not_load_is_reported_with_what_to_install(tmp_path, source):
    script = SPEAK + "text = b'ImportError: no libxerces'; say(b'E', 0, len(text), text)"
    text = refused(job(tmp_path, script), source, MissingDependencyError)
    assert "install wheelplane[all]" in text


@pytest.mark.parametrize("delay_s", [0.0, 0.01])
def test_every_block_arrives_as_it_was_written(tmp_path, source, delay_s):
    """However many times the slots go round, and whoever is the slower."""
    count = 8 * SLOTS + 1
    body = "for i in range(%d):\n    slots.next()[:] = bytes([i]) * 64\n    slots.filled(i // 9, 4)"
    script = MAIN.format(body=indented(body % count))
    parts = np.bincount(np.arange(count) // 9) * 4
    got = []
    for filled in run_child(job(tmp_path, script, tuple(parts.tolist())), source):
        time.sleep(delay_s)
        got.append((filled.part, filled.rows, bytes(filled.memory)))
    assert got == [(i // 9, 4, bytes([i]) * SLOT_BYTES) for i in range(count)]


def test_closing_the_iterator_or_the_source_ends_the_child(tmp_path, source):
    script = SPEAK + "say(b'B', 0, 1); time.sleep(60)"
    for close in ("iterator", "source"):
        with ExitStack() as stack:
            held = Source(source.stream, source.text, 1, "rr.laz", source.path, stack)
            filled = run_child(job(tmp_path, script), held)
            assert next(filled).rows == 1
            assert len(living()) == 1
            if close == "iterator":
                filled.close()
                assert living() == []
        assert living() == []


PARENT = """
import sys, time
from contextlib import ExitStack
from pathlib import Path
from wheelplane.readers.sandbox.client import run_child
from wheelplane.readers.sandbox.process import Job
from wheelplane.readers.source import Source
script, scan = map(Path, sys.argv[1:])
with ExitStack() as stack:
    source = Source.open(scan, "rr.laz", stack)
    filled = next(run_child(Job("test", "", {}, (2**62,), 2**62, 8, 1 << 26, script), source))
    print(filled.rows, flush=True)
    time.sleep(60)
"""
# Says its own number as that of the rows, then waits without looking at the pipe.
STUBBORN = MAIN.format(
    body=indented("import os, signal\nslots.filled(0, os.getpid())\nwhile True: time.sleep(60)")
)


@pytest.mark.parametrize("deed", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_the_child_dies_with_its_parent(tmp_path, deed):
    script, scan = tmp_path / "child.py", tmp_path / "rr.laz"
    script.write_text(STUBBORN)
    scan.write_bytes(b"?")
    arguments = [sys.executable, "-c", PARENT, str(script), str(scan)]
    with subprocess.Popen(
        arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=ROOT
    ) as parent:
        grandchild = int(parent.stdout.readline())
        assert Path(f"/proc/{grandchild}").exists()
        parent.send_signal(deed)
    wait_until(lambda: not runs(grandchild))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["child.py", "rr.laz"]


def runs(pid):
    """Whether the process exists and is no zombie, which here only init could bury."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition, patience_s=10.0):
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
def test_workers_of_any_kind_can_start_it(method):
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        scan = pool.submit(read_scan, LAZ).result()
    assert scan.points_m.tobytes() == read_scan(LAZ).points_m.tobytes()


def test_the_scan_folder_is_no_place_to_import_from(tmp_path, monkeypatch):
    """A file beside the scan that is called like a library is not run."""
    for name in ("lazrs", "json", "mmap", "struct"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run')")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rr.laz").write_bytes(LAZ.read_bytes())
    assert len(read_scan(Path("rr.laz")).points_m) == 1065


def test_the_folder_of_the_script_is_no_place_to_import_from(tmp_path, source):
    (tmp_path / "struct.py").write_text("raise SystemExit('run')")
    made = job(tmp_path, SPEAK + "say(b'B', 0, 4); say(b'D')")
    assert [filled.rows for filled in run_child(made, source)] == [4]


def test_what_is_missing_is_reported_with_what_to_install(source):
    assert Path(find_library("numpy", "arrays", "all", source), "numpy").is_dir()
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[e57\]'") as caught:
        find_library("no_such_library", "E57", "e57", source)
    assert str(caught.value).startswith("rr.laz: reading E57 needs the library no_such_library")


@pytest.mark.parametrize("deed", ["say(b'B', 0, 4)", "say(b'B', 1, 4)"])
def test_every_part_is_delivered_whole(tmp_path, source, deed):
    text = refused(job(tmp_path, SPEAK + f"{deed}; say(b'D')", (4, 4)), source)
    assert "declares 8 points, the file holds 4" in text
