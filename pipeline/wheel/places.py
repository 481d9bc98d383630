"""Places of wheels in the cloud of a vehicle: targets of one or more kinds, and bare wheels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..config import Config
from ..detection import find_targets
from ..plane import Patch
from ..system import frozen
from ..targets import Target, WheelTarget
from ..vectors import Array, Array32
from .find_wheels import find_wheels

SAME_M = 0.3  # apart: a target and the wheel behind it


@frozen(eq=False)
class VehicleScan:
    """Points of a vehicle, (N, 3), with what its file holds of them; see `find_targets`."""

    points_m: Array
    intensity: Array32 | None
    parts: Sequence[tuple[int, int]]
    stations_m: Sequence[Array | None]
    axes: Sequence[Array | None]


@frozen
class WheelPlace:
    """Place of a wheel: what was found there, by the number of its kind; what shows it best first.

    A target before a wheel hides some of it, so that it goes before the wheel.
    """

    patches: Mapping[int, Patch]

    @property
    def best(self) -> Patch:
        """Return the patch that shows the place best."""
        return next(iter(self.patches.values()))


def find_places(
    scan: VehicleScan,
    kinds: Sequence[Target],
    config: Config,
    near_m: Sequence[tuple[int, Array]] = (),
) -> tuple[WheelPlace, ...]:
    """Find all targets of the kinds, and bare wheels where one is of them.

    near_m: points (3,) chosen by the operator, each with the number of its kind: then the target of
    that kind at each of them, in their order. Raises NotMeasuredError, see `find_targets` and
    `find_wheels`.
    """
    if near_m:
        chosen: dict[int, WheelPlace] = {}
        for number, kind in enumerate(kinds):
            rows = [row for row, (own, _) in enumerate(near_m) if own == number]
            found = _find(scan, kind, config, [near_m[row][1] for row in rows]) if rows else ()
            chosen |= {row: WheelPlace({number: one}) for row, one in zip(rows, found, strict=True)}
        return tuple(chosen[row] for row in range(len(near_m)))
    flat_first = sorted(range(len(kinds)), key=lambda k: isinstance(kinds[k], WheelTarget))
    return _joined([(k, one) for k in flat_first for one in _find(scan, kinds[k], config, ())])


def _joined(found: Sequence[tuple[int, Patch]]) -> tuple[WheelPlace, ...]:
    """Return the places of patches, each with the number of its kind."""
    places: list[dict[int, Patch]] = []
    for number, patch in found:
        same = [p for p in places if number not in p and _apart_m(p, patch) < SAME_M]
        if same:
            same[0][number] = patch
        else:
            places.append({number: patch})
    return tuple(WheelPlace(patches) for patches in places)


def _find(
    scan: VehicleScan, kind: Target, config: Config, near_m: Sequence[Array]
) -> tuple[Patch, ...]:
    if isinstance(kind, WheelTarget):
        return find_wheels(scan.points_m, kind.rim_inch, scan.parts, scan.stations_m, near_m)
    seen = (scan.points_m, kind, config.segment, scan.intensity, scan.parts, scan.stations_m)
    return find_targets(*seen, scan.axes, near_m, config.seed)


def _apart_m(place: Mapping[int, Patch], patch: Patch) -> float:
    return min(float(np.linalg.norm(p.origin_m - patch.origin_m)) for p in place.values())
