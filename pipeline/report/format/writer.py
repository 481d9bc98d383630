"""Values as a report writes them: in the unit that was chosen, with the language's decimal sign."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Literal

from ...measurement import (
    VEHICLE_BY_SWEEP,
    WHEEL_BY_RUNOUT,
    WHEEL_BY_SWEEP,
    Estimate,
    Stated,
)
from ...system import frozen
from ...vehicle import RELATIVE, Axis, Unit
from .digits import UNKNOWN, Sign, arc, decimal, metres, millimetres, sexagesimal
from .language import Translations
from .layout import aligned, paragraph
from .view import Sort, View

SORTS: dict[str, Sort] = {
    "toe": "toe",
    "rear_total_toe": "total",
    "front_total_toe": "total",
    "rear_cross_toe": "total",
    "front_cross_toe": "total",
    "camber": "camber",
    "camber_iso": "camber",
    "rear_cross_camber": "camber",
    "front_cross_camber": "camber",
    **dict.fromkeys((*WHEEL_BY_SWEEP, *WHEEL_BY_RUNOUT, *VEHICLE_BY_SWEEP), "camber"),
}
FROM_VERTICAL = {
    "camber", "camber_iso", "rear_cross_camber", "front_cross_camber", "caster", "sai",
    "cross_caster", "cross_sai",
}  # fmt: skip
BESIDE, LONG = 2, 40  # characters beside a cell; longer cells are broken (macros.html)
NONE = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"


@frozen
class Table:
    """Rows of cells under a head; the first `left` columns are words, the others numbers."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    caption: str = ""
    classes: Sequence[str] = field(default_factory=tuple)  # of each row
    minor: Sequence[int] = field(default_factory=tuple)  # columns that a narrow screen leaves out

    @property
    def shares(self) -> list[float]:
        """Width of each column on paper, percent, by its longest cell."""
        columns = zip(self.head, *self.rows, strict=True)
        widths = [BESIDE + min(max(map(len, column)), LONG) for column in columns]
        return [round(100.0 * width / sum(widths), 2) for width in widths]

    def text(self) -> str:
        """Write the table as aligned columns of plain text."""
        return aligned([tuple(self.head), *map(tuple, self.rows)], self.left)

    def block(self, note: str) -> str:
        """Write the table as plain text under its caption and a note."""
        return f"{paragraph(f'{self.caption}. {note}')}\n{self.text()}"


@frozen
class Column:
    """A column of a table definition.

    on: where it is shown, on the page, in plain text or on both. quiet: plain text shows its cells
    without the head. minor: a narrow screen leaves it out, as it does u beside U.
    """

    head: str
    on: Literal["page", "text", "both"] = "both"
    quiet: bool = False
    minor: bool = False


Columns = Sequence[str | Column]


