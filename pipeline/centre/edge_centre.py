"""Centre of a target from one of its outlines: by the fit of its edge, or its outermost points."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from ..config import CentreConfig
from ..detection import OFF_PLANE, outnumbered
from ..errors import NotMeasuredError
from ..system import frozen
from ..targets import Circle, Holes, Outline, Polygon
from ..vectors import Array
from .combine import CentreEstimate, CentreMethod
from .edge.beam_direction import STEEPEST
from .edge.beams import CENTRE, INVERSE, PARALLEL, ROTATION, Prior
from .edge.fit_edge import (
    Aim,
    Behind,
    EdgeToFit,
    aimed,
    first_explained,
    fit_edge,
    fit_intensities,
    look_behind,
    square_on,
)
from .edge.mixed_pixel import EITHER, TAKEN_FOR
from .edge.solution import ANY_PART, AS_MUCH, EdgeFit, common_m2
from .edge.stated_size import (
    SURE_MISFIT,
    beside_m,
    check_diameter,
    check_sides,
    check_size,
    explained_m,
    fits_size,
    wider_by_ends_m,
)
from .in_plane_rotation import PlaneRotation
from .outline_fit import (
    MIN_DIRECTIONS,
    OutlineFit,
    check_alone,
    check_outline,
    fit_outline,
    middle_end_m,
    place_circle,
)
from .target_view import TargetView
from .uncut_edges import empty_arcs, in_sectors, uncut_arcs, uncut_sectors

# Logs of the thickness between two edges of one plate, from which the second is doubtful, or none:
# three and eight times what is known beforehand. Something before the background, just beyond the
# wall, passes for more of that then, and moves the centre.
DOUBTFUL, OTHER_PLATE = 0.15, 0.4
OUTLINE_EDGE_M = 5e-4  # shift of an outline by a usual footprint (k = 1)
# Shift of an outline without background, of its footprint's radius, and at least, by what its edge
# is not; with a background of unknown direction, where the wall returns part of the footprint.
OUTLINE_EDGE, LEAST_EDGE_M, UNEXPLAINED_EDGE = 1.0 / 3.0, 1e-4, 1.1 / 1.5
SHORT, U_SHORT = 0.5, 0.3  # shift of the centre and its u, of the footprint at the far edge
GRAZING = 1.3  # slope of beams, 52 degrees, from which it shifts
LOST_M = 2e-3  # uncertainty above which an edge fit gives way to the outline
UNCONVERGED_M = 3e-4  # model uncertainty of an edge fit that did not converge
BY_THICKNESS = 0.4  # of what an unknown thickness would move a centre: model uncertainty
WALL_SHARE = 2e-3  # of thickness times tan^3 of the incidence: model uncertainty by the wall
CLEAN_SHARE = 0.015  # of the shift of a clean edge: model uncertainty by what the scanner reports
ALONG_BEAMS, ACROSS_BEAMS = 1.25, 0.4  # shift of a centre by backgrounds, of that of the parts
INTENSITY_SHARE = 0.004  # of the footprint: model uncertainty by how intensities fade over an edge
MISFIT = (SURE_MISFIT, 0.09)  # share of outliers at which doubt begins, and is complete
MISFIT_BY_BEND, MIN_BEND_M = 30.0, 1e-3  # outliers by a curved wall, per metre of bend
# Difference of straight edges by mixed pixels and by points, of its standard uncertainty:
# tolerated; proof of another shape.
APART, WORST_APART = 3.0, 5.0
FULL_SLOPE = 0.5  # of the beams, from which a whole radius of the footprint meets the wall
# Of the spacing: half the difference of two edges that rows of points run along, each of whose last
# rows lies anywhere within a spacing of it: 1 / sqrt(24).
ROWS = 0.2
LEAST_ARC = 0.4  # of a round edge, not cut by a crop, to be fitted alone
BY_SPACING = 0.1  # of the spacing: how far inside the edge the outermost points may lie all round
OFF_INVERSE = 0.45  # 1/m, from the distance that a fit begins at: one and a half of its prior
# 1/m: of a scanner at 0.7 m, whose beams are less alike than is assumed first; what a fit leaves
# unexplained and of the edge covers, beyond which it may have been at such a distance.
NEAR_INVERSE, MOST_UNEXPLAINED, WELL_COVERED = 1.4, 0.52, 0.8
UNSETTLED = 1.5  # of what a fit leaves unexplained that did not converge: what another may leave
MAX_RATIO = 50.0  # reflectance ratio, or its inverse, beyond which a fit is implausible
CELL = 2.0  # of the spacing: cells in which points on and off the target are counted
MANY_OFF = 0.05  # points off the target, of those on it: below, no other surface is that near
SOUGHT = 1.5  # of its size: radius about the matched template in which its points lie
# Spacing from which, and match of a partly hidden target below which, the edge's start must be
# better than the template's position: 20 mm off half a disc of 250 mm.
SPARSE_M, HIDDEN = 0.006, 0.9
# Standard deviations of an edge's growth at which doubt begins; share of its movement into the
# centre.
STRANGE_SIZE, BY_GROWTH = 2.0, 0.6
BY_SIZE = 0.4  # of what an unknown size would move a clean edge's centre: largest u, where likely
GENTLE = 1.0  # slope below which all points that matter lie within target_view.GENTLE_SLOPE


@frozen
class EdgeCentre:
    """Centre from one outline, in-plane rotation of the target's axes, edge fit if there is one."""

    estimate: CentreEstimate
    rotation_rad: float
    edge_fit: EdgeFit | None


