"""Intensity of the target's points at an edge whose beams return one surface each.

A beam at the edge has only part of its footprint on the target, and its return has that part of the
power, whatever is behind: at x outside a sharp edge 1 - F(a) + o (F(a) - F(b)) of that inside it,
with the shares of mixed_pixel.py; a chamfer returns a part in between. So the intensities of the
target's points show where its edge is, and points of many beams do. Where target and background
part shows it worse: that depends on the background's brightness, which is another in each part of
the edge.

An intensity need not be proportional to power: it is taken as a power of it, by an exponent.
"""

from __future__ import annotations

import math

import numpy as np

from ...targets import sector
from ...vectors import NORMAL_OF_MAD, Array, Array32, Mask
from .beams import (
    CHAMFER,
    GROWTH,
    RATIO,
    SHAPE,
    SPOT,
    STATE,
    THICKNESS,
    WALL,
    Beams,
    bevel_reflectance,
    footprint_m,
    reaching,
    wall_reflectance,
)
from .clean_edge import fanned, mean_depths, seen_target
from .edge_residuals import (
    INNER_M,
    POINTING_M,
    SECTORS,
    EdgeProblem,
    Equations,
    profile_slopes,
    robust_weight,
)
from .mixed_pixel import EdgeProfile, profile_of

EXPONENT = RATIO  # the state's log of it: no background is in these equations
CLIPPED = 4  # fits of a face's brightness, each without the outliers of the one before
LEAST_OF_FACE = 24  # points of a face by which its brightness is known
WHOLE, LEAST_INSIDE = 2.0, 8  # radii of a footprint inside the edge, where it is whole; points
# Of a face of one brightness: relative scatter of its intensities, and the share of its points that
# have it; others lie at its edges.
MOST_SPECKLE, ONE_BRIGHTNESS = 0.25, 0.7
FADED = 0.85  # of the intensity inside the edge: less is that of a return at it
LEAST_POWER = 0.1  # of that inside the edge: of less, a detector reports what lies above its noise
NOT_BY_CHANCE = 5.0  # standard uncertainties of the mean depth of faded points
ROUNDED = 0.01  # of it: standard uncertainty of any intensity, besides its speckle


def face_light(plane: Array | Array32, intensity: Array | Array32) -> Array | None:
    """Return the intensity of a face, linear over its plane (3,), by points on it at (N, 2).

    Distance and incidence, and so the power that returns, are others from one side to the other.
    None where the face is not of one brightness, or too few intensities (N,) are known.
    """
    known = np.isfinite(intensity)
    columns, seen = _linear(plane[known]), intensity[known].astype(np.float64)
    used = np.ones(len(seen), bool)
    for _ in range(CLIPPED):
        if np.count_nonzero(used) < LEAST_OF_FACE:
            return None
        light = np.linalg.lstsq(columns[used], seen[used], rcond=None)[0]
        level = columns @ light
        if level.min() <= 0.0:
            return None
        ratio = seen / level
        off = np.abs(ratio / np.median(ratio) - 1.0)
        scatter = NORMAL_OF_MAD * float(np.median(off))
        used = off < 3.0 * scatter + ROUNDED
    alike = scatter < MOST_SPECKLE and np.mean(used) > ONE_BRIGHTNESS
    return np.asarray(light) if alike else None


def relative_to_face(plane: Array, intensity: Array | Array32, light: Array) -> Array:
    """Return intensities (N,) at (N, 2) over that of the face there, as `face_light` returns it."""
    level = _linear(plane) @ light
    return np.asarray(np.where(level > 0.0, intensity / np.where(level > 0.0, level, 1.0), np.nan))


def _linear(plane: Array | Array32) -> Array:
    return np.column_stack([np.ones(len(plane)), plane])


