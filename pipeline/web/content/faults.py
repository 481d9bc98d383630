"""Faults of tables of readings in the language of the page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from ...calibration import QUANTITIES, Fault, FaultyTableError, Wording
from ...errors import InputError
from ...report.format.language import Translations, load_translations
from ...report.tables.calibration import STATES, quantity


@contextmanager
def faults_in(words: Translations) -> Iterator[None]:
    """Raise FaultyTableError in a language as InputError with every fault."""
    try:
        yield
    except FaultyTableError as error:
        raise InputError("; ".join(_placed(fault, words) for fault in error.faults)) from error


def _placed(fault: str, words: Translations) -> str:
    """Return a fault with its file and place."""
    if not isinstance(fault, Fault):
        return fault
    name, _, _ = fault.partition(": ")
    places = [words("fault.row", row=fault.row)] * (fault.row is not None)
    places += [words("fault.column", column=fault.column)] * (fault.column is not None)
    parts = [name, *([", ".join(places)] if places else []), in_words(fault.fact, words)]
    return ": ".join(parts)


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
