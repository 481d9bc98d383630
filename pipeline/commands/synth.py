"""`wheelplane synth`: a capture of a synthetic vehicle with known angles."""

from __future__ import annotations

import importlib
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..config import config_file
from ..errors import InputError, MissingDependencyError
from ..targets import names_of_targets
from .shared.progress import TerminalProgress


@click.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed; the same one gives the same bytes.",
)
@click.option(
    "--vehicle",
    default="saloon",
    show_default=True,
    metavar="NAME|FILE",
    help="Vehicle, by name or file (TOML).",
)
@click.option(
    "--scanner",
    default="default",
    show_default=True,
    metavar="NAME|FILE",
    help="Scanner, by name or file (TOML).",
)
@click.option(
    "--target",
    default="disc-250",
    show_default=True,
    metavar="NAME|FILE",
    help="Target on the wheels, by name or file (TOML); wheel,RR=disc-250 where single wheels have "
    "another than the bare ones.",
)
@click.option(
    "--machine",
    metavar="NAME|FILE",
    help="Wheel alignment machine under test, by name or file (TOML), whose item.toml and "
    "readings.csv are written too.",
)
@click.option(
    "--trials",
    type=click.IntRange(min=0),
    default=None,
    help="Number of further scans of the wheels, each with angles of its own.  [default: 2]",
)
@click.option(
    "--whole",
    type=click.Choice(["ply", "e57"]),
    is_flag=False,
    flag_value="ply",
    default=None,
    help="Format of a whole-vehicle scan in a bay, made instead: vehicle.ply, or vehicle.e57 with "
    "one posed scan a station. Give it after OUT; without a value it is ply.",
)
@click.option(
    "--points",
    type=click.FloatRange(1e4, 1e9),
    default=None,
    metavar="N",
    help="Number of points of the whole-vehicle scan, approximately, such as 20e6; by default "
    "that of [panorama] in the scanner file.",
)
def synth(
    out: Path,
    seed: int,
    vehicle: str,
    scanner: str,
    target: str,
    machine: str | None,
    trials: int | None,
    whole: str | None,
    points: float | None,
) -> int:
    """Make a vehicle, scan its wheels, and write capture, five-point file and truth.json to OUT.

    With --whole the scanner is moved round the vehicle, and all that it sees is one point cloud:
    the car and its targets, floor, walls, a lift, a workbench, people. truth.json then holds the
    positions of the stations, the rows of each object, and, in `frame`, which way is forward in the
    cloud's coordinates.

    \b
    wheelplane synth car --seed 7
    wheelplane synth car --seed 7 --whole --points 2e6
    wheelplane synth car --seed 7 --whole e57 --target ring-300
    """  # noqa: D301 - click's mark for lines as they stand is a backspace
    if whole is None:
        if points is not None:
            raise click.UsageError("--points without --whole: add --whole, or leave --points out")
        count = 2 if trials is None else trials
        scans = make_capture(out, seed, vehicle, scanner, target, count, machine)
        more = "" if machine is None else "item.toml, readings.csv, "
        click.echo(f"wrote {out}: {scans} scans, five-point.txt, capture.toml, {more}truth.json")
        return 0
    if trials is not None:
        raise click.UsageError(
            "--trials with --whole: trials are scans of single wheels: leave one of them out"
        )
    if machine is not None:
        raise click.UsageError(
            "--machine with --whole: it reads trials, which are scans of single wheels: leave one "
            "of them out"
        )
    files = (vehicle, scanner, target)
    settings = {"form": whole, "points": None if points is None else round(points)}
    made = _make(
        lambda: importlib.import_module("wheelplane_synth.output.whole").write_whole,
        out,
        seed,
        files,
        settings,
    )
    count = sum(scan["points"] for scan in made.used["scans"])
    click.echo(f"wrote {out}: vehicle.{whole}, {count} points, five-point.txt, truth.json")
    front = ",".join(f"{axis:.2f}" for axis in made.to_json()["frame"]["forward"])
    cloud, shown = shlex.quote(str(out / f"vehicle.{whole}")), shlex.quote(target)
    click.echo(f"measure it: wheelplane measure {cloud} --target {shown} --front={front}")
    return 0


def make_capture(
    out: Path,
    seed: int,
    vehicle: str,
    scanner: str,
    target: str,
    trials: int,
    machine: str | None = None,
) -> int:
    """Write a capture of single wheels; return the number of scans."""
    files = (vehicle, scanner, target)
    settings: dict[str, Any] = {"trials": trials}
    if machine is not None:
        settings["machine"] = config_file("machines", machine)
    made = _make(
        lambda: importlib.import_module("wheelplane_synth.output.archive").write_capture,
        out,
        seed,
        files,
        settings,
    )
    return len(made.wheels)


def _make(
    writer: Callable[[], Any],
    out: Path,
    seed: int,
    files: tuple[str, str, str],
    settings: dict[str, Any],
) -> Any:
    """Call the generator, a package that shares no formula with this one; return the truth.

    files: names of vehicle, scanner and target.
    """
    errors = importlib.import_module("wheelplane_synth.errors")
    vehicle, scanner, named = files
    target, own = names_of_targets(named)
    if target is None:
        raise InputError(
            f"--target {named}: put a target of all other wheels before: wheel,{named}"
        )
    if own:
        settings = settings | {
            "targets": {wheel: config_file("targets", name) for wheel, name in own.items()}
        }
    try:
        with TerminalProgress(4 + settings.get("trials", 0), "scanned") as progress:
            return writer()(
                out,
                seed=seed,
                vehicle=config_file("vehicles", vehicle),
                scanner=config_file("scanners", scanner),
                target=config_file("targets", target),
                progress=progress,
                **settings,
            )
    except errors.SynthError as error:
        raise InputError(str(error)) from error
    except ImportError as error:
        raise MissingDependencyError(
            f"the generator cannot be imported ({error}): pip install 'wheelplane[synth]'"
        ) from error
