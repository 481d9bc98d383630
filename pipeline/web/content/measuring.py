"""Capture or five-point file -> all that the page shows of it, as files in the job's folder."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from ...capture import (
    Capture,
    CaptureOptions,
    files_of,
    find_capture_file,
    open_capture,
    read_capture_file,
)
from ...config import Config, load_config, load_station, with_scanner
from ...errors import InputError
from ...files import lies_in
from ...five_point import Station, measure_five_point, read_five_point
from ...measure import measure_capture
from ...measurement import Conformity, Measurement, assess, by_kind, stated, tolerance_for
from ...report.format.language import LANGUAGES, load_translations
from ...report.format.view import PAPER
from ...report.json.measurement import to_json
from ...report.json.stored import RECORD
from ...report.scene.scene import scene
from ...system import give_way
from ..files.stored import PICKLE, store
from .choices import reading_of
from .panel import drawings, panel
from .points import stamps, write_points

Send = Callable[[str, object], None]  # kind and content of a message to the server


def measure(plan: dict[str, Any], send: Send) -> None:
    """Measure the source of the plan; write results first, then the points of the 3D view.

    The current folder becomes plan["base"], so that messages name files as the user does; only
    files in plan["allowed"] are read.
    """
    out, allowed = Path(plan["out"]), Path(plan["allowed"])
    os.chdir(plan["base"])
    source, options = Path(plan["source"]), plan["options"]
    with ExitStack() as stack:
        capture, measured = None, {}
        if plan["kind"] != "five-point":
            capture = stack.enter_context(opened(source, options, allowed))
        model = None if capture is None else capture.vehicle_model
        tolerance = options.get("tolerance")
        limits = tolerance_for(tolerance, model, str(source)) if tolerance else None
        if capture is None:
            measurement = _five_point(source, options)
        else:
            measured = stamps(capture)
            measurement = measure_capture(
                capture,
                config_of(capture, plan),
                steps(capture, send),
                vertical=options.get("vertical", "wheels"),
            )
        write_results(measurement, assess(measurement, limits) if limits else None, out)
        send("about", about(measurement))
        send("ready", True)
        if capture is not None:
            give_way()  # the next measurement goes before these points
            room = plan["tree_bytes"]
            write_points(capture, measurement, out, measured, room, percentages(send))


def write_results(measurement: Measurement, conformity: Conformity | None, out: Path) -> None:
    """Write measurement.json, panel, scene and drawings in each language, and a pickle."""
    (out / RECORD).write_text(to_json(measurement, conformity), encoding="utf-8")
    known, number = by_kind(stated(measurement), PAPER.axis), itertools.count()
    for language in LANGUAGES:
        words = load_translations(language)
        shown = panel(measurement, conformity, words)
        for wheel, result in zip(shown["wheels"], measurement.wheels, strict=True):
            wheel["drawings"] = []
            for drawing in drawings(measurement, result, known, words):
                name = f"drawing-{language}-{next(number)}.svg"
                (out / name).write_text(drawing.svg, encoding="utf-8")
                wheel["drawings"].append({"file": name, "title": drawing.title})
        _write_json(out / f"panel-{language}.json", shown)
        _write_json(out / f"scene-{language}.json", scene(measurement, conformity, words))
    store((measurement, conformity), out / PICKLE)


def about(measurement: Measurement) -> dict[str, str]:
    """Return the vehicle and the date of a measurement, '' where they are not stated."""
    made = measurement.provenance
    return {"vehicle": made.vehicle or "", "date": made.date or ""}


def check_inside(source: Path, allowed: Path) -> None:
    """Raise InputError if the capture at `source` names files outside the folder `allowed`."""
    folder = source if source.is_dir() else source.parent
    declared_in = find_capture_file(folder) if source.is_dir() else None
    if declared_in is None:
        return
    _check_path(declared_in, declared_in.name, source, allowed)
    for name in files_of(read_capture_file(declared_in, f"{source}: capture.toml")):
        _check_path(folder / name, name, source, allowed)


def _check_path(path: Path, name: str, source: Path, allowed: Path) -> None:
    if not lies_in(path, allowed):
        raise InputError(
            f"{source}: {name!r} is outside the allowed folder: move it into the capture"
        )


@contextmanager
def opened(source: Path, options: dict[str, Any], allowed: Path) -> Iterator[Capture]:
    """Open the capture at `source` with the page's options; all its files must be in `allowed`."""
    check_inside(source, allowed)
    keys = ("length_unit", "front", "front_point", "up", "hints", "regions")
    overrides = CaptureOptions(
        reading=reading_of(options),
        **{key: options[key] for key in keys if options.get(key) is not None},
    )
    with open_capture(source, options.get("target"), overrides) as capture:
        for entry in (*capture.entries, *filter(None, [capture.cloud])):
            if not entry.path.is_absolute():  # absolute: from an archive, which was checked
                _check_path(entry.path, entry.file, source, allowed)
        yield capture


def steps(capture: Capture, send: Send) -> Callable[[str], None]:
    """Return what sends the progress of a capture, called with the name of each step."""
    done = itertools.count()
    return lambda name: send("progress", [next(done), capture.steps, name])


def percentages(send: Send) -> Callable[[float], None]:
    """Return what sends the progress of the points, called with the share that is done."""
    sent = -1

    def send_share(share: float) -> None:
        nonlocal sent
        if int(100.0 * share) > sent:
            sent = int(100.0 * share)
            send("progress", [sent, 100, "points"])

    return send_share


def config_of(capture: Capture, plan: dict[str, Any]) -> Config:
    """Return the settings of the page, with the scanner chosen or declared."""
    stated = Path(plan["config"]) if plan["config"] else None
    return with_scanner(load_config(stated), plan["options"].get("scanner") or capture.scanner)


def _five_point(source: Path, options: dict[str, Any]) -> Measurement:
    if options.get("vertical", "wheels") != "wheels":
        raise InputError(
            f"{source}: five points show neither floor nor gravity: measure camber from the plane "
            "of the wheel centres, or a capture of scans (--vertical)"
        )
    keys = ("length_unit", "coordinates", "angle_unit", "azimuth")
    given = {key: options[key] for key in keys if options.get(key) is not None}
    points = read_five_point(source, **given)
    station = None
    if options.get("station") is not None:
        import numpy as np

        station = Station(load_station(options["station"]), np.zeros(3))
    return measure_five_point(points, station)


def _write_json(path: Path, tree: object) -> None:
    path.write_text(json.dumps(tree, ensure_ascii=False, allow_nan=False), encoding="utf-8")
