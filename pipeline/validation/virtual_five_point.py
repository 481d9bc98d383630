"""Five points that an operator would aim at, picked from a dense scan, and how they depend on it.

Both methods then share the scan: its points, its clamp, its place. Let a plane be fitted to all N
points, and to five of them. Under independent noise the fit to all is the efficient one, and so
uncorrelated with the difference of the two (Hausman, Econometrica 46 (1978) 1251, lemma 2.1):

    Cov(all, five) = Var(all),  Var(five - all) = Var(five) - Var(all),

not the sum, as for independent methods. Noise that is alike from point to point takes its kernel
into (A5 - A) K (A5 - A)', A5 and A being the two fits. What moves the whole target, such as the
clamp, or the fitted centre about which the five are aimed, moves both alike, and cancels.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..capture import Capture
from ..centre import TargetFit
from ..cloud import random_rows
from ..config import Config
from ..errors import InputError, NotMeasuredError
from ..five_point import FivePointFile
from ..measure import fit_target, measure_capture, measure_five_point
from ..measurement import Evidence, WheelResult
from ..plane import Patch, PlaneFit
from ..targets import Target
from ..uncertainty import UncertaintyComponent, plane_component
from ..vectors import Array
from .comparison import Comparison, added
from .request import DENSE, Part, Request, as_method, measured
from .statistics.joint_test import Spread
from .tcgc_2013 import LABEL as OLD
from .tcgc_2013 import by_old_estimator

OF_RADIUS = 0.704  # of the target's: 88 mm on a plate of 250 mm, as in the paper
TURNS = 24  # of the pentagon, tried until no place aimed at is hidden
MISSED = 0.1  # of the pentagon's radius: farther from its place, a point is not that one
SAMPLE = 1200  # points that stand for the face where noise is correlated


@dataclass(frozen=True)
class Picked:
    """Five points of a scan: points_m (5, 3) in its coordinates, and in the plane about the centre.

    uv_m: (5, 2) where they lie; missed_m: (5, 2) by how much they miss the places aimed at.
    causes: of the five-point plane less the plane of all points, normal and centre.
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
    """The points nearest to a regular pentagon about the target's centre, turned at random.

    radius_m: of the pentagon, OF_RADIUS of the target's for None. Raises NotMeasuredError 'hidden'.
    """
    plane, fitted = evidence.plane, evidence.target
    assert plane is not None
    radius = OF_RADIUS * target.radius_m if radius_m is None else radius_m
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


def aimed(picks: list[Picked], fitted: list[TargetFit]) -> list[TargetFit]:
    """The targets with the causes of the five points' difference, their misses among them.

    Five points that miss their places by sigma along each axis have a mean that is off by
    sigma/sqrt(5), in the plane. Sigma is that of all misses together.
    """
    sigma = math.sqrt(float(np.mean(np.square([pick.missed_m for pick in picks]))))
    dof = 10 * len(picks)
    deltas = []
    for pick, target in zip(picks, fitted, strict=True):
        across = np.eye(3) - np.outer(target.normal, target.normal)
        factor = np.vstack([np.zeros((3, 3)), sigma / math.sqrt(5.0) * across])
        components = (*pick.components, UncertaintyComponent("aiming", factor, dof, pooled=True))
        deltas.append(replace(target, components=components))
    return deltas


