"""`wheelplane synth`: a capture of a made vehicle with known angles."""

from __future__ import annotations

import importlib
from pathlib import Path

import click

from pipeline.commands.progress import Progress
from pipeline.config import config_file
from pipeline.errors import InputError, MissingDependencyError


@click.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="The same seed gives the same bytes.",
)
@click.option("--vehicle", default="saloon", show_default=True, metavar="NAME|FILE")
@click.option("--scanner", default="default", show_default=True, metavar="NAME|FILE")
@click.option("--target", default="disc-250", show_default=True, metavar="NAME|FILE")
@click.option(
    "--trials",
    type=click.IntRange(min=0),
    default=2,
    show_default=True,
    help="Further scans of the wheels, each with angles of its own.",
)
def synth(out: Path, seed: int, vehicle: str, scanner: str, target: str, trials: int) -> int:
    """Make a vehicle, scan its wheels, and write capture, five-point file and truth.json to OUT."""
    scans = make_capture(out, seed, vehicle, scanner, target, trials)
    click.echo(f"wrote {out}: {scans} scans, five-point.txt, capture.toml, truth.json")
    return 0


def make_capture(out: Path, seed: int, vehicle: str, scanner: str, target: str, trials: int) -> int:
    """Call synth, a package of its own that shares no formula with this one; how many scans."""
    errors = importlib.import_module("synth.errors")
    archive = importlib.import_module("synth.archive")
    try:
        with Progress(4 + trials, "scanned") as progress:
            truth = archive.write_capture(
                out,
                seed=seed,
                vehicle=config_file("vehicles", vehicle),
                scanner=config_file("scanners", scanner),
                target=config_file("targets", target),
                trials=trials,
                progress=progress,
            )
        return len(truth.wheels)
    except errors.SynthError as error:
        raise InputError(str(error)) from error
    except ImportError as error:
        raise MissingDependencyError(
            f"the generator does not load ({error}): pip install trimesh open3d libusb-package"
        ) from error
