"""Rough direction of the beams, from the shadow that a target leaves in the background."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ...targets import Outline, sector
from ...vectors import Array, Mask, turned
from .beams import BEAM, CENTRE, INVERSE, MIN_DEPTH_M, ROTATION, SPOT, Beams, carry

Solve = Callable[[Array, Array], Array]

SECTORS, FEWEST_SECTORS, ROUNDS = 36, 12, 4
WINDOW_M = 0.03  # about the edge, in which its background is used
AGREE_M, MAX_CONSTANT_M = 0.0015, 0.006  # of the shadow's edge in a sector; shift common to all
RING_M = (0.0035, 0.0095)  # rings inside the edge, without background, and outside, with it
# Share of the background that may appear through the target; that appears by dust alone.
MAX_THROUGH, HARDLY_THROUGH = 0.1, 0.02
STEEPEST = 4.0  # slope of the directions that are tried
COARSE_STEP, FINE_STEP, BEST = 0.2, 0.07, 8  # between directions, at first and about the best ones
LEAST_IN_SECTOR = 5  # points that count as a background
LEAST_SHADOW = (6, 20)  # points of a sector that show the shadow's edge: few points, many
DUST = 0.05  # share of a sector's points that may appear through the target
TRIED_POINTS, TRIED_FROM = 2000, 15_000  # points by which directions, and distances, are tried
TRIED_INVERSE = (0.4, 1.0)  # 1/m, of the scanner's distance from the plane
# Besides that of the state: so near each other that a wheel's openings behind a target show one;
# those beside it, and farther ones.
OTHER_INVERSE = ((0.55, 0.25), (0.1, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0))
# Shares of the sectors that agree: enough not to try other distances, or farther ones, and to take
# one of them at all. How many more must agree than at the first: in number, and as a share.
SURE, ENOUGH, MOST, MORE = 0.65, 0.75, 0.4, (4, 0.1)
UNSURE_INVERSE = 0.05  # 1/m, of that distance, before it is fitted
MOST_TRIPLES = 1800  # of sectors, whose answers are tried
INSIDE = 5.0  # weight of a point inside the edge, of one outside


def first_beam(
    plane: Array, depth: Array, state: Array, outline: Outline, known: bool = False
) -> Array | None:
    """Return a state with the beams' direction, for points (N, 2) in the plane and (N,) deep.

    known: whether the distance of the state is known, so that no other is tried.
    None where there is background beside less than a quarter of the edge, or where no direction
    explains it: then it was scanned from two stations, or does not lie behind the target.
    """
    found = _best_shadow(plane, depth, state, outline)
    if found is not None and (known or found.is_sure):
        return found.state
    if found is None:
        tried = _of_all_directions(plane, depth, state, outline)
        if tried is not None:
            found = _best_shadow(plane, depth, tried, outline, (_by_consensus,))
    other = _from_elsewhere(plane, depth, state, outline)
    if other is not None and other.explains_more(found):
        return other.state
    return None if found is None else found.state


def _from_elsewhere(plane: Array, depth: Array, state: Array, outline: Outline) -> Shadow | None:
    """Return the shadow of beams from another distance, the one that explains most."""
    some, best = slice(None, None, max(1, len(depth) // TRIED_FROM)), None
    found: Shadow | None = None
    for inverses in OTHER_INVERSE:
        for inverse in inverses:
            here = state.copy()
            here[INVERSE] = inverse
            tried = _best_shadow(plane[some], depth[some], here, outline, (_by_consensus,))
            if tried is not None and (best is None or tried.agreeing > best.agreeing):
                best = tried
        if best is not None:
            found = _best_shadow(plane, depth, best.state, outline, (_by_consensus,)) or best
            if found.agreeing >= ENOUGH * found.sectors:
                break
    return found


@frozen(eq=False)
class Shadow:
    """State (16,) whose beams explain the shadow's edge in so many of the sectors that show it."""

    state: Array
    agreeing: int
    sectors: int

    @property
    def is_sure(self) -> bool:
        """Whether it explains so much that no other distance needs to be tried."""
        return self.agreeing >= SURE * self.sectors

    def explains_more(self, other: Shadow | None) -> bool:
        """Return whether it explains more than another one does, not by chance; or most of all."""
        if other is None:
            return self.agreeing > MOST * self.sectors
        return self.agreeing >= other.agreeing + max(MORE[0], MORE[1] * other.sectors)


def _best_shadow(
    plane: Array,
    depth: Array,
    state: Array,
    outline: Outline,
    ways: tuple[Solve, ...] | None = None,
) -> Shadow | None:
    """Return the shadow of beams from the distance of a state; None where none explains it."""
    best: Shadow | None = None
    if ways is None:  # straight edges are hidden as a whole, those of a disc in parts, if at all
        ways = (_by_consensus,) if outline.shows_rotation else (_by_all, _by_consensus)
    for solve in ways:
        found = _refined(plane, depth, state, outline, solve)
        if found is None:
            continue
        through = seen_through(plane, depth, found.state, outline)
        if through < MAX_THROUGH and (best is None or found.agreeing > best.agreeing):
            best = found
        if best is found and through < HARDLY_THROUGH and found.is_sure:
            break
    return best


