"""`wheelplane measure`: angles from laser scans of the wheels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from ..capture import Upright, open_capture
from ..config import load_config, with_scanner
from ..errors import InputError
from ..measure import measure_capture
from ..measurement import VerticalKind, assess, check_by_monte_carlo, conforms, tolerance_for
from ..report.format.earlier import check_comparable, check_same_vehicle, check_same_vertical
from ..report.format.view import AngleStyle, Convention, DigitStyle, read_view
from ..report.write import ReportFiles, keep_inputs, write_reports
from ..units import LengthUnit
from ..vehicle import Axis
from .shared.capture_options import (
    capture_options,
    config_option,
    hint_option,
    length_unit_option,
    monte_carlo_option,
    read_options,
    reading_options,
    scanner_option,
    target_option,
    vertical_option,
    whole_vehicle_options,
)
from .shared.limits import limited
from .shared.progress import TerminalProgress
from .shared.reporting import explain_to, plot_to, report_options, show, show_plot
from .shared.view_options import (
    axis_of,
    convention_option,
    language_and_plot,
    tolerance_option,
    view_options,
)


@click.command()
@click.argument("capture", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for measurement.json, the reports and the pictures of the targets.",
)
@click.option(
    "--explain",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for pictures of every plane that was looked at in each scan, with why it was "
    "taken or refused, and explanation.json; written before the measurement, even if that fails.",
)
@hint_option
@click.option("--json", "as_json", is_flag=True, help="Print measurement.json and nothing else.")
@target_option
@length_unit_option
@reading_options
@whole_vehicle_options
@config_option
@scanner_option
@vertical_option
@convention_option
@monte_carlo_option
@tolerance_option
@view_options
@click.option(
    "--before",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="An earlier measurement.json of the same vehicle, whose values are set beside the new "
    "ones.",
)
@click.option(
    "--pictures/--no-pictures", default=True, help="Write pictures of the targets to DIR."
)
@click.option("--html/--no-html", default=True, help="Write the HTML report, report.html, to DIR.")
@click.option("--pdf", is_flag=True, help="Write the PDF report, report.pdf, to DIR.")
@language_and_plot
@limited
def measure(
    capture: Path,
    output: Path | None,
    explain: Path | None,
    hints: tuple[str, ...],
    as_json: bool,
    target: str | None,
    length_unit: LengthUnit | None,
    columns: str | None,
    pitch: str | None,
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    config: Path | None,
    scanner: str | None,
    vertical: VerticalKind,
    convention: Convention,
    max_draws: int | None,
    tolerance: str | None,
    pictures: bool,
    html: bool,
    pdf: bool,
    plot: str | None,
    language: str | None,
    axis: Axis,
    angles: AngleStyle,
    rim: str | None,
    digits: DigitStyle,
    before: Path | None,
) -> int:
    """Measure CAPTURE: a folder, zip or tar with a scan of each wheel, or a whole-vehicle scan.

    A whole-vehicle scan, such as an E57 of several scans, alone or in a folder, zip or tar, is
    searched for the targets; wheels are named by their positions, and --front gives the front end.

    Scans of single wheels are named in capture.toml, or are called rr.* rl.* fr.* fl.* and
    trial-NAME.*. [[sweep]] in capture.toml names scans of the front wheels at three or more
    steering angles, with the body still and the brake held: if a wheel rolls, only a target with a
    known axial run-out, or one whose in-plane rotation is visible (a board, a square or a
    rectangle), shows it; these also give the steering axis inclination several times more precisely
    than a disc. [[runout]] names two or more scans of a lifted wheel, rotated about its axle by
    angle_deg.

    Exits with 1 when a trial, a sweep or a run-out could not be measured, and, with --tolerance,
    unless every quantity that it limits is conforming; undecided is 1 too, so that 0 never passes
    a vehicle in doubt.
    """
    if output is not None and before is not None:
        keep_inputs([output / "measurement.json"], [before])
    view = read_view(axis_of(axis, convention), angles, rim, digits)
    view = replace(view, vertical=vertical, convention=convention)
    settings = load_config(config)
    options = report_options(settings.report, language, view, before)
    if pdf and output is None:
        raise InputError("--pdf without -o DIR: name the folder that report.pdf goes to")
    reading = read_options(columns, pitch)
    overrides = capture_options(front, front_point, up, length_unit, reading, hints)
    with (
        open_capture(capture, target, overrides) as opened,
        TerminalProgress(opened.steps) as progress,
    ):
        if options.before:
            check_same_vertical(options.before, vertical)
            check_same_vehicle(options.before, opened.vehicle, str(capture))
        settings = with_scanner(settings, scanner or opened.scanner)
        if explain is not None:
            explain_to(explain, opened, settings, options.words, as_json=as_json)
        model, name = opened.vehicle_model, str(capture)
        limits = None if tolerance is None else tolerance_for(tolerance, model, name)
        mapped = output is not None or plot is not None
        measurement = measure_capture(opened, settings, progress, vertical=vertical, mapped=mapped)
    if options.before:
        check_comparable(options.before, measurement)
    if max_draws:
        measurement = check_by_monte_carlo(measurement, max_draws, settings.seed)
    conformity = assess(measurement, limits) if limits else None
    files = ReportFiles(pictures, html, pdf)
    written = write_reports(measurement, output, conformity, options, files) if output else []
    written += plot_to(plot, measurement, conformity, options)
    if as_json:
        from ..report.json.measurement import to_json

        click.echo(to_json(measurement, conformity, view.axis, options.before), nl=False)
    else:
        for note in measurement.notes:
            click.echo(note)
        show(measurement, view, conformity, options.before)
        show_plot(plot, measurement, conformity, options)
        for path in written:
            click.echo(f"wrote {path}")
    return 0 if measurement.complete and conforms(conformity) else 1
