"""A disc scanned by beams of many rays, of whose returns a scanner reports one, or their mean.

With its power.

Plane coordinates: the disc's face at depth 0, its wall down to the thickness, a background behind,
whose brightness is another on each side. The beams are parallel, as seen from afar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RAYS = 150
BACKGROUND_M = 0.12


@dataclass(frozen=True)
class PartedDisc:
    """Setup: slope (2,) of the beams per depth; bright and dark: background over the face.

    side_rad: direction of the bright half of the background, or, with parts, of the middle of one
    of so many bright sectors. printed: brightness of the face where its second coordinate is
    positive, over that of the rest. returned: strongest, first or last, or the mean of both,
    weighted by power; "unweighted": by the rays alone.
    """

    radius_m: float = 0.125
    thickness_m: float = 0.01
    centre_m: tuple[float, float] = (0.0015, -0.0008)
    slope: tuple[float, float] = (0.25, -0.1)
    spot_m: float = 0.003
    spacing_m: float = 0.002
    noise_m: float = 5e-4
    bright: float = 0.6
    dark: float = 0.08
    side_rad: float = 0.0
    returned: str = "strongest"
    speckle: float = 0.03
    lambert: float = 0.8
    parts: int = 0
    printed: float = 1.0

    def scan(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Points (N, 3), w towards the scanner, and their intensities (N,), of the face 1."""
        rng = np.random.default_rng(seed)
        steps = np.arange(-1.35, 1.35, self.spacing_m / self.radius_m) * self.radius_m
        feet = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        turn = rng.uniform(0.0, np.pi)
        feet = feet @ [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        feet = feet + self.spacing_m * rng.random(2)
        depth, power = self._returns(feet, rng)
        depth = depth + self.noise_m * rng.normal(size=len(feet))
        points = np.column_stack([feet + depth[:, None] * self.slope, -depth])
        return points, power * (1.0 + self.speckle * rng.normal(size=len(feet)))

    def _returns(self, feet, rng):
        """Depth and power of what is reported of beams that meet the plane at feet (N, 2)."""
        slope = np.array(self.slope)
        chance = (np.arange(RAYS) + 0.5) / RAYS
        reach = self.spot_m * np.sqrt(-np.log(1.0 - chance) / 2.0)  # exp(-2 r^2 / s^2)
        angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(RAYS)
        turned = angle + rng.uniform(0.0, 2.0 * np.pi, (len(feet), 1))
        ray = np.stack([reach * np.cos(turned), reach * np.sin(turned)], axis=-1)
        # Across the beam a circle; in the plane longer along the slope.
        size = np.hypot(*slope)
        along = slope / max(size, 1e-12)
        longer = np.sqrt(1.0 + size**2) - 1.0
        ray = ray + longer * (ray @ along)[..., None] * along
        # Rays beside the axis along the slope meet any depth that much later or earlier.
        later = -(ray @ slope) / (1.0 + size**2)
        q = feet[:, None, :] + ray - np.array(self.centre_m)
        face = np.hypot(q[..., 0], q[..., 1]) < self.radius_m
        b, c = q @ slope, np.sum(q**2, axis=-1) - self.radius_m**2
        root = b**2 - size**2 * c
        with np.errstate(invalid="ignore", divide="ignore"):
            met = c / (-b + np.sqrt(np.maximum(root, 0.0)))
        wall = ~face & (root > 0.0) & (b < 0.0) & (met < self.thickness_m)
        at = q + np.where(wall, met, 0.0)[..., None] * slope
        inward = np.maximum(-(at @ slope) / self.radius_m, 0.0)
        far = q + BACKGROUND_M * slope
        turn = np.arctan2(far[..., 1], far[..., 0]) - self.side_rad
        lit = np.cos(max(self.parts, 1) * turn) > 0.0
        behind = ~face & ~wall
        paint = np.where(q[..., 1] > 0.0, self.printed, 1.0)
        light = np.where(face, paint, np.where(wall, self.lambert * inward, 0.0))
        front = light.sum(axis=1) / RAYS
        echo = np.where(behind, np.where(lit, self.bright, self.dark), 0.0)
        back = echo.sum(axis=1) / RAYS
        depth = np.where(wall, met, 0.0) + later
        if self.returned in ("mean", "unweighted"):
            weight = light + echo if self.returned == "mean" else np.ones_like(light)
            depth = np.where(behind, BACKGROUND_M + later, depth)
            return np.sum(weight * depth, axis=1) / weight.sum(axis=1), front + back
        kept = {
            "strongest": front > back,
            "first": front > 0.01,
            "last": back < 0.01,
        }[self.returned]
        near = np.sum(light * depth, axis=1) / np.maximum(light.sum(axis=1), 1e-12)
        deep = np.sum(echo * (BACKGROUND_M + later), axis=1) / np.maximum(echo.sum(axis=1), 1e-12)
        return np.where(kept, near, deep), np.where(kept, front, back)
