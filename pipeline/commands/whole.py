"""The options by which a user tells what one cloud of a whole vehicle cannot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

import click

from pipeline.capture import Told
from pipeline.capture_file import LengthUnit, Upright
from pipeline.commands.judging import three_numbers

OPTIONS = (
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
    for option in reversed(OPTIONS):
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
