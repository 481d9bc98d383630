"""Points of a scan that an operator's hint leaves: those used, and those that are searched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..readers import Scan
from ..system import frozen
from ..vectors import Array, Mask
from .hints import Hint


@frozen
class Searched:
    """A scan as it is measured, and the points among which its target is searched.

    used: what the hint's box leaves. points: of these, what its region leaves; `used` itself
    without one.
    """

    used: Scan
    points: Scan
    hint: Hint | None = None

    @property
    def by_region(self) -> bool:
        """Whether the target is searched in a region only."""
        return self.hint is not None and self.hint.region_m is not None

    @property
    def near_m(self) -> Array | None:
        """The point on the target, (3,), if one is stated."""
        return None if self.hint is None else self.hint.near

    def shows(self, place_m: Array) -> bool:
        """Return whether a place (3,) lies in the region, if there is one."""
        return self.hint is None or bool(self.hint.shows(place_m[None])[0])


def boxed(scan: Scan, hint: Hint | None, source: str) -> Searched:
    """Return what a hint's box leaves of a scan. Raises InputError where that is no point."""
    used = scan if hint is None else _only(scan, hint.holds(scan.points_m), hint, source)
    return Searched(used, used, hint)


def searched(scan: Scan, hint: Hint | None, source: str) -> Searched:
    """Return what a hint leaves of a scan. Raises InputError where that is no point."""
    left = boxed(scan, hint, source)
    if hint is None or hint.region_m is None:
        return left
    used = left.used
    return replace(left, points=_only(used, hint.shows(used.points_m), hint, source))


def _only(scan: Scan, inside: Mask, hint: Hint, source: str) -> Scan:
    if not inside.any():
        raise InputError(
            f"{source}: {hint.note}, which holds none of its {len(inside)} points: give corners in "
            "the scan's coordinates and the capture's length_unit"
        )
    if inside.all():
        return scan
    before = np.concatenate([[0], np.cumsum(inside)])
    return replace(
        scan,
        points_m=scan.points_m[inside],
        intensity=None if scan.intensity is None else scan.intensity[inside],
        parts=tuple(
            replace(part, start=int(before[part.start]), stop=int(before[part.stop]))
            for part in scan.parts
        ),
    )
