"""Capture that could not be measured -> candidates and pictures, as files in the job's folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...explanation import explain_capture
from ...report.explanation import write_explanation
from ...report.format.language import load_translations
from .measuring import Send, config_of, opened, steps


def explain(plan: dict[str, Any], send: Send) -> None:
    """Explain the source of the plan, which is that of its measurement."""
    os.chdir(plan["base"])
    if plan["kind"] == "five-point":
        raise InputError(f"{plan['source']}: five points have no candidates: see the line above")
    with opened(Path(plan["source"]), plan["options"], Path(plan["allowed"])) as capture:
        found = explain_capture(capture, config_of(capture, plan), steps(capture, send))
    write_explanation(found, Path(plan["out"]), load_translations(plan["language"]))
