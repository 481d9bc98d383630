"""`wheelplane validate`: the dense method against five points, or against the truth."""

from __future__ import annotations

import math
from pathlib import Path

import click

from ..capture import CaptureOptions, Upright, open_capture
from ..config import Config, load_config, load_station, with_scanner
from ..errors import InputError
from ..report.json.validation import validation_json
from ..report.write import validation_report, write_validation
from ..units import AngleUnit, Azimuth, Coordinates, LengthUnit
from ..validation import (
    Against,
    Comparison,
    ComparisonStudy,
    Estimator,
    FivePointOptions,
    Request,
    is_archive_of_captures,
    validate_archive,
    validate_capture,
)
from .options import three_numbers, told, whole_vehicle_options
from .progress import Progress

BESIDE = Path("five-point.txt")  # in each capture of an archive


@click.command()
@click.argument("capture", type=click.Path(path_type=Path))
@click.option(
    "--five-point",
    "file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Five points a wheel; of an archive, the file's name in each capture [five-point.txt].",
)
@click.option("--virtual", is_flag=True, help="Five points picked from each scan instead.")
@click.option(
    "--truth",
    is_flag=True,
    help="Against truth.json of made captures; with --five-point, that method is judged.",
)
@click.option(
    "--blocks",
    metavar="NAMES",
    help="The scan of each block of five, such as RR,RL,FR,FL,2,1; `-` for none.",
)
@click.option("--length-unit", type=click.Choice(["m", "mm", "in"]), default="m", show_default=True)
@click.option(
    "--coordinates",
    type=click.Choice(["cartesian", "spherical"]),
    default="cartesian",
    show_default=True,
    help="Of the five points: x y z, or range azimuth zenith of a total station.",
)
@click.option("--angle-unit", type=click.Choice(["deg", "gon", "rad"]), help="With spherical.")
@click.option(
    "--azimuth",
    type=click.Choice(["auto", "clockwise", "counterclockwise"]),
    default="auto",
    show_default=True,
)
@click.option(
    "--method",
    type=click.Choice(["tls", "tcgc-2013"]),
    default="tls",
    show_default=True,
    help="Of the five points: total least squares, or the estimator of 2013.",
)
@click.option(
    "--total-station",
    metavar="NAME|FILE",
    help="Of the five points, such as leica-tm30: its uncertainty, not their scatter, counts.",
)
@click.option(
    "--total-station-at",
    metavar="X,Y,Z",
    help="Where it stood, in the five points' coordinates and unit.",
)
@click.option(
    "--aiming",
    type=click.FloatRange(min=0.0),
    metavar="MM",
    help="Standard uncertainty of the place of a point aimed at, along each axis of the face.",
)
@click.option(
    "--radius", type=click.FloatRange(min=1.0), metavar="MM", help="Of the virtual five points."
)
@click.option(
    "--see",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="DEG",
    help="An error that must be seen: the verdict is 'cannot tell' where it would not be.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Write here.")
@click.option("--json", "as_json", is_flag=True, help="Print validation.json and nothing else.")
@click.option("--target", metavar="NAME|FILE", help="As of `measure`.")
@whole_vehicle_options
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="As of `measure`.")
@click.option("--scanner", metavar="NAME|FILE", help="The laser scanner, as of `measure`.")
def validate(
    capture: Path,
    file: Path | None,
    virtual: bool,
    truth: bool,
    blocks: str | None,
    length_unit: LengthUnit,
    coordinates: Coordinates,
    angle_unit: AngleUnit | None,
    azimuth: Azimuth,
    method: Estimator,
    total_station: str | None,
    total_station_at: str | None,
    aiming: float | None,
    radius: float | None,
    see: float | None,
    output: Path | None,
    as_json: bool,
    target: str | None,
    front: str | None,
    front_point: str | None,
    up: Upright | None,
    config: Path | None,
    scanner: str | None,
) -> int:
    """Compare the angles of CAPTURE with those of a method that is trusted.

    CAPTURE is one, or a folder of many. Exits with 0 where both agree, with 1 where they do not,
    where it cannot be told, or where a part could not be compared.
    """
    points = FivePointOptions(
        length_unit=length_unit,
        coordinates=coordinates,
        angle_unit=angle_unit,
        azimuth=azimuth,
        blocks=blocks,
        station=None if total_station is None else load_station(total_station),
        place=None
        if total_station_at is None
        else three_numbers("--total-station-at", total_station_at),
        aiming_m=None if aiming is None else aiming / 1e3,
        method=method,
    )
    settings = load_config(config)
    many = is_archive_of_captures(capture)
    request = Request(
        against=_against(file, virtual, truth, many),
        file=_file(file, virtual, truth, many),
        points=points,
        radius_m=None if radius is None else radius / 1e3,
        see_rad=None if see is None else math.radians(see),
    )
    said = told(front, front_point, up)
    _check_used(request, said, many)
    found: Comparison | ComparisonStudy
    if many:
        with Progress(sum(1 for _ in capture.iterdir()), "comparing") as progress:
            found = validate_archive(capture, target, settings, scanner, request, progress)
        complete = found.complete
    else:
        found = _one(capture, target, said, settings, scanner, request)
        complete = not found.missing
    written = write_validation(found, output) if output else []
    if as_json:
        click.echo(validation_json(found), nl=False)
    else:
        click.echo(validation_report(found), nl=False)
        for path in written:
            click.echo(f"wrote {path}")
    return 0 if complete and found.verdict == "agree" else 1


def _one(
    source: Path,
    target: str | None,
    said: CaptureOptions,
    settings: Config,
    scanner: str | None,
    request: Request,
) -> Comparison:
    with open_capture(source, target, said) as opened, Progress(opened.steps) as progress:
        settings = with_scanner(settings, scanner or opened.scanner)
        return validate_capture(opened, settings, request, progress)


def _against(file: Path | None, virtual: bool, truth: bool, many: bool) -> Against:
    if virtual and (truth or file is not None):
        raise InputError("--virtual with --truth or --five-point: compare with one at a time")
    if not (virtual or truth or file or many):
        raise InputError(
            "nothing is named to compare with: add --five-point FILE, --virtual or --truth"
        )
    if truth:
        return "truth"
    return "virtual" if virtual else "five-point"


def _check_used(request: Request, said: CaptureOptions, many: bool) -> None:
    """Raise InputError for options that the comparison would leave unread."""
    if many and said != CaptureOptions():
        raise InputError(
            "--front, --front-point and --up with a folder of captures: each is told by its own "
            "capture.toml, as front, front_point and up: leave them out"
        )
    if request.radius_m is not None and request.against != "virtual":
        raise InputError("--radius without --virtual: it is of the virtual five points")
    method = request.points.method if request.against == "virtual" else "tls"
    if request.file is None and request.points != FivePointOptions(method=method):
        raise InputError(
            "options of a five-point file, but none is read: name it with --five-point, or leave "
            "out --blocks, --length-unit, --coordinates, --method, --aiming, --total-station"
        )


def _file(file: Path | None, virtual: bool, truth: bool, many: bool) -> Path | None:
    """Of one capture, from here; of many, from each capture."""
    if file is None:
        return None if virtual or truth else BESIDE
    if many and (file.is_absolute() or ".." in file.parts):
        raise InputError(
            f"--five-point {file}: of an archive, give the file's name in each capture"
        )
    return file if many else file.absolute()
