"""The wheel itself as target: its axis of revolution and its centre, from rim and tyre."""

from .find_places import VehicleScan, WheelPlace, find_places
from .find_wheel import find_patch
from .fit_wheel import fit_surface, target_of
from .profile import WheelProfile, profile_of

__all__ = [
    "VehicleScan",
    "WheelPlace",
    "WheelProfile",
    "find_patch",
    "find_places",
    "fit_surface",
    "profile_of",
    "target_of",
]
