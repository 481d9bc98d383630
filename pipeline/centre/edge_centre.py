"""The centre of a face from one of its outlines: by mixed ranges, or by its outermost points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..config import CentreConfig
from ..detection import OFF_PLANE, outnumbered
from ..errors import NotMeasuredError
from ..targets import Holes, Outline
from ..vectors import Array
from .combine import Estimate, Method
from .edge.beam_direction import STEEPEST
from .edge.fit_edge import Behind, EdgeFit, aimed, fit_edge, look_behind
from .in_plane_rotation import PlaneTurn
from .outline_fit import OutlineFit, check_outline, fit_outline, place_circle
from .target_view import TargetView

OUTLINE_EDGE_M = 5e-4  # what an outline without background may be shifted by the spot (k = 1)
# The same where a background takes the spot, but the plate's wall gives it back on a side unknown.
UNEXPLAINED_EDGE_M = 1.1e-3
SHORT, U_SHORT = 0.5, 0.3  # of what grazes the far edge: what takes a centre short
GRAZING = 1.3  # slope of beams, 52 degrees, from which it does
LOST_M = 2e-3  # above which a rim's fit gives way to the outline
UNSETTLED_M = 3e-4  # the same of a rim whose fit did not stand still
WALL_SHARE = 2e-3  # of the thickness, times tan^3 of the incidence: the wall's part of the model
MISFIT = (0.06, 0.09)  # of the points unexplained: where doubt begins, and is complete
MISFIT_BY_BEND, MIN_BEND_M = 30.0, 1e-3  # what a bent wall leaves unexplained, per metre of bend
# What straight edges by mixed ranges and by points may differ; and when the plate is another.
APART_M, WORST_APART_M = 3.0 * OUTLINE_EDGE_M, 5.0 * OUTLINE_EDGE_M
MAX_RATIO = 50.0  # a background that many times brighter, or darker, than the plate is no answer
CELL = 2.0  # of the spacing: in which points on and off the face are counted
MANY_OFF = 0.05  # off the face, of those on it: below, no other surface is as near as that
SOUGHT = 1.5  # of its size, about where the raster put a face, in which its points are
GENTLE = 1.0  # slope, below which what matters lies within face_view.GENTLE_SLOPE


@dataclass(frozen=True)
class EdgeCentre:
    """A centre from one outline, the turn of the target's axes, the rim's fit if there is one."""

    estimate: Estimate
    turn_rad: float
    edge_fit: EdgeFit | None


def centre_by_edge(seen: TargetView, outline: Outline) -> EdgeCentre:
    """By the outer edge. Raises NotMeasuredError 'no-outline' or 'wrong-outline'."""
    start = np.zeros(2), 0.0
    if outline.shows_rotation:
        first = fit_outline(_face(seen, seen.near(outline, start)), outline)
        start = first.centre_m, first.turn_rad
    try:
        found = _by_edge(seen, outline, start, "rim", None)
    except NotMeasuredError as error:
        hidden = error.status == "no-outline" and not outline.shows_rotation
        other = _placed(seen, outline) if hidden else None
        if other is None:
            raise
        found = _by_edge(seen, outline, (other, 0.0), "rim", None)
    if found is None:
        raise NotMeasuredError(
            "no-outline", f"less than a quarter of the edge of {outline.description} is seen"
        )
    return found


def centre_by_holes(seen: TargetView, holes: Holes, outer: EdgeCentre) -> EdgeCentre | None:
    """By the edges of holes, from where the outer edge places them; None where they are hidden."""
    start = outer.estimate.centre_m, outer.turn_rad
    try:
        return _by_edge(seen, holes, start, "holes" if holes.shows_rotation else "hole", outer)
    except NotMeasuredError as error:
        if error.status == "no-outline":
            return None
        raise


def _by_edge(
    seen: TargetView,
    outline: Outline,
    start: tuple[Array, float],
    method: Method,
    beside: EdgeCentre | None,
) -> EdgeCentre | None:
    """None where less than a quarter of the edge is seen. beside: another edge of the plate."""
    plane, config = seen.plane, seen.config
    near = seen.near(outline, start)
    face = _face(seen, near)
    told = beside.edge_fit if beside else None
    state = told.state if told else _aimed(seen, near, outline, start)
    edge_fit = None if beside and not told else _rim(seen, outline, start, near, told or state)
    model = None if edge_fit is None else _model_variance(edge_fit, face, outline, config)
    if edge_fit is not None and model is not None and _is_lost(edge_fit, model):
        edge_fit = None
    if edge_fit is None or model is None:
        fitted = fit_outline(face, outline, start)
        behind = look_behind(near, outline, config, start, state)
        grazing_m = _grazing(behind, config)
        edge_m = UNEXPLAINED_EDGE_M if behind.seen and behind.beam is None else OUTLINE_EDGE_M
        centre, turn = fitted.centre_m + SHORT * grazing_m, fitted.turn_rad
        method = "outline" if method == "rim" else method
        estimate = Estimate(
            method=method,
            centre_m=centre,
            noise_m2=fitted.covariance_m2,
            model_m2=edge_m**2 * np.eye(2) + U_SHORT**2 * np.outer(grazing_m, grazing_m),
            by_plane=np.zeros((2, 3)),
            dof=math.inf,
            turn=_turn(seen, outline, fitted, edge_m**2, np.zeros(3)),
        )
    else:
        centre, turn = edge_fit.centre_m, edge_fit.turn_rad
        shown = _turn(seen, outline, edge_fit, model, edge_fit.turn_by_plane)
        estimate = Estimate(
            method,
            centre,
            edge_fit.covariance_m2,
            model * np.eye(2),
            edge_fit.by_plane,
            edge_fit.dof,
            shown,
        )
    slope = 1.0 if edge_fit is None else float(np.hypot(*edge_fit.beam))
    if not check_outline(face, outline, centre, turn, seen.spacing_m, plane.sigma_m * slope):
        return None
    return EdgeCentre(estimate, turn, edge_fit)


def _turn(
    seen: TargetView,
    outline: Outline,
    fitted: EdgeFit | OutlineFit,
    model_m2: float,
    by_plane: Array,
) -> PlaneTurn | None:
    """The target's turn, where the edges show it.

    What the model may be wrong by, spread over the edges as noise that moves the centre as far,
    turns them by its part over sqrt(2) of the rms lever of the edges' places.
    """
    if not outline.shows_rotation:
        return None
    return PlaneTurn(
        mark="edges",
        angle_rad=fitted.turn_rad,
        period_rad=seen.target.turn_period_rad,
        noise=fitted.turn_noise,
        model_rad2=model_m2 / (2.0 * seen.target.region.lever_m2),
        by_plane=by_plane,
    )


def _is_lost(edge_fit: EdgeFit, model_m2: float) -> bool:
    """Whether a rim's fit knows its place worse than the outermost points would."""
    return float(np.trace(edge_fit.covariance_m2)) / 2.0 + model_m2 > LOST_M**2


