"""Target shapes and printed boards that can be clamped to a wheel."""

from .choice import TargetChoice, names_of_targets, read_targets
from .outline import Circle, Holes, OuterEdge, Outline, Polygon, sector
from .pattern_board import PatternTarget
from .region import Region
from .registry import Target, WheelTarget, load_target, parse_target, scaled, size_of

__all__ = [
    "Circle",
    "Holes",
    "OuterEdge",
    "Outline",
    "PatternTarget",
    "Polygon",
    "Region",
    "Target",
    "TargetChoice",
    "WheelTarget",
    "load_target",
    "names_of_targets",
    "parse_target",
    "read_targets",
    "scaled",
    "sector",
    "size_of",
]
