"""The server: a free port, the address it prints, and an end that leaves nothing behind."""

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
from .settings import Settings

TRIED_PORTS = 20


def serve(
    settings: Settings,
    host: str,
    port: int,
    start_at: str,
    browse: bool,
    tell: Callable[[str], None],
) -> None:
    """Serve until interrupted. start_at: what of the page to show first, after `#`."""
    from werkzeug.serving import make_server

    from .app import create_app

    listening = free_port(host, port)
    bound = int(listening.getsockname()[1])
    if port not in (bound, 0):
        tell(f"Port {port} is taken; port {bound} is used instead.")
    guard = guard_for(host, bound)
    with tempfile.TemporaryDirectory(prefix="wheelplane-page-") as scratch, listening:
        app = create_app(replace(settings, scratch=Path(scratch)), guard)
        server = make_server(host, bound, app, threaded=True, fd=listening.fileno())
        logging.getLogger("werkzeug").setLevel(logging.ERROR)  # a line a request helps nobody
        address = address_of(host, guard) + start_at
        tell(f"The page is at {address}\nPress Ctrl-C to end it.")
        if browse:
            threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            server.serve_forever()  # until Ctrl-C, which it takes itself
        finally:
            app.config["state"].jobs.close()
        tell("Ended.")


def free_port(host: str, port: int) -> socket.socket:
    """A listening socket on `port` or one of the next; any free one for 0. Raises InputError."""
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
                    f"--host {host} --port {tried}: cannot be used ({error.strerror}): name another"
                ) from error
        else:
            return listening
    raise InputError(f"--port {port}: it and the next {TRIED_PORTS - 1} are taken: name another")


def address_of(host: str, guard: Guard) -> str:
    """What a browser is to open, with the token where one is asked for."""
    everywhere = host in ("0.0.0.0", "::")  # noqa: S104 - compared, not bound
    name = in_address(socket.gethostname() if everywhere else host)
    return f"http://{name}:{guard.port}/" + (f"?token={guard.token}" if guard.token else "")
