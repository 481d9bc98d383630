"""`wheelplane view`: the local web page."""

from __future__ import annotations

import tempfile
from pathlib import Path
from urllib.parse import quote

import click

from ..config import load_config, read_toml
from ..errors import InputError
from ..web.settings import GIB, Endpoint, PageSettings
from .shared.capture_options import config_option
from .shared.options import FiniteRange


@click.command()
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option(
    "--folder",
    "folders",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="DIR",
    help="Folder that the page may read from and save reports to; may be repeated. By default, "
    "without SOURCE, the current folder.",
)
@config_option
@click.option(
    "--own",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder with your own files in targets, scanners and tolerances, which the page offers by "
    "name, and settings.toml, which is used as with --config.",
)
@click.option(
    "--results",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder that keeps what the page measures, with points and address, for the next start; "
    "made where it is missing. Without it, results end with the program.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=Endpoint.port,
    show_default=True,
    help="TCP port to serve at; 0 takes a free one. With --socket: the port forwarded to it.",
)
@click.option(
    "--host",
    default=Endpoint.host,
    show_default=True,
    metavar="ADDRESS",
    help="Address to serve at. Any but a loopback address opens the page to the network: to "
    "anyone with the token in the printed address, unencrypted.",
)
@click.option(
    "--socket",
    type=click.Path(path_type=Path),
    metavar="PATH",
    help="Unix socket to serve at instead of a port, which only you can open; for ssh -L.",
)
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
@click.option(
    "--upload-limit", type=FiniteRange(0.001, 64), default=2, show_default=True, metavar="GB",
    help="Size limit of one upload.",
)  # fmt: skip
@click.option(
    "--memory-limit", type=FiniteRange(0.5, 1024), default=8, show_default=True, metavar="GB",
    help="Memory limit of one measurement.",
)  # fmt: skip
@click.option(
    "--time-limit", type=FiniteRange(1, 86400), default=900, show_default=True, metavar="S",
    help="Time limit of one measurement.",
)  # fmt: skip
def view(
    source: Path | None,
    folders: tuple[Path, ...],
    config: Path | None,
    own: Path | None,
    results: Path | None,
    port: int,
    host: str,
    socket: Path | None,
    no_browser: bool,
    upload_limit: float,
    memory_limit: float,
    time_limit: float,
) -> int:
    """Open a page in the browser: load a capture or a five-point file, see its angles, save a
    report.

    SOURCE, a capture, a five-point file, a measurement.json or a folder of results, is opened at
    once. The page is served to this machine only, to browsers that open the printed address with
    its token, and shows only files that are dropped on it or lie in the allowed folders; SOURCE
    itself, or the folder of a file, is one of them.
    """
    from ..web.server import serve

    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{folder}: no such folder: check the path")
    if source is not None and not source.exists():
        raise InputError(f"{source}: no such file or folder: check the path")
    config = config or settings_of(own)
    load_config(config)  # a fault of it is reported before the page opens
    check_own(own)
    if results is not None:
        make_results(results)
    allowed, start_at = opened(source, folders) if source else (folders or (Path.cwd(),), "")
    settings = PageSettings(
        folders=allowed,
        scratch=Path(),
        upload_bytes=int(upload_limit * 1e9),
        seconds=time_limit,
        memory_bytes=int(memory_limit * GIB),
        config=None if config is None else config.resolve(),
        own=None if own is None else own.resolve(),
        results=None if results is None else results.resolve(),
    )
    endpoint = Endpoint(host, port, socket)
    serve(settings, endpoint, start_at, not no_browser, click.echo)
    return 0


def make_results(folder: Path) -> None:
    """Make the folder of results where it is missing. Raises InputError if it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        fact = error.strerror or str(error)
        raise InputError(f"--results {folder}: cannot be written ({fact}): give another") from error


SETTINGS = "settings.toml"


def settings_of(own: Path | None) -> Path | None:
    """Return the settings in the folder of the user's files, if there are any."""
    found = None if own is None else own / SETTINGS
    return found if found is not None and found.is_file() else None


def check_own(own: Path | None) -> None:
    """Raise InputError or ConfigError for a folder, or a file in it, that the page cannot offer."""
    from ..measurement import load_tolerance
    from ..targets import load_target
    from ..web.content.choices import KINDS, own_files

    if own is None:
        return
    files = {kind: own_files(own, kind) for kind in KINDS}
    if not own.is_dir() or not (any(files.values()) or settings_of(own)):
        raise InputError(
            f"{own}: holds none of {', '.join(f'{kind}/*.toml' for kind in KINDS)} and no "
            f"{SETTINGS}: check the path"
        )
    for path in files["targets"].values():
        load_target(str(path))
    for path in files["tolerances"].values():
        load_tolerance(str(path))
    for path in files["scanners"].values():
        read_toml(path)


def opened(source: Path, folders: tuple[Path, ...]) -> tuple[tuple[Path, ...], str]:
    """Return the allowed folders with `source`, and the part of the address that opens it.

    A folder outside `folders` is added itself, a file outside them adds its own folder.
    """
    from ..web.files.folders import kind_of_folder

    path = source.resolve()
    own = path if path.is_dir() else path.parent
    root = next((f for f in folders if path.is_relative_to(f.resolve())), own)
    allowed = folders if root in folders else (own, *folders)
    kind = kind_of_folder(path) if path.is_dir() else "file"
    if kind == "folder":  # of captures, perhaps: the user chooses one on the page
        return allowed, ""
    relative = path.relative_to(root.resolve()).as_posix()
    view = "archive" if kind == "results" else "open"
    return allowed, f"{view}={allowed.index(root)}/{quote('' if relative == '.' else relative)}"
