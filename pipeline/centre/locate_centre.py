"""Centre of a target from its edges and its print; never the mean of its points."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..plane import PlaneFit
from ..system import frozen, stage
from ..targets import PatternTarget, Target
from ..uncertainty import UncertaintyComponent, centre_component, plane_component
from ..vectors import Array, turned
from .combine import CentreEstimate, CentreMethod, check_agreement, combined, reconciled
from .edge.solution import EdgeFit
from .edge_centre import EdgeCentre, centre_by_edge, centre_by_holes, in_common
from .in_plane_rotation import InPlaneRotation, PlaneRotation
from .target_view import TargetView

if TYPE_CHECKING:  # imported for boards alone
    from .pattern.fit_pattern import PatternFit

EDGE_SHIFT = 0.6  # of s sqrt(s / R) along an axis, s^2 / R across: shift of a centre by its edge


@frozen(eq=False)
class OtherCentre:
    """Centre by one of several methods: centre_m (3,) scanner frame."""

    method: CentreMethod
    centre_m: Array
    centre_covariance_m2: Array


@frozen
class StationSpread:
    """Stations whose fits of one target were joined, and the largest differences between them.

    significant: whether these are beyond their uncertainty, and beyond what is stated. share: of
    an error that each station has on its own in the mean.
    """

    count: int
    shift_m: float
    tilt_rad: float
    significant: bool
    share: float


@frozen(eq=False)
class TargetFit:
    """A measured target: its plane and its centre, in scanner coordinates.

    centre_m: (3,). normal: (3,) unit, sign free. components: of the uncertainty of both.
    plane_rms_m: over the points of the plane.
    method: 'rim' from the edge fit, 'outline' from the points alone, 'hole' or 'holes' from the
    edges of holes, 'pattern' from what is printed, 'combined' from several of these, which `others`
    then lists; 'points' from five points; of a bare wheel what its axis is that of, 'flange' of the
    rim or 'tyre'. marker_ids: of the markers that were found; wheel: that
    they name. turn: in-plane rotation; None of a disc or a ring, which show none. bulge_m: of a
    bare wheel by its flange, how far the tyre's widest ring stands out over the flange's edge.
    print_missed: why the target's print was not used; None where it was, or there is none.
    stations: that saw it, where they are several; what is not theirs together is that of the first.
    """

    centre_m: Array
    normal: Array
    components: tuple[UncertaintyComponent, ...]
    plane_rms_m: float
    points_on_target: int
    method: CentreMethod
    edge_fit: EdgeFit | None = None
    others: tuple[OtherCentre, ...] = ()
    marker_ids: tuple[int, ...] = ()
    wheel: str | None = None
    turn: InPlaneRotation | None = None
    bulge_m: float | None = None
    print_missed: Literal["no-intensity", "not-found"] | None = None
    stations: StationSpread | None = None

    @property
    def is_bare_wheel(self) -> bool:
        """Whether the wheel itself was measured, with nothing mounted on it."""
        return self.method in ("flange", "tyre")

    def sight_m(
        self, distance_m: float, scanner_m: Array | None, plane: PlaneFit | None = None
    ) -> Array:
        """Return the vector from the scanner to the centre (3,).

        From the mixed pixels, in the axes of `plane`; without an edge fit from the scanner's
        position scanner_m (3,), if it is known; else along the normal, from the stated distance.
        """
        if self.edge_fit is None or plane is None:
            return -distance_m * self.normal if scanner_m is None else self.centre_m - scanner_m
        away = self.edge_fit.beam @ plane.basis[:2] - plane.normal
        inverse = max(self.edge_fit.inverse_distance, 1.0 / (10.0 * distance_m))
        return np.asarray(away / inverse)

    def turn_rad(self, plane: PlaneFit) -> float:
        """Return the in-plane rotation of the target's axis u from the plane's; 0 if not seen."""
        if self.turn is None:
            return 0.0
        along, across = plane.basis[:2] @ self.turn.axis
        return math.atan2(across, along)

    @property
    def covariance(self) -> Array:
        """Covariance (6, 6) of the normal (rad), then the centre (m), by all components."""
        return np.asarray(
            sum((component.covariance for component in self.components), np.zeros((6, 6)))
        )

    @property
    def normal_covariance(self) -> Array:
        """Covariance (3, 3) of the normal, rad^2."""
        return self.covariance[:3, :3]

    @property
    def centre_covariance_m2(self) -> Array:
        """Covariance (3, 3) of the centre."""
        return self.covariance[3:, 3:]


@stage("centre")
def locate_centre(view: TargetView) -> TargetFit:
    """Locate the centre of a target in view, on the plane fitted to it.

    By the points around its edges where there is a background (see edge/fit_edge.py),
    otherwise by its outermost points; by its holes; and by its print. The results are weighted by
    their uncertainties. Raises NotMeasuredError 'no-outline', 'wrong-outline' or
    'centres-disagree'.
    """
    target = view.target
    outer = centre_by_edge(view, target.edge)
    inner = centre_by_holes(view, target.holes, outer) if target.holes else None
    printed = _printed(view, target, outer)
    estimates = [edge.estimate for edge in (outer, inner) if edge]
    if printed is not None and isinstance(target, PatternTarget):
        estimates.append(_by_pattern(printed, target, outer.edge_fit))
    by_plane = _at(view.plane, view.to_scanner(outer.estimate.centre_m))
    check_agreement(estimates, by_plane)
    common = in_common(outer, inner) if inner else None
    fitted = _fit(view, combined(reconciled(estimates, by_plane), common), outer.edge_fit)
    missed = isinstance(target, PatternTarget) and printed is None
    blind = view.patch.face_intensity is None
    others = (
        [_fit(view, estimate, outer.edge_fit) for estimate in estimates]
        if len(estimates) > 1
        else []
    )
    return replace(
        fitted,
        others=tuple(OtherCentre(f.method, f.centre_m, f.centre_covariance_m2) for f in others),
        marker_ids=printed.marker_ids if printed else (),
        wheel=printed.wheel if printed else None,
        print_missed=("no-intensity" if blind else "not-found") if missed else None,
    )


def on_plane(plane: PlaneFit, near_m: Array, unknown_m: float) -> TargetFit:
    """Return a target of which the plane alone is known, its centre nearest to near_m (3,).

    unknown_m: standard uncertainty of the centre in the plane.
    """
    centre_m = near_m - ((near_m - plane.centroid_m) @ plane.normal) * plane.normal
    nowhere = CentreEstimate(
        "points",
        np.zeros(2),
        unknown_m**2 * np.eye(2),
        np.zeros((2, 2)),
        np.zeros((2, 3)),
        math.inf,
    )
    lever_m = centre_m - plane.centroid_m
    components = (
        *_plane_components(plane, lever_m, nowhere),
        *_besides(plane, lever_m, nowhere),
        centre_component("centre noise", nowhere.noise_m2, plane.basis),
    )
    return TargetFit(centre_m, plane.normal, components, plane.rms_m, plane.count, "points")


def _printed(view: TargetView, target: Target, outer: EdgeCentre) -> PatternFit | None:
    """Find the printed pattern, if the target has one and the scan has intensities; else None."""
    intensity = view.patch.face_intensity
    if not isinstance(target, PatternTarget) or intensity is None:
        return None
    from .pattern.fit_pattern import IntensityPoints, find_pattern

    edge_fit = outer.edge_fit
    uvw, kept = view.on_face(target.radius_m)
    beam = np.zeros(2) if edge_fit is None else edge_fit.beam
    inverse = 0.0 if edge_fit is None else edge_fit.inverse_distance
    c, depth = outer.estimate.centre_m, -uvw[:, 2:]
    closest = c + (uvw[:, :2] - c - depth * beam) / (1.0 + inverse * depth)
    spot = view.config.spot_radius_m if edge_fit is None else edge_fit.spot_m
    intensity_points = IntensityPoints(closest, intensity[kept].astype(np.float64), beam, spot)
    return find_pattern(
        intensity_points, target, (c, outer.rotation_rad), side_known=edge_fit is not None
    )


def _by_pattern(
    printed: PatternFit, target: PatternTarget, edge_fit: EdgeFit | None
) -> CentreEstimate:
    """Return the estimate by the print.

    A plane higher by h, or tilted by g, moves features along the beams, where these are known: the
    pattern by what it is higher there, and the board's centre besides as the pattern rotates.
    """
    by_plane, rotated = np.zeros((2, 3)), _rotation_by_plane(printed, target, edge_fit)
    if edge_fit is not None:
        ((u, v),) = turned(np.array([target.offset]), printed.rotation_rad)
        by_plane = np.outer([v, -u], rotated) - np.outer(edge_fit.beam, [1.0, u, v])
    return CentreEstimate(
        method="pattern",
        centre_m=printed.centre_m,
        noise_m2=printed.covariance_m2,
        model_m2=target.print_shift**2 * np.eye(2),
        by_plane=by_plane,
        dof=printed.dof,
        rotation=PlaneRotation(
            mark="print",
            angle_rad=printed.rotation_rad,
            period_rad=target.print_period_rad,
            noise=printed.rotation_noise,
            model_rad2=0.0,
            by_plane=rotated,
        ),
    )


def _rotation_by_plane(
    printed: PatternFit, target: PatternTarget, edge_fit: EdgeFit | None
) -> Array:
    """Return derivatives (3,) of the print's rotation by the plane's height and slopes.

    Along beams h a slope g moves points q by -h (g.q), which rotates them by
    -sum (q x h)(g.q) / sum q.q.
    """
    if edge_fit is None:
        return np.zeros(3)
    q = turned(target.places_m - target.places_m.mean(axis=0), printed.rotation_rad)
    across = q[:, 0] * edge_fit.beam[1] - q[:, 1] * edge_fit.beam[0]
    return np.array([0.0, *(-(across @ q) / np.sum(q * q))])


def _fit(view: TargetView, estimate: CentreEstimate, edge_fit: EdgeFit | None) -> TargetFit:
    """Return the target by one estimate of its centre, with its uncertainty components."""
    plane, rotation = view.plane, estimate.rotation
    centre_m = view.to_scanner(estimate.centre_m)
    noise, model = estimate.noise_m2, estimate.model_m2
    if rotation is not None:
        noise, model = rotation.with_noise(noise), rotation.with_model(model)
    return TargetFit(
        centre_m=centre_m,
        normal=plane.normal,
        components=(
            *_plane_components(plane, centre_m - plane.centroid_m, estimate),
            *_besides(plane, centre_m - plane.centroid_m, estimate),
            *_rounding(plane, centre_m - plane.centroid_m, estimate, view.target.radius_m),
            centre_component("centre noise", noise, plane.basis, estimate.dof),
            centre_component("centre model", model, plane.basis),
        ),
        plane_rms_m=plane.rms_m,
        points_on_target=plane.count,
        method=estimate.method,
        edge_fit=edge_fit,
        turn=rotation.in_scan(plane.basis) if rotation else None,
    )


def _plane_components(
    plane: PlaneFit, lever_m: Array, estimate: CentreEstimate
) -> list[UncertaintyComponent]:
    """Return components of the plane's scatter: independent noise, correlated noise, flatness."""
    correlated = plane.correlated
    by_plane = estimate.by_plane
    rotation = None if estimate.rotation is None else estimate.rotation.by_plane
    return [
        plane_component(name, covariance, plane.basis, lever_m, by_plane, dof, rotation)
        for name, covariance, dof in (
            ("plane noise", plane.noise_covariance, math.inf),
            ("correlated noise", correlated.covariance, correlated.dof),
            ("flatness", correlated.form_covariance, correlated.dof),
        )
        if covariance.any() or name == "plane noise"
    ]


