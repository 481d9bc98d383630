"""Step or bend of a face along a line, or a raised area: a label, dirt, a damaged or a bent plate.

A stationary field, as of correlated noise, varies everywhere alike. One line at which the face
steps or bends does not, nor one area that is raised, and most of what they do passes for a tilt of
the plane: that of a step in the middle is five times as large as a field with the same residuals
would have. So lines and areas are tried as one more column of the residuals' model, and believed as
far as this is likelier than a field alone, in the cells that show the field or the shape best. The
plane stays that of all points: what the shape does to it is its form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Generic, Literal, TypeVar

import numpy as np

from ..system import frozen
from ..vectors import Array, Rows
from .correlated_noise import Cells, CorrelatedNoise, correlated_noise, regressed

Kind = Literal["step", "bend", "area"]
KINDS: tuple[Kind, ...] = ("step", "bend")  # of lines
DIRECTIONS = 18
DISTANCES_OF_RADIUS = np.arange(-0.75, 0.76, 0.125)
FINER = np.linspace(-1.0, 1.0, 13)  # steps of both, about the likeliest
UNLIKELY = 11.0  # logarithm of the odds against any line before the residuals are seen
MIDDLES = np.arange(-0.75, 0.76, 0.25)  # of areas, by radius, as their half sides
SQUARES = [(half, half, 0.0) for half in (0.2, 0.35, 0.5, 0.7)]
OBLONGS = [(half, 2.5 * half, np.pi * k / 4) for half in (0.15, 0.25, 0.35) for k in range(4)]
SHAPES = SQUARES + OBLONGS
FIRST_AREAS = np.array(
    [(u, v, *shape) for u, v, shape in product(MIDDLES, MIDDLES, SHAPES) if math.hypot(u, v) < 0.9]
)
VARIED = np.array([0.125, 0.125, 0.3, 0.3, np.pi / 8])  # middle, logarithms of half sides, turn
VARIATIONS = VARIED * [by for by in product((-1, 0, 1), repeat=5) if by.count(0) > 2]
STARTS, ROUNDS, SMALLER = 6, 5, 0.65  # each round of variations by that much of those before
UNLIKELY_AREA = 14.0  # as UNLIKELY; there are more areas than lines
CLEARER, CLEARER_BY = 1.2, 8.0  # gain by the best line's, and over it, of areas worth a trial
DOUBTFUL = 0.0  # logarithm of the odds, in square cells, below which an area is not tried further
UNLIKE = 0.1  # of the tilt by an area, in any direction: it is no rectangle
LEAST_GAIN = 9.0  # in log-likelihood: shapes below have no belief worth counting
NOTED = 0.9  # belief


@frozen(eq=False)
class Lines:
    """Lines on a face, beyond each of which it steps, or bends, in the axes of the cells.

    directions: (L, 2) unit, across them. distances_m: (L,) from the cells' origin. side_m: of a
    cell.
    """

    kind: Kind
    directions: Array
    distances_m: Array
    side_m: float

    def columns(self, uv_m: Array) -> Array:
        """Return how far the means of cells at uv_m (C, 2) follow height or slope 1: (C, L)."""
        beyond = uv_m @ self.directions.T - self.distances_m
        if self.kind == "bend":
            return np.asarray(beyond.clip(min=0.0))
        return np.asarray((beyond / self.side_m + 0.5).clip(0.0, 1.0))

    def rise(self, radius_m: float) -> float:
        """Return the height of a step, and that of the target's edge by a bend, of size 1."""
        return 1.0 if self.kind == "step" else radius_m - float(self.distances_m[0])

    @classmethod
    def of(cls, kind: Kind, turns: Array, distances_m: Array, side_m: float) -> Lines:
        """Return the lines at each turn, rad, and at each distance."""
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        every = np.repeat(ways, len(distances_m), axis=0)
        return cls(kind, every, np.tile(distances_m, len(turns)), side_m)

    def one(self, index: int) -> Lines:
        """Return one of them."""
        at = slice(index, index + 1)
        return replace(self, directions=self.directions[at], distances_m=self.distances_m[at])


