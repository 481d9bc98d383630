"""Limits as data sheets print them: every unit gives the same interval, wrong ones are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from wheelplane.measurement.tolerance.limits import AngleLimits, LengthLimits, OffsetLimits
from wheelplane.measurement.tolerance.values import (
    ToleranceInterval,
    Value,
    angle_rad,
    read_value,
)

RIM_M = 0.4064


def dms(angle_deg: float, decimals: int) -> str:
    seconds = round(abs(angle_deg) * 3600, decimals)
    minutes, seconds = divmod(seconds, 60)
    degrees, minutes = divmod(int(minutes), 60)
    return f"{'-' if angle_deg < 0 else '+'}{degrees}°{minutes:02d}'{seconds:.{decimals}f}\""


@pytest.mark.parametrize(
    ("text", "number", "scale"),
    [
        ("0°10'", 10 / 60, "deg"),
        ("-0°05'30\"", -(5 / 60 + 30 / 3600), "deg"),
        ("+1°", 1.0, "deg"),
        ("1.25°", 1.25, "deg"),
        ("90'", 1.5, "deg"),
        ("-7.5'", -0.125, "deg"),
        ('36"', 0.01, "deg"),
        ("0.5 deg", 0.5, "deg"),
        ("12 min", 0.2, "deg"),
        ("−0° 30′ 36″", -0.51, "deg"),  # noqa: RUF001
        ("2.5 mm/m", 2.5, "mm/m"),
        ("-3mm/m", -3.0, "mm/m"),
        ("1.5 mm", 0.0015, "m"),
        ("0.25 m", 0.25, "m"),
        ("-1in", -0.0254, "m"),
    ],
)
def test_a_text_has_the_value_that_it_prints(text, number, scale):
    found = read_value(text)
    assert found.scale == scale
    assert found.number == pytest.approx(number, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["", " ", "-", "5", "0,5°", "1°70'", "0°10'60\"", "1.5°10'", "1°0.5'30\"", "10'1°", "1 km",
     "mm", "1e3 mm", "--1°", "nan°", "1° 2°", "0°10", "10''"],
)  # fmt: skip
def test_what_is_no_value_is_refused_with_what_to_write(text):
    with pytest.raises(ValueError, match=r"write it as 0°10'|whole degrees and minutes"):
        read_value(text)


@pytest.mark.parametrize("seed", range(3))
def test_every_unit_gives_the_same_interval(seed):
    """Of toe: degrees, minutes, dms, the tangent in mm/m, D sin(toe) at the rim."""
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.uniform(-3.0, 3.0, 2).tolist())
    tangents = [1e3 * math.tan(math.radians(angle)) for angle in (low, high)]
    sines = [1e3 * RIM_M * math.sin(math.radians(angle)) for angle in (low, high)]
    forms = [
        {"lower_deg": low, "upper_deg": high},
        {"lower": f"{low:.15f}°", "upper": f"{high:.15f}°"},
        {"lower": f"{low * 60:.15f}'", "upper": f"{high * 60:.15f}'"},
        {"lower": dms(low, 9), "upper": dms(high, 9)},
        {"lower": f"{tangents[0]:.15f} mm/m", "upper": f"{tangents[1]:.15f} mm/m"},
        {"lower": f"{sines[0]:.15f} mm", "upper": f"{sines[1]:.15f} mm"},
        {"nominal_deg": (low + high) / 2, "tolerance_deg": (high - low) / 2},
        {"nominal": f"{high:.15f}°", "lower_deviation": f"{low - high:.15f}°",
         "upper_deviation": "+0°00'"},
        {"nominal": f"{tangents[0]:.15f} mm/m", "lower_deviation": "0 mm/m",
         "upper_deviation": f"{tangents[1] - tangents[0]:.15f} mm/m"},
    ]  # fmt: skip
    for form in forms:
        found = AngleLimits.model_validate(form).interval(1, RIM_M)
        assert (found.lower, found.upper) == pytest.approx(
            (math.radians(low), math.radians(high)), abs=1e-13
        ), form
    small = AngleLimits.model_validate(forms[5]).interval(1, 0.9 * RIM_M)
    assert small.upper != pytest.approx(math.radians(high), abs=1e-4)


def test_deviations_are_as_a_data_sheet_prints_them():
    """0°10' +0°10'/-0°05'."""
    text = {"nominal": "0°10'", "upper_deviation": "+0°10'", "lower_deviation": "-0°05'"}
    found = AngleLimits.model_validate(text).interval(1, None)
    assert found.lower == pytest.approx(math.radians(5 / 60), rel=1e-14)
    assert found.upper == pytest.approx(math.radians(20 / 60), rel=1e-14)
    number = {"nominal_deg": 2.0, "lower_deviation_deg": -0.25, "upper_deviation_deg": 0.5}
    found = AngleLimits.model_validate(number).interval(1, None)
    assert found == ToleranceInterval(math.radians(1.75), math.radians(2.5))


