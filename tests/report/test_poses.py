"""Every angle and u of measurement.json worked out again from its `poses` alone.

Definitions are those of ISO 8855 and the paper, by vectors; derivatives are central differences.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.kinematics.test_runout import ECCENTRIC, HALF, WOBBLE, all_round
from tests.measurement.test_verticals import measured, scene
from tests.support.turning import WHEELS, Scene, mounted, rolled
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.report.json.measurement import to_json

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
STEP = 1e-5


def unit(vector):
    return vector / np.linalg.norm(vector)


def quantities(normals, centres, wheels):
    """By name, radians and metres; wheels: names, the first four RR, RL, FR, FL.

    One normal more than wheels is the vertical.
    """
    rr, rl, fr, fl = centres[:4]
    left, front = unit(rl - rr), unit(fl - fr)
    rear_middle, front_middle = (rr + rl) / 2, (fr + fl) / 2
    # the point of the front axle's line that lies square to the rear axle's middle
    ahead = front_middle - front * ((front_middle - rear_middle) @ left) / (front @ left)
    forward = unit(ahead - rear_middle)
    up = np.cross(forward, left)
    vertical = unit(normals[-1]) if len(normals) > len(wheels) else up
    found = {}
    for i, (name, wheel) in enumerate(wheels):
        n = normals[i]
        outward = left if wheel.endswith("L") else -left
        found[f"{name}.toe"] = np.arctan((n @ forward) / (n @ outward))
        camber = -np.arcsin(n @ vertical / np.linalg.norm(n))
        found[f"{name}.camber"] = camber
        found[f"{name}.camber_iso"] = np.arctan(np.tan(camber) / np.cos(found[f"{name}.toe"]))
    toe = [found[f"{name}.toe"] for name, _ in wheels[:4]]
    camber = [found[f"{name}.camber"] for name, _ in wheels[:4]]
    left_side, right_side = fl - rl, fr - rr
    return found | {
        "rear_total_toe": toe[0] + toe[1],
        "front_total_toe": toe[2] + toe[3],
        "thrust_angle": (toe[1] - toe[0]) / 2,
        "rear_cross_camber": camber[1] - camber[0],
        "front_cross_camber": camber[3] - camber[2],
        "rear_track": np.linalg.norm(rl - rr),
        "front_track": np.linalg.norm(fl - fr),
        "wheelbase": np.linalg.norm(ahead - rear_middle),
        "wheelbase_difference": np.linalg.norm(left_side) - np.linalg.norm(right_side),
        "front_setback": (fl - fr) @ forward,
    }


def recomputed(poses, vertical=None):
    """Values, u and degrees of freedom by name; vertical: the one in use, of `verticals`."""
    components = list(poses["components"])
    wheels = [(entry["name"], entry["wheel"]) for entry in poses["wheels"]]
    x = np.array([[entry["normal"], entry["centre_m"]] for entry in poses["wheels"]])
    names = [name for name, _ in wheels]
    if vertical is not None:
        x = np.concatenate([x, [[vertical["direction"], [0.0] * 3]]])
        names.append("vertical")
        components += [
            component | {"acts_on": [{"name": "vertical", "factor": component["factor"]}]}
            for component in vertical["components"]
        ]

    def at(change):
        moved = x + change.reshape(x.shape)
        found = quantities(moved[:, 0], moved[:, 1], wheels)
        return np.array(list(found.values()))

    steps = STEP * np.eye(x.size)
    J = np.stack([(at(step) - at(-step)) / (2 * STEP) for step in steps], axis=1)
    total, by_estimate = 0.0, {}
    for index, component in enumerate(components):
        columns = len(component["acts_on"][0]["factor"][0])
        F = np.zeros((x.size, columns))
        for part in component["acts_on"]:
            place, rows = 6 * names.index(part["name"]), part["factor"][:6]
            F[place : place + len(rows)] = rows
        variance = np.sum((J @ F) ** 2, axis=1)
        total = total + variance
        dof = component["degrees_of_freedom"] or np.inf
        key = component["name"] if component["pooled"] else index
        by_estimate[key] = (by_estimate.get(key, (0.0, dof))[0] + variance, dof)
    fourths = sum(v**2 / dof for v, dof in by_estimate.values())
    with np.errstate(divide="ignore"):
        dofs = np.where(fourths > 0, total**2 / fourths, np.inf)
    names = list(quantities(x[:, 0], x[:, 1], wheels))
    return dict(zip(names, zip(at(0 * x), np.sqrt(total), dofs, strict=True), strict=True))


def agrees(one, other):
    return one == pytest.approx(other, rel=1e-6, abs=1e-9)


def check(measured):
    """Compare all that a file prints with what follows from its poses."""
    tree = json.loads(to_json(measured))
    used = tree["vertical_in_use"]
    vertical = next((one for one in tree["verticals"] if one["kind"] == used), None)
    known = recomputed(tree["poses"]["evaluated"], vertical)
    printed = {entry["quantity"]: entry for entry in tree["uncertainty"]}
    assert known.keys() <= printed.keys()
    for name, (value, u, dof) in known.items():
        entry = printed[name]
        scale = np.degrees(1.0) if entry["unit"] == "deg" else 1.0
        assert agrees(value * scale, entry["value"]), name
        assert u * scale == pytest.approx(entry["u"], rel=1e-6), name
        inverse = 1.0 / (entry["degrees_of_freedom"] or np.inf)
        assert 1.0 / dof == pytest.approx(inverse, rel=1e-5, abs=1e-12), name
    mounted_as = recomputed(tree["poses"]["as_mounted"] or tree["poses"]["evaluated"], vertical)
    for wheel in tree["wheels"]:
        for angle in ("toe", "camber", "camber_iso"):
            for prefix, results in (("", known), ("plate_", mounted_as)):
                if wheel["toe_deg"] is None:
                    continue
                value, u, _ = results[f"{wheel['name']}.{angle}"]
                assert agrees(np.degrees(value), wheel[f"{prefix}{angle}_deg"])
                assert np.degrees(u) == pytest.approx(wheel[f"u_{prefix}{angle}_deg"], rel=1e-6)
    return tree


def test_the_papers_five_points():
    tree = check(measure_five_point(read_five_point(FIGURE_4)))
    assert tree["poses"]["as_mounted"] is None
    assert any(component["pooled"] for component in tree["poses"]["evaluated"]["components"])


def test_run_outs_of_all_wheels_and_of_one():
    every = all_round(10, 1.0, ECCENTRIC).measure()
    plate = {"wobble": WOBBLE, "eccentric_m": ECCENTRIC[0]}
    one = rolled(mounted(Scene(4).references(), "FL", **plate), "FL", HALF, **plate).measure()
    assert [w.compensated for w in one.wheels[:4]] == [False, False, False, True]
    for result in (every, one):
        tree = check(result)
        mounted_as = tree["poses"]["as_mounted"]
        for entry, wheel in zip(mounted_as["wheels"], tree["wheels"], strict=True):
            assert entry["centre_m"] == wheel["plate_centre_m"]
            assert entry["normal"] == pytest.approx(wheel["plate_normal"], abs=1e-15)
            stated = wheel["role"] == "runout"
            assert (entry["stated_rotation_deg"] is not None) == stated


@pytest.mark.parametrize("rolls", [(), ("FL",), WHEELS])
def test_from_gravity(rolls):
    tree = check(measured(scene(6, rolls=rolls)))
    assert tree["vertical_in_use"] == "gravity"


def test_a_plate_that_shows_its_rotation_states_it_with_its_covariance():
    scene = Scene(5, u_turn=7.5e-5, with_centre=0.6)
    plate = {"wobble": WOBBLE, "eccentric_m": ECCENTRIC[0]}
    tree = check(rolled(mounted(scene.references(), "FL", **plate), "FL", HALF, **plate).measure())
    poses = tree["poses"]["as_mounted"]
    (F,) = (
        np.array(part["factor"])
        for component in poses["components"]
        for part in component["acts_on"]
        if (component["name"], part["name"]) == ("centre noise", "FL turn 1")
    )
    entry = next(entry for entry in poses["wheels"] if entry["name"] == "FL turn 1")
    V = F @ F.T
    assert V.shape == (7, 7)
    assert np.sqrt(V[6, 6]) == pytest.approx(7.5e-5, rel=1e-6)
    correlation = np.linalg.norm(V[3:6, 6]) / np.sqrt(np.trace(V[3:6, 3:6]) / 3 * V[6, 6])
    assert correlation == pytest.approx(0.6, rel=1e-6)
    assert np.dot(entry["in_plane_axis"], entry["normal"]) == pytest.approx(0.0, abs=1e-12)
    assert entry["in_plane_period_deg"] == pytest.approx(90.0)
