"""Measurement of a vehicle from what a program holds."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import cast

from ..capture import Capture, CaptureOptions, ScanEntry, open_capture
from ..errors import InputError
from ..five_point import FivePointFile, measure_five_point
from ..measure import measure_capture
from ..measurement import VerticalKind
from ..system import frozen
from ..units import LengthUnit
from ..vehicle import REFERENCE_WHEELS
from .alignment import Alignment
from .messages import library_errors
from .scans import Settings, TargetName, as_config, as_scan, as_targets, check_one_of, is_path

SOURCE = "points in memory"


@frozen
class Unused:
    """Scans on which some arguments have no effect: the reason, and what to do, of each."""

    what: str
    reason: str
    of_one: Mapping[str, str] = field(default_factory=dict)


FIVE_POINTS = Unused(
    "five points",
    "leave it out",
    {
        "length_unit": "give it to read_five_point",
        "vertical": "they show neither floor nor gravity: leave it out, or give scans",
    },
)
CAPTURE_FILES = Unused("a capture", "state vehicle in its capture.toml")
OPEN_CAPTURE = Unused("an open capture", "give it where the capture is opened")


@library_errors
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
    reports, where no capture states it. progress: called with each scan's name.

    Raises InputError or ConfigError, one line that says what to do; also for an argument that has
    no effect on such scans. A trial that cannot be measured
    stays in the result with its status.

        m = wp.measure({"RR": rr, "RL": rl, "FR": fr, "FL": fl}, target="disc-250")
        m.wheels["FL"].toe.deg, m.wheels["FL"].toe.U_deg
    """
    check_one_of(length_unit or "m", LengthUnit, "length_unit")
    check_one_of(vertical, VerticalKind, "vertical")
    given = {
        "target": target,
        "length_unit": length_unit,
        "scanner": scanner,
        "config": config,
        "vertical": None if vertical == "wheels" else vertical,
        "vehicle": vehicle,
    }
    if isinstance(scans, FivePointFile):
        _check_unused(given, tuple(given), FIVE_POINTS)
        return Alignment(measure_five_point(scans))
    if is_path(scans):
        _check_unused(given, ("vehicle",), CAPTURE_FILES)
        path = Path(cast("str | os.PathLike[str]", scans))
        named = None if target is None else as_targets(target)
        with open_capture(path, named, CaptureOptions(length_unit)) as opened:
            return _measured(opened, scanner, config, vertical, progress)
    if isinstance(scans, Mapping):
        scans = _capture(scans, target, length_unit or "m", vehicle)
    elif isinstance(scans, Capture):
        _check_unused(given, ("target", "length_unit", "vehicle"), OPEN_CAPTURE)
    if not isinstance(scans, Capture):
        fact = f"a {type(scans).__name__} is no set of scans"
        raise InputError(f"{fact}: give a mapping of RR, RL, FR, FL to scans, or a capture's path")
    return _measured(scans, scanner, config, vertical, progress)


def _check_unused(given: Mapping[str, object], unused: Sequence[str], scans: Unused) -> None:
    """Raise InputError for an argument that has no effect on these scans."""
    for name in unused:
        if given[name] is not None:
            reason = scans.of_one.get(name, scans.reason)
            raise InputError(f"{name} has no effect on {scans.what}: {reason}")


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
    entries = tuple(_entry(name, points, length_unit) for name, points in _by_name(scans).items())
    choice = as_targets(target)
    if choice.common is None:
        raise InputError(
            f"target {target!r}: name that of all other scans first: disc-250,{target}"
        )
    of_all = (SOURCE, vehicle, length_unit, choice.common, None, entries)
    return Capture(*of_all, targets=choice.of)


def _by_name(scans: Mapping[object, object]) -> dict[str, object]:
    """Return the scans by name: the reference wheels, then the trials.

    Raises InputError for two of one name, such as 7 and "7", for a name that is empty, and for
    `vehicle`, which names the vehicle's own quantities.
    """
    named: dict[str, object] = {wheel: scans[wheel] for wheel in REFERENCE_WHEELS}
    for key in scans:
        name = str(key)
        if not name.strip():
            raise InputError(f"the trial {key!r} has no name: give one, such as '1'")
        if name == "vehicle":
            raise InputError("a trial is called 'vehicle', as the vehicle's own: rename it")
        if key not in REFERENCE_WHEELS and name in named:
            raise InputError(f"two scans have the name {name!r}: give each trial its own")
        named[name] = scans[key]
    return named


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
