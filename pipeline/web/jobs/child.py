"""The process that measures for the page: it reads a plan, says where it stands, writes results.

`jobs.py` is the other side. A file that makes a library crash ends this process, not the page.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any, TextIO

from ...errors import WheelplaneError
from ...readers import confine, die_with

TASKS = {
    "measure": "content.measuring:measure",
    "compare": "content.comparing:compare",
    "report": "content.reporting:report",
}


def main() -> None:
    """Do what standard input says; every line of standard output is one JSON object."""
    said = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a library prints is no message
    plan = json.load(sys.stdin)
    die_with(plan["parent"])
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[variable] = "1"  # same bytes at any number of cores
    try:
        _do(plan, said)
        say(said, "done", True)
    except WheelplaneError as error:
        from ..files.excerpt import failure

        source = Path(plan["source"]) if "source" in plan else None
        say(said, "failure", failure(str(error), source))
    except MemoryError:
        text = "the measurement needs more memory than it may have: thin the scans"
        say(said, "failure", {"text": text})
    except Exception as error:
        traceback.print_exc()
        text = f"the program has a fault here ({type(error).__name__}: {error}): please report it"
        say(said, "failure", {"text": text})


def _do(plan: dict[str, Any], said: TextIO) -> None:
    """Import the task first, so that memory counts from what the libraries hold."""
    module, name = TASKS[plan["task"]].split(":")
    task = getattr(importlib.import_module(f"..{module}", __package__), name)
    confine(plan["memory_bytes"])
    task(plan, lambda kind, what: say(said, kind, what))


def say(stream: TextIO, kind: str, what: object) -> None:
    """One message."""
    print(json.dumps({kind: what}), file=stream, flush=True)


if __name__ == "__main__":
    main()
