"""The options by which a user chooses the reports, their language and their plots."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from pipeline.config import ReportConfig
from pipeline.conformity import Conformity
from pipeline.measurement import Measurement
from pipeline.report.angle_text import angles_text
from pipeline.report.html import Dress
from pipeline.report.laboratory import read_laboratory
from pipeline.report.language import LANGUAGES, load_words
from pipeline.report.plots import plot_files
from pipeline.report.view import View
from pipeline.report.write import write_files

SCREEN = "-"
plot_option = click.option(
    "--plot",
    metavar="DIR|-",
    help="Write all plots here as SVG and PNG; - draws the angles in the terminal.",
)
language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    help="Of the page, the PDF and the plots; else what the config says, or en.",
)


def language_and_plot(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --plot and --language to a command."""
    return plot_option(language_option(command))


def dressed(config: ReportConfig, language: str | None, view: View) -> Dress:
    """The look of the reports. Raises ConfigError, InputError."""
    return Dress(load_words(language or config.language), view, read_laboratory(config))


def plot_to(
    plot: str | None, measurement: Measurement, judged: Conformity | None, dress: Dress
) -> list[Path]:
    """Write the plots; their folder, where one is named."""
    if plot is None or plot == SCREEN:
        return []
    write_files(Path(plot), plot_files(measurement, judged, dress.words, dress.view))
    return [Path(plot)]


def show_plot(
    plot: str | None, measurement: Measurement, judged: Conformity | None, dress: Dress
) -> None:
    """The angles on the terminal, where that is asked for."""
    if plot == SCREEN:
        click.echo(f"\n{angles_text(measurement, judged, dress.words, dress.view)}", nl=False)
