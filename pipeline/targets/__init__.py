"""Target shapes and printed boards that can be clamped to a wheel."""

from .outline import Circle, Holes, OuterEdge, Outline, sector
from .pattern_board import PatternTarget
from .region import Region
from .registry import Target, WheelTarget, load_target, parse_target, scaled, size_of

__all__ = [
    "Circle",
    "Holes",
    "OuterEdge",
    "Outline",
    "PatternTarget",
    "Region",
    "Target",
    "WheelTarget",
    "load_target",
    "parse_target",
    "scaled",
    "sector",
    "size_of",
]
