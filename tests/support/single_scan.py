"""One scan through the stages, without a capture around it."""

from __future__ import annotations

import math
from dataclasses import replace

from wheelplane.detection.find_target import find_target
from wheelplane.measure import fit_target
from wheelplane.uncertainty.type_b import with_type_b


def measure_scan(scan, target, config):
    """Plane and centre of the one target that a scan shows."""
    return fit_target(patch_of(scan, target, config), target, config)


def patch_of(scan, target, config):
    """The patch of the one target that a scan shows."""
    return find_target(scan.points_m, target, config.segment, config.seed, scan.intensity)


def with_stated(fitted, plane, target, instrument):
    """The fitted target with the type B components that target and instrument state."""
    sight_m = fitted.sight_m(instrument.distance_m, None, plane)
    stated = with_type_b(fitted.components, fitted.normal, sight_m, target, instrument)
    return replace(fitted, components=stated)


def u_turn_rad(fitted):
    """Standard uncertainty of the in-plane rotation; None where the target shows none."""
    if fitted.turn is None:
        return None
    turns = [component.turn for component in fitted.components if component.turn is not None]
    return math.sqrt(sum(float(turn @ turn) for turn in turns))
