"""Dual numbers: values are those of floats, derivatives those of central differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.vehicle.autodiff import Dual, atan2, constant, cos, length, over, sin

STEP = 1e-5
FUNCTIONS = {
    "sum": (lambda x, y, z: x + y - z, lambda x, y, z: x + y - z),
    "product": (lambda x, y, z: x * y * z, lambda x, y, z: x * y * z),
    "scaled": (lambda x, y, z: -(x * 3.0) / 7.0 + y * z, lambda x, y, z: -3 * x / 7 + y * z),
    "quotient": (lambda x, y, z: over(x * y, z), lambda x, y, z: x * y / z),
    "sine": (lambda x, y, z: sin(x * y) - sin(z), lambda x, y, z: math.sin(x * y) - math.sin(z)),
    "cosine": (lambda x, y, z: cos(x + y) * z, lambda x, y, z: math.cos(x + y) * z),
    "angle": (lambda x, y, z: atan2(x, y) * z, lambda x, y, z: math.atan2(x, y) * z),
    "length": (lambda x, y, z: length(x, y * z, z), lambda x, y, z: math.hypot(x, y * z, z)),
    "nested": (
        lambda x, y, z: atan2(sin(x) * y, length(cos(z), x)),
        lambda x, y, z: math.atan2(math.sin(x) * y, math.hypot(math.cos(z), x)),
    ),
}
SIGNS = [(a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1)]  # all octants


def inputs(at) -> list[Dual]:
    return [Dual(float(value), row) for value, row in zip(at, np.eye(len(at)), strict=True)]


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("signs", SIGNS)
def test_derivatives_are_those_of_central_differences(name, signs):
    of_duals, of_floats = FUNCTIONS[name]
    at = np.array(signs) * np.random.default_rng(len(name)).uniform(0.4, 1.6, 3)
    found = of_duals(*inputs(at))
    assert found.value == pytest.approx(of_floats(*at), rel=1e-15)
    ends = [[of_floats(*(at + s * STEP * row)) for s in (1, -1)] for row in np.eye(3)]
    wanted = [(high - low) / (2 * STEP) for high, low in ends]
    # A third derivative of order 10 times step^2, and rounding of 1e-15 over the step.
    np.testing.assert_allclose(found.slope, wanted, rtol=0, atol=1e-8)
    assert np.abs(wanted).min() > 1e-4  # every input counts


def test_a_constant_has_no_derivative():
    x, y = inputs([0.3, -2.0])
    np.testing.assert_array_equal(constant(4.0, 2).slope, 0.0)
    np.testing.assert_array_equal((x + constant(4.0, 2)).slope, x.slope)
    np.testing.assert_array_equal((constant(4.0, 2) * y).slope, (y * 4.0).slope)


@pytest.mark.parametrize("angle", np.linspace(-3.1, 3.1, 9))
def test_angle_and_length_of_a_point_on_a_circle(angle):
    """Polar coordinates undo Cartesian ones, values and derivatives alike; also beyond 90°."""
    radius, turn = inputs([2.5, angle])
    x, y = radius * cos(turn), radius * sin(turn)
    back = length(x, y), atan2(y, x)
    assert [part.value for part in back] == pytest.approx([2.5, angle], rel=1e-14)
    np.testing.assert_allclose([part.slope for part in back], np.eye(2), rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_follow_a_change_of_inputs(seed):
    """Chain rule: inputs that depend on others by M have the derivatives times M."""
    rng = np.random.default_rng(seed)
    at, M = rng.uniform(0.5, 1.5, 3), rng.uniform(-1, 1, (3, 5))
    plain = FUNCTIONS["nested"][0](*inputs(at)).slope
    mixed = FUNCTIONS["nested"][0](*(Dual(float(v), row) for v, row in zip(at, M, strict=True)))
    np.testing.assert_allclose(mixed.slope, plain @ M, rtol=0, atol=1e-14)
