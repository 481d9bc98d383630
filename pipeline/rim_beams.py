"""Beams carried back to the plane of the face, and where they came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.config import CentreConfig
from pipeline.kernels import Array
from pipeline.outline import Outline, turned

# A state is (9,): centre u v, beam u v, 1/distance, log spot, log thickness, log echo, turn.
CENTRE, BEAM, INVERSE = slice(0, 2), slice(2, 4), 4
SPOT, THICKNESS, ECHO, TURN = 5, 6, 7, 8
HELD_BEAM, HELD_THICKNESS = 0.05, 0.03  # of a fit that ran away from them (k = 1)
TURN_RAD = 0.1  # what the segmentation's axes may be turned against the target's (k = 1)
MIN_DEPTH_M = 0.006  # what lies nearer behind the face is not taken for background


@dataclass(frozen=True)
class Prior:
    """What is known before: mean (9,) and weight (9,), one over the variance."""

    mean: Array
    weight: Array

    @classmethod
    def of(cls, thickness_m: float | None, config: CentreConfig) -> Prior:
        """Of a plate of that thickness, if it is known, seen by a laser spot as configured."""
        known = thickness_m is not None
        thickness = thickness_m if thickness_m is not None else 0.008
        logs = np.log([config.spot_radius_m, max(thickness, 1e-4)])
        mean = np.array([0.0, 0.0, 0.0, 0.0, 0.4, *logs, 0.0, 0.0])
        sigma = [0.01, 0.01, 3.0, 3.0, 0.3, 0.7, 0.3 if known else 1.0, 1.5, TURN_RAD]
        return cls(mean, 1.0 / np.array(sigma) ** 2)

    def held(self, state: Array) -> Prior:
        """The same with the thickness and the beams held near what is known, from a start (9,)."""
        mean, weight = self.mean.copy(), self.weight.copy()
        mean[BEAM] = state[BEAM]
        weight[BEAM] = HELD_BEAM**-2
        weight[THICKNESS] = HELD_THICKNESS**-2
        return Prior(mean, weight)

    @classmethod
    def beside(cls, state: Array) -> Prior:
        """Of another edge of a plate, the first of which has that state (9,): same beams."""
        sigma = [0.01, 0.01, 0.02, 0.02, 0.03, 0.2, 0.2, 0.7, TURN_RAD]
        return cls(state, 1.0 / np.array(sigma) ** 2)


@dataclass(frozen=True)
class Beams:
    """Beams carried to the plane, (N,) each or (N, 2): x outside the edge, its normal rho, tau.

    q_m: where they met the plane, seen from the centre. shrink: of a step at the point's depth, on
    its way to the plane. curve: see outline.Feet.
    """

    x_m: Array
    rho: Array
    tau: Array
    shrink: Array
    q_m: Array
    curve: Array
    share: Array
    clear: npt.NDArray[np.bool_]


def carry(plane: Array, depth: Array, state: Array, outline: Outline) -> Beams:
    """Where each point's beam met the plane: q = c + (p - c - z g) / (1 + z/D), seen from c.

    tau: at the depth z, a beam that met the plane x outside the edge is x - tau z outside the wall,
    less (z t)^2 / (2 R) by the wall's own curvature where the beam runs aside by t per depth; that
    is taken as a straight line down to the thickness.
    """
    shrink = 1.0 / (1.0 + state[INVERSE] * depth)
    q = (plane - state[CENTRE] - depth[:, None] * state[BEAM]) * shrink[:, None]
    feet = outline.feet(turned(q, -state[TURN]))
    rho = turned(feet.normal, state[TURN])
    outward = rho @ state[BEAM]
    aside = state[BEAM] @ state[BEAM] - outward**2
    bent = np.exp(state[THICKNESS]) * aside * feet.bend / 2.0
    tau = -outward - state[INVERSE] * feet.support_m - bent
    return Beams(feet.x_m, rho, tau, shrink, q, feet.curve, feet.share, feet.clear)
