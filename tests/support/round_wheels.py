"""Clouds of round wheels in closed form: points about an axis over a known meridian, with noise."""

from __future__ import annotations

import numpy as np

from wheelplane.vectors import plane_basis

# Radius and height of the meridian: ledge, flange with its edge at 0, groove, side wall, tread.
MERIDIAN = np.array(
    [(0.196, -0.020), (0.215, -0.014), (0.226, -0.009), (0.229, -0.003), (0.232, -0.0004),
     (0.235, 0.0), (0.238, -0.0006), (0.240, -0.004), (0.242, -0.0075), (0.246, -0.003),
     (0.256, 0.006), (0.270, 0.010), (0.285, 0.011), (0.300, 0.006), (0.314, -0.006),
     (0.320, -0.020), (0.321, -0.060)]
)  # fmt: skip
EDGE_M, GROOVE_M = 0.235, 0.242


def axis_of(rng):
    """A random axis: centre and outward direction."""
    direction = rng.normal(size=3)
    return rng.uniform(-3.0, 3.0, 3), direction / np.linalg.norm(direction)


def about_axis(radius, angle, height, centre, direction):
    """Points (N, 3) at cylindrical coordinates about an axis."""
    basis = plane_basis(direction)
    across = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return centre + across @ basis[:2] + height[:, None] * basis[2]


def wheel_points(
    rng, centre, direction, count=60_000, noise_m=0.0008, wave_m=0.0, meridian=MERIDIAN
):
    """Points of a wheel, evenly over its surface, with isotropic noise.

    wave_m: amplitude of a lateral wave of two periods a turn. The hub is a flat disc.
    """
    steps = np.linalg.norm(np.diff(meridian, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = rng.random(4 * count) * along[-1]
    radius, height = (np.interp(at, along, column) for column in meridian.T)
    kept = np.flatnonzero(rng.random(4 * count) < radius / radius.max())[:count]
    angle = rng.uniform(0.0, 2.0 * np.pi, len(kept))
    height = height[kept] + wave_m * np.cos(2.0 * angle + 0.4)
    wheel = about_axis(radius[kept], angle, height, centre, direction)
    hub = about_axis(
        0.07 * np.sqrt(rng.random(count // 20)),
        rng.uniform(0.0, 2.0 * np.pi, count // 20),
        np.full(count // 20, -0.03),
        centre,
        direction,
    )
    points = np.concatenate([wheel, hub])
    return points + rng.normal(0.0, noise_m, points.shape)


def seen_from(rng, points, centre, direction, sight, meridian=MERIDIAN):
    """Those of the points that a scanner in the direction `sight` sees, as densely as it does."""
    local = points - centre
    height = local @ direction
    away = local - height[:, None] * direction
    radius = np.linalg.norm(away, axis=1)
    slope = np.interp(radius, meridian[:, 0], np.gradient(meridian[:, 1], meridian[:, 0]))
    normal = direction - slope[:, None] * away / radius[:, None]
    density = normal @ sight / np.linalg.norm(normal, axis=1)
    return points[density > rng.random(len(points))]


def door_points(rng, centre, direction, count=20_000):
    """Points of a flat panel beside the wheel, a little off square to its axis."""
    basis = plane_basis(direction)
    uv = rng.uniform(-0.8, 0.8, (count, 2))
    uv = uv[np.hypot(*uv.T) > 0.38]
    height = -0.04 + 0.03 * uv[:, 0]
    return centre + uv @ basis[:2] + height[:, None] * basis[2]


def angle_between(one, other):
    """Angle of two directions, sign free."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), abs(one @ other)))


def aside(point, centre, direction):
    """Distance of a point from an axis."""
    off = point - centre
    return float(np.linalg.norm(off - (off @ direction) * direction))


def vehicle_points(rng, centres, axes, count=30_000, noise_m=0.0008):
    """Points of wheels at centres with outward axes, of the panels above them, and of the floor."""
    wheels = [
        wheel_points(rng, np.array(centre), axis, count=count, noise_m=noise_m)
        for centre, axis in zip(centres, axes, strict=True)
    ]
    panels = []
    for x, y, z in centres:
        across = rng.uniform((-0.55, 0.38), (0.55, 0.6), (count // 4, 2))
        panels.append(
            np.column_stack([x + across[:, 0], np.full(len(across), 0.97 * y), z + across[:, 1]])
        )
    floor = rng.uniform((-3.0, -3.0), (5.5, 3.0), (5 * count, 2))
    points = np.concatenate([*wheels, *panels, np.column_stack([floor, np.zeros(len(floor))])])
    points = points[points[:, 2] > -0.001]
    points[:, 2] += rng.normal(0.0, noise_m, len(points))
    return points


def with_disc(rng, points, centre, axis, normal, off_m, noise_m=0.0005):
    """Points (N, 3) with a disc of 250 mm before the wheel at a centre, which hides the hub."""
    away = points - centre
    along = away @ axis
    behind = np.sqrt(np.sum(away**2, axis=1) - along**2) < 0.128
    kept = points[~(behind & (np.abs(along) < 0.3))]
    radius = 0.125 * np.sqrt(rng.random(15_000))
    angle = rng.uniform(0.0, 2.0 * np.pi, len(radius))
    face = about_axis(radius, angle, np.zeros(len(radius)), centre + off_m * axis, normal)
    return np.concatenate([kept, face + rng.normal(0.0, noise_m, face.shape)])
