"""Tests of the item file: nothing is guessed; what is missing is named with what to write."""

from __future__ import annotations

import math

import pytest

from wheelplane.calibration.forms.item import load_item
from wheelplane.calibration.forms.quantities import QUANTITIES, indicated, units_of
from wheelplane.calibration.forms.template import ITEM_FORM
from wheelplane.errors import ConfigError
from wheelplane.measurement import Value

NAMEPLATE = """[item]
maker = "M"
model = "N"
serial = "1"
software = "2"
"""
CAMBER = '[item.camber]\nresolution = "1\'"\npositive = "top-out"\n'
TOTAL = '[item.total_toe]\nresolution = "1\'"\npositive = "toe-in"\n'
TURNS = '[item.toe_out_on_turns]\nresolution = "1\'"\npositive = "toe-out"\n'
TOE = '[item.toe]\nresolution = "1\'"\npositive = "toe-in"\naxis = "rear-axle"\n'
RULE = '[decision]\nrule = "guarded"\n'


def item(tmp_path, text):
    path = tmp_path / "item.toml"
    path.write_text(text, encoding="utf-8")
    return load_item(path)


def test_a_declared_item_is_read_in_radians_and_metres(tmp_path):
    text = NAMEPLATE + 'rim = "16in"\n' + TOE + 'mpe = "4\'"\nuncertainty = "1 mm"\n'
    text += '[item.track]\nresolution = "1 mm"\n' + RULE
    found = item(tmp_path, text)
    assert list(found.item.declared()) == ["toe", "track"]
    assert found.item.resolution("toe") == pytest.approx(math.radians(1 / 60))
    assert found.item.value("toe", "mpe") == pytest.approx(math.radians(4 / 60))
    assert found.item.value("toe", "uncertainty") == pytest.approx(math.asin(1e-3 / 0.4064))
    assert found.item.resolution("track") == 1e-3
    assert found.item.value("track", "mpe") is None
    assert found.decision is not None
    assert found.decision.confidence == 0.95


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (NAMEPLATE, "declares no quantity: add a table such as [item.toe]"),
        (NAMEPLATE.replace('serial = "1"\n', "") + TOE, "'item.serial' is missing: add it"),
        (NAMEPLATE + TOE.replace('positive = "toe-in"\n', ""),
         'toe has no sign convention: add positive = "toe-in" or "toe-out"'),
        (NAMEPLATE + TOE.replace("toe-in", "in"), "toe.positive is 'in'"),
        (NAMEPLATE + TOE.replace('axis = "rear-axle"\n', ""), "toe has no axis: add"),
        (NAMEPLATE + TOE.replace("resolution = \"1'\"\n", ""), "'item.toe.resolution' is missing"),
        (NAMEPLATE + TOE.replace("1'", "1"), "toe.resolution: '1' is no value with its unit"),
        (NAMEPLATE + TOE.replace("1'", "1 mm"), "rim = \"16in\", at the top of"),
        (NAMEPLATE + TOE.replace("1'", "-1'"), "toe.resolution: -1': write it as a value above"),
        (NAMEPLATE + TOE + 'mpe = "4\'"\n', "no decision rule is named: add [decision]"),
        (NAMEPLATE + TOE + 'definition = "iso"\n', "definition is of camber only: leave it out"),
        (NAMEPLATE + CAMBER, 'camber has no definition: add definition = "elevation" or "iso"'),
        (NAMEPLATE + CAMBER + 'definition = "iso"\n', "camber has no axis"),
        (NAMEPLATE + TOTAL + 'axis = "rear-axle"\n', "total_toe depends on no axis: leave"),
        (NAMEPLATE + TURNS, "has no inner_deg"),
        (NAMEPLATE + '[item.track]\nresolution = "1\'"\n',
         "track.resolution: an angle, but a length is needed"),
        (NAMEPLATE + '[item.toes]\nresolution = "1\'"\n', "did you mean 'toe'?"),
        (NAMEPLATE + 'rim = "3m"\n' + TOE, "a diameter from 0.1 to 2 m is needed"),
    ],
)  # fmt: skip
def test_what_is_not_declared_is_named_with_what_to_write(tmp_path, text, fault):
    with pytest.raises(ConfigError) as error:
        item(tmp_path, text)
    assert fault in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / 'item.toml'}: ")


def test_the_form_is_valid_toml_and_refused_until_it_is_filled_in(tmp_path):
    with pytest.raises(ConfigError, match=r"item\.maker"):
        item(tmp_path, ITEM_FORM)
    filled = ITEM_FORM.replace('positive = ""           # toe', 'positive = "toe-in" #')
    filled = filled.replace('positive = ""           # top-out', 'positive = "top-out" #')
    filled = filled.replace('resolution = ""', 'resolution = "1\'"')
    filled = filled.replace('axis = ""', 'axis = "thrust-line"')
    filled = filled.replace('definition = ""', 'definition = "elevation"').replace('""', '"x"')
    assert list(item(tmp_path, filled).item.declared()) == ["toe", "camber", "total_toe"]


def test_a_unit_of_every_quantity_is_read():
    for quantity in QUANTITIES.values():
        units = units_of(quantity)
        assert ("mm" in units) == (quantity.unit == "m" or quantity.wheels_at_rim > 0)
    toe, total = QUANTITIES["toe"], QUANTITIES["total_toe"]
    assert indicated(Value(2.0, "mm/m"), toe, None) == pytest.approx(math.atan(2e-3))
    assert indicated(Value(2e-3, "m"), total, 0.4) == pytest.approx(2 * math.asin(2e-3 / 0.8))
    with pytest.raises(ValueError, match="only toe is given in mm"):
        indicated(Value(2e-3, "m"), QUANTITIES["camber"], 0.4)
