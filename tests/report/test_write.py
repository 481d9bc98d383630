"""Files are written whole or not at all; what is no regular file is never replaced."""

from __future__ import annotations

import os
import stat
import threading

import pytest

from wheelplane.errors import InputError
from wheelplane.report.write import write_whole


def test_a_pipe_is_written_to_and_stays(tmp_path):
    """So that a report to /dev/stdout or /dev/null leaves the device as it was."""
    pipe, link, read = tmp_path / "pipe", tmp_path / "link", []
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    for path in (pipe, link):
        reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
        reader.start()
        write_whole(path, b"a report")
        reader.join()
    assert read == [b"a report"] * 2
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert sorted(tmp_path.iterdir()) == [link, pipe]


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "report"
    write_whole(path, b"old")

    def fail(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(InputError, match="report: cannot be written"):
        write_whole(path, b"new")
    assert [path.read_bytes(), list(tmp_path.iterdir())] == [b"old", [path]]


def test_a_folder_in_place_of_the_file_is_one_line(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path, b"a report")
