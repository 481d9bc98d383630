"""Notes on scans that contradict what they are named for, each a doubt in every verdict.

Copies among the positions of a sweep or of a run-out are refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import Doubt, InputError
from ..uncertainty import chi_square_beyond
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS, Floor, VehicleFrame, fit_floor
from .records import Observation, Vertical

UPSIDE_DOWN = (
    "The vehicle's up direction is opposite to z ({z}): if z points up, left and right, or front "
    "and rear, are exchanged: check the order {names}; if it points down, state gravity in "
    "capture.toml."
)
ACROSS = (
    "z of the scans lies across the vehicle's up direction (up . z = {z}), so that nothing checks "
    "the order {names} and the handedness of the scans' axes: of wheels exchanged or of a mirrored "
    "export, signs are wrong: state gravity in capture.toml, or export the scans with z up."
)
# cos 60 degrees, between up and z: no ramp or lift tilts a vehicle so far, nor a tripod a scanner.
MIN_UPRIGHT = 0.5
FLOOR_ABOVE = (
    "The floor in the scans lies {height} m above the wheel centres: left and right, or front and "
    "rear, are exchanged, or the scans are mirrored: check the order {names}, and their axes."
)
UNLIKE_TRACKS = (
    "The wheels are not placed as on two axles: tracks of {one} m and {two} m: check the order "
    "{names}, and the points of each."
)
UNLIKE_WHEELBASES = (
    "The wheels are not placed as on two axles: wheelbases of {one} m and {two} m: check the "
    "order {names}, and the points of each."
)
TWISTED = (
    "The wheels are not placed as on two axles: the line through the front wheel centres is "
    "inclined by {angle}° against that through the rear ones, {height} m over its track: check "
    "that all scans are in the same coordinates, and the points of each."
)
FAR_FROM_WHEEL = (
    "Trial {trial} is named for {name}, {named} m from it, but lies {distance} m from {nearest}: "
    "check its wheel."
)
FAR_FROM_WHEELS = (
    "Trial {trial} lies {distance} m from {nearest}, its nearest wheel: check its file, and that "
    "it is in the coordinates of the other scans."
)
SCAN_FAR_FROM_WHEEL = (
    "Scan {scan} is named for {name}, {named} m from it, but lies {distance} m from {nearest}: "
    "check its wheel."
)
SCAN_FAR_FROM_WHEELS = (
    "Scan {scan} lies {distance} m from {nearest}, its nearest wheel: check its file, and that it "
    "is in the coordinates of the other scans."
)
COPIED = (
    "Trial {trial} holds the same points as {name}: it is a copy, which shows nothing of its own: "
    "check its file."
)
# Largest differences of one vehicle, as shares of the larger: of its tracks, of its wheelbases.
TRACKS, WHEELBASES = 0.25, 0.1
# Largest difference in height of an axle's wheel centres against the other axle: all the travel of
# a suspension, of one wheel against its bump stop and one hanging. A flat tyre is 0.1 m lower,
# tyres, springs and floors of a bay differ by millimetres.
TWIST_M = 0.2
# Of a trial's target from its wheel's centre: the radius of a lorry's wheel, with a bracket.
FAR_M = 0.6
# Of two scans of one target: components of their uncertainty by the noise of points alone; a
# difference of their centres beyond which they are no copies; probability of fits as near by
# chance; noise, of the largest, below which there is none.
OF_POINTS = ("plane noise", "centre noise", "point noise")
NEAR_M, BY_CHANCE, LEAST = 5e-4, 1e-7, 1e-3


def doubts_of(
    frame: VehicleFrame,
    centres: Array,
    measured: Sequence[Observation],
    known: Sequence[Vertical],
) -> list[Doubt]:
    """Return the notes of doubt on a vehicle and its trials.

    centres: (4, 3) of the reference wheels, the first four of `measured`. known: verticals.
    """
    return [
        *_upside_down(frame, measured, known),
        *_unlike_axles(frame, centres),
        *_far_from_their_wheel(measured, centres),
        *_copies(measured),
    ]


def floor_below(frame: VehicleFrame, references: Sequence[Observation]) -> Floor | None:
    """Return the floor beside the four wheels, against the frame's up, if their scans show it."""
    clouds = [one.cloud.points_m for one in references if one.cloud is not None]
    if not clouds:
        return None
    wheels = np.stack([one.fitted.centre_m for one in references])
    return fit_floor(frame.to_vehicle(np.concatenate(clouds)), frame.to_vehicle(wheels))


def _upside_down(
    frame: VehicleFrame, measured: Sequence[Observation], known: Sequence[Vertical]
) -> list[Doubt]:
    """Return a note where the vehicle is upside down, by the floor, else if z points up.

    A vertical that is known agrees with the frame's up, whatever the way of z. Without one, z alone
    shows wheels exchanged and mirrored scans, and none of it where it lies across the vehicle.
    """
    scanned = measured[0].fitted.method != "points"  # a five-point file has its own note
    if not scanned or known:
        return []
    names = ", ".join(REFERENCE_WHEELS)
    above = floor_below(replace(frame, up=-frame.up), measured[:4])
    if above is not None:
        return [Doubt(FLOOR_ABOVE, height=f"{above.depth_m:.2f}", names=names)]
    if frame.up[2] > MIN_UPRIGHT:
        return []
    sentence = UPSIDE_DOWN if frame.up[2] < -MIN_UPRIGHT else ACROSS
    return [Doubt(sentence, z=f"{round(frame.up[2], 2) + 0.0:+.2f}", names=names)]


