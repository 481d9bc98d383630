"""Axles in line: targets that belong to one vehicle, and the two axles by which it is measured.

Wheels of one vehicle lie in line as those of two seldom do. Axles closer together than a wheelbase
are at one end of the vehicle; there the one nearest to the other end is its rear, or front, axle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from ..system import frozen
from ..vectors import Array
from .vehicles import (
    RIVAL,
    WHEELBASE_M,
    Ends,
    FoundTarget,
    are_in_line,
    axles_among,
    centres_of,
    distance_m,
)

Axle = tuple[int, ...]  # both of its ends, or the one that was found
Bodied = Callable[[Array, Array, Array], bool | None]  # see `is_bodied`

STEERED_DEG = 15.0  # of the wheels of an axle that no set of four shows
AXLES_M = (0.6, RIVAL * WHEELBASE_M[1])  # apart: two axles of one vehicle
ASIDE_M = 0.1  # of a lone wheel, from the line along one side of the others: tracks differ
LEVEL_M = 0.15  # of wheels of one vehicle, from their plane


@frozen
class AxleLine:
    """Axles of one vehicle, from one end to the other, those closer than a wheelbase in one group.

    ends: the two that it is measured by; None where the axles do not show which, or where only one
    end of one of them was found.
    """

    groups: tuple[tuple[Axle, ...], ...]
    ends: tuple[Ends, Ends] | None

    @property
    def axles(self) -> tuple[Axle, ...]:
        """Return all its axles."""
        return tuple(chain.from_iterable(self.groups))

    @property
    def targets(self) -> set[int]:
        """Return the indices of all its targets."""
        return set(chain.from_iterable(self.axles))

    def from_end(
        self, index: int, targets: Sequence[FoundTarget], found: Sequence[tuple[Ends, Ends]]
    ) -> AxleLine:
        """Return the first two of several groups, from the end that has a target, by its index."""
        back = tuple(group[::-1] for group in reversed(self.groups))
        for two in (self.groups[:2], back[:2]) if len(self.groups) > 2 else ():
            if index in chain.from_iterable(two[0]):
                return _measured(targets, two, found)
        return self


def axle_lines(
    targets: Sequence[FoundTarget],
    among: Sequence[int],
    found: Sequence[tuple[Ends, Ends]],
    bodied: Bodied | None = None,
) -> list[AxleLine]:
    """Return the axles of each vehicle that the targets show.

    among: indices of the targets that may be wheels. found: sets of four that could be a vehicle's.
    Those that are not in line count where they share no target with axles that are, and measure a
    vehicle where bodywork joins them. bodied: see `is_bodied`, where the points of the cloud are
    known.
    """
    square = [ends for ends in found if are_in_line(targets, ends)]
    straight = axles_among(targets, among, STEERED_DEG)
    lines = _joined(targets, sorted({*straight, *chain.from_iterable(map(_sorted, square))}))
    paired = {index for line in lines for axle in line for index in axle}
    for index in among:
        if index not in paired:
            _join_lone(targets, lines, index)
    whole = [
        part for line in lines if len(line) > 1 for part in _pieces(targets, line, found, bodied)
    ]
    taken = {index for line in whole for index in line.targets}
    loose = [ends for ends in found if not taken & {*ends[0], *ends[1]}]
    return whole + [
        AxleLine(((ends[0],), (ends[1],)), ends if _joins(targets, ends, bodied) else None)
        for ends in loose
    ]


def _joins(targets: Sequence[FoundTarget], ends: tuple[Ends, Ends], bodied: Bodied | None) -> bool:
    """Return whether bodywork joins two axles, or none is seen in the cloud."""
    centres = centres_of(targets, ends)
    rear_m, front_m = centres.mean(axis=1)
    return bodied is None or bodied(rear_m, front_m, centres[0, 0] - centres[0, 1]) is not False


def _sorted(ends: tuple[Ends, Ends]) -> tuple[Ends, Ends]:
    first, second = ((min(axle), max(axle)) for axle in ends)
    return first, second


def _joined(targets: Sequence[FoundTarget], axles: Sequence[Ends]) -> list[list[Axle]]:
    """Return the axles, those in line with one another together."""
    lines: list[list[Axle]] = []
    for axle in axles:
        own = [line for line in lines if any(_are_of_one(targets, axle, a) for a in line)]
        lines = [line for line in lines if line not in own]
        lines.append([axle, *chain.from_iterable(own)])
    return lines


def _are_of_one(targets: Sequence[FoundTarget], one: Axle, other: Axle) -> bool:
    apart = _middle_m(targets, one) - _middle_m(targets, other)
    return (
        not set(one) & set(other)
        and AXLES_M[0] < float(np.linalg.norm(apart)) < AXLES_M[1]
        and any(
            are_in_line(targets, ((one[0], one[1]), (same[0], same[1])))
            for same in (other, other[::-1])
        )
    )


def _join_lone(targets: Sequence[FoundTarget], lines: list[list[Axle]], index: int) -> None:
    """Add a target that is no axle's end to the line with whose nearest axle it is in line."""
    away_m = {
        number: min(_away_m(targets, index, axle) for axle in line if len(axle) > 1)
        for number, line in enumerate(lines)
    }
    nearest = min(away_m, key=away_m.__getitem__, default=None)
    if nearest is not None and away_m[nearest] < AXLES_M[1]:
        lines[nearest].append((index,))