def centre_by_edge(view: TargetView, outline: Outline) -> EdgeCentre:
    """Locate the centre by the outer edge.

    Raises NotMeasuredError 'no-outline' or 'wrong-outline'.
    """
    start = np.zeros(2), 0.0
    try:
        if _is_rough(view, outline):
            first = _by_outermost(view, outline)
            start = first.centre_m, first.rotation_rad
        found = _by_edge(view, outline, start, "rim", None)
    except NotMeasuredError as error:
        hidden = error.status == "no-outline" and not outline.shows_rotation
        other = _placed(view, outline) if hidden else None
        if other is None:
            raise
        found = _by_edge(view, outline, (other, 0.0), "rim", None)
    if found is None:
        raise NotMeasuredError(
            "no-outline", f"less than a quarter of the edge of {outline.description} is in the scan"
        )
    return found


def rough_pose(view: TargetView) -> tuple[Array, float] | None:
    """Return centre (3,) and in-plane rotation by the outermost points.

    None where detection is as near, where a part is hidden, or where they show none.
    """
    outline = view.target.edge
    if view.patch.match < HIDDEN or not _is_rough(view, outline):
        return None
    try:
        found = _by_outermost(view, outline)
    except NotMeasuredError:
        return None
    return view.to_scanner(found.centre_m), found.rotation_rad


def _is_rough(view: TargetView, outline: Outline) -> bool:
    """Return whether detection places a target less well than its outermost points do."""
    sparse = view.spacing_m > SPARSE_M or view.patch.match < HIDDEN
    return outline.shows_rotation or sparse


def _by_outermost(view: TargetView, outline: Outline) -> OutlineFit:
    """Fit an outline to the outermost points about where detection placed the target."""
    return fit_outline(_on_target(view, view.near(outline, (np.zeros(2), 0.0))), outline)


def centre_by_holes(view: TargetView, holes: Holes, outer: EdgeCentre) -> EdgeCentre | None:
    """Locate the centre by the edges of holes, from the pose by the outer edge; None if hidden."""
    start = outer.estimate.centre_m, outer.rotation_rad
    try:
        return _by_edge(view, holes, start, "holes" if holes.shows_rotation else "hole", outer)
    except NotMeasuredError as error:
        if error.status == "no-outline":
            return None
        raise


