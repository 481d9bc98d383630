"""Step or bend of a face along a straight line: a label, dirt, a damaged or a bent plate.

A stationary field, as of correlated noise, varies everywhere alike. One line at which the face
steps or bends does not, and most of what it does passes for a tilt of the plane: that of a step in
the middle is five times as large as a field with the same residuals would have. So lines are tried
as one more column of the residuals' model, and believed as far as this is likelier than a field
alone. The plane stays that of all points: what the line does to it is its form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..vectors import Array
from .correlated_noise import Cells, CorrelatedNoise, correlated_noise

Kind = Literal["step", "bend"]
KINDS: tuple[Kind, ...] = ("step", "bend")
DIRECTIONS = 18
DISTANCES_OF_RADIUS = np.arange(-0.75, 0.76, 0.125)
FINER = np.linspace(-1.0, 1.0, 13)  # steps of both, about the likeliest
UNLIKELY = 11.0  # logarithm of the odds against any line before the residuals are seen
LEAST_GAIN = 9.0  # in log-likelihood: lines below have no belief worth counting
NOTED = 0.9  # belief


@dataclass(frozen=True)
class Line:
    """Line on a face, beyond which it steps or bends, in the axes of the cells.

    direction: (2,) unit, across it. distance_m: from the cells' origin. side_m: of a cell.
    """

    kind: Kind
    direction: Array
    distance_m: float
    side_m: float

    def column(self, uv_m: Array) -> Array:
        """Return how far (C,) the means of cells at uv_m (C, 2) follow a height of 1, or slope."""
        beyond = uv_m @ self.direction - self.distance_m
        if self.kind == "bend":
            return np.asarray(beyond.clip(min=0.0))
        return np.asarray((beyond / self.side_m + 0.5).clip(0.0, 1.0))

    @property
    def other_side(self) -> Line:
        """The same line, the face beyond it being the other part."""
        return replace(self, direction=-self.direction, distance_m=-self.distance_m)


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
    line, size = likely.lines[likely.best], float(likely.size[likely.best])
    gain = float(likely.gain.max())
    if gain < LEAST_GAIN:
        return plain.of_plane, None
    levelled = [_without(line, size, one) for one in (cells, *lined)]
    rest = correlated_noise(levelled[0], radius_m, spread_m, resolution_m, levelled[1:])
    belief = 1.0 / (1.0 + math.exp(UNLIKELY - (gain + rest.gain - plain.gain)))
    found = FaceBreak(
        kind=line.kind,
        height_m=size * (1.0 if line.kind == "step" else radius_m - line.distance_m),
        belief=belief,
        covariance=belief * likely.covariance,
    )
    noise = (rest if belief > 0.5 else plain).of_plane
    return replace(noise, form_covariance=noise.form_covariance + found.covariance), found


@dataclass(frozen=True)
class _Lines:
    """Lines and what each explains of the cells' residuals.

    size: (L,) height or slope. gain: (L,) in log-likelihood. by_line: (3, L) height and slopes of
    the plane by each.
    """

    lines: Sequence[Line]
    size: Array
    gain: Array
    by_line: Array

    @classmethod
    def of(cls, lines: Sequence[Line], cells: Cells) -> _Lines:
        """Fit each line on its own to the residuals."""
        columns = np.stack([line.column(cells.uv_m) for line in lines], axis=1)
        of_plane = _fitted(columns, cells)
        rest = columns - cells.slopes @ of_plane
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
    def covariance(self) -> Array:
        """Second moments (3, 3) of what a line does to the plane, over lines by likelihood."""
        likely = np.exp(self.gain - self.gain.max())
        return np.asarray((self.by_line * likely / likely.sum()) @ self.by_line.T)


def _likely_lines(cells: Cells, radius_m: float) -> _Lines:
    """Return the lines about the likeliest, the face beyond them being its smaller part."""
    turns = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    side_m = float(np.min(cells.sides_m))

    def lines(kind: Kind, turns: Array, shares: Array) -> list[Line]:
        ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        return [Line(kind, way, share * radius_m, side_m) for way in ways for share in shares]

    every = _Lines.of(
        [line for kind in KINDS for line in lines(kind, turns, DISTANCES_OF_RADIUS)], cells
    )
    line = every.lines[every.best]
    if cells.count @ (cells.uv_m @ line.direction > line.distance_m) > 0.5 * cells.count.sum():
        line = line.other_side
    turn = math.atan2(line.direction[1], line.direction[0])
    near = turn + FINER * np.pi / DIRECTIONS
    shares = line.distance_m / radius_m + FINER * (DISTANCES_OF_RADIUS[1] - DISTANCES_OF_RADIUS[0])
    return _Lines.of(lines(line.kind, near, shares), cells)


def _fitted(columns: Array, cells: Cells) -> Array:
    """Return the coefficients (3 + K, ...) of columns (C, ...) by what was fitted to the cells."""
    weighted = cells.slopes.T * cells.count
    return np.asarray(np.linalg.solve(weighted @ cells.slopes, weighted @ columns))


def _without(line: Line, size: float, cells: Cells) -> Cells:
    """Return the cells without what the line leaves in their residuals."""
    column = line.column(cells.uv_m)
    rest = column - cells.slopes @ _fitted(column, cells)
    return replace(cells, mean_m=cells.mean_m - size * rest)
