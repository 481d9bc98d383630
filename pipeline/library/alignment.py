"""Result of a measurement, as a program reads it: wheels, values, covariance, tables, report."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import InputError, MissingDependencyError, NotMeasuredError
from ..measurement import (
    CROSS,
    UNITS,
    WHEEL_BY_RUNOUT,
    WHEEL_BY_SWEEP,
    Conformity,
    Estimate,
    Measurement,
    VerticalKind,
    WheelResult,
    stated,
    steering_quantity,
    turned_quantity,
)
from ..report.format.view import AngleStyle, Convention
from ..report.html.page import html_report
from ..report.json.measurement import to_json
from ..report.json.stored import RECORD
from ..report.text.report import detailed_report, summary_table
from ..report.write import ReportFiles, write_reports
from ..system import frozen
from ..vectors import Array
from ..vehicle import Axis
from .messages import in_library_words
from .reporting import report_options
from .value import EqualByFields, Named, Value


@frozen(eq=False)
class Wheel(EqualByFields):
    """One reference wheel or trial; its angles raise NotMeasuredError where there are none.

    wheel: RR, RL, FR or FL. status: ok, or the kind of cause that `reason` explains. centre_m (3,)
    and normal (3,), outward: of the axle where its run-out is compensated, else of the target as
    mounted; coordinates of the scans; None where unmeasured.
    """

    name: str
    wheel: str | None
    status: str
    reason: str
    compensated: bool
    centre_m: Array | None
    normal: Array | None
    _values: Mapping[str, Value]

    @property
    def toe(self) -> Value:
        """Toe against the normal of the rear axle, > 0 with toe-in."""
        return self["toe"]

    @property
    def camber(self) -> Value:
        """Camber: elevation of the normal, > 0 with the top outwards."""
        return self["camber"]

    @property
    def camber_iso(self) -> Value:
        """Camber as ISO 8855 defines it."""
        return self["camber_iso"]

    def __getitem__(self, name: str) -> Value:
        """Return a value by its name without the wheel's, such as `caster`."""
        try:
            return self._values[name]
        except KeyError:
            if self.status != "ok":
                raise NotMeasuredError(self.status, f"{self.name}: {self.reason}") from None
            known = ", ".join(self._values)
            raise KeyError(f"{self.name} has no {name!r}: it has {known}") from None

    def __repr__(self) -> str:
        if "toe" not in self._values:
            return f"<Wheel {self.name}: {self.status}>"
        return f"<Wheel {self.name}: {self.toe}; {self.camber}>"


@frozen(eq=False)
class Covariance(EqualByFields):
    """Covariance of all angles (rad) and lengths (m): `covariance["FL.toe", "FR.toe"]`.

    names: (Q,). matrix: (Q, Q).
    """

    names: tuple[str, ...]
    matrix: Array

    def __getitem__(self, pair: tuple[str, str]) -> float:
        rows = []
        for name in pair:
            if name not in self.names:
                raise KeyError(f"the covariance has no {name!r}: its names are in `names`")
            rows.append(self.names.index(name))
        return float(self.matrix[rows[0], rows[1]])

    def table(self) -> Any:
        """Return a pandas DataFrame. Raises MissingDependencyError."""
        return _pandas().DataFrame(self.matrix, index=self.names, columns=self.names)

    def __repr__(self) -> str:
        return f"<Covariance of {len(self.names)} quantities, rad and m>"


