"""From scans to angles with their uncertainty: the whole story."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from . import __version__
from . import wheel as bare_wheel
from .capture import Capture
from .centre import (
    TargetFit,
    TargetView,
    clear_of_occluders,
    joined,
    locate_centre,
    of_stations,
    on_plane,
    rough_pose,
    scanner_by_shadow,
)
from .config import ISSUER, Config
from .errors import NotMeasuredError
from .kinematics import carried, solve
from .measurement import (
    Evidence,
    Fit,
    Measurement,
    Naming,
    Observation,
    Provenance,
    VerticalKind,
    align,
    as_contradicted,
    broken,
    by_outermost,
    contradicted_thickness,
    find_verticals,
    meshed,
    noisy,
    not_as_large,
    not_as_registered,
    not_as_thick,
    not_printed,
    notes_of_assumptions,
    observe_cloud,
    observe_entries,
    observe_rolled,
    residual_map,
    rounded,
    shaded,
    spaced,
    thinned,
    without_thickness,
)
from .plane import Patch, PlaneFit, distance_pull, fit_plane
from .targets import Target, WheelTarget
from .uncertainty import brightness_component, distance_component, with_type_b
from .vectors import Array

# Of the edge that the best placement shows by mixed pixels: what makes another as likely; of the
# radius: where it is the same.
RIVAL_COVERED, SAME_PLACE = 0.8, 0.01
# Standard uncertainty of a tilt, beyond which no target was found: of one in 300 points with 5 mm
# of noise it is 0.3 degrees.
MOST_UNSURE_RAD = math.radians(2.0)
REFITTED = 0.5  # of the margin at the edges: how far the patch's edges may be from those fitted


def measure_capture(
    capture: Capture,
    config: Config,
    progress: Callable[[str], None] = lambda _: None,
    fit: Fit | None = None,
    vertical: VerticalKind = "wheels",
    *,
    mapped: bool = True,
) -> Measurement:
    """Measure toe, camber and the vehicle's quantities from a capture of scans.

    fit: measures the target in a scan, one after another, such as one that calls `fit_target` and
    looks at the points; that one by default, of several scans at once.
    vertical: from which camber, caster and SAI are measured. mapped: whether residuals are mapped,
    for the pictures of a report.

    Raises InputError for a scan that cannot be read, for wheels that cannot be identified, and for
    a reference wheel whose target cannot be measured; a trial that cannot be measured stays in the
    result with its status.
    """
    chosen = fit or partial(fit_target, mapped=mapped)
    observations, naming = observe_capture(capture, config, chosen, progress, several=fit is None)
    origin = provenance_of_capture(capture, config, observations, naming)
    of_scans = [note for observation in observations for note in observation.notes]
    noted = [*of_scans, *noisy(observations, config.instrument)]
    noted += [
        *meshed(observations),
        *rounded(observations),
        *thinned(observations),
        *spaced(observations),
        *by_outermost(observations),
    ]
    noted += [*shaded(observations), *broken(observations)]
    noted += [*not_as_registered(observations), *not_printed(observations)]
    noted += [*not_as_thick(observations), *not_as_large(observations)]
    verticals = find_verticals(capture.verticals, vertical, capture.source)
    found = solve(align(observations, origin, [*origin.notes, *noted], verticals))
    assumed = notes_of_assumptions(found, capture.target, config.instrument)
    return replace(found, notes=(*found.notes, *assumed))


def observe_capture(
    capture: Capture,
    config: Config,
    fit: Fit,
    progress: Callable[[str], None],
    several: bool = True,
) -> tuple[list[Observation], Naming | None]:
    """Observe every target, those of RR, RL, FR, FL first; return how a cloud's wheels were named.

    Scans of a vehicle that has rolled are carried to where it was in the others. A capture is scans
    of single wheels, whose names say which, or one scan of the whole vehicle. Where all scans
    together contradict the stated thickness of a target, they are measured again without it.
    several: whether scans may be measured at once.
    """
    found, naming = _observed(capture, config, fit, progress, several)
    wrong = contradicted_thickness(found)
    if wrong:
        free = without_thickness(capture, wrong)
        again, naming = _observed(free, config, fit, progress, several)
        stated = {one.name: one.target for one in found}
        found = [as_contradicted(one, stated[one.name]) for one in again]
    return carried(found, capture.source), naming


def _observed(
    capture: Capture, config: Config, fit: Fit, progress: Callable[[str], None], several: bool
) -> tuple[list[Observation], Naming | None]:
    if capture.cloud is not None:
        observe = partial(observe_cloud, config=config, fit=fit, progress=progress, several=several)
        found, naming = observe(capture.cloud, capture)
        for cloud in capture.rolled:
            found += observe_rolled(cloud, capture, observe)
        return found, naming
    return observe_entries(capture, config, fit, progress, several), None


def fit_target(patch: Patch, target: Target, config: Config, *, mapped: bool = True) -> Evidence:
    """Fit plane and centre of the target in `patch`, or axis and centre of the wheel itself.

    mapped: whether the residuals of the plane are mapped.
    Raises NotMeasuredError.
    """
    if isinstance(target, WheelTarget):
        return _fit_bare_wheel(patch, target, config)
    patch, plane, fitted = _fit_stations(patch, target, config)
    check_flat(fitted, target)
    sight_m = fitted.sight_m(config.instrument.distance_m, patch.scanner_m, plane)
    of_fit, stated = (fitted.components, fitted.normal, sight_m), config.instrument
    if fitted.stations is not None:
        stated = stated.of_stations(fitted.stations.share)
    components = with_type_b(*of_fit, target, stated, patch.station)
    if plane.brightness is not None and plane.brightness.level_m:
        off = brightness_component(plane.brightness.level_m, sight_m, fitted.normal)
        components = (*components, off)
    seen = fitted.edge_fit is not None or patch.scanner_m is not None
    pull = distance_pull(patch, plane, fitted.centre_m - sight_m, target.radius_m) if seen else None
    if pull is not None:
        plane = replace(plane, spaced_m=pull.distance_m)
        components = (*components, distance_component(pull.pull_m, fitted.normal))
    fitted = replace(fitted, components=components)
    if not mapped:
        return Evidence(fitted, plane)
    residuals = residual_map(patch, plane, fitted, target, config.plane.edge_margin_m)
    return Evidence(fitted, plane, residuals)


def check_flat(fitted: TargetFit, target: Target) -> None:
    """Raise NotMeasuredError 'no-target' where a plane's tilt is as unsure as that of no target."""
    u_rad = math.sqrt(float(np.linalg.eigvalsh(fitted.normal_covariance)[-1]))
    if u_rad > MOST_UNSURE_RAD:
        raise NotMeasuredError(
            "no-target",
            f"what fits {target.description} best is so uneven that its tilt is known to "
            f"{math.degrees(u_rad):.1f}° only: the target is not in the scan, or not of that size",
        )


