"""OpenCV leaves nothing by which later programs load from the current folder."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.paths import ROOT
from wheelplane.cloud.native import load_opencv


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
