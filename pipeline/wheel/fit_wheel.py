"""Axis and centre of a bare wheel, with their uncertainty: from its patch to the fitted target."""

from __future__ import annotations

import math

import numpy as np

from ..centre import CentreMethod, TargetFit
from ..cloud import sample
from ..errors import NotMeasuredError
from ..plane import Patch
from ..system import frozen, stage
from ..uncertainty import UncertaintyComponent
from ..vectors import Array
from .cell_fit import HARMONICS, TUKEY, root_of
from .cells import Grid
from .fit_axis import AxisFit, fit_axis
from .flange import ROUND, Flange, bulges_inwards, edge_ring, find_flange, widest_ring
from .normal_lines import Axis

START_POINTS = 100_000
START_RAD = 1e-4  # last tilt by which the rough axis has settled
INNER_M, START_M = 0.10, 0.15  # radii from which rings are laid, and from which they are used
RING_M, RING_OF_SPACING = 0.0015, 0.75  # width of a ring
SECTORS, FEW_SECTORS, SPARSE_M = 72, 48, 0.003
RIM_RING_M, RIM_SECTORS = 0.002, 36  # of a rim with few points: its flange bends within wider rings
LEAST_CIRCLE = 0.6  # of the sectors that show the rim
LEAST_TYRE = 0.87  # of the cells of a tyre's side wall: part of it tilts far beyond its run-out
SIDE_WALL = 0.7  # of the largest radius used: where it begins
LEAST_RINGS = 5
MOST_TILT_RAD = math.radians(1.0)  # no angle of a wheel is worth stating beyond
CONTRADICTS = 10.0  # clearness of a flange beside which a stated rim of another size is wrong
OFF_CREST = 0.5  # of the height of a ridge over the rings beside it: uncertainty of its top
ARC = 0.13  # of the circle: the arc in which a tyre bulges, where it stands, by its most


@frozen
class WheelFit:
    """Fitted wheel, and what it rests on. level_m: of the centre along the axis of `fit`.

    bulge_m: height of the tyre's widest ring over the flange's edge, where both are seen.
    """

    fit: AxisFit
    method: CentreMethod
    radius_m: float
    level_m: float
    bulge_m: float | None = None


def fit_wheel(patch: Patch, rim_inch: float | None) -> TargetFit:
    """Fit the axis of the wheel in `patch`, and its centre on it; see `fit_surface`."""
    return target_of(fit_surface(patch, rim_inch), patch)


@stage("plane")
def fit_surface(patch: Patch, rim_inch: float | None) -> WheelFit:
    """Fit the surface of revolution of the wheel in `patch`.

    By the rim where its flange is seen, else by the tyre; the centre is level with the flange's
    edge, or with the tyre's widest ring. The axis points outwards, as the tyre bulges.
    rim_inch: nominal diameter of the rim, if it is stated.
    Raises NotMeasuredError 'wheel-not-found'.
    """
    found = _by_rim_or_tyre(patch, rim_inch)
    _check(found.fit, found.method)
    return found


def target_of(found: WheelFit, patch: Patch) -> TargetFit:
    """Return axis and centre of a fitted wheel in the scan's coordinates, with uncertainty."""
    fit, cells = found.fit, found.fit.cells
    used = cells.used
    return TargetFit(
        centre_m=patch.origin_m + fit.axis.point_m + found.level_m * fit.axis.direction,
        normal=fit.axis.direction,
        components=tuple(_components(found)),
        plane_rms_m=float(np.sqrt(np.mean(fit.meridian.noise_m[used] ** 2))),
        points_on_target=int(np.sum(cells.count[cells.weight > 0.0])),
        method=found.method,
        bulge_m=found.bulge_m,
    )


