"""Errors of a scanner's range and axes, carried to the normal and the centre of a target.

An error of range, azimuth or elevation moves the points of a target, each along or across its own
beam. To first order the target is shifted by what moves its centre, and tilted by how that differs
from point to point. Azimuth and elevation are about the scan's z.
Sources: terms of the axes, as of theodolites: Lichti, ISPRS J. Photogramm. 61 (2007) 307; field
tests that find them: ISO 17123-9, ASTM E3125, ISO 10360-13.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..config import InstrumentConfig
from ..vectors import Array
from .components import UncertaintyComponent

ARCSEC = math.radians(1.0 / 3600.0)
REACH = 0.5  # of the target's radius: where movements are compared with those of its centre
STEEPEST = 0.1  # least cosine of incidence
# Of b sin(incidence): shift of a centre in its plane by its edges under an error by incidence, as
# the wall is seen at another incidence than the face. Measured on synthetic scans of discs at 23 to
# 40 degrees: 0.2 at 0.8 mm of noise, 0.3 to 0.8 at 0.2 mm.
EDGE_BY_INCIDENCE = 0.4

Movement = Callable[[Array], Array]  # of points (N, 3) relative to the scanner


def instrument_components(
    instrument: InstrumentConfig,
    sight_m: Array,
    normal: Array,
    radius_m: float,
    station: str | None,
) -> list[UncertaintyComponent]:
    """Return the components of the stated errors of range and axes, of one target.

    sight_m: (3,) from the scanner to the centre; normal: (3,) unit. Errors of the range are shared
    by all scans of the scanner. Those of the axes are shared by the scans of one station, whose
    name is None where it is not known: between stations the face of the instrument may change,
    which reverses their signs. All scans share them if they were taken in the same face.
    """
    stated = instrument
    by_incidence = [_by_incidence(stated.incidence_bias_m, sight_m, normal)]
    by_scale = [_along(_distance, 1e-6 * stated.range_scale_ppm)]
    ranges = (("incidence", by_incidence), ("range scale", by_scale))
    axes = [
        _azimuth(lambda p: _distance(p) / _level(p), stated.collimation_arcsec * ARCSEC),
        _azimuth(lambda p: p[:, 2] / _level(p), stated.trunnion_arcsec * ARCSEC),
        _azimuth(lambda p: 1.0 / _level(p), stated.beam_offset_m),
        _elevation(lambda p: np.ones(len(p)), stated.vertical_index_arcsec * ARCSEC),
        *_eccentricity(stated.azimuth_eccentricity_arcsec, _azimuth, _azimuth_of),
        *_eccentricity(stated.elevation_eccentricity_arcsec, _elevation, _elevation_of),
    ]
    of_range = [
        _component(name, moved, sight_m, normal, radius_m, "scanner") for name, moved in ranges
    ]
    common = "scanner" if stated.same_face else station
    return [*of_range, _component("axes", axes, sight_m, normal, radius_m, common)]


def _component(
    name: str,
    movements: list[Movement],
    sight_m: Array,
    normal: Array,
    radius_m: float,
    shared: str | None,
) -> UncertaintyComponent:
    """Return the component of independent movements, one column each.

    With u, v, n right-handed and D the movement: the normal turns by -(n.D_u) u - (n.D_v) v, the
    target in its plane by (v.D_u - u.D_v) / 2.
    """
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    step = REACH * radius_m
    points = sight_m + step * np.array([np.zeros(3), u, -u, v, -v])
    columns, turns = [], []
    for movement in movements:
        at_centre, *around = movement(points)
        by_u, by_v = (around[0] - around[1]) / (2.0 * step), (around[2] - around[3]) / (2.0 * step)
        tilt = -(normal @ by_u) * u - (normal @ by_v) * v
        columns.append(np.concatenate([tilt, at_centre]))
        turns.append(0.5 * float(v @ by_u - u @ by_v))
    factor = np.stack(columns, axis=1)
    return UncertaintyComponent(name, factor, shared=shared, turn=np.array(turns))


def edge_shift_m(bias_m: float, sight_m: Array, normal: Array) -> Array:
    """Return the shift (3,) of a centre in its plane by walls with an error by incidence."""
    beam = sight_m / np.linalg.norm(sight_m)
    return np.asarray(EDGE_BY_INCIDENCE * bias_m * (beam - (beam @ normal) * normal))


def _by_incidence(bias_m: float, sight_m: Array, normal: Array) -> Movement:
    """Return the movement by an error of the range that grows with the incidence."""
    along = _along(lambda p: _steepness(p, normal), bias_m)
    shift_m = edge_shift_m(bias_m, sight_m, normal)
    return lambda p: along(p) + shift_m


def _along(error_m: Callable[[Array], Array], size: float) -> Movement:
    """Return the movement by an error of the range."""
    return lambda p: size * (error_m(p) / _distance(p))[:, None] * p


def _azimuth(error_rad: Callable[[Array], Array], size: float) -> Movement:
    """Return the movement by an error of the azimuth, counterclockwise about z."""
    return lambda p: size * error_rad(p)[:, None] * np.cross([0.0, 0.0, 1.0], p)


def _elevation(error_rad: Callable[[Array], Array], size: float) -> Movement:
    """Return the movement by an error of the elevation."""

    def movement(p: Array) -> Array:
        up = np.column_stack([-p[:, :2] * (p[:, 2] / _level(p))[:, None], _level(p)])
        return np.asarray(size * error_rad(p)[:, None] * up)

    return movement


def _eccentricity(
    amplitude_arcsec: float,
    moved_by: Callable[[Callable[[Array], Array], float], Movement],
    angle: Callable[[Array], Array],
) -> list[Movement]:
    """Return the movements by E sin(angle) and E cos(angle), for a phase that is not known."""
    size = amplitude_arcsec * ARCSEC / math.sqrt(2.0)
    return [
        moved_by(lambda p: np.sin(angle(p)), size),
        moved_by(lambda p: np.cos(angle(p)), size),
    ]


def _distance(p: Array) -> Array:
    return np.asarray(np.linalg.norm(p, axis=1))


def _level(p: Array) -> Array:
    """Return the distances from the vertical axis, above 0."""
    return np.hypot(p[:, 0], p[:, 1]).clip(min=1e-3 * float(np.abs(p).max()))


def _azimuth_of(p: Array) -> Array:
    return np.arctan2(p[:, 1], p[:, 0])


def _elevation_of(p: Array) -> Array:
    return np.arctan2(p[:, 2], _level(p))


def _steepness(p: Array, normal: Array) -> Array:
    """Return 1 / cos(incidence) - 1."""
    return 1.0 / (np.abs(p @ normal) / _distance(p)).clip(min=STEEPEST) - 1.0
