"""The wheel itself as target: its axis of revolution and its centre, from rim and tyre.

Its modules are loaded when they are first used: a tenth of the start, and few scans have no target.
"""

from typing import TYPE_CHECKING

from ..system import loader
from .find_patch import find_patch

if TYPE_CHECKING:
    from .fit_wheel import fit_surface, target_of
    from .places import VehicleScan, WheelPlace, find_places
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

if not TYPE_CHECKING:
    __getattr__ = loader(
        __name__,
        {
            ".places": {"VehicleScan", "WheelPlace", "find_places"},
            ".fit_wheel": {"fit_surface", "target_of"},
            ".profile": {"WheelProfile", "profile_of"},
        },
    )
