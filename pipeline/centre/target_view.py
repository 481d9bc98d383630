"""Points of a scan at a target, in the coordinates of the plane fitted to it."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..cloud import sample_rows, thin
from ..config import CentreConfig
from ..plane import Patch, PlaneFit
from ..system import frozen
from ..targets import Outline, Target
from ..vectors import Array, Array32, Mask, Rows, in_axes, turned
from .edge.edge_intensity import face_light, relative_to_face

GENTLE_SLOPE = 1.2  # of beams: shift aside per depth, as a rule
FACE_POINTS = 5_000  # by which its brightness is known
BEYOND_M = 0.03  # distance outside an edge within which points may matter to it


@frozen
class TargetView:
    """Points of a scan at a target, and the plane fitted to them."""

    patch: Patch
    plane: PlaneFit
    target: Target
    config: CentreConfig

    def near(
        self,
        outline: Outline,
        start: tuple[Array, float],
        slope: float = GENTLE_SLOPE,
        even: bool = False,
    ) -> Array:
        """Return the points that may matter to an outline, in plane coordinates (M, 3 or 5).

        With intensities over that of the face, where known: of those on the target, NaN around it,
        and on a face that is not of one brightness; then of all, as the scan has them about such a
        face. slope: of the beams, by which points behind the plane are shifted aside per depth.
        even: those on the target are thinned as those around it are, so that all beams count alike.
        """
        face, around = self._near_rows(outline, start, slope)
        return self._joined(self._thinned(face) if even else face, around)

    def flat_and_even(
        self, outline: Outline, start: tuple[Array, float], within_m: float
    ) -> tuple[Array, Array]:
        """Return those of `near` within that of the plane, without intensities, and all, `even`."""
        face, around = self._near_rows(outline, start, GENTLE_SLOPE)
        flat = [_flat(self.parts[0], face, within_m), _flat(self.parts[1], around, within_m)]
        even = self._joined(self._thinned(face), around)
        return np.concatenate(flat, axis=1, dtype=np.float64).T, even

    def _near_rows(self, outline: Outline, start: tuple[Array, float], slope: float) -> list[Rows]:
        """Return the rows of face and surroundings that may matter to an outline."""
        inner = max(0.1 * outline.size_m, 0.012)

        def near(uvw: Array | Array32) -> Mask:
            q = turned(uvw[:, :2] - start[0].astype(uvw.dtype), -start[1])
            x = outline.outside_m(*q.T)
            aside = slope * np.abs(uvw[:, 2])
            return np.asarray((x > -inner - aside) & (x < BEYOND_M + aside))

        return [np.flatnonzero(near(uvw)) for uvw in self.parts]

    def _thinned(self, face: Rows) -> Rows:
        """Return those of some rows of the face that are left where it is as thin as the rest."""
        share = self.patch.around_share
        return face[thin(self.patch.face_m[face], share)] if share < 1.0 else face

    def _joined(self, face: Rows, around: Rows) -> Array:
        """Return rows of face and surroundings in plane coordinates, and their intensity."""
        (on, off), count = self.parts, len(face)
        joined = np.empty((5, count + len(around)))
        joined[:3, :count] = on.T.take(face, axis=1)
        joined[:3, count:] = off.T.take(around, axis=1)
        lights = self.patch.face_intensity, self.patch.around_intensity
        if lights[0] is None or lights[1] is None:
            return joined[:3].T
        joined[3], joined[4] = np.nan, np.concatenate([lights[0][face], lights[1][around]])
        if self._face_light is not None:
            joined[4] = relative_to_face(joined[:2].T, joined[4], self._face_light)
            joined[3, :count] = joined[4, :count]
        return joined.T

    @cached_property
    def _face_light(self) -> Array | None:
        """Intensity of the target's face (3,), see `face_light`; None where it is not known."""
        if self.patch.face_intensity is None:
            return None
        uvw, rows = self.on_face(self.target.radius_m)
        some = sample_rows(uvw, FACE_POINTS)
        return face_light(uvw[some, :2], self.patch.face_intensity[rows[some]])

    @cached_property
    def parts(self) -> tuple[Array, Array32]:
        """Face and surroundings of the patch in the plane's coordinates, (N, 3) and (M, 3)."""
        return self.in_plane(self.patch.face_m), self.in_plane(self.patch.around_m)

    def in_plane(self, points: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return points (N, 3) of the patch in the plane's coordinates."""
        uvw = in_axes(self.plane.basis.astype(points.dtype), points)
        uvw[:, 2] += self._lift_m
        return uvw

    def on_face(self, radius_m: float) -> tuple[Array, npt.NDArray[np.intp]]:
        """Return the points on the target in plane coordinates (M, 3), and their rows."""
        uvw, _ = self.parts
        near = uvw[:, 0] ** 2 + uvw[:, 1] ** 2 < (1.1 * radius_m) ** 2
        kept = np.flatnonzero(near & (np.abs(uvw[:, 2]) < self.band_m))
        return np.stack([column.take(kept) for column in uvw.T], axis=1), kept

    @property
    def station(self) -> Array | None:
        """Position of the scanner in the plane's coordinates (3,).

        None if it is not known, or lies behind the target, which contradicts the scan.
        """
        if self.patch.station_m is None:
            return None
        position = self.in_plane((self.patch.station_m - self.patch.origin_m)[None])[0]
        return position if position[2] > 0.0 else None

    @property
    def band_m(self) -> float:
        """Half the thickness of the layer of points on the target."""
        return max(3.0 * self.plane.sigma_m, 1e-6)

    @property
    def spacing_m(self) -> float:
        """Mean distance between points on the target."""
        return math.sqrt(self.target.region.area_m2 / self.plane.count)

    def to_scanner(self, centre: Array) -> Array:
        """Return a position (2,) in the plane in scanner coordinates (3,)."""
        basis = self.plane.basis
        return np.asarray(self.patch.origin_m + centre @ basis[:2] - self._lift_m * basis[2])

    @property
    def _lift_m(self) -> float:
        """Height of the patch's origin above the plane."""
        return float((self.patch.origin_m - self.plane.centroid_m) @ self.plane.basis[2])


def _flat(uvw: npt.NDArray[Any], rows: Rows, within_m: float) -> npt.NDArray[Any]:
    """Return those rows of points uvw (N, 3) that lie within that of the plane, transposed."""
    return np.asarray(uvw.T.take(rows[np.abs(uvw[:, 2].take(rows)) < within_m], axis=1))