def speckle(problem: EdgeProblem, state: Array) -> float | None:
    """Return the scatter of the intensities inside the edge; None where too few are known."""
    if problem.intensity is None:
        return None
    inside = problem.beams(state).x_m < -WHOLE * float(np.exp(state[SPOT]))
    inside &= np.abs(problem.depth) < 5.0 * problem.sigma_m + 1e-4
    seen = problem.intensity[inside & np.isfinite(problem.intensity)]
    if len(seen) < LEAST_INSIDE:
        return None
    return NORMAL_OF_MAD * float(np.median(np.abs(seen - np.median(seen))))


def intensity_equations(
    problem: EdgeProblem, state: Array, speckle: float, robust: bool
) -> Equations:
    """Linearise the depths and the intensities of the target's points about its edge at `state`.

    speckle: scatter of the latter, of their value.
    """
    problem, beams = problem.near_edge(state, (INNER_M + float(state[GROWTH]), np.inf))
    beams = fanned(beams, state)
    beside = _beside(problem, beams, state)
    chosen = beside & (beams.x_m < 0.0)
    depths = mean_depths(problem, beams, chosen, state, robust, robust, alone=False)
    return Equations.stacked([depths, _intensities(problem, beams, beside, state, speckle, robust)])


def fading(problem: EdgeProblem, state: Array) -> tuple[float, float]:
    """Return the share of sectors in which intensities fade, and of how they differ from the face.

    The former of all, or of those on the far side, where less: there no wall is seen, which is
    darker than the face to a camera as well. The latter is what the fit explains, of the squares of
    their differences, or of those that a wall of another brightness leaves.
    """
    beams = fanned(problem.beams(state), state)
    chosen = np.flatnonzero(_beside(problem, beams, state) & np.isfinite(_known(problem)))
    beams = beams.taken(chosen)
    model, seen = intensity_profile(beams, state).depth_m, _known(problem)[chosen]
    faded = (model < FADED) | (seen < FADED)
    seen, on_wall = seen[faded], problem.depth[chosen][faded] > 5.0 * problem.sigma_m + 1e-4
    wall = float(seen[on_wall].mean()) if on_wall.any() else 1.0
    darker = min(np.sum((1.0 - seen) ** 2), np.sum((np.where(on_wall, wall, 1.0) - seen) ** 2))
    left = np.sum((model[faded] - seen) ** 2)
    return _in_sectors(beams, model), float(1.0 - left / darker) if darker > 0.0 else 0.0


def is_mixed(problem: EdgeProblem, state: Array) -> bool:
    """Return whether faded points of the far side are the deeper: they are of the background, too.

    Of mixed pixels a filter may leave the nearest to the target, whose intensities fade by as much
    as the background is darker, and not as the target's own power. No wall is seen there.
    """
    beams = fanned(problem.beams(state), state)
    chosen = np.flatnonzero(_beside(problem, beams, state) & (beams.tau < 0.0))
    depth = problem.depth[chosen][intensity_profile(beams.taken(chosen), state).depth_m < FADED]
    if len(depth) == 0:
        return False
    u_m = problem.sigma_m * max(NOT_BY_CHANCE / math.sqrt(len(depth)), 1.0)
    return float(np.mean(depth)) > u_m


def seen_fading(problem: EdgeProblem, state: Array) -> float:
    """Return the share of sectors as `fading` does, by the intensities as they are: no fit yet."""
    beams = fanned(problem.beams(state), state)
    chosen = np.flatnonzero(_beside(problem, beams, state) & np.isfinite(_known(problem)))
    return _in_sectors(beams.taken(chosen), _known(problem)[chosen])


def _in_sectors(beams: Beams, intensity: Array) -> float:
    """Return the share of sectors with faded intensities (N,), or of those on the far side."""
    part = sector(beams.share, SECTORS)
    shown = np.bincount(part[intensity < FADED], minlength=SECTORS) > 0
    far = np.bincount(part, beams.tau, SECTORS) < 0.0
    return float(min([np.mean(shown), *([np.mean(shown[far])] if far.any() else [])]))


def _known(problem: EdgeProblem) -> Array:
    assert problem.intensity is not None
    return problem.intensity


