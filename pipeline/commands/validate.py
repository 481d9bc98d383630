"""`wheelplane validate`: dense scans compared with five points, or with the truth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import click

from ..capture import CaptureOptions, Upright, open_capture
from ..config import Config, load_config, with_scanner
from ..errors import InputError
from ..report.format.view import DigitStyle, View
from ..report.json.validation import validation_json
from ..report.validation import validation_report, write_validation
from ..report.write import ReportFiles
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..validation import (
    Against,
    Comparison,
    ComparisonStudy,
    Estimator,
    FivePointOptions,
    Mountings,
    Request,
    is_archive_of_captures,
    validate_archive,
    validate_capture,
    validate_mountings,
)
from .shared.capture_options import (
    capture_options,
    config_option,
    scanner_option,
    target_option,
    whole_vehicle_options,
)
from .shared.five_point_options import five_point_options, five_point_unit_option, read_station
from .shared.options import FiniteRange, option
from .shared.progress import TerminalProgress
from .shared.reporting import report_options
from .shared.view_options import digits_option, language_option

# A mark is resolved to 0.01 mm at best, and a target is hardly wider than the larger. A standard
# uncertainty in another unit is outside: in m, those below 10 mm; in µm, those above 0.05 mm.
AIMING_MM = (0.01, 50.0)
BESIDE = Path("five-point.txt")  # in each capture of an archive


@click.command()
@click.argument("capture", type=click.Path(path_type=Path))
@click.option(
    "--five-point",
    "file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Five-point file; for a folder of captures, its name in each [five-point.txt].",
)
@click.option(
    "--virtual", is_flag=True, help="Compare with five points picked from each scan instead."
)
@click.option(
    "--truth",
    is_flag=True,
    help="Compare with truth.json of a synthetic capture; with --five-point, compare the five "
    "points with it.",
)
@click.option(
    "--against",
    type=click.Choice(["wheel"]),
    help="Compare each target with the wheel that it is mounted on, in the same scan: how it is "
    "mounted.",
)
@click.option(
    "--blocks",
    metavar="NAMES",
    help="Names of the scans that the blocks of five belong to, such as RR,RL,FR,FL,2,1; `-` for "
    "none.",
)
@five_point_unit_option
@five_point_options(former_position="--total-station-at")
@click.option(
    "--method",
    type=click.Choice(["tls", "tcgc-2013"]),
    default="tls",
    show_default=True,
    help="Estimator for the five points: total least squares, or that of the software of 2013.",
)
@click.option(
    "--aiming",
    type=FiniteRange(min=0.0),
    metavar="MM",
    help="Standard uncertainty of aiming at a point, along each axis of the target.",
)
@click.option(
    "--radius",
    type=FiniteRange(min=1.0),
    metavar="MM",
    help="Radius of the circle through the five points of a target: that of --virtual, or what "
    "those of --five-point must have.",
)
@option(
    "--detectable",
    former="--see",
    type=FiniteRange(min=0.0, min_open=True),
    metavar="DEG",
    help="Require that an error of DEG be detectable; otherwise report 'cannot tell'.",
)
@digits_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Folder for the report."
)
@click.option("--json", "as_json", is_flag=True, help="Print validation.json and nothing else.")
@click.option(
    "--html/--no-html", default=True, help="Write the HTML report, validation.html, to DIR."
)
@click.option("--pdf", is_flag=True, help="Write the PDF report, validation.pdf, to DIR.")
@language_option
@target_option
@whole_vehicle_options
@config_option
@scanner_option
def validate(
    capture: Path,
    file: Path | None,
    virtual: bool,
    truth: bool,
    against: Literal["wheel"] | None,
    blocks: str | None,
    length_unit: LengthUnit,
    coordinates: Coordinates,
    angle_unit: AngleUnit | None,
    azimuth: Azimuth,
    method: Estimator,
    total_station: str | None,
    total_station_position: str | None,
    aiming: float | None,
    radius: float | None,
    detectable: float | None,
    digits: DigitStyle,
    output: Path | None,
    as_json: bool,
    html: bool,
    pdf: bool,
    language: str | None,
    target: str | None,
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    config: Path | None,
    scanner: str | None,
) -> int:
    """Compare the angles of CAPTURE with those of a trusted method.

    --against wheel compares each target with the wheel behind it instead: how it is mounted.

    CAPTURE is one capture, or a folder of many. Exits with 0 if both methods agree; with 1 if they
    disagree, if the comparison cannot tell, or if a part could not be compared.
    """
    points = FivePointOptions(
        length_unit=length_unit,
        coordinates=coordinates,
        angle_unit=angle_unit,
        azimuth=azimuth,
        blocks=blocks,
        station=read_station(total_station, total_station_position, coordinates, length_unit),
        aiming_m=None if aiming is None else _aiming_m(aiming),
        radius_m=None if radius is None or virtual else radius / 1e3,
        method=method,
    )
    settings = load_config(config)
    options = report_options(settings.report, language, View(digits=digits))
    if pdf and output is None:
        raise InputError("--pdf without -o DIR: name the folder that validation.pdf goes to")
    many = is_archive_of_captures(capture)
    request = Request(
        against=_against(file, virtual, truth, against, many),
        file=_file(file, virtual or against == "wheel", truth, many),
        points=points,
        radius_m=radius / 1e3 if radius is not None and virtual else None,
        to_detect_rad=None if detectable is None else math.radians(detectable),
    )
    overrides = capture_options(front, front_point, up)
    _check_used(request, overrides, many)
    found: Comparison | ComparisonStudy | Mountings
    if many:
        with TerminalProgress(sum(1 for _ in capture.iterdir()), "comparing") as progress:
            found = validate_archive(capture, target, settings, scanner, request, progress)
        complete = found.complete
    else:
        found = _one(capture, target, overrides, settings, scanner, request)
        complete = not found.missing
    wanted = ReportFiles(html=html, pdf=pdf)
    written = write_validation(found, output, options, wanted) if output else []
    if as_json:
        click.echo(validation_json(found), nl=False)
    else:
        click.echo(validation_report(found, options.view), nl=False)
        for path in written:
            click.echo(f"wrote {path}")
    agrees = isinstance(found, Mountings) or found.verdict == "agree"
    return 0 if complete and agrees else 1


def _one(
    source: Path,
    target: str | None,
    overrides: CaptureOptions,
    settings: Config,
    scanner: str | None,
    request: Request,
) -> Comparison | Mountings:
    with (
        open_capture(source, target, overrides) as opened,
        TerminalProgress(opened.steps) as progress,
    ):
        settings = with_scanner(settings, scanner or opened.scanner)
        if request.against == "wheel":
            return validate_mountings(opened, settings, progress)
        return validate_capture(opened, settings, request, progress)


def _aiming_m(aiming_mm: float) -> float:
    """Return it in metres. Raises InputError where it is in another unit beyond doubt."""
    least, most = AIMING_MM
    if aiming_mm and not least <= aiming_mm <= most:
        unit, factor = ("m", 1e3) if aiming_mm < least else ("µm", 1e-3)
        raise InputError(
            f"--aiming is {aiming_mm:g} mm, and points are aimed at within {least:g} to {most:g} "
            f"mm: if it is in {unit}, give {aiming_mm * factor:g}"
        )
    return aiming_mm / 1e3


def _against(
    file: Path | None, virtual: bool, truth: bool, wheel: Literal["wheel"] | None, many: bool
) -> Against:
    if wheel and (virtual or truth or file is not None):
        raise InputError(
            "--against wheel with --virtual, --truth or --five-point: compare with one at a time"
        )
    if wheel and many:
        raise InputError("--against wheel with a folder of captures: give one of them")
    if virtual and (truth or file is not None):
        raise InputError("--virtual with --truth or --five-point: compare with one at a time")
    if wheel:
        return wheel
    if not (virtual or truth or file or many):
        raise InputError(
            "nothing to compare with: add --five-point FILE, --virtual, --truth or --against wheel"
        )
    if truth:
        return "truth"
    return "virtual" if virtual else "five-point"


def _check_used(request: Request, overrides: CaptureOptions, many: bool) -> None:
    """Raise InputError for options that the comparison would ignore."""
    if many and overrides != CaptureOptions():
        raise InputError(
            "--front, --front-point and --up with a folder of captures: leave them out, and give "
            "front, front_point and up in the capture.toml of each"
        )
    if request.points.radius_m is not None and request.file is None:
        raise InputError(
            "--radius without --virtual or --five-point: leave it out, or add one of them"
        )
    method = request.points.method if request.against == "virtual" else "tls"
    if request.file is None and request.points != FivePointOptions(method=method):
        raise InputError(
            "options of a five-point file, but none is read: give it with --five-point, or leave "
            "out --blocks, --length-unit, --coordinates, --method, --aiming, --total-station"
        )


def _file(file: Path | None, virtual: bool, truth: bool, many: bool) -> Path | None:
    """Return the five-point file: of one capture from here, of many from each capture."""
    if file is None:
        return None if virtual or truth else BESIDE
    if many and (file.is_absolute() or ".." in file.parts):
        raise InputError(
            f"--five-point {file}: for a folder of captures, give the file's name in each"
        )
    return file if many else file.absolute()
