"""Plausibility of five-point blocks: flat within their noise, and regular pentagons.

A wrong digit moves one coordinate of one point. Each block is tested against the scatter of the
others: across its plane (2 degrees of freedom), about a regular pentagon in it (6), and for an
error of each of its 15 coordinates. Blocks that fail are taken out one after the other, the worst
first, so that they hide neither each other nor in the noise of the rest (Rosner, Technometrics 25
(1983) 165).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from ..errors import InputError
from ..system import frozen, stage
from ..uncertainty import chi_square_beyond, f_beyond, least_tail
from ..vectors import Array
from .components import SIGNIFICANCE, Station, stated_variance
from .fit_block import BlockFit, fit_points
from .pentagon import KEPT, SIDES, Pentagon, fit_pentagon

BlockStatus = Literal["ok", "block-not-flat", "block-not-regular"]
LEVEL = 2e-6  # significance level of a block: no false alarm in ten thousand files
TESTS = 3 * SIDES + 2
RADIUS = 0.1  # of the stated radius, by which that of most blocks may differ
# What is known before the points: total stations scatter by 0.17 to 1.1 mm across a target (95 %),
# and marks about a regular pentagon by 0.6 to 2.2 mm.
NOISE_M, NOISE_DOF = 0.3e-3, 3
MARKS_M, MARKS_DOF = 1e-3, 6


@frozen
class Remainder:
    """Block without its suspect point, the one that contradicts the other four.

    suspect: its index in the block. off_m: (3,) from the free corner of the other four's pentagon.
    points_m: (4, 3). fit: their plane. centre_m: of their pentagon; u_centre_m: its standard
    uncertainty along each axis of the plane, of dof degrees of freedom.
    """

    suspect: int
    off_m: Array
    points_m: Array
    fit: BlockFit
    centre_m: Array
    u_centre_m: float
    dof: int


@frozen
class BlockCheck:
    """Result for one block; remainder: None where it is plausible, or no single point accounts.

    off_plane_m, off_pentagon_m: root mean square of its points.
    """

    status: BlockStatus
    off_plane_m: float
    off_pentagon_m: float
    remainder: Remainder | None = None


def check_radius(blocks_m: Array, radius_m: float, source: str) -> None:
    """Raise InputError, which names the file, where `radius_m` is not that of most blocks."""
    found = [Misfit.of(block, None, None).pentagon.radius_m for block in blocks_m]
    middle_m = float(np.median(found))
    if abs(middle_m - radius_m) > RADIUS * radius_m:
        raise InputError(
            f"{source}: the points lie on circles of {middle_m * 1e3:.3g} mm radius, not "
            f"{radius_m * 1e3:.3g} mm: check --radius and --length-unit"
        )


@stage("plane")
def check_blocks(
    blocks_m: Array, station: Station | None, radius_m: float | None
) -> tuple[BlockCheck, ...]:
    """Check blocks (M, 5, 3). radius_m: that all pentagons must have, if it is known.

    station: the scatter across the planes is compared with what it states, if that explains the
    other blocks, and with theirs otherwise.
    """
    misfits = [Misfit.of(block, station, radius_m) for block in blocks_m]
    bad = _worst_first(misfits)
    usual = Scatter.of(misfit for index, misfit in enumerate(misfits) if index not in bad)
    return tuple(
        BlockCheck(
            bad.get(index, "ok"),
            misfit.fit.rms_m,
            math.sqrt(misfit.ring / SIDES),
            _remainder(block, usual, station, radius_m) if index in bad else None,
        )
        for index, (block, misfit) in enumerate(zip(blocks_m, misfits, strict=True))
    )


@frozen
class Misfit:
    """Residuals of a block, or of four points of it, across its plane and about its pentagon.

    flat, ring: sums of their squares, that across over `unit`, the variance (m2) which is stated or
    usual; flat_dof, ring_dof: their degrees of freedom.
    """

    points_m: Array
    fit: BlockFit
    pentagon: Pentagon
    unit: float
    stated: bool
    flat: float
    flat_dof: int
    ring: float
    ring_dof: int

    @classmethod
    def of(cls, points_m: Array, station: Station | None, radius_m: float | None) -> Misfit:
        """Fit plane and pentagon to points (n, 3)."""
        fit, n = fit_points(points_m), len(points_m)
        pentagon = fit_pentagon((points_m - fit.centre_m) @ fit.axes[1:].T)
        stated = 0.0 if station is None else stated_variance(points_m, fit, station)
        unit = stated or NOISE_M**2
        ring, ring_dof = pentagon.square_m2, 2 * n - 4
        if radius_m is not None:
            ring, ring_dof = ring + n * (pentagon.radius_m - radius_m) ** 2, ring_dof + 1
        flat = float(fit.scatter_m2[0]) / unit
        return cls(points_m, fit, pentagon, unit, stated > 0.0, flat, n - 3, ring, ring_dof)

    def error_of_a_coordinate(self, usual: Scatter) -> float:
        """Return the smallest p-value of Student's tests for an error of each coordinate.

        An error d of coordinate k of point i gives the residuals d n_k (I - H)_i across the plane,
        n being its normal and H its hat matrix, and the like in it. Generalised least squares
        estimate d; its degrees of freedom are those of Welch and Satterthwaite.
        """
        across, in_plane = usual.flat * self.unit, usual.ring
        flat_m, ring_m, kept_flat, kept_ring = self._coordinates
        residuals = ring_m / in_plane + flat_m / across
        of_flat, of_ring = kept_flat / across, kept_ring / in_plane
        weight = of_flat + of_ring
        share = of_flat / weight
        with np.errstate(divide="ignore"):
            dof = 1.0 / (share**2 / usual.flat_dof + (1.0 - share) ** 2 / usual.ring_dof)
        return 2.0 * least_tail((np.abs(residuals) / np.sqrt(weight)).ravel(), dof.ravel())

    @cached_property
    def _coordinates(self) -> tuple[Array, Array, Array, Array]:
        """Residuals (n, 3) by coordinate, and shares of an error in them: (n, 3) and (3,).

        Each of both: across the plane, and about the pentagon.
        """
        n, axes = self.fit.normal, self.fit.axes[1:]
        offset = self.points_m - self.fit.centre_m
        uv = offset @ axes.T
        leverage = 1.0 / len(uv) + np.sum(uv**2 / self.fit.scatter_m2[1:], axis=1)
        return (
            np.outer(offset @ n, n),
            self.pentagon.residuals_m @ axes,
            np.outer(1.0 - leverage, n**2),
            KEPT * np.sum(axes**2, axis=0),
        )


@frozen
class Scatter:
    """Mean squares of plausible blocks with their degrees of freedom, as those of a Misfit."""

    flat: float
    flat_dof: float
    ring: float
    ring_dof: int

    @classmethod
    def of(cls, misfits: Iterable[Misfit]) -> Scatter:
        """Pool the scatter of blocks with what is stated, or known before."""
        others = list(misfits)
        ring = MARKS_DOF * MARKS_M**2 + sum(one.pentagon.square_m2 for one in others)
        ring_dof = MARKS_DOF + (2 * SIDES - 4) * len(others)
        flat, flat_dof = sum(one.flat for one in others), sum(one.flat_dof for one in others)
        if not all(one.stated for one in others):
            flat, flat_dof = flat + NOISE_DOF, flat_dof + NOISE_DOF
        elif chi_square_beyond(flat, flat_dof) >= SIGNIFICANCE:
            return cls(1.0, math.inf, ring / ring_dof, ring_dof)
        return cls(flat / flat_dof, flat_dof, ring / ring_dof, ring_dof)

    def doubt(self, block: Misfit) -> tuple[float, BlockStatus]:
        """Return the p-value of a block, by its most significant test, and the status for it."""
        flat = f_beyond(block.flat / block.flat_dof / self.flat, block.flat_dof, self.flat_dof)
        ring = f_beyond(block.ring / block.ring_dof / self.ring, block.ring_dof, self.ring_dof)
        single = block.error_of_a_coordinate(self) if len(block.points_m) == SIDES else 1.0
        status: BlockStatus = "block-not-flat" if flat <= ring else "block-not-regular"
        return TESTS * min(flat, ring, single), status


def _worst_first(misfits: Sequence[Misfit]) -> dict[int, BlockStatus]:
    """Return the indices of implausible blocks, at most half of them, with their statuses."""
    left = dict(enumerate(misfits))
    out: dict[int, BlockStatus] = {}
    failed = 0
    for count in range(1, len(misfits) // 2 + 1):
        doubts = {
            index: Scatter.of(one for other, one in left.items() if other != index).doubt(block)
            for index, block in left.items()
        }
        worst = min(doubts, key=lambda index: doubts[index][0])
        out[worst] = doubts[worst][1]
        del left[worst]
        if doubts[worst][0] < LEVEL:
            failed = count
    return dict(list(out.items())[:failed])


def _remainder(
    block_m: Array, usual: Scatter, station: Station | None, radius_m: float | None
) -> Remainder | None:
    """Return the block without the point that leaves the others most plausible, if they are."""
    rests = [np.delete(block_m, index, axis=0) for index in range(SIDES)]
    misfits = [Misfit.of(rest, station, radius_m) for rest in rests]
    index = int(np.argmin([one.flat / usual.flat + one.ring / usual.ring for one in misfits]))
    best = misfits[index]
    if usual.doubt(best)[0] < LEVEL:
        return None
    across = best.fit.axes[1:]
    corner_m = best.fit.centre_m + best.pentagon.free @ across
    return Remainder(
        suspect=index,
        off_m=block_m[index] - corner_m,
        points_m=rests[index],
        fit=best.fit,
        centre_m=best.fit.centre_m + best.pentagon.centre @ across,
        # The centre by four corners has the variance 4/15 of one mark, the mean of five 1/5.
        u_centre_m=math.sqrt(usual.ring / 15.0),
        dof=usual.ring_dof,
    )
