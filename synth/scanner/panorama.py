"""Scan of a whole scene from one station, block after block of its rows.

Every row of beams has its own stream of random numbers, so that the points do not depend on the
number of rows of a block, and a block does not depend on the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Beam, Calibration
from ..scene.scene import Scene
from .echoes import Echoes, trace
from .lattice import Lattice
from .noise import by_surfaces, correlated_rows, margin
from .raycast import RayCaster
from .scanner import Scan, directions, range_sigma_m, report
from .spot import near_edges, spot_reach, with_spots
from .systematic import EXACT, measured_angles

BLOCK = 400_000  # beams per block
ROWS, CORRELATED, LINES = 3, 5, 6  # streams of random numbers, with the seed


def scan_rows(
    scene: Scene,
    caster: RayCaster,
    grid: Lattice,
    beam: Beam,
    target_m: Array,
    nearest_m: float,
    stream: tuple[int, int],
    block: int = BLOCK,
    calibration: Calibration = EXACT,
) -> Iterator[Scan]:
    """Yield the scan in blocks of rows, from the lowest.

    target_m: (3,) in station coordinates, where the correlation length of the noise applies;
    nearest_m: lower bound of the range; stream: seed and number of the station; block: beams per
    block.
    """
    row_scanner = _RowScanner(scene, caster, grid, beam, target_m, nearest_m, *stream, calibration)
    count = len(grid.elevation_rad)
    height = max(1, block // len(grid.azimuth_rad))
    for first in range(0, count, height):
        yield row_scanner.scan(range(first, min(first + height, count)))


@dataclass(frozen=True)
class _RowScanner:
    """Scanner of rows from one station."""

    scene: Scene
    caster: RayCaster
    grid: Lattice
    beam: Beam
    target_m: Array
    nearest_m: float
    seed: int
    station: int
    calibration: Calibration

    @cached_property
    def reach(self) -> int:
        """Largest number of steps within a spot radius."""
        ends = directions(np.zeros(2), self.grid.elevation_rad[[0, -1]])
        return spot_reach(self.nearest_m, ends, self.grid.step_rad, self.beam)

    def scan(self, rows: range) -> Scan:
        beyond = self.reach + 1  # rows on either side whose edges a spot may reach
        low = max(rows.start - beyond, 0)
        high = min(rows.stop + beyond, len(self.grid.elevation_rad))
        streams = [self._stream(ROWS, row) for row in range(low, high)]
        inner = slice(rows.start - low, rows.stop - low)
        echoes = self._echoes(slice(low, high), streams, inner)
        correlated = self._correlated(rows)
        width = len(self.grid.azimuth_rad)
        scans = []
        for k, rng in enumerate(streams[inner]):
            row = _rows(echoes, slice(k * width, (k + 1) * width))
            elevation = np.full(width, self.grid.elevation_rad[rows[k]])
            angles = measured_angles(
                self.grid.azimuth_rad, elevation, row.range_m, self.calibration
            )
            sigma_m = range_sigma_m(self.beam.range_sigma_m, row, self.beam)
            noise_m = rng.normal(0.0, 1.0, width) * sigma_m
            if len(correlated):
                sigma_m = range_sigma_m(self.beam.correlated_sigma_m, row, self.beam)
                noise_m += correlated[k] * sigma_m
            if self.beam.line_sigma_m > 0.0:
                noise_m += self.beam.line_sigma_m * self._line_offsets(rows[k])
            if self.scene.optics is not None:
                row, noise_m = by_surfaces(row, noise_m, self.scene.optics, rng)
            scans.append(
                report(row, directions(*angles), noise_m, self.beam, rng, self.calibration)
            )
        return _joined(scans)

    def _stream(self, kind: int, row: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, kind, self.station, row])

    def _line_offsets(self, row: int) -> Array | float:
        """Return the offsets of the scan lines that the beams of a row belong to."""
        if self.beam.scan_lines == "rows":
            return float(self._stream(LINES, row).standard_normal())
        return self._stream(LINES, 0).standard_normal(len(self.grid.azimuth_rad))

    def _echoes(self, span: slice, streams: Sequence[np.random.Generator], inner: slice) -> Echoes:
        """Return the echoes of the rows `inner` of the span."""
        width = len(self.grid.azimuth_rad)
        jitter = np.stack([rng.normal(0.0, 1.0, (2, width)) for rng in streams])
        true = self.grid.jittered(span, jitter * self.beam.angle_sigma_urad * 1e-6)
        thin = trace(self.scene, self.caster, 0.0, true.reshape(-1, 3))
        kept = _rows(thin, slice(inner.start * width, inner.stop * width))
        if self.beam.is_thin:
            return kept
        edge = near_edges(self.scene, thin, true, self.grid.step_rad, self.beam, self.reach)[inner]
        beams = true[inner].reshape(-1, 3)
        numbers = np.arange(len(beams)) + (span.start + inner.start) * width
        return with_spots(self.scene, self.caster, kept, beams, edge.ravel(), self.beam, numbers)

    def _correlated(self, rows: range) -> Array:
        """Return the part of the noise that is correlated between beams, unit variance: (H, W)."""
        if self.beam.correlated_sigma_m == 0.0:
            return np.zeros((0, 0))
        far_m = float(np.linalg.norm(self.target_m))
        level = float(np.hypot(*self.target_m[:2])) / far_m
        steps = self.beam.correlation_length_m / (far_m * self.grid.step_rad)
        across = self.beam.correlation_aspect * steps / level
        width = len(self.grid.azimuth_rad)
        if not self.grid.closed:
            width += 2 * margin(across)

        def white(row: int) -> Array:
            return self._stream(CORRELATED, row + margin(steps)).standard_normal(width)

        return correlated_rows(white, rows, (steps, across), closed=self.grid.closed)


def _rows(echoes: Echoes, span: slice) -> Echoes:
    return replace(echoes, **{name: getattr(echoes, name)[span] for name in vars(echoes)})


def _joined(scans: Sequence[Scan]) -> Scan:
    return Scan(
        np.concatenate([scan.points_station_m for scan in scans]),
        np.concatenate([scan.intensity for scan in scans]),
        np.concatenate([scan.target for scan in scans]),
        sum(scan.beams for scan in scans),
    )
