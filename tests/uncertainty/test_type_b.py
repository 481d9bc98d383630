"""Type B components: stated values enter, nothing else; the larger of two forms counts."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.config import InstrumentConfig
from wheelplane.targets.plates import DiscTarget
from wheelplane.targets.registry import parse_target
from wheelplane.uncertainty.components import UncertaintyComponent, flatness_component
from wheelplane.uncertainty.type_b import with_type_b
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.scene.target import draw_mount

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


@pytest.mark.parametrize(
    "table",
    [
        {"shape": "disc", "diameter": 0.25},
        {"shape": "ring", "diameter": 0.3, "hole_diameter": 0.12},
        {"shape": "square", "side": 0.3, "hole_diameter": 0.06, "hole_spacing": 0.18},
        {"shape": "rectangle", "width": 0.36, "height": 0.24},
    ],
    ids=lambda table: table["shape"],
)
def test_stated_flatness_holds_the_tilt_of_smooth_forms_of_any_shape(table, tmp_path):
    """Forms between planes as far apart as stated, of a generator that knows no component."""
    flatness_m, path = 5e-4, tmp_path / "target.toml"
    stated = table | {"flatness": flatness_m, "thickness": 0.01}
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in stated.items()))
    (form,) = with_type_b((), NORMAL, SIGHT_M, parse_target(stated, "test"), InstrumentConfig())
    u = np.sqrt(np.trace(form.covariance[:3, :3]) / 2.0)
    made, rng = read_target(path), np.random.default_rng(3)
    uv = rng.uniform(-0.18, 0.18, (4000, 2))
    half = np.array([table.get("width", 9.0), table.get("height", 9.0)]) / 2.0
    side, radius = table.get("side", 9.0) / 2.0, table.get("diameter", 9.0) / 2.0
    inner = table.get("hole_diameter", 0.0) / 2.0 if table["shape"] == "ring" else 0.0
    off = np.hypot(*uv.T)
    uv = uv[np.all(np.abs(uv) < np.minimum(half, side), axis=1) & (off < radius) & (off > inner)]
    slopes = np.linalg.pinv(np.column_stack([np.ones(len(uv)), uv]))[1:]
    tilts = [slopes @ draw_mount(made, rng).form.height_m(uv) for _ in range(400)]
    along = np.sqrt(np.mean(np.square(tilts), axis=0)) / u
    assert np.all((along > 0.8) & (along < 1.15))
    assert 0.9 < np.sqrt(np.mean(along**2)) < 1.1
