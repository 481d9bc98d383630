"""Values as a report writes them: in the unit that was chosen, with the language's decimal sign."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from ...measurement import Estimate, Stated
from ...vehicle import Axis, Unit, deg_min_sec
from .language import Translations
from .view import Sort, View

SORTS: dict[str, Sort] = {
    "toe": "toe",
    "rear_total_toe": "toe",
    "front_total_toe": "toe",
    "camber": "camber",
    "camber_iso": "camber",
    "rear_cross_camber": "camber",
    "front_cross_camber": "camber",
}
NONE = "\N{EN DASH}"


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head; the first `left` columns are words, the others numbers."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    caption: str = ""
    classes: Sequence[str] = field(default_factory=tuple)  # of each row


@dataclass(frozen=True)
class Writer:
    """Words and view of one report."""

    words: Translations
    view: View

    def value(self, quantity: Stated) -> str:
        """Of an angle with its sign, of a length in metres."""
        if quantity.unit == "m":
            return self.words.number(f"{quantity.value:.5f} m")
        return self.words.number(self.view.angle(quantity.value, sort_of(quantity.kind)))

    def width(self, quantity: Stated, size: float) -> str:
        """Of an uncertainty of the quantity."""
        if quantity.unit == "m":
            return self.millimetres(size)
        sort = sort_of(quantity.kind)
        at = quantity.value if sort != "camber" else 0.0
        if quantity.kind.endswith("total_toe"):
            at /= 2.0  # mm at the rim come from each wheel's angle
        return self.words.number(self.view.width(size, sort, at))

    def spread(self, quantity: Stated) -> tuple[str, str]:
        """Give u and U."""
        return self.width(quantity, quantity.u), self.width(quantity, quantity.expanded)

    def millimetres(self, length_m: float) -> str:
        """A small length."""
        return self.words.number(f"{length_m * 1e3:.3f} mm")

    def plain(self, value: float | None, unit: Unit) -> str:
        """Deg-min-sec, or metres."""
        if value is None or not math.isfinite(value):
            return NONE
        return self.words.number(deg_min_sec(value) if unit == "rad" else f"{value:.5f} m")

    def limit(self, value: float, unit: Unit) -> str:
        """The same, as short as it can be."""
        whole = unit == "rad" and abs(math.degrees(value) * 3600 % 1.0 - 0.5) > 0.499
        return deg_min_sec(value, 0) if whole and math.isfinite(value) else self.plain(value, unit)

    def size(self, value: float | None, unit: Unit) -> str:
        """Seconds of arc, or millimetres."""
        if value is None or not math.isfinite(value):
            return NONE
        return self.words.number(size_text(value, unit))

    def estimate(self, known: Estimate | None) -> tuple[str, str, str]:
        """Value, u and U of an angle; dashes for what is not known."""
        if known is None:
            return NONE, NONE, NONE
        u, expanded = self.size(known.u, "rad"), self.size(known.expanded, "rad")
        return self.plain(known.value, "rad"), u, expanded

    def length(self, known: Estimate | None) -> tuple[str, str]:
        """Value and u in millimetres."""
        if known is None:
            return NONE, NONE
        number = self.words.number
        return number(f"{known.value * 1e3:+.2f} mm"), number(f"{known.u * 1e3:.2f} mm")

    def share(self, probability: float | None) -> str:
        """Per cent, never rounded to the certainty of 0 or 100."""
        if probability is None:
            return NONE
        if probability < 5e-4:
            return self.words.number("< 0.1 %")
        at_most = "> 99.9 %" if probability >= 0.9995 else f"{probability * 100:.1f} %"
        return self.words.number(at_most)

    def quantity(self, name: str) -> str:
        """What a quantity is called, such as `toe_to_thrust_line`."""
        kind, _, axis = name.partition("_to_")
        called = self.words.known("quantity", kind)
        if not axis:
            return called
        return self.words("quantity.to", quantity=called, axis=self.words.known("axis", axis))

    def axis(self, axis: Axis) -> str:
        """What an axis is called."""
        return self.words.known("axis", axis)

    def status(self, status: str) -> str:
        """What a status is called."""
        return self.words.known("status", status)


def sort_of(kind: str) -> Sort:
    """How an angle's kind is written."""
    return SORTS.get(kind, "heading")


def size_text(value: float, unit: str) -> str:
    """Of an uncertainty: seconds of arc, or millimetres."""
    return f"{value * 1e3:.3f} mm" if unit == "m" else f'{math.degrees(value) * 3600:.1f}"'
