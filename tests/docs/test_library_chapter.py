"""The library's chapter: its examples are run, and its table names what is there."""

from __future__ import annotations

import doctest
import re

import wheelplane as wp
from tests.support.manual_blocks import folder, prepare, run
from wheelplane.manual.build import chapter_files

CHAPTER = next(path for path in chapter_files() if path.name.endswith("-library.md"))
SYNTH = "wheelplane synth mine --seed 5 --scanner coarse.toml"  # of chapter 2


def test_the_capture_of_the_examples_is_that_of_chapter_2():
    text = next(path for path in chapter_files() if path.name.startswith("02-")).read_text("utf-8")
    assert f"\n{SYNTH}\n" in text


def test_examples_print_what_is_shown(tmp_path):
    prepare(tmp_path)
    with folder(tmp_path):
        assert run(SYNTH)[0] == 0
        found = doctest.testfile(
            str(CHAPTER),
            module_relative=False,
            optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL,
            encoding="utf-8",
        )
    assert found.failed == 0
    assert found.attempted > 20


def test_every_public_name_is_in_the_chapter():
    text = CHAPTER.read_text(encoding="utf-8")
    results = {"Alignment", "Comparison", "Covariance", "FivePointFile", "FoundTarget", "Plane"}
    results |= {"Value", "Wheel"}
    functions = set(wp.__all__) - results
    assert {name for name in functions if not re.search(rf"\b{name}\b", text)} == set()
    for name in re.findall(r"`m\.(\w+)", text):
        assert hasattr(wp.Alignment, name) or name == "measurement", name
