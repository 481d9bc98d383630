"""Numbers that carry their derivatives: what is computed of them has its own, by the chain rule."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..vectors import Array


@dataclass(frozen=True)
class First:
    """A value and its derivatives (K,) by K inputs.

    Source: forward accumulation; Griewank and Walther, Evaluating Derivatives (2008), chapter 3.
    """

    value: float
    slope: Array

    def __add__(self, other: First) -> First:
        return First(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other: First) -> First:
        return First(self.value - other.value, self.slope - other.slope)

    def __mul__(self, other: First | float) -> First:
        if isinstance(other, First):
            slope = self.value * other.slope + other.value * self.slope
            return First(self.value * other.value, slope)
        return First(self.value * other, self.slope * other)

    def __truediv__(self, divisor: float) -> First:
        return First(self.value / divisor, self.slope / divisor)

    def __neg__(self) -> First:
        return First(-self.value, -self.slope)


def constant(value: float, count: int) -> First:
    """A number that none of `count` inputs moves."""
    return First(value, np.zeros(count))


def cos(angle: First) -> First:
    """Of an angle in radians."""
    return First(math.cos(angle.value), -math.sin(angle.value) * angle.slope)


def sin(angle: First) -> First:
    """Of an angle in radians."""
    return First(math.sin(angle.value), math.cos(angle.value) * angle.slope)


def atan2(y: First, x: First) -> First:
    """Angle of (x, y), radians; not of (0, 0)."""
    square = x.value**2 + y.value**2
    return First(math.atan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / square)


def length(*parts: First) -> First:
    """Root of the sum of squares, which is not zero."""
    whole = math.hypot(*(part.value for part in parts))
    slope = sum((part.value * part.slope for part in parts), np.zeros_like(parts[0].slope))
    return First(whole, slope / whole)
