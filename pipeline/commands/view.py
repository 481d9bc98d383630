"""`wheelplane view`: the local page."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import click

from pipeline.errors import InputError
from pipeline.web.settings import GIB, Settings

PORT = 8765


@click.command()
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option(
    "--folder",
    "folders",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="DIR",
    help="A folder that the page may read, and save reports to; several times for several. "
    "Without it and SOURCE, the current one.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=PORT, show_default=True)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address to serve at. Any but a loopback one opens the page to the network, to whoever "
    "has the token in the address that is printed; it travels unencrypted.",
)
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
@click.option(
    "--upload-limit", type=click.FloatRange(0.001, 64), default=2, show_default=True, metavar="GB"
)
@click.option(
    "--memory-limit", type=click.FloatRange(0.5, 1024), default=8, show_default=True, metavar="GB",
    help="Of one measurement.",
)  # fmt: skip
@click.option(
    "--time-limit", type=click.FloatRange(1, 86400), default=900, show_default=True, metavar="S",
    help="Of one measurement.",
)  # fmt: skip
def view(
    source: Path | None,
    folders: tuple[Path, ...],
    port: int,
    host: str,
    no_browser: bool,
    upload_limit: float,
    memory_limit: float,
    time_limit: float,
) -> int:
    """Open a page in the browser: load a capture or a five-point file, see its angles, save a
    report.

    SOURCE, a capture, a five-point file or a folder of results, is opened at once. The page is
    served to this machine alone, and shows nothing but what is dropped on it or lies in the
    folders allowed.
    """
    from pipeline.web.server import serve

    allowed = [*folders, *([source.absolute().parent] if source else [])] or [Path.cwd()]
    for folder in allowed:
        if not folder.is_dir():
            raise InputError(f"{folder}: no such folder: check the path")
    if source is not None and not source.exists():
        raise InputError(f"{source}: no such file or folder: check the path")
    start_at = f"#open={len(folders)}/{quote(source.name)}" if source else ""
    settings = Settings(
        folders=tuple(allowed),
        scratch=Path(),
        upload_bytes=int(upload_limit * 1e9),
        seconds=time_limit,
        memory_bytes=int(memory_limit * GIB),
    )
    serve(settings, host, port, start_at, not no_browser, click.echo)
    return 0
