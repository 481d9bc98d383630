"""OpenCV, imported so that nothing is loaded from the current folder."""

from __future__ import annotations

import importlib
import os
from functools import lru_cache
from typing import Any

LIBRARIES = "LD_LIBRARY_PATH"


@lru_cache(maxsize=1)
def load_opencv() -> Any:
    """Import OpenCV, which leaves an empty entry, the current folder, in LD_LIBRARY_PATH.

    Every program that is started later would load its libraries from there: the old value is put
    back.
    """
    before = {LIBRARIES: os.environ[LIBRARIES]} if LIBRARIES in os.environ else {}
    cv2 = importlib.import_module("cv2")
    os.environ.pop(LIBRARIES, None)
    os.environ.update(before)
    return cv2
