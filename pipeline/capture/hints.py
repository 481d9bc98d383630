"""Hints of capture.toml: the operator's decisions on which plane of a scan is the target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, Wording
from ..units import in_metres
from ..vectors import Array, Mask
from ..vehicle import REFERENCE_WHEELS
from .declaration import DeclaredHint, Vector
from .entry import ScanEntry

NEAR = "{who} chose the target at {at}"
BOXED = "{who} chose the box from {low} to {high}"
NEAR_BOXED = "{who} chose the target at {at} in the box from {low} to {high}"
REASONED = "{choice} ({reason})"


@dataclass(frozen=True)
class Hint:
    """Decision on one scan, or on one wheel in a cloud of all.

    near_m: (3,) a point on the target; low_m, high_m: (3,) corners of the box that is searched;
    scan coordinates, None where not stated. by, reason: who decided, and why.
    """

    near_m: Vector | None = None
    low_m: Vector | None = None
    high_m: Vector | None = None
    by: str | None = None
    reason: str | None = None

    def holds(self, points_m: Array) -> Mask:
        """Return which of points_m (N, 3) lie in the box; all without one."""
        if self.low_m is None or self.high_m is None:
            return np.ones(len(points_m), dtype=bool)
        inside = (points_m >= np.array(self.low_m)) & (points_m <= np.array(self.high_m))
        return np.asarray(inside.all(axis=1))

    @property
    def near(self) -> Array | None:
        """The point on the target, (3,)."""
        return None if self.near_m is None else np.array(self.near_m)

    @property
    def note(self) -> str:
        """Sentence for the report."""
        boxed = self.low_m is not None and self.high_m is not None
        at, low, high = (
            "" if place is None else _placed(place)
            for place in (self.near_m, self.low_m, self.high_m)
        )
        sentence = NEAR if not boxed else BOXED if self.near_m is None else NEAR_BOXED
        chosen = Wording(sentence, who=self.by or "The operator", at=at, low=low, high=high)
        return Wording(REASONED, choice=chosen, reason=self.reason) if self.reason else chosen

    def stated(self) -> dict[str, object]:
        """Return what is stated, for the settings of a measurement."""
        return {key: value for key, value in vars(self).items() if value is not None}


def hints_of(
    declared: Mapping[str, DeclaredHint],
    given: Mapping[str, Vector],
    scans: Sequence[ScanEntry],
    unit: str,
    where: str,
) -> dict[str, Hint]:
    """Return the hints by the name of a scan, for a cloud of a wheel or 'vehicle'.

    given: points of the command line, which replace those of capture.toml; unit: of all.
    Raises InputError for a name that is none, and for hints that say nothing or too little.
    """
    merged = dict(declared)
    for name, point in given.items():
        merged[name] = DeclaredHint(near=point, box=getattr(merged.get(name), "box", None))
    whole = len(scans) == 1 and scans[0].role == "vehicle"
    names = (*REFERENCE_WHEELS, "vehicle") if whole else tuple(scan.name for scan in scans)
    for name, hint in merged.items():
        _check(name, hint, names, f"{where}: hint {name!r}", whole=whole)
    wheels = [wheel for wheel in REFERENCE_WHEELS if wheel in merged]
    if whole and 0 < len(wheels) < len(REFERENCE_WHEELS):
        missing = ", ".join(wheel for wheel in REFERENCE_WHEELS if wheel not in merged)
        raise InputError(
            f"{where}: hints name the targets of {', '.join(wheels)}: add {missing}, or leave out "
            "all four: positions of single wheels do not name the others"
        )
    return {name: _in_metres(hint, unit) for name, hint in merged.items()}


def _check(name: str, hint: DeclaredHint, names: Sequence[str], where: str, *, whole: bool) -> None:
    if name not in names:
        raise InputError(f"{where}: there is no such scan: name one of {', '.join(names)}")
    if hint.near is None and hint.box is None:
        raise InputError(
            f"{where}: add near = [x, y, z], a point on the target, or box = [[x, y, z], [x, y, z]]"
        )
    if whole and name == "vehicle" and hint.near is not None:
        raise InputError(f"{where}: near is for RR, RL, FR and FL: give the vehicle a box")
    if whole and name != "vehicle" and hint.box is not None:
        raise InputError(f"{where}: a box is for 'vehicle': give the wheel near = [x, y, z]")
    if hint.box is not None and not all(low < high for low, high in zip(*hint.box, strict=True)):
        raise InputError(f"{where}: box: the first corner must be less than the second in x, y, z")


def _in_metres(hint: DeclaredHint, unit: str) -> Hint:
    low, high = hint.box or (None, None)
    near, low, high = (_scaled(one, unit) for one in (hint.near, low, high))
    return Hint(near, low, high, hint.by, hint.reason)


def _scaled(vector: Vector | None, unit: str) -> Vector | None:
    if vector is None:
        return None
    x, y, z = (in_metres(part, unit) for part in vector)
    return x, y, z


def _placed(vector: Vector) -> str:
    return f"({', '.join(f'{x:.3f}' for x in vector)}) m"
