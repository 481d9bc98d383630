"""Results on the screen and in files, by the options of `measure` and `five-point`."""

from __future__ import annotations

from pathlib import Path

import click

from ...capture import Capture
from ...config import Config, ReportConfig
from ...errors import ConfigError
from ...measurement import Conformity, Measurement
from ...report.format.earlier import Earlier, read_earlier
from ...report.format.laboratory import read_laboratory
from ...report.format.language import LANGUAGES, Translations, load_translations
from ...report.format.report_options import ReportOptions
from ...report.format.view import View
from ...report.write import write_result
from .progress import TerminalProgress

SCREEN = "-"  # of --plot


def show(
    measurement: Measurement,
    view: View,
    conformity: Conformity | None,
    before: Earlier | None = None,
) -> None:
    """Print the tables of a measurement, what changed, and its conformity, where there are such."""
    from ...report.text.conformity import conformity_text
    from ...report.text.report import extra_parts, summary_table
    from ...report.text.vehicle import before_text, vehicle_lines

    click.echo(summary_table(measurement, view))
    click.echo()
    click.echo(vehicle_lines(measurement, view))
    if before:
        click.echo(f"\n{before_text(measurement, before, view)}")
    for part in extra_parts(measurement, view):
        click.echo(f"\n{part}")
    if conformity:
        click.echo(f"\n{conformity_text(conformity, view)}")


def report_options(
    config: ReportConfig, language: str | None, view: View, before: Path | None = None
) -> ReportOptions:
    """Return language, view, laboratory and earlier values. Raises ConfigError, InputError."""
    earlier = None if before is None else read_earlier(before)
    if language is None and config.language not in LANGUAGES:
        known = ", ".join(LANGUAGES)
        raise ConfigError(f"--config: [report] language is {config.language!r}: known are {known}")
    words = load_translations(language or config.language)
    return ReportOptions(words, view, read_laboratory(config), earlier)


def explain_to(
    folder: Path, capture: Capture, config: Config, words: Translations, *, as_json: bool
) -> None:
    """Write the explanation of a capture to `folder`, and print it, beside JSON as an error."""
    from ...explanation import explain_capture
    from ...report.candidates.text import explanation_text
    from ...report.explanation import write_explanation

    with TerminalProgress(capture.steps, "explaining") as progress:
        found = explain_capture(capture, config, progress)
    written = write_explanation(found, folder, words)
    click.echo(explanation_text(found), err=as_json)
    click.echo(f"wrote {len(written)} files to {folder}", err=as_json)


def plot_to(
    plot: str | None,
    measurement: Measurement,
    conformity: Conformity | None,
    options: ReportOptions,
) -> list[Path]:
    """Write the plots where --plot names a folder; return that folder.

    Those of scans of an earlier measurement that this one does not replace are removed.
    """
    if plot is None or plot == SCREEN:
        return []
    from ...report.plots.files import ANGLES, OF_SCANS, plot_files

    files = plot_files(measurement, conformity, options.words, options.view)
    write_result(Path(plot), files, ANGLES, OF_SCANS)
    return [Path(plot)]


def show_plot(
    plot: str | None,
    measurement: Measurement,
    conformity: Conformity | None,
    options: ReportOptions,
) -> None:
    """Draw the angles in the terminal where --plot is -."""
    if plot == SCREEN:
        from ...report.plots.angle_chart import angles_text

        click.echo(
            f"\n{angles_text(measurement, conformity, options.words, options.view)}", nl=False
        )
