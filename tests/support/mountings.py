"""Planted mountings of targets before real wheels, and how far a comparison finds them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.support.mixed import disc_file, write_mixed
from wheelplane.capture import open_capture
from wheelplane.config import Config
from wheelplane.validation import validate_mountings

NAMES = ("RR", "RL", "FR", "FL")
OFFSETS = ("toe", "camber", "stand_off", "forward", "upward")


def true_offsets(wheel: dict, frame: dict) -> dict[str, float]:
    """Offsets of a clamped target from its rim's own axis, from truth.json alone."""
    held, side = wheel["clamped_target"], 1.0 if wheel["wheel"].endswith("L") else -1.0
    left, forward, up = (np.array(frame[key]) for key in ("left", "forward", "up"))
    n, a = np.array(held["normal"]), np.array(wheel["rim_normal"])
    toes = [np.arctan2(one @ forward, side * (one @ left)) for one in (n, a)]
    cambers = [-np.arcsin(one @ up) for one in (n, a)]
    apart = np.subtract(held["centre_m"], wheel["rim_centre_m"])
    ahead = forward - (forward @ a) * a
    ahead /= np.linalg.norm(ahead)
    above = np.cross(a, ahead)
    above *= np.sign(above @ up)
    values = toes[0] - toes[1], cambers[0] - cambers[1], apart @ a, apart @ ahead, apart @ above
    return dict(zip(OFFSETS, map(float, values), strict=True))


def compared(folder: Path, seed: int, target: Path | None = None, **scan: object):
    """The comparison of one capture with a target before each wheel, and its true offsets."""
    files = folder / f"files-{seed}"
    files.mkdir(parents=True, exist_ok=True)
    own = dict.fromkeys(NAMES, target or disc_file(files))
    truth = write_mixed(folder / f"car-{seed}", own, seed=seed, **scan)
    with open_capture(folder / f"car-{seed}") as capture:
        found = validate_mountings(capture, Config())
    true = {w["name"]: true_offsets(w, truth["frame"]) for w in truth["wheels"]}
    return found, true
