"""Records of an explanation: scans, the candidates in each, and the verdict on each."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Literal

import numpy as np

from ..capture import Hint
from ..detection import Candidate
from ..measurement import ResidualMap
from ..system import frozen
from ..targets import Region
from ..vectors import Array

Standing = Literal["chosen", "rival", "refused"]
Finding = Literal[
    "chosen_by_hand", "no_outline", "outline", "outline_too", "worse", "of_wheel", "at_no_wheel",
    "other_target", "stands", "outside_region",
]  # fmt: skip


NO_POINTS: Array = np.zeros((0, 3))


@frozen
class ExplainedCandidate:
    """A plane that may be the target, or a wheel that may be one, with the verdict on it.

    number: from 1, best match first. finding: why it was taken or refused. least_match: that it
    lacks; apart_m: its distance from the best one; where the finding is of these. wheel: in a
    cloud, the wheel that it was named, or ''. target: in a cloud of several kinds, the description
    of its own, or ''. region: of that target; None where it is the scan's.
    """

    number: int
    candidate: Candidate
    standing: Standing
    finding: Finding
    wheel: str = ""
    least_match: float = 0.0
    apart_m: float = 0.0
    target: str = ""
    region: Region | None = None


@frozen
class ExplainedScan:
    """A scan, what became of it, and all that was looked at in it.

    status: 'ok', or that of the failure; reason: its message. points: in the scan. sample_m: (M, 3)
    of them, for a picture. region: of the target. best: normal (3,) of the best candidate, towards
    the scanner or away from its back; None without. face: residuals about the best candidate, with
    sigma_m, the noise across its plane. drawn_m: (K, 3) corners of the region that the operator
    drew, (0, 3) without.
    """

    name: str
    role: str
    file: str
    status: str
    reason: str
    points: int
    sample_m: Array
    region: Region
    candidates: tuple[ExplainedCandidate, ...] = ()
    best: Array | None = None
    face: ResidualMap | None = None
    sigma_m: float = 0.0
    drawn_m: Array = field(default_factory=lambda: NO_POINTS)

    @property
    def is_measured(self) -> bool:
        """Whether the target, in a cloud all four, was measured."""
        return self.status == "ok"


@frozen
class Explanation:
    """Explanation of a capture. target: its description. length_unit: of the scans' coordinates."""

    source: str
    target: str
    length_unit: str
    scans: tuple[ExplainedScan, ...]


def with_region(scan: ExplainedScan, hint: Hint | None) -> ExplainedScan:
    """Return the scan with the region that the operator drew in it, if he did."""
    if hint is None or hint.region_m is None:
        return scan
    return replace(scan, drawn_m=np.array(hint.region_m))
