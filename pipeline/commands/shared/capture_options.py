"""Options that state what a capture is: its targets, its scanner, and how its files are read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import click

from ...capture import CaptureOptions, Upright
from ...errors import InputError
from ...measurement import VerticalKind
from ...readers import AS_THE_FILE_SAYS, ReadOptions
from ...units import LENGTH_UNITS, LengthUnit
from .options import Command, added, three_numbers

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


vertical_option = click.option(
    "--vertical",
    type=click.Choice(get_args(VerticalKind)),
    default="wheels",
    show_default=True,
    help="Direction from which camber, caster and SAI are measured: the normal to the plane of the "
    "wheel centres, the normal of the floor in the scans or in capture.toml, or gravity in "
    "capture.toml.",
)
monte_carlo_option = click.option(
    "--monte-carlo",
    "max_draws",
    type=click.IntRange(min=20_000),
    metavar="N",
    help="Number of Monte Carlo draws, at most, to check the uncertainties with (JCGM 101); "
    "500000 are enough, 2000000 where u has few degrees of freedom.",
)
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
