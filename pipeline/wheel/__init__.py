"""The wheel itself as target: its axis of revolution and its centre, from rim and tyre."""

from .find_wheel import find_patch
from .find_wheels import find_wheels
from .fit_wheel import fit_wheel

__all__ = ["find_patch", "find_wheels", "fit_wheel"]