def _beside(problem: EdgeProblem, beams: Beams, state: Array) -> Mask:
    """Return which points (N,) are the target's about its edge."""
    on_target, _ = seen_target(problem, beams, state)
    return np.asarray(on_target & (beams.x_m + state[GROWTH] > -INNER_M))


def _intensities(
    problem: EdgeProblem,
    beams: Beams,
    beside: Mask,
    state: Array,
    speckle: float,
    robust: bool,
) -> tuple[Array, ...]:
    """Return the rows of Equations for the intensities of target points: q to by_height."""
    chosen = np.flatnonzero(beside & np.isfinite(_known(problem)))
    beams = beams.taken(chosen)
    parts = reaching(beams, state)
    cut = beams.taken(parts)
    profile = intensity_profile(cut, state)
    model, d_x = np.ones(len(chosen)), np.zeros(len(chosen))
    slopes = np.zeros((STATE, len(chosen))).T
    model[parts], d_x[parts] = profile.depth_m, profile.d_x
    slopes[parts] = profile_slopes(profile, cut, problem.depth[chosen[parts]], state)
    residual = _known(problem)[chosen] - model
    variance = (speckle * model) ** 2 + ROUNDED**2 + (d_x * POINTING_M) ** 2
    weight, change = robust_weight(residual**2 / variance, robust)
    rows = (
        beams.q_m,
        beams.share,
        residual,
        slopes,
        weight / variance,
        change / variance,
        -d_x * beams.tau * beams.shrink,
    )
    shown = model > LEAST_POWER ** float(np.exp(state[EXPONENT]))
    return tuple(of[shown] for of in rows)


def intensity_profile(beams: Beams, state: Array) -> EdgeProfile:
    """Return the intensity (N,) of a return by face, chamfer and wall, of the face's, as 'depth'.

    And its derivatives, by the log of the exponent instead of that of the reflectance ratio.
    """
    thickness, exponent = float(np.exp(state[THICKNESS])), float(np.exp(state[EXPONENT]))
    spot_m = footprint_m(beams, state)
    facing, chamfer = np.maximum(beams.tau, 0.0), float(state[CHAMFER])
    a, c = (beams.x_m + chamfer) / spot_m, (beams.x_m - chamfer * beams.tau) / spot_m
    b = np.where(beams.tau > 0.0, (beams.x_m - thickness * facing) / spot_m, c)
    profile = profile_of(float(state[SHAPE]))
    at_a, at_c, at_b = profile.at(a), profile.at(c), profile.at(b)
    # Reflectances of the wall, 0 where it is not seen, and of the chamfer.
    o = np.where(beams.tau > 0.0, wall_reflectance(facing, state)[0], 0.0)
    w = bevel_reflectance(beams.tau, float(state[WALL]))
    power = 1.0 - at_a.share + w * (at_a.share - at_c.share) + o * (at_c.share - at_b.share)
    shown = power > LEAST_POWER
    power = np.maximum(power, LEAST_POWER)
    intensity = power**exponent
    rate = np.where(shown, exponent * intensity / power, 0.0)
    fa, fc, fb = at_a.density / spot_m, at_c.density / spot_m, at_b.density / spot_m
    nothing = np.zeros(len(power))
    return EdgeProfile(
        depth_m=intensity,
        d_x=rate * (w * (fa - fc) + o * (fc - fb) - fa),
        d_tau=rate * o * fb * thickness,
        d_log_spot=rate * spot_m * ((1.0 - w) * fa * a + (w - o) * fc * c + o * fb * b),
        d_thickness=rate * o * fb * facing,
        d_log_ratio=exponent * intensity * np.log(power),
        d_wall=rate * (at_c.share - at_b.share),
        d_shape=rate
        * (
            (w - 1.0) * at_a.share_by_shape
            + (o - w) * at_c.share_by_shape
            - o * at_b.share_by_shape
        ),
        background_share=nothing,
        by_background=nothing,
        d_chamfer=rate * ((w - 1.0) * fa + (w - o) * beams.tau * fc),
        d_lean=rate * (w - o) * fc * chamfer,
        d_bevel=rate * (at_a.share - at_c.share),
    )