def test_at_the_rim_two_wheels_of_equal_toe_add_up():
    """Total toe of 4 mm is 2 mm a wheel: D (sin(left) + sin(right))."""
    total = angle_rad(Value(0.004, "m"), RIM_M, 2)
    each = angle_rad(Value(0.002, "m"), RIM_M, 1)
    assert total == pytest.approx(2.0 * each, rel=1e-15)
    assert 2.0 * RIM_M * math.sin(total / 2.0) == pytest.approx(0.004, rel=1e-14)


def test_lengths_have_every_unit_and_only_signed_ones_are_negative():
    for form in (
        {"nominal": "2600 mm", "tolerance": "5 mm"},
        {"nominal": "2.6 m", "tolerance": "5 mm"},
        {"nominal_m": 2.6, "tolerance_m": 0.005},
        {"lower": "2595mm", "upper": "2.605 m"},
    ):
        found = LengthLimits.model_validate(form).interval(0, None)
        assert (found.lower, found.upper) == pytest.approx((2.595, 2.605), abs=1e-15)
    offset = OffsetLimits.model_validate({"lower": "-2 mm"}).interval(0, None)
    assert offset == ToleranceInterval(-0.002, math.inf)
    with pytest.raises(ValidationError, match="a length is not negative"):
        LengthLimits.model_validate({"lower": "-2 mm"})


@pytest.mark.parametrize(
    ("kind", "form", "says"),
    [
        (AngleLimits, {"lower": 1}, "lower = 1 has no unit: write lower_deg = 1, or a text"),
        (LengthLimits, {"lower": 1.5}, "lower = 1.5 has no unit: write lower_m = 1.5"),
        (AngleLimits, {"lower": "1°", "lower_deg": 1.0}, "both lower and lower_deg"),
        (AngleLimits, {"lower": "1°", "upper": "2 mm/m"}, "units of several kinds"),
        (AngleLimits, {"nominal": "1°"}, "nominal_deg with tolerance_deg"),
        (AngleLimits, {"nominal": "1°", "upper_deviation": "1°"}, "lower_deviation_deg and"),
        (AngleLimits, {"nominal": "1°", "tolerance": "0'"}, "tolerance = 0': write it"),
        (AngleLimits, {"nominal": "1°", "lower_deviation": "5'", "upper_deviation": "10'"},
         "lower_deviation = 5': write it with its sign, below zero"),
        (AngleLimits, {"nominal": "1°", "lower_deviation": "-5'", "upper_deviation": "-1'"},
         "upper_deviation = -1': write it with its sign, above zero"),
        (AngleLimits, {"nominal": "1°", "lower_deviation": "0'", "upper_deviation": "0'"},
         "lower_deviation = 0' is not below upper_deviation = 0'"),
        (AngleLimits, {"lower": "2°", "upper": "100'"}, "lower = 2° is not below upper = 100'"),
        (AngleLimits, {"lower": "91°"}, "lower = 91°: it must lie from -90° to 90°"),
        (OffsetLimits, {"lower": "1°"}, "lower = 1°: a length is needed"),
        (OffsetLimits, {"lower": "2 mm/m"}, "lower = 2 mm/m: a length is needed"),
    ],
)  # fmt: skip
def test_limits_that_contradict_themselves_are_refused(kind, form, says):
    with pytest.raises(ValidationError) as refused:
        kind.model_validate(form)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("number", "wheels", "rim_m", "says"),
    [(0.001, 1, None, "add its diameter"), (0.001, 0, RIM_M, "only toe"), (0.5, 1, RIM_M, "more")],
)
def test_a_length_is_an_angle_only_of_toe_at_a_rim(number, wheels, rim_m, says):
    with pytest.raises(ValueError, match=says):
        angle_rad(Value(number, "m"), rim_m, wheels)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [(1.0, 1.0), (2.0, 1.0), (-math.inf, math.inf), (math.nan, 1.0), (math.inf, math.inf)],
)
def test_a_zone_holds_something_but_not_everything(lower, upper):
    with pytest.raises(ValueError, match="no tolerance lies"):
        ToleranceInterval(lower, upper)
