"""`wheelplane manual`: the user manual in the browser."""

from __future__ import annotations

import os
import webbrowser
from pathlib import Path

import click

from .. import __version__
from ..errors import InputError
from ..manual.build import pages
from ..report.write import write_whole


@click.command()
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for the pages; by default, the user's cache.",
)
@click.option("--browser/--no-browser", default=True, help="Open the first page in the browser.")
def manual(output: Path | None, browser: bool) -> int:
    """Write the user manual (in English) as web pages, and open it.

    The pages need neither network nor server: the folder can be copied, zipped or printed.
    """
    folder = cache_folder() if output is None else output
    made = pages()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be made ({error.strerror}): give another folder with -o"
        ) from error
    for name, content in made.items():
        write_whole(folder / name, content)
    first = (folder / "index.html").absolute()
    click.echo(f"wrote {len(made)} files; the manual begins at {first}")
    if browser and not webbrowser.open(first.as_uri()):
        click.echo("no browser was found: open that file yourself")
    return 0


def cache_folder() -> Path:
    """Return the folder of this version's pages, below $XDG_CACHE_HOME or ~/.cache."""
    named = os.environ.get("XDG_CACHE_HOME")
    try:
        base = Path(named) if named else Path.home() / ".cache"
    except RuntimeError as error:
        raise InputError("the user has no home folder: give a folder with -o") from error
    return base / "wheelplane" / f"manual-{__version__}"
