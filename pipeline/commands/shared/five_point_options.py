"""Options of a five-point file, and of the total station that observed it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, get_args

import click

from ...config import load_station
from ...errors import InputError
from ...units import LENGTH_UNITS, AngleUnit, Azimuth, Coordinates, LengthUnit, in_metres
from .options import Command, FiniteRange, added, option, three_numbers

if TYPE_CHECKING:
    from ...five_point import Station

five_point_unit_option = click.option(
    "--length-unit",
    type=click.Choice(LENGTH_UNITS),
    default="m",
    show_default=True,
    help="Length unit of the five-point file.",
)


def five_point_options(
    former_station: str | None = None, *, former_position: str | None = None
) -> Callable[[Command], Command]:
    """Add the options of a five-point file, and of the total station that observed it.

    former_station, former_position: the command's earlier names of the last two options.
    """
    options = (
        click.option(
            "--coordinates",
            type=click.Choice(get_args(Coordinates)),
            default="cartesian",
            show_default=True,
            help="Coordinates in the five-point file: x y z, or range azimuth zenith of a total "
            "station.",
        ),
        click.option(
            "--angle-unit",
            type=click.Choice(get_args(AngleUnit)),
            help="Unit of azimuth and zenith; required with spherical coordinates.",
        ),
        click.option(
            "--azimuth",
            type=click.Choice(get_args(Azimuth)),
            default="auto",
            show_default=True,
            help="Sense of the azimuths, seen from above; auto: the one that leaves the vehicle "
            "upright.",
        ),
        option(
            "--total-station",
            former=former_station,
            metavar="NAME|FILE",
            help="Total station, by name or file (TOML), whose stated uncertainty is used, such as "
            "leica-tm30.",
        ),
        option(
            "--total-station-position",
            former=former_position,
            metavar="X,Y,Z",
            help="Position of the total station, in the five-point file's coordinates and unit; "
            "the origin for spherical ones.",
        ),
    )
    return lambda command: added(options, command)


radius_option = click.option(
    "--radius",
    type=FiniteRange(min=1.0),
    metavar="MM",
    help="Radius of the circle through the five points of a target, which every block must have.",
)


def read_station(
    name: str | None, position: str | None, coordinates: Coordinates, unit: LengthUnit
) -> Station | None:
    """Return the total station of --total-station at its position; None where none is named.

    Raises InputError, ConfigError.
    """
    if name is None:
        if position is not None:
            raise InputError(
                "--total-station-position without --total-station: name the total station as well"
            )
        return None
    stated = load_station(name)
    if position is None and coordinates == "cartesian":
        raise InputError(
            "--total-station with cartesian coordinates: add --total-station-position X,Y,Z, "
            "since its errors depend on distance and direction"
        )
    import numpy as np

    from ...five_point import Station

    at = three_numbers("--total-station-position", position or "0,0,0")
    return Station(stated, np.array([in_metres(x, unit) for x in at]))
