"""Text of JSON: the same data, and nothing that could control a terminal."""

from __future__ import annotations

import json
import sys

import pytest

from wheelplane.report.json.text import json_text

EVERY = "".join(map(chr, range(sys.maxunicode + 1)))


@pytest.mark.parametrize("indent", [None, 1])
def test_every_sign_comes_back_and_those_printed_are_printable(indent):
    """Lone halves of a surrogate pair as well, as of a path that is no UTF-8."""
    apart = EVERY[:0xDC00] + EVERY[0xE000:]  # no pairs, which are read as one sign
    for text in (apart, "Citro\udceb", "a\x9b31m\u202eb\x7f", "Citroën é"):
        tree = {"a": {text: [text, 1.5, None]}}
        written = json_text(tree, indent)
        assert json.loads(written) == tree
        assert written.replace("\n", "").isprintable()
        assert written.encode().decode() == written


def test_letters_of_any_script_are_written_as_they_are():
    for text in ("Citroën", "ação", "車輪", "колесо", "\N{WHEEL}"):
        assert json_text(text) == f'"{text}"'
