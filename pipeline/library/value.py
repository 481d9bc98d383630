"""Value of a quantity with its uncertainty, in the units that people use; values by name."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from ..report.format.digits import decimal
from ..system import frozen
from ..vehicle import Unit

Item = TypeVar("Item")


class EqualByFields:
    """Equality of records whose fields may be arrays: type and all fields are equal."""

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = (one.name for one in fields(self))  # type: ignore[arg-type]
        return all(_are_equal(getattr(self, name), getattr(other, name)) for name in names)


def _are_equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    return bool(one == other)


class Named(Mapping[str, Item]):
    """Read-only mapping by name; unlike a mappingproxy it can be copied and pickled."""

    def __init__(self, held: Mapping[str, Item]) -> None:
        self._held = dict(held)

    def __getitem__(self, name: str) -> Item:
        return self._held[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._held)

    def __len__(self) -> int:
        return len(self._held)

    def __repr__(self) -> str:
        return repr(self._held)


@frozen
class Value:
    """Quantity in rad or m, with its standard uncertainty u and U = k u, which holds 95 %.

    name: such as `FL.toe` or `thrust_angle`. k: by Student's t of `dof` degrees of freedom. Signs
    and axes are those of measurement.json.
    """

    name: str
    unit: Unit
    value: float
    u: float
    U: float
    dof: float = math.inf

    @property
    def k(self) -> float:
        """Coverage factor."""
        return self.U / self.u if self.u > 0.0 else math.nan

    @property
    def deg(self) -> float:
        """Value in degrees; raises TypeError of a length, as the next two do."""
        return math.degrees(self._of("rad", self.value))

    @property
    def u_deg(self) -> float:
        """Standard uncertainty in degrees."""
        return math.degrees(self._of("rad", self.u))

    @property
    def U_deg(self) -> float:
        """Expanded uncertainty in degrees."""
        return math.degrees(self._of("rad", self.U))

    @property
    def mm(self) -> float:
        """Value in millimetres; raises TypeError of an angle, as the next two do."""
        return 1e3 * self._of("m", self.value)

    @property
    def u_mm(self) -> float:
        """Standard uncertainty in millimetres."""
        return 1e3 * self._of("m", self.u)

    @property
    def U_mm(self) -> float:
        """Expanded uncertainty in millimetres."""
        return 1e3 * self._of("m", self.U)

    def _of(self, unit: Unit, number: float) -> float:
        if self.unit != unit:
            kind, use = ("a length", "mm") if self.unit == "m" else ("an angle", "deg")
            raise TypeError(f"{self.name} is {kind}: use {use}")
        return number

    def __float__(self) -> float:
        """Return `value`, rad or m."""
        return self.value

    def __format__(self, spec: str) -> str:
        """Return the value in degrees or millimetres with that unit; all of it without a spec."""
        value, _, _, unit = self.shown
        return f"{value:{spec}} {unit}" if spec else str(self)

    @property
    def shown(self) -> tuple[float, float, float, str]:
        """Value, u and U in degrees or millimetres, and that unit."""
        if self.unit == "rad":
            return self.deg, self.u_deg, self.U_deg, "°"
        return self.mm, self.u_mm, self.U_mm, "mm"

    def __repr__(self) -> str:
        value, _, expanded, unit = self.shown
        number, spread = decimal(value, expanded, 6), decimal(expanded, expanded, 6, "")
        return f"{self.name} = ({number} ± {spread}) {unit}, k = {self.k:.2f}"
