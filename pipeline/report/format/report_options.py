"""Options of a report in any format."""

from __future__ import annotations

from ...system import frozen
from .earlier import Earlier
from .laboratory import NOBODY, Laboratory
from .language import Translations
from .view import View


@frozen
class ReportOptions:
    """How a report looks: its language, who issues it, the view of the angles, what was before.

    record: the measurement.json that lies beside it and numbers it; "" where it is written with it.
    """

    words: Translations
    view: View
    laboratory: Laboratory = NOBODY
    before: Earlier | None = None
    record: str = ""