def _by_edge(
    view: TargetView,
    outline: Outline,
    start: tuple[Array, float],
    method: CentreMethod,
    beside: EdgeCentre | None,
) -> EdgeCentre | None:
    """Locate the centre by one outline; None where less than a quarter of the edge is in the scan.

    beside: another edge of the same target.
    """
    plane, config = view.plane, view.config
    flat, near = view.flat_and_even(outline, start, OFF_PLANE * view.band_m)
    face = _on_target(view, flat)
    known = beside.edge_fit if beside else None
    aim = None if known else _aimed(view, near, outline, start)
    edge_fit = (
        None if beside and not known else _by_mixed_pixels(view, outline, start, near, known or aim)
    )
    thicker = abs(math.log(edge_fit.thickness_m / known.thickness_m)) if edge_fit and known else 0.0
    if thicker > OTHER_PLATE:
        return None
    if outline.shows_rotation:
        face, near, edge_fit = _uncut(view, outline, start, (face, near), edge_fit, known or aim)
    elif edge_fit is not None:
        near, edge_fit = _uncut_arcs(view, outline, near, edge_fit, known or aim)
    if edge_fit is not None and isinstance(outline, Polygon):
        edge_fit = _with_right_sides(view, outline, start, near, edge_fit, known or aim)
    if edge_fit is not None:
        check_size(edge_fit, outline, config.spot_radius_m)
    model = None if edge_fit is None else _model_variance(edge_fit, face, outline, view)
    if edge_fit is not None and model is not None and _is_lost(edge_fit, model, outline):
        edge_fit = None
    if edge_fit is None or model is None:
        fitted = fit_outline(face, outline, start)
        check_alone(fitted, outline)
        begun = known or aim
        behind = look_behind(near, outline, config, start, begun.state if begun else None)
        grazing_m = _grazing(behind, config)
        share = UNEXPLAINED_EDGE if behind.seen and behind.beam is None else OUTLINE_EDGE
        edge_m = max(share * config.spot_radius_m, LEAST_EDGE_M, _rows_m(view, outline))
        edge_m = math.hypot(edge_m, _cut_m(view, near, outline, fitted))
        centre, rotation = fitted.centre_m + SHORT * grazing_m, fitted.rotation_rad
        method = "outline" if method == "rim" else method
        estimate = CentreEstimate(
            method=method,
            centre_m=centre,
            noise_m2=fitted.covariance_m2,
            model_m2=edge_m**2 * np.eye(2) + U_SHORT**2 * np.outer(grazing_m, grazing_m),
            by_plane=np.zeros((2, 3)),
            dof=math.inf,
            rotation=_rotation(view, outline, fitted, edge_m**2, np.zeros(3)),
        )
    else:
        centre, rotation = edge_fit.centre_m, edge_fit.rotation_rad
        aside_m2 = model + (ACROSS_BEAMS * edge_fit.unlike_m) ** 2
        shown = _rotation(view, outline, edge_fit, aside_m2, edge_fit.rotation_by_plane)
        estimate = CentreEstimate(
            method,
            centre,
            edge_fit.covariance_m2,
            model * np.eye(2) + _by_backgrounds(edge_fit) + _by_form(edge_fit),
            edge_fit.by_plane,
            edge_fit.dof,
            shown,
            doubtful=thicker > DOUBTFUL,
        )
    slope = 1.0 if edge_fit is None else float(np.hypot(*edge_fit.beam))
    noise_m, shown_m = plane.sigma_m * slope, beside_m(edge_fit) if edge_fit else 0.0
    if not check_outline(face, outline, centre, rotation, view.spacing_m, noise_m, shown_m):
        return None
    if isinstance(outline, Circle) and (known or aim):
        fit = partial(_by_mixed_pixels, view, start=start, near=near, begin=known or aim)
        ends_m = middle_end_m(face, outline, centre)
        check_diameter(edge_fit, outline, ends_m, noise_m, config.spot_radius_m, fit)
    return EdgeCentre(estimate, rotation, edge_fit)


def _rotation(
    view: TargetView,
    outline: Outline,
    fitted: EdgeFit | OutlineFit,
    model_m2: float,
    by_plane: Array,
) -> PlaneRotation | None:
    """Return the target's in-plane rotation where the edges show it, else None.

    The model's uncertainty, spread over the edges as noise that moves the centre as far, rotates
    them by its amount over sqrt(2) times the rms lever of the edges.
    """
    if not outline.shows_rotation:
        return None
    return PlaneRotation(
        mark="edges",
        angle_rad=fitted.rotation_rad,
        period_rad=view.target.turn_period_rad,
        noise=fitted.rotation_noise,
        model_rad2=model_m2 / (2.0 * view.target.region.lever_m2),
        by_plane=by_plane,
    )


