"""Passes over all points of a cloud: sample, crop, voxel sums, first and second moments."""

from .moments import SlabMoments, slab_moments
from .preview import CloudSample, by_wheel, cloud_sample
from .selection import (
    Slab,
    gather_ball,
    random_rows,
    sample,
    surroundings,
    within_slab,
)
from .voxel_grid import Cubes, cube_key, cube_moments, lowest, within_cubes

__all__ = [
    "CloudSample",
    "Cubes",
    "Slab",
    "SlabMoments",
    "by_wheel",
    "cloud_sample",
    "cube_key",
    "cube_moments",
    "gather_ball",
    "lowest",
    "random_rows",
    "sample",
    "slab_moments",
    "surroundings",
    "within_cubes",
    "within_slab",
]
