"""Virtual five-point method: five points picked from a dense scan, and their covariance with it.

Both methods share the scan: its points, mounting and position. Let one plane be fitted to all N
points, and another to five of them. With independent noise the fit to all is efficient, and so it
is uncorrelated with the difference of the two (Hausman, Econometrica 46 (1978) 1251, lemma 2.1):

    Cov(all, five) = Var(all),  Var(five - all) = Var(five) - Var(all),

not the sum, as for independent methods. Correlated noise with kernel K contributes
(A5 - A) K (A5 - A)', A5 and A being the two fits. Components that move the whole target, such as
its mounting, or the fitted centre about which the five are aimed, move both equally and cancel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from ..capture import Capture
from ..centre import TargetFit
from ..cloud import random_rows
from ..config import Config
from ..errors import InputError, NotMeasuredError
from ..five_point import FivePointFile, measure_five_point
from ..measure import fit_target, measure_capture
from ..measurement import Evidence, WheelPose, WheelResult
from ..plane import Patch, PlaneFit
from ..system import frozen
from ..targets import Target, WheelTarget
from ..uncertainty import UncertainTarget, UncertaintyComponent, plane_component
from ..vectors import Array
from .comparison import Comparison, added
from .request import DENSE, Request, RequestPart, as_method, measured, note_of_plates, of_faces
from .statistics.joint_test import Spread
from .tcgc_2013 import LABEL as OLD
from .tcgc_2013 import by_old_estimator

OF_RADIUS = 0.704  # of the target's radius: 88 mm on a target of 250 mm, as in the paper
OF_HALF = 0.9  # at most, of half the least width: a pentagon that is on the face all round
ROTATIONS = 24  # of the pentagon, tried until no corner is hidden
MISSED = 0.1  # of the pentagon's radius: largest distance of a point from its corner
SAMPLE = 1200  # points that represent the target where noise is correlated


@frozen
class Picked:
    """Five points of a scan.

    points_m: (5, 3) in its coordinates. uv_m: (5, 2) in the plane, about the centre; missed_m:
    (5, 2) from the corners aimed at. components: uncertainty of normal and centre of the plane of
    five points less that of all points.
    """

    points_m: Array
    uv_m: Array
    missed_m: Array
    components: tuple[UncertaintyComponent, ...]


def pick_five(
    patch: Patch,
    evidence: Evidence,
    target: Target,
    radius_m: float | None,
    rng: np.random.Generator,
) -> Picked:
    """Pick the points nearest to a randomly rotated regular pentagon about the target's centre.

    radius_m: of the pentagon, for None OF_RADIUS of the target's, or OF_HALF. Raises
    NotMeasuredError 'hidden'.
    """
    plane, fitted = evidence.plane, evidence.target
    assert plane is not None
    usual = min(OF_RADIUS * target.radius_m, OF_HALF * min(target.region.half_m))
    radius = usual if radius_m is None else radius_m
    uvw = patch.face_m @ plane.basis.T + (patch.origin_m - fitted.centre_m) @ plane.basis.T
    on_face = np.abs(uvw[:, 2]) < 3.0 * max(plane.sigma_m, 1e-7)
    face, uvw = patch.face_m[on_face], uvw[on_face]
    rows, missed = _nearest(uvw[:, :2], radius, rng)
    uv = uvw[rows, :2]
    return Picked(
        points_m=face[rows] + patch.origin_m,
        uv_m=uv,
        missed_m=missed,
        components=added_components(uv, uvw[:, :2], plane, fitted, target.flatness),
    )


def aimed(picks: list[Picked], fitted: Sequence[UncertainTarget]) -> list[WheelPose]:
    """Return the targets with the components of the five points' difference, aiming included.

    Five points that miss their corners by sigma along each axis have a mean with a standard
    uncertainty of sigma/sqrt(5) in the plane. Sigma is pooled over all targets.
    """
    sigma = math.sqrt(float(np.mean(np.square([pick.missed_m for pick in picks]))))
    dof = 10 * len(picks)
    deltas = []
    for pick, target in zip(picks, fitted, strict=True):
        across = np.eye(3) - np.outer(target.normal, target.normal)
        factor = np.vstack([np.zeros((3, 3)), sigma / math.sqrt(5.0) * across])
        components = (*pick.components, UncertaintyComponent("aiming", factor, dof, pooled=True))
        deltas.append(WheelPose(target.centre_m, target.normal, components))
    return deltas


def _nearest(
    uv: Array, radius_m: float, rng: np.random.Generator
) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the rows of uv (N, 2) nearest to a pentagon, and their misses (5, 2)."""
    start = rng.uniform(0.0, 2.0 * math.pi)
    corners = 2.0 * math.pi * np.arange(5) / 5.0
    for rotation in start + 2.0 * math.pi / 5.0 * np.arange(ROTATIONS) / ROTATIONS:
        aims = radius_m * np.column_stack([np.cos(rotation + corners), np.sin(rotation + corners)])
        rows = np.array([np.argmin(np.sum((uv - aim) ** 2, axis=1)) for aim in aims])
        missed = uv[rows] - aims
        if float(np.hypot(*missed.T).max()) <= MISSED * radius_m and len(set(rows)) == 5:
            return rows, missed
    raise NotMeasuredError(
        "hidden",
        f"no pentagon of {radius_m * 1e3:.0f} mm radius about its centre has a point of the scan "
        f"within {MISSED * radius_m * 1e3:.0f} mm of each corner",
    )


