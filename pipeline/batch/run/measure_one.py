"""One capture -> its result, measured or failed: the same bytes on any machine."""

from __future__ import annotations

import json
import re
import tempfile
import traceback
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from ... import __version__
from ...calibration import Reference, calibrate_file, load_item
from ...capture import Capture, check_inside, open_capture
from ...config import with_scanner
from ...errors import WheelplaneError
from ...five_point import measure_five_point, read_five_point
from ...measure import measure_capture
from ...measurement import Measurement
from ...report.json.calibration import SCHEMA as CALIBRATION_SCHEMA
from ...report.json.calibration import calibration_tree
from ...report.json.measurement import SCHEMA, to_tree
from ...system import frozen, stage
from ..plan.discover import Kind
from ..plan.machine_files import has_machine, in_words, machine_files
from ..plan.settings import BatchSettings
from ..storage.entry import legible
from .stages import error_chain, stage_of, transient_fault


@frozen
class Subject:
    """Capture called `name`, whose local copy is at `source`, and how to measure it.

    key, inputs: those of its identity, if it has one. archive: folder that all its files must lie
    in; None for no limit.
    """

    source: Path
    name: str
    kind: Kind
    settings: BatchSettings
    key: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    archive: Path | None = None


@frozen
class Outcome:
    """Status of a capture (ok, part, failed, quarantined), with stage and reason of a failure.

    reason: of one that was measured, the notes that put it in doubt.
    """

    status: str
    stage: str = ""
    reason: str = ""


@frozen
class Result:
    """JSON of a capture, its outcome, and the log of a failure.

    tree: the same as plain data; None where paths in its text were replaced.
    """

    data: bytes
    outcome: Outcome
    log: str = ""
    tree: dict[str, Any] | None = None


class TransientError(Exception):
    """Fault of the machine or the storage, not of the capture: another try may succeed."""


class EngineLostError(TransientError):
    """Engine that lost its tasks, and takes them again when it is back."""


def measure_bytes(subject: Subject) -> Result:
    """Measure a capture, or return the reason of its failure in the same schema.

    Raises TransientError and MemoryError, which are not due to the capture, and nothing else.
    """
    try:
        measurement, calibration = _measure(subject)
        status = "ok" if measurement.complete else "part"
        outcome = Outcome(status, reason=" ".join(measurement.doubts))
        return _report(measurement, calibration, outcome, subject)
    except Exception as error:
        _raise_foreign(error, subject)
        log = "".join(traceback.format_exception(error))
        return failed(subject, Outcome("failed", stage_of(error), _reason(error)), log)


@stage("report")
def _report(
    measurement: Measurement,
    calibration: dict[str, Any] | None,
    outcome: Outcome,
    subject: Subject,
) -> Result:
    tree = to_tree(measurement)
    tree["batch"] = _batch(subject, outcome, tree["date"])
    if calibration is not None:
        tree["calibration"] = calibration | {"date": tree["batch"]["date"]}
    return _result(tree, subject, outcome)


def _raise_foreign(error: Exception, subject: Subject) -> None:
    """Raise TransientError or MemoryError for an error that is not due to the capture."""
    if any(isinstance(cause, MemoryError) for cause in error_chain(error)):
        raise MemoryError from error
    fault = transient_fault(error)
    if fault is not None:
        raise TransientError(f"{fault.filename or subject.name}: {fault.strerror}") from error


def _reason(error: Exception) -> str:
    if isinstance(error, WheelplaneError):
        return str(error)
    return f"internal error ({type(error).__name__}: {error}): please report it"


def failed(subject: Subject, outcome: Outcome, log: str) -> Result:
    """Return the result of a capture that could not be measured."""
    reason = _without_paths(" ".join(outcome.reason.split()), subject)
    outcome = replace(outcome, reason=reason)
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
        "batch": _batch(subject, outcome, None),
    }
    return _result(tree, subject, outcome, log)


def _measure(subject: Subject) -> tuple[Measurement, dict[str, Any] | None]:
    """Return a capture's measurement, and the calibration by a machine's files beside its scans."""
    settings = subject.settings
    if subject.kind == "five-point":
        check_inside(subject.archive, subject.source, subject.source.name, str(subject.source))
        points = read_five_point(
            subject.source,
            name=subject.name,
            length_unit=settings.options.length_unit or "m",
            coordinates=settings.coordinates,
            angle_unit=settings.angle_unit,
            azimuth=settings.azimuth,
        )
        return measure_five_point(points, settings.station, settings.radius_m), None
    with open_capture(subject.source, settings.target, settings.options, subject.archive) as opened:
        named = None if settings.scanner else opened.scanner
        config = with_scanner(settings.config, named)
        measurement = measure_capture(opened, config, vertical=settings.vertical, mapped=False)
        origin = replace(measurement.provenance, source=subject.name)
        measurement = replace(measurement, provenance=origin)
        return measurement, _calibration(measurement, opened, subject)


def _calibration(
    measurement: Measurement, opened: Capture, subject: Subject
) -> dict[str, Any] | None:
    """Return the calibration by the machine's files in the capture's folder, as plain data.

    None without such files; with an "error" in the place of results where they cannot be used.
    """
    item, folder = None, opened.folder
    if subject.kind == "cloud" or not has_machine(folder):
        return None
    try:
        item_path, readings_path = machine_files(folder, opened.within)
        item_file = load_item(item_path)
        item = {"serial": item_file.item.serial}
        return calibration_tree(calibrate_file([Reference(measurement)], item_file, readings_path))
    except Exception as error:
        _raise_foreign(error, subject)
        known = isinstance(error, WheelplaneError)
        reason = in_words(error, folder) if known else _reason(error)
        return {"schema": CALIBRATION_SCHEMA, "item": item, "error": reason}


def _batch(subject: Subject, outcome: Outcome, date: str | None) -> dict[str, Any]:
    return {
        "key": subject.key,
        "kind": subject.kind,
        "date": date or subject.settings.date_of(subject.name),
        "status": outcome.status,
        "stage": outcome.stage,
        "reason": outcome.reason,
        "config_sha256": subject.settings.digest(subject.kind),
    }


def _result(tree: dict[str, Any], subject: Subject, outcome: Outcome, log: str = "") -> Result:
    """Serialise with one line for each top-level key."""
    form: dict[str, Any] = {"ensure_ascii": False, "allow_nan": False, "separators": (",", ":")}
    lines = [f'"{key}":{json.dumps(value, **form)}' for key, value in tree.items()]
    whole = "{" + ",\n".join(lines) + "}\n"
    text = _without_paths(whole, subject, lambda path: json.dumps(path, ensure_ascii=False)[1:-1])
    data = legible(text, r"\\x").encode(errors="backslashreplace")
    return Result(data, outcome, log, tree if data == whole.encode(errors="replace") else None)


def _without_paths(text: str, subject: Subject, written: Callable[[str], str] = str) -> str:
    """Replace the paths of the capture and its unpacked copy in a text by the capture's name.

    written: escapes a path as in the text.
    """
    for path in (str(subject.source), str(WheelplaneError(str(subject.source)))):
        text = text.replace(written(path), written(subject.name))
    return re.sub(re.escape(tempfile.gettempdir()) + r"/wheelplane-\w+/(capture/)?", "", text)