def _by_rim_or_tyre(patch: Patch, rim_inch: float | None) -> WheelFit:
    points = patch.face_m
    if not len(points):
        raise NotMeasuredError("wheel-not-found", "no point lies about the wheel's rough axis")
    start = Axis(np.zeros(3), patch.basis[2])
    reach = float(np.sqrt(_square_m2(points, start).max()))
    grid = _grid(len(points), reach)
    some = sample(points, START_POINTS)
    rough = fit_axis(some, start, grid, (START_M, reach), START_RAD)
    if bulges_inwards(rough):
        start = Axis(rough.axis.point_m, -rough.axis.direction)
        rough = fit_axis(some, start, grid, (START_M, reach), START_RAD)
    flange = find_flange(points, rough, rim_inch)
    if flange is None:
        _check_stated(points, rough, rim_inch)
        radius, level = widest_ring(rough, START_M)
        return WheelFit(rough, "tyre", radius, level)
    near = points[_square_m2(points, rough.axis) < (flange.groove_m + 2.0 * grid.width_m) ** 2]
    fit = fit_axis(near, rough.axis, _rim_grid(rough, flange), flange.within_m)
    bulge_m = widest_ring(rough, flange.groove_m)[1] - edge_ring(rough, flange)[1]
    seen = bulge_m if math.isfinite(bulge_m) else None
    return WheelFit(fit, "flange", *edge_ring(fit, flange), seen)


def _check_stated(points_m: Array, rough: AxisFit, rim_inch: float | None) -> None:
    """Raise NotMeasuredError 'wheel-not-found' where another rim than the stated one stands out."""
    other = None if rim_inch is None else find_flange(points_m, rough, None)
    if other is not None and other.clearness > CONTRADICTS:
        raise NotMeasuredError(
            "wheel-not-found",
            f"no flange stands out where a rim of {rim_inch:g} inches has it, but that of a rim of "
            f"{other.rim_inch:.1f} inches does: correct rim, or leave it out",
        )


def _square_m2(points_m: Array, axis: Axis) -> Array:
    """Return the square distances (N,) of points (N, 3) from the axis."""
    away = points_m - axis.point_m
    return np.asarray(np.einsum("ij,ij->i", away, away) - (away @ axis.direction) ** 2)


def _grid(points: int, reach_m: float) -> Grid:
    """Return rings and sectors such that a cell holds several of the points within reach_m."""
    spacing = reach_m * math.sqrt(math.pi / points)
    width = max(RING_M, RING_OF_SPACING * spacing)
    rings = int((reach_m - INNER_M) / width)
    return Grid(INNER_M, width, rings, SECTORS if spacing < SPARSE_M else FEW_SECTORS)


def _rim_grid(rough: AxisFit, flange: Flange) -> Grid:
    """Return the grid of the rough axis, or one of narrower rings where its own are wide.

    They are no narrower than the noise, by which points change rings.
    """
    grid, (low, high) = rough.meridian.grid, flange.within_m
    own = (grid.radius_m > low) & (grid.radius_m < high) & np.isfinite(rough.meridian.noise_m)
    width = max(RIM_RING_M, float(np.median(rough.meridian.noise_m[own])) if own.any() else 0.0)
    if grid.width_m <= width:
        return grid
    rings = int(grid.rings * grid.width_m / width)
    return Grid(grid.low_m, width, rings, RIM_SECTORS, least=1)


def _check(fit: AxisFit, method: CentreMethod) -> None:
    """Raise NotMeasuredError 'wheel-not-found' where it is no surface of revolution."""
    cells = fit.cells
    circle = float(np.mean(np.any(cells.weight > 0.0, axis=0)))
    rings = int(np.count_nonzero(cells.kept >= ROUND))
    tilt, shift_m = (
        math.sqrt(float(np.linalg.eigvalsh(cells.covariance[i : i + 2, i : i + 2])[-1]))
        for i in (0, 2)
    )
    moves, moves_m = (float(np.abs(cells.step[i : i + 2]).max()) for i in (0, 2))
    radius = fit.meridian.grid.radius_m[cells.used]
    wall = float(np.mean(cells.weight[radius > SIDE_WALL * radius.max()] > 0.0))
    facts = (
        (moves > tilt, f"the fit has not settled: the axis still moves by {math.degrees(moves):.2f}"
         f"°, and is uncertain by {math.degrees(tilt):.2f}°"),
        (moves_m > shift_m, "the fit has not settled: the centre still moves by "
         f"{moves_m * 1e3:.1f} mm, and is uncertain by {shift_m * 1e3:.1f} mm"),
        (method == "tyre" and wall < LEAST_TYRE, "no flange of a rim stands out, and of the tyre's "
         f"side wall {wall:.0%} is seen, {LEAST_TYRE:.0%} needed"),
        (circle < LEAST_CIRCLE, f"{circle:.0%} of a wheel's circle is seen, "
         f"{LEAST_CIRCLE:.0%} needed"),
        (rings < LEAST_RINGS, f"{rings} round rings are seen, {LEAST_RINGS} needed"),
        (not tilt < MOST_TILT_RAD, f"the axis is uncertain by {math.degrees(tilt):.1f}°"),
    )  # fmt: skip
    for failed, fact in facts:
        if failed:
            raise NotMeasuredError("wheel-not-found", fact)


