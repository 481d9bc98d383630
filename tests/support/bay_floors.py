"""Scans of floor, pads and tyres about four wheels, by rays and formulas of their own."""

from __future__ import annotations

import numpy as np

WHEELS = np.array([[-0.75, 0.0], [0.75, 0.0], [-0.74, 2.65], [0.76, 2.64]])
SLOPES = np.array([0.002, -0.0035])
RADIUS, LOADED, WIDTH, STAND_OFF = 0.31, 0.30, 0.2, 0.06


def scanned(
    seed,
    pads=(0.0, 0.0, 0.0, 0.0),
    patches=(0.0, 0.0, 0.0, 0.0),
    waves=0.0,
    size=(0.4, 0.4),
    count=4000,
    noise=1.5e-3,
):
    """Scan the floor about each wheel from a station of its own; vehicle frame.

    pads: heights of the plates, `size` left and forward, on the floor beneath the wheels; patches:
    of the floor about each wheel; waves: rms of unevenness, 0.3 to 2.5 m long.

    Returns points (N, 3), wheels (4, 3), and the true slopes (2,) of the plane nearest to the four
    heights that the wheels stand on.
    """
    rng = np.random.default_rng([seed, 7])
    heading = rng.uniform(0.0, 2.0 * np.pi, 6)
    number = 2.0 * np.pi / rng.uniform(0.3, 2.5, 6)
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)

    def ground(x, y, patch):
        turned = [k * (x * np.cos(a) + y * np.sin(a)) + p
                  for k, a, p in zip(number, heading, phase, strict=True)]  # fmt: skip
        uneven = waves * np.sqrt(2.0 / 6.0) * np.sum(np.sin(turned), axis=0) if waves else 0.0
        return x * SLOPES[0] + y * SLOPES[1] + patch + uneven

    points, wheels, stands = [], [], []
    for (x, y), pad, patch in zip(WHEELS, pads, patches, strict=True):
        side = np.sign(x)
        middle = x - side * (STAND_OFF + WIDTH / 2.0)
        across, along = np.meshgrid(np.linspace(-0.1, 0.1, 7), np.linspace(-0.08, 0.08, 7))
        height = float(np.mean(ground(middle + across, y + along, patch))) + pad
        stands.append([middle, y, height])
        wheels.append([x, y, height + LOADED])
        out, ahead, up = rng.uniform((1.8, -0.8, 0.6), (3.0, 0.8, 1.3))
        station = np.array([x + side * out, y + ahead, height + up])
        aim = [x, y, height + 0.2] - station
        reach = np.linalg.norm(aim)
        right = np.cross(aim, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        aside = rng.uniform(-0.7, 0.7, (count, 2))
        rays = aim + aside[:, :1] * right + aside[:, 1:] * np.cross(right, aim / reach)
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        z = np.full(count, height)
        for _ in range(6):
            r = (z - station[2]) / rays[:, 2]
            z = ground(station[0] + r * rays[:, 0], station[1] + r * rays[:, 1], patch)
        nearest = np.where(r > 0.0, r, np.inf)
        if pad:
            upright = np.array([*-SLOPES, 1.0])
            r = (([middle, y, height] - station) @ upright) / (rays @ upright)
            on = station + r[:, None] * rays
            inside = (r > 0) & (np.abs(on[:, 0] - middle) < size[0] / 2)
            inside &= np.abs(on[:, 1] - y) < size[1] / 2
            nearest = np.where(inside, np.minimum(r, nearest), nearest)
            r = (middle + side * size[0] / 2 - station[0]) / rays[:, 0]
            on = station + r[:, None] * rays
            wall = (r > 0) & (np.abs(on[:, 1] - y) < size[1] / 2) & (on[:, 2] < height)
            wall &= on[:, 2] > height - pad
            nearest = np.where(wall, np.minimum(r, nearest), nearest)
        r = (x - side * STAND_OFF - station[0]) / rays[:, 0]
        on = station + r[:, None] * rays - [0.0, y, height + LOADED]
        sidewall = (r > 0) & (np.hypot(on[:, 1], on[:, 2]) < RADIUS)
        nearest = np.where(sidewall, np.minimum(r, nearest), nearest)
        nearest += noise * rng.standard_normal(count)
        seen = nearest < 6.0
        points.append(station + nearest[seen, None] * rays[seen])
    stands = np.array(stands)
    slopes = np.linalg.lstsq(np.column_stack([np.ones(4), stands[:, :2]]), stands[:, 2], rcond=None)
    return (
        np.concatenate(points) - [0.0, 0.0, LOADED],
        np.array(wheels) - [0.0, 0.0, LOADED],
        slopes[0][1:],
    )
