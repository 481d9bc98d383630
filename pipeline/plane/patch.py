"""Patch of a scan that shows a target: the input of the plane fit and the centre fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ..cloud import EXACT, Steps
from ..system import frozen
from ..vectors import Array, Array32, Mask, Rows, turned
from .copies import copies_within_m, first_in_places, first_within, places_shared, some_of

CHANCE_M = 2e-4  # steps of coordinates from which on points share places by chance


@frozen(eq=False)
class Patch:
    """Points of a target and its surroundings, before anything is fitted to them.

    origin_m: (3,) scanner frame, near the target's centre.
    face_m: (N, 3) all points near the target's plane, relative to origin_m, scanner axes.
    around_m: (M, 3) float32, other points around, likewise relative, thinned where there are many;
    around_share: of them that was kept; around_after: (M,) how many of face_m stand before each in
    the file, whose order both keep; None where that is not known.
    face_intensity, around_intensity: (N,) and (M,) float32 intensities of both, or None.
    match: score of the outline. sigma_m: rough noise across the plane.
    basis: (3, 3) rows: the target's axes u and v, then the normal towards the scanner.
    part: index of the cloud's part that holds the points. station_m: (3,) scanner frame, position
    of the scanner, if the file states it. steps: in which the coordinates were rounded. elsewhere:
    other placements, (2,) along u and v from origin_m and a rotation, at which what is seen of a
    partly hidden target fits nearly as well. copies: number of points left out of face_m, in the
    places of others.
    """

    origin_m: Array
    face_m: Array
    around_m: Array32
    match: float
    basis: Array
    sigma_m: float
    face_intensity: Array32 | None = None
    around_intensity: Array32 | None = None
    around_share: float = 1.0
    around_after: Rows | None = None
    part: int = 0
    station_m: Array | None = None
    steps: Steps = EXACT
    elsewhere: tuple[tuple[Array, float], ...] = ()
    copies: int = 0

    @property
    def scanner_m(self) -> Array | None:
        """Position of the scanner (3,), scanner frame.

        None if the file does not state it, or if it lies behind the target, which contradicts the
        scan.
        """
        if self.station_m is None or not (self.station_m - self.origin_m) @ self.basis[2] > 0.0:
            return None
        return self.station_m

    @property
    def station(self) -> str | None:
        """Name of the scanner's station, by its position; None without one."""
        if self.scanner_m is None:
            return None
        return "station {:.3f} {:.3f} {:.3f}".format(*(self.scanner_m.round(3) + 0.0))

    def placed(self, centre_m: Array, turn_rad: float) -> Patch:
        """Return the same points about another centre (3,), the axes u and v rotated in-plane."""
        moved = self.origin_m - centre_m
        axes = turned(self.basis[:2].T, -turn_rad).T
        return replace(
            self,
            origin_m=centre_m,
            face_m=self.face_m + moved,
            around_m=self.around_m + moved.astype(np.float32),
            basis=np.vstack([axes, self.basis[2]]),
            elsewhere=(),
        )

    @property
    def placements(self) -> list[Patch]:
        """The patch, and the same points about each of its other placements."""
        others = ((self.origin_m + by @ self.basis[:2], turn) for by, turn in self.elsewhere)
        return [replace(self, elsewhere=()), *(self.placed(at, turn) for at, turn in others)]

    @property
    def each_once(self) -> Patch:
        """The patch without copies of points, as of a cloud that was merged with itself.

        They show nothing of their own, and would count as further points.
        """
        if float(self.steps.step_m.max()) > CHANCE_M:
            return self
        some = some_of(self.face_m)
        if len(some) == 0:
            return self
        reach_m = copies_within_m(self.face_m, some[0], self.basis[2], self.sigma_m)
        if reach_m > 0.0:
            return self._without_copies(partial(first_within, reach_m=reach_m))
        if places_shared(some):
            return self._without_copies(first_in_places)
        return self

    def _without_copies(self, first: Callable[[Array | Array32], Rows]) -> Patch:
        """Return the patch with the rows of its points that `first` names."""
        alone = self.kept(first(self.face_m), first(self.around_m))
        return replace(alone, copies=len(self.face_m) - len(alone.face_m))

    def kept(self, face: Mask | Rows | slice, around: Mask | Rows | slice) -> Patch:
        """Return the patch with those of its points alone, rows of face_m and around_m."""
        on_face, beside = self.face_intensity, self.around_intensity
        return replace(
            self,
            face_m=self.face_m[face],
            around_m=self.around_m[around],
            around_after=None,
            face_intensity=None if on_face is None else on_face[face],
            around_intensity=None if beside is None else beside[around],
        )

    def turned_round(self) -> Patch:
        """Return the same points, the scanner on the other side of the target."""
        elsewhere = tuple((by * np.array([1.0, -1.0]), -turn) for by, turn in self.elsewhere)
        basis = self.basis * np.array([[1.0], [-1.0], [-1.0]])
        return replace(self, basis=basis, elsewhere=elsewhere)
