"""Item file: the machine under test, what it declares of its readings, and the decision rule."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator  # noqa: TID253 - an item is a pydantic model

from ...config import Section, parse_section, read_toml
from ...measurement import VerticalKind, read_value, rim_diameter
from ...vehicle import Axis
from .quantities import QUANTITIES, MachineQuantity, indicated

Rule = Literal["guarded", "simple", "shared"]
UPRIGHT = ("camber", "caster", "sai")  # measured from a vertical


class ItemQuantity(Section):
    """Declaration of one quantity by the item; values are texts with their units.

    positive: the sense that it counts as positive. axis: the longitudinal axis that it counts from.
    definition: of camber. vertical: from which it counts camber, caster or SAI; None: from that of
    the reference. inner_deg: angle of the inner wheel of toe-out on turns. mpe: maximum permissible
    error, plus or minus. uncertainty: the item's own expanded uncertainty (k = 2).
    """

    resolution: str
    positive: str | None = None
    axis: Axis | None = None
    definition: Literal["elevation", "iso"] | None = None
    vertical: VerticalKind | None = None
    inner_deg: float | None = Field(None, gt=0.0, le=60.0)
    mpe: str | None = None
    uncertainty: str | None = None


class DecisionRule(Section):
    """Decision rule of JCGM 106:2012.

    guarded: accepted with at least this confidence (8.3.2), undecided near the MPE. simple: the
    measured error alone decides, its risk is stated (8.2). shared: the same, but only where
    MPE/U is at least `ratio`; else undecided (8.2.3).
    """

    rule: Rule
    confidence: float = Field(0.95, gt=0.5, lt=1.0)
    ratio: float = Field(3.0, ge=1.0)


class Item(Section):
    """The machine under test; a table for each quantity that is calibrated."""

    maker: str = Field(min_length=1)
    model: str = Field(min_length=1)
    serial: str = Field(min_length=1)
    software: str = Field(min_length=1)
    rim: str | None = None
    toe: ItemQuantity | None = None
    camber: ItemQuantity | None = None
    total_toe: ItemQuantity | None = None
    thrust_angle: ItemQuantity | None = None
    caster: ItemQuantity | None = None
    sai: ItemQuantity | None = None
    toe_out_on_turns: ItemQuantity | None = None
    setback: ItemQuantity | None = None
    track: ItemQuantity | None = None

    @model_validator(mode="after")
    def _declare_everything(self) -> Self:
        missing = [
            fault for kind, stated in self.declared().items() for fault in _lacks(kind, stated)
        ]
        if missing:
            raise ValueError("; ".join(missing))
        if not self.declared():
            raise ValueError("it declares no quantity: add a table such as [item.toe]")
        for kind in self.declared():
            for part in ("resolution", "mpe", "uncertainty"):
                try:
                    self.value(kind, part)
                except ValueError as error:
                    raise ValueError(f"{kind}.{part}: {error}") from error
        return self

    def declared(self) -> dict[str, ItemQuantity]:
        """Return the declared quantities by their kinds, in the order of `QUANTITIES`."""
        found = {kind: getattr(self, kind) for kind in QUANTITIES}
        return {kind: stated for kind, stated in found.items() if stated is not None}

    @property
    def rim_m(self) -> float | None:
        """Diameter at which toe in mm is read, metres. Raises ValueError where it is no rim's."""
        return None if self.rim is None else rim_diameter(self.rim)

    def value(self, kind: str, part: str) -> float | None:
        """Return resolution, mpe or uncertainty in radians or metres. Raises ValueError."""
        text = getattr(self.declared()[kind], part)
        if text is None:
            return None
        found = indicated(read_value(text), QUANTITIES[kind], self.rim_m)
        if not (found > 0.0 or (part == "resolution" and found == 0.0)):
            raise ValueError(f"{text}: write it as a value above zero")
        return found

    def resolution(self, kind: str) -> float:
        """Return the resolution of a quantity, radians or metres."""
        return self.value(kind, "resolution") or 0.0

    def sign(self, kind: str) -> float:
        """Return the factor from this program's sign to the item's."""
        positive = self.declared()[kind].positive
        return QUANTITIES[kind].signs[positive] if positive is not None else 1.0


class ItemFile(Section):
    """Item file: [item], and [decision] where a maximum permissible error is stated."""

    item: Item
    decision: DecisionRule | None = None

    @model_validator(mode="after")
    def _name_the_rule(self) -> Self:
        limited = [kind for kind, stated in self.item.declared().items() if stated.mpe is not None]
        if limited and self.decision is None:
            raise ValueError(
                f"{limited[0]} has an mpe, but no decision rule is named: add [decision] with "
                'rule = "guarded", "simple" or "shared"'
            )
        return self


def _lacks(kind: str, stated: ItemQuantity) -> list[str]:
    """Return what a quantity's table leaves undeclared, or declares without a meaning."""
    quantity = QUANTITIES[kind]
    found = _sign_faults(quantity, stated)
    needs_axis = quantity.axis or (kind == "camber" and stated.definition == "iso")
    if needs_axis and stated.axis is None:
        found.append(
            f"{kind} has no axis: add the longitudinal axis that the item counts from, "
            'such as axis = "rear-axle" or "thrust-line"'
        )
    if not needs_axis and stated.axis is not None:
        found.append(f"{kind} depends on no axis: leave axis out")
    if (kind == "camber") != (stated.definition is not None):
        found.append(
            f'{kind} has no definition: add definition = "elevation" or "iso"'
            if kind == "camber"
            else f"{kind}: definition is of camber only: leave it out"
        )
    if stated.vertical is not None and kind not in UPRIGHT:
        found.append(f"{kind} depends on no vertical: leave vertical out")
    if (kind == "toe_out_on_turns") != (stated.inner_deg is not None):
        found.append(
            f"{kind} has no inner_deg: add the angle of the inner wheel, such as inner_deg = 20.0"
            if kind == "toe_out_on_turns"
            else f"{kind}: inner_deg is of toe_out_on_turns only: leave it out"
        )
    return found


def _sign_faults(quantity: MachineQuantity, stated: ItemQuantity) -> list[str]:
    senses = list(quantity.signs)
    known = " or ".join(f'"{sense}"' for sense in senses)
    if len(senses) == 1:
        unsigned = stated.positive in (None, *senses)
        return [] if unsigned else [f"{quantity.kind} is a length: leave positive out"]
    if stated.positive is None:
        return [f"{quantity.kind} has no sign convention: add positive = {known}"]
    if stated.positive not in senses:
        return [f"{quantity.kind}.positive is {stated.positive!r}: write {known}"]
    return []


def load_item(path: Path) -> ItemFile:
    """Load an item file (TOML). Raises ConfigError."""
    return parse_section(ItemFile, read_toml(path), str(path))


def item_toml(item_file: ItemFile) -> str:
    """Return the text of an item file, which `load_item` reads as the same."""
    tree = item_file.model_dump(exclude_none=True)
    item, decision = tree["item"], tree.get("decision")
    tables = {"item": {key: value for key, value in item.items() if not isinstance(value, dict)}}
    tables |= {f"item.{kind}": item[kind] for kind in item_file.item.declared()}
    tables |= {} if decision is None else {"decision": decision}
    return "\n".join(
        "\n".join([f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in table.items()), ""])
        for name, table in tables.items()
    )


def _toml(value: str | float) -> str:
    """Return a text or a number as TOML writes it: JSON's text, but DEL escaped."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
