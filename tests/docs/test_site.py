"""The site of `make docs`: every chapter and public name is on it, and its notebooks run."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import wheelplane
from tests.support.paths import ROOT

SITE = ROOT / ".ci" / "docs"
NOTEBOOKS = sorted((SITE / "source" / "notebooks").glob("*.py"))


def test_every_chapter_is_in_the_navigation():
    listed = re.findall(r"manual/(\d\d-[\w-]+\.md)", (SITE / "mkdocs.yml").read_text())
    chapters = [path.name for path in (ROOT / "pipeline" / "manual").glob("[0-9][0-9]-*.md")]
    assert sorted(listed) == sorted(chapters)


def test_every_public_name_is_in_the_reference():
    text = (SITE / "source" / "reference.md").read_text()
    paths = re.findall(r"^::: (wheelplane\.[\w.]+)$", text, re.M)
    assert sorted(path.rpartition(".")[2] for path in paths) == sorted(wheelplane.__all__)
    for path in paths:  # a module of the name would be described in its place
        assert find_spec(path) is None, path


def cells(notebook: Path) -> list[str]:
    """The cells of code of a notebook in the percent format; commands become calls."""
    parts = re.split(r"^# %%(.*)\n", notebook.read_text(), flags=re.M)[1:]
    code = [text for kind, text in zip(parts[::2], parts[1::2], strict=True) if "mark" not in kind]
    return [
        re.sub(r"^# !wheelplane (.*)$", r"command(f'''\1''')", text, flags=re.M) for text in code
    ]


def command(line: str) -> None:
    """Run a command of a notebook, which must not fail."""
    words = re.findall(r'"([^"]*)"|(\S+)', line)
    arguments = [quoted or plain for quoted, plain in words]
    subprocess.run([sys.executable, "-m", "wheelplane", *arguments], check=True, cwd=ROOT)


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs(notebook):
    names = {"command": command}
    for cell in cells(notebook):
        exec(compile(cell, str(notebook), "exec"), names)


def test_there_are_notebooks_of_a_scan_a_vehicle_and_an_archive():
    assert [path.stem for path in NOTEBOOKS] == ["archive", "one-scan", "whole-vehicle"]