@frozen(eq=False)
class Areas:
    """Rectangles on a face that are raised, or sunk, in the axes of the cells.

    middles_m: (L, 2). halves_m: (L, 2) half their sides. turns: (L,) of the first of these, rad.
    side_m: of a cell.
    """

    middles_m: Array
    halves_m: Array
    turns: Array
    side_m: float
    kind: Kind = "area"

    def columns(self, uv_m: Array) -> Array:
        """Return the share (C, L) of each cell at uv_m (C, 2) within them, along their sides."""
        half_cell, along = 0.5 * self.side_m, np.array([np.cos(self.turns), np.sin(self.turns)])
        share = np.ones((len(uv_m), len(self.turns)))
        for axis, half in zip((along, along[::-1] * [[-1.0], [1.0]]), self.halves_m.T, strict=True):
            from_middle = uv_m @ axis - np.sum(self.middles_m.T * axis, axis=0)
            end = np.minimum(from_middle + half_cell, half)
            within = end - np.maximum(from_middle - half_cell, -half)
            share *= within.clip(min=0.0) / self.side_m
        return share

    def rise(self, _radius_m: float) -> float:
        """Return the height of an area of size 1."""
        return 1.0

    def varied(self, chosen: Rows, by: Array, radius_m: float) -> Areas:
        """Return those at rows (K,), varied by each of (V, 5) middle, logarithms of halves, turn.

        Those of one row stand together: K V areas.
        """
        every, by = np.repeat(chosen, len(by)), np.tile(by, (len(chosen), 1))
        return replace(
            self,
            middles_m=self.middles_m[every] + radius_m * by[:, :2],
            halves_m=self.halves_m[every] * np.exp(by[:, 2:4]),
            turns=self.turns[every] + by[:, 4],
        )

    def one(self, index: int) -> Areas:
        """Return one of them."""
        return self.varied(np.array([index]), np.zeros((1, 5)), 0.0)


Shapes = TypeVar("Shapes", Lines, Areas)


@frozen(eq=False)
class FaceBreak:
    """Step, bend or raised area found on a face.

    height_m: of a step or an area; of a bend how far it lifts the target's edge. belief:
    probability. covariance: (3, 3) of the plane's height (m) at the centroid and its slopes along u
    and v: of all points against the greater part of the face, or what surrounds an area, by belief.
    """

    kind: Kind
    height_m: float
    belief: float
    covariance: Array

    @property
    def is_noted(self) -> bool:
        """Whether it is beyond reasonable doubt."""
        return self.belief > NOTED


def noise_and_break(
    cells: Cells | None,
    radius_m: float,
    spread_m: float,
    resolution_m: float,
    lined: Sequence[Cells] = (),
) -> tuple[CorrelatedNoise, FaceBreak | None]:
    """Estimate correlated noise as `correlated_noise` does, and a break where one is likely.

    What it does to the plane counts in the covariance of its form.
    """
    plain = correlated_noise(cells, radius_m, spread_m, resolution_m, lined)
    if cells is None or not cells.white_variance > resolution_m**2:
        return plain.of_plane, None
    trial = _Trial((cells, *lined), radius_m, spread_m, resolution_m, plain)
    lines = _likely_lines(cells, radius_m)
    tried = [trial.of(lines, UNLIKELY)] if lines.most >= LEAST_GAIN else []
    if not tried and not any(plain.gains):
        return plain.of_plane, None
    areas = _likely_areas(cells, radius_m)
    if areas.most > max(CLEARER * lines.most, lines.most + CLEARER_BY):
        in_squares = replace(trial, kinds=(cells,)).of(areas, UNLIKELY_AREA)
        if in_squares.log_odds > DOUBTFUL:
            tried.append(trial.of(areas, UNLIKELY_AREA) if lined else in_squares)
    if not tried:
        return plain.of_plane, None
    found = [one.found(radius_m, tried) for one in tried]
    best = max(range(len(tried)), key=lambda index: tried[index].log_odds)
    noise = (tried[best].noise if tried[best].log_odds > 0.0 else plain).of_plane
    form = sum((one.covariance for one in found), noise.form_covariance)
    return replace(noise, form_covariance=form), found[best]


@frozen
class _Tried:
    """Shape tried on the residuals: what its column leaves is noise.

    log_odds: logarithm of the odds of the shape and this noise against the noise of a plain face.
    """

    fits: _Fits[Lines] | _Fits[Areas]
    noise: CorrelatedNoise
    log_odds: float

    def found(self, radius_m: float, tried: Sequence[_Tried]) -> FaceBreak:
        """Return the break by its probability, against none and the others tried."""
        others = [one.log_odds for one in tried if one is not self]
        against = float(np.logaddexp.reduce([0.0, *others]))
        belief = 0.5 + 0.5 * math.tanh(0.5 * (self.log_odds - against))
        fits, best = self.fits, self.fits.best
        height_m = float(fits.size[best] * fits.shapes.one(best).rise(radius_m))
        covariance = fits.covariance
        if fits.shapes.kind == "area":
            tilt = np.trace(covariance[1:, 1:])
            covariance[1:, 1:] += UNLIKE**2 * tilt * np.eye(2)
        return FaceBreak(fits.shapes.kind, height_m, belief, belief * covariance)


