"""All quantities of a vehicle by points, lines and planes in space: no frame, no angle formulas."""

import numpy as np

from wheelplane.vehicle.definitions import VEHICLE, WHEEL

AXES = ("rear-axle", "centreline", "thrust-line", "side-bisector")


def unit(vector):
    return vector / np.linalg.norm(vector)


def level(vector, up):
    """Its direction within the plane that `up` is normal to."""
    return unit(vector - (vector @ up) * up)


def turn(start, end, up):
    """Signed angle from one direction to another, > 0 to the right."""
    return np.arcsin(np.clip(np.cross(end, start) @ up, -1, 1))


def upwards(centres):
    """Normal to the rear axle and to the line from its middle to the front axle, square to it."""
    right, left, front_right, front_left = centres
    axle = left - right
    # Where (FR + s (FL - FR) - middle) is square to the axle: one linear equation for s.
    s = ((right + left) / 2 - front_right) @ axle / ((front_left - front_right) @ axle)
    ahead = front_right + s * (front_left - front_right) - (right + left) / 2
    return unit(np.cross(ahead, axle)), ahead


def axes(centres, normals, up, ahead):
    """Direction of each longitudinal axis; a wheel rolls along the level line in its plane."""
    right, left, front_right, front_left = centres
    rolls = [level(np.cross(n, up), up) for n in normals]
    rolls = [r if r @ ahead > 0 else -r for r in rolls]
    return {
        "rear-axle": unit(ahead),
        "centreline": level(front_left + front_right - left - right, up),
        "thrust-line": unit(rolls[0] + rolls[1]),
        "side-bisector": unit(level(front_left - left, up) + level(front_right - right, up)),
    }, rolls


def own_thrust_lines(rolls, wheels):
    """Directions of the thrust line with each wheel in its place, those of the front alike."""
    found = []
    for roll, wheel in zip(rolls, wheels, strict=True):
        right, left = rolls[:2]
        right, left = roll if wheel == "RR" else right, roll if wheel == "RL" else left
        found.append(unit(right + left))
    return found


def plain(centres, normals, wheels):
    """By name: of a wheel (W,), of the vehicle a number; radians and metres."""
    right, left, front_right, front_left = centres
    up, ahead = upwards(centres)
    direction, rolls = axes(centres, normals, up, ahead)
    side = np.array([1.0 if wheel.endswith("L") else -1.0 for wheel in wheels])
    outer = [n * np.sign(n @ (left - right)) * s for n, s in zip(normals, side, strict=True)]
    lean = np.array([np.linalg.norm(n - (n @ up) * up) for n in outer])
    found = {"camber": np.arctan([-(n @ up) / h for n, h in zip(outer, lean, strict=True)])}
    middle, front = (right + left) / 2, (front_right + front_left) / 2
    for axis in AXES:
        d = direction[axis]
        suffix = "" if axis == "rear-axle" else "_to_" + axis.replace("-", "_")
        own = [d] * len(wheels) if axis != "thrust-line" else own_thrust_lines(rolls, wheels)
        found["toe" + suffix] = side * [
            turn(a, roll, up) for a, roll in zip(own, rolls, strict=True)
        ]
        across = np.array([abs(n @ np.cross(a, up)) for a, n in zip(own, outer, strict=True)])
        found["camber_iso" + suffix] = np.arctan([-(n @ up) for n in outer] / across)
        found["thrust_angle" + suffix] = turn(d, direction["thrust-line"], up)
        found["front_setback" + suffix] = (front_left - front_right) @ d
        found["rear_setback" + suffix] = (left - right) @ d
        found["axle_offset" + suffix] = (front - middle) @ np.cross(d, up)
    toe, camber = found["toe"], found["camber"]
    steered = level(unit(rolls[2]) + unit(rolls[3]), up)
    sides = np.linalg.norm(front_left - left), np.linalg.norm(front_right - right)
    across = unit(np.cross(up, direction["centreline"]))  # to the left
    return found | {
        "rear_total_toe": toe[0] + toe[1],
        "front_total_toe": toe[2] + toe[3],
        "rear_cross_toe": toe[1] - toe[0],
        "front_cross_toe": toe[3] - toe[2],
        "rear_cross_camber": camber[1] - camber[0],
        "front_cross_camber": camber[3] - camber[2],
        "steer_ahead": turn(direction["thrust-line"], steered, up),
        "centreline_angle": turn(direction["rear-axle"], direction["centreline"], up),
        "side_bisector_angle": turn(direction["rear-axle"], direction["side-bisector"], up),
        "rear_squareness": turn(across, unit(left - right), up),
        "rear_track": np.linalg.norm(left - right),
        "front_track": np.linalg.norm(front_left - front_right),
        "wheelbase": np.linalg.norm(ahead),
        "wheelbase_left": sides[0],
        "wheelbase_right": sides[1],
        "wheelbase_difference": sides[0] - sides[1],
    }


def all_plain(centres, normals, wheels):
    """The same (Q,), in the order of the covariance."""
    found = plain(centres, normals, wheels)
    return np.concatenate(
        [*(found[entry.name] for entry in WHEEL), [found[entry.name] for entry in VEHICLE]]
    )
