"""`wheelplane measure`: angles from laser scans of the wheels."""

from __future__ import annotations

from pathlib import Path

import click

from ..capture import Upright, open_capture
from ..config import load_config, with_scanner
from ..errors import InputError
from ..measure import measure_capture
from ..measurement import assess, check_by_monte_carlo, conforms, load_tolerance
from ..report.format.view import AngleStyle, read_view
from ..report.json.measurement import to_json
from ..report.write import ReportFiles, write_reports
from ..units import LENGTH_UNITS, LengthUnit
from ..vehicle import Axis
from .options import (
    language_and_plot,
    monte_carlo_option,
    told,
    tolerance_option,
    view_options,
    whole_vehicle_options,
)
from .progress import Progress
from .reporting import dressed, plot_to, show, show_plot


@click.command()
@click.argument("capture", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Write measurement.json, the reports and pictures of the targets here.",
)
@click.option("--json", "as_json", is_flag=True, help="Print measurement.json and nothing else.")
@click.option("--target", metavar="NAME|FILE", help="The target, such as disc-250; see `targets`.")
@click.option(
    "--length-unit",
    type=click.Choice(LENGTH_UNITS),
    help="Of the coordinates; else what capture.toml says, or m.",
)
@whole_vehicle_options
@click.option(
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Settings other than the defaults, and who issues the report (TOML).",
)
@click.option(
    "--scanner",
    metavar="NAME|FILE",
    help="The scanner, whose file states what the scans cannot show of its uncertainty (TOML).",
)
@monte_carlo_option
@tolerance_option
@view_options
@click.option("--pictures/--no-pictures", default=True, help="Pictures of the targets in DIR.")
@click.option("--html/--no-html", default=True, help="The report as a page, report.html, in DIR.")
@click.option("--pdf", is_flag=True, help="The same as report.pdf in DIR.")
@language_and_plot
def measure(
    capture: Path,
    output: Path | None,
    as_json: bool,
    target: str | None,
    length_unit: LengthUnit | None,
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    config: Path | None,
    scanner: str | None,
    trials: int | None,
    tolerance: str | None,
    pictures: bool,
    html: bool,
    pdf: bool,
    plot: str | None,
    language: str | None,
    axis: Axis,
    angles: AngleStyle,
    rim: str | None,
) -> int:
    """Measure CAPTURE: a folder, zip or tar with a scan of each wheel, or one cloud of them all.

    One cloud, such as an E57 of several scans, alone or in its folder, zip or tar, is searched for
    the targets, whose wheels are named by where they stand; --front tells which end is the front.

    Scans of single wheels are named in its capture.toml, or are called rr.* rl.* fr.* fl.* and
    trial-NAME.*. Its [[sweep]] names scans of front wheels at three or more angles of the steering,
    body still and brake held, for a wheel that rolls on its axle shows only where its plate
    wobbles, or shows its own turn: a board, a square or a rectangle, which give the kingpin
    inclination several times better than a disc; its [[runout]] two or more of a lifted wheel,
    turned about its axle by angle_deg.

    Exits with 1 when a trial, a sweep or a run-out could not be measured, and, with --tolerance,
    unless all that it limits is shown to conform: undecided is 1 too, so that 0 never lets a
    vehicle pass on a doubt.
    """
    view = read_view(axis, angles, rim)
    settings = load_config(config)
    dress = dressed(settings.report, language, view)
    if pdf and output is None:
        raise InputError("--pdf without -o DIR: name the folder that report.pdf goes to")
    limits = None if tolerance is None else load_tolerance(tolerance)
    said = told(front, front_point, up, length_unit)
    with open_capture(capture, target, said) as opened, Progress(opened.steps) as progress:
        settings = with_scanner(settings, scanner or opened.scanner)
        measurement = measure_capture(opened, settings, progress)
    if trials:
        measurement = check_by_monte_carlo(measurement, trials, settings.seed)
    judged = assess(measurement, limits) if limits else None
    wanted = ReportFiles(pictures, html, pdf)
    written = write_reports(measurement, output, judged, dress, wanted) if output else []
    written += plot_to(plot, measurement, judged, dress)
    if as_json:
        click.echo(to_json(measurement, judged, view.axis), nl=False)
    else:
        for note in measurement.notes:
            click.echo(note)
        show(measurement, view, judged)
        show_plot(plot, measurement, judged, dress)
        for path in written:
            click.echo(f"wrote {path}")
    return 0 if measurement.complete and conforms(judged) else 1
