"""Files mapped into memory: what is mapped stays as it is, and a writer waits until it is freed."""

from __future__ import annotations

import errno
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from tests.support.leases import are_given
from wheelplane.system import mapping

WRITER = "import sys; open(sys.argv[1], 'wb').write(b'new')"
WAITS_S = 0.3
lending = pytest.mark.skipif(not are_given(), reason="no leases on this system")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "scan"
    path.write_bytes(b"points")
    return path


@lending
def test_a_writer_waits_until_a_mapped_file_is_freed(file):
    with file.open("rb") as stream:
        content = mapping.lent(stream)
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(file)])
    time.sleep(WAITS_S)
    assert writer.poll() is None
    assert content[:] == b"points"
    content.close()
    assert writer.wait(10) == 0
    assert file.read_bytes() == b"new"


@lending
def test_a_file_that_is_open_for_writing_is_not_lent(file):
    with file.open("rb+"), file.open("rb") as stream:
        assert mapping.lent(stream) is None


def no_leases(*_):
    raise OSError(errno.EINVAL, "Invalid argument")


@pytest.mark.parametrize(
    "fcntl", [None, SimpleNamespace(), SimpleNamespace(F_SETLEASE=0, F_SETSIG=0, fcntl=no_leases)]
)
def test_without_leases_no_file_is_lent(file, monkeypatch, fcntl):
    monkeypatch.setattr(mapping, "fcntl", fcntl)
    with file.open("rb") as stream:
        assert mapping.lent(stream) is None
