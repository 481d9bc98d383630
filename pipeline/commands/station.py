"""The total station of five-point files, as options tell it."""

from __future__ import annotations

import numpy as np

from pipeline.commands.judging import three_numbers
from pipeline.config import load_station
from pipeline.errors import InputError
from pipeline.five_point_file import Coordinates, LengthUnit
from pipeline.point_causes import Station
from pipeline.units import in_metres


def read_station(
    option: str, name: str | None, place: str | None, coordinates: Coordinates, unit: LengthUnit
) -> Station | None:
    """The total station that `option` names, at the --station `place`; None where none is named."""
    if name is None:
        if place is not None:
            raise InputError(f"--station without {option}: name the total station as well")
        return None
    stated = load_station(name)
    if place is None and coordinates == "cartesian":
        raise InputError(
            f"{option} with cartesian coordinates: add --station X,Y,Z, where the total station "
            "stood, since its errors depend on the distance and the direction"
        )
    stood = three_numbers("--station", place or "0,0,0")
    return Station(stated, np.array([in_metres(x, unit) for x in stood]))
