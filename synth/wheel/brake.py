"""View between the spokes: brake disc and calliper, which do not run out with the rim."""

from __future__ import annotations

import numpy as np

from ..scene.solids import Solid, box, revolved


def brake(hub_z: float, down_rad: float) -> list[Solid]:
    """Build disc and calliper, about the spin axis; the calliper is level, before the axle."""
    face = hub_z - 0.055
    disc = [(0.06, face - 0.02), (0.145, face - 0.02), (0.145, face), (0.06, face),
            (0.06, face - 0.02)]  # fmt: skip
    pose = np.eye(4)
    turn = down_rad + 0.5 * np.pi
    pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    calliper = box((0.085, -0.075, face - 0.03), (0.158, 0.075, face + 0.028), 0.35)
    return [revolved(disc, 240, 0.4), calliper.placed(pose)]
