"""Passes over all points of a cloud: sample, crop, voxel grid, first and second moments."""

from .moments import SlabMoments, slab_moments
from .native import load_opencv
from .preview import CloudSample, by_wheel, cloud_sample
from .selection import (
    Slab,
    gather_ball,
    random_rows,
    sample,
    sample_rows,
    surroundings,
    within_slab,
)
from .steps import EXACT, Levels, Steps, coordinate_levels, coordinate_steps
from .threads import side_by_side
from .voxel_grid import VoxelGrid, lowest, voxel_key, voxel_moments, within_voxels

__all__ = [
    "EXACT",
    "CloudSample",
    "Levels",
    "Slab",
    "SlabMoments",
    "Steps",
    "VoxelGrid",
    "by_wheel",
    "cloud_sample",
    "coordinate_levels",
    "coordinate_steps",
    "gather_ball",
    "load_opencv",
    "lowest",
    "random_rows",
    "sample",
    "sample_rows",
    "side_by_side",
    "slab_moments",
    "surroundings",
    "voxel_key",
    "voxel_moments",
    "within_slab",
    "within_voxels",
]
