"""Assign the targets of one cloud to the wheels RR, RL, FR, FL, or report why it is impossible.

Axles run along the targets' normals, so four targets form two axles whose ends target outwards. The
front is given and up is found; left = up x forward. Nothing is guessed: targets that form no
vehicle, or several, raise an error that lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np

from ..errors import InputError, Wording
from ..system import frozen
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .axle_lines import AxleLine, Bodied, axle_lines, level_with
from .vehicles import (
    RIVAL,
    TRACK_M,
    WHEELBASE_M,
    Ends,
    FoundTarget,
    centres_of,
    distance_m,
    vehicles,
)

MOST_LISTED = 8
PLACED = "at ({position}) m (match {match})"
MUCH_WORSE = 0.7  # of the weakest match of a set of four: sets with a worse target are dropped
WORSE = 0.8  # of the match of another target: one that is worse and overlaps it is none


@frozen
class Axles:
    """Four targets as two axles, by their indices, the ends of both in the same order.

    further: indices of the targets on further axles of the vehicle. left_out: of all others.
    """

    ends: tuple[Ends, Ends]
    left_out: tuple[int, ...]
    further: tuple[int, ...] = ()

    def centres_m(self, targets: Sequence[FoundTarget]) -> Array:
        """Return the centres (2, 2, 3): axle, end, coordinate."""
        return centres_of(targets, self.ends)

    def named(
        self, targets: Sequence[FoundTarget], up: Array, second_is_front: bool
    ) -> dict[str, int]:
        """Return the target's index for each of RR, RL, FR, FL, given the up direction (3,)."""
        rear, front = self.ends if second_is_front else self.ends[::-1]
        middles = self.centres_m(targets).mean(axis=1)
        forward = (middles[1] - middles[0]) * (1.0 if second_is_front else -1.0)
        left = np.cross(up, forward)
        first_is_left = (targets[rear[0]].centre_m - targets[rear[1]].centre_m) @ left > 0.0
        right, other = (1, 0) if first_is_left else (0, 1)
        return dict(
            zip(
                REFERENCE_WHEELS,
                (rear[right], rear[other], front[right], front[other]),
                strict=True,
            )
        )


def find_axles(
    targets: Sequence[FoundTarget],
    radius_m: float,
    stand: Callable[[Array], bool] | None = None,
    near_front_m: Array | None = None,
    bodied: Bodied | None = None,
) -> Axles:
    """Find the two axles of the one vehicle that the targets form; radius_m: of a target.

    Other sets of four are left out if they have a much worse target, do not stand on the floor, or
    are not in line where one that shares a target is. stand: returns whether axles (2, 2, 3) stand,
    where the floor is known. near_front_m: (3,) where its front is: of several vehicles, the one
    whose wheel is the nearest to it counts, and of axles in a row the two at that end. bodied: see
    `is_bodied`.
    Raises InputError, which lists the targets, where there is no such four, or more than one.
    """
    among = _uncovered(targets, radius_m)
    if len(among) < 4:
        raise InputError(
            f"{_count(len(targets))} found, four are needed: {listed(targets)}: check --target, "
            "and that the cloud shows all four; scans of single wheels go in one folder"
        )
    found = _clearest(vehicles(targets, among, RIVAL), targets)
    _check_apart(targets, among, {i for ends in found for axle in ends for i in axle}, radius_m)
    if len(found) > 1 and stand is not None:
        found = [ends for ends in found if stand(centres_of(targets, ends))] or found
    ends, further = _of_one_vehicle(targets, among, found, near_front_m, bodied)
    if ends not in _clearest(vehicles(targets, among, 1.0), targets):
        raise InputError(
            f"{_count(len(targets))} found, but no four are arranged as a vehicle's wheels "
            f"(facing outwards, tracks of {TRACK_M[0]:g} to {TRACK_M[1]:g} m, a wheelbase of "
            f"{WHEELBASE_M[0]:g} to {WHEELBASE_M[1]:g} m): {listed(targets)}: check --target and "
            "the unit, or scan each wheel separately"
        )
    used = {*ends[0], *ends[1], *further}
    return Axles(ends, tuple(i for i in range(len(targets)) if i not in used), further)


