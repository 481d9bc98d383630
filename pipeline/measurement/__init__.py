"""Observations to a measurement: evaluation, repeatability, tolerances, conformity."""

from .assumptions import notes_of_assumptions
from .conformity import Conformity, Verdict, assess, conforms
from .estimates import estimate, vertical_tilts, weighted_sum
from .evaluate import align, check_by_monte_carlo, evaluate, find_verticals
from .limits import ToleranceInterval
from .observe import Fit, noisy, observe_entry, rounded, shaded
from .observe_vehicle import observe_cloud
from .quantities import (
    VEHICLE_BY_SWEEP,
    WHEEL_BY_RUNOUT,
    WHEEL_BY_SWEEP,
    Quantity,
    Stated,
    against,
    by_name,
    stated,
    workshop_angles,
)
from .records import (
    AxleAngles,
    AxleStatus,
    Estimate,
    Evidence,
    FrameThrough,
    Measurement,
    Naming,
    Observation,
    Provenance,
    Runout,
    SteeringAxis,
    SuspectPoint,
    SweepStatus,
    ToeOut,
    Vertical,
    VerticalKind,
    WheelPose,
    WheelResult,
)
from .repeatability import OF_PLATE, PooledAngle, Repeats, pool_repeats
from .residual_map import CELLS, ResidualMap, residual_map
from .tolerance import BY_MODEL, load_tolerance, tolerance_for
from .turn_curve import toe_out_at

__all__ = [
    "BY_MODEL",
    "CELLS",
    "OF_PLATE",
    "VEHICLE_BY_SWEEP",
    "WHEEL_BY_RUNOUT",
    "WHEEL_BY_SWEEP",
    "AxleAngles",
    "AxleStatus",
    "Conformity",
    "Estimate",
    "Evidence",
    "Fit",
    "FrameThrough",
    "Measurement",
    "Naming",
    "Observation",
    "PooledAngle",
    "Provenance",
    "Quantity",
    "Repeats",
    "ResidualMap",
    "Runout",
    "Stated",
    "SteeringAxis",
    "SuspectPoint",
    "SweepStatus",
    "ToeOut",
    "ToleranceInterval",
    "Verdict",
    "Vertical",
    "VerticalKind",
    "WheelPose",
    "WheelResult",
    "against",
    "align",
    "assess",
    "by_name",
    "check_by_monte_carlo",
    "conforms",
    "estimate",
    "evaluate",
    "find_verticals",
    "load_tolerance",
    "noisy",
    "notes_of_assumptions",
    "observe_cloud",
    "observe_entry",
    "pool_repeats",
    "residual_map",
    "rounded",
    "shaded",
    "stated",
    "toe_out_at",
    "tolerance_for",
    "vertical_tilts",
    "weighted_sum",
    "workshop_angles",
]
