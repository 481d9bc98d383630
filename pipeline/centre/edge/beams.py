"""Beams about a target's edge, and the background behind it."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np
import numpy.typing as npt

from ...config import CentreConfig
from ...system import frozen
from ...targets import Outline, sector
from ...vectors import Array, Mask, Rows, turned
from .mixed_pixel import END

RING_M = (0.001, 0.011)  # beyond the footprint: where the clean background is looked up
TWELFTHS, LEAST_IN_TWELFTH = 12, 4
LEAST_IN_RING, WIDEST_M = 150, 0.028  # points that it should hold, and its width where few are
IN_SECTOR, IN_SECTOR_SPARSE = (10, 5), (6, 4)  # points of a ring per sector, and the fewest
AT_SCANNER = 1e-9  # of its distance
LEAST_IN_HALF = 4  # points of a sector's ring that give a slope
# Of few points: how near the edge mixed pixels are counted, how far their background is behind the
# wall, how far they lie before it: of its roughness (at least that share of its depth), and beyond.
BESIDE_M, BETWEEN_M = 0.002, 0.01
BEFORE, ROUGH_SHARE, BEFORE_M = 3.0, 0.02, 0.003
# Another surface: how far beyond the edge it is looked for, how alike depths are on it, how many.
SURFACE_M, SAME_DEPTH_M, LEAST_SAME, DEEPEST_M = (0.004, 0.02), 0.003, 3, 10.0
# Inside the edge: how far the face's brightness is looked at; points of a sector that show it; by
# how many standard uncertainties, and how much besides, in logs, a sector differs; quantile of
# bright sectors.
FACE_M, LEAST_OF_FACE, UNLIKE, BRIGHT = 0.01, 5, (3.0, 0.1), 0.9
MAX_SPREAD = 0.15  # sectors whose background is rougher than this share of its depth are left out
SPARSE, MAX_SPREAD_SPARSE = 16, 0.4  # the same of sectors of fewer points, which are wider
# Just beyond the footprint: how far it is looked at; off the background by more than that of its
# roughness and of its depth, points are of another surface, which that many and that share show.
NEXT_M, OFF_ROUGH, OFF_SHARE, LEAST_OTHER, MOST_OTHER = 0.003, 4.0, 0.15, 3, 0.3


@frozen(eq=False)
class Background:
    """Clean background by sector, (K,) each: a line of depth over x, and where it can be used.

    depth_m at from_m outside the edge; slope; spread_m about the line. log_light: (K,) logs of its
    intensities over that of the middle sector; None where they are unknown. log_face: likewise, of
    the target inside the edge, over its bright sectors, 0 where it is as bright; None where it is
    all round. rows, part: (N,) points that are compared with it, near the edge where it was looked
    up, and their sectors.
    """

    depth_m: Array
    from_m: Array
    slope: Array
    spread_m: Array
    usable: Mask
    log_light: Array | None = None
    log_face: Array | None = None
    rows: Rows = field(default_factory=lambda: np.zeros(0, np.int64))
    part: Rows = field(default_factory=lambda: np.zeros(0, np.int64))

    def of_some(self, most: int) -> Background:
        """Return the background with so many of the points that are compared with it."""
        return replace(self, rows=self.rows[:most], part=self.part[:most])

    def lighter(self, part: npt.NDArray[np.int64]) -> Array:
        """Return the logs (N,) of the intensities over the face's in sectors (N,), 0 if unknown."""
        if self.log_light is None:
            return np.zeros(len(part))
        return np.asarray(self.log_light[part]) - self.face(part)

    def face(self, part: npt.NDArray[np.int64]) -> Array:
        """Return the logs (N,) of the face's intensities in sectors (N,), 0 if unknown."""
        return np.zeros(len(part)) if self.log_face is None else np.asarray(self.log_face[part])

    def at(self, part: npt.NDArray[np.int64], x_m: Array) -> tuple[Array, Array]:
        """Return depth and its slope (N,) in sectors (N,), x_m (N,) outside the edge."""
        slope = np.where(x_m > 0.0, self.slope[part], 0.0)
        depth = self.depth_m[part] + self.slope[part] * (np.maximum(x_m, 0.0) - self.from_m[part])
        return np.maximum(depth, MIN_DEPTH_M), slope

    def sector(self, beams: Beams) -> npt.NDArray[np.int64]:
        """Return the sector (N,) that each beam falls in."""
        return sector(beams.share, len(self.usable))


