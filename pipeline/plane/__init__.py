"""Plane fits: least squares, sigma clipping, RANSAC, correlated noise, range by brightness."""

from .brightness import RangeByBrightness
from .clipped_plane import ClippedFit, ClipSlab, fit_clipped_plane
from .find_planes import CloudPlane, find_planes, plane_of_all
from .fit_plane import SPANNED, PlaneFit, Rounding, fit_plane
from .least_squares import total_least_squares
from .patch import Patch
from .ransac import RansacOptions, ransac
from .scan_lines import nearest, strong_waves
from .sigma_clipping import Clipping, converge, first_sigma
from .thinned.distance_pull import distance_pull
from .thinned.voxel_pull import Thinning

__all__ = [
    "SPANNED",
    "ClipSlab",
    "ClippedFit",
    "Clipping",
    "CloudPlane",
    "Patch",
    "PlaneFit",
    "RangeByBrightness",
    "RansacOptions",
    "Rounding",
    "Thinning",
    "converge",
    "distance_pull",
    "find_planes",
    "first_sigma",
    "fit_clipped_plane",
    "fit_plane",
    "nearest",
    "plane_of_all",
    "ransac",
    "strong_waves",
    "total_least_squares",
]
