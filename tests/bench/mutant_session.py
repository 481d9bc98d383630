"""A pytest session that tries many one-token changes of a room, each in a forked process.

Once, each quick test runs under a trace: its seconds and the room's lines that it executes. Then,
for each change, the tests of its line run until one fails: first those that saw the last changes
of the file, then the fastest. A change within a function replaces the code of the functions that
stand in memory; any other, and the one of a line that no test is seen to execute, runs in a fork
from before the package was imported. The changed file lies on disk meanwhile, for processes that
the tests start. mutants.py starts this in a copy of the files under version control.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import importlib
import io
import json
import math
import os
import resource
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import hypothesis
import pytest

from tests.bench.changes import Change, Outcome

TEST_S = 5.0  # slower tests, traced, are left out
CHANGE_S = 180.0
MEMORY_B = 6 << 30
QUICK = ["-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header"]
QUICK += ["--tb=no", "--assert=plain", "--no-summary", "-p", "no:hypothesispytest"]
BEFOREHAND = [
    "click", "cv2", "jinja2", "numpy", "pydantic", "rich", "scipy.linalg", "scipy.ndimage",
    "scipy.optimize", "scipy.signal", "scipy.sparse", "scipy.spatial", "scipy.special",
    "scipy.stats",
]  # fmt: skip


def forked(work: Callable[[], Any], limit_s: float = math.inf) -> tuple[int, Any]:
    """Do the work in a forked process group; return its status and what it returns."""
    began = time.monotonic()
    with tempfile.TemporaryFile() as stream:
        child = os.fork()
        if not child:
            try:
                os.setpgid(0, 0)
                if limit_s < math.inf:
                    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_B, MEMORY_B))
                stream.write(json.dumps(work()).encode())
                stream.flush()
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(0)
        while not (ended := os.waitpid(child, os.WNOHANG))[0]:
            time.sleep(0.002)
            if time.monotonic() - began > limit_s:
                os.kill(child, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        stream.seek(0)
        text = stream.read()
    return ended[1], json.loads(text) if text else None


def functions_of(folder: Path) -> dict[tuple[str, int, str], list[FunctionType]]:
    """Return the functions in memory of the files of a folder, by file, first line and name."""
    found: dict[tuple[str, int, str], list[FunctionType]] = {}
    for one in gc.get_objects():
        if isinstance(one, FunctionType):
            path = os.path.realpath(one.__code__.co_filename)
            if path.startswith(str(folder)):
                key = (path, one.__code__.co_firstlineno, one.__code__.co_name)
                found.setdefault(key, []).append(one)
    return found


def outer_code(code: CodeType, line: int) -> CodeType | None:
    """Return the outermost function's code that holds a line."""
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            is_function = inner.co_flags & 1  # CO_OPTIMIZED; a class body has it not
            found = inner if is_function and line in lines_of(inner) else outer_code(inner, line)
            if found:
                return found
    return None


def lines_of(code: CodeType) -> set[int]:
    """Return the lines of a code and of those in it."""
    inner = [lines_of(one) for one in code.co_consts if isinstance(one, CodeType)]
    return {line for *_, line in code.co_lines() if line}.union(*inner)


class Traced:
    """The lines of a folder that run while it is entered, in threads begun meanwhile too."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.lines = str(folder), set[tuple[str, int]]()
        self.real: dict[str, str | None] = {}

    def __call__(self, frame: FrameType, event: str, _argument: object) -> Any:
        name = frame.f_code.co_filename
        if name not in self.real:
            real = os.path.realpath(name)
            self.real[name] = real if real.startswith(self.folder) else None
        path = self.real[name]
        if path is None:
            return None
        if event == "line":
            self.lines.add((path, frame.f_lineno))
        return self

    def __enter__(self) -> Traced:
        threading.settrace(self)
        sys.settrace(self)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]


class Room:
    """The changes of a room, its tests' seconds and lines, and what came of the changes."""

    def __init__(self, room: str, tests: list[str], folder: Path, budget_s: float) -> None:
        self.folder, self.tests, self.budget_s = Path.cwd() / room, tests, budget_s
        self.room, self.stored = room, folder / (room.replace("/", "-") + ".json")
        sources = b"".join(path.read_bytes() for path in sorted(self.folder.rglob("*.py")))
        self.state = hashlib.sha256(sources).hexdigest()
        known = json.loads(self.stored.read_text()) if self.stored.exists() else {}
        self.known = known["tests"] if known.get("state") == self.state else {}
        self.killers: dict[str, list[str]] = {}
        self.left: list[Change] = []

    def covered(self, change: Change) -> bool:
        """Return whether a test executes the line."""
        return any(change.line in one["lines"].get(change.file, ()) for one in self.known.values())

    def order(self, change: Change) -> list[str]:
        """Return the tests of a change in their order, up to the budget.

        They execute its line; where none does, as at import, those of its file come first.
        """
        passing = {name: one for name, one in self.known.items() if one["passed"]}
        of_file = {name: one["lines"].get(change.file, ()) for name, one in passing.items()}
        names = [name for name, lines in of_file.items() if change.line in lines]
        names = names or [n for n, lines in of_file.items() if lines or n.startswith(self.tests[0])]
        last = self.killers.get(change.file, [])
        places = {name: -place - 1 for place, name in enumerate(last)}
        names.sort(key=lambda n: (places.get(n, 0), not of_file[n], passing[n]["seconds"]))
        spent, kept = 0.0, []
        for name in names:
            spent += passing[name]["seconds"]
            if kept and spent > self.budget_s:
                break
            kept.append(name)
        return kept

    def noted(self, change: Change, status: int, answer: Any, began: float) -> Outcome:
        """Return the outcome of a change, and keep in mind the test that saw it."""
        ran, failed = answer or (
            0,
            "takes too long" if status in (signal.SIGALRM, signal.SIGKILL) else "ends the process",
        )
        if answer and failed:
            last = self.killers.setdefault(change.file, [])
            if failed in last:
                last.remove(failed)
            last.append(failed)
            del last[:-4]
        return Outcome(change, failed, ran, round(time.monotonic() - began, 2))


