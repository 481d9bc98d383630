"""Server of the page: port, printed address, clean shutdown."""

from __future__ import annotations

import errno
import logging
import signal
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from .security import Guard, guard_for, in_address
from .settings import PageSettings

TRIED_PORTS = 20


def serve(
    settings: PageSettings,
    host: str,
    port: int,
    start_at: str,
    browse: bool,
    notify: Callable[[str], None],
) -> None:
    """Serve until interrupted.

    start_at: fragment of the address (`#...`) that selects the first view. notify: called with
    messages to the user.
    """
    from werkzeug.serving import make_server

    from .app import create_app

    listening = free_port(host, port)
    bound = int(listening.getsockname()[1])
    if port not in (bound, 0):
        notify(f"Port {port} is in use; using port {bound} instead.")
    guard = guard_for(host, bound)
    with tempfile.TemporaryDirectory(prefix="wheelplane-page-") as scratch, listening:
        app = create_app(replace(settings, scratch=Path(scratch)), guard)
        server = make_server(host, bound, app, threaded=True, fd=listening.fileno())
        logging.getLogger("werkzeug").setLevel(logging.ERROR)  # no line for each request
        address = address_of(host, guard) + start_at
        notify(f"The page is at {address}\nPress Ctrl-C to stop it.")
        if browse:
            threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            server.serve_forever()  # returns on Ctrl-C
        finally:
            app.config["state"].jobs.close()
        notify("Stopped.")


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


def address_of(host: str, guard: Guard) -> str:
    """Return the address for the browser, with the token if one is required."""
    everywhere = host in ("0.0.0.0", "::")  # noqa: S104 - compared, not bound
    name = in_address(socket.gethostname() if everywhere else host)
    return f"http://{name}:{guard.port}/" + (f"?token={guard.token}" if guard.token else "")
