"""Candidates as they are shown: each place once, the best of them, none that matches nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..detection import DOUBTED, Candidate, on_one_surface

MOST_SHOWN = 12
LEAST_SHOWN = 0.02  # match: about that of a larger surface


def apart(candidates: Sequence[Candidate], radius_m: float) -> list[Candidate]:
    """Return the candidates, best match first, of which none lies within a radius of a better one.

    One on another surface is shown if it matches half as well: the target behind what hides it. At
    least the best one is returned, however poorly it matches.
    """
    kept: list[Candidate] = []
    for one in candidates:
        near = [
            better
            for better in kept
            if float(np.linalg.norm(one.centre_m - better.centre_m)) < radius_m
        ]
        hidden = all(
            one.match > DOUBTED * better.match and not on_one_surface(one, better, radius_m)
            for better in near
        )
        if not kept or (one.match >= LEAST_SHOWN and hidden):
            kept.append(one)
    return kept
