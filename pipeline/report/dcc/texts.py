"""Texts of a digital certificate, each in every language of the program."""

from __future__ import annotations

from collections.abc import Callable

from ..format.language import LANGUAGES, Translations, load_translations
from .xml import Element, element

Said = Callable[[Translations], str]


def own(name: str, text: str, **attributes: str) -> Element:
    """Return an element of a text as the user wrote it, whatever its language."""
    return element(name, element("dcc:content", text), **attributes)


def both(name: str, said: Said, **attributes: str) -> Element:
    """Return an element of a text in every language."""
    contents = [
        element("dcc:content", said(load_translations(language)), lang=language)
        for language in LANGUAGES
    ]
    return element(name, *contents, **attributes)


def term(name: str, key: str, **attributes: str) -> Element:
    """Return an element of one of the program's words in every language."""
    return both(name, lambda words: words(key), **attributes)
