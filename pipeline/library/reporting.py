"""Options of the reports of a result: language, axis, angles, convention."""

from __future__ import annotations

from dataclasses import replace

from ..measurement import VerticalKind
from ..report.format.language import load_translations
from ..report.format.report_options import ReportOptions
from ..report.format.view import AngleStyle, Convention, axis_by, read_view
from ..vehicle import Axis
from .messages import library_errors
from .scans import check_one_of


@library_errors
def report_options(
    vertical: VerticalKind = "wheels",
    language: str = "en",
    axis: Axis | None = None,
    angles: AngleStyle = "dms",
    convention: Convention = "default",
    rim: str | None = None,
) -> ReportOptions:
    """Return how a report looks. axis: by default that of the convention.

    Raises InputError, which lists the choices.
    """
    check_one_of(convention, Convention, "convention")
    check_one_of(angles, AngleStyle, "angles")
    axis = axis_by(convention) if axis is None else axis
    check_one_of(axis, Axis, "axis")
    view = read_view(axis, angles, rim)
    view = replace(view, vertical=vertical, convention=convention)
    return ReportOptions(load_translations(language), view)
