"""Explain a capture: the steps of a measurement again, with all that they refuse kept.

A scan that cannot be read, or whose target cannot be measured, ends its own explanation, not that
of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..capture import Capture, ScanEntry, Searched, searched
from ..cloud import Steps, coordinate_steps, sample
from ..config import Config, SegmentConfig
from ..detection import Candidate, candidate_near, check_best, find_candidates, patch_of, rivals
from ..diagnostics import check_poses, check_wheel_scan
from ..errors import InputError, NotMeasuredError
from ..measure import fit_target
from ..measurement import find_searched, map_about
from ..plane import Patch
from ..targets import Target, WheelTarget
from ..vectors import Array
from .explain_cloud import SAMPLE, explain_cloud
from .records import (
    NO_POINTS,
    ExplainedCandidate,
    ExplainedScan,
    Explanation,
    Finding,
    Standing,
    with_region,
)
from .verdicts import MOST_SHOWN, apart


def explain_capture(
    capture: Capture, config: Config, progress: Callable[[str], None] = lambda _: None
) -> Explanation:
    """Explain every scan of the capture, in the order in which they are measured."""
    if capture.cloud is not None:
        rolled = (replace(capture, cloud=cloud, hints={}) for cloud in capture.rolled)
        scans = [explain_cloud(one, config, progress) for one in (capture, *rolled)]
    else:
        scans = []
        for entry in capture.entries:
            progress(entry.file)
            scans.append(_explain_scan(entry, capture, config))
    shown = [capture.target_of(entry) for entry in capture.entries] or [*capture.of_wheels.values()]
    described = ", ".join(dict.fromkeys(target.description for target in shown))
    return Explanation(capture.source, described, capture.length_unit, tuple(scans))


def _explain_scan(entry: ScanEntry, capture: Capture, config: Config) -> ExplainedScan:
    """Explain the scan of one wheel."""
    source, target = f"{capture.source}: {entry.file}", capture.target_of(entry)
    found = ExplainedScan(entry.name, entry.role, entry.file, "ok", "", 0, NO_POINTS, target.region)
    try:
        scan = entry.read(capture.length_unit, source, capture.reading)
        found = replace(found, points=len(scan.points_m), sample_m=sample(scan.points_m, SAMPLE))
        check_poses(scan.parts, source)
        check_wheel_scan(scan.points_m, 2.0 * target.radius_m, capture.length_unit, source)
    except InputError as error:
        return replace(found, status="not-read", reason=str(error))
    hint = capture.hints.get(entry.name)
    found = with_region(found, hint)
    axes = scan.parts[0].axes if len(scan.parts) == 1 else None
    try:
        within = searched(scan, hint, source)
    except InputError as error:
        search = (target, config.segment, config.seed, coordinate_steps(scan.points_m, axes=axes))
        outside = _outside(Searched(scan, scan, hint), 0, search)
        return replace(found, status="not-read", reason=str(error), candidates=outside)
    if isinstance(target, WheelTarget):
        return _bare(found, within, target, config)
    return _searched(found, within, axes, target, config)


def _bare(found: ExplainedScan, within: Searched, target: Target, config: Config) -> ExplainedScan:
    """Add what became of a wheel without a target, of which there are no candidates."""
    try:
        patch = find_searched(within, target, config, None)
        fit_target(patch, target, config)
    except NotMeasuredError as error:
        return replace(found, status=error.status, reason=str(error))
    return replace(found, best=patch.basis[2])


def _searched(
    found: ExplainedScan,
    within: Searched,
    axes: Array | None,
    target: Target,
    config: Config,
) -> ExplainedScan:
    """Add the candidates, their verdicts, and the residuals about the best one."""
    near_m, points_m, used = within.near_m, within.points.points_m, within.used
    search = (target, config.segment, config.seed, coordinate_steps(points_m, axes=axes))
    candidates: list[Candidate] = []
    patch = None
    try:
        candidates = apart(find_candidates(points_m, *search), target.radius_m)
        if near_m is not None:
            best = candidate_near(points_m, near_m, *search)
            candidates = apart([best, *candidates], target.radius_m)
        if within.by_region:
            patch = find_searched(within, target, config, axes)
        elif near_m is None:
            check_best(candidates, target, config.segment)
    except NotMeasuredError as error:
        found = replace(found, status=error.status, reason=str(error))
    is_chosen = near_m is not None and found.status == "ok"
    judged = _judged(candidates, found.status, target, config.segment, is_chosen=is_chosen)
    found = replace(found, candidates=judged + _outside(within, len(judged), search))
    if not candidates:
        return found
    try:
        of_best = (candidates[0], target, config.segment, used.intensity, axes)
        patch = patch or patch_of(used.points_m, *of_best)
    except NotMeasuredError as error:
        return replace(found, status=error.status, reason=str(error))
    return _fitted(replace(found, best=patch.basis[2]), patch, target, config)


def _outside(
    within: Searched, shown: int, search: tuple[Target, SegmentConfig, int, Steps]
) -> tuple[ExplainedCandidate, ...]:
    """Return the candidates outside the region that was drawn, numbered after those shown."""
    if not within.by_region or isinstance(search[0], WheelTarget):
        return ()
    try:
        found = apart(find_candidates(within.used.points_m, *search), search[0].radius_m)
    except NotMeasuredError:
        return ()
    outside = [one for one in found if not within.shows(one.centre_m)]
    return tuple(
        ExplainedCandidate(number, one, "refused", "outside_region")
        for number, one in enumerate(outside[: MOST_SHOWN - shown], shown + 1)
    )


def _fitted(found: ExplainedScan, patch: Patch, target: Target, config: Config) -> ExplainedScan:
    """Add the residual map of the fit, where there is none of the candidate as it was found."""
    if found.status == "ok":
        try:
            evidence = fit_target(patch, target, config)
        except NotMeasuredError as error:
            found = replace(found, status=error.status, reason=str(error))
        else:
            sigma_m = evidence.plane.sigma_m if evidence.plane is not None else 0.0
            return replace(found, face=evidence.face, sigma_m=sigma_m)
    as_found = (patch.basis, patch.origin_m, 0.0, patch.sigma_m)
    face = map_about(patch, *as_found, target, config.plane.edge_margin_m)
    return replace(found, face=face, sigma_m=patch.sigma_m)


def _judged(
    candidates: Sequence[Candidate],
    status: str,
    target: Target,
    config: SegmentConfig,
    *,
    is_chosen: bool,
) -> tuple[ExplainedCandidate, ...]:
    """Return the candidates with the verdict on each, best match first.

    is_chosen: whether a person chose the first.
    """
    judged: list[ExplainedCandidate] = []
    for number, one in enumerate(candidates[:MOST_SHOWN], 1):
        best = candidates[0]
        apart_m = float(np.linalg.norm(one.centre_m - best.centre_m))
        standing: Standing = "refused"
        finding: Finding
        if number == 1 and is_chosen:
            standing, finding = "chosen", "chosen_by_hand"
        elif one.match < config.min_match:
            finding = "no_outline"
        elif number == 1:
            standing, finding = "chosen" if status == "ok" else "rival", "outline"
        elif not is_chosen and rivals(best, one, target, config):
            standing, finding = "rival", "outline_too"
        else:
            finding = "worse"
        least = config.min_match
        judged.append(
            ExplainedCandidate(number, one, standing, finding, least_match=least, apart_m=apart_m)
        )
    return tuple(judged)
