"""From five points a wheel to angles with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import __version__
from ..measurement import Measurement, Observation, Provenance, align
from .check_blocks import check_blocks, check_radius
from .components import Station, check_station
from .file import FivePointFile
from .observe import copied_blocks, observe_block, pooled_noise


def measure_five_point(
    file: FivePointFile,
    station: Station | None = None,
    radius_m: float | None = None,
    *,
    check: bool = True,
) -> Measurement:
    """Measure the same quantities from five points a plane, by total least squares.

    station: total station whose stated uncertainty is used; without it, the points' scatter.
    radius_m: of the circle that the five points of every block lie on, if it is known. check:
    whether a block that is not plausible gets a status, and adds nothing to the noise of the
    others; a copy of a block adds nothing in any case. Raises InputError where it is a reference
    wheel's, and not because of a single point; and for a station at a point, or out of sight.
    """
    if station is not None:
        check_station(file.blocks_m, station, file.source)
    if radius_m is not None:
        check_radius(file.blocks_m, radius_m, file.source)
    checks = check_blocks(file.blocks_m, station, radius_m) if check else ()
    bad = [index for index, one in enumerate(checks) if one.status != "ok"]
    bad += copied_blocks(file.blocks_m)
    noise = pooled_noise(np.delete(file.blocks_m, bad, axis=0), station)
    observations = [
        observe_block(file, index, noise, station, checks[index] if checks else None)
        for index in range(len(file.blocks_m))
    ]
    origin = provenance_of(file, observations, station, radius_m)
    return align(observations, origin, file.notes)


def provenance_of(
    file: FivePointFile,
    observations: Sequence[Observation],
    station: Station | None,
    radius_m: float | None = None,
) -> Provenance:
    """Return the input and the method of a measurement from five points a plane."""
    inputs = {observation.source: observation.sha256 for observation in observations}
    used: dict[str, Any] = {"method": "total-least-squares"}
    if station is not None:
        used |= {"station": station.stated.model_dump(), "place_m": station.position_m.tolist()}
    if radius_m is not None:
        used |= {"radius_m": radius_m}
    return Provenance(file.source, None, __version__, inputs, used, 0)
