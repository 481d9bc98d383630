"""The server itself: few threads, connections that end, bodies of admitted requests alone."""

from __future__ import annotations

import errno
import http.client
import re
import socket
import threading
import time
import types
from contextlib import ExitStack, nullcontext, suppress
from functools import partial
from pathlib import Path

import pytest
from waitress import wasyncore

from tests.support.web_site import Site
from wheelplane.web import listener as module
from wheelplane.web.app import REQUEST_BYTES, admit
from wheelplane.web.listener import CONNECTIONS, LIMITS, Listener
from wheelplane.web.security import KEY_HEADER
from wheelplane.web.server import free_port

MOST_BYTES = 80_000_000


class Served:
    """A site behind its server, at a port of this machine."""

    def __init__(self, place: Path, stack: ExitStack) -> None:
        listening = stack.enter_context(free_port("127.0.0.1", 0))
        self.port = int(listening.getsockname()[1])
        self.site = Site(place, port=self.port, upload_bytes=MOST_BYTES)
        guard = self.site.guard
        self.admitted = {"Cookie": f"{guard.cookie}={guard.session}", KEY_HEADER: guard.key}
        state = self.site.app.config["state"]
        self.listener = Listener(self.site.app, listening, partial(admit, state), MOST_BYTES)
        thread = threading.Thread(target=self.listener.run)
        for end in (self.listener.close, self.site.close, thread.join, self.listener.stop):
            stack.callback(end)
        thread.start()

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)

    def ask(self, method: str, path: str, body: object = None, **headers: str):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        connection.request(method, path, body=body, headers={**self.admitted, **headers})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer, text

    def head(self, method: str, path: str, *lines: str) -> bytes:
        """What is answered to the head of a request alone."""
        with self.connect() as client:
            head = [f"{method} {path} HTTP/1.1", f"Host: 127.0.0.1:{self.port}", *lines, "", ""]
            client.sendall("\r\n".join(head).encode("latin-1"))
            answer = b""
            while more := client.recv(1 << 16):
                answer += more
            return answer


@pytest.fixture
def served(tmp_path):
    with ExitStack() as stack:
        yield Served(tmp_path, stack)


@pytest.fixture
def hasty(tmp_path, monkeypatch):
    """The same, with time limits of one second."""
    limits = LIMITS | {"channel_timeout": 1, "cleanup_interval": 1}
    monkeypatch.setattr(module, "LIMITS", limits)
    with ExitStack() as stack:
        yield Served(tmp_path, stack)


def test_a_server_that_ends_before_it_is_woken_has_ended(tmp_path):
    """It is awake for what a request has sent, and finds that it is to stop."""
    with ExitStack() as stack:
        served = Served(tmp_path, stack)
        trigger = served.listener._server.trigger
        wake = trigger._physical_pull

        def late() -> None:
            wake()
            while trigger._fds:
                time.sleep(0.001)
            wake()

        trigger._physical_pull = late
    assert served.listener._server.has_ended


def test_any_number_of_idle_connections_leaves_room(served):
    before, files = threading.active_count(), open_files()
    with ExitStack() as stack:
        idle = [stack.enter_context(served.connect()) for _ in range(4 * CONNECTIONS)]
        for client in idle[1::2]:
            with suppress(OSError):
                client.sendall(b"GET / HTTP/1.1\r\nHost: ")  # and never the rest
        answer, _ = served.ask("GET", "/api/folders")
        assert answer.status == 200
        assert threading.active_count() == before
        assert open_files() - files - len(idle) <= CONNECTIONS + 10
        assert idle[0].recv(1) == b""  # the oldest was closed for a new one
    assert LIMITS["threads"] <= 8


@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: a\r\n"])
def test_a_connection_without_a_request_is_closed(hasty, sent):
    with hasty.connect() as client:
        client.sendall(sent)
        assert client.recv(1) == b""


def test_a_body_that_stops_is_closed(hasty):
    upload = hasty.site.send()
    lines = [f"{name}: {value}" for name, value in hasty.admitted.items()]
    path = f"/api/uploads/{upload}/rr.ply"
    assert hasty.head("PUT", path, *lines, "Content-Length: 1000") == b""
    assert [p for p in (hasty.site.allowed.parent / "scratch").rglob("*") if p.is_file()] == []


def test_a_long_answer_is_no_idle_connection(hasty, monkeypatch):
    def slow(*_):
        time.sleep(3.0)
        return []

    monkeypatch.setattr(type(hasty.site.app.config["state"].jobs), "measured", slow)
    answer, text = hasty.ask("GET", "/api/jobs")
    assert (answer.status, text) == (200, b'{"jobs":[],"running":null}\n')


GB = "Content-Length: 1000000000"
# The first size that is refused: of a larger one the server leaves bytes unread, and the reset
# that follows can reach the client before the answer.
REFUSED_HEAD = 262_144


