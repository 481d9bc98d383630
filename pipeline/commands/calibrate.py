"""`wheelplane calibrate`: a wheel alignment machine's readings against reference angles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import get_args

import click

from ..calibration import (
    CERTIFICATE_FORM,
    ITEM_FORM,
    PLAN_FORM,
    FaultyTableError,
    Reference,
    by_series,
    calibrate_file,
    load_item,
    load_plan,
    plan_calibration,
    planned_reference,
    readings_form,
)
from ..capture import CaptureOptions, Upright, open_capture
from ..config import Config, load_config, with_scanner
from ..errors import InputError, MissingDependencyError
from ..five_point import FivePointFile, Station, measure_five_point, read_five_point
from ..measure import measure_capture
from ..measurement import Measurement, VerticalKind
from ..report.certificate import FORMS
from ..report.format.view import DigitStyle, View
from ..report.json.calibration import calibration_json, plan_json
from ..report.json.stored import read_measurement, record_of
from ..report.text.calibration import calibration_text
from ..report.text.calibration_plan import plan_text
from ..report.write import write_files, write_result
from ..system import frozen
from ..targets import load_target
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..vehicle import REFERENCE_WHEELS
from .shared.capture_options import (
    capture_options,
    config_option,
    scanner_option,
    target_option,
    whole_vehicle_options,
)
from .shared.certificate_options import CertificateOptions, certificate_options, keep_signed
from .shared.five_point_options import five_point_options, five_point_unit_option, read_station
from .shared.progress import TerminalProgress
from .shared.view_options import digits_option

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


@frozen
class Opening:
    """How the references are read and measured."""

    five_point: bool
    target: str | None
    overrides: CaptureOptions
    scanner: str | None
    config: Config
    length_unit: LengthUnit
    coordinates: Coordinates
    angle_unit: AngleUnit | None
    azimuth: Azimuth
    station: Station | None
    vertical: VerticalKind | None

    def read_points(self, source: Path) -> FivePointFile:
        """Read a five-point file."""
        return read_five_point(
            source,
            length_unit=self.length_unit,
            coordinates=self.coordinates,
            angle_unit=self.angle_unit,
            azimuth=self.azimuth,
        )

    def measure(self, source: Path) -> Measurement:
        """Measure a capture, or a five-point file; read what is measured already."""
        if self.five_point:
            if self.vertical not in (None, "wheels"):
                raise InputError(
                    f"--vertical {self.vertical} with --five-point: five points are measured from "
                    "the plane of the wheel centres: leave it out"
                )
            return measure_five_point(self.read_points(source), self.station)
        record = record_of(source)
        if record is not None:
            return self.read(record)
        with (
            open_capture(source, self.target, self.overrides) as opened,
            TerminalProgress(opened.steps) as progress,
        ):
            config = with_scanner(self.config, self.scanner or opened.scanner)
            return measure_capture(opened, config, progress, vertical=self.vertical or "wheels")

    def read(self, record: Path) -> Measurement:
        """Read a measurement.json. Raises InputError where options of a capture are given, too."""
        given = self.target or self.scanner or self.vertical
        if given or self.overrides != CaptureOptions():
            raise InputError(
                f"{record}: measured already: leave out --target, --scanner, --vertical and the "
                "options of a capture, or name the capture instead"
            )
        return read_measurement(record, str(record))[0]

    def targets(self, source: Path) -> list[str]:
        """Return the names of the reference wheels and trials, without measuring them."""
        if self.five_point:
            trials = len(self.read_points(source).blocks_m) - len(REFERENCE_WHEELS)
            return [*REFERENCE_WHEELS, *(str(number) for number in range(1, trials + 1))]
        record = record_of(source)
        if record is not None:
            return list(Reference(self.read(record)).wheels)
        with open_capture(source, self.target, self.overrides) as opened:
            roles = ("reference", "trial")
            names = [entry.name for entry in opened.entries if entry.role in roles]
            return names if opened.cloud is None else [*REFERENCE_WHEELS, *names]


@click.command()
@click.argument("references", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--item",
    "item_path",
    type=FILE,
    metavar="FILE",
    help="Item file (TOML) of the machine under test; --template writes a form of it.",
)
@click.option(
    "--readings", "readings_path", type=FILE, metavar="FILE", help="Its readings, CSV or XLSX."
)
@click.option("-o", "--output", type=FOLDER, metavar="DIR", help="Folder for the results.")
@click.option("--json", "as_json", is_flag=True, help="Print calibration.json and nothing else.")
@click.option(
    "--template",
    type=FOLDER,
    metavar="DIR",
    help="Folder for empty forms of the item file and of the readings of all trials, instead.",
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 100),
    default=None,
    metavar="N",
    help="--template: number of rows for each point.  [default: 3]",
)
@click.option(
    "--directions", is_flag=True, help="--template: approach each point upwards and downwards."
)
@click.option(
    "--plan",
    "plan_path",
    type=FILE,
    metavar="FILE",
    help="Plan file (TOML) of a calibration to be planned, instead; without REFERENCES the "
    "reference is that of --scanner and --target. --template writes a form of it.",
)
@click.option(
    "--five-point", "five_point", is_flag=True, help="The references are five-point files."
)
@five_point_unit_option
@five_point_options()
@digits_option
@target_option
@whole_vehicle_options
@config_option
@scanner_option
@click.option(
    "--vertical",
    type=click.Choice(get_args(VerticalKind)),
    help="Direction from which camber, caster and SAI of a capture are measured, as of `measure`. "
    " [default: wheels]",
)
@certificate_options
def calibrate(
    references: tuple[Path, ...],
    item_path: Path | None,
    readings_path: Path | None,
    output: Path | None,
    as_json: bool,
    template: Path | None,
    repeats: int | None,
    directions: bool,
    plan_path: Path | None,
    five_point: bool,
    length_unit: LengthUnit,
    coordinates: Coordinates,
    angle_unit: AngleUnit | None,
    azimuth: Azimuth,
    total_station: str | None,
    total_station_position: str | None,
    digits: DigitStyle,
    target: str | None,
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    config: Path | None,
    scanner: str | None,
    vertical: VerticalKind | None,
    issuing: CertificateOptions,
) -> int:
    """Calibrate a wheel alignment machine: its readings against the angles of REFERENCES.

    REFERENCES is a capture, the results of `measure`, or with --five-point a five-point file, whose
    wheels and trials the machine has read as well; or several of them, the references of series 1,
    2, ... in this order.

    \b
    wheelplane calibrate bay --template forms
    wheelplane calibrate bay --item forms/item.toml --readings forms/readings.csv -o results

    Exits with 1 unless every point with a maximum permissible error is conforming, or where
    readings fit another axis, sign, unit or quantity than the declared one far better.
    """  # noqa: D301 - click's mark for lines as they stand is a backspace
    opening = Opening(
        five_point=five_point,
        target=target,
        overrides=capture_options(front, front_point, up),
        scanner=scanner,
        config=load_config(config),
        length_unit=length_unit,
        coordinates=coordinates,
        angle_unit=angle_unit,
        azimuth=azimuth,
        vertical=vertical,
        station=read_station(total_station, total_station_position, coordinates, length_unit),
    )
    if not references and plan_path is None:
        raise click.UsageError("REFERENCES are missing: name a capture, or five-point files")
    if vertical is not None and not references:
        raise InputError(f"--vertical {vertical} without REFERENCES: leave it out")
    if plan_path is not None:
        if readings_path or output or template:
            raise InputError(
                "--plan with --readings, -o or --template: it computes before anything is read: "
                "leave these out"
            )
        return _plan(references, opening, plan_path, item_path, as_json, View(digits=digits))
    if template is not None:
        if readings_path or output or as_json:
            raise InputError(
                "--template with --readings, -o or --json: it writes empty forms: leave these out"
            )
        return _write_forms(references, opening, item_path, template, repeats or 3, directions)
    if directions or repeats is not None:
        raise InputError("--repeats and --directions are of --template: add it, or leave them out")
    if item_path is None or readings_path is None:
        missing = "--item" if item_path is None else "--readings"
        raise InputError(f"{missing} is needed: give the file; --template DIR writes forms of both")
    issuing.check(output)
    item = load_item(item_path)
    measured = [Reference(opening.measure(source)) for source in references]
    try:
        found = calibrate_file(by_series(measured), item, readings_path)
    except FaultyTableError as error:
        for fault in error.faults:
            click.echo(f"wheelplane: {' '.join(fault.split())}", err=True)
        return 2
    view = View(digits=digits)
    record, text = calibration_json(found), calibration_text(found, view)
    files = {"calibration.json": record.encode(), "calibration.txt": text.encode()}
    if output:
        files |= issuing.files(found, opening.config, view, record)
        keep_signed(output, files)
    written = write_result(output, files, "calibration.json", FORMS) if output else []
    if as_json:
        click.echo(record, nl=False)
    else:
        click.echo(text, nl=False)
        for path in written:
            click.echo(f"wrote {path}")
    sound = not found.warnings and not found.doubts
    return 0 if sound and found.decision in (None, "conform") else 1


def _write_forms(
    references: Sequence[Path],
    opening: Opening,
    item_path: Path | None,
    folder: Path,
    repeats: int,
    directions: bool,
) -> int:
    """Write the forms; of the item only where none is given. Nothing is overwritten."""
    from ..batch.results import export  # 0.1 s, which no calibration needs

    if len(references) > 1:
        raise InputError("--template with several references: give one of them")
    item = None if item_path is None else load_item(item_path).item
    columns = readings_form(opening.targets(references[0]), item, repeats, directions)
    forms = {
        "item.toml": ITEM_FORM,
        "plan.toml": PLAN_FORM,
        "certificate.toml": CERTIFICATE_FORM,
    }
    if item is not None:
        forms = {}
    names = [*forms, "readings.csv", "readings.xlsx"]
    there = [name for name in names if (folder / name).exists()]
    if there:
        raise InputError(f"{folder / there[0]}: there already: name another folder for --template")
    written = write_files(folder, {name: form.encode() for name, form in forms.items()})
    path = folder / "readings.csv"
    export.export(path, columns, export.write_csv)
    written.append(path)
    try:
        export.export(folder / "readings.xlsx", columns, export.write_xlsx)
        written.append(folder / "readings.xlsx")
    except MissingDependencyError as error:
        click.echo(f"readings.xlsx is not written: {error}", err=True)
    for path in written:
        click.echo(f"wrote {path}")
    return 0


def _plan(
    references: Sequence[Path],
    opening: Opening,
    path: Path,
    item_path: Path | None,
    as_json: bool,
    view: View,
) -> int:
    """Print what a planned set shows; of a capture, or of the scanner's and the target's files."""
    if item_path is None:
        raise InputError("--item is needed: give the file; --template DIR writes a form of it")
    if len(references) > 1:
        raise InputError("--plan with several references: give one of them, or none")
    item, plan = load_item(item_path).item, load_plan(path)
    config = with_scanner(opening.config, opening.scanner)
    try:
        if references:
            known = Reference(opening.measure(references[0]))
            found = plan_calibration(plan, item, known, None)
        else:
            if opening.target is None:
                raise InputError("--plan without REFERENCES needs --target and --scanner: add them")
            target = load_target(opening.target)
            new = cache(partial(planned_reference, plan, item, target=target, config=config))
            found = plan_calibration(plan, item, new(plan.trials), new)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    click.echo(plan_json(found) if as_json else plan_text(found, view), nl=False)
    return 0
