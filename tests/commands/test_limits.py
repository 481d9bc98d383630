"""Limits of memory and time, and signals: one line that says what lifts it; nothing is left."""

from __future__ import annotations

import gzip
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from wheelplane.commands.shared.limits import within
from wheelplane.errors import InputError


@pytest.fixture
def large(tmp_path):
    """A text of 40 million points, packed to 1 MB, which takes long to read."""
    path = tmp_path / "large.xyz.gz"
    path.write_bytes(gzip.compress(b"1 2 3\n" * 1_000_000, mtime=0) * 40)
    (tmp_path / "capture.toml").write_text(
        'target = "disc-250"\ncloud = "large.xyz.gz"\nfront = [1.0, 0.0, 0.0]\n'
    )
    return path


@pytest.mark.parametrize(
    ("option", "fact"),
    [
        (("--timeout", "2"), "it takes more than 2 s: allow more by --timeout"),
        (("--memory", "300M"), "allow more by --memory"),
    ],
)
def test_a_limit_is_told_with_the_option_that_lifts_it(large, option, fact):
    process, scratch = start(large.parent, "measure", ".", *option)
    _, text = process.communicate(timeout=120)
    assert (process.returncode, text.count("\n")) == (2, 1), text
    assert fact in text
    assert list(scratch.iterdir()) == []


def test_inspect_needs_little_memory_and_ends_in_time(large):
    process, scratch = start(large.parent, "inspect", large.name, "--memory", "100M", "--timeout=3")
    _, text = process.communicate(timeout=120)
    assert (process.returncode, text) == (
        2, "wheelplane: it takes more than 3 s: allow more by --timeout\n",
    )  # fmt: skip
    assert list(scratch.iterdir()) == []


@pytest.mark.parametrize("command", [("measure", "."), ("inspect", "large.xyz.gz")])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_leaves_nothing_behind(large, command, number):
    process, scratch = start(large.parent, *command)
    while not any(path.stat().st_size for path in scratch.rglob("*.xyz")):
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(0.5)
    process.send_signal(number)
    _, text = process.communicate(timeout=60)
    assert process.returncode == (2 if number == signal.SIGINT else 128 + number)
    assert text.strip().count("\n") == 0
    assert "nothing more was written" in text
    assert list(scratch.iterdir()) == []


def test_limits_hold_within_and_not_behind():
    before = resource.getrlimit(resource.RLIMIT_DATA), signal.getsignal(signal.SIGALRM)
    with within(60.0, "1G", "measure fewer points"):
        assert len(np.ones(1 << 20)) == 1 << 20
    too_much = r"more than 64 MB of memory: allow more by --memory, or try less at once"
    with pytest.raises(InputError, match=too_much), within(60.0, "64M", "try less"):
        np.ones(1 << 30)
    with pytest.raises(InputError, match=r"more than 0\.1 s"), within(0.1, None, "try less"):
        time.sleep(60.0)
    time.sleep(0.2)
    assert before == (resource.getrlimit(resource.RLIMIT_DATA), signal.getsignal(signal.SIGALRM))
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def start(folder, *arguments):
    """A command in the folder, and the folder of its temporary files."""
    scratch = folder / "scratch"
    scratch.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "wheelplane", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    return process, scratch
