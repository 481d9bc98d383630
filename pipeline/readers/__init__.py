"""Readers of point-cloud files: PLY, PCD, PTX, PTS, E57, LAS, LAZ, text, NumPy and meshes."""

from .arrays import scan_of_points
from .blocks import PlacedBlock, read_blocks
from .gather import Placer, PointRows, RowProgress, silent
from .missing import LookedAt, Markers, find_markers
from .options import AS_THE_FILE_SAYS, ReadOptions
from .packed import scan_suffix
from .read_scan import MESH_SUFFIXES, RAW_FORMATS, READERS, open_cloud, read_scan, unknown_format
from .sandbox.environment import child_environment
from .sandbox.worker import confine, die_with
from .scan import Part, Scan
from .source import Block, RawCloud

__all__ = [
    "AS_THE_FILE_SAYS",
    "MESH_SUFFIXES",
    "RAW_FORMATS",
    "READERS",
    "Block",
    "LookedAt",
    "Markers",
    "Part",
    "PlacedBlock",
    "Placer",
    "PointRows",
    "RawCloud",
    "ReadOptions",
    "RowProgress",
    "Scan",
    "child_environment",
    "confine",
    "die_with",
    "find_markers",
    "open_cloud",
    "read_blocks",
    "read_scan",
    "scan_of_points",
    "scan_suffix",
    "silent",
    "unknown_format",
]
