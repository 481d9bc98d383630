"""Noise that is alike from beam to beam."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
APART = 6.0  # correlation lengths beyond which nothing is alike: exp(-18)


def gaussian_field(
    shape: tuple[int, int], length: tuple[float, float], rng: np.random.Generator
) -> Array:
    """A normal field (H, W) on a lattice, of variance 1 and correlation exp(-d^2 / (2 L^2)).

    length: L in steps of the lattice along either axis, above 0; d is counted in the same steps.
    White noise on a torus, so large that its far side is unlike, gets the square root of the
    covariance's spectrum; the covariance on the lattice is exact to rounding of exp(-18).
    Source: circulant embedding, Dietrich and Newsam, SIAM J. Sci. Comput. 18 (1997) 1088.
    """
    height, width = shape
    down, across = (_root(n, L) for n, L in zip(shape, length, strict=True))
    white = np.fft.rfft2(rng.standard_normal((len(down), len(across))))
    half = across[: white.shape[1]]
    field = np.fft.irfft2(white * down[:, None] * half, s=(len(down), len(across)))
    return np.asarray(field[:height, :width])


def _root(count: int, length: float) -> Array:
    """Square root of the spectrum along one axis: the torus is longer than `count` by 6 L."""
    around = count + math.ceil(APART * length)
    places = np.arange(around) + around * np.arange(-1, 2)[:, None]
    covariance = np.exp(-0.5 * (places / length) ** 2).sum(axis=0)
    spectrum = np.fft.fft(covariance).real.clip(min=0.0)
    root: Array = np.sqrt(spectrum * around / spectrum.sum())
    return root
