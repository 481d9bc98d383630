"""Put on PYTHONPATH, this makes captures of certain names kill the process that measures them."""

import ctypes
import importlib.abc
import importlib.machinery
import os
import sys
import time
from pathlib import Path

POISONED = "wheelplane.batch.run.measure_one"


def poison(measure):
    """What `measure` does, unless the capture's name holds one of these words."""

    def poisoned(subject):
        name = subject.name
        if "crash" in name:
            ctypes.string_at(0)
        if "hang" in name:
            time.sleep(1e6)
        if "greedy" in name:
            held = []
            while True:
                held.append(bytearray(16 << 20))
        if "once" in name:
            mark = Path(os.environ["WHEELPLANE_POISON_MARKS"]) / name.replace("/", "-")
            if not mark.exists():
                mark.touch()
                ctypes.string_at(0)
        return measure(subject)

    return poisoned


class Finder(importlib.abc.MetaPathFinder):
    """Finds the one module as ever, and changes it once it is loaded."""

    def find_spec(self, name, path, target=None):
        if name != POISONED:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        execute = spec.loader.exec_module

        def exec_module(module):
            execute(module)
            module._measure = poison(module._measure)

        spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, Finder())
