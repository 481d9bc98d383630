"""`wheelplane targets`: the known targets."""

from __future__ import annotations

import click

from pipeline.config import config_folder
from pipeline.report.layout import aligned
from pipeline.targets import load_target


@click.command()
def targets() -> int:
    """List the targets that --target knows by name; a TOML file describes any other."""
    rows = [("name", "shape", "diameter", "thickness")]
    for path in sorted((config_folder() / "targets").glob("*.toml")):
        target = load_target(path.stem)
        thickness = "-" if target.thickness is None else f"{target.thickness * 1e3:g} mm"
        rows.append((path.stem, target.shape, f"{target.diameter * 1e3:g} mm", thickness))
    click.echo(aligned(rows, left=2))
    return 0
