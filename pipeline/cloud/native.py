"""numba and OpenCV, imported so that nothing is run or loaded from the current folder."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from functools import lru_cache
from typing import Any

LIBRARIES = "LD_LIBRARY_PATH"


@lru_cache(maxsize=1)
def load_numba() -> Any:
    """Import numba, which then reads no settings from the file `.numba_config.yaml`.

    Its key `cache_dir` names a folder of machine code that numba would run.
    """
    modules: dict[str, Any] = sys.modules
    yaml = {"yaml": modules["yaml"]} if "yaml" in modules else {}
    modules["yaml"] = None  # without which numba leaves the file alone
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            numba: Any = importlib.import_module("numba")
    finally:
        del modules["yaml"]
        modules.update(yaml)
    numba.core.config._config_fname = ""  # names no file: later, too, none is read
    numba.core.config.reload_config()
    return numba


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
