"""The body of a car about its four wheels: sides, bonnet, windows, roof, and fittings.

All in vehicle coordinates; heights of profiles are above the floor. Panels are flat or bent in one
direction, and most of them are larger than any target.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..arrays import Array
from ..scene.solids import Solid, box, ellipsoid, ruled
from .shell import BELT_M, SIDES, Shell, shell_of
from .vehicle import Vehicle, Wheel

PAINT, GLASS, PLASTIC, DARK = 0.6, 0.05, 0.25, 0.15
SILL_M, ROOF_M = 0.24, 1.45
GAP_M = 0.005  # between doors
ROOF_INSET_M = 0.14


def body_solids(vehicle: Vehicle, wheels: Sequence[Wheel]) -> list[Solid]:
    """Build the car without its wheels; wheels: the four reference wheels."""
    shell = shell_of(vehicle, wheels)
    solids = [panel for side in SIDES for panel in _side(shell, side)]
    solids += _middle(shell) + _greenhouse(shell) + _fittings(shell)
    return solids + [_well(vehicle, wheel) for wheel in wheels]


def _side(shell: Shell, side: int) -> list[Solid]:
    """Build rear fender, two doors, front fender, from sill or wheel arch to the upper edge."""
    rear, front = shell.wheels_m[side][:, 0]
    reach = shell.arch_m + 0.04
    cuts = [shell.rear_m, rear + reach, (rear + front) / 2, front - reach, shell.front_m]
    spans = [(a + GAP_M / 2, b - GAP_M / 2) for a, b in pairwise(cuts)]
    solids = []
    for low, high in spans:
        x = np.union1d(np.linspace(low, high, 160), [low, high])
        for centre in shell.wheels_m[side]:
            arch = centre[0] + shell.arch_m * np.cos(np.linspace(0.0, np.pi, 180))
            x = np.union1d(x, arch[(arch > low) & (arch < high)])
        lower, upper = _lower_m(shell, side, x), shell.floor_m + shell.upper_m(x)
        y = shell.across_m(side, x)
        edge = np.column_stack([x, y, lower])
        solids.append(ruled(edge, np.column_stack([x, y, upper]), PAINT))
        solids.append(ruled(edge, edge - [0.0, side * 0.03, 0.0], PAINT))
    return solids


def _lower_m(shell: Shell, side: int, x_m: Array) -> Array:
    """Return the height (N,) of the sill, or of the wheel arch."""
    lower = np.full(len(x_m), shell.floor_m + SILL_M)
    for ahead, up in shell.wheels_m[side]:
        rise = up + np.sqrt(np.maximum(shell.arch_m**2 - (x_m - ahead) ** 2, 0.0))
        lower = np.where(np.abs(x_m - ahead) < shell.arch_m, np.maximum(lower, rise), lower)
    return lower


def _middle(shell: Shell) -> list[Solid]:
    """Build what spans the car from left to right: bumpers, boot lid, bonnet, floor."""
    rear, front, base = shell.rear_m, shell.front_m, shell.wheelbase_m
    bend = np.linspace(-1.0, 1.0, 25)
    bulge = 0.06 * (1.0 - bend**2)
    rear_bumper = np.column_stack([rear - bulge, 0.60 + 0.36 * bend])
    front_bumper = np.column_stack([front + bulge, 0.49 + 0.25 * bend])
    lid = np.array([[rear, 0.96], [-0.45, BELT_M]])
    along = np.linspace(0.0, 1.0, 30)
    hood = np.column_stack(
        [front + along * (base - 0.15 - front), 0.74 + 0.19 * along + 0.05 * along * (1 - along)]
    )
    under = np.array([[rear, SILL_M], [front, SILL_M]])
    return [_across(shell, line, PAINT) for line in (rear_bumper, lid, hood)] + [
        _across(shell, front_bumper, PLASTIC),
        _across(shell, under, DARK),
    ]


def _greenhouse(shell: Shell) -> list[Solid]:
    """Build windscreen, roof, rear window and side windows, inclined towards the roof."""
    base = shell.wheelbase_m
    belt = np.array([[-0.45, BELT_M], [base - 0.15, BELT_M]])
    roof = np.array([[0.15, ROOF_M], [base - 0.95, ROOF_M]])
    along = np.linspace(0.0, 1.0, 30)[:, None]
    crown = roof[0] + along * (roof[1] - roof[0]) + [0.0, 0.05] * (along * (1 - along))
    solids = [
        _across(shell, np.array([belt[1], roof[1]]), GLASS, inclined=True),
        _across(shell, np.array([belt[0], roof[0]]), GLASS, inclined=True),
        _across(shell, crown, PAINT, inclined=True),
    ]
    for side in SIDES:
        pillars = np.column_stack([belt[:, 0], shell.across_m(side, belt[:, 0])])
        one = np.column_stack([pillars, shell.floor_m + belt[:, 1]])
        inner = side * (shell.half_m[side] - ROOF_INSET_M)
        other = np.array([[x, inner, shell.floor_m + z] for x, z in roof])
        solids.append(ruled(one, other, GLASS))
    return solids


def _fittings(shell: Shell) -> list[Solid]:
    """Build mirrors, lamps, number plates, door handles."""
    floor, base = shell.floor_m, shell.wheelbase_m
    plates = [(shell.front_m + 0.055, 0.45), (shell.rear_m - 0.075, 0.62)]
    solids = [
        box((x, -0.26, floor + z - 0.055), (x + 0.02, 0.26, floor + z + 0.055), 0.8)
        for x, z in plates
    ]
    for side in SIDES:
        y = side * shell.half_m[side]
        mirror = (base - 0.45, y + side * 0.10, floor + 1.0)
        solids.append(ellipsoid(mirror, (0.06, 0.11, 0.075), PAINT))
        for x, z in ((shell.front_m - 0.02, 0.64), (shell.rear_m + 0.02, 0.82)):
            solids.append(ellipsoid((x, 0.75 * y, floor + z), (0.08, 0.16, 0.07), 0.5))
        for x in (base / 2 - 0.75, base / 2 + 0.15):
            low, high = sorted((y, y + side * 0.03))
            solids.append(box((x, low, floor + 0.80), (x + 0.17, high, floor + 0.83), PLASTIC))
    return solids


def _well(vehicle: Vehicle, wheel: Wheel) -> Solid:
    """Build the inner wall of a wheel arch, behind the tyre."""
    x, y, _ = wheel.centre_vehicle_m
    inner = abs(y) - wheel.stand_off_m - vehicle.body.tyre_width_m - 0.12
    low, high = sorted((wheel.side * inner, wheel.side * (inner - 0.01)))
    bottom = vehicle.floor_m + SILL_M - 0.05
    return box((x - 0.5, low, bottom), (x + 0.5, high, vehicle.floor_m + 0.72), DARK)


def _across(shell: Shell, line: Array, reflectance: float, *, inclined: bool = False) -> Solid:
    """Build a sheet from the left skin to the right along a profile (N, 2) of x and height.

    inclined: narrower from the belt to the roof.
    """
    share = np.clip((line[:, 1] - BELT_M) / (ROOF_M - BELT_M), 0.0, 1.0) * inclined
    edges = []
    for side in SIDES:
        y = shell.across_m(side, line[:, 0]) - side * ROOF_INSET_M * share
        edges.append(np.column_stack([line[:, 0], y, shell.floor_m + line[:, 1]]))
    return ruled(edges[0], edges[1], reflectance)
