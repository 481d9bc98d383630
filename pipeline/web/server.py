"""Server of the page: where it listens, the address for its user alone, clean shutdown."""

from __future__ import annotations

import errno
import os
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from html import escape
from pathlib import Path

from ..batch.storage.scratch import scratch_folder
from ..errors import InputError
from .security import ENTRY, Guard, guard_for, in_address
from .settings import Endpoint, PageSettings

TRIED_PORTS = 20
SCRATCH = "wheelplane-page-"  # first part of the name of the folder of uploads and results
OPENING = """<!doctype html>
<meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>wheelplane</title><a href="{address}">wheelplane</a>
"""


def serve(
    settings: PageSettings,
    endpoint: Endpoint,
    start_at: str,
    browse: bool,
    notify: Callable[[str], None],
) -> None:
    """Serve until interrupted.

    start_at: the first view, as `open=0/path`. notify: called with messages to the user.
    """
    from .app import admit, create_app
    from .listener import Listener

    with listening_at(endpoint) as (listening, port):
        if endpoint.socket is None and endpoint.port not in (port, 0):
            notify(f"Port {endpoint.port} is in use; using port {port} instead.")
        guard = guard_for(endpoint.host, port)
        with scratch_folder(SCRATCH) as scratch:
            app = create_app(replace(settings, scratch=scratch), guard)
            state = app.config["state"]
            listener = Listener(app, listening, partial(admit, state), settings.upload_bytes)
            address = address_of(endpoint, guard, start_at)
            opening = write_opening(scratch, address)
            notify(announcement(endpoint, address, opening, sys.stdout.isatty()))
            if browse and endpoint.socket is None:  # arguments are seen by all users of a machine
                open_it = partial(webbrowser.open, opening.as_uri())
                threading.Thread(target=open_it, daemon=True).start()
            signal.signal(signal.SIGTERM, signal.default_int_handler)
            try:
                listener.run()  # returns on Ctrl-C
            finally:
                state.jobs.close()
                listener.close()
    notify("Stopped.")


def announcement(endpoint: Endpoint, address: str, opening: Path, private: bool) -> str:
    """Return what is printed at the start; the token only if private, never to a log."""
    complete = address if private else f"the address in {opening}"
    if endpoint.socket is not None:
        forward = f"ssh -L {endpoint.port}:{endpoint.socket.absolute()} {socket.gethostname()}"
        line = f"The page is at the socket {endpoint.socket}: {forward}, then open {complete}"
    elif private:
        line = f"The page is at {address}"
    else:
        line = f"The page is at {address.partition(ENTRY)[0]}/: open {complete}"
    return f"{line}\nPress Ctrl-C to stop it."


def address_of(endpoint: Endpoint, guard: Guard, start_at: str = "") -> str:
    """Return the address for the browser, with the token in its fragment."""
    everywhere = endpoint.host in ("0.0.0.0", "::")  # noqa: S104 - compared, not bound
    name = in_address(socket.gethostname() if everywhere else endpoint.host)
    port = endpoint.port if guard.port is None else guard.port  # forwarded to the Unix socket
    view = f"&{start_at}" if start_at else ""
    return f"http://{name}:{port}{ENTRY}#token={guard.token}{view}"


def write_opening(folder: Path, address: str) -> Path:
    """Write a page that leads to the address, to be read by this user alone."""
    path = folder / "open.html"
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(OPENING.format(address=escape(address)))
    return path


@contextmanager
def listening_at(endpoint: Endpoint) -> Iterator[tuple[socket.socket, int | None]]:
    """Yield a socket that listens, and its port; None for a Unix socket. Raises InputError."""
    if endpoint.socket is None:
        with free_port(endpoint.host, endpoint.port) as listening:
            yield listening, int(listening.getsockname()[1])
        return
    with unix_socket(endpoint.socket) as listening:
        try:
            yield listening, None
        finally:
            endpoint.socket.unlink(missing_ok=True)


def free_port(host: str, port: int) -> socket.socket:
    """Listen on `port` or one of the next; on any free port for 0. Raises InputError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for tried in range(port, min(port + TRIED_PORTS, 65536)):
        listening = socket.socket(family, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((host, tried))
            listening.listen(64)
        except OSError as error:
            listening.close()
            if error.errno != errno.EADDRINUSE:
                raise InputError(
                    f"--host {host} --port {tried}: cannot be used ({error.strerror}): give another"
                ) from error
        else:
            return listening
    raise InputError(f"--port {port}: this and the next {TRIED_PORTS - 1} are in use: give another")


def unix_socket(path: Path) -> socket.socket:
    """Listen at a socket that only this user can open. Raises InputError."""
    if not hasattr(socket, "AF_UNIX"):
        raise InputError("--socket: this system has no Unix sockets: use --port")
    if path.is_socket() and not _answers(path):
        path.unlink()  # of a program that was killed
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        listening.bind(str(path))
    except OSError as error:
        listening.close()
        fact = error.strerror or str(error)
        raise InputError(f"--socket {path}: cannot be used ({fact}): give another path") from error
    finally:
        os.umask(before)
    return listening


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        try:
            client.connect(str(path))
        except OSError as error:
            return error.errno != errno.ECONNREFUSED
    return True
