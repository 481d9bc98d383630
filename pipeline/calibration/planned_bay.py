"""Reference of a calibration that is only planned: targets in a bay, as the files state them."""

from __future__ import annotations

import math

import numpy as np

from ..capture import Role
from ..centre import TargetFit
from ..config import Config
from ..measurement import Evidence, Observation, Provenance, align
from ..targets import Target, WheelTarget
from ..uncertainty import centre_component, plane_component, with_type_b
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .forms.item import Item
from .forms.plan_file import Plan
from .reference import Reference


def planned_reference(
    plan: Plan, item: Item, trials: int, target: Target, config: Config
) -> Reference:
    """Return the four wheels and trials of a plan, spread evenly over its ranges, as a reference.

    Toe and camber run through their ranges in opposite ways, and the trials over the wheels
    (`_wheels`). Noise is that of the scanner's file, independent from point to point; the centre is
    known as well as the spacing of the points shows an edge. Raises ValueError for what the files
    do not state, and for points too far apart for the target.
    """
    sigma_m = config.instrument.range_sigma_m
    if isinstance(target, WheelTarget):
        raise ValueError("a bare wheel's uncertainty shows in its scan only: plan with a target")
    if sigma_m is None:
        raise ValueError("the scanner's file states no range_sigma_m: add it to [instrument]")
    if plan.spacing is None:
        raise ValueError("plan.spacing is missing: add the spacing of the scan's points")
    count = len(REFERENCE_WHEELS) + trials
    wheels = [*REFERENCE_WHEELS, *_wheels(trials)]
    toes = _spread("toe", plan, item, trials)
    cambers = _spread("camber", plan, item, trials)
    observations = []
    for k, wheel in enumerate(wheels):
        camber = cambers[k] if k < 4 else cambers[count + 3 - k]
        fit = _target(plan, wheel, toes[k], camber, target, config, sigma_m)
        role: Role = "reference" if k < 4 else "trial"
        name = wheel if k < 4 else str(k - 3)
        observations.append(
            Observation(name, role, wheel, "plan", "", 0, 0, evidence=Evidence(fit))
        )
    return Reference(align(observations, Provenance("plan", None, "", {}, {}, 0)))


def _wheels(trials: int) -> list[str]:
    """Return the wheels of the trials: one after the other up to the middle, and back.

    Sides and angles are so uncorrelated, and either side has as many trials as the other, or one
    more: an error of the frame, of opposite sign left and right, is taken for no gain, and for
    little of a zero error. Of 2, 6, 10 ... trials both cannot be had; there the sides are alike.
    """
    order = [min(k, trials - 1 - k) for k in range(trials)]
    if trials % 4 == 2:
        order[trials // 2] += 1  # from right to left
    return [REFERENCE_WHEELS[k % 4] for k in order]


def _spread(kind: str, plan: Plan, item: Item, trials: int) -> list[float]:
    """Return the angles of four wheels, in the middle of the range, and of the trials in it."""
    if kind not in plan.quantities():
        return [0.0] * (4 + trials)
    ends = [plan.value(kind, end, item) for end in ("lower", "upper")]
    low, high = (0.0 if end is None else end for end in ends)
    return [*[(low + high) / 2.0] * 4, *np.linspace(low, high, trials).tolist()]


def _target(
    plan: Plan,
    wheel: str,
    toe: float,
    camber: float,
    target: Target,
    config: Config,
    sigma_m: float,
) -> TargetFit:
    side = 1.0 if wheel.endswith("L") else -1.0
    ahead = plan.length_m("wheelbase") if wheel.startswith("F") else 0.0
    centre = np.array([ahead, side * plan.length_m("track") / 2.0, 0.0])
    level = np.array([math.sin(toe), side * math.cos(toe), 0.0])
    normal = math.cos(camber) * level - math.sin(camber) * np.array([0.0, 0.0, 1.0])
    u = np.cross(normal, [0.0, 0.0, 1.0])
    u /= np.linalg.norm(u)
    basis = np.stack([u, np.cross(normal, u), normal])
    spacing = plan.length_m("spacing")
    plane = plane_component("plane noise", _plane(target, spacing, sigma_m), basis, np.zeros(3))
    edge = 2.0 * math.pi * target.radius_m / spacing
    own = spacing**2 / 12.0 * 2.0 / edge + config.centre.model_uncertainty_m**2
    known = (plane, centre_component("centre noise", own * np.eye(2), basis))
    sight = -config.instrument.distance_m * normal
    components = with_type_b(known, normal, sight, target, config.instrument)
    return TargetFit(centre, normal, components, sigma_m, 0, "outline")


def _plane(target: Target, spacing: float, sigma_m: float) -> Array:
    """Return the covariance (3, 3) of height and slopes of a plane through a grid of points.

    Raises ValueError where fewer than three points lie on the target, or all on a line.
    """
    reach = target.radius_m
    steps = np.arange(-reach, reach + spacing, spacing)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    inside = grid[target.region.holds(grid)]
    X = np.column_stack([np.ones(len(inside)), inside])
    if len(inside) < 3 or np.linalg.matrix_rank(X) < 3:
        raise ValueError(
            f"plan.spacing: of points {spacing * 1e3:g} mm apart {len(inside)} lie on the target "
            f"({2e3 * reach:g} mm), which show no plane: write a smaller spacing"
        )
    return np.asarray(sigma_m**2 * np.linalg.inv(X.T @ X))
