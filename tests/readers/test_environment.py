"""Environment of child processes: what they need, and nothing else."""

from __future__ import annotations

import os
import site
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from wheelplane.readers.sandbox import environment as module
from wheelplane.readers.sandbox.environment import child_environment

EDITABLE = str(ROOT / ".ci" / "editable")
FIXED = {"PYTHONSAFEPATH": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@pytest.fixture
def variables(monkeypatch):
    """Give this process these variables and no others."""

    def give(**given: str) -> None:
        for name in list(os.environ):
            monkeypatch.delenv(name)
        for name, value in given.items():
            monkeypatch.setenv(name, value)

    return give


def test_from_nothing_comes_what_is_stated(variables):
    variables()
    assert child_environment(TMPDIR="/scratch") == {
        **FIXED,
        "PYTHONPATH": EDITABLE,
        "TMPDIR": "/scratch",
    }


def test_what_the_machine_and_its_user_set_is_passed_on(variables):
    given = {
        "HOME": "/home/a",
        "PATH": "/usr/bin:/bin",
        "LANG": "pt_PT.UTF-8",
        "LC_NUMERIC": "C",
        "TMPDIR": "/scratch",
        "XDG_CACHE_HOME": "/home/a/.cache",
        "WHEELPLANE_THREADS": "2",
        "LD_LIBRARY_PATH": "/opt/lib",
        "PYTHONPATH": "/opt/python",
    }
    variables(**given)
    path = {"PYTHONPATH": f"{EDITABLE}:/opt/python"}
    assert child_environment() == given | FIXED | path


def test_whatever_else_is_set_is_not(variables):
    variables(
        PYTHONSTARTUP="a.py",
        PYTHONINSPECT="1",
        PYTHONWARNINGS="error::a.B",
        SECRET="1",
        A_TOKEN="2",
    )
    assert (
        child_environment() == child_environment(storage=True) == {**FIXED, "PYTHONPATH": EDITABLE}
    )


@pytest.mark.parametrize(
    "name",
    ["AWS_SECRET_ACCESS_KEY", "GOOGLE_APPLICATION_CREDENTIALS", "AZURE_STORAGE_KEY", "https_proxy"],
)
def test_credentials_are_for_those_who_need_them(variables, name):
    variables(**{name: "value"})
    assert child_environment(storage=True)[name] == "value"
    assert name not in child_environment()


@pytest.mark.parametrize("name", ["PATH", "LD_LIBRARY_PATH", "PYTHONPATH"])
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("/a:/b", "/a:/b"),
        (":/a", "/a"),
        ("/a:", "/a"),
        ("/a::/b", "/a:/b"),
        (".:/a:..:b/c:./d", "/a"),
        ("", ""),
        (".", ""),
        (":", ""),
    ],
)
def test_the_current_folder_is_on_no_search_path(variables, monkeypatch, name, given, expected):
    monkeypatch.setattr(module, "PACKAGE_PARENT", site.getusersitepackages())
    variables(**{name: given})
    assert child_environment().get(name, "") == expected


def test_a_child_imports_the_same_program_first(tmp_path, variables):
    (tmp_path / "wheelplane").mkdir()
    (tmp_path / "wheelplane" / "__init__.py").write_text("raise SystemExit('another')")
    variables(PYTHONPATH=str(tmp_path))
    code = "import wheelplane.readers; print(wheelplane.__file__)"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=child_environment(),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(run.stdout.strip()).parent == Path(EDITABLE, "wheelplane")


def test_what_is_installed_is_found_without_a_search_path(variables, monkeypatch):
    """Ahead of the standard library a folder of packages would hide modules of it."""
    monkeypatch.setattr(module, "PACKAGE_PARENT", site.getsitepackages()[0])
    variables()
    assert "PYTHONPATH" not in child_environment()
