"""Targets against the wheels that they are mounted on, in the same scans: errors of the mounting.

The target is measured as always, the wheel from what is left of its scan: the points of the target,
and those before it, are taken out first. Both share the scanner, whose errors cancel, but no point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..capture import Capture, ScanEntry
from ..centre import TargetFit
from ..config import Config
from ..errors import InputError, NotMeasuredError, Wording
from ..measure import fit_target, measure_capture
from ..measurement import Estimate, Measurement, Provenance, WheelResult
from ..readers import Part
from ..system import frozen
from ..targets import Target, WheelTarget
from ..uncertainty import UncertaintyComponent
from ..vectors import Array
from ..vehicle import VehicleFrame, outward_normal
from ..wheel import find_patch
from .request import COMPARED, why_missing

BEHIND_M, BESIDE_M = 0.03, 0.03  # the target's face and edge: its body, and mixed pixels
WITHIN_M = 0.8  # of a target: its wheel is nearer
OF_SCANNER = ("range bias", "range scale", "incidence", "axes", "pointing", "registration")
LEAST_SCATTER = 3  # mountings whose scatter is worth stating
OF_RIM = (
    "Mountings are against the rim's own axis, as it stands in the scan: its run-out against the "
    "spin axis is not in them."
)
OF_TYRE = "No flange of a rim stands out in {names}: against the tyre."


@frozen
class Mounting:
    """Target of one scan less its wheel, in the vehicle's frame.

    toe, camber: of the target's normal less those of the wheel's axis, rad. stand_off: of the
    target's centre from the plane of the flange's edge, outwards along the axis; forward, upward:
    of that centre from the axis, across it; metres. by: 'flange' or 'tyre', which gave the axis.
    """

    name: str
    wheel: str
    toe: Estimate
    camber: Estimate
    stand_off: Estimate
    forward: Estimate
    upward: Estimate
    by: str

    @property
    def offsets(self) -> dict[str, Estimate]:
        """The five offsets by name."""
        names = ("toe", "camber", "stand_off", "forward", "upward")
        return {name: getattr(self, name) for name in names}


@frozen
class MountingScatter:
    """Scatter of several mountings of one target, as its file states it.

    stand_off_m: mean, u_m: standard deviation of the next one; tilt_rad, shift_m: root mean squares
    per axis about zero.
    """

    target: Target
    count: int
    stand_off_m: float
    u_m: float
    tilt_rad: float
    shift_m: float


@frozen
class Mountings:
    """All mountings of a capture; missing: name and reason of what shows not both."""

    source: str
    vehicle: str
    mountings: tuple[Mounting, ...]
    scatters: tuple[MountingScatter, ...]
    missing: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    origins: tuple[Provenance, ...] = ()


def validate_mountings(
    capture: Capture, config: Config, progress: Callable[[str], None] = lambda _: None
) -> Mountings:
    """Measure targets and wheels of one capture. Raises InputError where no scan shows both."""
    dense = measure_capture(capture, config, progress)
    found, missing = [], []
    for result in (w for w in dense.wheels if w.observation.role in COMPARED):
        name = result.observation.name
        try:
            found.append(_mounting(result, dense, capture, config))
        except NotMeasuredError as error:
            missing.append((name, f"{error.status}: {error}"))
    if not found:
        reason = "; ".join(f"{name}: {reason}" for name, reason in missing)
        raise InputError(f"{capture.source}: no scan shows a target and its wheel: {reason}")
    bare = [one.name for one in found if one.by == "tyre"]
    notes = [Wording(OF_RIM)]
    if bare:
        notes.append(Wording(OF_TYRE, names=", ".join(bare)))
    return Mountings(
        capture.source,
        capture.vehicle or capture.source,
        tuple(found),
        tuple(_scatters(found, dense)),
        tuple(missing),
        tuple(notes),
        (dense.provenance,),
    )


def _mounting(
    result: WheelResult, dense: Measurement, capture: Capture, config: Config
) -> Mounting:
    """Measure one wheel behind its target. Raises NotMeasuredError."""
    seen, target = result.observation, result.observation.target
    if seen.evidence is None or result.wheel is None or target is None:
        raise NotMeasuredError(seen.status, why_missing(result).partition(": ")[2])
    if isinstance(target, WheelTarget):
        raise NotMeasuredError("no-target", "nothing is mounted on it")
    plate = seen.evidence.target
    outward = outward_normal(dense.frame, plate.normal, result.wheel)
    points_m, part = _scan_about(seen.name, plate.centre_m, capture)
    rest_m = without_target(points_m, plate.centre_m, outward, target.radius_m)
    rim = capture.target.rim if isinstance(capture.target, WheelTarget) else None
    bare = WheelTarget(shape="wheel", rim=rim)
    patch = find_patch(rest_m, bare, config, near_m=plate.centre_m, outward=outward)
    patch = replace(patch, station_m=None if part is None else part.station_m)
    wheel = fit_target(patch, bare, config).target
    return mounting_of(seen.name, result.wheel, plate, wheel, dense.frame)


def without_target(points_m: Array, centre_m: Array, outward: Array, radius_m: float) -> Array:
    """Return the points (N, 3) less those of a target and before it.

    What is nearer to the wheel than BEHIND_M behind the face stays, so do all points beside it.
    """
    local = points_m - centre_m
    height = local @ outward
    square = np.einsum("ij,ij->i", local, local) - height**2
    on_target = (height > -BEHIND_M) & (square < (radius_m + BESIDE_M) ** 2)
    return np.asarray(points_m[~on_target & (height < BEHIND_M)])


def _scan_about(name: str, centre_m: Array, capture: Capture) -> tuple[Array, Part | None]:
    """Read a scan again; return its points about a target, of the posed scan with most of them."""
    entry: ScanEntry = capture.cloud or next(e for e in capture.entries if e.name == name)
    scan = entry.read(capture.length_unit, capture.called(entry), capture.reading)
    parts = scan.parts or (Part("", 0, len(scan.points_m), None),)
    near = [
        rows[np.linalg.norm(rows - centre_m, axis=1) < WITHIN_M]
        for rows in (scan.points_m[part.start : part.stop] for part in parts)
    ]
    most = max(range(len(parts)), key=lambda number: len(near[number]))
    return near[most], parts[most] if scan.parts else None


def mounting_of(
    name: str, wheel: str, plate: TargetFit, axis: TargetFit, frame: VehicleFrame
) -> Mounting:
    """Return the offsets of a fitted target from its wheel's fitted axis."""
    n, a = (outward_normal(frame, fit.normal, wheel) for fit in (plate, axis))
    side = 1.0 if wheel.endswith("L") else -1.0
    out = side * frame.left
    toe_n, camber_n, rows_n = _angles(n, out, frame)
    toe_a, camber_a, rows_a = _angles(a, out, frame)
    forward = frame.forward - (frame.forward @ a) * a
    forward /= np.linalg.norm(forward)
    upward = frame.up - (frame.up @ a) * a - (frame.up @ forward) * forward
    upward /= np.linalg.norm(upward)
    apart = plate.centre_m - axis.centre_m
    off = float(apart @ a)
    slopes = np.zeros((5, 12))  # by normal and centre of the target, then of the wheel
    slopes[:2, :3], slopes[:2, 6:9] = rows_n, -rows_a
    for row, way in enumerate((a, forward, upward), 2):
        slopes[row, 3:6], slopes[row, 9:] = way, -way
    slopes[2, 6:9], slopes[3, 6:9], slopes[4, 6:9] = apart, -off * forward, -off * upward
    signs = [math.copysign(1.0, u @ fit.normal) for u, fit in ((n, plate), (a, axis))]
    slopes[:, :3] *= signs[0]
    slopes[:, 6:9] *= signs[1]
    values = [toe_n - toe_a, camber_n - camber_a, *(float(apart @ w) for w in (a, forward, upward))]
    moved = list(_effects(plate, axis, slopes))
    toe, camber, stand_off, ahead, above = (
        _estimate(value, [(rows[i], dof) for rows, dof in moved]) for i, value in enumerate(values)
    )
    return Mounting(name, wheel, toe, camber, stand_off, ahead, above, axis.method)


