"""Packages whose modules are loaded when a name of theirs is first asked for."""

import subprocess
import sys

import pytest

import wheelplane.wheel
from wheelplane.system.lazily import loader


def test_a_name_is_that_of_its_module():
    load = loader("wheelplane.wheel", {".fit_wheel": {"fit_surface"}, ".profile": {"profile_of"}})
    assert load("profile_of") is wheelplane.wheel.profile_of
    with pytest.raises(AttributeError, match=r"'wheelplane.wheel' has no attribute 'find_plane'"):
        load("find_plane")


@pytest.mark.parametrize("package", ["wheel", "uncertainty", "diagnostics"])
def test_all_public_names_are_found(package):
    module = getattr(__import__(f"wheelplane.{package}"), package)
    for name in module.__all__:
        assert getattr(module, name) is not None


def test_measure_loads_no_module_that_few_captures_need():
    seldom = (
        "wheel.fit_wheel",
        "wheel.places",
        "uncertainty.field_tests",
        "diagnostics.selftest",
    )
    code = "import sys, wheelplane.commands.measure; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert "wheelplane.measure" in loaded
    assert not {f"wheelplane.{name}" for name in seldom} & set(loaded)