def _fit_stations(
    patch: Patch, target: Target, config: Config
) -> tuple[Patch, PlaneFit, TargetFit]:
    """Fit the target to the points of each station that saw it, and join the fits.

    Patch and plane are those of the station with the most points. Where that one shows too little,
    the points of all count as those of one station; where another does, its plane alone counts.
    """
    main, *others = sorted(of_stations(patch, target.region), key=lambda one: -len(one.face_m))
    try:
        main, plane, fitted = _fit_plane_and_centre(main, target, config)
    except NotMeasuredError:
        if not others:
            raise
        return _fit_plane_and_centre(patch, target, config)
    fits = [fitted]
    for other in others:
        with suppress(NotMeasuredError):
            fits.append(_fit_beside(fitted, other, target, config))
    return main, plane, joined(fits, config.instrument)


def _fit_beside(main: TargetFit, patch: Patch, target: Target, config: Config) -> TargetFit:
    """Fit the target to the points of another station; by their plane if they show no centre."""
    try:
        return _fit_plane_and_centre(patch, target, config)[2]
    except NotMeasuredError:
        return on_plane(fit_plane(patch, target, config.plane), main.centre_m, target.radius_m)


def _fit_plane_and_centre(
    patch: Patch, target: Target, config: Config
) -> tuple[Patch, PlaneFit, TargetFit]:
    """Fit plane and centre; also return the patch of the points that were used.

    Where what is seen of a partly hidden target fits at several placements, the one with mixed
    pixels about its edge counts: there are none where the scan or its crop ends.
    Raises NotMeasuredError: 'ambiguous-target' where no edge decides; as `locate_centre`.
    """
    if not patch.elsewhere:
        return _fit_placed(patch, target, config)
    found, refusals = [], []
    for placement in patch.placements:
        try:
            found.append(_fit_placed(placement, target, config))
        except NotMeasuredError as refusal:
            refusals.append(refusal)
    if not found:
        raise refusals[0]
    covered = [0.0 if f.edge_fit is None else f.edge_fit.covered for _, _, f in found]
    best = int(np.argmax(covered))
    centres_m = [f.centre_m for _, _, f in found]
    apart_m = [float(np.linalg.norm(one - centres_m[best])) for one in centres_m]
    rivals = [
        apart > SAME_PLACE * target.radius_m and share >= RIVAL_COVERED * covered[best]
        for apart, share in zip(apart_m, covered, strict=True)
    ]
    if covered[best] == 0.0 or any(rivals):
        raise NotMeasuredError(
            "ambiguous-target",
            f"what is seen of {target.description} fits at {len(patch.placements)} placements, and "
            "no background about its edges shows which: scan more of it, or more around it",
        )
    return found[best]


