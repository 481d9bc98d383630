"""Steering axis, run-out and toe-out on turns, from scans of a wheel in several positions."""

from .runout import Runout, all_turned, measure_runouts
from .steering_axis import SteeringAxis, measure_steering_axes
from .sweep import Estimate
from .toe_out_on_turns import ToeOut, measure_toe_out

__all__ = [
    "Estimate",
    "Runout",
    "SteeringAxis",
    "ToeOut",
    "all_turned",
    "measure_runouts",
    "measure_steering_axes",
    "measure_toe_out",
]
