"""Hints of capture.toml: the operator's decisions on which plane of a scan is the target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError, Wording
from ..system import frozen
from ..units import in_metres
from ..vectors import Array, Mask
from ..vehicle import REFERENCE_WHEELS
from .declaration import DeclaredHint, Vector
from .entry import ScanEntry
from .region import in_region, normal_of

Corners = tuple[Vector, ...]

OPERATOR = "The operator"
NEAR = "{who} chose the target at {at}"
# Sentences of a choice of places alone, and of one in them.
BOXED = "{who} chose the box from {low} to {high}", "{choice} in the box from {low} to {high}"
REGION = (
    "{who} chose the region with corners {corners}",
    "{choice} in the region with corners {corners}",
)
REASONED = "{choice} ({reason})"


@frozen
class Hint:
    """Decision on one scan, or on one wheel in a cloud of all.

    near_m: (3,) a point on the target; low_m, high_m: (3,) corners of the box outside which no
    point is used; region_m: (K, 3) corners of the region in which the target lies (see
    `in_region`); scan coordinates, None where not stated. by, reason: who decided, and why.
    """

    near_m: Vector | None = None
    low_m: Vector | None = None
    high_m: Vector | None = None
    by: str | None = None
    reason: str | None = None
    region_m: Corners | None = None

    def holds(self, points_m: Array) -> Mask:
        """Return which of points_m (N, 3) lie in the box; all without one."""
        if self.low_m is None or self.high_m is None:
            return np.ones(len(points_m), dtype=bool)
        inside = (points_m >= np.array(self.low_m)) & (points_m <= np.array(self.high_m))
        return np.asarray(inside.all(axis=1))

    def shows(self, points_m: Array) -> Mask:
        """Return which of points_m (N, 3) lie in the region; all without one."""
        if self.region_m is None:
            return np.ones(len(points_m), dtype=bool)
        return in_region(points_m, self.region_m)

    @property
    def near(self) -> Array | None:
        """The point on the target, (3,)."""
        return None if self.near_m is None else np.array(self.near_m)

    @property
    def note(self) -> str:
        """Sentence for the report."""
        note: str = ""
        if self.near_m is not None:
            note = Wording(NEAR, who=self.by or OPERATOR, at=_placed(self.near_m))
        if self.low_m is not None and self.high_m is not None:
            note = self._within(note, BOXED, low=_placed(self.low_m), high=_placed(self.high_m))
        if self.region_m is not None:
            note = self._within(note, REGION, corners=", ".join(map(_placed, self.region_m)))
        return Wording(REASONED, choice=note, reason=self.reason) if self.reason else note

    @property
    def there(self) -> str:
        """Begin of a message on what is searched; nothing where that is the whole scan."""
        bounded = self.low_m is not None or self.region_m is not None
        return f"{self.note}: there, " if bounded else ""

    def _within(self, note: str, sentences: tuple[str, str], **places: str) -> str:
        """Return the sentence of a choice of places, or that of a choice in them."""
        alone, added = sentences
        if note:
            return Wording(added, choice=note, **places)
        return Wording(alone, who=self.by or OPERATOR, **places)

    def stated(self) -> dict[str, object]:
        """Return what is stated, for the settings of a measurement."""
        return {key: value for key, value in vars(self).items() if value is not None}


def hints_of(
    declared: Mapping[str, DeclaredHint],
    given: Mapping[str, Vector],
    drawn: Mapping[str, Corners],
    scans: Sequence[ScanEntry],
    unit: str,
    where: str,
) -> dict[str, Hint]:
    """Return the hints by the name of a scan, for a cloud of a wheel or 'vehicle'.

    given: points, which replace all but the box of capture.toml; drawn: regions, which replace all
    that it states of a scan; unit: of all.
    Raises InputError for a name that is none, and for hints that say nothing or too little.
    """
    merged = dict(declared)
    for name, corners in drawn.items():
        merged[name] = DeclaredHint(region=corners)
    for name, point in given.items():
        box = merged.get(name, DeclaredHint()).box
        merged[name] = DeclaredHint(near=point, box=box, region=drawn.get(name))
    whole = scans[0].role == "vehicle"
    names = (*REFERENCE_WHEELS, "vehicle") if whole else tuple(scan.name for scan in scans)
    for name, hint in merged.items():
        typed = name in given and name not in declared
        at = f"--hint {name}" if typed else f"{where}: hint {name!r}"
        _check(name, hint, names, at, whole=whole)
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
    if hint.near is None and hint.box is None and hint.region is None:
        raise InputError(
            f"{where}: add near = [x, y, z], a point on the target, box = [[x, y, z], [x, y, z]], "
            "or region, the corners of a polygon"
        )
    if whole and name == "vehicle" and hint.near is not None:
        raise InputError(f"{where}: near is for RR, RL, FR and FL: give the vehicle a box")
    if whole and name != "vehicle" and (hint.box is not None or hint.region is not None):
        kind = "a box" if hint.box is not None else "a region"
        raise InputError(f"{where}: {kind} is for 'vehicle': give the wheel near = [x, y, z]")
    if hint.region is not None and normal_of(np.array(hint.region)) is None:
        raise InputError(f"{where}: region: its corners lie on a line: draw it wider")
    if hint.box is not None and not all(low < high for low, high in zip(*hint.box, strict=True)):
        raise InputError(f"{where}: box: the first corner must be less than the second in x, y, z")


def _in_metres(hint: DeclaredHint, unit: str) -> Hint:
    low, high = hint.box or (None, None)
    near, low, high = (one and _scaled(one, unit) for one in (hint.near, low, high))
    region = hint.region and tuple(_scaled(corner, unit) for corner in hint.region)
    return Hint(near, low, high, hint.by, hint.reason, region)


def _scaled(vector: Vector, unit: str) -> Vector:
    x, y, z = (in_metres(part, unit) for part in vector)
    return x, y, z


def _placed(vector: Vector) -> str:
    return f"({', '.join(f'{x:.3f}' for x in vector)}) m"
