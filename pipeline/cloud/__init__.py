"""Passes over all points of a cloud: sample, crop, voxel grid, octree, moments."""

from .lattice import VoxelLattice, find_lattice
from .moments import SlabMoments, raster_sums, slab_moments
from .native import load_opencv
from .octree import (
    CODE_BITS,
    GRID_BITS,
    LEAF,
    MOST_DEPTH,
    NodeRows,
    cell_index,
    divide,
    mixed,
    morton_codes,
)
from .preview import CloudSample, by_wheel, cloud_sample
from .selection import (
    Slab,
    coordinate_hash,
    gather_ball,
    least_rows,
    nearest_points,
    random_rows,
    sample,
    sample_rows,
    surroundings,
    thin,
    within_slab,
)
from .steps import EXACT, Levels, Steps, coordinate_levels, coordinate_steps, scattered
from .threads import over_chunks, over_items, side_by_side
from .voxel_grid import (
    VoxelGrid,
    all_within,
    box,
    voxel_key,
    voxels_without_strays,
    within_voxels,
)

__all__ = [
    "CODE_BITS",
    "EXACT",
    "GRID_BITS",
    "LEAF",
    "MOST_DEPTH",
    "CloudSample",
    "Levels",
    "NodeRows",
    "Slab",
    "SlabMoments",
    "Steps",
    "VoxelGrid",
    "VoxelLattice",
    "all_within",
    "box",
    "by_wheel",
    "cell_index",
    "cloud_sample",
    "coordinate_hash",
    "coordinate_levels",
    "coordinate_steps",
    "divide",
    "find_lattice",
    "gather_ball",
    "least_rows",
    "load_opencv",
    "mixed",
    "morton_codes",
    "nearest_points",
    "over_chunks",
    "over_items",
    "random_rows",
    "raster_sums",
    "sample",
    "sample_rows",
    "scattered",
    "side_by_side",
    "slab_moments",
    "surroundings",
    "thin",
    "voxel_key",
    "voxels_without_strays",
    "within_slab",
    "within_voxels",
]