@frozen
class Writer:
    """Words and view of one report; plain: it is written as plain text, not as a page.

    minus: sign of negative numbers; a hyphen where they are copied into other programs.
    """

    words: Translations
    view: View
    plain: bool = False
    minus: str = "-"

    @property
    def none(self) -> str:
        """The sign of a value that does not exist."""
        return "-" if self.plain else NONE

    @property
    def chi(self) -> str:
        """The head of a column of chi-square per degree of freedom."""
        return "chi2/nu" if self.plain else "χ²/ν"  # noqa: RUF001

    def table(
        self,
        columns: Columns,
        rows: Iterable[Sequence[str]],
        left: int = 1,
        caption: str = "",
        classes: Sequence[str] = (),
    ) -> Table:
        """Return the table with those columns that this report shows.

        rows: cells of all columns. left: how many of all columns are words, from the first.
        """
        all_of = [column if isinstance(column, Column) else Column(column) for column in columns]
        hidden = "page" if self.plain else "text"
        kept = [i for i, column in enumerate(all_of) if column.on != hidden]
        head = ["" if all_of[i].quiet and self.plain else all_of[i].head for i in kept]
        cells = [[row[i] for i in kept] for row in rows]
        heads = [all_of[i].head for i in kept]
        minor = [
            column
            for column, i in enumerate(kept)
            if all_of[i].minor or (heads[column] == "u" and "U" in heads)
        ]
        return Table(head, cells, sum(i < left for i in kept), caption, classes, minor)

    def value(self, quantity: Stated) -> str:
        """Write an angle with its sign, a length in metres, to the place of U."""
        if quantity.unit == "m":
            return self.number(quantity.value, "m", quantity.expanded)
        sort, value = sort_of(quantity.kind), self.view.sense(quantity.kind) * quantity.value
        return self.words.number(self.view.angle(value, sort, quantity.expanded))

    def width(self, quantity: Stated, size: float) -> str:
        """Write an uncertainty of the quantity."""
        if quantity.unit == "m":
            return self.size(size, "m")
        sort = sort_of(quantity.kind)
        at = quantity.value if sort != "camber" else 0.0
        return self.words.number(self.view.width(size, sort, at))

    def spread(self, quantity: Stated) -> tuple[str, str]:
        """Give u and U."""
        return self.width(quantity, quantity.u), self.width(quantity, quantity.expanded)

    def millimetres(self, length_m: float, expanded_m: float = UNKNOWN, sign: Sign = "") -> str:
        """Write a small length, to the place of its U."""
        return self._negative(millimetres(length_m, self.view.known(expanded_m), sign))

    def number(self, value: float | None, unit: Unit, expanded: float = UNKNOWN) -> str:
        """Write deg-min-sec, or metres, to the place of U."""
        if value is None or not math.isfinite(value):
            return self.none
        if unit == "m":
            return self._negative(self.view.length(value, expanded))
        return self._negative(sexagesimal(value, self.view.known(expanded)))

    def angle(self, value: float | None, kind: str, expanded: float = UNKNOWN) -> str:
        """Write an angle of this kind in the unit that was chosen, to the place of U."""
        if value is None or not math.isfinite(value):
            return self.none
        return self._negative(self.view.angle(value, sort_of(kind), expanded))

    def angle_width(
        self,
        size: float | None,
        kind: str,
        at: float,
        expanded: float | None = None,
        sign: Sign = "",
    ) -> str:
        """Write an uncertainty, or another small size, of an angle of this kind at `at`."""
        if size is None or not math.isfinite(size):
            return self.none
        return self._negative(self.view.width(size, sort_of(kind), at, expanded, sign))

    def _negative(self, text: str) -> str:
        """Write a number with this language's decimal sign and this report's minus."""
        return self.words.number(text).replace("-", self.minus)

    def coordinate(self, value_m: float, u_m: float) -> str:
        """Write a coordinate in metres with its sign, without the unit."""
        expanded_m = self.view.known(Estimate(value_m, u_m).expanded)
        return self.words.number(metres(value_m, expanded_m, "+").removesuffix(" m"))

    def size(self, value: float | None, unit: Unit) -> str:
        """Write an uncertainty with two digits, as an arc or in millimetres."""
        if value is None or not math.isfinite(value):
            return self.none
        if unit == "m":
            return self.millimetres(value, value)
        return self.arc(value, value)

    def arc(self, angle_rad: float, expanded_rad: float = UNKNOWN, sign: Sign = "") -> str:
        """Write a small angle in seconds, minutes or degrees, to the place of its U."""
        return self._negative(arc(angle_rad, self.view.known(expanded_rad), sign))

    def estimate(self, known: Estimate | None, kind: str) -> tuple[str, str, str]:
        """Write value, u and U of an angle of this kind; dashes where it is not known."""
        if known is None:
            return self.none, self.none, self.none
        value = self.angle(known.value, kind, known.expanded)
        u, expanded = (self.angle_width(s, kind, known.value) for s in (known.u, known.expanded))
        return value, u, expanded

    def degrees(
        self, angle_rad: float, decimals: int, expanded_rad: float = UNKNOWN, sign: Sign = "+"
    ) -> str:
        """Write decimal degrees, to the place of U."""
        expanded = math.degrees(self.view.known(expanded_rad))
        return self.words.number(f"{decimal(math.degrees(angle_rad), expanded, decimals, sign)}°")

    def reduced_chi_square(self, chi_square: float, dof: int) -> str:
        """Write chi-square per degree of freedom."""
        return self.words.number(f"{chi_square / dof:.2f}") if dof else self.none

    def length(self, known: Estimate | None) -> tuple[str, str]:
        """Write value and u in millimetres."""
        if known is None:
            return self.none, self.none
        return self.millimetres(known.value, known.expanded, "+"), self.size(known.u, "m")

    def share(self, probability: float | None) -> str:
        """Write per cent, never rounded to the certainty of 0 or 100."""
        if probability is None:
            return self.none
        if probability < 5e-4:
            return self.words.number("< 0.1 %")
        at_most = "> 99.9 %" if probability >= 0.9995 else f"{probability * 100:.1f} %"
        return self.words.number(at_most)

    def quantity(self, name: str) -> str:
        """Return the name of a quantity, such as `toe_to_thrust_line`."""
        kind, _, axis = name.partition("_to_")
        called = self.words.known("quantity", kind)
        if kind in FROM_VERTICAL:
            called = self.upright(called)
        if not axis:
            return called
        return self.words("quantity.to", quantity=called, axis=self.words.known("axis", axis))

    def from_rear_axle(self, name: str) -> str:
        """Return the name of a quantity from the rear-axle normal.

        It is named so where values beside it are from another axis.
        """
        called = self.quantity(name)
        if name not in RELATIVE or self.view.axis == "rear-axle":
            return called
        return self.words("quantity.to", quantity=called, axis=self.axis("rear-axle"))

    def sign(self, kind: str) -> str:
        """Return which sense of a quantity is positive, in words; '' where no words are needed."""
        key = f"sign.{kind}" if self.view.sense(kind) > 0.0 else f"sign_left.{kind}"
        return self.words.texts.get(key, "")

    @property
    def heading_side(self) -> str:
        """Side to which headings are positive, in words."""
        side = "right" if self.view.sense("thrust_angle") > 0.0 else "left"
        return self.words(f"convention.{side}")

    def upright(self, called: str) -> str:
        """Return the name of an angle with the vertical in use, unless that is the default."""
        vertical = self.view.vertical
        if vertical == "wheels":
            return called
        return self.words(
            "vertical.from", quantity=called, vertical=self.words(f"vertical.{vertical}")
        )

    def wheel(self, name: str) -> str:
        """Return the name of a wheel in this language; of a scan, its own name."""
        return self.words.wheel(name)

    def axis(self, axis: Axis) -> str:
        """Return the name of an axis."""
        return self.words.known("axis", axis)

    def status(self, status: str) -> str:
        """Return the name of a status."""
        return self.words.known("status", status)


def sort_of(kind: str) -> Sort:
    """Return how an angle of this kind, such as `toe` or `toe_to_thrust_line`, is written."""
    return SORTS.get(kind.partition("_to_")[0], "heading")