def _angles(normal: Array, out: Array, frame: VehicleFrame) -> tuple[float, float, Array]:
    """Return toe and camber (elevation) of an outward normal, and their derivatives (2, 3)."""
    o, f, u = normal @ out, normal @ frame.forward, normal @ frame.up
    level = math.hypot(o, f)
    rows = np.stack([(o * frame.forward - f * out) / level**2, -frame.up / level])
    return math.atan2(f, o), -math.atan2(u, level), rows


def _effects(plate: TargetFit, axis: TargetFit, slopes: Array) -> Iterator[tuple[Array, float]]:
    """Yield the five offsets' movements (5, k) by each component, with its degrees of freedom.

    What the file states of the mounting is what is measured here, and the scanner's own errors act
    on both alike.
    """
    of_axis = {part.name: part for part in axis.components if part.name in OF_SCANNER}
    for part in plate.components:
        if part.name == "clamp":
            continue
        factor = slopes[:, :6] @ part.factor
        other = of_axis.pop(part.name, None)
        if other is not None:
            factor = factor + slopes[:, 6:] @ other.factor
        yield factor, part.dof
    rest: list[UncertaintyComponent] = [p for p in axis.components if p.name not in OF_SCANNER]
    for part in (*rest, *of_axis.values()):
        yield slopes[:, 6:] @ part.factor, part.dof


def _estimate(value: float, moved: Sequence[tuple[Array, float]]) -> Estimate:
    parts = [(float(rows @ rows), dof) for rows, dof in moved]
    total = sum(variance for variance, _ in parts)
    loss = sum(variance**2 / dof for variance, dof in parts)
    return Estimate(value, math.sqrt(total), total**2 / loss if loss > 0.0 else math.inf)


def _scatters(found: Sequence[Mounting], dense: Measurement) -> Iterator[MountingScatter]:
    """Yield what the mountings of each target show, where there are enough of them."""
    targets = {wheel.observation.name: wheel.observation.target for wheel in dense.wheels}
    kinds: list[Target] = []
    for one in found:
        target = targets[one.name]
        if target is not None and target not in kinds:
            kinds.append(target)
    for kind in kinds:
        own = [one for one in found if targets[one.name] == kind]
        if len(own) < LEAST_SCATTER:
            continue
        off = np.array([one.stand_off.value for one in own])
        tilts = [x.value for one in own for x in (one.toe, one.camber)]
        shifts = [x.value for one in own for x in (one.forward, one.upward)]
        rms = (math.sqrt(float(np.mean(np.square(x)))) for x in (tilts, shifts))
        next_m = float(off.std(ddof=1)) * math.sqrt(1.0 + 1.0 / len(own))
        yield MountingScatter(kind, len(own), float(off.mean()), next_m, *rms)
