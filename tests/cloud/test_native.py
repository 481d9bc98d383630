"""numba and OpenCV take nothing from the current folder, and leave nothing that others take."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.paths import ROOT
from wheelplane.cloud.native import load_numba, load_opencv

FIRST = """
import sys
for name in {loaded!r}:
    __import__(name)
from wheelplane.cloud import compiled
print(compiled.coordinate_hash(1.0, 2.0, 3.0))
"""


@pytest.mark.parametrize("loaded", [[], ["yaml"], ["numba"]])
def test_machine_code_comes_from_no_folder_that_a_file_here_names(tmp_path, loaded):
    """As scans of others may bring along; whatever the program had imported before."""
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: mine\ndisable_jit: true\n")
    run = subprocess.run(
        [sys.executable, "-P", "-W", "error", "-c", FIRST.format(loaded=loaded)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT / ".ci" / "editable")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip().isdecimal()
    assert [path.name for path in tmp_path.iterdir()] == [".numba_config.yaml"]


def test_numba_keeps_the_settings_of_the_environment(monkeypatch, tmp_path):
    config = load_numba().core.config
    with monkeypatch.context() as patch:
        patch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
        config.reload_config()
        assert str(tmp_path) == config.CACHE_DIR
    config.reload_config()
    assert str(tmp_path) != config.CACHE_DIR


@pytest.mark.parametrize("before", [None, "", "/opt/lib"])
def test_programs_started_later_load_no_library_from_the_current_folder(before):
    code = (
        "import os\n"
        f"before = {before!r}\n"
        "os.environ.pop('LD_LIBRARY_PATH', None)\n"
        "if before is not None: os.environ['LD_LIBRARY_PATH'] = before\n"
        "from wheelplane.cloud import load_opencv\n"
        "cv2 = load_opencv()\n"
        "assert cv2.blur is not None\n"
        "assert os.environ.get('LD_LIBRARY_PATH') == before, os.environ['LD_LIBRARY_PATH']\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT / ".ci" / "editable")}
    subprocess.run([sys.executable, "-P", "-c", code], env=environment, check=True)
    assert load_opencv() is load_opencv()