@pytest.mark.parametrize("method", ["PUT", "POST", "GET", "DELETE"])
@pytest.mark.parametrize("more", [[GB], [GB, "Expect: 100-continue"]])
def test_no_body_is_received_from_a_stranger(served, method, more):
    answer = served.head(method, "/api/uploads/x/rr.ply", *more)
    assert re.match(rb"HTTP/1.1 403 ", answer)
    assert b"no session with this server" in answer
    assert b"default-src 'none'" in answer
    assert b"100 Continue" not in answer


def test_no_body_is_received_that_is_too_large_or_of_no_stated_size(served):
    own = [f"{name}: {value}" for name, value in served.admitted.items()]
    for method, path, size in (
        ("PUT", "/api/uploads/x/rr.ply", MOST_BYTES + 1),
        ("POST", "/api/measure", REQUEST_BYTES + 1),
        ("POST", "/api/session", REQUEST_BYTES + 1),
    ):
        answer = served.head(method, path, *own, f"Content-Length: {size}", "Expect: 100-continue")
        assert answer.startswith(b"HTTP/1.1 413 "), path
        assert b"100 Continue" not in answer
    answer = served.head("PUT", "/api/uploads/x/rr.ply", *own, "Transfer-Encoding: chunked")
    assert answer.startswith(b"HTTP/1.1 411 ")
    foreign = "Origin: http://evil.example"
    assert served.head("POST", "/api/session", foreign, GB).startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    "head",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1, 2\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\nX: b\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\n: b\r\n\r\n",
        b"GET  / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: ".ljust(REFUSED_HEAD - 4, b"a") + b"\r\n\r\n",
        b"PUT /a HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\nCookie: \xff=\xff; a\r\n\r\n",
    ],
)
def test_malformed_requests_are_the_client_s_fault(served, head):
    with served.connect() as client:
        client.sendall(head)
        client.shutdown(socket.SHUT_WR)
        assert re.match(rb"HTTP/1\.[01] 4\d\d ", client.recv(1000))


def test_a_large_upload_arrives_whole_and_takes_little_memory(served):
    upload, count = served.site.send(), 80
    pieces = (bytes([k]) * 1_000_000 for k in range(count))
    before = peak_bytes()
    length = {"Content-Length": f"{count}000000"}
    answer, text = served.ask("PUT", f"/api/uploads/{upload}/rr.ply", pieces, **length)
    assert answer.status == 200, text
    assert peak_bytes() - before < 20_000_000
    (stored,) = (served.site.allowed.parent / "scratch").rglob("rr.ply")
    with stored.open("rb") as file:
        for k in range(count):
            assert file.read(1_000_000) == bytes([k]) * 1_000_000
        assert file.read() == b""


def test_a_full_disk_ends_the_upload_and_nothing_else(served, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    upload = served.site.send()
    with monkeypatch.context() as patch:
        patch.setattr("waitress.receiver.FixedStreamReceiver.received", full)
        answer, text = served.ask("PUT", f"/api/uploads/{upload}/rr.ply", b"1 2 3")
        assert answer.status == 507
        assert b"(No space left on device): free some disk space" in text
    assert served.ask("PUT", f"/api/uploads/{upload}/rr.ply", b"1 2 3")[0].status == 200


def test_an_unfinished_upload_is_closed_with_the_server(tmp_path):
    before = nameless_files()
    with ExitStack() as late, ExitStack() as stack:
        served = Served(tmp_path, stack)
        client = late.enter_context(served.connect())
        lines = [f"{name}: {value}" for name, value in served.admitted.items()]
        path = f"/api/uploads/{served.site.send()}/rr.ply"
        head = [f"PUT {path} HTTP/1.1", f"Host: 127.0.0.1:{served.port}", *lines]
        size = "Content-Length: 2000000"
        client.sendall("\r\n".join([*head, size, "", ""]).encode() + bytes(1_000_000))
        while not (body := nameless_files() - before):
            time.sleep(0.01)
        channels = list(served.listener._server.active_channels.values())
    assert len(channels) == len(body) == 1
    assert nameless_files() == before


@pytest.mark.parametrize("ended", [True, False])
def test_a_request_that_outlives_the_server_is_no_fault(monkeypatch, ended):
    """Its thread wakes the server by a file that is closed by then, or is being closed."""

    def woken(_channel):
        raise OSError(errno.EBADF, "Bad file descriptor")

    monkeypatch.setattr("waitress.channel.HTTPChannel.service", woken)
    kind = module._channel(admit)
    channel = kind.__new__(kind)
    channel.server = types.SimpleNamespace(has_ended=ended)
    with nullcontext() if ended else pytest.raises(OSError, match="descriptor"):
        channel.service()


def test_the_server_has_ended_before_its_sockets_are_closed(tmp_path, monkeypatch):
    seen, close_all = [], wasyncore.close_all
    with ExitStack() as stack:
        server = Served(tmp_path, stack).listener._server
        assert not server.has_ended

        def noting(sockets):
            seen.append(server.has_ended)
            close_all(sockets)

        monkeypatch.setattr(wasyncore, "close_all", noting)
    assert seen == [True]


def nameless_files() -> set[str]:
    """Temporary files that are open in this process."""
    links = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            links.add(str(link.readlink()))
    return {link for link in links if link.endswith("(deleted)")}


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def peak_bytes() -> int:
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) * 1024
