"""Options that several commands share, and the values that they stand for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click
from click.core import ParameterSource

from ..capture import CaptureOptions, Upright
from ..config import load_station
from ..errors import InputError
from ..measurement import VerticalKind
from ..readers import AS_THE_FILE_SAYS, ReadOptions
from ..report.format.language import LANGUAGES
from ..report.format.view import ANGLE_STYLES, CONVENTIONS, DIGIT_STYLES, Convention, axis_by
from ..units import LENGTH_UNITS, AngleUnit, Azimuth, Coordinates, LengthUnit, in_metres
from ..vehicle import AXES, Axis

if TYPE_CHECKING:
    from ..five_point import Station

Command = Callable[..., Any]


class FiniteRange(click.FloatRange):
    """Number in a range, neither infinite nor NaN."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number of an argument."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is no finite number.", param, ctx)
        return number


class RenamedOption(click.Option):
    """Option that accepts its former name as well, which help does not show."""

    def __init__(self, *args: Any, former: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.former = former

    def add_to_parser(self, parser: Any, ctx: click.Context) -> None:
        """Register both names; the former one has a destination of its own."""
        super().add_to_parser(parser, ctx)
        parser.add_option(obj=self, opts=[self.former], dest=self.former, action="store")

    def handle_parse_result(
        self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]
    ) -> tuple[Any, list[str]]:
        """Take the value from either name. Raises UsageError where both are given."""
        if self.former in opts:
            if self.name in opts:
                raise click.UsageError(
                    f"{self.former} is the former name of {self.opts[0]}: give {self.opts[0]} only",
                    ctx,
                )
            opts = {**opts, str(self.name): opts[self.former]}
        return super().handle_parse_result(ctx, opts, args)


def option(name: str, *declarations: str, former: str | None = None, **settings: Any) -> Command:
    """Return click's decorator of an option, with the former name of it where it has one."""
    if former is None:
        return click.option(name, *declarations, **settings)
    return click.option(name, *declarations, cls=RenamedOption, former=former, **settings)


def added(options: Sequence[Command], command: Command) -> Command:
    """Add options to a command, in the order in which help shows them."""
    for one in reversed(options):
        command = one(command)
    return command


target_option = click.option(
    "--target",
    metavar="NAME|FILE",
    help="Target on the wheels, by name (see `targets`) or file (TOML), such as disc-250; "
    "disc-250,FR=wheel,FL=wheel where single wheels have another.",
)
scanner_option = click.option(
    "--scanner",
    metavar="NAME|FILE",
    help="Scanner file (TOML) with its stated uncertainty.",
)
config_option = click.option(
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Configuration file (TOML): settings other than the defaults, and who issues the report.",
)
length_unit_option = click.option(
    "--length-unit",
    type=click.Choice(LENGTH_UNITS),
    help="Length unit of the coordinates; by default that of capture.toml, or m.",
)
READING_OPTIONS = (
    click.option(
        "--columns",
        metavar="NAMES",
        help="Names of the columns of text scans, in order, such as row,col,x,y,z,i; - for one "
        "that is not needed.",
    ),
    click.option(
        "--pitch",
        metavar="DX,DY",
        help="Scans that are matrices of heights: step of x from column to column and of y from "
        "row to row, in the unit of the heights.",
    ),
)


def reading_options(command: Command) -> Command:
    """Add --columns and --pitch to a command; `read_options` reads them."""
    return added(READING_OPTIONS, command)


def read_options(columns: str | None, pitch: str | None) -> ReadOptions:
    """Return what the command line states of scans. Raises InputError that names the option."""
    names = None if columns is None else tuple(name.strip() for name in columns.split(","))
    steps = None
    if pitch is not None:
        try:
            dx, dy = (float(part) for part in pitch.split(","))
        except ValueError:
            raise InputError(
                f"--pitch {pitch}: two numbers DX,DY are needed, such as 0.05,0.1"
            ) from None
        steps = dx, dy
    given = " ".join(
        f"{name} {text}" for name, text in (("--columns", columns), ("--pitch", pitch)) if text
    )
    try:
        return ReadOptions(names, steps)
    except ValueError as error:
        raise InputError(f"{given}: {error}") from error


monte_carlo_option = click.option(
    "--monte-carlo",
    "max_draws",
    type=click.IntRange(min=20_000),
    metavar="N",
    help="Number of Monte Carlo draws, at most, to check the uncertainties with (JCGM 101); "
    "500000 are enough, 2000000 where u has few degrees of freedom.",
)
vertical_option = click.option(
    "--vertical",
    type=click.Choice(get_args(VerticalKind)),
    default="wheels",
    show_default=True,
    help="Direction from which camber, caster and SAI are measured: the normal to the plane of the "
    "wheel centres, the normal of the floor in the scans or in capture.toml, or gravity in "
    "capture.toml.",
)
convention_option = click.option(
    "--convention",
    type=click.Choice(CONVENTIONS),
    default="default",
    show_default=True,
    help="Signs and angles of the text and reports: the manual's, those of ISO 8855, or those of "
    "German workshops; the latter two with --axis centreline by default.",
)


