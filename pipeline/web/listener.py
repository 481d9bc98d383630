"""Server of the page (waitress): a few threads, connections that end, bodies of admitted requests.

waitress receives a request in its main thread, which takes any number of slow connections, and
calls the application from one of a few others once all of it is there, bodies over half a megabyte
in a temporary file. So a body is received only if the request may do what it asks for.
"""

from __future__ import annotations

import json
import logging
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from .security import RefusedError, response_headers

if TYPE_CHECKING:
    from flask import Flask
    from waitress.channel import HTTPChannel

Admit = Callable[[str, str, Mapping[str, str]], None]

CONNECTIONS = 100  # above this, the one idle for longest is closed for each new one
LIMITS = {
    "threads": 8,
    "backlog": 1024,
    "connection_limit": 4 * CONNECTIONS,  # not accepted before others have gone; 3 files each
    "channel_timeout": 60,  # seconds without a byte
    "cleanup_interval": 5,
    "recv_bytes": 1 << 18,
    "asyncore_use_poll": True,
    "log_socket_errors": False,
    "ident": None,
}


class Listener:
    """Server of an application at a bound socket.

    admit: called with method, path and headers before a body is received; raises RefusedError.
    most_bytes: of a body.
    """

    def __init__(self, app: Flask, listening: socket.socket, admit: Admit, most_bytes: int) -> None:
        from waitress.server import BaseWSGIServer, create_server

        logging.getLogger("waitress").setLevel(logging.ERROR)  # no line for a full queue
        self._map: dict[int, Any] = {}
        create_server(
            app,
            map=self._map,
            sockets=[listening],
            max_request_body_size=most_bytes + 1,
            **LIMITS,
        )
        self._server = next(s for s in self._map.values() if isinstance(s, BaseWSGIServer))
        self._server.channel_class, self._server.has_ended = _channel(admit), False

    def run(self) -> None:
        """Serve until KeyboardInterrupt, or until `stop` is called in another thread."""
        from waitress import wasyncore

        try:
            wasyncore.loop(timeout=1.0, use_poll=True, map=self._map)
        except KeyboardInterrupt:
            self._close_all()

    def stop(self) -> None:
        """End `run`.

        Awake for another reason, it may end before it is woken for this one: what would have done
        so is closed then.
        """
        with suppress(OSError):
            self._server.trigger.pull_trigger(self._close_all)

    def _close_all(self) -> None:
        from waitress import wasyncore

        self._server.has_ended = True
        wasyncore.close_all(self._map)

    def close(self) -> None:
        """End the threads; call after what they may wait for has ended."""
        self._server.task_dispatcher.shutdown()


def _channel(admit: Admit) -> type[HTTPChannel]:
    """Return the class of connections that receive a body only after `admit`."""
    from waitress.channel import HTTPChannel
    from waitress.parser import HTTPRequestParser
    from waitress.utilities import Error

    class RefusalError(Error):  # type: ignore[misc]
        def __init__(self, refused: RefusedError) -> None:
            super().__init__(str(refused))
            self.code = refused.code

        def to_response(self, ident: str | None = None) -> tuple[str, list[tuple[str, str]], bytes]:
            headers = response_headers(api=True) | {"Content-Type": "application/json"}
            body = json.dumps({"error": self.body}).encode()
            return f"{self.code} Refused", list(headers.items()), body

    class Parser(HTTPRequestParser):  # type: ignore[misc]
        error: Error | None
        refusal: RefusalError | None = None

        def parse_header(self, header_plus: bytes) -> None:
            super().parse_header(header_plus)
            if not (self.content_length or self.chunked):
                return
            headers = {name.replace("_", "-").title(): v for name, v in self.headers.items()}
            try:
                if self.chunked:
                    raise RefusedError(411, "the request does not state its size")
                admit(self.command, self.path, headers)
            except RefusedError as refused:
                self.refusal = RefusalError(refused)

        def received(self, data: bytes) -> int:
            try:
                consumed = super().received(data)
            except OSError as error:  # of the temporary file
                fact = f"the upload cannot be stored ({error.strerror}): free some disk space"
                self.refusal, consumed = RefusalError(RefusedError(507, fact)), len(data)
            self.error = self.refusal or self.error
            if self.error is not None:
                self.completed, self.expect_continue = True, False
            return int(consumed)

    class Channel(HTTPChannel):  # type: ignore[misc]
        parser_class = Parser

        def __init__(self, server: Any, *rest: Any, **more: Any) -> None:
            idle = [c for c in server.active_channels.values() if not c.is_busy]
            if len(server.active_channels) >= CONNECTIONS and idle:
                min(idle, key=lambda channel: channel.last_activity).will_close = True
            super().__init__(server, *rest, **more)

        def service(self) -> None:
            """Answer requests; where the server ends meanwhile, nothing is left to be woken."""
            try:
                super().service()
            except OSError:
                if not self.server.has_ended:
                    raise

        def handle_close(self) -> None:
            """Close the temporary file of a body that was not received to its end."""
            unfinished = self.request
            super().handle_close()
            if unfinished is not None:
                unfinished.close()

        def close(self) -> None:
            """Close the connection as `wasyncore.close_all` does, its temporary files included."""
            self.handle_close()

        def cancel(self) -> None:
            """Close the bodies of requests that no thread took before the server ended."""
            super().cancel()
            for request in self.requests:
                request.close()

        @property
        def is_busy(self) -> bool:
            receiving = self.request is not None and self.request.headers_finished
            return bool(receiving or self.requests or self.total_outbufs_len or self.will_close)

    return Channel