class Session:
    """The plugin: collects the room's tests, and tries changes of functions."""

    def __init__(self, room: Room, changes: list[Change], write: Callable[[Outcome], None]) -> None:
        self.room, self.changes, self.write = room, changes, write

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Measure the tests that are new, then try the changes."""
        for path in sorted(self.room.folder.rglob("*.py")):
            inside = path.relative_to(Path.cwd() / "pipeline").with_suffix("").parts
            importlib.import_module(".".join(("wheelplane", *inside)).removesuffix(".__init__"))
        self.items = {item.nodeid: item for item in session.items}
        self.session = session
        self.measure()
        functions = functions_of(self.room.folder)
        for change in self.changes:
            path = Path.cwd() / change.file
            code = outer_code(compile(change.source(), path, "exec"), change.line)
            live = functions.get((str(path), code.co_firstlineno, code.co_name)) if code else None
            names = [name for name in self.room.order(change) if name in self.items]
            at_import = not self.room.covered(change)
            if at_import or not live:
                self.room.left.append(change)
                continue
            began = time.monotonic()
            with change.on_disk():
                status, answer = forked(partial(self.tried, names, live, code), CHANGE_S)
            self.write(self.room.noted(change, status, answer, began))
        return True

    def measure(self) -> None:
        """Run each test that is new in a process of its own, traced."""
        known = self.room.known
        for number, (name, item) in enumerate(self.items.items()):
            if name in known:
                continue
            began = time.monotonic()
            _, lines = forked(partial(self.traced, item), CHANGE_S)
            seconds = time.monotonic() - began
            passed = lines is not None and seconds < TEST_S
            known[name] = {"seconds": seconds, "passed": passed, "lines": lines or {}}
            if not number % 100:
                print(f"{number} of {len(self.items)} tests measured", file=sys.stderr, flush=True)
        stored = {"state": self.room.state, "tests": known}
        self.room.stored.write_text(json.dumps(stored))

    def traced(self, item: pytest.Item) -> dict[str, list[int]] | None:
        """Run a test; return the room's lines that it executes, or None if it fails."""
        signal.setitimer(signal.ITIMER_REAL, 3.0 * TEST_S)
        with Traced(self.room.folder) as traced:
            item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
        lines: dict[str, list[int]] = {}
        for path, line in sorted(traced.lines):
            lines.setdefault(os.path.relpath(path), []).append(line)
        return None if self.session.testsfailed else lines

    def tried(
        self, names: list[str], live: list[FunctionType], code: CodeType
    ) -> tuple[int, str | None]:
        """Run tests with another code of functions; return how many ran and which failed."""
        for function in live:
            function.__code__ = code
        return run(self.session, [self.items[name] for name in names], self.room)


def run(session: pytest.Session, items: list[pytest.Item], room: Room) -> tuple[int, str | None]:
    """Run tests until one fails; one that takes much longer than it did ends the process."""
    for number, item in enumerate(items):
        seconds = room.known[item.nodeid]["seconds"]
        signal.setitimer(signal.ITIMER_REAL, 5.0 * seconds + 5.0)
        following = items[number + 1] if number + 1 < len(items) else None
        item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return number + 1, item.nodeid
    return len(items), None


class Fresh:
    """The plugin that runs chosen tests in their order in a process that just began."""

    def __init__(self, room: Room, names: list[str]) -> None:
        self.room, self.names = room, names
        self.answer: tuple[int, str | None] = (0, "does not collect")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run them."""
        items = {item.nodeid: item for item in session.items}
        if not session.testsfailed:
            ordered = [items[name] for name in self.names if name in items]
            self.answer = run(session, ordered, self.room)
        return True


def fresh(room: Room, names: list[str]) -> tuple[int, str | None]:
    """Import what a change altered, and run tests."""
    signal.setitimer(signal.ITIMER_REAL, 60.0)
    plugin = Fresh(room, names)
    files = list(dict.fromkeys(name.partition("::")[0] for name in names))
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main([*QUICK, *files], plugins=[plugin])
    return plugin.answer


def try_all(room: Room, changes: list[Change], write: Callable[[Outcome], None]) -> None:
    """Try the changes of a room and write each one's outcome."""
    phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
    hypothesis.settings.register_profile(
        "mutants", deadline=None, database=None, derandomize=True, phases=phases
    )
    hypothesis.settings.load_profile("mutants")
    for name in BEFOREHAND:
        importlib.import_module(name)

    def session() -> list[int]:
        plugin = Session(room, changes, write)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        pytest.main([*QUICK, *room.tests], plugins=[plugin])
        return [changes.index(one) for one in room.left]

    _, left = forked(session)
    room.known = json.loads(room.stored.read_text())["tests"]
    for change in [changes[index] for index in left]:
        began, names = time.monotonic(), room.order(change)
        with change.on_disk():
            status, answer = forked(partial(fresh, room, names), CHANGE_S)
        write(room.noted(change, status, answer, began))
