"""Tests of the warnings: a wrong sign or axis is named, a right one never."""

from __future__ import annotations

import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.conventions import convention_warnings


def warnings(bay, **tables):
    tested = machine(**tables)
    reference, item = bay.reference(), item_of(tested)
    found = calibrate([reference], item, bay.readings(tested))
    assert convention_warnings(found.results, [reference], item.item) == found.warnings
    return found.warnings


@pytest.mark.parametrize("seed", range(20))
def test_right_declarations_give_no_warning(seed):
    bay = Bay(seed=seed)
    toe = changed(TOE, zero=3.0, gain=-0.05, axis=("rear-axle", "thrust-line")[seed % 2])
    assert warnings(bay, toe=toe, camber=CAMBER) == ()


@pytest.mark.parametrize("seed", range(5))
def test_the_opposite_sign_is_named(seed):
    toe = changed(TOE, declared_positive="toe-out")
    (text,) = warnings(Bay(seed=seed), toe=toe)
    assert 'the opposite sign, positive = "toe-in",' in text
    camber = changed(CAMBER, declared_positive="top-in", zero=2.0)
    assert any('positive = "top-out"' in text for text in warnings(Bay(seed=seed), camber=camber))


def test_another_axis_is_named_where_the_axes_differ():
    named = 0
    for seed in range(10):
        bay = Bay(seed=seed)
        toe = changed(TOE, axis="thrust-line", declared_axis="rear-axle", zero=0.5)
        found = warnings(bay, toe=toe)
        apart = abs(60.0 * bay.truth["vehicle"]["thrust_angle_deg"])
        named += bool(found)
        assert bool(found) or apart < 3.0
        assert all("another axis" in text for text in found)
        assert apart < 5.0 or 'axis = "thrust-line"' in found[0]
    assert named > 5
