"""TODO."""

from __future__ import annotations

from dataclasses import dataclass

from ..vectors import Array, Array32


@dataclass(frozen=True)
class Patch:
    """The surroundings of the target's face, before anything is fitted to it.

    origin_m: (3,) scanner frame, near the target's centre.
    face_m: (N, 3) all points within reach of the face's plane, relative to origin_m, scanner axes.
    face_intensity: (N,) float32 of them, or None.
    around_m: (M, 3) float32, the same of other points around, thinned where there are many.
    match: of the outline. sigma_m: noise across the plane, roughly.
    basis: (3, 3) rows: the face's own axes u and v as the outline has them, then the normal that
    points to the scanner.
    part: which of the cloud's parts the points are of. station_m: (3,) scanner frame, where the
    scanner stood, if the file says so.
    """

    origin_m: Array
    face_m: Array
    around_m: Array32
    match: float
    basis: Array
    sigma_m: float
    face_intensity: Array32 | None = None
    part: int = 0
    station_m: Array | None = None
