"""Faults of tables of readings in the language of the page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from ...calibration import QUANTITIES, Fault, FaultyTableError
from ...errors import InputError, Wording
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


PLACE, GOT = r"^(?:item: |item\.)?(?P<field>[\w.]+): ", r", got (?P<value>.+)$"
KIND = r"^(?:item: )?(?P<kind>\w+)"
# What an item file says that it lacks; all else stays in English, as the command says it.
ITEM_FAULTS = {
    key: re.compile(form)
    for key, form in {
        "empty": r"^(?:item: |item\.)?(?P<field>[\w.]+) is empty: fill it in",
        "missing": r"^'(?:item\.)?(?P<field>[\w.]+)' is missing: add it",
        "no_axis": KIND + r" has no axis:",
        "no_sign": KIND + r" has no sign convention:",
        "no_definition": KIND + r" has no definition:",
        "no_inner": KIND + r" has no inner_deg:",
        "no_rule": KIND + r" has an mpe, but no decision rule",
        "no_quantity": r"^(?:item: )?it declares no quantity",
        "no_rim": PLACE + r"rim = (?P<value>\S+): a diameter from (?P<low>\S+) to (?P<high>\S+) m",
        "at_rim": PLACE + r"(?P<value>.+) is at the rim:",
        "no_value": PLACE + r"(?P<value>['\"].*['\"]) is no value with its unit:",
        "no_angle": PLACE + r"(?P<value>['\"].*['\"]): whole degrees and minutes",
        "not_positive": PLACE + r"(?P<value>.+): write it as a value above zero",
        "no_length": PLACE + r"an angle, but a length is needed",
        "needless_axis": KIND + r" depends on no axis:",
        "needless_sign": KIND + r" is a length: leave positive out",
        "of_camber": KIND + r": definition is of camber only",
        "of_turns": KIND + r": inner_deg is of toe_out_on_turns only",
        "other_sign": KIND + r"\.positive is (?P<value>.+): write (?P<known>.+)$",
        "choice": PLACE + r"input should be (?P<known>'.+')" + GOT,
        "at_most": PLACE + r"input should be less than or equal to (?P<limit>\S+)" + GOT,
        "at_least": PLACE + r"input should be greater than or equal to (?P<limit>\S+)" + GOT,
        "below": PLACE + r"input should be less than (?P<limit>\S+)" + GOT,
        "above": PLACE + r"input should be greater than (?P<limit>\S+)" + GOT,
        "no_number": PLACE + r"a number is needed" + GOT,
        "no_text": PLACE + r"text in quotes is needed" + GOT,
        "no_table": PLACE + r"a table is needed" + GOT,
        "unknown": r"^unknown key '(?:item\.)?(?P<field>.+)': .*known are (?P<known>.+)$",
    }.items()
}


def item_in_words(error: str, words: Translations) -> list[str]:
    """Return the faults of an item file, one after the other, in a language."""
    if words.language == "en":
        return [error]
    return [_item_fault(text, words) for text in error.removeprefix("item.toml: ").split("; ")]


def _item_fault(text: str, words: Translations) -> str:
    for key, form in ITEM_FAULTS.items():
        found = form.match(text)
        if found is not None:
            given = {name: part.replace(" or ", ", ") for name, part in found.groupdict().items()}
            parts = {name: _part(name, part, words) for name, part in given.items()}
            return words(f"item_fault.{key}", **parts) + "."
    return text


def _part(name: str, part: object, words: Translations) -> str:
    if words.language != "en" and name == "kind" and part in QUANTITIES:
        return quantity(str(part), words)
    if name == "state" and part in STATES:
        return words(f"calibration.{STATES[str(part)]}")
    if name in ("found", "declared"):
        return words.number(str(part))
    return in_words(part, words)


@cache
def _keys() -> dict[str, str]:
    """Return the keys of the English sentences."""
    return {text: key for key, text in load_translations("en").section("fault").items()}
