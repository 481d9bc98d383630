"""Systematic errors: of the range by what a beam meets, and of the instrument."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Beam, Calibration
from .echoes import Echoes

LIGHT, DARK = 0.8, 0.1  # albedos between which brightness_bias_m applies
EXACT = Calibration()
ARCSEC = np.pi / 180 / 3600
STEEPEST = 0.1  # cosine below which the bias by incidence stays the same


def biased(echoes: Echoes, beam: Beam) -> Echoes:
    """Return the echoes with the range errors of the beam.

    Brightness: b (0.8 - albedo) / 0.7. Rangefinders correct for the power that they receive, by
    a table; what remains differs between instruments in size and sign. Incidence: b (1 / cos - 1),
    as of light that enters a surface to a depth before it returns.
    """
    return replace(echoes, range_m=echoes.range_m + _bias_m(echoes, beam))


def measured_range_m(range_m: Array, calibration: Calibration) -> Array:
    """Return the ranges with the instrument's offset and scale."""
    scale = 1.0 + 1e-6 * calibration.range_scale_ppm
    return np.asarray(range_m * scale + calibration.range_offset_m)


def measured_angles(
    azimuth_rad: Array, elevation_rad: Array, range_m: Array, calibration: Calibration
) -> tuple[Array, Array]:
    """Return the azimuth and elevation that the instrument reports of a beam.

    Azimuth: collimation c / cos e, trunnion axis i tan e, eccentricity E sin(a - a0), and the beam
    offset over the level range; elevation: index v, eccentricity: the axis errors of theodolites,
    which laser scanners share (Lichti, ISPRS J. Photogramm. 61 (2007) 307). Face 2 reads the
    azimuth half a turn on, and the vertical circle in its other sense: -v - E sin(e + e0).
    """
    one = calibration
    sign = 1.0 if one.face == 1 else -1.0
    level = np.cos(elevation_rad)
    azimuth = one.collimation_arcsec / level + one.trunnion_arcsec * np.tan(elevation_rad)
    zero = np.radians(one.azimuth_eccentricity_at_deg)
    azimuth = azimuth + one.azimuth_eccentricity_arcsec * np.sin(azimuth_rad - zero)
    if one.beam_offset_m:
        azimuth = azimuth + one.beam_offset_m / (range_m * level) / ARCSEC
    zero = sign * np.radians(one.elevation_eccentricity_at_deg)
    elevation = one.vertical_index_arcsec + one.elevation_eccentricity_arcsec * np.sin(
        elevation_rad - zero
    )
    return azimuth_rad + sign * ARCSEC * azimuth, elevation_rad + sign * ARCSEC * elevation


def _bias_m(echoes: Echoes, beam: Beam) -> Array:
    dimness = (LIGHT - echoes.reflectance) / (LIGHT - DARK)
    slope = 1.0 / np.maximum(echoes.cosine, STEEPEST) - 1.0
    return np.asarray(beam.brightness_bias_m * dimness + beam.incidence_bias_m * slope)
