"""Range noise that is correlated from beam to beam, and that of single surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..arrays import Array, Mask
from ..scene.optics import DETOUR_M, STRAY_M, Optics
from .echoes import Echoes

APART = 6.0  # correlation lengths beyond which noise is uncorrelated: exp(-18)
REACH = 4.0  # correlation lengths of the smoothing kernel: exp(-16)


def gaussian_field(
    shape: tuple[int, int], length: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Draw a normal field (H, W) on a lattice, of variance 1 and correlation exp(-d^2 / (2 L^2)).

    length: L in steps of the lattice along either axis, above 0; d is counted in the same steps.
    White noise on a torus, large enough that its far side is uncorrelated, is multiplied by the
    square root of the covariance's spectrum; the covariance is exact to exp(-18).
    Source: circulant embedding, Dietrich and Newsam, SIAM J. Sci. Comput. 18 (1997) 1088.
    """
    height, width = shape
    down, across = (_root(n, L) for n, L in zip(shape, length, strict=True))
    white = np.fft.rfft2(rng.standard_normal((len(down), len(across))))
    half = across[: white.shape[1]]
    field = np.fft.irfft2(white * down[:, None] * half, s=(len(down), len(across)))
    return np.asarray(field[:height, :width])


def _root(count: int, length: float) -> Array:
    """Return the root of the spectrum along one axis: the torus is longer than `count` by 6 L."""
    size = count + math.ceil(APART * length)
    steps = np.arange(size) + size * np.arange(-1, 2)[:, None]
    covariance = np.exp(-0.5 * (steps / length) ** 2).sum(axis=0)
    spectrum = np.fft.fft(covariance).real.clip(min=0.0)
    root: Array = np.sqrt(spectrum * size / spectrum.sum())
    return root


def correlated_rows(
    white: Callable[[int], Array], rows: range, length: tuple[float, float], *, closed: bool
) -> Array:
    """Return rows (H, W) of a normal field of any height, of variance 1 and the same correlation.

    white: returns the unit normal noise of one row, from -REACH * length on: (W,) if the rows are
    closed to a ring, else (W + 2 * margin(length[1]),). White noise smoothed by exp(-d^2 / L^2) has
    the correlation exp(-d^2 / (2 L^2)), to 3e-5 where L is 1.5 steps or more, to 1.5 % at 1 step.
    """
    down, across = (_kernel(one) for one in length)
    above = margin(length[0])
    noise = np.stack([white(row) for row in range(rows.start - above, rows.stop + above)])
    width = noise.shape[1]
    ring = np.zeros(width)
    np.add.at(ring, np.arange(len(across)) % width, across)
    if len(across) > width:  # its ends overlap
        ring /= np.linalg.norm(ring)
    smooth = np.fft.irfft(np.fft.rfft(noise, axis=1) * np.fft.rfft(ring), n=width, axis=1)
    if not closed:
        smooth = smooth[:, len(across) - 1 :]
    return np.stack([down @ smooth[k : k + len(down)] for k in range(len(rows))])


def margin(length: float) -> int:
    """Return the half-width of the smoothing kernel in steps."""
    return math.ceil(REACH * length)


def _kernel(length: float) -> Array:
    steps = np.arange(-margin(length), margin(length) + 1)
    weight = np.exp(-((steps / length) ** 2))
    return np.asarray(weight / np.linalg.norm(weight))


def by_surfaces(
    echoes: Echoes, noise_m: Array, optics: Optics, rng: np.random.Generator
) -> tuple[Echoes, Array]:
    """Return echoes and range noise (N,) with the drop-outs and errors of their surfaces."""
    facet = echoes.facet
    met = facet >= 0
    count = len(facet)

    def chosen(share: Array) -> Mask:
        return np.asarray(met & (rng.random(count) < share[facet]))

    lost, stray, twice = (chosen(s) for s in (optics.dropout, optics.stray, optics.multipath))
    noise_m = np.where(met, noise_m * optics.noise[facet], noise_m)
    noise_m = noise_m + np.where(stray, rng.normal(0.0, STRAY_M, count), 0.0)
    noise_m += np.where(twice, rng.exponential(DETOUR_M, count), 0.0)
    return replace(echoes, range_m=np.where(lost, np.nan, echoes.range_m)), noise_m
