"""Independent model of all quantities, for many vehicles at once.

It shares no formula with vehicle/, so that a comparison checks those formulas and their
derivatives. Directions in the plane of left and forward are complex numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..vectors import Array, Mask
from ..vehicle import VEHICLE, WHEEL

ComplexArray = npt.NDArray[np.complex128]


def independent_quantities(normals: Array, centres: Array, wheels: Sequence[str]) -> Array:
    """Return all quantities (T, Q) of normals and centres (T, W, 3), normals of either sense.

    One normal more than wheels is the vertical from which camber is measured.

    The point FR + a f of the front axle's line with (FR + a f - c_R) . r = 0, r the rear axle, is
    the foot of the wheelbase; up runs along foot x r.
    """
    r, f = centres[:, 1] - centres[:, 0], centres[:, 3] - centres[:, 2]
    middle = (centres[:, 1] + centres[:, 0]) / 2.0
    along = _dot(middle - centres[:, 2], r) / _dot(f, r)
    foot = centres[:, 2] + along[:, None] * f - middle
    up = np.cross(foot, r)
    rear_track, front_track, wheelbase = (np.sqrt(_dot(x, x)) for x in (r, f, foot))
    axes = np.stack([foot / wheelbase[:, None], r / rear_track[:, None], up], axis=2)
    axes[:, :, 2] /= np.sqrt(_dot(up, up))[:, None]
    left = np.array([wheel.endswith("L") for wheel in wheels])
    found = _of_wheels(normals[:, : len(wheels)] @ axes, left)
    if normals.shape[1] > len(wheels):
        found |= _from_vertical(normals[:, : len(wheels)], normals[:, -1], r, left, found["toe"])
    ahead, across, _ = np.moveaxis((centres[:, :4] - middle[:, None]) @ axes, 2, 0)
    found |= _of_vehicle(ahead + 1j * across, found)
    found |= _against_axes(ahead + 1j * across, found, wheels)
    found |= {"rear_track": rear_track, "front_track": front_track, "wheelbase": wheelbase}
    side_right, side_left = np.moveaxis(centres[:, 2:4] - centres[:, :2], 1, 0)
    found["wheelbase_left"] = np.sqrt(_dot(side_left, side_left))
    found["wheelbase_right"] = np.sqrt(_dot(side_right, side_right))
    found["wheelbase_difference"] = found["wheelbase_left"] - found["wheelbase_right"]
    names = [*(entry.name for entry in WHEEL), *(entry.name for entry in VEHICLE)]
    return np.column_stack([found[name] for name in names])


def _of_wheels(parts: Array, left: Mask) -> dict[str, Array]:
    """Return the angles (T, W) of nearly unit normals (T, W, 3): forward, left, up."""
    facing = np.where((parts[:, :, 1] > 0.0) == left, 1.0, -1.0)
    forward, out, up = parts[:, :, 0] * facing, np.abs(parts[:, :, 1]), parts[:, :, 2] * facing
    whole = np.sqrt(out**2 + forward**2 + up**2)
    return {
        "toe": np.angle(out + 1j * forward),
        "camber": -np.arcsin(up / whole),
        "camber_iso": -np.angle(out + 1j * up),
    }


def _from_vertical(
    normals: Array, vertical: Array, r: Array, left: Mask, toe: Array
) -> dict[str, Array]:
    """Return cambers (T, W) by the angle between a wheel's plane and the vertical (T, 3)."""
    facing = np.where((np.sum(normals * r[:, None], axis=2) > 0.0) == left, 1.0, -1.0)
    whole = np.linalg.norm(normals, axis=2) * np.linalg.norm(vertical, axis=1)[:, None]
    sine = facing * np.sum(normals * vertical[:, None], axis=2) / whole
    camber = np.arccos(sine) - np.pi / 2.0
    return {"camber": camber, "camber_iso": np.arctan(np.tan(camber) / np.cos(toe))}


def _of_vehicle(positions: ComplexArray, found: dict[str, Array]) -> dict[str, Array]:
    """Return angles between wheels and axes from positions (T, 4), forward + i left.

    Directions are complex units; the sum of two is their bisector. A wheel rolls along exp(-i toe)
    on the left, exp(+i toe) on the right.
    """
    toe, camber = found["toe"], found["camber"]
    rolls = np.exp(np.array([1j, -1j, 1j, -1j]) * toe[:, :4])
    thrust = rolls[:, 0] + rolls[:, 1]
    sides = positions[:, 2:] - positions[:, :2]
    side = sides / np.abs(sides)
    middles = positions[:, 2:].sum(axis=1)
    return {
        "rear_total_toe": np.angle(rolls[:, 0] / rolls[:, 1]),
        "front_total_toe": np.angle(rolls[:, 2] / rolls[:, 3]),
        "rear_cross_toe": -np.angle(rolls[:, 0] * rolls[:, 1]),
        "front_cross_toe": -np.angle(rolls[:, 2] * rolls[:, 3]),
        "rear_cross_camber": camber[:, 1] - camber[:, 0],
        "front_cross_camber": camber[:, 3] - camber[:, 2],
        "steer_ahead": np.angle(thrust / (rolls[:, 2] + rolls[:, 3])),
        "thrust_angle": -np.angle(thrust),
        "centreline_angle": -np.angle(middles),
        "rear_squareness": np.angle(middles),
        "side_bisector_angle": -np.angle(side.sum(axis=1)),
    }


def _against_axes(
    positions: ComplexArray, found: dict[str, Array], wheels: Sequence[str]
) -> dict[str, Array]:
    """Return quantities relative to each axis: all rotated so that the axis runs forward."""
    angles = {"thrust_line": found["thrust_angle"], "centreline": found["centreline_angle"]}
    angles |= {"side_bisector": found["side_bisector_angle"], "": np.zeros(len(positions))}
    slope = np.tan(found["camber"])
    side = np.array([-1.0 if wheel.endswith("L") else 1.0 for wheel in wheels])
    for name, angle in angles.items():
        suffix = f"_to_{name}" if name else ""
        local = positions * np.exp(1j * angle)[:, None]
        found[f"front_setback{suffix}"] = local[:, 3].real - local[:, 2].real
        found[f"rear_setback{suffix}"] = local[:, 1].real - local[:, 0].real
        found[f"axle_offset{suffix}"] = -local[:, 2:].imag.mean(axis=1)
        found[f"thrust_angle{suffix}"] = found["thrust_angle"] - angle
        if name:
            own = _own_thrust(found, wheels) if name == "thrust_line" else angle[:, None]
            toe = found["toe"] + side * own
            found[f"toe{suffix}"] = toe
            found[f"camber_iso{suffix}"] = np.arctan(slope / np.cos(toe))
    return found


def _own_thrust(found: dict[str, Array], wheels: Sequence[str]) -> Array:
    """Return the thrust angle (T, W) of each wheel's vehicle, a trial in its wheel's place."""
    columns = []
    for index, wheel in enumerate(wheels):
        rear = {"RR": 0, "RL": 1} | ({wheel: index} if wheel in ("RR", "RL") else {})
        toe_right, toe_left = found["toe"][:, rear["RR"]], found["toe"][:, rear["RL"]]
        columns.append(-np.angle(np.exp(1j * toe_right) + np.exp(-1j * toe_left)))
    return np.column_stack(columns)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=1))