def _rows_m(view: TargetView, outline: Outline) -> float:
    """Return the standard uncertainty of a centre by outermost points whose rows run along edges.

    Rows along one edge do so along the opposite one, too; an arc has points of many rows.
    """
    return ROWS * view.spacing_m if outline.shows_rotation else 0.0


def _cut_m(view: TargetView, near: Array, outline: Outline, fitted: OutlineFit) -> float:
    """Return the standard uncertainty of a round outline that a round crop may have cut.

    Such a crop leaves points that end inside the stated outline, not evenly, or where their
    background ends, and nothing beyond them; the middle is then elsewhere by about as much as they
    end inside all round. near: points (N, 3) about the outline, at all depths.
    """
    if outline.shows_rotation:
        return 0.0
    kept = uncut_arcs(near, outline, fitted.centre_m, view.band_m, view.spacing_m)
    if kept is None and not fitted.is_uneven:
        return 0.0
    empty = float(np.mean(empty_arcs(near, outline, fitted.centre_m)))
    return empty * max(-fitted.growth_m - BY_SPACING * view.spacing_m, 0.0)


def _explains_more(other: EdgeFit, found: EdgeFit, spot_m: float) -> bool:
    """Return whether another fit leaves less unexplained, by the stated size or nearer to it.

    Half as much more may be left where the one found did not converge.
    """
    if not found.converged:
        return other.converged and other.unexplained < UNSETTLED * found.unexplained
    sized = abs(other.growth_m) < abs(found.growth_m) or fits_size(other, spot_m)
    return other.converged and sized and AS_MUCH * other.unexplained < found.unexplained


def _is_likely(edge_fit: EdgeFit, begin: Aim | None, spot_m: float) -> bool:
    """Return whether a fit converged, at about the stated size and the distance it began at."""
    nearer = 0.0 if begin is None else edge_fit.inverse_distance - begin.state[INVERSE]
    return edge_fit.converged and fits_size(edge_fit, spot_m) and abs(nearer) < OFF_INVERSE


def _is_lost(edge_fit: EdgeFit, model_m2: float, outline: Outline) -> bool:
    """Return whether an edge fit is less certain than the outermost points would be.

    So are straight edges of which only parallel ones show: along them next to nothing does.
    """
    sure, unsure = np.linalg.eigvalsh(edge_fit.covariance_m2)
    if outline.shows_rotation and sure < MIN_DIRECTIONS * unsure and unsure > OUTLINE_EDGE_M**2:
        return True
    return float(np.trace(edge_fit.covariance_m2)) / 2.0 + model_m2 > LOST_M**2


def _with_right_sides(
    view: TargetView,
    outline: Polygon,
    start: tuple[Array, float],
    near: Array,
    edge_fit: EdgeFit,
    begin: EdgeFit | Aim | None,
) -> EdgeFit:
    """Return the fit, or one that finds a side that it had lost; see `check_sides`.

    near, begin: as in `_by_mixed_pixels`.
    """
    fit = partial(_by_mixed_pixels, view, start=start, near=near, begin=begin)
    first = begin or edge_fit
    wider_m = wider_by_ends_m(near, outline, edge_fit.state, view.band_m)

    def look(other: Polygon) -> float:
        return first_explained(near, _edge(view, other), first)

    def refit(other: EdgeFit) -> EdgeFit | None:
        station = begin.station if isinstance(begin, Aim) else None
        return fit_edge(near, _edge(view, outline), Aim(other.state, station))

    mixed = begin is not None and edge_fit.clean_shift_m is None
    return check_sides(edge_fit, outline, wider_m, fit, look if mixed else None, refit)


def _aimed(
    view: TargetView,
    near: Array,
    outline: Outline,
    start: tuple[Array, float],
    inverse: float | None = None,
) -> Aim | None:
    return aimed(near, outline, view.target.thickness, view.config, start, view.station, inverse)


def _edge(view: TargetView, outline: Outline) -> EdgeToFit:
    """Return an outline of the target as an edge to fit."""
    target = view.target
    chamfer_m, roundness = target.chamfer, EITHER if target.chamfer is None else 0.0
    if target.edge_radius is not None:
        chamfer_m, roundness = TAKEN_FOR * target.edge_radius, 1.0
    sigma_m = view.plane.sigma_m
    return EdgeToFit(outline, target.thickness, sigma_m, view.config, chamfer_m, roundness)


