"""The disc that is clamped to the wheel."""

from __future__ import annotations

import numpy as np

from synth.parameters import TargetFile
from synth.solids import Solid, revolved

# The polygon lies within radius * (1 - cos(pi / SECTIONS)) of its circle: 0.3 um at 125 mm.
SECTIONS = 1440


def disc(target: TargetFile) -> Solid:
    """The target in its own coordinates: front face on z = 0 about the origin, body at z < 0.

    The facets of the front face carry the plane z = 0 itself, and its flag.
    """
    radius, depth = target.diameter / 2, -target.thickness
    profile = [(0.0, depth), (radius, depth), (radius, 0.0), (0.0, 0.0)]
    solid = revolved(profile, SECTIONS, reflectance=0.8)
    front = np.all(np.abs(solid.corners_m[:, :, 2]) < 1e-12, axis=1)
    return solid.with_front(front)
