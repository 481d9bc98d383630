"""`wheelplane five-point`: angles from five surveyed points a wheel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import click

from ..config import load_config
from ..errors import InputError
from ..five_point import (
    FivePointFile,
    check_blocks,
    check_radius,
    measure_five_point,
    read_five_point,
    tcgc_2013,
)
from ..measurement import assess, check_by_monte_carlo, conforms, tolerance_for
from ..report.format.view import PAPER, AngleStyle, Convention, DigitStyle, read_view
from ..report.json.measurement import to_json
from ..report.text.report import detailed_report
from ..report.text.tcgc_2013 import tcgc_2013_text
from ..report.write import ReportFiles, keep_inputs, report_files, write_whole
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..vehicle import Axis
from .shared.capture_options import monte_carlo_option
from .shared.five_point_options import (
    five_point_options,
    five_point_unit_option,
    radius_option,
    read_station,
)
from .shared.reporting import plot_to, report_options, show, show_plot
from .shared.view_options import (
    axis_of,
    convention_option,
    language_and_plot,
    tolerance_option,
    view_options,
)


@click.command("five-point")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="REPORT",
    help="Text file for the detailed report.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the measurement as JSON and nothing else."
)
@five_point_unit_option
@five_point_options("--scanner", former_position="--station")
@radius_option
@click.option(
    "--method",
    type=click.Choice(["tls", "tcgc-2013"]),
    default="tls",
    show_default=True,
    help="Estimator: total least squares, or that of the software of 2013.",
)
@click.option(
    "--print",
    "table",
    type=click.Choice(["report", "matrix"]),
    default="report",
    show_default=True,
    help="Table of the paper to print, with tcgc-2013.",
)
@click.option(
    "--html", type=click.Path(path_type=Path), metavar="FILE", help="HTML file for the report."
)
@click.option(
    "--pdf", type=click.Path(path_type=Path), metavar="FILE", help="PDF file for the report."
)
@click.option(
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Configuration file (TOML) whose table [report] names the laboratory.",
)
@language_and_plot
@monte_carlo_option
@tolerance_option
@convention_option
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
    total_station: str | None,
    total_station_position: str | None,
    radius: float | None,
    max_draws: int | None,
    tolerance: str | None,
    html: Path | None,
    pdf: Path | None,
    config: Path | None,
    plot: str | None,
    language: str | None,
    convention: Convention,
    axis: Axis,
    angles: AngleStyle,
    rim: str | None,
    digits: DigitStyle,
) -> int:
    """Measure FILE: five points x y z a plane, blocks RR, RL, FR, FL, then the trials.

    Rows of three numbers, separated by commas or blanks, no header. With --tolerance, exits with 1
    unless every quantity that it limits is conforming; undecided is 1 too.
    """
    stated = (Path(one) for one in (config, tolerance, total_station) if one is not None)
    keep_inputs((output, html, pdf), [file, *stated])
    radius = None if radius is None else radius / 1e3
    view = read_view(axis_of(axis, convention), angles, rim, digits)
    view = replace(view, convention=convention)
    options = report_options(load_config(config).report, language, view)
    limits = None if tolerance is None else tolerance_for(tolerance, None, str(file))
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
                "--json with --method tcgc-2013: that estimator reproduces the printed tables, "
                "whose signs are not those of the JSON: leave out one of the two"
            )
        if total_station or total_station_position or max_draws:
            raise InputError(
                "--total-station and --monte-carlo with --method tcgc-2013: that estimator "
                "states no uncertainty: leave them out"
            )
        if limits:
            raise InputError(
                "--tolerance with --method tcgc-2013: that estimator states no uncertainty, on "
                "which conformity depends: leave out one of the two"
            )
        if view != PAPER:
            raise InputError(
                "--axis, --angles, --digits and --convention with --method tcgc-2013: its tables "
                "are reproduced as they were printed: leave them out"
            )
        if html or pdf or plot:
            raise InputError(
                "--html, --pdf and --plot with --method tcgc-2013: its tables are reproduced as "
                "they were printed: leave them out"
            )
        if radius is not None:
            check_radius(points.blocks_m, radius, points.source)
        text = tcgc_2013_text(tcgc_2013(points.blocks_m, table))
        if output:
            write_whole(output, text.encode())
        click.echo(text, nl=False)
        return 1 if _name_implausible(points, radius) else 0
    if table != "report":
        raise InputError(
            f"--print {table} without --method tcgc-2013: that estimator's tables are printed: add "
            "it, or leave out --print"
        )
    station = read_station(total_station, total_station_position, coordinates, length_unit)
    measurement = measure_five_point(points, station, radius)
    if max_draws:
        measurement = check_by_monte_carlo(measurement, max_draws, 0)
    conformity = assess(measurement, limits) if limits else None
    code = 0 if measurement.complete and conforms(conformity) else 1
    written = []
    if output:
        written.append(write_whole(output, detailed_report(measurement, conformity, view).encode()))
    wanted = ReportFiles(html=html is not None, pdf=pdf is not None)
    made = report_files(measurement, conformity, options, wanted)
    for path, name in ((html, "report.html"), (pdf, "report.pdf")):
        if path:
            written.append(write_whole(path, made[name]))
    written += plot_to(plot, measurement, conformity, options)
    if as_json:
        click.echo(to_json(measurement, conformity, view.axis), nl=False)
        return code
    planes = len(points.blocks_m)
    click.echo(f"{points.source}: {5 * planes} points read, {planes} planes of five")
    for note in measurement.notes:
        click.echo(note)
    click.echo()
    show(measurement, view, conformity)
    show_plot(plot, measurement, conformity, options)
    for path in written:
        click.echo(f"wrote {path}")
    return code


def _name_implausible(points: FivePointFile, radius_m: float | None) -> bool:
    """Name the blocks that are not plausible, on standard error; return whether there are any."""
    checks = check_blocks(points.blocks_m, None, radius_m)
    bad = [index for index, check in enumerate(checks) if check.status != "ok"]
    for index in bad:
        first = points.first_line(index)
        fact = f"lines {first}-{first + 4}: {checks[index].status}"
        click.echo(f"{points.source}: {fact}: leave out --method for its suspect point", err=True)
    return bool(bad)
