"""Observations to a measurement: evaluation, repeatability, tolerances, conformity."""

from .conformity import Conformity, Unit, Verdict, assess, conforms
from .evaluate import align, check_by_monte_carlo
from .observe import Fit, noisy, observe_entry
from .observe_vehicle import observe_cloud
from .quantities import Stated, against, by_name, stated
from .records import (
    Evidence,
    Measurement,
    Naming,
    Observation,
    Provenance,
    WheelResult,
)
from .repeatability import OF_PLATE, PooledAngle, Repeats, pool_repeats
from .residual_map import CELLS, FaceMap, face_map
from .tolerance import Zone, load_tolerance

__all__ = [
    "CELLS",
    "OF_PLATE",
    "Conformity",
    "Evidence",
    "FaceMap",
    "Fit",
    "Measurement",
    "Naming",
    "Observation",
    "PooledAngle",
    "Provenance",
    "Repeats",
    "Stated",
    "Unit",
    "Verdict",
    "WheelResult",
    "Zone",
    "against",
    "align",
    "assess",
    "by_name",
    "check_by_monte_carlo",
    "conforms",
    "face_map",
    "load_tolerance",
    "noisy",
    "observe_cloud",
    "observe_entry",
    "pool_repeats",
    "stated",
]
