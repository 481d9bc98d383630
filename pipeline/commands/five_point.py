"""`wheelplane five-point`: angles from five surveyed points a wheel."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from ..config import load_config
from ..errors import InputError
from ..five_point import read_five_point, tcgc_2013
from ..measure import measure_five_point
from ..measurement import assess, check_by_monte_carlo, conforms, load_tolerance
from ..report.format.view import PAPER, AngleStyle, read_view
from ..report.json.measurement import to_json
from ..report.text.report import detailed_report
from ..report.text.tcgc_2013 import tcgc_2013_text
from ..report.write import html_bytes, pdf_bytes, write_whole
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..vehicle import Axis
from .options import (
    language_and_plot,
    monte_carlo_option,
    read_station,
    tolerance_option,
    view_options,
)
from .reporting import dressed, plot_to, show, show_plot


@click.command("five-point")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="REPORT",
    help="Write the detailed report to this text file.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the measurement as JSON, only.")
@click.option("--length-unit", type=click.Choice(["m", "mm", "in"]), default="m", show_default=True)
@click.option(
    "--coordinates",
    type=click.Choice(["cartesian", "spherical"]),
    default="cartesian",
    show_default=True,
    help="Rows x y z, or range azimuth zenith of a total station.",
)
@click.option(
    "--angle-unit",
    type=click.Choice(["deg", "gon", "rad"]),
    help="Of azimuth and zenith; needed with spherical coordinates.",
)
@click.option(
    "--azimuth",
    type=click.Choice(["auto", "clockwise", "counterclockwise"]),
    default="auto",
    show_default=True,
    help="How azimuths run, seen from above; auto: as leaves the vehicle upright.",
)
@click.option(
    "--method",
    type=click.Choice(["tls", "tcgc-2013"]),
    default="tls",
    show_default=True,
    help="Total least squares, or the estimator of the software of 2013.",
)
@click.option(
    "--print",
    "table",
    type=click.Choice(["report", "matrix"]),
    default="report",
    show_default=True,
    help="With tcgc-2013: which of the paper's two tables.",
)
@click.option(
    "--scanner",
    metavar="NAME|FILE",
    help="The total station, whose uncertainty is carried to the angles, such as leica-tm30.",
)
@click.option(
    "--station",
    metavar="X,Y,Z",
    help="Where it stood, in the file's coordinates and unit; the origin for spherical ones.",
)
@click.option(
    "--html", type=click.Path(path_type=Path), metavar="FILE", help="The report as a page."
)
@click.option("--pdf", type=click.Path(path_type=Path), metavar="FILE", help="The same as PDF.")
@click.option(
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Whose table [report] names who issues the report (TOML).",
)
@language_and_plot
@monte_carlo_option
@tolerance_option
@view_options
def five_point(
    file: Path,
    output: Path | None,
    as_json: bool,
    length_unit: LengthUnit,
    coordinates: Coordinates,
    angle_unit: AngleUnit | None,
    azimuth: Azimuth,
    method: str,
    table: Literal["report", "matrix"],
    scanner: str | None,
    station: str | None,
    trials: int | None,
    tolerance: str | None,
    html: Path | None,
    pdf: Path | None,
    config: Path | None,
    plot: str | None,
    language: str | None,
    axis: Axis,
    angles: AngleStyle,
    rim: str | None,
) -> int:
    """Measure FILE: five points x y z a plane, blocks RR, RL, FR, FL, then the trials.

    Rows of three numbers, separated by commas or blanks, no header. With --tolerance, exits with 1
    unless all that it limits is shown to conform: undecided is 1 too.
    """
    view = read_view(axis, angles, rim)
    dress = dressed(load_config(config).report, language, view)
    limits = None if tolerance is None else load_tolerance(tolerance)
    points = read_five_point(
        file,
        length_unit=length_unit,
        coordinates=coordinates,
        angle_unit=angle_unit,
        azimuth=azimuth,
    )
    if method == "tcgc-2013":
        if as_json:
            raise InputError(
                "--json with --method tcgc-2013: that estimator is kept to reproduce the printed "
                "tables, whose signs are not ours: leave out one of the two"
            )
        if scanner or station or trials:
            raise InputError(
                "--scanner, --station and --monte-carlo with --method tcgc-2013: that estimator "
                "states no uncertainty: leave it, or them, out"
            )
        if limits:
            raise InputError(
                "--tolerance with --method tcgc-2013: that estimator states no uncertainty to "
                "judge by: leave out one of the two"
            )
        if view != PAPER:
            raise InputError(
                "--axis and --angles with --method tcgc-2013: its tables are kept as they were "
                "printed: leave it, or them, out"
            )
        if html or pdf or plot:
            raise InputError(
                "--html, --pdf and --plot with --method tcgc-2013: its tables are kept as they "
                "were printed: leave it, or them, out"
            )
        text = tcgc_2013_text(tcgc_2013(points.blocks_m, table))
        if output:
            write_whole(output, text.encode())
        click.echo(text, nl=False)
        return 0
    surveyed = read_station("--scanner", scanner, station, coordinates, length_unit)
    measurement = measure_five_point(points, surveyed)
    if trials:
        measurement = check_by_monte_carlo(measurement, trials, 0)
    judged = assess(measurement, limits) if limits else None
    code = 0 if measurement.complete and conforms(judged) else 1
    written = []
    if output:
        written.append(write_whole(output, detailed_report(measurement, judged, view).encode()))
    if html:
        written.append(write_whole(html, html_bytes(measurement, judged, dress)))
    if pdf:
        written.append(write_whole(pdf, pdf_bytes(measurement, judged, dress)))
    written += plot_to(plot, measurement, judged, dress)
    if as_json:
        click.echo(to_json(measurement, judged, view.axis), nl=False)
        return code
    planes = len(points.blocks_m)
    click.echo(f"{points.source}: {5 * planes} points read, {planes} planes of five")
    for note in points.notes:
        click.echo(note)
    click.echo()
    show(measurement, view, judged)
    show_plot(plot, measurement, judged, dress)
    for path in written:
        click.echo(f"wrote {path}")
    return code
