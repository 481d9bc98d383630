"""Plates of the targets: what all scans together show of them by their edges."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..capture import Capture
from ..centre import SIZE_M, EdgeFit
from ..errors import Wording
from ..targets import Target
from .records import Observation

PULLED, CONTRADICTED = 5.0, 5.0  # standard deviations of one scan, and of all together
THICKNESS = (
    "By its mixed pixels, the target's edge is {seen} mm thick, its file says {stated} mm: "
    "{names}. The centre is by the former; correct the thickness in the target's file, or omit it; "
    "a wrong size, chamfer or edge_radius in it looks the same, and so does a wider plate behind "
    "it."
)
SIZES = {
    "larger": (
        "By their edges, the targets of {names} are larger all round than their file says, by "
        "{size} mm: check its sizes. The centres may be off by as much."
    ),
    "smaller": (
        "By their edges, the targets of {names} are smaller all round than their file says, by "
        "{size} mm: check its sizes. The centres may be off by as much."
    ),
}

Stated = Sequence[tuple[Target, Target]]  # a target without the thickness that it states, and it


def contradicted_thickness(observations: Sequence[Observation]) -> Stated:
    """Return targets whose stated thickness all scans together contradict.

    Of each scan the pull of its mixed pixels on the thickness, at most PULLED of its standard
    deviations, so that one false fit is not enough: their sum is one over the root of their number.
    """
    found = []
    for target, edges in _edges_by_target(observations):
        pulls = [edge.thickness_pull for _, edge in edges if edge.thickness_pull is not None]
        held = [max(-PULLED, min(pull, PULLED)) for pull in pulls]
        if abs(sum(held)) > CONTRADICTED * math.sqrt(len(held)):
            found.append((target.model_copy(update={"thickness": None}), target))
    return found


def without_thickness(capture: Capture, wrong: Stated) -> Capture:
    """Return a capture whose targets of a wrong thickness state none."""

    def free(target: Target) -> Target:
        return next((plain for plain, stated in wrong if stated == target), target)

    targets = {name: free(target) for name, target in capture.targets.items()}
    return replace(capture, target=free(capture.target), targets=targets)


def as_contradicted(one: Observation, stated: Target | None) -> Observation:
    """Return an observation without a thickness that is stated as one that contradicted it.

    stated: the target of the same scan before.
    """
    if stated == one.target or one.evidence is None:
        return one
    fitted = one.evidence.target
    edge = fitted.edge_fit
    if edge is not None and not edge.is_clean:
        edge = replace(edge, stated_thickness_m=getattr(stated, "thickness", None))
    evidence = replace(one.evidence, target=replace(fitted, edge_fit=edge))
    return replace(one, target=stated, evidence=evidence)


def _edges_by_target(
    observations: Sequence[Observation],
) -> list[tuple[Target, list[tuple[str, EdgeFit]]]]:
    """Return the edges with mixed pixels, with the names of their scans, of each unlike target."""
    found: list[tuple[Target, list[tuple[str, EdgeFit]]]] = []
    for one in observations:
        edge = one.evidence.target.edge_fit if one.evidence else None
        if edge is None or edge.is_clean or one.target is None:
            continue
        same = next((edges for target, edges in found if target == one.target), None)
        if same is None:
            found.append((one.target, [(one.name, edge)]))
        else:
            same.append((one.name, edge))
    return found


def not_as_thick(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note on targets whose edges contradict the stated thickness, one for each of these.

    With the median of the scans' thicknesses.
    """
    scans: dict[float, list[tuple[str, float]]] = {}
    for observation in observations:
        edge = observation.evidence.target.edge_fit if observation.evidence else None
        if edge is not None and edge.stated_thickness_m is not None:
            found = scans.setdefault(edge.stated_thickness_m, [])
            found.append((observation.name, edge.thickness_m))
    for stated_m, found in scans.items():
        seen_m = statistics.median(thickness_m for _, thickness_m in found)
        names = ", ".join(name for name, _ in found)
        seen, stated = f"{seen_m * 1e3:.1f}", f"{stated_m * 1e3:.3g}"
        yield Wording(THICKNESS, seen=seen, stated=stated, names=names)


def not_as_large(observations: Sequence[Observation]) -> Iterator[str]:
    """Yield a note on targets that are all larger, or smaller, than stated, with the median.

    Of each edge its growth over the deviation of sizes from those stated; together, their sum over
    the root of their number.
    """
    for _, edges in _edges_by_target(observations):
        growth_m = [edge.growth_m for _, edge in edges]
        if abs(sum(growth_m)) > CONTRADICTED * SIZE_M * math.sqrt(len(edges)):
            median_m = statistics.median(growth_m)
            side = "larger" if median_m > 0.0 else "smaller"
            names = ", ".join(name for name, _ in edges)
            yield Wording(SIZES[side], names=names, size=f"{abs(median_m) * 1e3:.1f}")
