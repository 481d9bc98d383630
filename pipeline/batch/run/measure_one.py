"""One capture to its result, measured or failed: the same bytes wherever it is worked on."""

from __future__ import annotations

import json
import re
import tempfile
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ... import __version__
from ...capture import open_capture
from ...config import with_scanner
from ...errors import WheelplaneError
from ...five_point import read_five_point
from ...measure import measure_capture, measure_five_point
from ...measurement import Measurement
from ...report.json.measurement import SCHEMA, to_tree
from ..plan.discover import Kind
from ..plan.settings import Settings
from ..storage.entry import legible
from .stages import causes, passing, stage_of


@dataclass(frozen=True)
class Subject:
    """A capture that is at hand at `source` and is called `name`, and how to measure it.

    key, inputs: of its identity, where it has one.
    """

    source: Path
    name: str
    kind: Kind
    settings: Settings
    key: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """What became of a capture: ok, part, failed or quarantined; of the last two, where and why."""

    status: str
    stage: str = ""
    reason: str = ""


@dataclass(frozen=True)
class Result:
    """A capture's JSON, what became of it, and of a failure the whole story."""

    data: bytes
    verdict: Verdict
    log: str = ""


class PassingError(Exception):
    """A fault of the machine or the storage, not of the capture: another try may succeed."""


def measure_bytes(subject: Subject) -> Result:
    """Measure a capture, or say in the same schema why that failed.

    Raises PassingError and MemoryError, which are no facts of the capture, and nothing else.
    """
    try:
        measurement = _measure(subject)
        verdict = Verdict("ok" if measurement.complete else "part")
        tree = to_tree(measurement)
        tree["batch"] = _batch(subject, verdict, tree["date"])
        return Result(_bytes(tree, subject), verdict)
    except Exception as error:
        if any(isinstance(cause, MemoryError) for cause in causes(error)):
            raise MemoryError from error
        fault = passing(error)
        if fault is not None:
            raise PassingError(f"{fault.filename or subject.name}: {fault.strerror}") from error
        reason = str(error)
        if not isinstance(error, WheelplaneError):
            reason = f"a fault of the program ({type(error).__name__}: {reason}): report it"
        log = "".join(traceback.format_exception(error))
        return failed(subject, Verdict("failed", stage_of(error), reason), log)


def failed(subject: Subject, verdict: Verdict, log: str) -> Result:
    """The result of a capture that could not be measured."""
    reason = _without_paths(" ".join(verdict.reason.split()), subject)
    verdict = replace(verdict, reason=reason)
    tree: dict[str, Any] = {
        "schema": SCHEMA,
        "capture": subject.name,
        "vehicle_name": None,
        "date": None,
        "wheels": [],
        "frame": None,
        "vehicle": {},
        "notes": [],
        "provenance": {
            "version": __version__,
            "inputs": dict(subject.inputs),
            "config": subject.settings.effective(subject.kind),
            "seed": subject.settings.config.seed,
        },
        "batch": _batch(subject, verdict, None),
    }
    return Result(_bytes(tree, subject), verdict, log)


def _measure(subject: Subject) -> Measurement:
    settings = subject.settings
    if subject.kind == "five-point":
        points = read_five_point(
            subject.source,
            name=subject.name,
            length_unit=settings.told.length_unit or "m",
            coordinates=settings.coordinates,
            angle_unit=settings.angle_unit,
            azimuth=settings.azimuth,
        )
        return measure_five_point(points, settings.station)
    with open_capture(subject.source, settings.target, settings.told) as opened:
        named = None if settings.scanner else opened.scanner
        measurement = measure_capture(opened, with_scanner(settings.config, named))
    return replace(measurement, provenance=replace(measurement.provenance, source=subject.name))


def _batch(subject: Subject, verdict: Verdict, date: str | None) -> dict[str, Any]:
    return {
        "key": subject.key,
        "kind": subject.kind,
        "date": date or subject.settings.date_of(subject.name),
        "status": verdict.status,
        "stage": verdict.stage,
        "reason": verdict.reason,
        "config_sha256": subject.settings.digest(subject.kind),
    }


def _bytes(tree: dict[str, Any], subject: Subject) -> bytes:
    """A line for each top-level key, which is both small and legible."""
    form: dict[str, Any] = {"ensure_ascii": False, "allow_nan": False, "separators": (",", ":")}
    lines = [f'"{key}":{json.dumps(value, **form)}' for key, value in tree.items()]
    text = "{" + ",\n".join(lines) + "}\n"
    told = _without_paths(text, subject, lambda path: json.dumps(path, ensure_ascii=False)[1:-1])
    return legible(told, r"\\x").encode(errors="backslashreplace")


def _without_paths(text: str, subject: Subject, written: Callable[[str], str] = str) -> str:
    """The text, in which nothing tells where the capture, or its unpacked copy, lay.

    written: how a path stands in it.
    """
    for path in (str(subject.source), str(WheelplaneError(str(subject.source)))):
        text = text.replace(written(path), written(subject.name))
    return re.sub(re.escape(tempfile.gettempdir()) + r"/wheelplane-\w+/(capture/)?", "", text)
