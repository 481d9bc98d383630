"""Outline of a target from its points alone, and the check of its size and shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..errors import NotMeasuredError
from ..system import frozen
from ..targets import Outline, sector
from ..vectors import Array, turned
from .edge.beams import ROTATION_RAD

EROSION_M = 1.5e-3  # erosion of an outline all round by footprint and spacing (k = 1)
SECTORS = 72  # of the outline, in which the points are compared with it
MAX_BEYOND, MAX_SHORT = 0.3, 0.2  # shares of the visible edge on which the target may end elsewhere
BEYOND_M, SHORT_M = 0.0015, 0.003  # how far points may reach over the outline, or stop short of it
MIN_DIRECTIONS = 0.02  # least information on one axis, of that on the other
LEAST_ON_CIRCLE, FEW_OUTSIDE = 0.4, 0.1  # of the extreme points, on the circle; beyond it
HIDDEN = 0.08  # of its size: farther inside an outline, something hides the edge
STRAYS = 400  # points of a sector, of which one may lie anywhere
OPPOSITE = 0.5  # of the edge that is reached beyond, as much opposite: of another size all round
SHORT_ARC, MANY_OFF = 0.4, 0.2  # of the sectors; of their points, off the circle by SHORT_M
CORNER = 0.7  # of EROSION_M: uncertainty of the growth that corners alone leave
UNEVEN_WAVES, UNEVEN = (2, 3), 9.5  # chi-square of 4 dof, 0.95
UNEVEN_BY_GROWTH = 0.1  # their least amplitude: footprint and grid make some, too
STEP_M = 1e-9
MAX_STEPS, MAX_LOOKS = 60, 20


@frozen(eq=False)
class OutlineFit:
    """An outline through the outermost points of a target: centre_m (2,), covariance_m2 (2, 2).

    rotation_noise: (3,) covariances of the rotation with the centre, and its variance.
    growth_m: how much farther out than the outline its points lie, all round; growth_u_m: its
    standard uncertainty. excess_m: (K,) how far outside that each of them lies; share: (K,) where
    along the outline, ascending. seen: share of the outline's sectors that have points.
    """

    centre_m: Array
    rotation_rad: float
    covariance_m2: Array
    rotation_noise: Array
    growth_m: float
    growth_u_m: float
    excess_m: Array
    share: Array
    seen: float = 1.0

    @property
    def is_uneven(self) -> bool:
        """Whether the points follow no grown outline: something else ends the target in a part.

        By the second and third harmonics along the outline: chi-square of 4 dof of independent
        points, whose variance is that of successive differences (von Neumann, Ann. Math. Stat. 12
        (1941) 367), and their amplitude against the growth.
        """
        steps_m = np.diff(self.excess_m, append=self.excess_m[0])
        variance = max(float(np.mean(steps_m**2)) / 2.0, 1e-18)
        waves = np.exp(2j * np.pi * np.outer(UNEVEN_WAVES, self.share))
        square = float(np.sum(np.abs(2.0 * waves @ self.excess_m / len(self.share)) ** 2))
        significant = square * len(self.share) / (2.0 * variance) > UNEVEN
        return significant and square > (UNEVEN_BY_GROWTH * self.growth_m) ** 2


def fit_outline(
    face: Array, outline: Outline, start: tuple[Array, float] = (np.zeros(2), 0.0)
) -> OutlineFit:
    """Fit an outline through the outermost points of a target (N, 2), from a nearby pose.

    start: centre and rotation. All edges may lie farther in by the same, within 1.5 mm, because
    footprint and spacing erode them.
    Raises NotMeasuredError 'no-outline'.
    """
    centre, rotation = start
    count = int(np.clip(len(face) // 40, 24, 180))
    for look in range(MAX_LOOKS):
        wide = 2.0 if outline.shows_rotation and look < 3 else 1.0
        edge = _outermost(face, outline, centre, rotation, count, wide)
        if len(edge) < 8:
            raise NotMeasuredError(
                "no-outline",
                f"less than a third of the edge of {outline.description} is in the scan",
            )
        fitted = fit_edge_points(edge, outline, centre, rotation)
        moved = fitted.centre_m - centre
        centre, rotation = fitted.centre_m, fitted.rotation_rad
        if float(np.abs(moved).max()) < STEP_M:
            break
    return replace(fitted, seen=len(edge) / count)


def check_alone(fitted: OutlineFit, outline: Outline) -> None:
    """Raise NotMeasuredError 'no-outline' where a surface that ends anywhere looks the same.

    For an outline whose edges no background shows: the end of the scan, or of its crop, may be
    taken for them. A larger surface has corners there, whose edges do not show how far in they all
    lie, as opposite edges do; and a little of an arc that does not fit well is that of any circle.
    """
    off = float(np.mean(np.abs(fitted.excess_m) > SHORT_M))
    doubtful = abs(fitted.growth_m) > 2.0 * EROSION_M or off > MANY_OFF
    if outline.shows_rotation and fitted.growth_u_m > CORNER * EROSION_M:
        piece = "a corner"
    elif doubtful and fitted.seen < SHORT_ARC:
        piece = f"{fitted.seen:.0%} of the edge"
    else:
        return
    raise NotMeasuredError(
        "no-outline",
        f"no more than {piece} of {outline.description} is in the scan, and no background behind "
        "it: scan more of it, or what is around it",
    )


def place_circle(face: Array, radius_m: float) -> Array | None:
    """Return the centre (2,) of a disc of known radius, partly hidden perhaps; None if none fits.

    Among the circles through two of the extreme points of (N, 2), it is the one that most of them
    lie on and hardly any lies outside of.
    """
    ways = 2.0 * np.pi * np.arange(SECTORS) / SECTORS
    ahead = np.stack([np.cos(ways), np.sin(ways)])
    tips = np.unique(face[np.argmax(face @ ahead, axis=0)], axis=0)
    first, second = np.triu_indices(len(tips), 1)
    half = (tips[second] - tips[first]) / 2.0
    length = np.hypot(*half.T)
    fits = (length > 0.1 * radius_m) & (length < radius_m)
    half, length, middle = half[fits], length[fits], (tips[first] + tips[second])[fits] / 2.0
    rise = np.sqrt(radius_m**2 - length**2) / np.maximum(length, 1e-12)
    aside = np.stack([-half[:, 1], half[:, 0]], axis=1) * rise[:, None]
    centres = np.concatenate([middle + aside, middle - aside])
    excess = np.hypot(*(tips - centres[:, None]).transpose(2, 0, 1)) - radius_m
    count = np.count_nonzero(np.abs(excess) < SHORT_M, axis=1)
    count[np.count_nonzero(excess > SHORT_M, axis=1) > FEW_OUTSIDE * len(tips)] = 0
    if len(count) == 0 or count.max() < LEAST_ON_CIRCLE * len(tips):
        return None
    return np.asarray(centres[int(np.argmax(count))])


def check_outline(
    face: Array,
    outline: Outline,
    centre: Array,
    rotation_rad: float,
    spacing_m: float,
    noise_m: float,
    beside_m: float = 0.0,
) -> bool:
    """Return whether a quarter of the edge is visible.

    face: points on the target (N, 2). noise_m: of a point along the plane. beside_m: how far beside
    the edge a footprint returns the target, and nothing else. Sectors whose points
    stop well inside are hidden and do not count; few of the others may reach beyond the outline or
    stop short of it. A target of another size reaches beyond on opposite sides alike; what adjoins
    it or hides one side does not. Raises NotMeasuredError 'wrong-outline'.
    """
    outermost = _ends_about_m(face, outline, centre, rotation_rad)
    visible = outermost > -HIDDEN * outline.size_m
    if np.count_nonzero(visible) < SECTORS // 4:
        return False
    excess = outermost[visible]
    beyond = outermost > BEYOND_M + spacing_m + 3.0 * noise_m + beside_m
    over = float(np.mean(beyond[visible]))
    if over > MAX_BEYOND:
        fact = (
            f"{np.quantile(excess, 0.75) * 1e3:.1f} mm beyond the edge of {outline.description} "
            f"on {over:.0%} of it"
        )
        if np.mean(beyond[np.roll(beyond, SECTORS // 2)]) > OPPOSITE:
            raise NotMeasuredError("wrong-outline", f"the target reaches {fact}: check its sizes")
        raise NotMeasuredError(
            "wrong-outline",
            f"points in the target's plane reach {fact}, and not opposite: check whether another "
            "surface adjoins it or hides a part of it, and its sizes",
        )
    short = excess < -(SHORT_M + 1.5 * spacing_m)
    if float(np.mean(short)) > MAX_SHORT:
        raise NotMeasuredError(
            "wrong-outline",
            f"the target ends {-float(np.median(excess[short])) * 1e3:.1f} mm inside the edge of "
            f"{outline.description} on {np.mean(short):.0%} of it: check its sizes",
        )
    return True


def middle_end_m(face: Array, outline: Outline, centre: Array) -> float:
    """Return how far outside a round outline the points (N, 2) end, in the middle of its sectors.

    Of those that are not hidden.
    """
    ends = _ends_about_m(face, outline, centre, 0.0)
    return float(np.median(ends[ends > -HIDDEN * outline.size_m]))


def _ends_about_m(face: Array, outline: Outline, centre: Array, rotation_rad: float) -> Array:
    closest = outline.closest(turned(face - centre, -rotation_rad))
    return ends_m(closest.x_m, sector(closest.share, SECTORS))


def ends_m(x_m: Array, part: npt.NDArray[np.int64], count: int = SECTORS) -> Array:
    """Return how far out the points x_m (N,) of each of `count` sectors reach; -inf without any.

    But for one in STRAYS: of millions of points, some that belong to nothing lie in the plane.
    """
    order = np.argsort(part.astype(np.uint8), kind="stable")
    starts = np.searchsorted(part[order], np.arange(1, count))
    ends = np.full(count, -np.inf)
    for k, rows in enumerate(np.split(order, starts)):
        if len(rows):
            last = len(rows) - 1 - len(rows) // STRAYS
            ends[k] = np.partition(x_m[rows], last)[last]
    return ends


def _outermost(
    face: Array, outline: Outline, centre: Array, rotation: float, count: int, wide: float
) -> Array:
    """Return the outermost point near the edge in each of `count` sectors: (K, 2)."""
    closest = outline.closest(turned(face - centre, -rotation))
    part = sector(closest.share, count)
    near = (closest.x_m < 0.05 * wide * outline.size_m) & closest.clear
    order = np.lexsort((np.where(near, closest.x_m, -np.inf), part))
    last = order[np.diff(part[order], append=count) > 0]
    kept = near[last] & (np.abs(closest.x_m[last]) < 0.08 * wide * outline.size_m)
    return np.asarray(face[last[kept]])


def fit_edge_points(edge: Array, outline: Outline, centre: Array, rotation: float) -> OutlineFit:
    """Fit an outline, grown alike all round, to points on its edge (K, 2) by weighted squares.

    x = growth, d x = -n . dc - n . J q dphi, with J a rotation by 90 degrees; Gauss-Newton.
    """
    prior = np.diag([0.0, 0.0, ROTATION_RAD**-2, EROSION_M**-2])
    state = np.array([*centre, rotation, 0.0])
    for _ in range(MAX_STEPS):
        q = turned(edge - state[:2], -state[2])
        closest = outline.closest(q)
        excess = closest.x_m - state[3]
        by_rotation = closest.normal[:, 0] * q[:, 1] - closest.normal[:, 1] * q[:, 0]
        slopes = np.column_stack([turned(closest.normal, state[2]), -by_rotation, np.ones(len(q))])
        weight = _tukey(excess)
        information = (slopes.T * weight) @ slopes + prior
        _check_directions(information[:2, :2], outline)
        step = np.linalg.solve(
            information, slopes.T @ (weight * excess) - prior @ np.array([0, 0, *state[2:]])
        )
        state = state + step
        if float(np.abs(step).max()) < 1e-15:
            break
    covariance: Array = np.linalg.inv(information).astype(np.float64)
    order = np.argsort(closest.share)
    return OutlineFit(
        centre_m=state[:2],
        rotation_rad=float(state[2]),
        covariance_m2=covariance[:2, :2],
        rotation_noise=covariance[2, :3],
        growth_m=float(state[3]),
        growth_u_m=float(np.sqrt(covariance[3, 3])),
        excess_m=excess[order],
        share=closest.share[order],
    )


def _check_directions(information: Array, outline: Outline) -> None:
    """Raise NotMeasuredError 'no-outline' where the visible edges fix one axis alone."""
    values = np.linalg.eigvalsh(information)
    if values[0] < MIN_DIRECTIONS * values[1]:
        raise NotMeasuredError(
            "no-outline", f"only parallel edges of {outline.description} are in the scan"
        )


def _tukey(excess: Array) -> Array:
    """Return Tukey's biweight at 4.685 sigma over the variance, sigma by the median deviation."""
    sigma = max(1.4826 * float(np.median(np.abs(excess))), 2e-5)
    return np.asarray(np.clip(1.0 - (excess / (4.685 * sigma)) ** 2, 0.0, None) ** 2 / sigma**2)
