"""Scanned discs from definitions: beams from the origin, ranges that follow the brightness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wheelplane.plane import Patch

RADIUS_M, DISTANCE_M = 0.125, 3.0
EDGE_M = 0.002  # of the spot: about it brightness and depth are mixed
Shading = Callable[[np.ndarray, np.ndarray], np.ndarray]


def halves(angle_rad: float, offset: float = 0.0, dark: float = 0.15, bright: float = 0.8):
    """Dark on one side of a line `offset` radii from the centre."""

    def shade(u, v):
        across = u * np.cos(angle_rad) + v * np.sin(angle_rad)
        return np.where(across < offset * RADIUS_M, dark, bright)

    return shade


def checkerboard(side_m: float, dark: float = 0.15, bright: float = 0.8):
    """Squares from the centre on."""
    return lambda u, v: np.where((np.floor(u / side_m) + np.floor(v / side_m)) % 2, dark, bright)


def gradient(angle_rad: float, low: float = 0.3, high: float = 0.9):
    """A smooth trend from edge to edge."""

    def shade(u, v):
        share = 0.5 + (u * np.cos(angle_rad) + v * np.sin(angle_rad)) / (2.0 * RADIUS_M)
        return low + (high - low) * share

    return shade


def plain(u, v):
    """One brightness."""
    return np.full(u.shape, 0.6)


@dataclass(frozen=True)
class Disc:
    """One scan of a disc; lengths in metres.

    bias_m: range of the brightest points, less that of the darkest. speckle: relative noise of the
    intensities. bowl_m: depth of the middle under the edge. waves_m, wave_m: standard deviation and
    length of noise that is alike in neighbouring points. glints: share of points a hundred times as
    bright.
    """

    shade: Shading
    points: int = 3000
    bias_m: float = 0.0
    noise_m: float = 0.8e-3
    incidence_deg: float = 0.0
    speckle: float = 0.05
    bowl_m: float = 0.0
    waves_m: float = 0.0
    wave_m: float = 0.02
    glints: float = 0.0

    def scan(self, seed: int) -> tuple[Patch, np.ndarray]:
        """The patch and the true normal, towards the scanner."""
        rng = np.random.default_rng(seed)
        tilt, roll = np.radians(self.incidence_deg), rng.uniform(0.0, 2.0 * np.pi)
        normal = np.array([-np.cos(tilt), np.sin(tilt) * np.cos(roll), np.sin(tilt) * np.sin(roll)])
        u_axis = np.cross([0.0, 0.3, 1.0], normal)
        u_axis /= np.linalg.norm(u_axis)
        axes = np.stack([u_axis, np.cross(normal, u_axis), normal])
        centre = np.array([DISTANCE_M, 0.0, 0.0])
        count = int(self.points * (RADIUS_M / 0.113) ** 2)
        radius, angle = (
            RADIUS_M * np.sqrt(rng.uniform(0.0, 1.0, count)),
            rng.uniform(0.0, 2.0 * np.pi, count),
        )
        u, v = radius * np.cos(angle), radius * np.sin(angle)
        albedo = self.shade(u, v)
        height = self.bowl_m * (radius / RADIUS_M) ** 2
        place = centre + np.column_stack([u, v, height]) @ axes
        beam = place / np.linalg.norm(place, axis=1, keepdims=True)
        seen = albedo * np.abs(beam @ normal) / np.sum(place**2, axis=1) * DISTANCE_M**2
        over = np.ptp(albedo)
        share = (albedo - albedo.mean()) / over if over > 0.0 else np.zeros(count)
        error = self.bias_m * share + self.noise_m * rng.standard_normal(count)
        if self.waves_m > 0.0:
            error += self.waves_m * waves(u, v, self.wave_m, rng)
        mixed = radius > RADIUS_M - EDGE_M
        error += np.where(mixed, 0.05 * rng.uniform(0.0, 1.0, count), 0.0)
        seen = np.where(mixed, seen * rng.uniform(0.2, 1.0, count), seen)
        seen = seen * (1.0 + self.speckle * rng.standard_normal(count))
        seen = np.where(rng.uniform(size=count) < self.glints, 100.0 * seen, seen)
        points = place + beam * error[:, None]
        start = axes[2] + 1e-3 * rng.standard_normal(3)
        start /= np.linalg.norm(start)
        first = np.cross(axes[1], start)
        first /= np.linalg.norm(first)
        return Patch(
            origin_m=centre,
            face_m=points - centre,
            around_m=np.zeros((0, 3), np.float32),
            match=1.0,
            basis=np.stack([first, np.cross(start, first), start]),
            sigma_m=max(self.noise_m, 1e-4),
            face_intensity=seen.astype(np.float32),
        ), normal


def waves(u: np.ndarray, v: np.ndarray, length_m: float, rng: np.random.Generator) -> np.ndarray:
    """A random field of unit variance, correlation exp(-d^2 / (2 L^2)): a sum of 300 cosines."""
    direction = rng.standard_normal((2, 300)) / length_m
    phase = rng.uniform(0.0, 2.0 * np.pi, 300)
    return np.sqrt(2.0 / 300) * np.cos(np.column_stack([u, v]) @ direction + phase).sum(axis=1)