def _by_mixed_pixels(
    view: TargetView,
    outline: Outline,
    start: tuple[Array, float],
    near: Array,
    begin: EdgeFit | Aim | None,
) -> EdgeFit | None:
    """Fit an edge to its mixed pixels; where the beams are steep, again with points farther aside.

    To intensities, where nothing behind the edge shows the beams' direction. Where a fit is not
    likely, again with beams from the distance that it found, and from near by: a wrong one to start
    from leads to such solutions, too.
    near: points (N, 3 or 5) about the outline. begin: as in `fit_edge`; None: found from more.
    """
    edge = _edge(view, outline)
    edge_fit = None if begin is None else fit_edge(near, edge, begin)
    if edge_fit is not None and float(np.hypot(*edge_fit.beam)) < GENTLE:
        spot_m = view.config.spot_radius_m
        if isinstance(begin, EdgeFit):
            return edge_fit
        poor = edge_fit.unexplained > MOST_UNEXPLAINED and edge_fit.covered < WELL_COVERED
        inverses = [NEAR_INVERSE] if poor else []
        if not _is_likely(edge_fit, begin, spot_m):
            inverses = [edge_fit.inverse_distance, NEAR_INVERSE]
        for inverse in inverses:
            aim = _aimed(view, near, outline, start, inverse)
            other = None if aim is None else fit_edge(near, edge, aim)
            if other and _explains_more(other, edge_fit, spot_m):
                edge_fit = other
            if edge_fit.converged and fits_size(edge_fit, spot_m):
                break
        return edge_fit
    near = view.near(outline, start, STEEPEST, even=True)
    if not isinstance(begin, EdgeFit):
        first = replace(begin, state=edge_fit.state) if begin and edge_fit else None
        begin = first or _aimed(view, near, outline, start)
    if begin is not None:
        return fit_edge(near, edge, begin) or edge_fit
    begin = square_on(view.target.thickness, view.config, start)
    return fit_intensities(near, edge, begin)


def _uncut(
    view: TargetView,
    outline: Outline,
    start: tuple[Array, float],
    points: tuple[Array, Array],
    edge_fit: EdgeFit | None,
    begin: EdgeFit | Aim | None,
) -> tuple[Array, Array, EdgeFit | None]:
    """Leave out the edges that a crop may have cut, and fit to the others where there was a fit.

    points: on the target (N, 2) and about the outline (M, 3). begin: as in `fit_edge`.
    """
    face, near = points
    if edge_fit is None:
        fitted = fit_outline(face, outline, start)
        state = Prior.of(None, view.config).mean
        state[CENTRE], state[ROTATION] = fitted.centre_m, fitted.rotation_rad
    else:
        state = edge_fit.state
    kept = uncut_sectors(near, face, outline, state, view.band_m, view.spacing_m)
    if kept is None:
        return face, near, edge_fit
    face = face[in_sectors(kept, face, np.zeros(len(face)), outline, state)]
    if edge_fit is not None:
        if float(np.hypot(*edge_fit.beam)) > GENTLE:
            pose = edge_fit.centre_m, edge_fit.rotation_rad
            near = view.near(outline, pose, STEEPEST, even=True)
        near = near[in_sectors(kept, near[:, :2], -near[:, 2], outline, state)]
        begin = replace(begin, state=state) if isinstance(begin, Aim) else begin or edge_fit
        edge_fit = fit_edge(near, _edge(view, outline), begin)
    return face, near, edge_fit


def _uncut_arcs(
    view: TargetView,
    outline: Outline,
    near: Array,
    edge_fit: EdgeFit,
    begin: EdgeFit | Aim | None,
) -> tuple[Array, EdgeFit | None]:
    """Leave out the arcs of a round edge that a crop may have cut, and fit to the others.

    None where these are less than LEAST_ARC of it: what of the edge was left then looks whole.
    near, begin: as in `_by_mixed_pixels`.
    """
    kept = uncut_arcs(near, outline, edge_fit.centre_m, view.band_m, view.spacing_m)
    if kept is None:
        return near, edge_fit
    if float(np.mean(kept)) < LEAST_ARC:
        return near, None
    near = near[in_sectors(kept, near[:, :2], -near[:, 2], outline, edge_fit.state)]
    return near, fit_edge(near, _edge(view, outline), begin or edge_fit)


