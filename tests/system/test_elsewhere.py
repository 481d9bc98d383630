"""Without what Linux alone has, the same bytes are measured."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tests.support.batches import archive_of
from tests.support.made import write_small_capture
from tests.support.paths import FORMATS, ROOT

pytestmark = pytest.mark.slow

SYSTEMS = ["macos", "windows"]
READ = """
import hashlib, sys
from pathlib import Path
from wheelplane.readers import read_scan
for name in sys.argv[1:]:
    scan = read_scan(Path(name))
    print(len(scan.points_m), hashlib.sha256(scan.points_m.tobytes()).hexdigest())
"""
SCANS = [str(FORMATS / name) for name in ("A4.e57", "simple.laz", "autzen.pts")]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return write_small_capture(tmp_path_factory.mktemp("small") / "capture", trials=0)


def there(*arguments, system="", prefix=(), tmp=None):
    """Run Python on a system that lacks what `system` lacks; return what it prints."""
    path = [str(ROOT / "tests" / "elsewhere"), *filter(None, [os.environ.get("PYTHONPATH")])]
    stated = {"WHEELPLANE_ELSEWHERE": system, "PYTHONPATH": os.pathsep.join(path)}
    if tmp is not None:
        stated["TMPDIR"] = str(tmp)
    run = subprocess.run(
        [*prefix, sys.executable, *arguments],
        env=os.environ | stated,
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.mark.parametrize("system", SYSTEMS)
def test_what_is_hidden_is_hidden(system):
    code = "import os, select; print(hasattr(os, 'memfd_create'), hasattr(select, 'poll'))\n"
    assert there("-c", code) == "True True\n"
    assert there("-c", code, system=system) == f"False {system == 'macos'}\n"
    code = "open('/proc/self/statm')"
    with pytest.raises(AssertionError, match="No such file"):
        there("-c", code, system=system)


@pytest.mark.parametrize("system", SYSTEMS)
def test_measure_gives_the_same_bytes(small, tmp_path, system):
    command = ("-m", "wheelplane", "measure", str(small), "--json")
    assert there(*command, system=system, tmp=tmp_path) == there(*command)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("system", SYSTEMS)
def test_native_libraries_and_text_give_the_same_points(tmp_path, system):
    read = there("-c", READ, *SCANS, system=system, tmp=tmp_path)
    assert read == there("-c", READ, *SCANS)
    assert read.count("\n") == len(SCANS)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_batch_gives_the_same_files(tmp_path, system):
    archive, found = archive_of(tmp_path / "archive", 3), []
    scratch = Path(tempfile.mkdtemp(dir="/tmp"))  # short: in it is the fork server's socket
    for name in ("", system):
        results = tmp_path / f"results-{name}"
        command = ("-m", "wheelplane", "batch", str(archive), "-o", str(results))
        there(*command, system=name, tmp=scratch)
        found.append(
            {
                path.relative_to(results): path.read_bytes()
                for path in (*results.rglob("*.json"), results / "catalogue.sqlite")
                if path.parent.name not in ("state", "times")  # of the clock
            }
        )
    assert found[0] == found[1]
    assert len(found[0]) >= 4
    scratch.rmdir()  # since nothing is left in it


def test_measure_works_where_proc_is_not_mounted(small):
    hidden = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /proc && exec "$0" "$@"')
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([*hidden, "true"], capture_output=True).returncode:
        pytest.skip("unshare cannot hide /proc from this user")
    command = ("-m", "wheelplane", "measure", str(small), "--json")
    assert there(*command, prefix=hidden) == there(*command)
    assert there("-c", READ, *SCANS, prefix=hidden) == there("-c", READ, *SCANS)
    assert Path("/proc/self/statm").exists()
