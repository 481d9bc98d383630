"""Plates of the targets: what all scans together show of them by their edges."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..capture import Capture
from ..centre import SIZE_M, Dimensions, EdgeFit, TargetFit, alike
from ..errors import Wording
from ..targets import Target
from ..uncertainty import UncertaintyComponent, centre_component
from ..vectors import Array
from .records import Observation

OF_PLANE = ("plane noise", "correlated noise")  # components that move a centre by its beams
PULLED, CONTRADICTED = 5.0, 5.0  # standard deviations of one scan, and of all together
THICKNESS = (
    "By its mixed pixels, the target's edge is {seen} mm thick, its file says {stated} mm: "
    "{names}. The centre is by the former; correct the thickness in the target's file, or omit it."
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


def as_contradicted(one: Observation, wrong: Stated) -> Observation:
    """Return an observation without a stated thickness as one in which it was contradicted."""
    stated = next((stated for plain, stated in wrong if plain == one.target), None)
    if stated is None or one.evidence is None:
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


def with_alike_edges(observations: Sequence[Observation]) -> list[Observation]:
    """Return observations whose reference wheels have centres by all of their targets' edges.

    Other scans change nothing of these, and keep their own.
    """
    found = list(observations)
    measured = [
        k
        for k, one in enumerate(found)
        if one.role == "reference" and one.evidence and one.evidence.plane
    ]
    targets = [found[k].target for k in measured]
    for index, target in enumerate(targets):
        if target is None or target in targets[:index]:
            continue
        same = [k for k, other in zip(measured, targets, strict=True) if other == target]
        evidence = [one for k in same if (one := found[k].evidence)]
        bases = [one.plane.basis for one in evidence if one.plane]
        plates = [found[k].wheel or found[k].name for k in same]
        fits = with_alike_plates([one.target for one in evidence], bases, plates, str(index))
        for k, of, fit in zip(same, evidence, fits, strict=True):
            found[k] = replace(found[k], evidence=replace(of, target=fit))
    return found


def with_alike_plates(
    fits: Sequence[TargetFit], bases: Sequence[Array], plates: Sequence[str], drawing: str = ""
) -> list[TargetFit]:
    """Return fits of targets of one drawing, whose centres are by the dimensions that all show.

    bases: (3, 3) axes of each fitted plane. plates: name of the plate in each scan. drawing: name
    of it, where there are several. Fits stay as they are that are unlike the others, or show none.
    """
    shown = [(k, of) for k, fit in enumerate(fits) if (of := _dimensions(fit)) is not None]
    found, names = list(fits), [plates[k] for k, _ in shown]
    for (k, _), known in zip(shown, alike([of for _, of in shown], names), strict=True):
        if known is not None:
            found[k] = _moved(fits[k], bases[k], *known, drawing)
    return found


def _dimensions(fit: TargetFit) -> Dimensions | None:
    """Return the dimensions that a scan shows, of a round target whose centre is by its rim."""
    edge = fit.edge_fit
    if edge is None or edge.is_clean or not edge.converged:
        return None
    alone = fit.method == "rim" and fit.stations is None and fit.turn is None
    return edge.dimensions if alone else None


def _moved(fit: TargetFit, basis: Array, value: Array, factor: Array, drawing: str) -> TargetFit:
    """Return a fit whose centre is that of other dimensions (3,), with their factor (3, K).

    The dimensions of this scan hide a part of what its plane moves; those of all hide less.
    """
    edge, one = fit.edge_fit, _dimensions(fit)
    assert edge is not None
    assert one is not None
    centre_m = one.centre_m + one.move @ (value - one.value)
    own = factor @ factor.T @ np.linalg.inv(one.covariance)
    by_plane = basis[:2].T @ one.move @ (own - np.eye(len(value))) @ one.by_plane
    by_dimensions = np.vstack([np.zeros((3, factor.shape[1])), basis[:2].T @ one.move @ factor])
    components = [
        centre_component("centre noise", one.noise_m2, basis, edge.dof)
        if part.name == "centre noise"
        else _by_plane(part, basis, by_plane)
        for part in fit.components
    ]
    shared = UncertaintyComponent("centre model", by_dimensions, shared=f"plates {drawing}")
    return replace(
        fit,
        centre_m=fit.centre_m + basis[:2].T @ (centre_m - edge.centre_m),
        components=(*components, shared),
    )


def _by_plane(part: UncertaintyComponent, basis: Array, by_plane: Array) -> UncertaintyComponent:
    """Return a component of the plane's noise with what it moves besides; others as they are.

    by_plane: (3, 3) derivatives of the centre by the plane's height there and by its slopes.
    """
    if part.name not in OF_PLANE:
        return part
    tilt, shift = part.factor[:3], part.factor[3:]
    moved = by_plane @ np.vstack([basis[2] @ shift, -basis[:2] @ tilt])
    return replace(part, factor=np.vstack([tilt, shift + moved]))