def _nearest(
    uv: Array, radius_m: float, rng: np.random.Generator
) -> tuple[npt.NDArray[np.int64], Array]:
    """Rows of uv (N, 2) nearest to a pentagon, and how far off they are (5, 2)."""
    start = rng.uniform(0.0, 2.0 * math.pi)
    corners = 2.0 * math.pi * np.arange(5) / 5.0
    for turn in start + 2.0 * math.pi / 5.0 * np.arange(TURNS) / TURNS:
        places = radius_m * np.column_stack([np.cos(turn + corners), np.sin(turn + corners)])
        rows = np.array([np.argmin(np.sum((uv - place) ** 2, axis=1)) for place in places])
        missed = uv[rows] - places
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
    """What the plane of five points adds to that of all; five (5, 2), face (N, 2) about the centre.

    Height at the centre and two slopes; all stand in the basis of the plane.
    """
    A5, none = _fit(five), np.zeros(3)
    lever = fitted.centre_m - plane.centroid_m
    to_centre = np.eye(3)
    to_centre[0, 1:] = plane.basis[:2] @ lever
    of_all = to_centre @ plane.noise_covariance @ to_centre.T
    white = float(plane.noise_covariance[0, 0]) * plane.count
    components = [
        plane_component("points less cloud", white * A5 @ A5.T - of_all, plane.basis, none)
    ]
    seen, stated = plane.correlated, (flatness_m**2 / 12.0) * A5 @ A5.T
    if seen.sigma_m > 0.0:
        sample = random_rows(face, SAMPLE, np.random.default_rng(0))
        weights = np.hstack([A5, -_fit(sample)])
        field = seen.sigma_m**2 * weights @ _kernel(np.vstack([five, sample]), seen.length_m)
        name, covariance = "correlated noise", field @ weights.T
        components.append(plane_component(name, covariance, plane.basis, none, dof=seen.dof))
    if flatness_m > 0.0:
        components.append(plane_component("flatness", stated, plane.basis, none))
    return tuple(components)


def _fit(uv: Array) -> Array:
    """(3, N): takes heights to height at the origin and slopes, by least squares."""
    return np.linalg.pinv(np.column_stack([np.ones(len(uv)), uv]))


def _kernel(uv: Array, length_m: float) -> Array:
    """(N, N) correlation exp(-d^2 / (2 L^2)), as of correlation.py."""
    square = np.sum((uv[:, None] - uv[None]) ** 2, axis=2)
    return np.asarray(np.exp(-square / (2.0 * length_m**2)))


VIRTUAL = "five of their points"


def compare_virtual(
    capture: Capture, config: Config, request: Request, progress: Callable[[str], None]
) -> Comparison:
    """Measure the capture, pick five points a target, and compare by what the five add."""
    picks: list[tuple[PlaneFit | None, Picked | NotMeasuredError]] = []
    rng = np.random.default_rng(config.seed)

    def fit_and_pick(patch: Patch, target: Target, config: Config) -> Evidence:
        evidence = fit_target(patch, target, config)
        picks.append((evidence.plane, _picked(patch, evidence, target, request, rng)))
        return evidence

    dense = measure_capture(capture, config, progress, fit_and_pick)
    part, found = _picked_of(measured(dense), picks, capture.source)
    blocks_m = np.stack([picked.points_m for picked in found])
    points = measure_five_point(FivePointFile(blocks_m, capture.source, "", ()))
    first, second = as_method(DENSE, part.results), as_method(VIRTUAL, points.wheels)
    notes = dense.notes
    if request.points.method == OLD:
        second, said = by_old_estimator(second, blocks_m, part.wheels)
        notes = (*notes, said)
    sources = added(aimed(found, list(first.targets)))
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
        u_second=np.hypot(u_first, spread.u),  # five = all + what they add, uncorrelated with all
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
    part: Part, picks: list[tuple[PlaneFit | None, Picked | NotMeasuredError]], source: str
) -> tuple[Part, list[Picked]]:
    """The wheels whose five points were found, and these; raises InputError for a reference."""
    kept: list[WheelResult] = []
    found: list[Picked] = []
    missing = list(part.missing)
    for result in part.results:
        seen = result.observation
        plane = seen.evidence.plane if seen.evidence else None
        picked = next(picked for of, picked in picks if of is plane)
        if isinstance(picked, Picked):
            kept.append(result)
            found.append(picked)
        elif seen.role == "reference":
            raise InputError(f"{source}: {seen.source}: {picked}: give another --radius")
        else:
            missing.append((seen.name, f"{picked.status}: {picked}"))
    return Part(tuple(kept), tuple(missing)), found