def _fit_placed(patch: Patch, target: Target, config: Config) -> tuple[Patch, PlaneFit, TargetFit]:
    """Fit the plane, and the centre on it; also return the patch of the points that were used.

    Both are fitted again without the points beside what hides a part of the target, and where the
    centre is far from the patch's origin. Detection may be off by more than the margin at the edges
    then: mixed pixels of the edge in view count as points of the plane, and tilt it. The outermost
    points show that for most, before the centre is fitted at all.
    """

    def viewed(patch: Patch) -> TargetView:
        return TargetView(patch, fit_plane(patch, target, config.plane), target, config.centre)

    view, scanner_m = viewed(patch), patch.scanner_m
    margin_m, distance_m = config.plane.edge_margin_m, config.instrument.distance_m
    if scanner_m is None:
        scanner_m = scanner_by_shadow(view, margin_m, distance_m)
    if scanner_m is not None:
        clear = clear_of_occluders(view, margin_m, scanner_m)
        view = view if clear is patch else viewed(clear)
    rough = rough_pose(view)
    if rough is not None:
        nearer = _placed(view, *rough, margin_m)
        view = view if nearer is view.patch else viewed(nearer)
    fitted = locate_centre(view)
    again = _placed(view, fitted.centre_m, fitted.turn_rad(view.plane), margin_m)
    if scanner_m is None and fitted.edge_fit is not None:
        scanner_m = fitted.centre_m - fitted.sight_m(distance_m, None, view.plane)
        nearer_view = view if again is view.patch else replace(view, patch=again)
        again = clear_of_occluders(nearer_view, margin_m, scanner_m)
    if again is not view.patch:
        view = viewed(again)
        fitted = locate_centre(view)
    return view.patch, view.plane, fitted


def _placed(view: TargetView, centre_m: Array, turn_rad: float, margin_m: float) -> Patch:
    """Return the patch about a centre (3,), turned; the very same one where that is near enough."""
    target, patch = view.target, view.patch
    period_rad = target.region.period_rad
    turn_rad = math.remainder(turn_rad, period_rad) if period_rad else 0.0
    aside_m = float(np.linalg.norm(view.plane.basis[:2] @ (centre_m - patch.origin_m)))
    if aside_m + abs(turn_rad) * target.radius_m < REFITTED * margin_m:
        return patch
    return patch.placed(centre_m, turn_rad)


def _fit_bare_wheel(patch: Patch, target: WheelTarget, config: Config) -> Evidence:
    found, stated = bare_wheel.fit_surface(patch, target.rim_inch), config.instrument
    fitted = bare_wheel.target_of(found, patch)
    sight_m = fitted.sight_m(stated.distance_m, patch.scanner_m)
    of_fit = (fitted.components, fitted.normal, sight_m)
    components = with_type_b(*of_fit, target, stated, patch.station)
    return Evidence(
        replace(fitted, components=components), profile=bare_wheel.profile_of(found, patch)
    )


def provenance_of_capture(
    capture: Capture, config: Config, observations: Sequence[Observation], naming: Naming | None
) -> Provenance:
    """Return the inputs and settings of a measurement from scans."""
    used = config.model_dump(exclude={"seed", *ISSUER})
    used |= {"target": capture.target.model_dump(), "length_unit": capture.length_unit}
    if capture.targets:
        used["targets"] = {name: one.model_dump() for name, one in capture.targets.items()}
    used |= capture.reading.stated()
    if capture.hints:
        used["hints"] = {name: hint.stated() for name, hint in capture.hints.items()}
    inputs = {observation.source: observation.sha256 for observation in observations}
    if capture.cloud is not None:  # its observations name the single scans of the file as well
        clouds = (capture.cloud, *capture.rolled)
        inputs = {
            cloud.file: four.sha256 for cloud, four in zip(clouds, observations[::4], strict=True)
        }
    origin = (capture.source, capture.vehicle, __version__, inputs, used, config.seed)
    return Provenance(*origin, naming, capture.date)
