"""Options that several commands share, and the values that they stand for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, get_args

import click

from ..capture import CaptureOptions, Upright
from ..config import load_station
from ..errors import InputError
from ..report.format.language import LANGUAGES
from ..report.format.view import ANGLE_STYLES
from ..units import Coordinates, LengthUnit, in_metres
from ..vehicle import AXES

if TYPE_CHECKING:
    from ..five_point import Station

monte_carlo_option = click.option(
    "--monte-carlo",
    "trials",
    type=click.IntRange(min=20_000),
    metavar="N",
    help="Check the uncertainties by at most N random trials (JCGM 101); 500000 settle them.",
)
tolerance_option = click.option(
    "--tolerance",
    metavar="NAME|FILE",
    help="Limits to judge by (TOML); `example` shows how they are written.",
)


def three_numbers(option: str, text: str) -> tuple[float, float, float]:
    """X,Y,Z of an option. Raises InputError that names it."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option} {text}: three numbers X,Y,Z are needed, such as 100,100,50")
    return x, y, z


plot_option = click.option(
    "--plot",
    metavar="DIR|-",
    help="Write all plots here as SVG and PNG; - draws the angles in the terminal.",
)
language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    help="Of the page, the PDF and the plots; else what the config says, or en.",
)


def language_and_plot(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --plot and --language to a command."""
    return plot_option(language_option(command))


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
    import numpy as np

    from ..five_point import Station

    stood = three_numbers("--station", place or "0,0,0")
    return Station(stated, np.array([in_metres(x, unit) for x in stood]))


VIEW_OPTIONS = (
    click.option(
        "--axis",
        type=click.Choice(AXES),
        default="rear-axle",
        show_default=True,
        help="Longitudinal axis that toe, setback and offset of the text are counted from.",
    ),
    click.option(
        "--angles",
        type=click.Choice(ANGLE_STYLES),
        default="dms",
        show_default=True,
        help="Angles of the text: deg-min-sec, degrees, mm/m, or toe in mm at the rim.",
    ),
    click.option(
        "--rim", metavar="DIAMETER", help="With --angles mm: the rim's, such as 16in or 406mm."
    ),
)


def view_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --axis, --angles and --rim to a command; `report.view.read_view` reads them."""
    for option in reversed(VIEW_OPTIONS):
        command = option(command)
    return command


CLOUD_OPTIONS = (
    click.option(
        "--front",
        metavar="X,Y,Z",
        help="Of one cloud of the whole vehicle: a direction that points roughly forward.",
    ),
    click.option(
        "--front-point",
        metavar="X,Y,Z",
        help="Instead: a point near the front, in the cloud's coordinates and unit.",
    ),
    click.option(
        "--up",
        type=click.Choice(get_args(Upright)),
        help="What tells up in it; auto, the default: floor and z, which must not disagree.",
    ),
)


def whole_vehicle_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --front, --front-point and --up to a command; `told` reads them."""
    for option in reversed(CLOUD_OPTIONS):
        command = option(command)
    return command


def told(
    front: str | None, front_point: str | None, up: Upright | None, unit: LengthUnit | None = None
) -> CaptureOptions:
    """What the options tell. Raises InputError that names the one which is no three numbers."""
    return CaptureOptions(
        length_unit=unit,
        front=None if front is None else three_numbers("--front", front),
        front_point=None if front_point is None else three_numbers("--front-point", front_point),
        up=up,
    )
