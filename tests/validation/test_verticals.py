"""Tests of comparisons of measurements whose cambers are from a vertical of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.calibration_bay import Bay, tilted
from wheelplane.errors import InputError
from wheelplane.validation import as_method
from wheelplane.validation.request import from_wheel_centres, without_vertical
from wheelplane.web.content.comparing import compare_measurements


def cambers(comparison):
    """Cambers of the first and of the second method, and their differences, degrees."""
    count = len(comparison.names)
    first, second = (
        np.degrees(m.angles_rad[count:]) for m in (comparison.first, comparison.second)
    )
    return first, second, first - second


def test_two_measurements_from_gravity_are_compared_as_they_are():
    """Floors that lean by unlike angles make unlike cambers: left and right the other way."""
    known = Bay(seed=1, trials=0).reference()
    first, second = (tilted(known, by_deg=tilt).measurement for tilt in (0.5, 0.2))
    found = compare_measurements(first, second, ("a", "b"))
    of_first = [np.degrees(wheel.angles.camber_rad) for wheel in first.wheels]
    np.testing.assert_allclose(cambers(found)[0], of_first, atol=1e-9)
    sides = [1.0 if wheel.wheel.endswith("R") else -1.0 for wheel in first.wheels]
    np.testing.assert_allclose(cambers(found)[2], 0.3 * np.array(sides), atol=1e-3)
    with pytest.raises(InputError, match="measure both from the same"):
        compare_measurements(first, known.measurement, ("a", "b"))


def test_a_method_from_the_wheel_centres_has_no_other_vertical():
    known = Bay(seed=1, trials=0).reference()
    plain = as_method("plain", known.measurement.wheels)
    wheels = [wheel.wheel for wheel in known.measurement.wheels]
    leaning = as_method("leaning", tilted(known).measurement.wheels)
    assert np.abs(leaning.angles_rad - plain.angles_rad).max() > np.radians(0.4)
    np.testing.assert_allclose(
        from_wheel_centres(leaning, wheels).angles_rad, plain.angles_rad, atol=1e-12
    )
    notes = ("Camber, caster and SAI are measured from gravity (a level).", "Another.")
    assert without_vertical(notes) == ("Another.",)
