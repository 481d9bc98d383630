"""Notes of a measurement in the language of a report; stored ones are found by their sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache

from ...errors import Wording
from .language import Translations, load_translations

PLACE = re.compile(r"\\{(\w+)\\}")
SENTENCE_END = re.compile(r"(?<=\.) ")


def notes_in(notes: Iterable[str], words: Translations) -> tuple[str, ...]:
    """Return notes in a language; each as it stands where it has no words there."""
    return tuple(_said(note, words) for note in notes)


def joined_notes_in(text: str, words: Translations) -> str:
    """Return notes that were joined to one text in a language, as `notes_in` each of them."""
    pieces, notes = SENTENCE_END.split(text), []
    while pieces:
        tried = (" ".join(pieces[:count]) for count in range(1, len(pieces) + 1))
        note = next((one for one in tried if _found(one)[0]), pieces[0])
        notes.append(note)
        del pieces[: len(SENTENCE_END.split(note))]
    return " ".join(notes_in(notes, words))


def _said(text: object, words: Translations) -> str:
    """Return a sentence, or a phrase of one, in a language."""
    if words.language == "en":
        return str(text)
    key, parts = _found(text)
    if not key:
        return str(text)
    given = {name: PARTS.get(name, _number)(part, words) for name, part in parts.items()}
    return words(f"note.{key}", **given)


def _found(text: object) -> tuple[str, Mapping[str, object]]:
    """Return the key of a sentence and its parts; no key where it is none of those known."""
    if isinstance(text, Wording) and text.template in _keys():
        return _keys()[text.template], text.parts
    for key, form in _forms():
        found = form.fullmatch(str(text))
        if found is not None:
            return key, found.groupdict()
    return "", {}


@cache
def _keys() -> dict[str, str]:
    """Return the keys of the English sentences."""
    return {text: key for key, text in load_translations("en").section("note").items()}


@cache
def _forms() -> list[tuple[str, re.Pattern[str]]]:
    """Return the keys of the sentences with the forms that they have, the most particular first."""
    known = sorted(_keys().items(), key=lambda one: -len(PLACE.sub("", re.escape(one[0]))))
    return [(key, _form(text)) for text, key in known]


def _form(text: str) -> re.Pattern[str]:
    seen: set[str] = set()

    def part(found: re.Match[str]) -> str:
        name = found[1]
        again = name in seen
        seen.add(name)
        return f"(?P={name})" if again else f"(?P<{name}>.+?)"

    return re.compile(PLACE.sub(part, re.escape(text)))


def _number(part: object, words: Translations) -> str:
    return words.number(str(part))


def _as_it_stands(part: object, _: Translations) -> str:
    return str(part)


def _wheel(part: object, words: Translations) -> str:
    return words.wheel(str(part))


def _parts(part: object, words: Translations) -> str:
    return "; ".join(_said(one, words) for one in str(part).split("; "))


def _listed(part: object, words: Translations) -> str:
    """Return wheels, trials or phrases, separated by commas and the last by "and"."""
    ands = {" and ": f" {words('note.and')} "}
    pieces = re.split("(, | and )", str(part))
    return "".join(ands.get(one, _said(words.wheel(one), words)) for one in pieces)


# What parts of sentences are, by their names; all others are numbers.
PARTS: dict[str, Callable[[object, Translations], str]] = {
    **dict.fromkeys(("front", "up", "choice", "who", "fact", "vertical", "by", "other"), _said),
    **dict.fromkeys(("name", "nearest"), _wheel),
    **dict.fromkeys(("names", "sizes"), _listed),
    **dict.fromkeys(("file", "trial", "reason", "label"), _as_it_stands),
    "parts": _parts,
}
