"""Captures: capture.toml, file names and archives, and which scan shows which wheel."""

from .declaration import Upright, files_of, find_capture_file, read_capture_file
from .entries import check_inside
from .entry import Role, ScanEntry, Turn
from .file_names import TABLES, clouds_of, is_capture
from .hints import Corners, Hint
from .open_capture import Capture, CaptureOptions, Entries, open_capture, open_entries
from .searched import Searched, boxed, searched
from .vertical import StatedVertical

__all__ = [
    "TABLES",
    "Capture",
    "CaptureOptions",
    "Corners",
    "Entries",
    "Hint",
    "Role",
    "ScanEntry",
    "Searched",
    "StatedVertical",
    "Turn",
    "Upright",
    "boxed",
    "check_inside",
    "clouds_of",
    "files_of",
    "find_capture_file",
    "is_capture",
    "open_capture",
    "open_entries",
    "read_capture_file",
    "searched",
]
