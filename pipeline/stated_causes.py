"""What the scatter of the points cannot show: what the target's and the scanner's files state."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pipeline.causes import (
    Cause,
    clamp_cause,
    form_cause,
    pointing_cause,
    range_bias_cause,
    registration_cause,
)
from pipeline.config import InstrumentConfig
from pipeline.fit_plane import PlaneFit
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.measurement import Observation
from pipeline.targets import Target

NOISY = 1.5  # times the stated noise of a range


def add_stated_causes(
    fitted: TargetFit, plane: PlaneFit, target: Target, instrument: InstrumentConfig
) -> TargetFit:
    """The fitted target with its type B causes of uncertainty added (JCGM 100, 4.3).

    Waves that the residuals show and the flatness that is stated are one cause: the larger counts.
    """
    seen = [cause for cause in fitted.causes if cause.name == "flatness"]
    stated = [form_cause(target.flatness, target.radius_m, fitted.normal)]
    form = max(*seen, *stated, key=_tilt_variance) if seen else stated[0]
    sight = _sight(fitted, plane, instrument)
    causes = [
        *(cause for cause in fitted.causes if cause.name != "flatness"),
        form,
        clamp_cause(math.radians(target.clamp_tilt_deg), target.clamp_shift, fitted.normal),
        range_bias_cause(instrument.range_bias_m, sight, fitted.normal),
        pointing_cause(instrument.pointing_urad * 1e-6, sight, fitted.normal),
        registration_cause(instrument.registration_m),
    ]
    return replace(fitted, causes=tuple(cause for cause in causes if cause.factor.any()))


def noisy(observations: Sequence[Observation], instrument: InstrumentConfig) -> Iterator[str]:
    """A sentence on every scan whose noise is well beyond what is stated of the scanner."""
    if instrument.range_sigma_m is None:
        return
    for seen in observations:
        plane = seen.evidence.plane if seen.evidence else None
        if plane is not None and plane.sigma_m > NOISY * instrument.range_sigma_m:
            yield (
                f"The noise of {seen.name} across its plane, {plane.sigma_m * 1e3:.2f} mm, is "
                f"{plane.sigma_m / instrument.range_sigma_m:.1f} times the range noise that the "
                f"scanner's file states: check the target's surface, and the file."
            )


def _tilt_variance(cause: Cause) -> float:
    return float(np.trace(cause.covariance[:3, :3]))


def _sight(fitted: TargetFit, plane: PlaneFit, instrument: InstrumentConfig) -> Array:
    """From the scanner to the target's centre (3,), as the mixed ranges about the rim tell it.

    Without them: along the normal, from the distance that is stated.
    """
    rim = fitted.rim
    if rim is None:
        return -instrument.distance_m * plane.normal
    away = rim.beam @ plane.basis[:2] - plane.normal
    inverse = max(rim.inverse_distance, 1.0 / (10.0 * instrument.distance_m))
    return np.asarray(away / inverse)
