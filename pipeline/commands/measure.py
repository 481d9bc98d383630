"""`wheelplane measure`: angles from laser scans of the wheels."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.capture import open_capture
from pipeline.commands.progress import Progress
from pipeline.config import load_config
from pipeline.measure import measure_capture
from pipeline.report.json_report import to_json
from pipeline.report.text import summary_table, vehicle_lines
from pipeline.report.write import write_reports


@click.command()
@click.argument("capture", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Write measurement.json, report.txt and pictures of the targets here.",
)
@click.option("--json", "as_json", is_flag=True, help="Print measurement.json and nothing else.")
@click.option("--target", metavar="NAME|FILE", help="The target, such as disc-250; see `targets`.")
@click.option(
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Settings other than the defaults (TOML).",
)
@click.option("--pictures/--no-pictures", default=True, help="Pictures of the targets in DIR.")
def measure(
    capture: Path,
    output: Path | None,
    as_json: bool,
    target: str | None,
    config: Path | None,
    pictures: bool,
) -> int:
    """Measure CAPTURE: a folder, zip or tar with a scan of each wheel.

    The scans are named in its capture.toml, or are called rr.* rl.* fr.* fl.* and trial-NAME.*.
    Exits with 1 when a trial could not be measured.
    """
    settings = load_config(config)
    with open_capture(capture, target) as opened, Progress(len(opened.entries)) as progress:
        measurement = measure_capture(opened, settings, progress)
    written = write_reports(measurement, output, pictures) if output else []
    if as_json:
        click.echo(to_json(measurement), nl=False)
    else:
        for note in measurement.notes:
            click.echo(note)
        click.echo(summary_table(measurement))
        click.echo()
        click.echo(vehicle_lines(measurement))
        for path in written:
            click.echo(f"wrote {path}")
    return 0 if measurement.complete else 1
