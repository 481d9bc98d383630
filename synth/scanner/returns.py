"""Returns of one beam: its sub-rays parted by range, and the one that is reported."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Mask
from ..parameters.parameters import Beam


def reported_return(range_m: Array, power: Array, beam: Beam) -> Mask:
    """Return the sub-rays (N, K) of the return that each of N beams reports.

    range_m, power: (N, K) of the sub-rays; power, as it leaves the surfaces, is 0 without an echo.
    Two echoes less than the range gate apart, or joined by echoes between them, are one return: the
    pulse, or the ambiguity of its detection, is as long. What arrives of it falls with its range
    squared, as the intensity; it is detected if that reaches the threshold; where none does, all
    False.
    """
    met = power > 0.0
    order = np.argsort(np.where(met, range_m, np.inf), axis=1, kind="stable")
    sorted_m = np.take_along_axis(np.where(met, range_m, np.nan), order, axis=1)
    begins = np.zeros(met.shape, dtype=bool)
    begins[:, 1:] = np.diff(sorted_m, axis=1) >= beam.range_gate_m  # False beside NaN
    number = np.empty(met.shape, dtype=np.int64)
    np.put_along_axis(number, order, np.cumsum(begins, axis=1), axis=1)

    count = int(number.max()) + 1
    rows = np.arange(len(met))[:, None]
    powers = np.zeros((len(met), count))
    arrived = power / np.where(met, range_m, 1.0) ** 2
    np.add.at(powers, (np.broadcast_to(rows, met.shape), number), arrived)
    detected = (powers > 0.0) & (powers / met.shape[1] >= beam.detector_threshold)
    chosen = _chosen(detected, powers, beam.return_mode)
    return np.asarray(met & (number == chosen[:, None]) & detected.any(axis=1)[:, None])


def _chosen(detected: Mask, powers: Array, mode: str) -> Array:
    """Return the number (N,) of the chosen among the returns (N, M), in the order of range."""
    if mode == "first":
        return np.asarray(np.argmax(detected, axis=1))
    if mode == "last":
        return np.asarray(detected.shape[1] - 1 - np.argmax(detected[:, ::-1], axis=1))
    return np.asarray(np.argmax(np.where(detected, powers, -1.0), axis=1))
