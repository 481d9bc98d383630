"""The dense scans against five points picked from them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.capture import Capture
from pipeline.config import Config
from pipeline.errors import InputError, NotMeasuredError
from pipeline.fit_plane import PlaneFit
from pipeline.five_point_file import FivePointFile
from pipeline.joint_test import Spread
from pipeline.measure import fit_target, measure_capture, measure_five_point
from pipeline.measurement import Evidence, WheelResult
from pipeline.patch import Patch
from pipeline.targets import Target
from pipeline.validate_compare import Comparison, added
from pipeline.validate_old import LABEL as OLD
from pipeline.validate_old import by_old_estimator
from pipeline.validate_request import DENSE, Part, Request, as_method, measured
from pipeline.virtual_five_point import Picked, aimed, pick_five

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
