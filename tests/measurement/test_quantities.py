"""Quantities of a measurement: order of the covariance, budget, selection by axis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wheelplane.five_point import measure_five_point, read_five_point
from wheelplane.measurement.quantities import against, by_name, stated
from wheelplane.vehicle import AXES

PAPER = Path(__file__).resolve().parents[1] / "data" / "paper" / "figure-4.txt"
LENGTHS = ("rear_track", "front_track", "wheelbase")  # of centres alone


@pytest.fixture(scope="module")
def measured():
    return measure_five_point(read_five_point(PAPER))


def test_quantities_stand_in_the_order_of_the_covariance(measured):
    known, found = measured.uncertainty, stated(measured)
    np.testing.assert_array_equal([q.value for q in found], known.values)
    np.testing.assert_allclose([q.u**2 for q in found], np.diag(known.covariance), rtol=1e-12)
    for wheel, result in enumerate(measured.wheels):
        assert found[wheel].name == f"{result.observation.name}.toe"
        assert found[wheel].value == pytest.approx(result.angles.toe_rad, abs=1e-15)
        assert found[wheel].u == pytest.approx(result.u_toe_rad, rel=1e-12)


def test_contributions_of_a_budget_add_up_to_the_whole(measured):
    for quantity in stated(measured):
        assert float(np.sum(quantity.contributions)) == pytest.approx(1.0, abs=1e-9)
        assert np.all(quantity.contributions >= 0.0)
        assert -1e-12 <= quantity.through_frame <= 1.0 + 1e-9


def test_lengths_are_uncertain_through_the_centres_alone(measured):
    known = by_name(measured)
    for name in LENGTHS:
        assert known[name].through_frame == pytest.approx(1.0, abs=1e-9)
    assert known["RR.toe"].through_frame < 0.9


def test_a_larger_scale_of_the_covariance_leaves_the_shares(measured):
    known = measured.uncertainty
    wider = replace(
        measured,
        uncertainty=replace(
            known,
            covariance=9.0 * known.covariance,
            contributions=9.0 * known.contributions,
            through_frame=9.0 * known.through_frame,
        ),
    )
    for one, other in zip(stated(measured), stated(wider), strict=True):
        assert other.u == pytest.approx(3.0 * one.u, rel=1e-12)
        assert other.expanded == pytest.approx(3.0 * one.expanded, rel=1e-12)
        np.testing.assert_allclose(other.contributions, one.contributions, rtol=1e-12)


def test_a_quantity_without_uncertainty_has_no_shares_and_no_nan(measured):
    known = measured.uncertainty
    certain = replace(
        known,
        covariance=np.zeros_like(known.covariance),
        contributions=np.zeros_like(known.contributions),
        through_frame=np.zeros_like(known.through_frame),
    )
    for quantity in stated(replace(measured, uncertainty=certain)):
        assert (quantity.u, quantity.through_frame) == (0.0, 0.0)
        assert not quantity.contributions.any()


def test_names_are_unique(measured):
    found = stated(measured)
    assert list(by_name(measured).values()) == found
    assert len({q.name for q in found}) == len(found)


@pytest.mark.parametrize("axis", AXES)
def test_against_an_axis_a_kind_stands_at_most_once_for_each_subject(measured, axis):
    found = stated(measured)
    chosen = against(found, axis)
    pairs = [(q.subject, q.kind) for q in chosen]
    assert len(set(pairs)) == len(pairs)
    assert {q.axis for q in chosen} == {None, axis}
    wheels = [result.observation.name for result in measured.wheels]
    assert {(wheel, kind) for wheel in wheels for kind in ("toe", "camber")} <= {*pairs}


def test_every_quantity_belongs_to_an_axis_or_to_all(measured):
    found = stated(measured)
    everywhere = [{q.name for q in against(found, axis)} for axis in AXES]
    assert set.union(*everywhere) == {q.name for q in found}
    assert set.intersection(*everywhere) == {q.name for q in found if q.axis is None}


def test_kinds_stay_together_in_the_order_of_their_first(measured):
    found = stated(measured)
    kinds = [q.kind for q in against(found, "rear-axle")]
    order = list(dict.fromkeys(q.kind for q in found))
    assert kinds == sorted(kinds, key=order.index)
