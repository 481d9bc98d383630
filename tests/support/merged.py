"""One plate scanned from several stations, whose clouds are put one behind the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tests.support.scenes import Cloud, Setup, make, rotation

Array = np.ndarray
STATIONS = (
    Setup(spacing_m=0.004, half_width_m=0.17, pairs=8),
    Setup(spacing_m=0.004, half_width_m=0.17, pairs=8, incidence_deg=35.0, azimuth_deg=200.0),
)
EXACT = np.zeros(3)


def merged(
    seed: int,
    setups: Sequence[Setup] = STATIONS,
    shift_m: Array = EXACT,
    tilt_rad: float = 0.0,
    of: int = 1,
) -> tuple[Cloud, list[int]]:
    """Return the cloud of all stations, and the numbers of their points.

    shift_m: in the target frame, and tilt_rad: error of the registration of station number `of`,
    about the target.
    """
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(rng), rng.uniform(-3.0, 3.0, 3)
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    off = np.array([[c, 0.0, s, 0.0], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, 0.0], [0, 0, 0, 1.0]])
    off[:3, 3] = shift_m
    clouds = [
        make(setup, rng, pose @ off if number == of else pose)
        for number, setup in enumerate(setups)
    ]
    points = np.concatenate([cloud.points_m for cloud in clouds])
    on_face = np.concatenate([cloud.on_face for cloud in clouds])
    truth = clouds[1 if of == 0 and len(clouds) > 1 else 0]
    return replace(truth, points_m=points, on_face=on_face), [len(x.points_m) for x in clouds]
