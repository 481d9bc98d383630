"""Targets named by one option."""

import pytest

from wheelplane.errors import ConfigError
from wheelplane.targets.choice import TargetChoice, names_of_targets, read_targets
from wheelplane.targets.registry import DiscTarget, WheelTarget


@pytest.mark.parametrize(
    ("text", "common", "of"),
    [
        ("disc-250", "disc-250", {}),
        ("disc-250,FR=wheel,FL=wheel", "disc-250", {"FR": "wheel", "FL": "wheel"}),
        ("disc-250, FR=wheel,\tFL=wheel", "disc-250", {"FR": "wheel", "FL": "wheel"}),
        ("RR=wheel", None, {"RR": "wheel"}),
        ("my discs, k=1.toml", "my discs, k=1.toml", {}),
        ("a,b.toml,RL=c,d.toml", "a,b.toml", {"RL": "c,d.toml"}),
        ("k=1/disc.toml", "k=1/disc.toml", {}),
    ],
)
def test_a_name_is_of_all_wheels_and_wheels_have_their_own(text, common, of):
    assert names_of_targets(text) == (common, of)


@pytest.mark.parametrize("text", ["wheel,XX=disc-250", "FL=wheel,FL=disc-250"])
def test_a_wheel_that_is_none_or_named_twice_is_refused(text):
    with pytest.raises(ConfigError, match=r"is no wheel|is named twice"):
        read_targets(text)


def test_the_named_targets_are_loaded_and_those_of_all_stated_as_before():
    found = read_targets("disc-250,FL=wheel")
    assert isinstance(found.common, DiscTarget)
    assert isinstance(found.of["FL"], WheelTarget)
    assert found.stated()["FL"]["shape"] == "wheel"
    alone = read_targets("disc-250")
    assert alone.stated() == alone.common.model_dump()
    assert TargetChoice(None).stated() is None
