"""Search for the target in a scan, or for all targets of a vehicle and the wheel of each."""

from .candidates import FACE_BAND
from .find_target import find_target
from .find_targets import find_targets
from .identify_wheels import find_axles, placed, wheels_by_markers
from .template_match import OFF_PLANE, outnumbered
from .up_direction import find_up, stand_on_a_floor
from .vehicles import FoundTarget

__all__ = [
    "FACE_BAND",
    "OFF_PLANE",
    "FoundTarget",
    "find_axles",
    "find_target",
    "find_targets",
    "find_up",
    "outnumbered",
    "placed",
    "stand_on_a_floor",
    "wheels_by_markers",
]
