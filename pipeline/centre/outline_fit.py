"""A face's outline from its points alone: where it ends, and whether that is where it should."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import NotMeasuredError
from ..targets import Outline, sector
from ..vectors import Array, turned
from .edge.beams import TURN_RAD

EROSION_M = 1.5e-3  # what spot and spacing may take from an outline all round (k = 1)
SECTORS = 72  # of the outline, in which the face is compared with it
MAX_BEYOND, MAX_SHORT = 0.3, 0.2  # shares of the edge seen, on which a face may end elsewhere
BEYOND_M, SHORT_M = 0.0015, 0.003  # how far a face may reach over its outline, or stop short of it
MIN_DIRECTIONS = 0.02  # information on the axis told of least, of that on the other
LEAST_ON_CIRCLE, FEW_OUTSIDE = 0.4, 0.1  # of a face's extreme places, on its circle; beyond it
STILL_M = 1e-9
MAX_STEPS, MAX_LOOKS = 60, 20


@dataclass(frozen=True)
class OutlineFit:
    """An outline through the outermost points of a face: centre_m (2,), covariance_m2 (2, 2).

    turn_noise: (3,) covariances of the turn with the centre, and its variance.
    growth_m: how much farther out than the outline its points lie, all round.
    """

    centre_m: Array
    turn_rad: float
    covariance_m2: Array
    turn_noise: Array
    growth_m: float


def fit_outline(
    face: Array, outline: Outline, start: tuple[Array, float] = (np.zeros(2), 0.0)
) -> OutlineFit:
    """Outline through the outermost points of the face (N, 2), from a centre and turn near it.

    All edges may lie farther in by the same, within 1.5 mm, for spot and spacing erode them.
    Raises NotMeasuredError 'no-outline'.
    """
    centre, turn = start
    count = int(np.clip(len(face) // 40, 24, 180))
    for look in range(MAX_LOOKS):
        wide = 2.0 if outline.shows_rotation and look < 3 else 1.0
        edge = _outermost(face, outline, centre, turn, count, wide)
        if len(edge) < 8:
            raise NotMeasuredError(
                "no-outline",
                f"less than a third of the edge of {outline.description} is in the scan",
            )
        fitted = fit_edge_points(edge, outline, centre, turn)
        moved = fitted.centre_m - centre
        centre, turn = fitted.centre_m, fitted.turn_rad
        if float(np.abs(moved).max()) < STILL_M:
            break
    return fitted


def place_circle(face: Array, radius_m: float) -> Array | None:
    """Centre (2,) of a circle of known radius that holds a face (N, 2), half hidden perhaps.

    Of the circles through two of the face's extreme places, the one that most of them lie on, and
    hardly any point outside of; None where none is.
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
    turn_rad: float,
    spacing_m: float,
    noise_m: float,
) -> bool:
    """Whether a quarter of the edge is seen; NotMeasuredError where the face (N, 2) ends elsewhere.

    noise_m: of a point along the plane. Sectors whose points stop well inside are hidden, and tell
    nothing; few of the others may reach beyond the outline, or stop short of it.
    """
    closest = outline.closest(turned(face - centre, -turn_rad))
    outermost = np.full(SECTORS, -np.inf)
    np.maximum.at(outermost, sector(closest.share, SECTORS), closest.x_m)
    seen = outermost > -0.08 * outline.size_m
    if np.count_nonzero(seen) < SECTORS // 4:
        return False
    excess = outermost[seen]
    over = float(np.mean(excess > BEYOND_M + spacing_m + 3.0 * noise_m))
    if over > MAX_BEYOND:
        raise NotMeasuredError(
            "wrong-outline",
            f"the face reaches {np.quantile(excess, 0.75) * 1e3:.1f} mm beyond the edge of "
            f"{outline.description} on {over:.0%} of it",
        )
    short = excess < -(SHORT_M + 1.5 * spacing_m)
    if float(np.mean(short)) > MAX_SHORT:
        raise NotMeasuredError(
            "wrong-outline",
            f"the face ends {-float(np.median(excess[short])) * 1e3:.1f} mm inside the edge of "
            f"{outline.description} on {np.mean(short):.0%} of it",
        )
    return True


def _outermost(
    face: Array, outline: Outline, centre: Array, turn: float, count: int, wide: float
) -> Array:
    """The point of each of `count` sectors that is farthest out, near the edge: (K, 2)."""
    closest = outline.closest(turned(face - centre, -turn))
    part = sector(closest.share, count)
    near = (closest.x_m < 0.05 * wide * outline.size_m) & closest.clear
    order = np.lexsort((np.where(near, closest.x_m, -np.inf), part))
    last = order[np.diff(part[order], append=count) > 0]
    kept = near[last] & (np.abs(closest.x_m[last]) < 0.08 * wide * outline.size_m)
    return np.asarray(face[last[kept]])


def fit_edge_points(edge: Array, outline: Outline, centre: Array, turn: float) -> OutlineFit:
    """Fit the outline of least weighted squares to points on its edge (K, 2), all grown alike.

    x = growth, d x = -n . dc - n . J q dphi, with J a quarter turn; Gauss-Newton.
    """
    prior = np.diag([0.0, 0.0, TURN_RAD**-2, EROSION_M**-2])
    state = np.array([*centre, turn, 0.0])
    for _ in range(MAX_STEPS):
        q = turned(edge - state[:2], -state[2])
        closest = outline.closest(q)
        excess = closest.x_m - state[3]
        by_turn = closest.normal[:, 0] * q[:, 1] - closest.normal[:, 1] * q[:, 0]
        slopes = np.column_stack([turned(closest.normal, state[2]), -by_turn, np.ones(len(q))])
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
    turn_noise = covariance[2, :3]
    return OutlineFit(state[:2], float(state[2]), covariance[:2, :2], turn_noise, float(state[3]))


def _check_directions(information: Array, outline: Outline) -> None:
    """Raise NotMeasuredError 'no-outline' where the edges that are seen tell of one axis alone."""
    values = np.linalg.eigvalsh(information)
    if values[0] < MIN_DIRECTIONS * values[1]:
        raise NotMeasuredError(
            "no-outline", f"only parallel edges of {outline.description} are seen"
        )


def _tukey(excess: Array) -> Array:
    """Tukey's biweight at 4.685 sigma over the variance, sigma from the excesses themselves."""
    sigma = max(1.4826 * float(np.median(np.abs(excess))), 2e-5)
    return np.asarray(np.clip(1.0 - (excess / (4.685 * sigma)) ** 2, 0.0, None) ** 2 / sigma**2)
