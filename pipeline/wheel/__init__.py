"""The wheel itself as target: its axis of revolution and its centre, from rim and tyre."""

from .find_wheel import find_patch
from .fit_wheel import fit_wheel

__all__ = ["find_patch", "fit_wheel"]
