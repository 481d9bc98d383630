"""Type B components: uncertainty stated in the target's and the scanner's files."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..config import InstrumentConfig
from ..targets import Target
from ..vectors import Array
from .components import (
    UncertaintyComponent,
    flatness_component,
    mounting_component,
    pointing_component,
    range_bias_component,
    registration_component,
)
from .instrument import instrument_components


def with_type_b(
    components: Sequence[UncertaintyComponent],
    normal: Array,
    sight_m: Array,
    target: Target,
    instrument: InstrumentConfig,
    station: str | None = None,
) -> tuple[UncertaintyComponent, ...]:
    """Return a fitted target's components with the type B components added (JCGM 100, 4.3).

    Waviness observed in the residuals and the stated flatness are one component: the larger counts.
    normal: (3,) unit; sight_m: (3,) from the scanner to the target's centre, scanner coordinates.
    station: by which scans of one station are known; None where that is not known.
    """
    observed = [component for component in components if component.name == "flatness"]
    half_m = math.sqrt(math.prod(target.region.half_m))
    stated = [flatness_component(target.flatness, half_m, normal)]
    form = max(*observed, *stated, key=_tilt_variance) if observed else stated[0]
    every = [
        *(component for component in components if component.name != "flatness"),
        form,
        mounting_component(math.radians(target.clamp_tilt_deg), target.clamp_shift, normal),
        range_bias_component(instrument.range_bias_m, sight_m, normal),
        *instrument_components(instrument, sight_m, normal, target.radius_m, station),
        pointing_component(instrument.pointing_urad * 1e-6, sight_m, normal, station),
        registration_component(instrument.registration_m, station),
    ]
    return tuple(component for component in every if component.factor.any())


def _tilt_variance(component: UncertaintyComponent) -> float:
    return float(np.trace(component.covariance[:3, :3]))
