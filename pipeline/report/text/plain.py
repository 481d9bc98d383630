"""The writer of plain text, which is English."""

from __future__ import annotations

from ..format.language import load_translations
from ..format.view import View
from ..format.writer import Writer


def plain_writer(view: View) -> Writer:
    """Return a writer of English plain text."""
    return Writer(load_translations("en"), view, plain=True)