def look_up(beams: Beams, depth: Array, state: Array, light: Array | None = None) -> Background:
    """Return the background just beyond the edge, by sector.

    A line through the medians of the ring's inner and outer half (Brown and Mood); through the
    median of all where either holds fewer than LEAST_IN_HALF points. A sector is of no use where
    another surface lies between the edge and that background, as a spoke before an opening does.
    light: (N,) intensities, NaN where unknown, which the background then has as well.
    """
    wall = np.maximum(beams.tau, 0.0) * np.exp(state[THICKNESS])
    beyond = beams.x_m - np.exp(state[SPOT]) - wall
    deep = (beyond > RING_M[0]) & (depth > MIN_DEPTH_M)
    ring, outer_m = deep & (beyond < RING_M[1]), RING_M[1]
    found = int(np.count_nonzero(ring))
    each, least = IN_SECTOR
    if found < LEAST_IN_RING:
        outer_m = min(RING_M[0] + (RING_M[1] - RING_M[0]) * LEAST_IN_RING / max(found, 1), WIDEST_M)
        ring = deep & (beyond < outer_m)
        each, least = IN_SECTOR_SPARSE
    count = int(np.clip(np.count_nonzero(ring) // each, 12, 90))
    part, z, x = sector(beams.share[ring], count), depth[ring], beams.x_m[ring]
    outer = (beyond[ring] > (RING_M[0] + outer_m) / 2.0).astype(np.int64)
    halves, sizes = _quantiles(z, 2 * part + outer, 2 * count, (0.5,))
    by_x = np.argsort(x)
    places, _ = _quantiles(x, 2 * part + outer, 2 * count, (0.5,), by_x)
    (near, far), (x_near, x_far) = halves[0].reshape(-1, 2).T, places[0].reshape(-1, 2).T
    known = sizes.reshape(-1, 2).min(axis=1) >= LEAST_IN_HALF
    slope = np.where(known, (far - near) / np.where(known, x_far - x_near, 1.0), 0.0)
    (middle,), size = _quantiles(x, part, count, (0.5,), by_x)
    rest = z - slope[part] * (x - middle[part])
    (low, depth_m, high), _ = _quantiles(rest, part, count, (0.25, 0.5, 0.75))
    spread = (high - low) / 1.349
    with np.errstate(invalid="ignore"):
        most = np.where(size >= SPARSE, MAX_SPREAD, MAX_SPREAD_SPARSE)
        usable = (size >= least) & (spread < most * depth_m)
    clean = Background(depth_m, middle, slope, spread, usable)
    beside = np.flatnonzero((beyond > 0.0) & (beyond < NEXT_M))
    here = sector(beams.share[beside], count)
    behind, _ = clean.at(here, beams.x_m[beside])
    off_m = np.maximum(OFF_ROUGH * spread[here], OFF_SHARE * behind)
    other = np.bincount(here, np.abs(depth[beside] - behind) > off_m, count)
    shown = other > np.maximum(MOST_OTHER * np.bincount(here, minlength=count), LEAST_OTHER - 1)
    usable &= ~shown
    if light is None:
        return replace(clean, usable=usable)
    log_light = _log_light(light[ring], part, usable, least)
    inside = np.flatnonzero((beams.x_m < -RING_M[0] - np.exp(state[SPOT])) & (beams.x_m > -FACE_M))
    log_face = _log_face(light[inside], sector(beams.share[inside], count), count)
    return replace(clean, usable=usable, log_light=log_light, log_face=log_face)


def _log_face(light: Array, part: npt.NDArray[np.int64], count: int) -> Array | None:
    """Return the logs (K,) of the intensities (N,) of a face by sector, over its bright ones.

    A print is darker than a plate and its wall. 0 of sectors that differ by no more than those of
    an even face do, or have few points; None of such a face.
    """
    (low, middle, high), size = _logs(light, part, count, (0.25, 0.5, 0.75))
    sure = size >= LEAST_OF_FACE
    if not sure.any():
        return None
    off = np.where(sure, middle - np.quantile(middle[sure], BRIGHT), 0.0)
    u = np.where(sure, (high - low) / 1.349, np.inf) / np.sqrt(np.maximum(size, 1))
    shown = np.abs(off) > UNLIKE[0] * u + UNLIKE[1]
    return np.where(shown, off, 0.0) if shown.any() else None


def _log_light(light: Array, part: npt.NDArray[np.int64], usable: Mask, least: int) -> Array:
    """Return the logs (K,) of the intensities (N,) of sectors (N,), over that of the middle one.

    0 of sectors that are not usable, or have not as many as `least`.
    """
    (middle,), size = _logs(light, part, len(usable), (0.5,))
    sure = usable & (size >= least)
    if not sure.any():
        return np.zeros(len(usable))
    return np.where(sure, middle - np.median(middle[sure]), 0.0)


def _logs(
    light: Array, part: npt.NDArray[np.int64], count: int, shares: tuple[float, ...]
) -> tuple[list[Array], npt.NDArray[np.int64]]:
    """Return quantiles of the logs of intensities (N,), as `_quantiles`, of those above 0."""
    known = np.flatnonzero((light > 0.0) & (light < np.inf))
    return _quantiles(np.log(light[known]), part[known], count, shares)


def _quantiles(
    values: Array,
    part: npt.NDArray[np.int64],
    count: int,
    shares: tuple[float, ...],
    by_value: Rows | None = None,
) -> tuple[list[Array], npt.NDArray[np.int64]]:
    """Return quantiles of values (N,) in each of `count` parts, (count,) each, and their sizes.

    NaN in an empty part behind the last point. by_value: rows (N,) in the order of their values.
    """
    by_value = np.argsort(values) if by_value is None else by_value
    narrow = part[by_value].astype(np.min_scalar_type(count))  # numpy sorts one byte by counting
    order = by_value[np.argsort(narrow, kind="stable")]
    ranked = np.append(values[order], np.nan)
    start = np.searchsorted(part[order], np.arange(count + 1))
    size = np.diff(start)
    return [ranked[start[:-1] + (share * size).astype(int)] for share in shares], size


def mixed_share(
    beams: Beams, depth: Array, background: Background, besides_surfaces: bool = False
) -> float:
    """Return mixed pixels about the edge, per point on the target in a 2 mm ring just inside.

    Of the middle one of twelfths of the edge: another surface before the background is seen in few.
    Of all of it where there are few points. besides_surfaces: without those as deep as points
    beyond the edge in the same twelfth.
    """
    share = depth / background.at(background.sector(beams), beams.x_m)[0]
    mixed = (np.abs(beams.x_m) < 0.004) & (share > 0.2) & (share < 0.8)
    if besides_surfaces:
        mixed[mixed] = ~_on_surface(beams, depth, mixed)
    ring = (beams.x_m > -0.005) & (beams.x_m < -0.003) & (np.abs(share) < 0.2)
    if (total := int(np.count_nonzero(ring))) < LEAST_IN_TWELFTH * TWELFTHS:
        return float(np.count_nonzero(mixed) / max(total, 1))
    part = sector(beams.share, TWELFTHS)
    count = [np.bincount(part[chosen], minlength=TWELFTHS) for chosen in (mixed, ring)]
    shown = count[1] > 0
    return float(np.median(count[0][shown]) / np.mean(count[1][shown]))


def _on_surface(beams: Beams, depth: Array, chosen: Mask) -> Mask:
    """Return which of some points (N,) are as deep as others of the same twelfth beyond the edge.

    (M,) of the chosen ones; the others lie where no footprint meets the target.
    """
    beyond = (beams.x_m > SURFACE_M[0]) & (beams.x_m < SURFACE_M[1]) & (depth > MIN_DEPTH_M)
    deepest_m = float(np.max(depth[beyond | chosen], initial=DEEPEST_M))
    part = 2.0 * deepest_m * sector(beams.share, TWELFTHS)  # each deeper than the one before
    surface = np.sort(part[beyond] + depth[beyond])
    here = part[chosen] + depth[chosen]
    around = np.searchsorted(surface, [here - SAME_DEPTH_M, here + SAME_DEPTH_M])
    return np.asarray(around[1] - around[0] >= LEAST_SAME)


def mixed_share_of_few(
    beams: Beams, depth: Array, background: Background, target_depth_m: float
) -> float:
    """Return the share of the points next to the edge that returned a depth between both sides.

    Deeper than the target's wall and clearly nearer than the background, where this is deep enough.
    """
    part = background.sector(beams)
    behind, _ = background.at(part, beams.x_m)
    rough = np.maximum(background.spread_m[part], ROUGH_SHARE * behind)
    beside = np.abs(beams.x_m) < BESIDE_M
    near = beside & background.usable[part] & (behind > target_depth_m + BETWEEN_M)
    nearer = depth < behind - BEFORE * rough - BEFORE_M
    mixed = near & (depth > target_depth_m) & nearer
    return float(np.count_nonzero(mixed) / max(int(np.count_nonzero(near)), 1))


# A state is (16,): centre u v, beam u v, 1/distance, log spot, log thickness, log reflectance
# ratio, in-plane rotation, Lambert's share in the wall's reflectance, spot shape, growth: how much
# farther out the target's edge lies than its stated size, all round, width of its chamfer,
# modulation of a phase-shift scanner, see `sum_of_phases`, and ellipse of the spot, see
# `footprint_m`.
STATE = 16
CENTRE, BEAM, INVERSE = slice(0, 2), slice(2, 4), 4
SPOT, THICKNESS, RATIO, ROTATION = 5, 6, 7, 8
WALL, SHAPE, GROWTH, CHAMFER, MODULATION = 9, 10, 11, 12, 13
ELLIPSE = slice(14, 16)
LAMBERT, LAMBERT_SIGMA = 1.0, 0.3  # of a scanner that parts returns by power
RATIO_LOG = 1.5  # of the log of a reflectance ratio (k = 1)
EXPONENT_LOG = 0.5  # of the exponent by which intensities follow power (k = 1)
# Of the log footprint (k = 1), and of that of such a scanner or a camera, where it is finer.
SPOT_LOG, CLEAN_SPOT = 0.7, 2.0
# Of what a footprint is longer than wide, see `footprint_m` (k = 1): 1.3 times as long; of a round
# one; of another edge of one scan.
ELLIPSE_LOG, HELD_ELLIPSE, ALIKE_ELLIPSE = 0.13, 1e-5, 0.03
MORE_ELLIPSE = 10.0  # than a held one may seem
LEAST_WALL = 0.02  # reflectance of a wall, of the target's
STATED_THICKNESS, WRONG_THICKNESS = 0.03, 1.0  # relative: of a stated one; of a wrong one (k = 1)
HELD_WALL = 0.02  # of Lambert's share and the spot's shape in a first fit (k = 1)
HELD_SIZE_M = 1e-5  # of an edge of the stated size (k = 1)
HELD_BEAM, HELD_THICKNESS = 0.05, 0.03  # of a fit that diverged (k = 1)
SIZE_M = 1e-4  # of a target's radius, or half its width, against the stated one (k = 1)
# Width of an edge's chamfer that is not stated: likeliest one, as deburring leaves it, and its u;
# its rms. u of a stated one (k = 1).
LIKELY_CHAMFER_M, U_CHAMFER_M, CHAMFER_M, STATED_CHAMFER_M = 2e-4, 2e-4, 3e-4, 5e-5
ALIKE_CHAMFER_M = 1e-4  # of the chamfers of two edges of one plate (k = 1)
MODULATION_SIGMA, HELD_MODULATION = 100.0, 1e-3  # 1/m^2, of a scanner; of one without (k = 1)
ALIKE_MODULATION = 20.0  # of two edges of one scan (k = 1)
STATED_MODULATION = 0.1  # relative, of a stated one (k = 1): its wavelength to 5 %
MORE = 1.001  # than a held standard uncertainty
WRONG_SIZE_M = 1e-3  # of a radius that is wrong (k = 1)
WRONG_SIZE = 6.0  # u of a size, by which no plate of that size differs
STATION_M = 0.005  # of a scanner's stated position against the origin of its beams (k = 1)
ROTATION_RAD = 0.1  # of the detected axes against the target's (k = 1)
MIN_DEPTH_M = 0.006  # least depth of a background
PARALLEL = 1e-3  # inverse distance, 1/m, up to which beams count as parallel


@frozen(eq=False)
class Prior:
    """Prior of the state: mean and weight, one over the variance; (16,) each."""

    mean: Array
    weight: Array

    @classmethod
    def of(cls, thickness_m: float | None, config: CentreConfig) -> Prior:
        """Return the prior for a target of that thickness, if known, and the set footprint.

        Of sharp edges, mean ranges and round beams, see `bevelled`, `of_chamfer`, `by_phase` and
        `elliptic`.
        """
        known, modulation, by_phase = thickness_m is not None, 0.0, HELD_MODULATION
        if config.ambiguity_m:
            modulation = (2.0 * np.pi / config.ambiguity_m) ** 2
            by_phase = STATED_MODULATION * modulation
        thickness = thickness_m if thickness_m is not None else 0.008
        logs = np.log([config.spot_radius_m, max(thickness, 1e-4)])
        mean = np.array(
            [0.0, 0.0, 0.0, 0.0, 0.4, *logs, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, modulation, 0.0, 0.0]
        )
        known_log = STATED_THICKNESS if known else WRONG_THICKNESS
        sigma = [0.01, 0.01, 3.0, 3.0, 0.3, SPOT_LOG, known_log, RATIO_LOG, ROTATION_RAD]
        sigma += [0.5, 0.5, SIZE_M, HELD_SIZE_M, by_phase, HELD_ELLIPSE, HELD_ELLIPSE]
        return cls(mean, 1.0 / np.array(sigma) ** 2)

    def seen_from(self, station: Array, state: Array) -> Prior:
        """Return the prior for beams that come from a station (3,), about a state (16,)."""
        mean, weight = pointed(self.mean, station, state[CENTRE]), self.weight.copy()
        slant = 1.0 + float(mean[BEAM] @ mean[BEAM])
        weight[BEAM] = (station[2] / STATION_M) ** 2 / slant
        weight[INVERSE] = (station[2] ** 2 / STATION_M) ** 2
        return Prior(mean, weight)

    def from_afar(self, state: Array) -> Prior:
        """Return the prior for beams from about the distance of a state (16,)."""
        mean = self.mean.copy()
        mean[INVERSE] = state[INVERSE]
        return Prior(mean, self.weight)

    def held(self, state: Array) -> Prior:
        """Return the prior with thickness and beams held near the start (16,)."""
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[BEAM] = state[BEAM]
        weight[BEAM] = np.maximum(weight[BEAM], HELD_BEAM**-2)
        weight[THICKNESS] = HELD_THICKNESS**-2
        return Prior(mean, weight)

    def of_thickness(self, thickness_m: float | None) -> Prior:
        """Return the prior with another thickness; None: the same."""
        mean = self.mean.copy()
        if thickness_m is not None:
            mean[THICKNESS] = np.log(thickness_m)
        return Prior(mean, self.weight)

    @property
    def is_sharp(self) -> bool:
        """Whether it is that of an edge without a chamfer."""
        return bool(self.weight[CHAMFER] >= HELD_SIZE_M**-2)

    def bevelled(self) -> Prior:
        """Return the prior of an edge that may have a chamfer, instead of a sharp one."""
        mean = self.mean.copy()
        mean[CHAMFER] = LIKELY_CHAMFER_M
        return Prior(mean, self.weight)._known_to(U_CHAMFER_M, CHAMFER)

    def as_likely(self) -> Prior:
        """Return the prior with the chamfer held at its likeliest width."""
        return self._known_to(HELD_SIZE_M, CHAMFER)

    def of_held_chamfer(self, chamfer_m: float) -> Prior:
        """Return the prior with a chamfer that is held at that width, and a held modulation."""
        held = self.of_chamfer(chamfer_m)._known_to(HELD_SIZE_M, CHAMFER)
        return held._known_to(HELD_MODULATION, MODULATION)

    @property
    def is_of_means(self) -> bool:
        """Whether it is that of a scanner that measures the mean of all that returns."""
        return bool(self.weight[MODULATION] >= HELD_MODULATION**-2)

    def by_phase(self) -> Prior:
        """Return the prior of a scanner that may add phases, instead of one that measures means."""
        return self._known_to(MODULATION_SIGMA, MODULATION)

    def elliptic(self) -> Prior:
        """Return the prior of beams that may be longer than wide, instead of round ones."""
        return self._known_to(ELLIPSE_LOG, ELLIPSE)

    def of_chamfer(self, chamfer_m: float | None) -> Prior:
        """Return the prior with a chamfer of that width; None: the same."""
        if chamfer_m is None:
            return self
        mean = self.mean.copy()
        mean[CHAMFER] = chamfer_m
        return Prior(mean, self.weight)._known_to(STATED_CHAMFER_M, CHAMFER)

    def by_power(self) -> Prior:
        """Return the prior for a scanner that parts returns by power: a wall by Lambert's law.

        It may be a camera, whose pixels have hardly a footprint. Another edge of the target, which
        may have another background, says nothing of this one's.
        """
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[WALL], weight[WALL] = LAMBERT, LAMBERT_SIGMA**-2
        mean[RATIO], weight[RATIO] = 0.0, RATIO_LOG**-2
        weight[SPOT] = CLEAN_SPOT**-2
        return Prior(mean, weight).known_size()

    def towards(self, state: Array) -> Prior:
        """Return the prior at a state (16,): a footprint may be far finer than set, not wider."""
        if state[SPOT] <= self.mean[SPOT]:
            return self
        return self._known_to(min(SPOT_LOG, self.weight[SPOT] ** -0.5), SPOT)

    def by_intensity(self) -> Prior:
        """Return the prior for the intensities of returns that are parted by power.

        In the place of the reflectance ratio it has the exponent by which they follow power.
        """
        mean, weight = self.mean.copy(), self.weight.copy()
        weight[WALL] = max(weight[WALL], LAMBERT_SIGMA**-2)
        weight[RATIO] = EXPONENT_LOG**-2
        mean[WALL] = LAMBERT
        mean[RATIO] = 0.0
        return Prior(mean, weight)

    def plain(self) -> Prior:
        """Return the prior with the wall as bright as the face and the spot's shape held."""
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[WALL] = 0.0
        weight[WALL], weight[SHAPE] = HELD_WALL**-2, HELD_WALL**-2
        return Prior(mean, weight).sized()

    @property
    def is_plain(self) -> bool:
        """Whether it holds the wall and the spot's shape."""
        return bool(self.weight[SHAPE] >= HELD_WALL**-2)

    def off(self, state: Array, which: slice = slice(None)) -> float:
        """Return the square of how far a state (16,) lies from the mean, in standard deviations."""
        return float(np.sum(self.weight[which] * (state - self.mean)[which] ** 2))

    def unsized(self) -> Prior:
        """Return the prior of an edge of a size that may be wrong."""
        return self._known_to(WRONG_SIZE_M, GROWTH)

    def doubted(self) -> Prior:
        """Return the prior of an edge of a thickness that may be wrong."""
        return self._known_to(WRONG_THICKNESS, THICKNESS)

    def sized(self) -> Prior:
        """Return the prior of an edge of the stated size."""
        return self._known_to(HELD_SIZE_M, GROWTH)

    def known_size(self) -> Prior:
        """Return the prior of an edge of about the stated size."""
        return self._known_to(SIZE_M, GROWTH)

    def _known_to(self, sigma: float, which: int | slice) -> Prior:
        weight = self.weight.copy()
        weight[which] = sigma**-2
        return Prior(self.mean, weight)

    @classmethod
    def beside(cls, state: Array, chamfer_u_m: float, modulation_u: float) -> Prior:
        """Return the prior for another edge of a target whose first edge has that state (16,).

        Both are of one plate, whose thickness a hole shows worse than the rim. chamfer_u_m,
        modulation_u: standard uncertainties by the first edge.
        """
        sigma = [0.01, 0.01, 0.02, 0.02, 0.03, 0.2, 0.05, 0.7, ROTATION_RAD, 0.2, 0.2]
        mean = state.copy()
        mean[GROWTH] = 0.0
        alike_m, alike = HELD_SIZE_M, HELD_MODULATION  # of a first edge that is fitted without
        if chamfer_u_m > MORE * HELD_SIZE_M:
            alike_m = float(np.hypot(ALIKE_CHAMFER_M, chamfer_u_m))
        if modulation_u > MORE * HELD_MODULATION:
            alike = float(np.hypot(ALIKE_MODULATION, modulation_u))
        is_round = float(np.abs(state[ELLIPSE]).max()) < MORE_ELLIPSE * HELD_ELLIPSE
        sigma += [SIZE_M, alike_m, alike, *2 * [HELD_ELLIPSE if is_round else ALIKE_ELLIPSE]]
        return cls(mean, 1.0 / np.array(sigma) ** 2)


def pointed(state: Array, station: Array, centre: Array) -> Array:
    """Return a state (16,) whose beams come from a station (3,) to a centre (2,)."""
    state = state.copy()
    state[BEAM] = (centre - station[:2]) / station[2]
    state[INVERSE] = 1.0 / station[2]
    return state


@frozen(eq=False)
class Beams:
    """Beams carried to the plane, (N,) each or (N, 2): x outside the edge, its normal rho, tau.

    q_m: where they met the plane, from the centre. shrink: of a step at the point's depth, on its
    way to the plane. curve: see ClosestPoints. bent: by which the wall's bend lessens tau, down to
    the thickness.
    """

    x_m: Array
    rho: Array
    tau: Array
    shrink: Array
    q_m: Array
    curve: Array
    share: Array
    clear: Mask
    bent: Array

    def taken(self, rows: npt.NDArray[np.intp]) -> Beams:
        """Return those of some rows, the components of vectors contiguous as before."""
        return Beams(*(values.T[..., rows].T for values in vars(self).values()))


def wall_reflectance(wall: Array, state: Array) -> tuple[Array, Array]:
    """Return the wall's reflectance over the face's (N,), and 1 where above the least, else 0.

    wall: (N,) tangent of the incidence against it, which by Lambert's law is that ratio.
    """
    plain = 1.0 + state[WALL] * (wall - 1.0)
    return np.maximum(plain, LEAST_WALL), (plain > LEAST_WALL).astype(np.float64)


def bevel_reflectance(tau: Array, lambert: float) -> Array:
    """Return the reflectance of a chamfer over the face's (N,).

    tau: (N,) signed tangent of the incidence against the wall; by Lambert's law (1 + tau) / sqrt 2.
    lambert: its share, as of a state.
    """
    return np.asarray(np.maximum(1.0 + lambert * _dimmer(tau), LEAST_WALL))


def bevel_slopes(tau: Array, state: Array) -> tuple[Array, Array]:
    """Return the derivatives (N,) of `bevel_reflectance` by tau, and by Lambert's share."""
    dimmer = _dimmer(tau)
    shown = 1.0 + state[WALL] * dimmer > LEAST_WALL
    return np.where(shown, state[WALL] / np.sqrt(2.0), 0.0), np.where(shown, dimmer, 0.0)


def _dimmer(tau: Array) -> Array:
    return np.asarray((1.0 + tau) / np.sqrt(2.0) - 1.0)


def round_footprint_m(tau: Array, state: Array) -> Array:
    """Return the radius (N,) across the edge of round beams that run inwards by tau."""
    return np.asarray(np.exp(state[SPOT]) * np.sqrt(1.0 + tau**2))


def footprint_m(beams: Beams, state: Array) -> Array:
    """Return the radius (N,) of footprints across the edge.

    That of round beams by a factor: with the ellipse e of a state, log r = e_1 cos 2a + e_2 sin 2a
    in the direction a across the beam. An ellipse whose axes differ by a factor k, in logs by
    2 |e| = log k, is so to the square of e.
    """
    stretched = np.exp(state[ELLIPSE] @ across_beam(beams, state))
    return np.asarray(round_footprint_m(beams.tau, state) * stretched)


def across_beam(beams: Beams, state: Array) -> Array:
    """Return cos 2a and sin 2a (2, N) of the directions a across the beam that edges part.

    An edge whose normal is rho parts a beam of the slope g, as a plane across it sees that, along
    rho + g (g . rho) / (1 + sqrt(1 + g^2)).
    """
    beam = state[BEAM]
    part = beams.rho @ beam / (1.0 + np.sqrt(1.0 + beam @ beam))
    u, v = beams.rho.T + beam[:, None] * part
    uu, vv = u * u, v * v
    return np.asarray(np.stack([uu - vv, 2.0 * u * v]) / (uu + vv))


def reaching(beams: Beams, state: Array) -> npt.NDArray[np.intp]:
    """Return the rows of beams whose footprints reach over the edge.

    Those of others lie on the face: their returns show the face, whatever the state.
    """
    return np.flatnonzero(beams.x_m > -END * footprint_m(beams, state) - state[CHAMFER])


def carry(plane: Array, depth: Array, state: Array, outline: Outline) -> Beams:
    """Carry each point along its beam to the plane: q = (p - c - z g) / (1 + z/D), from c.

    tau: at the depth z, a beam that met the plane x outside the edge is x - tau z outside the wall,
    less (z t)^2 / (2 R) by the wall's curvature where the beam runs along the edge by t per depth;
    that is linearised down to the thickness.
    """
    shrink, q, aligned = _on_plane(plane, depth, state)
    return _against_edge(shrink, q, aligned, state, outline)


def carry_near(
    plane: Array, depth: Array, state: Array, outline: Outline, band_m: tuple[float, float]
) -> tuple[npt.NDArray[np.intp], Beams]:
    """Return the rows of the points from band_m[0] inside to band_m[1] outside the edge or wall.

    And their beams, as `carry` does. A few rows lie up to a wall's width farther outside.
    """
    shrink, q, aligned = _on_plane(plane, depth, state)
    x = outline.outside_m(*aligned.T) - state[GROWTH]
    rows = np.flatnonzero(x > -band_m[0])
    far = np.abs(q.T.take(rows, axis=1)).sum(axis=0) + np.abs(x[rows])
    # A hole's wall that bends farther inwards reaches across the whole hole.
    steepest = np.hypot(*state[BEAM]) + abs(state[INVERSE]) * far
    rows = rows[x[rows] < band_m[1] + steepest * np.exp(state[THICKNESS])]
    q, aligned = (at.T.take(rows, axis=1).T for at in (q, aligned))
    return rows, _against_edge(shrink[rows], q, aligned, state, outline)


def outside_m(plane: Array, depth: Array, state: Array, outline: Outline) -> Array:
    """Return how far outside the edge (N,) the points' beams meet the plane, as `carry` does."""
    *_, aligned = _on_plane(plane, depth, state)
    return np.asarray(outline.outside_m(*aligned.T) - state[GROWTH])


def _on_plane(plane: Array, depth: Array, state: Array) -> tuple[Array, Array, Array]:
    """Return the shrinking (N,) of steps, and where beams meet the plane (N, 2), in both axes.

    Far away, of points at the scanner or behind it.
    """
    shrink = 1.0 / np.maximum(1.0 + state[INVERSE] * depth, AT_SCANNER)
    q = plane.T - state[CENTRE, None]
    q -= depth * state[BEAM, None]
    q *= shrink
    return shrink, q.T, turned(q.T, -state[ROTATION])


def _against_edge(shrink: Array, q: Array, aligned: Array, state: Array, outline: Outline) -> Beams:
    closest = outline.closest(aligned)
    rho = turned(closest.normal, state[ROTATION])
    outward = rho @ state[BEAM]
    aside = state[BEAM] @ state[BEAM] - outward**2
    bent = np.exp(state[THICKNESS]) * aside * closest.bend / 2.0
    tau = -outward - state[INVERSE] * closest.support_m - bent
    x_m = closest.x_m - state[GROWTH]
    return Beams(x_m, rho, tau, shrink, q, closest.curve, closest.share, closest.clear, bent)