def _aimed(
    seen: TargetView, near: Array, outline: Outline, start: tuple[Array, float]
) -> Array | None:
    return aimed(near, outline, seen.target.thickness, seen.config, start, seen.station)


def _rim(
    seen: TargetView,
    outline: Outline,
    start: tuple[Array, float],
    near: Array,
    begin: EdgeFit | Array | None,
) -> EdgeFit | None:
    """By mixed ranges; again with what lies farther aside, where the beams are steep.

    near: points (N, 3) about the outline. begin: as in `fit_rim`; None: sought among more points.
    """
    fit = partial(
        fit_edge,
        outline=outline,
        thickness_m=seen.target.thickness,
        sigma_m=seen.plane.sigma_m,
        config=seen.config,
    )
    edge_fit = None if begin is None else fit(near, begin=begin)
    if edge_fit is not None and float(np.hypot(*edge_fit.beam)) < GENTLE:
        return edge_fit
    near = seen.near(outline, start, STEEPEST)
    if not isinstance(begin, EdgeFit):
        begin = _aimed(seen, near, outline, start) if edge_fit is None else edge_fit.state
    found = None if begin is None else fit(near, begin=begin)
    return found or edge_fit


def _grazing(behind: Behind, config: CentreConfig) -> Array:
    """What of a spot grazes the far edge (2,): its radius times the beams' run in the plane.

    There the background takes it from the face, which on the near side the plate's wall gives back.
    Zero where no background tells how the beams run, or where they do not graze.
    """
    if behind.beam is None or float(np.hypot(*behind.beam)) < GRAZING:
        return np.zeros(2)
    return np.asarray(config.spot_radius_m * behind.beam)


def _placed(seen: TargetView, outline: Outline) -> Array | None:
    """Where a round face lies whose edge is not where the raster put it: a half hidden one."""
    uvw, _ = seen.on_face(SOUGHT * outline.size_m)
    return place_circle(uvw[:, :2], outline.size_m)


def _face(seen: TargetView, near: Array) -> Array:
    """Those of the points near an outline that lie on the face: (N, 2).

    Where those just off it are many more, a surface behind reaches the face by its noise.
    """
    uv, depth = near[:, :2], np.abs(near[:, 2])
    face, off = (
        uv[depth < seen.band_m],
        uv[(depth >= seen.band_m) & (depth < OFF_PLANE * seen.band_m)],
    )
    if len(face) == 0 or len(off) < MANY_OFF * len(face):
        return face
    return face[~outnumbered(face, off, CELL * seen.spacing_m)]


def _model_variance(
    edge_fit: EdgeFit, face: Array, outline: Outline, config: CentreConfig
) -> float:
    """What the model of the rim may be wrong by, m^2.

    It grows as the beams graze the face, at first by the cube of the tangent where they see the
    wall, which bends away from the straight line that the profile takes it for. A fit that
    did not stand still, needs an absurd brightness, or leaves many points unexplained, as of a
    scan from two places, is off by what the outline says.
    """
    square = float(edge_fit.beam @ edge_fit.beam)
    spread: float = (config.model_uncertainty_m * (1.0 + 2.0 * square)) ** 2
    spread += (WALL_SHARE * edge_fit.thickness_m / (1.0 + square / 4.0)) ** 2 * square**3
    bend = edge_fit.thickness_m**2 * square / (8.0 * outline.size_m)  # of the wall, along a beam
    beyond = edge_fit.misfit - MISFIT[0] - MISFIT_BY_BEND * max(bend - MIN_BEND_M, 0.0)
    doubt = min(max(beyond / (MISFIT[1] - MISFIT[0]), 0.0), 1.0)
    if not edge_fit.settled or not 1.0 / MAX_RATIO < edge_fit.reflectance_ratio < MAX_RATIO:
        doubt = 1.0
    if doubt == 0.0 and not outline.shows_rotation:
        return spread
    apart = (
        fit_outline(face, outline, (edge_fit.centre_m, edge_fit.turn_rad)).centre_m
        - edge_fit.centre_m
    )
    far = float(apart @ apart)
    if outline.shows_rotation:
        if far > WORST_APART_M**2:
            raise NotMeasuredError(
                "wrong-outline",
                f"the edges by their mixed ranges and by the face's points have centres "
                f"{math.sqrt(far) * 1e3:.1f} mm apart: the plate is not {outline.description}",
            )
        spread += max(far - APART_M**2, 0.0)
    return spread + doubt * (UNSETTLED_M**2 + far)
