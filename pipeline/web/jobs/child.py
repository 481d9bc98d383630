"""Measuring process of the page: reads a plan, sends its progress, writes results.

`process.py` is the other end. A file that makes a library crash ends this process, not the server.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any, TextIO

from ...errors import InputError, WheelplaneError
from ...readers import confine, die_with

TASKS = {
    "measure": "content.measuring:measure",
    "open": "content.opening:open_measurement",
    "explain": "content.explaining:explain",
    "compare": "content.comparing:compare",
    "report": "content.reporting:report",
    "table": "content.calibration_files:read_table",
}


def main() -> None:
    """Run the plan on standard input; every line of standard output is one JSON object."""
    messages = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # output of libraries goes to the log
    plan = json.load(sys.stdin)
    die_with(plan["parent"])
    try:
        _run(plan, messages)
        send(messages, "done", True)
    except WheelplaneError as error:
        from ..files.excerpt import failure

        source = Path(plan["source"]) if "source" in plan else None
        refused = {"refused": True} if isinstance(error, InputError) else {}
        send(messages, "failure", failure(str(error), source) | refused)
    except MemoryError:
        text = "the measurement exceeds its memory limit: thin the scans"
        send(messages, "failure", {"text": text})
    except Exception as error:
        traceback.print_exc()
        text = f"internal error ({type(error).__name__}: {error}): please report it"
        send(messages, "failure", {"text": text})


def _run(plan: dict[str, Any], messages: TextIO) -> None:
    """Import the task first, so that the memory limit excludes the libraries."""
    module, name = TASKS[plan["task"]].split(":")
    task = getattr(importlib.import_module(f"..{module}", __package__), name)
    confine(plan["memory_bytes"])
    task(plan, lambda kind, content: send(messages, kind, content))


def send(stream: TextIO, kind: str, content: object) -> None:
    """Send one message."""
    print(json.dumps({kind: content}), file=stream, flush=True)


if __name__ == "__main__":
    main()