def _of_one_vehicle(
    targets: Sequence[FoundTarget],
    among: Sequence[int],
    found: Sequence[tuple[Ends, Ends]],
    near_front_m: Array | None,
    bodied: Bodied | None,
) -> tuple[tuple[Ends, Ends] | None, tuple[int, ...]]:
    """Return the two axles of the vehicle to measure, and the targets on its further axles.

    None where there is no set of four. Raises InputError where there are several vehicles, or its
    axles do not show which two.
    """
    bar = MUCH_WORSE * max((_weakest(targets, ends) for ends in found), default=0.0)
    clear = [i for i in level_with(targets, among, found) if targets[i].match >= bar]
    lines = axle_lines(targets, clear, found, bodied)
    if not lines:
        return None, ()
    if near_front_m is not None:
        away_m = [float(np.linalg.norm(targets[i].centre_m - near_front_m)) for i in among]
        nearest = among[int(np.argmin(away_m))]
        if len(lines) > 1:
            lines = [line for line in lines if nearest in line.targets] or lines
        lines = [line if line.ends else line.from_end(nearest, targets, found) for line in lines]
    if len(lines) > 1 and _are_apart(lines):
        raise InputError(
            f"{_count(len(targets))} found, on {len(lines)} vehicles "
            f"({_sets([line.axles for line in lines])}): {listed(targets)}: add --front-point "
            "X,Y,Z near the front of the one to measure, or crop the cloud to one vehicle"
        )
    if len(lines) > 1:
        raise InputError(
            f"{_count(len(targets))} found, of which {len(found)} sets of four could be a "
            f"vehicle's wheels, axle by axle ({_sets(found)}): {listed(targets)}: crop the cloud "
            "to one vehicle"
        )
    (line,) = lines
    if line.ends is None:
        point = "add --front-point X,Y,Z near the front, or " if near_front_m is None else ""
        raise InputError(
            f"{_count(len(targets))} found, on axles ({_sets([line.axles])}) that do not show "
            f"which two are one vehicle's: {listed(targets)}: {point}choose the four by --hint "
            "RR=X,Y,Z and so on"
        )
    return line.ends, tuple(sorted(line.targets - {*line.ends[0], *line.ends[1]}))


def _are_apart(lines: Sequence[AxleLine]) -> bool:
    """Return whether no target is of two vehicles."""
    return sum(len(line.targets) for line in lines) == len({i for x in lines for i in x.targets})


def wheels_by_markers(
    ways: Sequence[Mapping[str, int]], read: Mapping[int, str], targets: Sequence[FoundTarget]
) -> Mapping[str, int]:
    """Return the one of the `ways` to name the targets that agrees with the wheels by markers.

    read: wheels by index of the target, from its markers. Raises InputError unless exactly one
    agrees.
    """
    agreeing = [way for way in ways if all(way[wheel] == index for index, wheel in read.items())]
    if len(agreeing) == 1:
        return agreeing[0]
    pairs = ", ".join(f"target {i + 1} is {wheel}" for i, wheel in sorted(read.items()))
    fact = f"by their markers, {pairs}" if read else "no board's markers identify its wheel"
    gap = "so the front is unknown" if agreeing else "which contradicts the targets' positions"
    fix = "add --front X,Y,Z" if agreeing else "check which board is on which wheel, and --front"
    raise InputError(f"{fact}, {gap}: {listed(targets)}: {fix}")


def listed(targets: Sequence[FoundTarget]) -> str:
    """Describe each target: its position, its match, and the distance to the next."""
    lines = []
    for index, target in enumerate(targets[:MOST_LISTED]):
        apart = [distance_m(target, other) for other in targets if other is not target]
        near = f", {min(apart):.2f} m from the next" if apart else ""
        lines.append(f"target {index + 1} {placed(target)[:-1]}{near})")
    more = [f"{len(targets) - MOST_LISTED} more"] if len(targets) > MOST_LISTED else []
    return "; ".join([*lines, *more]) or "none"


def placed(target: FoundTarget) -> str:
    """Describe a target: its position and its match."""
    position = ", ".join(f"{x:.3f}" for x in target.centre_m + 0.0)
    return Wording(PLACED, position=position, match=f"{target.match:.2f}")


def _clearest(
    found: list[tuple[Ends, Ends]], targets: Sequence[FoundTarget]
) -> list[tuple[Ends, Ends]]:
    """Return the sets whose weakest target matches nearly as well as that of the best set."""
    weakest = [_weakest(targets, ends) for ends in found]
    bar = MUCH_WORSE * max(weakest, default=0.0)
    return [ends for ends, match in zip(found, weakest, strict=True) if match >= bar]


def _weakest(targets: Sequence[FoundTarget], ends: tuple[Ends, Ends]) -> float:
    """Return the match of the worst target of four."""
    return min(targets[i].match for axle in ends for i in axle)


def _sets(found: Sequence[Sequence[Sequence[int]]]) -> str:
    """List the targets' numbers of each vehicle, axle by axle."""
    sets = [
        "targets " + " and ".join(", ".join(str(i + 1) for i in axle) for axle in axles)
        for axles in found
    ]
    more = [f"{len(sets) - MOST_LISTED} more"] if len(sets) > MOST_LISTED else []
    return "; ".join([*sets[:MOST_LISTED], *more])


def _uncovered(targets: Sequence[FoundTarget], radius_m: float) -> list[int]:
    """Return the targets that overlap no much better one: two targets cannot overlap."""
    return [
        i
        for i, target in enumerate(targets)
        if not any(
            target.match < WORSE * other.match and distance_m(target, other) < 2.0 * radius_m
            for other in targets
        )
    ]


def _check_apart(
    targets: Sequence[FoundTarget], among: Sequence[int], wheels: set[int], radius_m: float
) -> None:
    """Raise InputError if a target that may be a wheel's overlaps one as good."""
    for i, j in combinations(among, 2):
        apart_m = distance_m(targets[i], targets[j])
        if apart_m < 2.0 * radius_m and {i, j} & wheels:
            raise InputError(
                f"targets {i + 1} and {j + 1} lie {apart_m * 1e3:.0f} mm apart, so one target is "
                f"seen twice: {listed(targets)}: register the scans of the file again"
            )


def _count(number: int) -> str:
    return {0: "no target", 1: "1 target"}.get(number, f"{number} targets")
