"""Dense scans compared with a trusted method: five points, virtual ones, or the truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..capture import Capture
from ..config import Config
from ..errors import InputError
from ..measure import measure_capture
from ..measurement import Measurement, WheelResult
from ..vehicle import REFERENCE_WHEELS
from .comparison import ComparedMethod, Comparison, check_alike, compare
from .five_point import FivePoints, measure_points, note_of_aiming, with_aiming
from .request import (
    COMPARED,
    DENSE,
    Request,
    RequestPart,
    as_method,
    comparable,
    folder_of,
    from_wheel_centres,
    measured,
    note_of_plates,
    of_faces,
    why_missing,
    without_vertical,
)
from .tcgc_2013 import LABEL as OLD
from .tcgc_2013 import by_old_estimator
from .truth import read_truth
from .virtual_five_point import compare_virtual

FIVE = "five points"
ValidationProgress = Callable[[str], None]


def validate_capture(
    capture: Capture,
    config: Config,
    request: Request,
    progress: ValidationProgress = lambda _: None,
) -> Comparison:
    """Compare both methods on one capture. Raises InputError where that is impossible."""
    found = _COMPARE[request.against](capture, config, request, progress)
    return replace(
        found, to_detect_rad=request.to_detect_rad, vehicle=capture.vehicle or capture.source
    )


def _with_five_points(
    capture: Capture, config: Config, request: Request, progress: ValidationProgress
) -> Comparison:
    points = _points(capture, request)
    dense = measure_capture(capture, config, progress)
    return compare_with_points(dense, points, request)


def compare_with_points(dense: Measurement, points: FivePoints, request: Request) -> Comparison:
    """Compare the targets of a measurement from scans with five points, by the request's options.

    Raises InputError where the two cannot be of one vehicle.
    """
    part, results = _in_both(measured(of_faces(dense)), points)
    first, said = as_method(DENSE, part.results), dense.notes
    if dense.vertical is not None:
        first, said = from_wheel_centres(first, part.wheels), without_vertical(said)
    second, notes = _second(points, results, request)
    check_alike(first, second, points.file.source, request.points.units)
    return compare(
        dense.provenance.source,
        part.names,
        part.wheels,
        first,
        second,
        part.missing,
        (*said, *note_of_plates(dense), *notes),
        (dense.provenance, points.measurement.provenance),
    )


def _with_truth(
    capture: Capture, config: Config, request: Request, progress: ValidationProgress
) -> Comparison:
    if request.file is None:
        measurement = measure_capture(capture, config, progress)
        part = measured(measurement)
        names = part.names
        first, notes = as_method(DENSE, part.results), measurement.notes
    else:
        points = _points(capture, request)
        measurement = points.measurement
        part = measured(measurement)
        names = tuple(points.name_of(result) for result in part.results)
        first, notes = _second(points, part.results, request)
    truth = read_truth(folder_of(capture) / "truth.json", f"{capture.source}: truth.json", names)
    origins = (measurement.provenance,)
    return compare(capture.source, names, part.wheels, first, truth, part.missing, notes, origins)


_COMPARE = {"five-point": _with_five_points, "truth": _with_truth, "virtual": compare_virtual}


def _points(capture: Capture, request: Request) -> FivePoints:
    """Read and measure the five-point file, relative to the capture's folder."""
    assert request.file is not None
    path = folder_of(capture) / request.file
    whole = REFERENCE_WHEELS if capture.cloud else ()
    scans = [*whole, *(entry.name for entry in capture.entries if entry.role in COMPARED)]
    name = str(request.file) if request.file.is_absolute() else f"{capture.source}: {request.file}"
    return measure_points(path, name, scans, request.points)


def _in_both(part: RequestPart, points: FivePoints) -> tuple[RequestPart, list[WheelResult]]:
    """Select what both measured; return also the five points' results in the scans' order."""
    by_name = {points.name_of(result): result for result in points.measurement.wheels}
    missing = list(part.missing)
    kept, results = [], []
    for result in part.results:
        name = result.observation.name
        other = by_name.get(name)
        if other is None:
            missing.append((name, "no block of five points is named for it"))
            continue
        if other.angles is None:
            missing.append((name, f"five points: {why_missing(other)}"))
        if not comparable(other):
            continue
        if other.wheel != result.wheel:
            raise InputError(
                f"{points.file.source}: the block for scan {name} is at {other.wheel}, the scan "
                f"at {result.wheel}: name the scan of each block with --blocks"
            )
        kept.append(result)
        results.append(other)
    return RequestPart(tuple(kept), tuple(missing)), results


def _second(
    points: FivePoints, results: Sequence[WheelResult], request: Request
) -> tuple[ComparedMethod, tuple[str, ...]]:
    """Return the five points as a method, and notes on them."""
    options = request.points
    found = as_method(FIVE, results)
    targets = tuple(with_aiming(target, options) for target in found.targets)
    blocks = points.file.blocks_m
    plausible = [wheel.angles is not None for wheel in points.measurement.wheels]
    notes = (*points.measurement.notes, *note_of_aiming(blocks[plausible], options))
    method = replace(found, targets=targets)
    if options.method != OLD:
        return method, notes
    rows = [int(np.flatnonzero([r is w for w in points.measurement.wheels])[0]) for r in results]
    old, note = by_old_estimator(method, blocks[rows], [str(r.wheel) for r in results])
    return old, (*notes, note)
