"""What `measure` and `five-point` share: the options that check and judge, and the screen."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import click
import numpy as np

from ..capture import Told, Upright
from ..config import ReportConfig, load_station
from ..errors import InputError
from ..five_point import Station
from ..measurement import Conformity, Measurement
from ..report.format.laboratory import read_laboratory
from ..report.format.language import LANGUAGES, load_words
from ..report.format.view import ANGLE_STYLES, View
from ..report.html.page import Dress
from ..report.plots.angle_chart import angles_text
from ..report.plots.files import plot_files
from ..report.text.conformity import conformity_text
from ..report.text.report import extra_parts, summary_table
from ..report.text.vehicle import vehicle_lines
from ..report.write import write_files
from ..units import Coordinates, LengthUnit, in_metres
from ..vehicle import AXES

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


def show(measurement: Measurement, view: View, judged: Conformity | None) -> None:
    """Print the tables of a measurement, and its verdict where it was judged."""
    click.echo(summary_table(measurement, view))
    click.echo()
    click.echo(vehicle_lines(measurement, view))
    for part in extra_parts(measurement, view):
        click.echo(f"\n{part}")
    if judged:
        click.echo(f"\n{conformity_text(judged)}")


def three_numbers(option: str, text: str) -> tuple[float, float, float]:
    """X,Y,Z of an option. Raises InputError that names it."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option} {text}: three numbers X,Y,Z are needed, such as 100,100,50")
    return x, y, z


SCREEN = "-"
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


def dressed(config: ReportConfig, language: str | None, view: View) -> Dress:
    """The look of the reports. Raises ConfigError, InputError."""
    return Dress(load_words(language or config.language), view, read_laboratory(config))


def plot_to(
    plot: str | None, measurement: Measurement, judged: Conformity | None, dress: Dress
) -> list[Path]:
    """Write the plots; their folder, where one is named."""
    if plot is None or plot == SCREEN:
        return []
    write_files(Path(plot), plot_files(measurement, judged, dress.words, dress.view))
    return [Path(plot)]


def show_plot(
    plot: str | None, measurement: Measurement, judged: Conformity | None, dress: Dress
) -> None:
    """The angles on the terminal, where that is asked for."""
    if plot == SCREEN:
        click.echo(f"\n{angles_text(measurement, judged, dress.words, dress.view)}", nl=False)


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
) -> Told:
    """What the options tell. Raises InputError that names the one which is no three numbers."""
    return Told(
        length_unit=unit,
        front=None if front is None else three_numbers("--front", front),
        front_point=None if front_point is None else three_numbers("--front-point", front_point),
        up=up,
    )
