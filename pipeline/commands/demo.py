"""`wheelplane demo`: a synthetic vehicle, measured, and compared with its truth."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import click

from ..capture import open_capture
from ..config import Config
from ..errors import InputError, fact_of
from ..measure import measure_capture
from ..measurement import Measurement, by_name
from ..report.format.digits import arc, sexagesimal
from ..report.format.layout import aligned
from ..report.write import write_reports
from .shared.progress import TerminalProgress
from .synth import make_capture


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), default="demo-output")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Seed of the synthetic vehicle and its scans.",
)
def demo(folder: Path, seed: int) -> int:
    """Make a synthetic vehicle in FOLDER, scan and measure it, and show both sets of angles."""
    capture, results = folder / "capture", folder / "results"
    mark = folder / ".demo"
    if mark.is_file():
        shutil.rmtree(capture, ignore_errors=True)  # of an earlier demo
    elif results.exists():
        raise InputError(f"{results}: there already, and of no demo: name another folder")
    click.echo(f"Making a vehicle (seed {seed}) and scanning its wheels into {capture} ...")
    make_capture(capture, seed, "saloon", "default", "disc-250", trials=2)
    mark.touch()
    click.echo("Measuring it from the scans alone ...\n")
    with open_capture(capture) as opened, TerminalProgress(opened.steps) as progress:
        measurement = measure_capture(opened, Config(), progress)
    written = write_reports(measurement, results)
    click.echo(compared(measurement, capture / "truth.json"))
    click.echo(
        "\nToe-in and camber with the top outward are positive. u: standard uncertainty (k = 1)."
    )
    for path in written:
        click.echo(f"wrote {path}")
    return 0 if measurement.complete else 1


def compared(measurement: Measurement, truth: Path) -> str:
    """Return a table of measured angles, truth, error and uncertainty, wheel by wheel."""
    try:
        wheels = {wheel["name"]: wheel for wheel in json.loads(truth.read_text())["wheels"]}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"{truth}: not a truth file ({fact_of(error)}): run the demo again"
        ) from error
    rows: list[tuple[str, ...]] = [("name", "wheel", "angle", "measured", "truth", "error", "u")]
    known = by_name(measurement)
    for result in measurement.wheels:
        if result.angles is None:
            continue
        name = result.observation.name
        for angle in ("toe", "camber"):
            true = math.radians(wheels[name][f"{angle}_deg"])
            quantity = known[f"{name}.{angle}"]
            value, expanded = quantity.value, quantity.expanded
            rows.append(
                (
                    name,
                    result.wheel or "",
                    angle,
                    sexagesimal(value, expanded),
                    sexagesimal(true, expanded),
                    arc(value - true, expanded, "+"),
                    arc(quantity.u, quantity.u),
                )
            )
    return aligned(rows, left=3)
