"""Type B components: stated values enter, nothing else; the larger of two forms counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.config import InstrumentConfig
from wheelplane.targets.plates import DiscTarget
from wheelplane.uncertainty.components import UncertaintyComponent, flatness_component
from wheelplane.uncertainty.type_b import with_type_b

R = rotation(np.random.default_rng(8))
NORMAL, SIGHT_M = R[2], 3.0 * R[2] + 0.8 * R[0]
DISC = DiscTarget(shape="disc", diameter=0.25)
STATED = DISC.model_copy(update={"flatness": 5e-5, "clamp_tilt_deg": 0.01, "clamp_shift": 1e-4})
SCANNER = InstrumentConfig(range_bias_m=1e-3, pointing_urad=20.0, registration_m=1e-4)
NOISE = UncertaintyComponent("plane noise", np.full((6, 1), 1e-5), dof=20.0)


def named(components):
    return {component.name: component for component in components}


def added(target=STATED, instrument=SCANNER, components=(NOISE,)):
    return with_type_b(components, NORMAL, SIGHT_M, target, instrument)


def test_type_a_components_stay_and_type_b_has_no_scatter_behind_it():
    found = named(added())
    assert found.pop("plane noise") is NOISE
    assert set(found) == {"flatness", "clamp", "range bias", "pointing", "registration"}
    assert all(math.isinf(component.dof) for component in found.values())


def test_what_is_not_stated_adds_nothing():
    plain = DISC.model_copy(update={"flatness": 0.0, "clamp_tilt_deg": 0.0, "clamp_shift": 0.0})
    nothing = InstrumentConfig(range_bias_m=0.0, pointing_urad=0.0, registration_m=0.0)
    assert added(plain, nothing) == (NOISE,)


@pytest.mark.parametrize(
    ("name", "target", "instrument"),
    [
        ("flatness", {"flatness": 1e-4}, {}),
        ("clamp", {"clamp_tilt_deg": 0.02, "clamp_shift": 2e-4}, {}),
        ("range bias", {}, {"range_bias_m": 2e-3}),
        ("pointing", {}, {"pointing_urad": 40.0}),
        ("registration", {}, {"registration_m": 2e-4}),
    ],
)
def test_twice_the_stated_value_is_twice_that_component_alone(name, target, instrument):
    before = named(added())
    after = named(added(STATED.model_copy(update=target), SCANNER.model_copy(update=instrument)))
    for key, component in before.items():
        scale = 2.0 if key == name else 1.0
        np.testing.assert_allclose(after[key].factor, scale * component.factor, rtol=1e-12)


def test_units_of_the_stated_values():
    """Degrees, microradians and metres: variances by hand."""
    found = named(added())
    mounting = found["clamp"].covariance
    assert np.trace(mounting[:3, :3]) == pytest.approx(2.0 * math.radians(0.01) ** 2)
    assert np.trace(mounting[3:, 3:]) == pytest.approx(2.0 * 1e-4**2)
    assert np.trace(found["pointing"].covariance[:3, :3]) == pytest.approx(2.0 * 20e-6**2)
    assert np.linalg.norm(found["range bias"].factor[3:]) == pytest.approx(1e-3)
    assert np.trace(found["registration"].covariance) == pytest.approx(3.0 * 1e-4**2)


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_observed_waviness_and_stated_flatness_are_one_component(ratio):
    observed = flatness_component(ratio * STATED.flatness, STATED.radius_m, NORMAL)
    forms = [c for c in added(components=(NOISE, observed)) if c.name == "flatness"]
    wanted = flatness_component(max(ratio, 1.0) * STATED.flatness, STATED.radius_m, NORMAL)
    assert len(forms) == 1
    np.testing.assert_allclose(forms[0].covariance, wanted.covariance, rtol=1e-12)


def test_it_can_be_repeated():
    once = added()
    again = added(DISC.model_copy(update={"flatness": 5e-5}), InstrumentConfig(), once)
    assert [component.name for component in again].count("flatness") == 1