def _away_m(targets: Sequence[FoundTarget], index: int, axle: Axle) -> float:
    """Return how far a target lies from an axle's end along the vehicle; inf if it lies aside."""
    one = targets[index]
    across = targets[axle[0]].centre_m - targets[axle[1]].centre_m
    end = targets[axle[0] if one.normal @ across > 0.0 else axle[1]]
    aside_m = abs(float((one.centre_m - end.centre_m) @ across)) / float(np.linalg.norm(across))
    apart_m = distance_m(one, end)
    alike = one.normal @ end.normal > np.cos(np.radians(STEERED_DEG))
    return apart_m if alike and aside_m < ASIDE_M and apart_m > AXLES_M[0] else np.inf


def _pieces(
    targets: Sequence[FoundTarget],
    line: Sequence[Axle],
    found: Sequence[tuple[Ends, Ends]],
    bodied: Bodied | None,
) -> list[AxleLine]:
    """Return a line of axles from end to end, with the two that it is measured by.

    Where there are more than two ends, it is parted at gaps in the bodywork.
    """
    first = next(axle for axle in line if len(axle) > 1)
    across = targets[first[0]].centre_m - targets[first[1]].centre_m
    square = across / np.linalg.norm(across)
    middle_m = _middle_m(targets, first)
    off_m = np.array([_middle_m(targets, axle) for axle in line]) - middle_m
    off_m -= np.outer(off_m @ square, square)
    far = off_m[np.argmax(np.linalg.norm(off_m, axis=1))]
    along_m = off_m @ far / np.linalg.norm(far)
    order = np.argsort(along_m, kind="stable")
    least_m = WHEELBASE_M[0] if len(line) > 2 else 0.0
    groups = np.split(order, np.flatnonzero(np.diff(along_m[order]) > least_m) + 1)
    if len(groups) > 2 and bodied is not None:
        gap = [
            not bodied(middle_m + off_m[one[-1]], middle_m + off_m[other[0]], across)
            for one, other in pairwise(groups)
        ]
        parts = np.split(np.arange(len(groups)), np.flatnonzero(gap) + 1)
        several = [[groups[i] for i in part] for part in parts if len(part) > 1] or [groups]
    else:
        several = [groups]
    return [
        _measured(targets, [[line[i] for i in group] for group in part], found) for part in several
    ]


def _measured(
    targets: Sequence[FoundTarget],
    groups: Sequence[Sequence[Axle]],
    found: Sequence[tuple[Ends, Ends]],
) -> AxleLine:
    """Return axles by their groups, from end to end, with the two that they are measured by."""
    line = AxleLine(tuple(map(tuple, groups)), None)
    if len(groups) != 2 or _overlap(line.axles):
        return line
    inner = {frozenset(groups[0][-1]), frozenset(groups[1][0])}
    own = next((ends for ends in found if set(map(frozenset, ends)) == inner), None)
    even = own is not None and _unevenness_m(targets, line.axles) < LEVEL_M
    return replace(line, ends=own if even else None)


def _overlap(axles: Sequence[Axle]) -> bool:
    """Return whether a target is an end of two axles."""
    ends = list(chain.from_iterable(axles))
    return len(set(ends)) < len(ends)


def _unevenness_m(targets: Sequence[FoundTarget], axles: Sequence[Axle]) -> float:
    """Return the largest distance of the targets from their plane."""
    centres = np.array([targets[i].centre_m for axle in axles for i in axle])
    local = centres - centres.mean(axis=0)
    return float(np.abs(local @ np.linalg.svd(local, full_matrices=False)[2][2]).max())


def _middle_m(targets: Sequence[FoundTarget], axle: Axle) -> Array:
    """Return the middle (3,) of an axle, or the centre of its one end that was found."""
    return np.asarray(np.mean([targets[i].centre_m for i in axle], axis=0))


def level_with(
    targets: Sequence[FoundTarget], among: Sequence[int], found: Sequence[tuple[Ends, Ends]]
) -> list[int]:
    """Return those of the targets that lie level with the wheels of some set of four."""
    centres = np.array([targets[i].centre_m for i in among])
    level = np.zeros(len(among), dtype=bool)
    for ends in found:
        four = centres_of(targets, ends)
        middles = four.mean(axis=1)
        up = np.cross(middles[1] - middles[0], (four[:, 0] - four[:, 1]).sum(axis=0))
        height_m = (centres - middles.mean(axis=0)) @ up / np.linalg.norm(up)
        level |= np.abs(height_m) < 2.0 * LEVEL_M
    return [i for i, own in zip(among, level, strict=True) if own]
