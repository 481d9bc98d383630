"""The options by which a user chooses how angles are shown: axis, unit, rim."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from pipeline.report.view import ANGLE_STYLES
from pipeline.vehicle import AXES

OPTIONS = (
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
    for option in reversed(OPTIONS):
        command = option(command)
    return command
