"""Measurement of a vehicle from what a program holds."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import cast

from ..capture import Capture, CaptureOptions, ScanEntry, open_capture
from ..errors import InputError
from ..five_point import FivePointFile, measure_five_point
from ..measure import measure_capture
from ..measurement import VerticalKind
from ..units import LengthUnit
from ..vehicle import REFERENCE_WHEELS
from .alignment import Alignment
from .scans import Settings, TargetName, as_config, as_scan, as_targets, check_one_of, is_path

SOURCE = "points in memory"


def measure(
    scans: object,
    target: TargetName | None = None,
    *,
    length_unit: LengthUnit | None = None,
    scanner: str | None = None,
    config: Settings = None,
    vertical: VerticalKind = "wheels",
    vehicle: str | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Alignment:
    """Measure a vehicle: toe, camber and all else that its scans show, with uncertainties.

    scans: a mapping of RR, RL, FR, FL, and any trials by name, to scans: arrays (N, 3), clouds of
    Open3D or trimesh, or paths; or the path of a capture, an open Capture, or a five-point file
    that was read. Arrays are not changed. target: name, file or table (metres) of the target on
    each wheel, "disc-250,FL=wheel" where a wheel has another; a capture may state it. length_unit:
    of all coordinates, "m" by default. scanner: name or file of the scanner's uncertainties.
    config: settings, or their file. vertical: from which camber is measured. vehicle: its name in
    reports. progress: called with each scan's name.

    Raises InputError or ConfigError, one line that says what to do. A trial that cannot be measured
    stays in the result with its status.

        m = wp.measure({"RR": rr, "RL": rl, "FR": fr, "FL": fl}, target="disc-250")
        m.wheels["FL"].toe.deg, m.wheels["FL"].toe.U_deg
    """
    check_one_of(length_unit or "m", LengthUnit, "length_unit")
    check_one_of(vertical, VerticalKind, "vertical")
    if isinstance(scans, FivePointFile):
        return Alignment(measure_five_point(scans))
    if is_path(scans):
        path = Path(cast("str | os.PathLike[str]", scans))
        named = None if target is None else as_targets(target)
        with open_capture(path, named, CaptureOptions(length_unit)) as opened:
            return _measured(opened, scanner, config, vertical, progress)
    if isinstance(scans, Mapping):
        scans = _capture(scans, target, length_unit or "m", vehicle)
    if not isinstance(scans, Capture):
        fact = f"a {type(scans).__name__} is no set of scans"
        raise InputError(f"{fact}: give a mapping of RR, RL, FR, FL to scans, or a capture's path")
    return _measured(scans, scanner, config, vertical, progress)


def _measured(
    capture: Capture,
    scanner: str | None,
    config: Settings,
    vertical: VerticalKind,
    progress: Callable[[str], None],
) -> Alignment:
    settings = as_config(config, scanner or capture.scanner)
    return Alignment(measure_capture(capture, settings, progress, vertical=vertical))


def _capture(
    scans: Mapping[object, object],
    target: TargetName | None,
    length_unit: LengthUnit,
    vehicle: str | None,
) -> Capture:
    """Return the scans as a capture: the reference wheels in their order, then the trials."""
    lacking = [wheel for wheel in REFERENCE_WHEELS if wheel not in scans]
    if lacking:
        fact = f"the scans lack {', '.join(lacking)}"
        raise InputError(f"{fact}: the frame needs all four of {', '.join(REFERENCE_WHEELS)}")
    if target is None:
        raise InputError('no target is named: add target, for example target="disc-250"')
    names = [*REFERENCE_WHEELS, *(name for name in scans if name not in REFERENCE_WHEELS)]
    entries = tuple(_entry(str(name), scans[name], length_unit) for name in names)
    choice = as_targets(target)
    if choice.common is None:
        raise InputError(
            f"target {target!r}: name that of all other scans first: disc-250,{target}"
        )
    of_all = (SOURCE, vehicle, length_unit, choice.common, None, entries)
    return Capture(*of_all, targets=choice.of)


def _entry(name: str, points: object, length_unit: LengthUnit) -> ScanEntry:
    of_wheel = name in REFERENCE_WHEELS
    file = str(points) if is_path(points) else name
    return ScanEntry(
        name,
        "reference" if of_wheel else "trial",
        name if of_wheel else None,
        file,
        Path(file),
        scan=None if is_path(points) else as_scan(points, length_unit, name),
    )
