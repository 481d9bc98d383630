"""What the scatter of the points cannot show: what the target's and the scanner's files state."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..config import InstrumentConfig
from ..targets import Target
from ..vectors import Array
from .components import (
    Cause,
    clamp_cause,
    form_cause,
    pointing_cause,
    range_bias_cause,
    registration_cause,
)


def with_type_b(
    causes: Sequence[Cause],
    normal: Array,
    sight_m: Array,
    target: Target,
    instrument: InstrumentConfig,
) -> tuple[Cause, ...]:
    """Causes of a fitted target's uncertainty with its type B causes added (JCGM 100, 4.3).

    Waves that the residuals show and the flatness that is stated are one cause: the larger counts.
    normal: (3,) unit; sight_m: (3,) from the scanner to the target's centre, scanner coordinates.
    """
    seen = [cause for cause in causes if cause.name == "flatness"]
    stated = [form_cause(target.flatness, target.radius_m, normal)]
    form = max(*seen, *stated, key=_tilt_variance) if seen else stated[0]
    every = [
        *(cause for cause in causes if cause.name != "flatness"),
        form,
        clamp_cause(math.radians(target.clamp_tilt_deg), target.clamp_shift, normal),
        range_bias_cause(instrument.range_bias_m, sight_m, normal),
        pointing_cause(instrument.pointing_urad * 1e-6, sight_m, normal),
        registration_cause(instrument.registration_m),
    ]
    return tuple(cause for cause in every if cause.factor.any())


def _tilt_variance(cause: Cause) -> float:
    return float(np.trace(cause.covariance[:3, :3]))
