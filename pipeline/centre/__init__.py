"""Centre of a target in its plane, from its edges and from its print."""

from .in_plane_rotation import Mark
from .locate_centre import OtherCentre, TargetFit, locate_centre
from .pattern.detect import marker_modules

__all__ = [
    "Mark",
    "OtherCentre",
    "TargetFit",
    "locate_centre",
    "marker_modules",
]
