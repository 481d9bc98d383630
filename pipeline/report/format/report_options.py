"""Options of a report in any format."""

from __future__ import annotations

from dataclasses import dataclass

from .earlier import Earlier
from .laboratory import NOBODY, Laboratory
from .language import Translations
from .view import View


@dataclass(frozen=True)
class ReportOptions:
    """How a report looks: its language, who issues it, the view of the angles, what was before.

    record: the measurement.json that lies beside it and numbers it; "" where it is written with it.
    """

    words: Translations
    view: View
    laboratory: Laboratory = NOBODY
    before: Earlier | None = None
    record: str = ""
