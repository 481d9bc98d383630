"""Cramer-Rao bound of a target's centre in its plane, with all nuisances, by mode and points.

.venv/bin/python -m tests.bench.bounds [--noise-mm 0.2] [--pointing-mm 0.05]
250 mm disc, 10 mm thick, 80 mm before a background, 15 degrees of incidence;
footprint of 1.5 mm. Mixed pixels: nuisances are plane, beams, footprint and its profile, thickness
(known to 3 %), brightness of the wall (2), chamfer (0 +- 0.3 mm), modulation of a phase-shift
scanner (0 +- 100 1/m^2), brightness and depth of the background by 24 sectors.
Clean edges: which side of the edge each beam fell on; nuisances are the beams, the edge's shift all
round, and the wall's width. Squares are left out: their bound for mixed pixels came out wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from scipy import stats

Array = np.ndarray
HALF_M, THICKNESS_M, BACKGROUND_M, SPOT_M = 0.125, 0.01, 0.08, 0.0015
RATIO, DISTANCE_M, SECTORS = 0.5, 2.5, 24
BEAM = np.array([np.tan(np.radians(15.0)), 0.0])
REACH_M = 0.02  # about the edge
QUADRATURE = 101
# Centre u v, rotation, plane (3), beam u v, 1/distance, log footprint, profile, log thickness,
# wall (2), chamfer, modulation, then brightness and depth of the background by sector.
CENTRE, ROTATION, PLANE, BEAMS, INVERSE, SPOT, PROFILE, THICKNESS = (
    slice(0, 2), 2, slice(3, 6), slice(6, 8), 8, 9, 10, 11,
)  # fmt: skip
WALL, CHAMFER, MODULATION, COMMON = slice(12, 14), 14, 15, 16
LIGHT, DEPTH = slice(COMMON, COMMON + SECTORS), slice(COMMON + SECTORS, COMMON + 2 * SECTORS)
LOGS = np.log([SPOT_M, THICKNESS_M, RATIO])
TRUTH = np.array(
    [*np.zeros(6), *BEAM, 1.0 / DISTANCE_M, LOGS[0], 0.5, LOGS[1], 0.0, 1.0, 0.0, 0.0]
    + [LOGS[2]] * SECTORS
    + [BACKGROUND_M] * SECTORS
)
THICKNESS_SIGMA = 0.03
KNOWN = np.array(
    [
        1.0,
        1.0,
        0.1,
        1.0,
        1.0,
        1.0,
        3.0,
        3.0,
        0.3,
        0.7,
        0.5,
        THICKNESS_SIGMA,
        0.5,
        0.5,
        0.0003,
        100.0,
    ]
    + [2.0] * SECTORS
    + [0.02] * SECTORS
)  # standard uncertainty beforehand

Edge = Callable[[Array], tuple[Array, Array]]


def disc(q_m: Array) -> tuple[Array, Array]:
    """Distance outside (N,) and outward normal (N, 2)."""
    far = np.hypot(*q_m.T)
    return far - HALF_M, q_m / np.maximum(far, 1e-9)[:, None]


SHAPES: dict[str, Edge] = {"disc": disc}


def beams(count: int, edge: Edge) -> Array:
    """Where beams meet the plane (N, 2), on a grid of that many on the target, near its edge."""
    area = np.pi * HALF_M**2
    spacing = np.sqrt(area / count)
    ticks = np.arange(-HALF_M - REACH_M, HALF_M + REACH_M, spacing) + 0.37 * spacing
    places = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    return places[np.abs(edge(places)[0]) < REACH_M]


def met(places: Array, depth: Array, state: Array, edge: Edge) -> tuple[Array, Array]:
    """Distance x outside the edge (N,) and normal of beams that were seen at a depth."""
    seen = places * (1.0 + depth / DISTANCE_M)[:, None] + depth[:, None] * BEAM
    shrink = 1.0 / (1.0 + state[INVERSE] * depth)
    q = (seen - state[CENTRE] - depth[:, None] * state[BEAMS]) * shrink[:, None]
    c, s = np.cos(state[ROTATION]), np.sin(state[ROTATION])
    return edge(q @ np.array([[c, -s], [s, c]]))


def density(u: Array, share: float) -> Array:
    disc_part = 2.0 / np.pi * np.sqrt(np.clip(1.0 - u * u, 0.0, None))
    return np.asarray((1.0 - share) * disc_part + share * stats.norm.pdf(u, scale=0.5))


def depths(places: Array, at_depth: Array, state: Array, edge: Edge) -> Array:
    """Mean depth (N,) over the footprint by strips, of beams that were seen at `at_depth`."""
    x, normal = met(places, at_depth, state, edge)
    tilt = -normal @ state[BEAMS]
    tau = np.maximum(tilt, 0.0)
    sector = np.arctan2(places[:, 1], places[:, 0]) / (2.0 * np.pi) % 1.0 * SECTORS
    sector = sector.astype(int) % SECTORS
    u = np.linspace(-2.0, 2.0, QUADRATURE)
    strip = density(u, state[PROFILE])
    there = x[:, None] + np.exp(state[SPOT]) * u
    width = (np.exp(state[THICKNESS]) * tau)[:, None]
    chamfer_m = state[CHAMFER]
    on_wall = np.clip(there / np.maximum(width, 1e-9), 0.0, 1.0)
    soft = np.exp(state[SPOT]) * (u[1] - u[0])  # one strip: derivatives need no steps

    def past(edge_m: Array | float) -> Array:
        return np.clip((there - edge_m) / soft + 0.5, 0.0, 1.0)

    off_face, off_chamfer, off_plate = past(-chamfer_m), past(chamfer_m * tau[:, None]), past(width)
    wall = (state[WALL][0] + state[WALL][1] * tau)[:, None]
    bevel = ((1.0 + tilt) / np.sqrt(2.0))[:, None]  # by Lambert's law
    light = strip * np.stack(
        [
            1.0 - off_face,
            bevel * (off_face - off_chamfer),
            wall * (off_chamfer - off_plate),
            np.exp(state[LIGHT][sector])[:, None] * off_plate,
        ]
    )
    zero = np.zeros_like(there)
    on_chamfer = np.clip((there + chamfer_m) / (1.0 + tau[:, None]), 0.0, max(chamfer_m, 0.0))
    deep = np.stack(
        [
            zero,
            on_chamfer,
            on_wall * np.exp(state[THICKNESS]),
            zero + state[DEPTH][sector][:, None],
        ]
    )
    lift = state[PLANE][0] + places @ state[PLANE][1:]
    total = np.sum(light, axis=(0, 2))
    mean = np.sum(light * deep, axis=(0, 2)) / total
    third = np.sum(light * (deep - mean[None, :, None]) ** 3, axis=(0, 2)) / total
    # to the first order of the modulation, of the phase of a sum of vectors
    return np.asarray(mean - state[MODULATION] * third / 6.0 + lift)


def mixed_bound_m(count: int, edge: Edge, noise_m: float, pointing_m: float) -> float:
    """Bound of the centre along the worse axis where pixels are mixed."""
    places = beams(count, edge)
    seen = depths(places, np.zeros(len(places)), TRUTH, edge)
    # depth and the place it is carried from depend on each other; at the truth they agree
    columns = []
    for index in range(len(TRUTH)):
        step = np.zeros(len(TRUTH))
        step[index] = 2e-6 if index in (0, 1, CHAMFER) else 1e-4
        ahead, behind = (depths(places, seen, TRUTH + s, edge) for s in (step, -step))
        columns.append((ahead - behind) / (2.0 * step[index]))
    slopes = np.stack(columns, axis=1)
    normal = met(places, seen, TRUTH, edge)[1]
    by_x = np.sum(slopes[:, CENTRE] * normal, axis=1)
    information = (slopes.T / (noise_m**2 + (by_x * pointing_m) ** 2)) @ slopes
    on_face = (HALF_M / 2.0) ** 2 * np.diag([0.0, 1.0, 1.0]) + np.diag([1.0, 0.0, 0.0])
    information[PLANE, PLANE] += count / noise_m**2 * on_face
    information += np.diag(KNOWN**-2.0)
    return _worst(information)


def clean_bound_m(count: int, edge: Edge, pointing_m: float) -> float:
    """Bound of the centre along the worse axis where each beam returns one surface.

    Of a beam that is x inside, P = Phi(x / pointing); the information of all over x is 1.81 /
    pointing per length of the edge and density of beams, half of it on each side. Where less than
    one beam falls within the pointing's noise of the edge, no estimator attains it: of 300 points
    the mean of all states that explain every side is 2.4 times as far off.
    """
    area = np.pi * HALF_M**2
    grid = np.linspace(-6.0, 6.0, 4001)
    chance = stats.norm.cdf(grid)
    total = np.trapezoid(stats.norm.pdf(grid) ** 2 / (chance * (1.0 - chance)), grid) / pointing_m
    angle = 2.0 * np.pi * (np.arange(720) + 0.5) / 720
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    places = HALF_M * way
    length = np.hypot(*np.diff(places, axis=0, append=places[:1]).T)
    normal = edge(places)[1]
    lever = normal[:, 1] * places[:, 0] - normal[:, 0] * places[:, 1]
    facing = np.maximum(-normal @ BEAM, 0.0)
    columns = []
    for depth in (0.0, BACKGROUND_M):
        zero = np.zeros(len(places))
        rows = [*normal.T, lever, *(normal * depth).T, HALF_M * depth + zero, facing, 1.0 + zero]
        columns.append(np.stack(rows, axis=1))
    information = np.zeros((8, 8))
    for slopes in columns:
        information += (slopes.T * length) @ slopes * (total / 2.0) * count / area
    information += np.diag(
        [1.0, 1.0, 100.0, 0.1, 0.1, 11.0, (THICKNESS_SIGMA * THICKNESS_M) ** -2, 1.0]
    )
    return _worst(information)


def _worst(information: Array) -> float:
    keep = np.delete(np.arange(len(information)), ROTATION)  # a disc shows none
    information = information[np.ix_(keep, keep)]
    scale = 1.0 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    return float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--noise-mm", type=float, default=0.2)
    parser.add_argument("--pointing-mm", type=float, default=0.05)
    options = parser.parse_args()
    noise_m, pointing_m = options.noise_mm * 1e-3, options.pointing_mm * 1e-3
    print("shape    points   mixed pixels   clean edges   (um, worse axis)")
    for name, edge in SHAPES.items():
        for count in (300, 3000, 30_000):
            mixed = mixed_bound_m(count, edge, noise_m, pointing_m) * 1e6
            clean = clean_bound_m(count, edge, pointing_m) * 1e6
            print(f"{name:8s} {count:6d} {mixed:14.1f} {clean:13.1f}", flush=True)


if __name__ == "__main__":
    main()