def _grazing(behind: Behind, config: CentreConfig) -> Array:
    """Return the footprint's length across the far edge (2,): spot radius times slope of the beams.

    There it falls on the background; on the near side it falls on the target's wall. Zero where
    the direction of the beams is unknown, or where they are not grazing.
    """
    if behind.beam is None or float(np.hypot(*behind.beam)) < GRAZING:
        return np.zeros(2)
    return np.asarray(config.spot_radius_m * behind.beam)


def _placed(view: TargetView, outline: Outline) -> Array | None:
    """Return the position of a partly hidden disc, which template matching placed wrongly."""
    uvw, _ = view.on_face(SOUGHT * outline.size_m)
    return place_circle(uvw[:, :2], outline.size_m)


def _on_target(view: TargetView, near: Array) -> Array:
    """Return the points near an outline that lie on the target: (N, 2).

    Points where those just off it are many more belong to a noisy surface behind it.
    """
    uv, depth = near[:, :2], np.abs(near[:, 2])
    face, off = (
        uv[depth < view.band_m],
        uv[(depth >= view.band_m) & (depth < OFF_PLANE * view.band_m)],
    )
    if len(face) == 0 or len(off) < MANY_OFF * len(face):
        return face
    return face[~outnumbered(face, off, CELL * view.spacing_m)]


def _model_variance(edge_fit: EdgeFit, face: Array, outline: Outline, view: TargetView) -> float:
    """Return the model variance of the edge fit, m^2.

    It grows with the incidence, at first by the cube of its tangent, as the beams see more of the
    wall, which is curved where the profile takes it for straight; by the shift of a clean edge, or
    the footprint over which its intensities fade; by rows of points that run along its sides; and
    by a growth that the target's size hardly explains: where a clean edge shows neither the one nor
    the other, by what it would move.
    A fit that did not converge, has an implausible reflectance ratio or beams that do not meet, or
    leaves many outliers, as in a scan from two stations, is given its difference from the outline
    by points.
    """
    square = float(edge_fit.beam @ edge_fit.beam)
    spread: float = (view.config.model_uncertainty_m * (1.0 + 2.0 * square)) ** 2
    spread += (WALL_SHARE * edge_fit.thickness_m / (1.0 + square / 4.0)) ** 2 * square**3
    spread += (CLEAN_SHARE * (edge_fit.clean_shift_m or 0.0)) ** 2 + edge_fit.rows_m**2 / 2.0
    if edge_fit.exponent is not None:
        spread += (INTENSITY_SHARE * edge_fit.spot_m) ** 2
    grown_m = max(
        abs(edge_fit.growth_m) - STRANGE_SIZE * explained_m(edge_fit, edge_fit.growth_u_m), 0.0
    )
    if edge_fit.by_size_m is not None:
        share = min(BY_SIZE**2 if grown_m == 0.0 else 1.0, edge_fit.size_chance)
        spread += share * float(edge_fit.by_size_m @ edge_fit.by_size_m)
    if edge_fit.by_size_m is None or edge_fit.size_chance == 1.0:
        spread += (BY_GROWTH * grown_m) ** 2
    bend = edge_fit.thickness_m**2 * square / (8.0 * outline.size_m)  # of the wall, along a beam
    beyond = edge_fit.misfit - MISFIT[0] - MISFIT_BY_BEND * max(bend - MIN_BEND_M, 0.0)
    doubt = min(max(beyond / (MISFIT[1] - MISFIT[0]), 0.0), 1.0)
    ratio, inverse = edge_fit.reflectance_ratio, edge_fit.inverse_distance
    likely = edge_fit.is_clean or (1.0 / MAX_RATIO < ratio < MAX_RATIO and inverse > PARALLEL)
    if not (edge_fit.converged and likely):
        doubt = 1.0
    if doubt == 0.0 and not outline.shows_rotation:
        return spread
    apart = (
        fit_outline(face, outline, (edge_fit.centre_m, edge_fit.rotation_rad)).centre_m
        - edge_fit.centre_m
    )
    far = float(apart @ apart)
    if outline.shows_rotation:
        apart = apart - _by_footprint(edge_fit, apart)
        rest = float(apart @ apart)
        by_points = max(OUTLINE_EDGE_M, _rows_m(view, outline)) ** 2
        by_points += (ALONG_BEAMS * edge_fit.unlike_m) ** 2
        if rest > WORST_APART**2 * by_points:
            raise NotMeasuredError(
                "wrong-outline",
                f"the centres by the edge's fit and by the outermost points lie "
                f"{math.sqrt(far) * 1e3:.1f} mm apart: check whether the target is "
                f"{outline.description}",
            )
        spread += max(rest - APART**2 * by_points, 0.0)
    return spread + doubt * (UNCONVERGED_M**2 + far)


