"""Candidates as they are shown: each place once, the best of them, none that matches nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..detection import Candidate

MOST_SHOWN = 12
LEAST_SHOWN = 0.02  # match: about that of a larger surface


def apart(candidates: Sequence[Candidate], radius_m: float) -> list[Candidate]:
    """Return the candidates, best match first, of which none lies within a radius of a better one.

    At least the best one is returned, however poorly it matches.
    """
    kept: list[Candidate] = []
    for one in candidates:
        near = (float(np.linalg.norm(one.centre_m - better.centre_m)) for better in kept)
        if kept and (one.match < LEAST_SHOWN or min(near) < radius_m):
            continue
        kept.append(one)
    return kept
