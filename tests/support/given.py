"""Causes of uncertainty with given covariances, for tests that need no scan."""

import numpy as np

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