def _by_backgrounds(edge_fit: EdgeFit) -> Array:
    """Return the covariance (2, 2) of a centre by backgrounds of unlike brightness.

    Slanted beams see other things behind the near edge than behind the far one, so that a clean
    edge is moved along them by about as much as its parts are; across, by a share of that. Measured
    on the rims and holes of 60 synthetic targets. Any part of what a background's light would move
    may be so.
    """
    slope = float(np.hypot(*edge_fit.beam))
    along = edge_fit.beam / slope if slope > 0.0 else np.zeros(2)
    shares = ACROSS_BEAMS**2 * np.eye(2)
    shares += (ALONG_BEAMS**2 - ACROSS_BEAMS**2) * np.outer(along, along)
    unlike_m2 = np.asarray(edge_fit.unlike_m**2 * shares)
    if edge_fit.by_light_m is None:
        return unlike_m2
    return unlike_m2 + ANY_PART**2 * np.outer(edge_fit.by_light_m, edge_fit.by_light_m)


def in_common(first: EdgeCentre, other: EdgeCentre) -> tuple[Array, Array] | None:
    """Return the covariances (2, 2) of the centre by another edge of a plate with the first's.

    Of noise, and of model; None where either is that of the outermost points.
    """
    if first.edge_fit is None or other.edge_fit is None:
        return None
    form_m2 = form_moves_m(other.edge_fit) @ form_moves_m(first.edge_fit).T
    return common_m2(other.edge_fit, first.edge_fit), np.asarray(form_m2)


def form_moves_m(edge_fit: EdgeFit) -> Array:
    """Return by how far (2, 3) the form of an edge may move a centre, as far as it is in doubt.

    By its thickness; by its chamfer, where that is not stated, and by what a rounded edge would
    move: the fit is of one between both. Each moves the centre along one line, that of the beams.
    """
    moves_m = np.zeros((2, 3))
    if edge_fit.by_thickness_m is not None:
        moves_m[:, 0] = BY_THICKNESS * edge_fit.by_thickness_m
    if edge_fit.by_chamfer_m is not None:
        moves_m[:, 1] = edge_fit.by_chamfer_m
    if edge_fit.by_round is not None:
        width_m = math.hypot(edge_fit.chamfer_m, edge_fit.chamfer_u_m)
        moves_m[:, 2] = EITHER * width_m * edge_fit.by_round
    return moves_m


def _by_form(edge_fit: EdgeFit) -> Array:
    """Return the covariance (2, 2) of a centre by the form of an edge."""
    moves_m = form_moves_m(edge_fit)
    return np.asarray(moves_m @ moves_m.T)


def _by_footprint(edge_fit: EdgeFit, apart_m: Array) -> Array:
    """Return what the footprint explains of how far the outermost points lie from an edge fit (2,).

    Beams that meet the near edge and the wall below it return points beside the edge; those that
    meet the far edge and the background do not. The middle of the outermost points lies against the
    beams by up to a footprint's radius.
    """
    slope = float(np.hypot(*edge_fit.beam))
    along = edge_fit.beam / max(slope, 1e-9)
    most_m = edge_fit.spot_m * min(slope / FULL_SLOPE, 1.0)
    return np.asarray(np.clip(along @ apart_m, -most_m, 0.0) * along)
