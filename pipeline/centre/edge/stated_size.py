"""Whether a target is as large as its file states, by the fit of its edge."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...errors import NotMeasuredError
from ...targets import Circle, Outline, Polygon
from ...vectors import Array
from .beams import SIZE_M, WRONG_SIZE, carry
from .solution import EdgeFit, sides_at

SURE_MISFIT = 0.06  # share of outliers up to which a fit shows how large a target is
PULLED = 2.5  # of SIZE_M: half a width against half a height, beyond which sides pull at them
# Standard deviations of its own, beyond which a stated size does not explain a growth of
# WRONG_SIZE: beams square to a target show little of its size. Least share of SIZE_M that is shown.
SURE_SIZE, LEAST_SHOWN = 4.0, 0.1
SIZE_BY_SPOT = 0.07  # of the footprint: u of a growth by what profile and brightness leave out
SIZE_BY_SHIFT = 0.2  # of the shift of a clean edge: u of a growth by how a scanner chooses returns
# Share of a side without a background, from which it may lie elsewhere, and of both pairs of sides,
# beyond which no width shows more. Up to which another size shows that side, or that share of what
# had been lost: parts lack a background in coarse scans. Of the edge, what may be shown more.
LOST_SIDE, NO_SIDE, FOUND_SIDE, STILL_LOST, MORE_COVERED = 0.3, 0.75, 0.25, 0.6, 0.05
# Half a width against half a height, by where points end: beyond which either may be wrong (60
# right plates lay within 1.04 mm), about which sizes are tried, and below which none is.
WIDER_M, ABOUT_M, LEAST_OTHER_M = 1.2e-3, 2.5e-4 * np.arange(-3, 4), 2e-4
# Of the points that the stated size explains, and their number, what a better one explains more: of
# plates of that size others explained 0.06 more at most, of plates 3 mm wider or narrower the right
# one from 0.25 on, but from 0.05 where it finds that share of a side or none pulls any more. The
# same of a rough fit, from which the size is fitted: 0.01 and 0.3.
MORE_EXPLAINED, MORE_IF_SEEN, WHOLE_SIDE, BY_CHANCE, MORE_AT_FIRST = 0.15, 0.02, 0.5, 20.0, 0.1
# How far inside a round edge the points of a target end by its mixed pixels, and what a larger one
# explains more. Of right discs they ended 0.6 mm inside or more, and up to 1.6 stated footprints
# outside a clean edge, of which BESIDE fitted ones return the target and nothing else.
ENDS_INSIDE_M, MORE_IF_LARGER, ENDS_BESIDE, BESIDE = 1.3e-3, 0.05, 1.7, 1.3
BY_NOISE = 2.0  # standard deviations: how far outside an edge noise along the beams puts points


def check_size(edge_fit: EdgeFit, outline: Outline, spot_m: float) -> None:
    """Raise NotMeasuredError 'wrong-outline' where SIZE_M does not explain where the edge lies.

    spot_m: radius of the footprint, as configured; a fit may explain a wrong size by a wider one.
    """
    if not _is_sure(edge_fit):
        return
    growth_m, stretch_m = edge_fit.growth_m, edge_fit.stretch_m
    if not fits_size(edge_fit, spot_m):
        side = "beyond" if growth_m > 0.0 else "inside"
        raise NotMeasuredError(
            "wrong-outline",
            f"by the points about it, the target's edge lies {abs(growth_m) * 1e3:.2f} mm or more "
            f"{side} that of {outline.description} all round: check its sizes and thickness, "
            "and whether its face is flat",
        )
    if not _is_explained(edge_fit, stretch_m, edge_fit.stretch_u_m, spot_m):
        wide, narrow = ("u", "v") if stretch_m > 0.0 else ("v", "u")
        raise NotMeasuredError(
            "wrong-outline",
            f"by the points about it, the target is {abs(stretch_m) * 2e3:.2f} mm or more larger "
            f"along {wide}, and smaller along {narrow}, than {outline.description}: check its "
            "width and height",
        )


def check_diameter(
    edge_fit: EdgeFit | None,
    outline: Circle,
    ends_m: float,
    noise_m: float,
    spot_m: float,
    fit: Callable[[Circle], EdgeFit | None],
) -> None:
    """Raise NotMeasuredError 'wrong-outline' where a larger circle explains more.

    Parts of an edge that lies outside the stated one contradict their background and are left out,
    and the others move the centre, or look like those of a thinner plate; or few mixed pixels are
    seen where they should be, and the edge looks like a clean one.
    edge_fit: None where no fit explains the edge; where it did not converge either, the larger one
    counts if it lies where its points end. ends_m: how far outside the outline the target's points
    end. noise_m: of a point along the plane. spot_m: as of `check_size`. fit: returns the fit of
    another outline.
    """
    shown_m = ENDS_BESIDE * spot_m if edge_fit is not None and edge_fit.is_clean else 0.0
    if ends_m < max(shown_m, BY_NOISE * noise_m):
        return
    by_m = ends_m + ENDS_INSIDE_M
    other = fit(outline.resized(by_m))
    if other is None or other.is_clean or not other.converged:
        return
    explained = edge_fit.explained if edge_fit is not None and edge_fit.converged else 0.0
    larger_m = by_m + other.growth_m
    if larger_m < WRONG_SIZE * SIZE_M or (explained == 0.0 and not fits_size(other, spot_m)):
        return
    if other.explained - explained > max(MORE_IF_LARGER * explained, BY_CHANCE):
        diameter_m = 2.0 * (outline.radius_m + larger_m)
        raise NotMeasuredError(
            "wrong-outline",
            f"by the points about it, the target is not {outline.size_text}, but about "
            f"{diameter_m * 1e3:.0f} mm: check its sizes and thickness",
        )


def beside_m(edge_fit: EdgeFit) -> float:
    """Return how far beside an edge a footprint returns the target, and nothing else."""
    return BESIDE * edge_fit.spot_m if edge_fit.is_clean else 0.0


def check_sides(
    edge_fit: EdgeFit,
    outline: Polygon,
    wider_m: float,
    fit: Callable[[Polygon], EdgeFit | None],
    look: Callable[[Polygon], float] | None,
    refit: Callable[[EdgeFit], EdgeFit | None],
) -> EdgeFit:
    """Raise NotMeasuredError 'wrong-outline' where another width or height explains more.

    A side that lies elsewhere contradicts its background and is left out: the centre is then by the
    opposite one, and off by half of what the size is wrong by. Or parts of both are left out, and
    the others pull at the size. Returns the fit; where it lost a side that a size near the stated
    one shows, the one of the stated size from there, or where that loses it again, of the other.
    wider_m: by how much half the width is larger against half the height, by where the points end.
    fit, look: return the fit of another outline, and how much a rough fit explains. One of a wrong
    size takes many steps, and leaves out more with each: those that look best are fitted first.
    refit: returns the fit of the stated outline from another one.
    """
    others = [
        (axis, by_m, outline.resized(np.where(np.arange(2) == axis, by_m, 0.0)))
        for axis in _doubtful_axes(edge_fit, wider_m)
        for by_m in ((1 - 2 * axis) * wider_m + ABOUT_M).tolist()
        if abs(by_m) > LEAST_OTHER_M and outline.half_m[axis] + by_m > 0.0
    ]
    if others and look is not None:
        least = (1.0 + MORE_AT_FIRST) * look(outline)
        looked = sorted(((look(one[-1]), k) for k, one in enumerate(others)), reverse=True)
        others = [others[k] for explained, k in looked if explained > least]
    for axis, by_m, resized in others:
        other = fit(resized)
        if other is None or not _is_better_size(other, edge_fit):
            continue
        if abs(by_m) > WRONG_SIZE * SIZE_M:
            raise NotMeasuredError(
                "wrong-outline",
                f"by the points about them, its edges across {'uv'[axis]} are not as far apart as "
                f"those of {outline.description}, but about {resized.half_m[axis] * 2e3:.1f} mm: "
                "check its width and height",
            )
        again = refit(other)
        more = again is not None and _is_whole(again) and again.explained > edge_fit.explained
        return again if again is not None and more else other
    return edge_fit


def wider_by_ends_m(near: Array, outline: Polygon, state: Array, band_m: float) -> float:
    """Return by how much half the width is larger, against half the height, by where points end.

    The target ends where the fewest points lie on the wrong side: on the face beyond, or deeper
    inside. By footprints that meet the background, too, it ends a little inside all sides alike.
    near: points (N, 3) about the outline, at all depths; state: (16,) of its fit.
    """
    beams = carry(near[:, :2], -near[:, 2], state, outline)
    sides, across_u = sides_at(beams.share, outline)
    on_face = np.abs(near[:, 2]) < band_m
    ends: tuple[list[float], list[float]] = [], []
    for side, is_across_u in zip(sides.T, across_u.tolist(), strict=True):
        rows = np.flatnonzero(side & beams.clear)
        rows = rows[np.argsort(beams.x_m[rows], kind="stable")]
        if len(rows) > 0:
            wrong = np.cumsum(np.where(on_face[rows], -1, 1))
            ends[0 if is_across_u else 1].append(float(beams.x_m[rows[np.argmin(wrong)]]))
    of_width, of_height = (float(np.mean(one)) if one else 0.0 for one in ends)
    return of_width - of_height


def _doubtful_axes(edge_fit: EdgeFit, wider_m: float) -> tuple[int, ...]:
    """Return the axes along which the size may be wrong: see `check_sides`."""
    if min(edge_fit.lost) > NO_SIDE:
        return ()
    is_mixed = edge_fit.clean_shift_m is None
    if _is_pulled(edge_fit) or (is_mixed and abs(wider_m) > WIDER_M):
        return 0, 1
    return () if _is_whole(edge_fit) else (int(np.argmax(edge_fit.lost)),)


def _is_whole(edge_fit: EdgeFit) -> bool:
    """Return whether no side has lost so much that it may lie elsewhere."""
    return max(edge_fit.lost) < LOST_SIDE or edge_fit.covered + MORE_COVERED >= 1.0


def _is_better_size(other: EdgeFit, found: EdgeFit) -> bool:
    """Return whether the fit of another size, at which no side pulls, shows more of a plate."""
    if not other.converged or abs(other.stretch_m) > SIZE_M:
        return False
    axis = int(np.argmax(found.lost))
    most = max(FOUND_SIDE, STILL_LOST * found.lost[axis])
    if other.lost[axis] > most or max(other.lost) > max(found.lost):
        return False
    is_whole = found.lost[axis] - other.lost[axis] > WHOLE_SIDE
    clearly = is_whole or _is_pulled(found)
    least = (MORE_IF_SEEN if clearly else MORE_EXPLAINED) * found.explained
    return other.explained - found.explained > max(least, BY_CHANCE)


def _is_pulled(edge_fit: EdgeFit) -> bool:
    """Return whether sides ask for more than width and height may differ by from those stated."""
    return abs(edge_fit.stretch_m) > PULLED * SIZE_M


def fits_size(edge_fit: EdgeFit, spot_m: float) -> bool:
    """Return whether SIZE_M explains where the edge lies all round."""
    return _is_explained(edge_fit, edge_fit.growth_m, edge_fit.growth_u_m, spot_m)


def _is_sure(edge_fit: EdgeFit) -> bool:
    """Return whether a fit shows how large a target is.

    A clean edge does where the stated size explains less than another.
    """
    shown = edge_fit.clean_shift_m is None or edge_fit.size_chance == 1.0
    return edge_fit.converged and edge_fit.misfit < SURE_MISFIT and shown


def _is_explained(edge_fit: EdgeFit, growth_m: float, u_m: float, spot_m: float) -> bool:
    """Return whether SIZE_M explains a growth, all round or along one axis, of that u."""
    by_spot_m = SIZE_BY_SPOT * min(edge_fit.spot_m, spot_m)
    by_shift_m = SIZE_BY_SHIFT * (edge_fit.clean_shift_m or 0.0)
    most_m = WRONG_SIZE * explained_m(edge_fit, u_m)
    return abs(growth_m) <= max(most_m, SURE_SIZE * math.hypot(u_m, by_spot_m, by_shift_m))


def explained_m(edge_fit: EdgeFit, u_m: float) -> float:
    """Return the standard deviation of an edge's growth, of that u, where SIZE_M holds.

    A posterior mean has the variance of its prior less that of the posterior. That of a clean edge
    has a wide prior, and the variance of its estimate besides.
    """
    if edge_fit.clean_shift_m is not None:
        return math.hypot(SIZE_M, u_m)
    return SIZE_M * math.sqrt(max(1.0 - (u_m / SIZE_M) ** 2, LEAST_SHOWN))
