"""The library's public functions and their results; `import wheelplane` exports them."""

from .alignment import Alignment, Covariance, Wheel
from .comparison import Comparison, validate
from .files import open_measurement, read_five_point
from .measure_vehicle import measure
from .single_scan import FoundTarget, Plane, find_planes, find_target, fit_plane
from .value import Value

__all__ = [
    "Alignment",
    "Comparison",
    "Covariance",
    "FoundTarget",
    "Plane",
    "Value",
    "Wheel",
    "find_planes",
    "find_target",
    "fit_plane",
    "measure",
    "open_measurement",
    "read_five_point",
    "validate",
]
