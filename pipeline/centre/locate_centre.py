"""The centre of a target's face from its edges and its print; never the mean of its points."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..config import CentreConfig
from ..plane import Patch, PlaneFit
from ..targets import PatternTarget, Target
from ..uncertainty import UncertaintyComponent, centre_component, plane_component
from ..vectors import Array
from ..vectors import turned as turned_by
from .combine import Estimate, Method, check_agreement, combined
from .edge.fit_edge import EdgeFit
from .edge_centre import EdgeCentre, centre_by_edge, centre_by_holes
from .in_plane_rotation import InPlaneRotation, PlaneTurn
from .pattern.fit_pattern import IntensityPoints, PatternFit, find_pattern
from .target_view import TargetView


@dataclass(frozen=True)
class OtherCentre:
    """One of several ways to a centre: centre_m (3,) scanner frame."""

    method: Method
    centre_m: Array
    centre_covariance_m2: Array


@dataclass(frozen=True)
class TargetFit:
    """A measured target: its plane and its centre, in scanner coordinates.

    centre_m: (3,). normal: (3,) unit, sign free. causes: of the uncertainty of both.
    plane_rms_m: over the points of the plane.
    method: 'rim' from mixed ranges, 'outline' from the points alone, 'hole' or 'holes' from the
    edges of holes, 'pattern' from what is printed, 'combined' from several of these, which `others`
    then lists; 'points' from five points. marker_ids: of the markers that were seen; wheel: that
    they name. turn: of the face about its normal; None of a disc or a ring, which show none.
    """

    centre_m: Array
    normal: Array
    components: tuple[UncertaintyComponent, ...]
    plane_rms_m: float
    points_on_target: int
    method: Method
    edge_fit: EdgeFit | None = None
    others: tuple[OtherCentre, ...] = ()
    marker_ids: tuple[int, ...] = ()
    wheel: str | None = None
    turn: InPlaneRotation | None = None

    def sight_m(self, plane: PlaneFit, distance_m: float) -> Array:
        """Return the vector from the scanner to the centre (3,), as the mixed pixels tell it.

        Without them: along the normal of `plane`, from the stated distance.
        """
        if self.edge_fit is None:
            return -distance_m * plane.normal
        away = self.edge_fit.beam @ plane.basis[:2] - plane.normal
        inverse = max(self.edge_fit.inverse_distance, 1.0 / (10.0 * distance_m))
        return np.asarray(away / inverse)

    @property
    def covariance(self) -> Array:
        """(6, 6) of the normal (rad), then the centre (m), by all causes."""
        return np.asarray(
            sum((component.covariance for component in self.components), np.zeros((6, 6)))
        )

    @property
    def normal_covariance(self) -> Array:
        """(3, 3), rad^2."""
        return self.covariance[:3, :3]

    @property
    def centre_covariance_m2(self) -> Array:
        """(3, 3)."""
        return self.covariance[3:, 3:]


def locate_centre(patch: Patch, plane: PlaneFit, target: Target, config: CentreConfig) -> TargetFit:
    """Centre of the target in `patch`, on the fitted plane.

    By the mixed ranges around its edges where there is a background (see rim.py); otherwise by the
    outermost points of the face; by its holes, and by what is printed on it. What these give is
    weighted by their uncertainties. Raises NotMeasuredError 'no-outline', 'wrong-outline' or
    'centres-disagree'.
    """
    seen = TargetView(patch, plane, target, config)
    outer = centre_by_edge(seen, target.edge)
    inner = centre_by_holes(seen, target.holes, outer) if target.holes else None
    printed = _printed(seen, target, outer)
    estimates = [edge.estimate for edge in (outer, inner) if edge]
    if printed is not None and isinstance(target, PatternTarget):
        estimates.append(_by_pattern(printed, target, outer.edge_fit))
    check_agreement(estimates, _at(plane, seen.to_scanner(outer.estimate.centre_m)))
    fitted = _fit(seen, combined(estimates), outer.edge_fit)
    others = (
        [_fit(seen, estimate, outer.edge_fit) for estimate in estimates]
        if len(estimates) > 1
        else []
    )
    return replace(
        fitted,
        others=tuple(OtherCentre(f.method, f.centre_m, f.centre_covariance_m2) for f in others),
        marker_ids=printed.marker_ids if printed else (),
        wheel=printed.wheel if printed else None,
    )


def _printed(seen: TargetView, target: Target, outer: EdgeCentre) -> PatternFit | None:
    """The pattern on the face, where there is one, and the scan has intensities that show it."""
    intensity = seen.patch.face_intensity
    if not isinstance(target, PatternTarget) or intensity is None:
        return None
    edge_fit = outer.edge_fit
    uvw, kept = seen.on_face(target.radius_m)
    beam = np.zeros(2) if edge_fit is None else edge_fit.beam
    inverse = 0.0 if edge_fit is None else edge_fit.inverse_distance
    c, depth = outer.estimate.centre_m, -uvw[:, 2:]
    closest = c + (uvw[:, :2] - c - depth * beam) / (1.0 + inverse * depth)
    spot = seen.config.spot_radius_m if edge_fit is None else edge_fit.spot_m
    intensity_points = IntensityPoints(closest, intensity[kept].astype(np.float64), beam, spot)
    return find_pattern(
        intensity_points, target, (c, outer.turn_rad), side_known=edge_fit is not None
    )


def _by_pattern(printed: PatternFit, target: PatternTarget, edge_fit: EdgeFit | None) -> Estimate:
    """Its features are seen along the beams, where these are known: h higher, h g nearer."""
    by_plane = np.zeros((2, 3))
    if edge_fit is not None:
        by_plane = -np.outer(edge_fit.beam, [1.0, *target.offset])
    return Estimate(
        method="pattern",
        centre_m=printed.centre_m,
        noise_m2=printed.covariance_m2,
        model_m2=target.print_shift**2 * np.eye(2),
        by_plane=by_plane,
        dof=printed.dof,
        turn=PlaneTurn(
            mark="print",
            angle_rad=printed.turn_rad,
            period_rad=target.print_period_rad,
            noise=printed.turn_noise,
            model_rad2=0.0,
            by_plane=_sheared(printed, target, edge_fit),
        ),
    )


def _sheared(printed: PatternFit, target: PatternTarget, edge_fit: EdgeFit | None) -> Array:
    """How the print's turn goes with the plane's height and slopes (3,), seen along beams h.

    A slope g takes places q by -h (g.q), which turns them by -sum (q x h)(g.q) / sum q.q.
    """
    if edge_fit is None:
        return np.zeros(3)
    q = turned_by(target.places_m - target.places_m.mean(axis=0), printed.turn_rad)
    across = q[:, 0] * edge_fit.beam[1] - q[:, 1] * edge_fit.beam[0]
    return np.array([0.0, *(-(across @ q) / np.sum(q * q))])


def _fit(seen: TargetView, estimate: Estimate, edge_fit: EdgeFit | None) -> TargetFit:
    """A target by one estimate of its centre, with the causes of its uncertainty."""
    plane, turn = seen.plane, estimate.turn
    centre_m = seen.to_scanner(estimate.centre_m)
    noise, model = estimate.noise_m2, estimate.model_m2
    if turn is not None:
        noise, model = turn.with_noise(noise), turn.with_model(model)
    return TargetFit(
        centre_m=centre_m,
        normal=plane.normal,
        components=(
            *_plane_components(plane, centre_m - plane.centroid_m, estimate),
            centre_component("centre noise", noise, plane.basis, estimate.dof),
            centre_component("centre model", model, plane.basis),
        ),
        plane_rms_m=plane.rms_m,
        points_on_target=plane.count,
        method=estimate.method,
        edge_fit=edge_fit,
        turn=turn.in_scan(plane.basis) if turn else None,
    )


def _plane_components(
    plane: PlaneFit, lever_m: Array, estimate: Estimate
) -> list[UncertaintyComponent]:
    """Of the plane's own scatter: independent noise, correlated noise, waves of the face."""
    seen = plane.correlated
    by_plane = estimate.by_plane
    turned = None if estimate.turn is None else estimate.turn.by_plane
    return [
        plane_component(name, covariance, plane.basis, lever_m, by_plane, dof, turned)
        for name, covariance, dof in (
            ("plane noise", plane.noise_covariance, math.inf),
            ("correlated noise", seen.covariance, seen.dof),
            ("flatness", seen.form_covariance, seen.dof),
        )
        if covariance.any() or name == "plane noise"
    ]


def _at(plane: PlaneFit, centre_m: Array) -> Array:
    """Covariance (3, 3) of the plane's height at the centre (3,) and of its slopes."""
    carried = np.eye(3)
    carried[0, 1:] = plane.basis[:2] @ (centre_m - plane.centroid_m)
    covariance = plane.noise_covariance + plane.correlated.covariance
    return np.asarray(carried @ covariance @ carried.T)
