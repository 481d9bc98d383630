"""Search for the target in a scan, or for all targets of a vehicle and the wheel of each."""

from .bodywork import is_bodied
from .candidates import FACE_BAND, Candidate
from .find_target import (
    DOUBTED,
    candidate_near,
    check_best,
    find_candidates,
    find_target,
    on_one_surface,
    patch_of,
    rivals,
)
from .find_targets import candidates_of_cloud, find_targets
from .identify_wheels import Axles, find_axles, listed, placed, wheels_by_markers
from .surfels import planes_of
from .template_match import OFF_PLANE, outnumbered
from .up_direction import find_up, stand_on_a_floor
from .vehicles import FoundTarget

__all__ = [
    "DOUBTED",
    "FACE_BAND",
    "OFF_PLANE",
    "Axles",
    "Candidate",
    "FoundTarget",
    "candidate_near",
    "candidates_of_cloud",
    "check_best",
    "find_axles",
    "find_candidates",
    "find_target",
    "find_targets",
    "find_up",
    "is_bodied",
    "listed",
    "on_one_surface",
    "outnumbered",
    "patch_of",
    "placed",
    "planes_of",
    "rivals",
    "stand_on_a_floor",
    "wheels_by_markers",
]
