"""`wheelplane five-point`: angles from five surveyed points a wheel."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from pipeline.errors import InputError
from pipeline.five_point_file import AngleUnit, Azimuth, Coordinates, LengthUnit, read_five_point
from pipeline.measure import measure_five_point
from pipeline.report.json_report import to_json
from pipeline.report.tcgc_2013_text import tcgc_2013_text
from pipeline.report.text import detailed_report, summary_table, vehicle_lines
from pipeline.report.write import write_whole
from pipeline.tcgc_2013 import tcgc_2013


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
) -> int:
    """Measure FILE: five points x y z a plane, blocks RR, RL, FR, FL, then the trials.

    Rows of three numbers, separated by commas or blanks, no header.
    """
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
        text = tcgc_2013_text(tcgc_2013(points.blocks_m, table))
        if output:
            write_whole(output, text.encode())
        click.echo(text, nl=False)
        return 0
    measurement = measure_five_point(points)
    if output:
        write_whole(output, detailed_report(measurement).encode())
    if as_json:
        click.echo(to_json(measurement), nl=False)
        return 0
    planes = len(points.blocks_m)
    click.echo(f"{points.source}: {5 * planes} points read, {planes} planes of five")
    for note in points.notes:
        click.echo(note)
    click.echo()
    click.echo(summary_table(measurement))
    click.echo()
    click.echo(vehicle_lines(measurement))
    if output:
        click.echo(f"wrote {output}")
    return 0