def axis_of(axis: Axis, convention: Convention) -> Axis:
    """Return --axis, or where that was left out, the axis of a convention."""
    given = click.get_current_context().get_parameter_source("axis")
    return axis_by(convention) if given is ParameterSource.DEFAULT else axis


tolerance_option = click.option(
    "--tolerance",
    metavar="NAME|FILE|DIR|auto",
    help="Tolerance file (TOML) to assess conformity with; `example` shows its format; auto or a "
    "folder: the file there that has the capture's vehicle_model.",
)
plot_option = click.option(
    "--plot",
    metavar="DIR|-",
    help="Folder for all plots as SVG and PNG; - draws the angles in the terminal.",
)
language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    help="Language of the page, the PDF and the plots; by default that of the configuration, "
    "or en.",
)


def language_and_plot(command: Command) -> Command:
    """Add --plot and --language to a command."""
    return added((plot_option, language_option), command)


digits_option = click.option(
    "--digits",
    type=click.Choice(DIGIT_STYLES),
    default="uncertainty",
    show_default=True,
    help="Digits of the text: two of each uncertainty and values to the same place, or full.",
)
VIEW_OPTIONS = (
    click.option(
        "--axis",
        type=click.Choice(AXES),
        default="rear-axle",
        show_default=True,
        help="Longitudinal axis to which toe, setback and offset in the text refer.",
    ),
    click.option(
        "--angles",
        type=click.Choice(ANGLE_STYLES),
        default="dms",
        show_default=True,
        help="Angle format of the text: deg-min-sec, degrees, mm/m, or toe in mm at the rim.",
    ),
    click.option(
        "--rim",
        metavar="DIAMETER",
        help="Diameter of the wheel's rim for --angles mm, such as 16in or 406mm.",
    ),
    digits_option,
)


def view_options(command: Command) -> Command:
    """Add --axis, --angles, --rim and --digits to a command; `report.view.read_view` reads them."""
    return added(VIEW_OPTIONS, command)


WHOLE_VEHICLE_OPTIONS = (
    click.option(
        "--front",
        metavar="X,Y,Z",
        help="Whole-vehicle scan: a direction that points roughly forward.",
    ),
    click.option(
        "--front-point",
        metavar="X,Y,Z",
        help="Whole-vehicle scan: instead, a point near the front of the vehicle to measure, in "
        "the scan's coordinates and unit.",
    ),
    click.option(
        "--up",
        type=click.Choice(get_args(Upright)),
        help="Whole-vehicle scan: source of the up direction; auto, the default, takes the floor "
        "and z, which must agree.",
    ),
)


def whole_vehicle_options(command: Command) -> Command:
    """Add --front, --front-point and --up to a command; `capture_options` reads them."""
    return added(WHOLE_VEHICLE_OPTIONS, command)


hint_option = click.option(
    "--hint",
    "hints",
    multiple=True,
    metavar="NAME=X,Y,Z",
    help="A point on the target of a scan, by its name, where no outline is clear or several are; "
    "of a whole-vehicle scan, of each of the four wheels. As [hints] in capture.toml. Repeatable.",
)


def read_hints(texts: Sequence[str]) -> dict[str, tuple[float, float, float]]:
    """Return the points of --hint by name. Raises InputError that names the one that is wrong."""
    hints: dict[str, tuple[float, float, float]] = {}
    for text in texts:
        name, equals, point = text.rpartition("=")
        if not (equals and name):
            raise InputError(f"--hint {text}: write NAME=X,Y,Z, such as FL=0.2,3.1,0.3")
        if name in hints:
            raise InputError(f"--hint {text}: {name} has a point already: give one")
        hints[name] = three_numbers(f"--hint {name}", point)
    return hints


def capture_options(
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    unit: LengthUnit | None = None,
    reading: ReadOptions = AS_THE_FILE_SAYS,
    hints: Sequence[str] = (),
) -> CaptureOptions:
    """Return the command line's overrides of capture.toml.

    Raises InputError that names the option which is not three numbers.
    """
    return CaptureOptions(
        length_unit=unit,
        front=None if front is None else three_numbers("--front", front),
        front_point=None if front_point is None else three_numbers("--front-point", front_point),
        up=up,
        reading=reading,
        hints=read_hints(hints),
    )


def three_numbers(option: str, text: str) -> tuple[float, float, float]:
    """Parse X,Y,Z of an option. Raises InputError that names it."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option} {text}: three numbers X,Y,Z are needed, such as 100,100,50")
    return x, y, z


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

    from ..five_point import Station

    at = three_numbers("--total-station-position", position or "0,0,0")
    return Station(stated, np.array([in_metres(x, unit) for x in at]))
