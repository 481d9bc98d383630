"""Step or bend of a face along a straight line: a label, dirt, a damaged or a bent plate.

A stationary field, as of correlated noise, varies everywhere alike. One line at which the face
steps or bends does not, and most of what it does passes for a tilt of the plane: that of a step in
the middle is five times as large as a field with the same residuals would have. So lines are tried
as one more column of the residuals' model, and believed as far as this is likelier than a field
alone, in the cells that show the field or the line best. The plane stays that of all points: what
the line does to it is its form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..vectors import Array
from .correlated_noise import Cells, CorrelatedNoise, correlated_noise, regressed

Kind = Literal["step", "bend"]
KINDS: tuple[Kind, ...] = ("step", "bend")
DIRECTIONS = 18
DISTANCES_OF_RADIUS = np.arange(-0.75, 0.76, 0.125)
FINER = np.linspace(-1.0, 1.0, 13)  # steps of both, about the likeliest
UNLIKELY = 11.0  # logarithm of the odds against any line before the residuals are seen
LEAST_GAIN = 9.0  # in log-likelihood: lines below have no belief worth counting
NOTED = 0.9  # belief


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class FaceBreak:
    """Step or bend found on a face.

    height_m: of a step; of a bend how far it lifts the target's edge. belief: probability.
    covariance: (3, 3) of the plane's height (m) at the centroid and its slopes along u and v:
    of all points against the greater part of the face, by belief.
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
    """Estimate correlated noise as `correlated_noise` does, and a step or bend where one is likely.

    What it does to the plane counts in the covariance of its form.
    """
    plain = correlated_noise(cells, radius_m, spread_m, resolution_m, lined)
    if cells is None or not cells.white_variance > resolution_m**2:
        return plain.of_plane, None
    likely = _likely_lines(cells, radius_m)
    line, size, gain = likely.lines.one(likely.best), likely.size[likely.best], likely.most
    if gain < LEAST_GAIN:
        return plain.of_plane, None
    kinds = (cells, *lined)
    levelled, by_line = zip(*(_without(line, size, one) for one in kinds), strict=True)
    rest = correlated_noise(levelled[0], radius_m, spread_m, resolution_m, levelled[1:])
    with_line, without = np.add(by_line, rest.gains), np.array(plain.gains)
    clearest = int(np.argmax(np.maximum(with_line, without)))
    log_odds = float(with_line[clearest] - without[clearest]) - UNLIKELY
    belief = 0.5 + 0.5 * math.tanh(0.5 * log_odds)
    found = FaceBreak(
        kind=line.kind,
        height_m=float(size * (1.0 if line.kind == "step" else radius_m - line.distances_m[0])),
        belief=belief,
        covariance=belief * likely.covariance,
    )
    noise = (rest if belief > 0.5 else plain).of_plane
    return replace(noise, form_covariance=noise.form_covariance + found.covariance), found


@dataclass(frozen=True)
class _Fits:
    """Lines and what each explains of the cells' residuals.

    size: (L,) height or slope. gain: (L,) in log-likelihood. by_line: (3, L) height and slopes of
    the plane by each.
    """

    lines: Lines
    size: Array
    gain: Array
    by_line: Array

    @classmethod
    def of(cls, lines: Lines, cells: Cells) -> _Fits:
        """Fit each line on its own to the residuals."""
        columns = lines.columns(cells.uv_m)
        of_plane, rest = regressed(cells, cells.slopes, columns)
        square = cells.count @ rest**2
        shown = square > 1e-6 * (cells.count @ columns**2)
        size = (cells.count * cells.mean_m) @ rest / np.where(shown, square, np.inf)
        gain = 0.5 * size**2 * square / cells.white_variance
        return cls(lines, size, gain, size * of_plane[:3])

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
        """Second moments (3, 3) of what a line does to the plane, over lines by likelihood."""
        likely = np.exp(self.gain - self.most)
        return np.asarray((self.by_line * likely / likely.sum()) @ self.by_line.T)


def _likely_lines(cells: Cells, radius_m: float) -> _Fits:
    """Return the lines about the likeliest, the face beyond them being its smaller part."""
    turns = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    distances_m = radius_m * DISTANCES_OF_RADIUS
    side_m = float(cells.side_m)
    coarse = [_Fits.of(Lines.of(kind, turns, distances_m, side_m), cells) for kind in KINDS]
    found = max(coarse, key=lambda fits: fits.most)
    line = found.lines.one(found.best)
    direction, distance_m = line.directions[0], line.distances_m[0]
    if cells.count @ (cells.uv_m @ direction > distance_m) > 0.5 * cells.count.sum():
        direction, distance_m = -direction, -distance_m
    near = math.atan2(direction[1], direction[0]) + FINER * turns[1]
    beside_m = distance_m + FINER * (distances_m[1] - distances_m[0])
    return _Fits.of(Lines.of(line.kind, near, beside_m, side_m), cells)


def _without(line: Lines, size: float, cells: Cells) -> tuple[Cells, float]:
    """Return the cells without what one line leaves in their residuals, and its gain in them."""
    _, rest = regressed(cells, cells.slopes, line.columns(cells.uv_m))
    mean_m = cells.mean_m - size * rest[:, 0]
    less = cells.count @ (cells.mean_m**2 - mean_m**2)
    return replace(cells, mean_m=mean_m), float(0.5 * less / cells.white_variance)
