"""Range errors that depend on what a beam meets: its brightness and its incidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Beam
from .echoes import Echoes

LIGHT, DARK = 0.8, 0.1  # albedos between which brightness_bias_m applies
STEEPEST = 0.1  # cosine below which the bias by incidence stays the same


def biased(echoes: Echoes, beam: Beam) -> Echoes:
    """Return the echoes with the range errors of the beam.

    Brightness: b (0.8 - albedo) / 0.7. Rangefinders correct for the power that they receive, by
    a table; what remains differs between instruments in size and sign. Incidence: b (1 / cos - 1),
    as of light that enters a surface to a depth before it returns.
    """
    return replace(echoes, range_m=echoes.range_m + _bias_m(echoes, beam))


def _bias_m(echoes: Echoes, beam: Beam) -> Array:
    dimness = (LIGHT - echoes.reflectance) / (LIGHT - DARK)
    slope = 1.0 / np.maximum(echoes.cosine, STEEPEST) - 1.0
    return np.asarray(beam.brightness_bias_m * dimness + beam.incidence_bias_m * slope)
