"""Toe-out on turns at a named angle: exact for a parabola, u by the slopes, never extrapolated."""

from dataclasses import replace

import numpy as np
import pytest

from wheelplane.measurement.estimates import estimate, weighted_sum
from wheelplane.measurement.records import Estimate, ToeOut
from wheelplane.measurement.turn_curve import toe_out_at
from wheelplane.uncertainty.propagation import Effect

STEERS = np.radians([-19.0, -12.0, -4.0, 5.0, 11.0, 21.0])
U = 1e-4


def outer_less(inner):
    return 0.02 + 0.1 * inner + 0.4 * inner**2


def measured(shift=0.0) -> ToeOut:
    """Inner angles and differences, each with an error of its own; `shift` moves the inputs."""
    count = 2 * len(STEERS)
    effects = (Effect("noise", U * np.eye(count), np.inf, pooled=False),)
    moved = np.zeros(count) + shift
    values = np.concatenate([STEERS, outer_less(STEERS)]) + moved
    known = [estimate(v, slope, effects) for v, slope in zip(values, np.eye(count), strict=True)]
    pairs = zip(known[: len(STEERS)], known[len(STEERS) :], strict=True)
    return ToeOut("left", curve=tuple(pairs))


@pytest.mark.parametrize("inner_deg", [20.0, 15.0, 8.5, -3.0, 21.9, -19.9])
def test_a_parabola_is_met_at_any_angle(inner_deg):
    found = toe_out_at(measured(), np.radians(inner_deg))
    assert (found.status, found.inner_rad) == ("ok", np.radians(inner_deg))
    assert found.difference.value == pytest.approx(outer_less(found.inner_rad), abs=1e-12)
    again = toe_out_at(found, np.radians(10.0))  # the curve stays
    assert again.difference.value == pytest.approx(outer_less(np.radians(10.0)), abs=1e-12)


@pytest.mark.parametrize("inner_deg", [20.0, 9.0])
def test_u_is_that_of_central_differences(inner_deg):
    inner, slopes = np.radians(inner_deg), []
    for i in range(2 * len(STEERS)):
        step = np.zeros(2 * len(STEERS))
        step[i] = 1e-6
        high, low = (toe_out_at(measured(sign * step), inner).difference.value for sign in (1, -1))
        slopes.append((high - low) / 2e-6)
    found = toe_out_at(measured(), inner)
    np.testing.assert_allclose(found.difference.slope, slopes, atol=1e-7)
    expected = np.hypot(U * np.linalg.norm(slopes), found.u_interpolation_rad)
    assert found.difference.u == pytest.approx(expected, rel=1e-6)
    assert found.u_interpolation_rad > U


def test_the_turns_share_positions_so_that_their_difference_has_their_covariance():
    one = toe_out_at(measured(), np.radians(10.0))
    other = replace(one, turn="right")
    difference = weighted_sum([(1.0, one.difference), (-1.0, other.difference)])
    assert difference.u == pytest.approx(np.sqrt(2.0) * one.u_interpolation_rad)


@pytest.mark.parametrize(("inner_deg", "steered"), [(22.5, "21.0°"), (-21.0, "-19.0°")])
def test_beyond_the_positions_nothing_is_extrapolated(inner_deg, steered):
    found = toe_out_at(measured(), np.radians(inner_deg))
    assert (found.status, found.difference) == ("not-reached", None)
    assert f"steered to {steered}, {inner_deg:g}° are needed" in found.reason


def test_two_positions_and_positions_that_are_one_are_too_few():
    curve = measured().curve
    for few in (curve[:2], (curve[0], curve[0], curve[1], curve[1])):
        found = toe_out_at(ToeOut("left", curve=few), np.radians(-15.0))
        assert (found.status, found.difference) == ("too-few-pairs", None)


def test_wheels_that_are_steered_against_each_other_have_no_toe_out():
    """As where the scans of two positions are exchanged for one wheel: 16 degrees each."""
    curve = list(measured().curve)
    curve[0] = (curve[0][0], Estimate(np.radians(33.0), 1e-5))
    found = toe_out_at(ToeOut("left", curve=tuple(curve)), np.radians(-15.0))
    assert (found.status, found.difference) == ("not-together", None)
    assert "scans are exchanged" in found.reason
