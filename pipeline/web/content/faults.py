"""Faults of tables of readings in the language of the page."""

from __future__ import annotations

from functools import cache

from ...calibration import QUANTITIES, Wording
from ...report.format.language import Translations, load_translations
from ...report.tables.calibration import STATES, quantity


def in_words(fact: object, words: Translations) -> str:
    """Return a fact in a language; in English where it has no words there."""
    key = _keys().get(fact.template) if isinstance(fact, Wording) else None
    if key is None or not isinstance(fact, Wording):
        return str(fact)
    parts = {name: _part(name, part, words) for name, part in fact.parts.items()}
    return words(f"fault.{key}", **parts)


def _part(name: str, part: object, words: Translations) -> str:
    if words.language != "en" and name == "kind" and part in QUANTITIES:
        return quantity(str(part), words)
    if name == "state" and part in STATES:
        return words(f"calibration.{STATES[str(part)]}")
    return in_words(part, words)


@cache
def _keys() -> dict[str, str]:
    """Return the keys of the English sentences."""
    return {text: key for key, text in load_translations("en").section("fault").items()}
