"""Readers of point-cloud files: PLY, PCD, PTX, PTS, E57, LAS, LAZ, text, NumPy and meshes."""

from .gather import Placer, PointRows, RowProgress, silent
from .packed import scan_suffix
from .read_scan import MESH_SUFFIXES, READERS, open_cloud, read_scan
from .sandbox.environment import child_environment
from .sandbox.worker import confine, die_with
from .scan import Part, Scan
from .source import Block, RawCloud

__all__ = [
    "MESH_SUFFIXES",
    "READERS",
    "Block",
    "Part",
    "Placer",
    "PointRows",
    "RawCloud",
    "RowProgress",
    "Scan",
    "child_environment",
    "confine",
    "die_with",
    "open_cloud",
    "read_scan",
    "scan_suffix",
    "silent",
]