@frozen
class _Trial:
    """Residuals on which shapes are tried: kinds of their cells, and their noise on a plain face.

    radius_m, spread_m, resolution_m: see correlated_noise.
    """

    kinds: tuple[Cells, ...]
    radius_m: float
    spread_m: float
    resolution_m: float
    plain: CorrelatedNoise

    def of(self, fits: _Fits[Lines] | _Fits[Areas], unlikely: float) -> _Tried:
        """Try the likeliest shape, in the kind of cells that shows it or the noise the clearest.

        unlikely: logarithm of the odds against any before the residuals are seen.
        """
        one, size = fits.shapes.one(fits.best), fits.size[fits.best]
        levelled, by_shape = zip(*(_without(one, size, kind) for kind in self.kinds), strict=True)
        noise = correlated_noise(
            levelled[0], self.radius_m, self.spread_m, self.resolution_m, levelled[1:]
        )
        with_shape = np.add(by_shape, noise.gains)
        without = np.array(self.plain.gains[: len(self.kinds)])
        clearest = int(np.argmax(np.maximum(with_shape, without)))
        return _Tried(fits, noise, float(with_shape[clearest] - without[clearest]) - unlikely)


@frozen(eq=False)
class _Fits(Generic[Shapes]):
    """Lines or areas and what each explains of the cells' residuals.

    size: (L,) height or slope. gain: (L,) in log-likelihood. by_shape: (3, L) height and slopes
    of the plane by each.
    """

    shapes: Shapes
    size: Array
    gain: Array
    by_shape: Array

    @classmethod
    def of(cls, shapes: Shapes, cells: Cells) -> _Fits[Shapes]:
        """Fit each on its own to the residuals."""
        columns = shapes.columns(cells.uv_m)
        of_plane, rest = regressed(cells, cells.slopes, columns)
        square = cells.count @ rest**2
        shown = square > 1e-6 * (cells.count @ columns**2)
        size = (cells.count * cells.mean_m) @ rest / np.where(shown, square, np.inf)
        gain = 0.5 * size**2 * square / cells.white_variance
        return cls(shapes, size, gain, size * of_plane[:3])

    @property
    def best(self) -> int:
        """Index of the likeliest."""
        return int(np.argmax(self.gain))

    @property
    def most(self) -> float:
        """Gain of the likeliest."""
        return float(self.gain.max())

    @property
    def covariance(self) -> Array:
        """Second moments (3, 3) of what shapes do to the plane, by likelihood."""
        likely = np.exp(self.gain - self.most)
        return np.asarray((self.by_shape * likely / likely.sum()) @ self.by_shape.T)


def _likely_lines(cells: Cells, radius_m: float) -> _Fits[Lines]:
    """Return the lines about the likeliest, the face beyond them being its smaller part."""
    turns = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    distances_m = radius_m * DISTANCES_OF_RADIUS
    side_m = float(cells.side_m)
    coarse = [_Fits.of(Lines.of(kind, turns, distances_m, side_m), cells) for kind in KINDS]
    found = max(coarse, key=lambda fits: fits.most)
    line = found.shapes.one(found.best)
    direction, distance_m = line.directions[0], line.distances_m[0]
    if cells.count @ (cells.uv_m @ direction > distance_m) > 0.5 * cells.count.sum():
        direction, distance_m = -direction, -distance_m
    near = math.atan2(direction[1], direction[0]) + FINER * turns[1]
    beside_m = distance_m + FINER * (distances_m[1] - distances_m[0])
    return _Fits.of(Lines.of(line.kind, near, beside_m, side_m), cells)


def _likely_areas(cells: Cells, radius_m: float) -> _Fits[Areas]:
    """Return the areas about the likeliest; those first tried where none of them is clear."""
    middles_m, halves_m = radius_m * FIRST_AREAS[:, :2], radius_m * FIRST_AREAS[:, 2:4]
    first = Areas(middles_m, halves_m, FIRST_AREAS[:, 4], float(cells.side_m))
    found = _Fits.of(first, cells)
    if found.most < LEAST_GAIN:
        return found
    by_shape = found.gain.reshape(-1, len(SHAPES))
    best = by_shape.argmax(axis=0) * len(SHAPES) + np.arange(len(SHAPES))
    starts = best[np.argsort(-found.gain[best], kind="stable")[:STARTS]]
    for step in SMALLER ** np.arange(ROUNDS):
        found = _Fits.of(found.shapes.varied(starts, step * VARIATIONS, radius_m), cells)
        of_each = found.gain.reshape(len(starts), -1)
        starts = of_each.argmax(axis=1) + of_each.shape[1] * np.arange(len(starts))
    return found


def _without(shape: Lines | Areas, size: float, cells: Cells) -> tuple[Cells, float]:
    """Return the cells without what one shape leaves in their residuals, and its gain in them."""
    _, rest = regressed(cells, cells.slopes, shape.columns(cells.uv_m))
    mean_m = cells.mean_m - size * rest[:, 0]
    less = cells.count @ (cells.mean_m**2 - mean_m**2)
    return replace(cells, mean_m=mean_m), float(0.5 * less / cells.white_variance)
