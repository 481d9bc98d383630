"""All that scans of wheels in several positions give, solved once for a measurement."""

from __future__ import annotations

from dataclasses import replace

from ..measurement import Measurement, evaluate
from ..system import stage
from .axle_pose import compensated, vertical_as_effect, wheel_poses, with_mounting
from .rolled import is_rolled, over_positions
from .runout import runouts_of
from .steering_axis import fit_steering_axes
from .sweep import sweep_scans
from .toe_out_on_turns import toe_out_of
from .wheel_axis import Framed, fit_axles, on_axles


@stage("angles")
def solve(measurement: Measurement) -> Measurement:
    """Return the measurement with its steering axes, run-outs and toe-out on turns.

    Of a vehicle that has rolled, its wheels are means over the positions. Wheels whose axle is
    known have its angles, and the frame stands on its centre. The same measurement where none of
    its scans is of a sweep or a run-out.
    """
    if any(map(is_rolled, measurement.wheels)):
        return over_positions(measurement)
    if not any(wheel.observation.role in ("sweep", "runout") for wheel in measurement.wheels):
        return measurement
    scans = sweep_scans(measurement)
    best = with_mounting(on_axles(scans, fit_axles(scans, measurement)))
    steering_axes = fit_steering_axes(best, measurement)
    return replace(
        _compensate(measurement, best),
        steering_axes=steering_axes,
        runouts=runouts_of(best),
        toe_out=toe_out_of(best, steering_axes),
    )


def _compensate(plates: Measurement, best: Framed) -> Measurement:
    """Return the measurement with the angles of the axles; the same where none is known."""
    names = compensated(best)
    if not names:
        return plates
    observations = [wheel.observation for wheel in plates.wheels]
    above = vertical_as_effect(best)
    found = evaluate(observations, wheel_poses(best), plates.provenance, plates.notes, above)
    wheels = (
        replace(wheel, compensated=wheel.observation.name in names, plate=plate)
        for wheel, plate in zip(found.wheels, plates.wheels, strict=True)
    )
    return replace(found, wheels=tuple(wheels), plates=plates, verticals=plates.verticals)
