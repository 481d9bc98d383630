"""Vehicle frame, toe, camber, all vehicle quantities and their derivatives; owns all signs."""

from .angles import (
    WheelAngles,
    deg_min_sec,
    nearest_wheel,
    outward_normal,
    wheel_angles,
)
from .autodiff import Dual, atan2, cos, length, over, sin
from .axes import AXES, Axis, upright
from .definitions import (
    AGAINST_AN_AXIS,
    OF_SECOND_ORDER,
    RELATIVE,
    VEHICLE,
    WHEEL,
    Unit,
    VehicleQuantity,
    WheelQuantity,
    named,
)
from .frame import (
    MAX_COORDINATE_M,
    REFERENCE_WHEELS,
    VehicleFrame,
    build_reference_frame,
    rotation_by_basis,
)
from .jacobian import FrameSlopes, frame_slopes, jacobian, linearise
from .vertical import Floor, fit_floor

__all__ = [
    "AGAINST_AN_AXIS",
    "AXES",
    "MAX_COORDINATE_M",
    "OF_SECOND_ORDER",
    "REFERENCE_WHEELS",
    "RELATIVE",
    "VEHICLE",
    "WHEEL",
    "Axis",
    "Dual",
    "Floor",
    "FrameSlopes",
    "Unit",
    "VehicleFrame",
    "VehicleQuantity",
    "WheelAngles",
    "WheelQuantity",
    "atan2",
    "build_reference_frame",
    "cos",
    "deg_min_sec",
    "fit_floor",
    "frame_slopes",
    "jacobian",
    "length",
    "linearise",
    "named",
    "nearest_wheel",
    "outward_normal",
    "over",
    "rotation_by_basis",
    "sin",
    "upright",
    "wheel_angles",
]
