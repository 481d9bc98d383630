"""Target shapes and printed boards that can be clamped to a wheel."""

from .outline import Holes, Outline, holes_of, outer_edge, sector
from .pattern_board import PatternTarget
from .plates import ANY_WIDTH, NO_HOLES, Region
from .registry import Target, load_target, parse_target, scaled, size_of

__all__ = [
    "ANY_WIDTH",
    "NO_HOLES",
    "Holes",
    "Outline",
    "PatternTarget",
    "Region",
    "Target",
    "holes_of",
    "load_target",
    "outer_edge",
    "parse_target",
    "scaled",
    "sector",
    "size_of",
]
