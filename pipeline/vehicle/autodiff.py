"""Forward-mode automatic differentiation: numbers that carry their derivatives."""

from __future__ import annotations

import math

import numpy as np

from ..system import frozen
from ..vectors import Array


@frozen
class Dual:
    """A value and its derivatives (K,) with respect to K inputs.

    Source: forward accumulation; Griewank and Walther, Evaluating Derivatives (2008), chapter 3.
    """

    value: float
    slope: Array

    def __add__(self, other: Dual) -> Dual:
        return Dual(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other: Dual) -> Dual:
        return Dual(self.value - other.value, self.slope - other.slope)

    def __mul__(self, other: Dual | float) -> Dual:
        if isinstance(other, Dual):
            slope = self.value * other.slope + other.value * self.slope
            return Dual(self.value * other.value, slope)
        return Dual(self.value * other, self.slope * other)

    def __truediv__(self, divisor: float) -> Dual:
        return Dual(self.value / divisor, self.slope / divisor)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)


def constant(value: float, count: int) -> Dual:
    """Return a number that depends on none of `count` inputs."""
    return Dual(value, np.zeros(count))


def cos(angle: Dual) -> Dual:
    """Return the cosine of an angle in radians."""
    return Dual(math.cos(angle.value), -math.sin(angle.value) * angle.slope)


def sin(angle: Dual) -> Dual:
    """Return the sine of an angle in radians."""
    return Dual(math.sin(angle.value), math.cos(angle.value) * angle.slope)


def atan2(y: Dual, x: Dual) -> Dual:
    """Return the angle of (x, y), radians; (x, y) must not be (0, 0)."""
    square = x.value**2 + y.value**2
    return Dual(math.atan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / square)


def over(top: Dual, bottom: Dual) -> Dual:
    """Return a quotient; bottom must not be 0."""
    ratio = top.value / bottom.value
    return Dual(ratio, (top.slope - ratio * bottom.slope) / bottom.value)


def length(*parts: Dual) -> Dual:
    """Return the Euclidean norm of the parts, which must not all be zero."""
    whole = math.hypot(*(part.value for part in parts))
    slope = sum((part.value * part.slope for part in parts), np.zeros_like(parts[0].slope))
    return Dual(whole, slope / whole)
