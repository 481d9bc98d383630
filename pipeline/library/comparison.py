"""Comparison of a measurement with another method."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from .. import validation
from ..errors import InputError
from ..five_point import FivePointFile, read_five_point
from ..report.html.provenance import is_five_point
from ..report.json.validation import validation_json
from ..report.validation import validation_html, validation_report, write_validation
from ..report.write import ReportFiles
from ..system import frozen
from ..validation import Request, compare_with_points, points_of
from .alignment import Alignment
from .messages import library_errors
from .reporting import report_options


@frozen(eq=False)
class Comparison(validation.Comparison):
    """Differences of two methods on n wheels and trials, first less second, and their verdict.

    difference_rad, en: (2 n,) toes, then cambers, and over their expanded uncertainty. names: of
    the wheels and trials. verdict: of all together; verdicts: of each angle.
    """

    def json(self) -> str:
        """Return validation.json."""
        return validation_json(self)

    def text(self) -> str:
        """Return validation.txt."""
        return validation_report(self)

    def html(self, language: str = "en") -> str:
        """Return validation.html, one file that needs no network. Raises InputError."""
        return validation_html(self, report_options(language=language))

    def save(self, folder: str | Path, *, pdf: bool = False, language: str = "en") -> list[Path]:
        """Write validation.json and the reports to `folder`; return their paths.

        Raises InputError, and MissingDependencyError of a PDF.
        """
        options, wanted = report_options(language=language), ReportFiles(pdf=pdf)
        return write_validation(self, Path(folder), options, wanted)

    def __repr__(self) -> str:
        methods = f"{self.first.label} and {self.second.label}"
        return f"<Comparison of {methods}: {', '.join(self.names)}; {self.verdict}>"


@library_errors
def validate(alignment: Alignment, five_points: FivePointFile | str | Path) -> Comparison:
    """Compare a measurement from scans with five points on the same wheels, in the same order.

    five_points: a file that `read_five_point` read, or its path. The comparison states whether the
    methods agree within their uncertainties (`verdict`), and where not.

    Raises InputError where the two cannot be of one vehicle, or differ in their wheels, and for an
    alignment of five points.
    """
    if not isinstance(alignment, Alignment):
        kind = type(alignment).__name__
        raise InputError(f"a {kind} is no alignment: give what `measure` returns")
    if is_five_point(alignment.measurement):
        raise InputError(
            f"{alignment.measurement.provenance.source}: is of five points a plane itself, and the "
            "comparison is of scans with them: give an alignment of scans"
        )
    file = read_five_point(five_points) if isinstance(five_points, (str, Path)) else five_points
    if not isinstance(file, FivePointFile):
        kind = type(file).__name__
        raise InputError(f"a {kind} is no five-point file: give one that was read, or its path")
    points = points_of(file, list(alignment.wheels))
    found = compare_with_points(alignment.measurement, points, Request("five-point"))
    held = {one.name: getattr(found, one.name) for one in fields(found)}
    made = alignment.measurement.provenance
    return Comparison(**held | {"vehicle": made.vehicle or made.source})
