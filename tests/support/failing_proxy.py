"""A proxy in front of a server of object storage that fails some requests, or all for a time."""

from __future__ import annotations

import http.client
import random
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

ERROR = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"


KINDS = ("refuse", "cut", "late")
SLOW_S = 2.0


class FailingProxy:
    """Proxy that gives a share of the requests one of `kinds`, and cuts all while `gone`.

    refuse: 503; error: 500; cut, late: the connection ends before or after it was done; part: it
    ends in the middle of the answer; slow: the answer comes SLOW_S late.
    """

    def __init__(
        self, address: str, share: float, seed: int, kinds: tuple[str, ...] = KINDS
    ) -> None:
        proxy, self.failed, self.passed, self.gone = self, 0, 0, False
        target = urlsplit(address).netloc
        rng, lock = random.Random(seed), threading.Lock()

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle_any(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                with lock:
                    fate, kind = rng.random(), rng.choice(kinds)
                if proxy.gone:
                    self.close_connection = True
                    return None
                if fate >= share:
                    proxy.passed += 1
                    return self.pass_on(body)
                proxy.failed += 1
                if kind == "refuse":
                    return self.answer(503, [], ERROR)
                if kind == "error":
                    return self.answer(500, [], ERROR.replace(b"SlowDown", b"InternalError"))
                if kind == "slow":
                    time.sleep(SLOW_S)
                    return self.pass_on(body)
                if kind == "part":
                    status, headers, content = self.ask(body)
                    length = [("Content-Length", str(len(content) + 100))]
                    headers = [h for h in headers if h[0].lower() != "content-length"] + length
                    self.answer(status, headers, content[: len(content) // 2])
                if kind == "late":
                    self.ask(body)
                self.close_connection = True
                return None

            do_GET = do_PUT = do_HEAD = do_POST = do_DELETE = handle_any  # noqa: N815

            def ask(self, body: bytes) -> tuple[int, list[tuple[str, str]], bytes]:
                there = http.client.HTTPConnection(target)
                there.putrequest(self.command, self.path, skip_host=True, skip_accept_encoding=True)
                for name, value in self.headers.items():
                    there.putheader(name, value)
                there.endheaders(body)
                reply = there.getresponse()
                content = reply.read()
                there.close()
                return reply.status, reply.getheaders(), content

            def pass_on(self, body: bytes) -> None:
                self.answer(*self.ask(body))

            def answer(self, status: int, headers: list[tuple[str, str]], content: bytes) -> None:
                self.send_response_only(status)
                names = {name.lower() for name, _ in headers}
                for name, value in headers:
                    if name.lower() not in ("transfer-encoding", "connection"):
                        self.send_header(name, value)
                if "content-length" not in names:
                    self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(content)

            def log_message(self, *_: object) -> None:
                """Keep quiet."""

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *_: object) -> None:
                """A client that goes away is no fault."""

        self._server = Server(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Stop answering."""
        self._server.shutdown()
        self._server.server_close()
