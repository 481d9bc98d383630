"""Steering axis, run-out and toe-out on turns, from scans of a wheel in several positions."""

from .runout import Runout, all_turned, measure_runouts
from .steering_axis import Kingpin, measure_kingpins
from .sweep import Estimate
from .toe_out_on_turns import ToeOut, measure_toe_out

__all__ = [
    "Estimate",
    "Kingpin",
    "Runout",
    "ToeOut",
    "all_turned",
    "measure_kingpins",
    "measure_runouts",
    "measure_toe_out",
]