def _components(found: WheelFit) -> list[UncertaintyComponent]:
    """Return independent noise, what is correlated or not round, the edge, a tyre's run-out."""
    fit, cells = found.fit, found.fit.cells
    noise = cells.white_covariance
    rest = cells.covariance - noise
    level_m = _off_crest(found)
    if found.method == "tyre":
        level_m = math.hypot(level_m, _hidden_bulge(found))
    parts = [
        UncertaintyComponent("surface noise", _moved(found, root_of(noise))),
        UncertaintyComponent("surface form", _moved(found, root_of(rest)), cells.dof),
        UncertaintyComponent("centre model", _along(fit.basis[2], level_m)),
    ]
    if found.method == "tyre":
        parts.append(_tyre_runout(found))
    return parts


def _moved(found: WheelFit, root: Array) -> Array:
    """Return the factor (6, k) of steps (4, k): tilts and shifts along two axes across the axis."""
    across = found.fit.basis[:2].T
    tilt = across @ root[:2]
    return np.vstack([tilt, across @ root[2:] + found.level_m * tilt])


def _along(direction: Array, u_m: float) -> Array:
    return np.concatenate([np.zeros(3), u_m * direction])[:, None]


def _off_crest(found: WheelFit) -> float:
    """Return the uncertainty of the height of a ridge, which rings of some width blunt."""
    meridian = found.fit.meridian
    ring = int(np.argmin(np.abs(meridian.grid.radius_m - found.radius_m)))
    beside = meridian.height_m[max(ring - 1, 0) : ring + 2]
    blunt = OFF_CREST * float(np.nanmax(beside) - np.nanmean(beside))
    known = found.fit.cells.ring_u_m
    own = known[ring] if np.isfinite(known[ring]) else float(np.nanmedian(known))
    return math.hypot(blunt, own)


def _hidden_bulge(found: WheelFit) -> float:
    """Return the uncertainty of a tyre's level by a bulge where it stands that no cell shows.

    Cells are rejected from TUKEY of their standard deviations; a bulge below that is as likely of
    any height, and lifts the mean of the circle by its share of it.
    """
    cells = found.fit.cells
    kept = cells.weight > 0.0
    spread_m = math.sqrt(float(np.median(cells.white_m2[kept])) + cells.excess_m**2)
    return ARC * TUKEY * spread_m / math.sqrt(3.0)


def _tyre_runout(found: WheelFit) -> UncertaintyComponent:
    """Return the component of a tyre's first harmonic, which only its own axis shows.

    It is taken as large as the root sum of squares of the second and the third, which are fitted:
    amplitudes of tyres fall about as 1 / k.
    """
    step = found.fit.cells.step[4:].reshape(len(HARMONICS), 2, 2)
    lateral, radial = np.sqrt(np.sum(step**2, axis=(0, 2)))
    factor = np.zeros((6, 4))
    across = found.fit.basis[:2].T
    factor[:3, :2] = lateral / math.sqrt(2.0) / found.radius_m * across
    factor[3:, 2:] = radial / math.sqrt(2.0) * across
    return UncertaintyComponent("tyre run-out", factor, 2.0 * len(HARMONICS))
