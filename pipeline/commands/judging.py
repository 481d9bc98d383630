"""What `measure` and `five-point` share: the options that check and judge, and the screen."""

from __future__ import annotations

import math

import click

from pipeline.conformity import Conformity
from pipeline.errors import InputError
from pipeline.measurement import Measurement
from pipeline.report.conformity_text import conformity_text
from pipeline.report.text import extra_parts, summary_table
from pipeline.report.vehicle_text import vehicle_lines
from pipeline.report.view import View

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