@frozen(eq=False)
class Alignment(Mapping[str, Value]):
    """Alignment of one vehicle: a mapping of all quantities by name, such as `FL.toe`.

    Two are equal when all their quantities are. It can be copied and pickled.
    measurement: the record with the evidence behind it. file: the measurement.json that it was read
    from; None of one that was measured. conformity: to the limits that this file states; None
    without such.
    """

    measurement: Measurement = field(repr=False)
    file: Path | None = field(default=None, repr=False)
    conformity: Conformity | None = field(default=None, repr=False)

    @cached_property
    def wheels(self) -> Mapping[str, Wheel]:
        """Reference wheels RR, RL, FR, FL, then the trials, by name."""
        made = {
            one.observation.name: _wheel(one, self._values)
            for one in self.measurement.wheels
            if one.observation.role in ("reference", "trial")
        }
        return Named(made)

    @cached_property
    def vehicle(self) -> Mapping[str, Value]:
        """Quantities of the vehicle: `rear_total_toe`, `thrust_angle`, `wheelbase` ..."""
        return Named({k: v for k, v in self._values.items() if "." not in k})

    @cached_property
    def covariance(self) -> Covariance:
        """Covariance of the quantities of one position; those of a sweep are not among them."""
        names = tuple(one.name for one in stated(self.measurement))
        return Covariance(names, self.measurement.uncertainty.covariance)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what the user should know: what counts as zero, what was left out."""
        return self.measurement.notes

    @property
    def complete(self) -> bool:
        """Whether every wheel, trial, sweep and run-out was measured."""
        return self.measurement.complete

    def __getitem__(self, name: str) -> Value:
        if name not in self._values:
            raise KeyError(f"there is no {name!r}: list(...) of the alignment names them all")
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(tuple(self.values()))

    @cached_property
    def _values(self) -> dict[str, Value]:
        found = {
            one.name: Value(one.name, one.unit, one.value, one.u, one.expanded, one.dof)
            for one in stated(self.measurement)
        }
        return found | dict(_turned(self.measurement))

    def table(self) -> Any:
        """Return a pandas DataFrame: value, u, U, unit, k, dof by name, in ° and mm.

        Raises MissingDependencyError.
        """
        rows = [(*v.shown, v.k, v.dof) for v in self.values()]
        columns = ["value", "u", "U", "unit", "k", "dof"]
        return _pandas().DataFrame(rows, index=list(self), columns=columns)

    def json(self) -> str:
        """Return measurement.json, the contract `wheelplane/measurement/1`."""
        return to_json(self.measurement, self.conformity)

    def text(
        self,
        *,
        axis: Axis | None = None,
        angles: AngleStyle = "dms",
        convention: Convention = "default",
        rim: str | None = None,
    ) -> str:
        """Return report.txt.

        axis: longitudinal axis of toe, "rear-axle", "centreline", "thrust-line" or "side-bisector";
        by default that of the convention. angles: "dms", "deg", "mm/m", or "mm" at a `rim` such as
        "16in". convention: of signs, "default", "iso-8855" or "german-workshop". Raises InputError.
        """
        view = report_options(self._vertical, "en", axis, angles, convention, rim).view
        return detailed_report(self.measurement, self.conformity, view)

    def html(
        self,
        language: str = "en",
        *,
        axis: Axis | None = None,
        angles: AngleStyle = "dms",
        convention: Convention = "default",
        rim: str | None = None,
    ) -> str:
        """Return report.html, one file that needs no network; options as of `text`."""
        options = report_options(self._vertical, language, axis, angles, convention, rim)
        return html_report(self.measurement, self.conformity, options)

    def save(
        self,
        folder: str | Path,
        *,
        pdf: bool = False,
        language: str = "en",
        axis: Axis | None = None,
        angles: AngleStyle = "dms",
        convention: Convention = "default",
        rim: str | None = None,
    ) -> list[Path]:
        """Write measurement.json and the reports to `folder`; return their paths.

        Options as of `text`. Raises InputError, also for the folder that it was read from, whose
        files hold more; and MissingDependencyError of a PDF.
        """
        written = Path(folder) / RECORD
        if self.file is not None and written.exists() and written.samefile(self.file):
            raise InputError(
                f"{written}: this measurement was read from it, without what only the points of "
                "the scans show: give another folder"
            )
        options = report_options(self._vertical, language, axis, angles, convention, rim)
        wanted = ReportFiles(pdf=pdf)
        return write_reports(self.measurement, Path(folder), self.conformity, options, wanted)

    @property
    def _vertical(self) -> VerticalKind:
        return self.measurement.vertical_kind

    def show(self) -> None:
        """Show the report: inline in a notebook, else in the browser."""
        try:
            notebook = import_module("IPython").get_ipython() is not None
        except ImportError:
            notebook = False
        if notebook:
            display = import_module("IPython.display")
            display.display(display.HTML(_framed(self.html())))
            return
        with tempfile.NamedTemporaryFile(
            "w", suffix=".html", encoding="utf-8", delete=False
        ) as file:
            file.write(self.html())
        webbrowser.open(Path(file.name).as_uri())

    def _repr_html_(self) -> str:
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        table = summary_table(self.measurement, report_options(self._vertical).view)
        return f"<pre>{html.escape(table)}</pre>{notes}"

    def __repr__(self) -> str:
        made = self.measurement.provenance
        what = made.vehicle or made.source
        state = "complete" if self.complete else "incomplete"
        wheels = ", ".join(self.wheels)
        return f"<Alignment of {what}: {wheels}; {len(self)} quantities, {state}>"


def _wheel(result: WheelResult, values: Mapping[str, Value]) -> Wheel:
    seen = result.observation
    measured = values if result.provisional is None else {}
    named = {key.rpartition("."): value for key, value in measured.items()}
    own = {kind: value for (name, _, kind), value in named.items() if name == seen.name}
    return Wheel(
        seen.name,
        result.wheel,
        seen.status,
        in_library_words(seen.reason),
        result.compensated,
        None if result.pose is None else result.pose.centre_m,
        result.normal,
        Named(own),
    )


def _turned(measurement: Measurement) -> Iterator[tuple[str, Value]]:
    """Yield the quantities of sweeps and run-outs that were measured."""
    of_wheels = [
        turned_quantity(measurement, name, record.wheel)
        for records, names in (
            (measurement.steering_axes, WHEEL_BY_SWEEP),
            (measurement.runouts, WHEEL_BY_RUNOUT),
        )
        for record in records
        for name in names
    ]
    cross = [steering_quantity(measurement, name, 0.0) for name in CROSS]
    for one in [*of_wheels, *cross]:
        if isinstance(one.source, Estimate):
            name = one.name if one.wheel is None else f"{one.wheel}.{one.name}"
            known = one.source
            unit = UNITS.get(one.name, "rad")
            yield name, Value(name, unit, known.value, known.u, known.expanded, known.dof)


def _framed(page: str) -> str:
    """Return a report as a frame of its own, so that its styles stay its own."""
    source = html.escape(page, quote=True)
    return f'<iframe srcdoc="{source}" style="width:100%;height:800px;border:0"></iframe>'


def _pandas() -> Any:
    try:
        return import_module("pandas")
    except ImportError as error:
        raise MissingDependencyError(
            "pandas: a table needs it: pip install 'wheelplane[pandas]'"
        ) from error
