"""`wheelplane targets`: known targets, their dimensions, and drawings of them."""

from __future__ import annotations

from pathlib import Path

import click

from ..config import config_folder
from ..errors import InputError
from ..report.format.layout import aligned
from ..targets import PatternTarget, Target, WheelTarget, load_target


@click.command()
@click.argument("name", required=False)
@click.option(
    "-o",
    "--output",
    "folder",
    type=click.Path(path_type=Path),
    help="Folder for drawings to scale (SVG), one a target.",
)
def targets(name: str | None, folder: Path | None) -> int:
    """List the targets that --target knows by name; a TOML file describes any other.

    NAME, a known target or a TOML file, shows every value of that target.
    """
    names = [name] if name else known_targets()
    loaded = {one: load_target(one) for one in names}
    if name:
        click.echo(in_full(name, loaded[name]))
    else:
        click.echo(as_table(loaded))
    if folder is not None:
        for path in _drawn(loaded, folder):
            click.echo(f"Wrote {path}")
    return 0


def known_targets() -> list[str]:
    """Return the names of the targets that are shipped."""
    return sorted(path.stem for path in (config_folder() / "targets").glob("*.toml"))


def as_table(loaded: dict[str, Target]) -> str:
    """Return a table of the targets: shape, size, holes or print, thickness."""
    rows = [("name", "shape", "size", "holes or print", "thickness")]
    for name, target in loaded.items():
        size = _size(target)
        rows.append((name, target.shape, size, _inside(target), _mm(target.thickness)))
    return aligned(rows, left=4)


def in_full(name: str, target: Target) -> str:
    """Return every value of a target, lengths in mm."""
    rows = [(name, target.description)]
    for key, value in target.model_dump().items():
        if key in target.lengths:
            rows.append((key, "-" if value is None else _lengths(value)))
        elif value is None:
            continue
        elif isinstance(value, dict):
            rows += [(f"{key}.{k}", ", ".join(map(str, ids))) for k, ids in value.items()]
        elif isinstance(value, tuple):
            rows.append((key, ", ".join(map(str, value))))
        else:
            rows.append((key, str(value)))
    return aligned(rows, left=2)


def _size(target: Target) -> str:
    return target.rim or "-" if isinstance(target, WheelTarget) else target.edge.size_text


def _inside(target: Target) -> str:
    holes = target.region.holes_m
    if isinstance(target, PatternTarget):
        return f"{target.rows} x {target.columns} {target.kind}, {_mm(target.pitch)} apart"
    if len(holes) == 0:
        return "-"
    return f"{len(holes)} of {_mm(2.0 * float(holes[0, 2]))}"


def _lengths(value: float | tuple[float, ...]) -> str:
    return ", ".join(_mm(v) for v in value) if isinstance(value, tuple) else _mm(value)


def _mm(length_m: float | None) -> str:
    return "-" if length_m is None else f"{length_m * 1e3:g} mm"


def _drawn(loaded: dict[str, Target], folder: Path) -> list[Path]:
    """Draw the targets; return the files. Raises InputError where they cannot be written."""
    from ..report.plots.target import target_svg

    made = {name: one for name, one in loaded.items() if not isinstance(one, WheelTarget)}
    if not made:
        raise InputError("a wheel itself is no target to make: nothing to draw; leave out -o")
    paths = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, target in made.items():
            path = folder / f"{Path(name).stem}.svg"
            path.write_text(target_svg(Path(name).stem, target), encoding="utf-8")
            paths.append(path)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): give another folder with -o"
        ) from error
    return paths
