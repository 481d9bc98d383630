"""The wheel itself as target: its axis of revolution and its centre, from rim and tyre.

Its modules are loaded when they are first used: a tenth of the start, and few scans have no target.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from .find_patch import find_patch

if TYPE_CHECKING:
    from .find_places import VehicleScan, WheelPlace, find_places
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
_MODULES = {
    ".find_places": {"VehicleScan", "WheelPlace", "find_places"},
    ".fit_wheel": {"fit_surface", "target_of"},
    ".profile": {"WheelProfile", "profile_of"},
}

if not TYPE_CHECKING:

    def __getattr__(name):
        """Load a public name."""
        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(module, __name__), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