def added_components(
    five: Array, face: Array, plane: PlaneFit, fitted: TargetFit, flatness_m: float
) -> tuple[UncertaintyComponent, ...]:
    """Return the components of the plane of five points less that of all points.

    five (5, 2), face (N, 2): about the centre, in the basis of the plane, as are the results:
    height at the centre and two slopes.
    """
    A5, none = _fit(five), np.zeros(3)
    lever = fitted.centre_m - plane.centroid_m
    to_centre = np.eye(3)
    to_centre[0, 1:] = plane.basis[:2] @ lever
    of_all = to_centre @ plane.point_covariance @ to_centre.T
    white = float(plane.point_covariance[0, 0]) * plane.count
    components = [
        plane_component("points less cloud", white * A5 @ A5.T - of_all, plane.basis, none)
    ]
    correlated, stated = plane.correlated, (flatness_m**2 / 12.0) * A5 @ A5.T
    if correlated.sigma_m > 0.0:
        sample = random_rows(face, SAMPLE, np.random.default_rng(0))
        weights = np.hstack([A5, -_fit(sample)])
        field = (
            correlated.sigma_m**2
            * weights
            @ _kernel(np.vstack([five, sample]), correlated.length_m)
        )
        name, covariance = "correlated noise", field @ weights.T
        components.append(plane_component(name, covariance, plane.basis, none, dof=correlated.dof))
    if flatness_m > 0.0:
        components.append(plane_component("flatness", stated, plane.basis, none))
    return tuple(components)


def _fit(uv: Array) -> Array:
    """Return the least squares map (3, N) from heights to height at the origin and slopes."""
    return np.linalg.pinv(np.column_stack([np.ones(len(uv)), uv]))


def _kernel(uv: Array, length_m: float) -> Array:
    """Return the correlation (N, N) exp(-d^2 / (2 L^2)), as in plane/correlated_noise.py."""
    square = np.sum((uv[:, None] - uv[None]) ** 2, axis=2)
    return np.asarray(np.exp(-square / (2.0 * length_m**2)))


VIRTUAL = "five of their points"


def compare_virtual(
    capture: Capture, config: Config, request: Request, progress: Callable[[str], None]
) -> Comparison:
    """Measure the capture, pick five points a target, and compare by what the five add."""
    shown = (capture.target, *capture.targets.values())
    if any(isinstance(target, WheelTarget) for target in shown):
        raise InputError(
            f"{capture.source}: a bare wheel has no plane of which five points could be picked: "
            "give --five-point FILE or --truth"
        )
    picks: list[tuple[PlaneFit | None, Picked | NotMeasuredError]] = []
    rng = np.random.default_rng(config.seed)

    def fit_and_pick(patch: Patch, target: Target, config: Config) -> Evidence:
        evidence = fit_target(patch, target, config)
        picks.append((evidence.plane, _picked(patch, evidence, target, request, rng)))
        return evidence

    dense = measure_capture(capture, config, progress, fit_and_pick)
    part, found = _picked_of(measured(of_faces(dense)), picks, capture.source)
    blocks_m = np.stack([picked.points_m for picked in found])
    points = measure_five_point(FivePointFile(blocks_m, capture.source, "", ()), check=False)
    first, second = as_method(DENSE, part.results), as_method(VIRTUAL, points.wheels)
    notes = (*dense.notes, *note_of_plates(dense))
    if request.points.method == OLD:
        second, note = by_old_estimator(second, blocks_m, part.wheels)
        notes = (*notes, note)
    sources = added(aimed(found, first.targets))
    by_first, by_second = first.slopes(part.wheels), second.slopes(part.wheels)
    spread = Spread.of(np.hstack([by_first, -by_second]), sources)
    u_first = first.u(by_first)
    return Comparison(
        source=capture.source,
        names=part.names,
        wheels=part.wheels,
        first=first,
        second=second,
        u_first=u_first,
        u_second=np.hypot(u_first, spread.u),  # five = all + difference, uncorrelated
        sources=sources,
        spread=spread,
        missing=part.missing,
        notes=notes,
        origins=(dense.provenance,),
    )


def _picked(
    patch: Patch,
    evidence: Evidence,
    target: Target,
    request: Request,
    rng: np.random.Generator,
) -> Picked | NotMeasuredError:
    try:
        return pick_five(patch, evidence, target, request.radius_m, rng)
    except NotMeasuredError as error:
        return error.with_traceback(None)


def _picked_of(
    part: RequestPart, picks: list[tuple[PlaneFit | None, Picked | NotMeasuredError]], source: str
) -> tuple[RequestPart, list[Picked]]:
    """Select the wheels whose five points were found. Raises InputError for a reference wheel."""
    kept: list[WheelResult] = []
    found: list[Picked] = []
    missing = list(part.missing)
    for result in part.results:
        observation = result.observation
        plane = observation.evidence.plane if observation.evidence else None
        picked = next(picked for of, picked in picks if of is plane)
        if isinstance(picked, Picked):
            kept.append(result)
            found.append(picked)
        elif observation.role == "reference":
            raise InputError(f"{source}: {observation.source}: {picked}: give another --radius")
        else:
            missing.append((observation.name, f"{picked.status}: {picked}"))
    return RequestPart(tuple(kept), tuple(missing)), found
