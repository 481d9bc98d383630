"""Run-out of a rim or a tyre: waves about its axis, lateral and radial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

HARMONICS = np.array([1.0, 2.0, 3.0])
SHARES = np.array([1.0, 0.5, 0.3])  # of the amplitudes, as drawn
TURNS = 720


@dataclass(frozen=True)
class Wave:
    """Deviation over the angle about the axis: sum of a cos(k angle - phase), metres."""

    order: Array
    amplitude_m: Array
    phase: Array

    def at(self, angle: Array) -> Array:
        """Return the deviation at angles of any shape."""
        turned = np.multiply.outer(angle, self.order) - self.phase
        return np.asarray(np.cos(turned) @ self.amplitude_m)

    @property
    def first(self) -> Array:
        """Cosine and sine amplitude (2,) of the first harmonic."""
        one = self.order == 1.0
        a, phase = self.amplitude_m[one], self.phase[one]
        return np.array([np.sum(a * np.cos(phase)), np.sum(a * np.sin(phase))])

    @property
    def beyond_first(self) -> Wave:
        """The wave without its first harmonic, which moves the whole as a rigid body."""
        more = self.order > 1.0
        return Wave(self.order[more], self.amplitude_m[more], self.phase[more])


def draw_wave(reading_m: float, rng: np.random.Generator) -> Wave:
    """Draw harmonics 1 to 3 whose highest and lowest deviation are `reading_m` apart."""
    phase = rng.uniform(0.0, 2.0 * np.pi, len(HARMONICS))
    amplitude = SHARES * rng.uniform(0.3, 1.0, len(HARMONICS))
    raw = Wave(HARMONICS, amplitude, phase)
    over = np.ptp(raw.at(2.0 * np.pi * np.arange(TURNS) / TURNS))
    return Wave(HARMONICS, amplitude * (reading_m / over), phase)
