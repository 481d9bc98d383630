"""Steering axis, run-out and toe-out on turns, from scans of a wheel in several positions."""

from .rolled import carried
from .solve import solve

__all__ = ["carried", "solve"]
