"""A report of tables and pictures as one HTML page: letterhead, verdict, results, annexes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import field

from ... import __version__
from ...system import frozen
from ..format.laboratory import NOBODY, Laboratory
from ..format.language import Translations
from ..format.writer import Table
from ..plots.drawing import FONT, Drawing
from .provenance import Pairs
from .results import Headline
from .template import render

NUMBER_DIGITS = 12  # of the record's digest, which make the report's number
Part = Table | Drawing | str


@frozen
class Section:
    """Tables, drawings and paragraphs under a title; name: its anchor."""

    name: str
    title: str
    parts: Sequence[Part]


@frozen
class Document:
    """Content of a report; record: the JSON whose digest numbers it.

    number: of a certificate, in the place of the digest's. running, ending: words before it, at the
    foot of each page and at the end. draft: why it is one. names: of those who sign it.
    """

    title: str
    record: str
    head: Pairs
    headline: Headline | None
    results: Sequence[Section]
    annexes: Sequence[Section]
    notes: Sequence[str] = field(default_factory=tuple)
    number: str = ""
    running: str = ""
    ending: str = ""
    draft: Sequence[str] = field(default_factory=tuple)
    names: Sequence[str] = field(default_factory=tuple)


def document_html(made: Document, words: Translations, laboratory: Laboratory = NOBODY) -> str:
    """Return the page; same document, same text."""
    digest = hashlib.sha256(made.record.encode(errors="backslashreplace")).hexdigest()
    number = made.number or digest[:NUMBER_DIGITS]
    head = made.head if made.number else [*made.head, (words("head.report"), number)]
    sections = [*made.results, *made.annexes]
    return render(
        "document.html",
        {
            "words": words,
            "font": FONT,
            "number": number,
            "version": __version__,
            "title": made.title,
            "vehicle": "",
            "laboratory": laboratory,
            "head": head,
            "running": made.running or words("head.report"),
            "ending": made.ending or words("title.end"),
            "draft": made.draft,
            "names": made.names,
            "sections": [(section.name, section.title) for section in sections],
            "verdict": made.headline,
            "results": made.results,
            "annexes": made.annexes,
            "notes": made.notes,
        },
    )