def _unlike_axles(frame: VehicleFrame, centres: Array) -> list[Doubt]:
    """Return notes where the four centres are not those of a vehicle's two axles."""
    right_m, left_m = np.linalg.norm(centres[2:] - centres[:2], axis=1)
    pairs = (
        (frame.rear_track_m, frame.front_track_m, TRACKS, UNLIKE_TRACKS),
        (left_m, right_m, WHEELBASES, UNLIKE_WHEELBASES),
    )
    order = ", ".join(REFERENCE_WHEELS)
    notes = [
        Doubt(sentence, one=f"{one:.3f}", two=f"{other:.3f}", names=order)
        for one, other, most, sentence in pairs
        if abs(one - other) > most * max(one, other)
    ]
    _, _, height_m = np.abs(frame.to_vehicle(centres[3]) - frame.to_vehicle(centres[2]))
    if height_m > TWIST_M:
        angle = math.degrees(math.asin(height_m / frame.front_track_m))
        notes.append(Doubt(TWISTED, angle=f"{angle:.1f}", height=f"{height_m:.2f}"))
    return notes


def _far_from_their_wheel(measured: Sequence[Observation], centres: Array) -> list[Doubt]:
    """Return a note for every scan at another wheel than it is named for, or at none.

    On a trial alone, or on the vehicle: a scan of a sweep or a run-out moves wheels and axes.
    """
    notes: list[Doubt] = []
    for observation in measured[4:]:
        distance_m = np.linalg.norm(centres - observation.fitted.centre_m, axis=1)
        nearest = REFERENCE_WHEELS[int(np.argmin(distance_m))]
        is_trial = observation.role == "trial"
        known = {
            "trial" if is_trial else "scan": observation.name,
            "distance": f"{distance_m.min():.3f}",
            "nearest": nearest,
        }
        if observation.wheel in REFERENCE_WHEELS and observation.wheel != nearest:
            named_m = distance_m[REFERENCE_WHEELS.index(observation.wheel)]
            named = {"name": observation.wheel, "named": f"{named_m:.3f}"}
            sentence = FAR_FROM_WHEEL if is_trial else SCAN_FAR_FROM_WHEEL
            notes.append(Doubt(sentence, **known, **named))
        elif distance_m.min() > FAR_M:
            notes.append(Doubt(FAR_FROM_WHEELS if is_trial else SCAN_FAR_FROM_WHEELS, **known))
    return notes


def _copies(measured: Sequence[Observation]) -> list[Doubt]:
    """Return a note for every trial whose fit is that of an earlier scan but for rounding.

    Noise makes any two scans differ; a sweep or a run-out may use the reference scan once more.
    """
    notes: list[Doubt] = []
    seen: list[Observation] = []
    for observation in measured:
        if observation.role in ("reference", "trial") and observation.evidence is not None:
            first = next((one.name for one in seen if are_copies(one, observation)), None)
            seen.append(observation)
            if first is not None:
                notes.append(Doubt(COPIED, trial=observation.name, name=first))
    return notes


def check_positions(observations: Sequence[Observation], source: str) -> None:
    """Raise InputError for a scan of a sweep or a run-out that copies another of its wheel.

    A wheel that seems not to have moved has no run-out, and a sweep another axis. The reference
    scan may be one of them, but for a vehicle that has rolled: there it is the first position.
    """
    positions: dict[tuple[str, str | None], list[Observation]] = {}
    references = {one.wheel: one for one in observations if one.role == "reference"}
    for one in observations:
        if one.role not in ("sweep", "runout") or one.evidence is None:
            continue
        first = (
            [references[one.wheel]] if one.rolled is not None and one.wheel in references else []
        )
        before = positions.setdefault((one.role, one.wheel), first)
        copied = next((other.name for other in before if are_copies(other, one)), None)
        if copied is not None:
            raise InputError(
                f"{source}: {one.name} holds the same points as {copied}: it is a copy, which "
                f"shows no other position of {one.wheel}: check its file"
            )
        before.append(one)


def are_copies(one: Observation, other: Observation) -> bool:
    """Return whether two fits differ by less than the noise of their points ever makes two differ.

    A copy that was exported again has other digits, another order of points, or fewer around it.
    """
    first, second = one.fitted, other.fitted
    moved_m = second.centre_m - first.centre_m
    if not np.abs(moved_m).max() < NEAR_M:
        return False
    tilted = second.normal - np.sign(first.normal @ second.normal) * first.normal  # signs are free
    apart = np.concatenate([tilted, moved_m])
    if not apart.any():
        return True
    noise = [
        component.factor
        for fit in (first, second)
        for component in fit.components
        if component.name in OF_POINTS
    ]
    if not noise:
        return False
    factor = np.hstack(noise)
    parts, sizes, _ = np.linalg.svd(factor, full_matrices=False)
    shown = sizes > LEAST * sizes[0]  # five; none about the normal itself
    drawn = (parts.T @ apart)[shown] / sizes[shown]
    dof = int(np.count_nonzero(shown))
    return 1.0 - chi_square_beyond(float(drawn @ drawn), dof) < BY_CHANCE
