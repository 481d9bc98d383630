"""Centre of a target in its plane, from its edges and from its print."""

from .combine import CentreMethod
from .in_plane_rotation import RotationMark
from .locate_centre import OtherCentre, TargetFit, locate_centre
from .outline_fit import fit_edge_points
from .pattern.detect import marker_modules

__all__ = [
    "CentreMethod",
    "OtherCentre",
    "RotationMark",
    "TargetFit",
    "fit_edge_points",
    "locate_centre",
    "marker_modules",
]