def _besides(
    plane: PlaneFit, lever_m: Array, estimate: CentreEstimate
) -> list[UncertaintyComponent]:
    """Return components of what is fitted with the plane: range by brightness, a lattice's pull."""
    rotation = None if estimate.rotation is None else estimate.rotation.by_plane
    fitted = {"brightness": plane.brightness, "thinning": plane.thinning}
    return [
        plane_component(
            name,
            part.covariance,
            plane.basis,
            lever_m,
            estimate.by_plane,
            turn_by_plane=rotation,
        )
        for name, part in fitted.items()
        if part is not None
    ]


def _rounding(
    plane: PlaneFit, lever_m: Array, estimate: CentreEstimate, radius_m: float
) -> list[UncertaintyComponent]:
    """Return the component of rounded coordinates: of the plane, and of the centre in it.

    Where an edge runs along an axis of the coordinates, all its points are rounded alike: on an arc
    of sqrt(s R). Steps across the plane move which points are the edge's, by about s^2 / R. The
    factor is measured on synthetic scans (tests/bench/rounding.py).
    """
    if plane.rounding is None:
        return []
    rotation = None if estimate.rotation is None else estimate.rotation.by_plane
    covariance = plane.rounding.covariance
    by_plane = plane_component(
        "rounding",
        covariance,
        plane.basis,
        lever_m,
        estimate.by_plane,
        turn_by_plane=rotation,
    )
    steps = plane.rounding.steps
    shift_m = EDGE_SHIFT * steps.step_m * np.sqrt(steps.step_m / radius_m)
    across = (steps.axes * shift_m[:, None]) @ plane.basis[:2].T
    depth_m = EDGE_SHIFT * plane.rounding.step_m**2 / radius_m
    shift = plane.basis[:2].T @ np.hstack([across.T, depth_m * np.eye(2)])
    in_plane = np.vstack([np.zeros_like(shift), shift])
    turn = None if by_plane.turn is None else np.append(by_plane.turn, np.zeros(shift.shape[1]))
    return [replace(by_plane, factor=np.hstack([by_plane.factor, in_plane]), turn=turn)]


def _at(plane: PlaneFit, centre_m: Array) -> Array:
    """Return the covariance (3, 3) of the plane's height at the centre (3,) and of its slopes."""
    carried = np.eye(3)
    carried[0, 1:] = plane.basis[:2] @ (centre_m - plane.centroid_m)
    covariance = plane.point_covariance + plane.correlated.covariance
    return np.asarray(carried @ covariance @ carried.T)
