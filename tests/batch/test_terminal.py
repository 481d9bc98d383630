"""A batch at a terminal: the same results, with a bar that leaves nothing behind."""

from __future__ import annotations

import os
import pty
import subprocess
import threading

from tests.support.batches import BATCH, archive_of, five_points, left, run, run_process
from tests.support.paths import ROOT


def at_a_terminal(*arguments: object) -> tuple[int, str]:
    """Run a command at a pseudo-terminal; its exit code, and what the terminal showed."""
    outer, inner = pty.openpty()
    shown = bytearray()

    def read() -> None:
        while True:
            try:
                shown.extend(os.read(outer, 65536))
            except OSError:  # nobody writes any more
                return

    command = [*BATCH[:-1], *map(str, arguments)]
    process = subprocess.Popen(command, cwd=ROOT, stdin=inner, stdout=inner, stderr=inner)
    os.close(inner)
    reader = threading.Thread(target=read)
    reader.start()
    code = process.wait(timeout=300)
    reader.join(timeout=10)
    os.close(outer)
    return code, shown.decode()


def test_a_terminal_shows_a_bar_and_the_results_are_the_same(tmp_path):
    archive = archive_of(tmp_path / "archive", 4)
    (archive / "00" / "car-0001.txt").write_text("no points\n")
    os.utime(archive / "00" / "car-0001.txt", (1e9, 1e9))
    code, shown = at_a_terminal("batch", archive, "-o", tmp_path / "seen")
    unseen = run_process(archive, tmp_path / "unseen")
    assert code == unseen.returncode == 1
    assert "failed: 00/car-0001.txt" in shown.replace("\r\n", " ")
    assert "\x1b[" in shown  # the bar
    assert "3 ok, 1 failed" in shown
    assert "internal error" not in shown
    assert left(tmp_path / "seen") == left(tmp_path / "unseen")


def test_names_do_not_control_the_terminal(tmp_path):
    """In tables as well: other names than one's own stand in an archive."""
    odd = "\x1b[2J\x1b]0;title\x07\x9b31m"
    five_points(tmp_path / "archive" / f"{odd}.txt", 1)
    assert run(tmp_path / "archive", tmp_path / "results").returncode == 0
    sql = "--sql", "SELECT name FROM captures"
    for arguments in (
        (),
        sql,
        ("--csv", "-"),
        ("--json",),
        (*sql, "--json"),
        ("--slow", "1", "--json"),
    ):
        code, shown = at_a_terminal("results", tmp_path / "results", *arguments)
        assert code == 0
        assert (r"\u009b31m" if "--json" in arguments else r"\x1b[2J") in shown, arguments
        assert not {"\x1b", "\x07", "\x9b"} & set(shown), arguments
