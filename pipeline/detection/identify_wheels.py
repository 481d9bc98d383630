"""Which wheels the faces of one cloud are: RR, RL, FR, FL, or why that cannot be told.

The axles run along the faces' normals, so four faces stand as two axles whose ends look apart. What
is front is told, and up is seen; left follows, as up x forward. Nothing is guessed: a set of faces
that makes no vehicle, or several, is an error that lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..errors import InputError
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .vehicles import (
    RIVAL,
    TRACK_M,
    WHEELBASE_M,
    Ends,
    FoundTarget,
    distance_m,
    vehicles,
)

MOST_LISTED = 8
MUCH_WORSE = 0.7  # of the weakest match of a four: another four with a face of less is none
WORSE = 0.8  # of the match of another: a face that is less and overlaps with it is none


@dataclass(frozen=True)
class Axles:
    """Four faces as two axles: faces' indices, the ends of both in the same order.

    left_out: the faces that belong to no vehicle.
    """

    ends: tuple[Ends, Ends]
    left_out: tuple[int, ...]

    def centres_m(self, faces: Sequence[FoundTarget]) -> Array:
        """(2, 2, 3): axle, end, coordinate."""
        return _centres_m(faces, self.ends)

    def named(
        self, faces: Sequence[FoundTarget], up: Array, second_is_front: bool
    ) -> dict[str, int]:
        """The face of each of RR, RL, FR, FL, for an up direction (3,)."""
        rear, front = self.ends if second_is_front else self.ends[::-1]
        middles = self.centres_m(faces).mean(axis=1)
        forward = (middles[1] - middles[0]) * (1.0 if second_is_front else -1.0)
        left = np.cross(up, forward)
        first_is_left = (faces[rear[0]].centre_m - faces[rear[1]].centre_m) @ left > 0.0
        right, other = (1, 0) if first_is_left else (0, 1)
        return dict(
            zip(
                REFERENCE_WHEELS,
                (rear[right], rear[other], front[right], front[other]),
                strict=True,
            )
        )


def find_axles(
    faces: Sequence[FoundTarget], radius_m: float, stand: Callable[[Array], bool] | None = None
) -> Axles:
    """The two axles of the one vehicle that the faces make; radius_m: of the target.

    Faces more than four are left out where no other four of them could be a vehicle's wheels, or
    all others have a face that matches much worse, or do not stand on the floor. stand: whether
    axles (2, 2, 3) do, where that can be seen.
    Raises InputError, which lists the faces, where there is no such four, or more than one.
    """
    among = _uncovered(faces, radius_m)
    if len(among) < 4:
        raise InputError(
            f"{_count(len(faces))} of the target found, four are needed: {listed(faces)}: check "
            "--target, and that the cloud shows all four; scans of single wheels go in one folder"
        )
    found = _clearest(vehicles(faces, among, RIVAL), faces)
    _check_apart(faces, among, {i for ends in found for axle in ends for i in axle}, radius_m)
    if len(found) > 1 and stand is not None:
        standing = [ends for ends in found if stand(_centres_m(faces, ends))]
        found = standing if len(standing) == 1 else found
    if len(found) > 1:
        raise InputError(
            f"{_count(len(faces))} of the target found, of which {len(found)} sets of four could "
            f"be a vehicle's wheels, axle by axle ({_sets(found)}): {listed(faces)}: crop the "
            "cloud to one vehicle"
        )
    if not found or found[0] not in _clearest(vehicles(faces, among, 1.0), faces):
        raise InputError(
            f"{_count(len(faces))} of the target found, but no four stand as a vehicle's wheels "
            f"(looking outwards, tracks of {TRACK_M[0]:g} to {TRACK_M[1]:g} m, a wheelbase of "
            f"{WHEELBASE_M[0]:g} to {WHEELBASE_M[1]:g} m): {listed(faces)}: check --target and the "
            "unit, or give each wheel a scan of its own"
        )
    used = {i for axle in found[0] for i in axle}
    return Axles(found[0], tuple(i for i in range(len(faces)) if i not in used))


def wheels_by_markers(
    ways: Sequence[Mapping[str, int]], told: Mapping[int, str], faces: Sequence[FoundTarget]
) -> Mapping[str, int]:
    """That of the `ways` to name the faces which agrees with the wheels that markers tell.

    told: the wheel of a face, by its markers. Raises InputError where none agrees, or not one only.
    """
    agreeing = [way for way in ways if all(way[wheel] == index for index, wheel in told.items())]
    if len(agreeing) == 1:
        return agreeing[0]
    said = ", ".join(f"face {i + 1} {wheel}" for i, wheel in sorted(told.items()))
    read = f"the markers tell of {said}" if told else "no board's markers tell its wheel"
    fact = "so the front is not told" if agreeing else "which contradicts where the faces stand"
    mend = "add --front X,Y,Z" if agreeing else "check which board is on which wheel, and --front"
    raise InputError(f"{read}, {fact}: {listed(faces)}: {mend}")


def listed(faces: Sequence[FoundTarget]) -> str:
    """Where each face lies, how well it matches, and how far it is from the next."""
    words = []
    for index, face in enumerate(faces[:MOST_LISTED]):
        apart = [distance_m(face, other) for other in faces if other is not face]
        near = f", {min(apart):.2f} m from the next" if apart else ""
        words.append(f"face {index + 1} {placed(face)[:-1]}{near})")
    more = [f"{len(faces) - MOST_LISTED} more"] if len(faces) > MOST_LISTED else []
    return "; ".join([*words, *more]) or "none"


def placed(face: FoundTarget) -> str:
    """Where a face lies, and how well it matches."""
    place = ", ".join(f"{x:.3f}" for x in face.centre_m + 0.0)
    return f"at ({place}) m (match {face.match:.2f})"


def _centres_m(faces: Sequence[FoundTarget], ends: tuple[Ends, Ends]) -> Array:
    return np.array([[faces[i].centre_m for i in axle] for axle in ends])


def _clearest(
    found: list[tuple[Ends, Ends]], faces: Sequence[FoundTarget]
) -> list[tuple[Ends, Ends]]:
    """The fours whose weakest face matches as well as that of the best four, or nearly."""
    weakest = [min(faces[i].match for axle in ends for i in axle) for ends in found]
    bar = MUCH_WORSE * max(weakest, default=0.0)
    return [ends for ends, match in zip(found, weakest, strict=True) if match >= bar]


def _sets(found: Sequence[tuple[Ends, Ends]]) -> str:
    """Which faces make the axles of each vehicle, by their numbers."""
    told = ["faces " + " and ".join(f"{i + 1}, {j + 1}" for i, j in axles) for axles in found]
    more = [f"{len(told) - MOST_LISTED} more"] if len(told) > MOST_LISTED else []
    return "; ".join([*told[:MOST_LISTED], *more])


def _uncovered(faces: Sequence[FoundTarget], radius_m: float) -> list[int]:
    """The faces but those that overlap with a much better one: two targets cannot."""
    return [
        i
        for i, face in enumerate(faces)
        if not any(
            face.match < WORSE * other.match and distance_m(face, other) < 2.0 * radius_m
            for other in faces
        )
    ]


def _check_apart(
    faces: Sequence[FoundTarget], among: Sequence[int], wheels: set[int], radius_m: float
) -> None:
    """Raise InputError where a face that may be a wheel's overlaps with one as good."""
    for i, j in combinations(among, 2):
        apart_m = distance_m(faces[i], faces[j])
        if apart_m < 2.0 * radius_m and {i, j} & wheels:
            raise InputError(
                f"faces {i + 1} and {j + 1} of the target lie {apart_m * 1e3:.0f} mm apart, so one "
                f"target is shown twice: {listed(faces)}: register the scans of the file anew"
            )


def _count(number: int) -> str:
    return "no face" if number == 0 else "1 face" if number == 1 else f"{number} faces"
