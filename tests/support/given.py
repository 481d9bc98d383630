"""Causes of uncertainty with given covariances, for tests that need no scan."""

import numpy as np
from scipy.spatial.transform import Rotation

from wheelplane.uncertainty.components import UncertaintyComponent


def root(covariance):
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(values.clip(min=0.0))


def components(centre_m2, normal):
    """Of a covariance (3, 3) of the centre and one (3, 3) of the normal, independent."""
    none = np.zeros((3, 3))
    return (
        UncertaintyComponent("plane noise", np.vstack([root(normal), none])),
        UncertaintyComponent("centre noise", np.vstack([none, root(centre_m2)])),
    )


TILT_RAD = 0.7  # of a scanner on a table or a slope, and less than that of one on its side


def standing(pose: Rotation) -> Rotation:
    """A pose of a vehicle in a scanner's coordinates, tilted so that z is not far from up."""
    up = pose.apply([0.0, 0.0, 1.0])
    across = np.cross(up, [0.0, 0.0, 1.0])
    off = np.arctan2(np.linalg.norm(across), up[2])
    back = max(off - TILT_RAD, 0.0) / max(np.linalg.norm(across), 1e-12)
    return Rotation.from_rotvec(back * across) * pose
