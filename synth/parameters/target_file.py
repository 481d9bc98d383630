"""Reader of the target files in configs/targets/."""

from __future__ import annotations

from pathlib import Path

from .pattern_file import PatternFile
from .plate_file import BareWheelFile, DiscFile, RectangleFile, RingFile, SquareFile, TargetFile
from .recipe import read_one_of

SHAPES: dict[str, type[TargetFile]] = {
    "disc": DiscFile,
    "ring": RingFile,
    "rectangle": RectangleFile,
    "square": SquareFile,
    "pattern": PatternFile,
    "wheel": BareWheelFile,
}


def read_target(path: Path) -> TargetFile:
    """Read the target that a file describes. Raises SynthError."""
    return read_one_of(path, "shape", SHAPES)