def is_contradicted(plane: Array, depth: Array, state: Array, outline: Outline) -> bool:
    """Return whether the beams of a state are too steep, or meet background through the target.

    Without a background nothing is contradicted.
    """
    if float(np.hypot(*state[BEAM])) > STEEPEST:
        return True
    through = seen_through(plane, depth, state, outline)
    return bool(MAX_THROUGH <= through < np.inf)


def has_background(plane: Array, depth: Array, state: Array, outline: Outline) -> bool:
    """Return whether there is background beside a quarter of the edge."""
    beams = carry(plane, depth, state, outline)
    beside = (depth > 2.0 * MIN_DEPTH_M) & (np.abs(beams.x_m) < WINDOW_M)
    sectors = _sectors(int(np.count_nonzero(beside)), LEAST_IN_SECTOR + 3)
    count = np.bincount(sector(beams.share[beside], sectors), minlength=sectors)
    return bool(np.count_nonzero(count >= LEAST_IN_SECTOR) >= sectors // 4)


def _sectors(points: int, each: int) -> int:
    """Return the number of sectors in which points are looked at, that many in each if possible."""
    return int(np.clip(points // each, FEWEST_SECTORS, SECTORS))


def seen_through(plane: Array, depth: Array, state: Array, outline: Outline) -> float:
    """Return background points whose beams pass through the target, per one just outside it."""
    beams = carry(plane, depth, state, outline)
    inside, outside = _beside(beams, depth, state)
    deep = depth > 2.0 * MIN_DEPTH_M
    if not np.any(outside & deep):
        return np.inf
    clean = depth > 0.8 * float(np.median(depth[outside & deep]))
    count = max(int(np.count_nonzero(outside & clean)), 1)
    return float(np.count_nonzero(inside & clean) / count)


def _beside(beams: Beams, depth: Array, state: Array) -> tuple[Mask, Mask]:
    """Return which beams meet the plane in rings just inside and outside the edge, (N,) each.

    Farther from it where a distance of the scanner that is not known yet leaves a place unsure.
    """
    clear = 1.5 * np.exp(state[SPOT]) * (np.sqrt(1.0 + beams.tau**2) - 1.0)
    clear += UNSURE_INVERSE * np.maximum(depth, 0.0) * np.hypot(*beams.q_m.T)
    inside = (beams.x_m < -RING_M[0] - clear) & (beams.x_m > -RING_M[1] - clear)
    outside = (beams.x_m > RING_M[0] + clear) & (beams.x_m < RING_M[1] + clear)
    return inside & beams.clear, outside & beams.clear


def _refined(
    plane: Array, depth: Array, state: Array, outline: Outline, solve: Solve
) -> Shadow | None:
    """Return the shadow with the beams' slope g fitted to its edge, or None.

    At depth z that edge is shifted by z g against the target's, x = a + z g . rho; the innermost
    background points of the sectors are fitted.
    """
    state = state.copy()
    deep = np.flatnonzero(depth > 2.0 * MIN_DEPTH_M)
    plane, depth = plane.T.take(deep, axis=1).T, depth[deep]
    for _ in range(ROUNDS):
        beams = carry(plane, depth, state, outline)
        behind = np.flatnonzero(np.abs(beams.x_m) < WINDOW_M)
        sectors = _sectors(len(behind), 2 * LEAST_SHADOW[1])
        least = int(np.clip(len(behind) // (2 * sectors), *LEAST_SHADOW))
        middles = (np.arange(sectors) + 0.5) / sectors
        normals = turned(outline.normals(middles), state[ROTATION])
        part = sector(beams.share[behind], sectors).astype(np.uint8)  # sorted by counting
        behind = behind[np.argsort(part, kind="stable")]
        ends, rows = np.cumsum(np.bincount(part, minlength=sectors)), []
        for k, here in enumerate(np.split(behind, ends[:-1])):
            if len(here) < least:
                continue
            z = depth[here]
            middle = _median(z)
            clean = here[z > 0.8 * middle]
            if len(clean) >= least // 2:
                rank = max(least // 5, int(DUST * len(clean)))
                inner = np.partition(beams.x_m[clean], rank)[rank]
                rows.append((inner, 1.0, *(middle * normals[k])))
        if len(rows) < sectors // 4:
            return None
        values, slopes = np.hsplit(np.array(rows), [1])
        answer = solve(slopes, values[:, 0])
        state[BEAM] += answer[1:]
    agree = np.abs(values[:, 0] - slopes @ answer) < AGREE_M
    return Shadow(state, int(np.count_nonzero(agree)), len(agree))


def _median(values: Array) -> float:
    """Return the median of values (N,), in a fifth of the time that numpy takes for few."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    ordered = np.partition(values, (low, high))
    return float(ordered[low] + ordered[high]) / 2.0


def _by_all(slopes: Array, values: Array) -> Array:
    """Solve by least squares over all sectors: slopes (K, 3), values (K,)."""
    return np.asarray(np.linalg.lstsq(slopes, values, rcond=None)[0])


def _by_consensus(slopes: Array, values: Array) -> Array:
    """Solve by least squares over the largest consistent set of sectors; the others are occluded.

    slopes (K, 3), the first of ones; values (K,). Three sectors give an answer, MOST_TRIPLES of
    these are tried; the sectors that agree with the most supported one of small constant are used.
    """
    triples = _triples(len(values))
    at, values_at = slopes[triples, 1:], values[triples]
    (ahead_u, ahead_v), (aside_u, aside_v) = ((at[:, k] - at[:, 0]).T for k in (1, 2))
    ahead, aside = (values_at[:, k] - values_at[:, 0] for k in (1, 2))
    determinant = ahead_u * aside_v - ahead_v * aside_u
    solvable = np.abs(determinant) > 1e-3 * np.abs(slopes[:, 1:]).max() ** 2
    by_u, by_v = ahead * aside_v - aside * ahead_v, ahead_u * aside - aside_u * ahead
    beams = np.stack([by_u, by_v], axis=1)[solvable] / determinant[solvable, None]
    constant = values_at[solvable, 0] - np.sum(at[solvable, 0] * beams, axis=1)
    answers = np.column_stack([constant, beams])
    answers = answers[np.abs(answers[:, 0]) < MAX_CONSTANT_M]
    if len(answers) == 0:
        return _by_all(slopes, values)
    agree = np.abs(values - answers @ slopes.T) < AGREE_M
    best = agree[np.argmax(np.count_nonzero(agree, axis=1))]
    return _by_all(slopes[best], values[best])


@lru_cache(maxsize=SECTORS)
def _triples(sectors: int) -> npt.NDArray[np.int64]:
    """Return threes of so many sectors (K, 3), of many threes one in so many."""
    every = np.array(list(combinations(range(sectors), 3)))
    return every[:: max(1, len(every) // MOST_TRIPLES)]


def _of_all_directions(plane: Array, depth: Array, state: Array, outline: Outline) -> Array | None:
    """Return the state of the direction, up to 76 degrees, that keeps the background outside.

    Background close behind the target is shifted too little to show it, and is left out.
    """
    deep = np.flatnonzero(depth > 2.0 * MIN_DEPTH_M)
    some = deep[:: max(1, len(deep) // TRIED_POINTS)]
    if len(some) < 50:
        return None
    few = some[::2]
    highest, found = 0.0, None
    for inverse in TRIED_INVERSE:
        here = state.copy()
        here[INVERSE] = inverse
        tries = directions(STEEPEST, COARSE_STEP)
        score = _background_outside(plane[few], depth[few], here, tries, outline)
        best = tries[np.argsort(-score, kind="stable")[:BEST]]
        tries = (best[:, None] + directions(COARSE_STEP, FINE_STEP)).reshape(-1, 2)
        score = _background_outside(plane[some], depth[some], here, tries, outline)
        if score.max() > highest:
            highest, found = float(score.max()), here
            found[BEAM] = tries[int(np.argmax(score))]
    return found


def directions(steepest: float, step: float) -> Array:
    """Return in-plane slopes (K, 2) on rings `step` apart, and as far apart on each."""
    rings = np.arange(0.0, steepest + 0.5 * step, step)
    turns = [
        np.arange(k) / k * 2.0 * np.pi for k in np.maximum(1, np.ceil(2.0 * np.pi * rings / step))
    ]
    return np.concatenate(
        [r * np.stack([np.cos(t), np.sin(t)], axis=1) for r, t in zip(rings, turns, strict=True)]
    )


def _background_outside(
    plane: Array, depth: Array, state: Array, slopes: Array, outline: Outline
) -> Array:
    """Return a score (K,) of beams of slopes (K, 2): points outside the edge less those inside.

    Points inside count INSIDE times.
    """
    shrink = 1.0 / (1.0 + state[INVERSE] * depth)
    here = turned((plane - state[CENTRE]) * shrink[:, None], -state[ROTATION])
    run = turned(slopes, -state[ROTATION])
    u, v = (
        place - np.outer(aside, depth * shrink) for place, aside in zip(here.T, run.T, strict=True)
    )
    x = outline.outside_m(u, v)
    near = np.abs(x) < WINDOW_M
    outside = np.count_nonzero(near & (x > 0.0), axis=1)
    return np.asarray(outside - INSIDE * np.count_nonzero(near & (x < 0.0), axis=1))
