"""Options that state how results are shown: axis, signs, angles, digits, language, plots."""

from __future__ import annotations

import click
from click.core import ParameterSource

from ...report.format.language import LANGUAGES
from ...report.format.view import ANGLE_STYLES, CONVENTIONS, DIGIT_STYLES, Convention, axis_by
from ...vehicle import AXES, Axis
from .options import Command, added

convention_option = click.option(
    "--convention",
    type=click.Choice(CONVENTIONS),
    default="default",
    show_default=True,
    help="Signs and angles of the text and reports: the manual's, those of ISO 8855, or those of "
    "German workshops; the latter two with --axis centreline by default.",
)


def axis_of(axis: Axis, convention: Convention) -> Axis:
    """Return --axis, or where that was left out, the axis of a convention."""
    given = click.get_current_context().get_parameter_source("axis")
    return axis_by(convention) if given is ParameterSource.DEFAULT else axis


tolerance_option = click.option(
    "--tolerance",
    metavar="NAME|FILE|DIR|auto",
    help="Tolerance file (TOML) to assess conformity with; `example` shows its format; auto or a "
    "folder: the file there that has the capture's vehicle_model.",
)
plot_option = click.option(
    "--plot",
    metavar="DIR|-",
    help="Folder for all plots as SVG and PNG; - draws the angles in the terminal.",
)
language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    help="Language of the page, the PDF and the plots; by default that of the configuration, "
    "or en.",
)


def language_and_plot(command: Command) -> Command:
    """Add --plot and --language to a command."""
    return added((plot_option, language_option), command)


digits_option = click.option(
    "--digits",
    type=click.Choice(DIGIT_STYLES),
    default="uncertainty",
    show_default=True,
    help="Digits of the text: two of each uncertainty and values to the same place, or full.",
)
VIEW_OPTIONS = (
    click.option(
        "--axis",
        type=click.Choice(AXES),
        default="rear-axle",
        show_default=True,
        help="Longitudinal axis to which toe, setback and offset in the text refer.",
    ),
    click.option(
        "--angles",
        type=click.Choice(ANGLE_STYLES),
        default="dms",
        show_default=True,
        help="Angle format of the text: deg-min-sec, degrees, mm/m, or toe in mm at the rim.",
    ),
    click.option(
        "--rim",
        metavar="DIAMETER",
        help="Diameter of the wheel's rim for --angles mm, such as 16in or 406mm.",
    ),
    digits_option,
)


def view_options(command: Command) -> Command:
    """Add --axis, --angles, --rim and --digits to a command; `report.view.read_view` reads them."""
    return added(VIEW_OPTIONS, command)
