"""Centre of a target in its plane, from its edges and from its print."""

from .combine import CentreMethod
from .edge.beams import SIZE_M
from .edge.solution import EdgeFit
from .edge_centre import rough_pose
from .in_plane_rotation import InPlaneRotation, RotationMark
from .joined import joined
from .locate_centre import OtherCentre, TargetFit, locate_centre, on_plane
from .occlusion import clear_of_occluders, scanner_by_shadow
from .on_wheel import MOST_M, lies_on_wheel, off_tyre, on_wheel, unlike_wheels, with_unstated
from .outline_fit import fit_edge_points
from .pattern.detect import marker_modules
from .stations import of_stations
from .target_view import TargetView

__all__ = [
    "MOST_M",
    "SIZE_M",
    "CentreMethod",
    "EdgeFit",
    "InPlaneRotation",
    "OtherCentre",
    "RotationMark",
    "TargetFit",
    "TargetView",
    "clear_of_occluders",
    "fit_edge_points",
    "joined",
    "lies_on_wheel",
    "locate_centre",
    "marker_modules",
    "of_stations",
    "off_tyre",
    "on_plane",
    "on_wheel",
    "rough_pose",
    "scanner_by_shadow",
    "unlike_wheels",
    "with_unstated",
]
