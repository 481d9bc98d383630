"""State of the runs as OpenMetrics text, for Prometheus: in a file, or by HTTP."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from ...errors import InputError
from ..storage.store import Store
from .run_state import RunState, read_states

CONTENT_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"
RENEWED_S = 5.0
HERE = "127.0.0.1"
FAMILIES = {
    "wheelplane_captures": ("counter", "Captures done by a run, by status."),
    "wheelplane_captures_before": ("gauge", "Captures done before a run began."),
    "wheelplane_captures_left": ("gauge", "Captures that a run has still to do."),
    "wheelplane_captures_at_work": ("gauge", "Captures being measured."),
    "wheelplane_longest_at_work_seconds": ("gauge", "Time since the oldest of these was begun."),
    "wheelplane_run_up": ("gauge", "1 while a run gives signs of life, 0 after it ended."),
    "wheelplane_run_started_seconds": ("gauge", "Start of a run, since 1970."),
    "wheelplane_run_updated_seconds": ("gauge", "Last sign of a run, since 1970."),
}


def metrics_text(results: Store) -> str:
    """Return the state of all runs on the results as OpenMetrics text."""
    now_s = time.time()
    rows: dict[str, list[str]] = {name: [] for name in FAMILIES}
    for file, state in sorted(read_states(results), key=lambda each: each[0]):
        run = file.rsplit("/", 1)[-1].removesuffix(".json")
        labels = {"runner": state.runner, "run": run, "shard": state.shard}
        for name, more, value in _samples(state, now_s):
            family = name.removesuffix("_total")
            rows[family].append(f"{name}{{{_labels(labels | more)}}} {value:.15g}")
    lines = []
    for name, (kind, meaning) in FAMILIES.items():
        lines += [f"# TYPE {name} {kind}", f"# HELP {name} {meaning}", *rows[name]]
    return "\n".join([*lines, "# EOF\n"])


def _samples(state: RunState, now_s: float) -> Iterator[tuple[str, dict[str, str], float]]:
    """Yield name, labels and value of each sample of a run."""
    for status, count in sorted(state.done.items()):
        yield "wheelplane_captures_total", {"status": status}, count
    is_up = state.is_up(now_s)
    working = state.at_work if is_up else ()
    yield "wheelplane_captures_before", {}, state.known
    yield "wheelplane_captures_left", {}, state.left
    yield "wheelplane_captures_at_work", {}, sum(len(one.captures) for one in working)
    oldest_s = min((one.since_s for one in working), default=now_s)
    yield "wheelplane_longest_at_work_seconds", {}, round(now_s - oldest_s, 3)
    yield "wheelplane_run_up", {}, float(is_up)
    yield "wheelplane_run_started_seconds", {}, round(state.started_s, 3)
    yield "wheelplane_run_updated_seconds", {}, round(state.updated_s, 3)


def _labels(labels: dict[str, str]) -> str:
    return ",".join(f'{name}="{_escaped(value)}"' for name, value in labels.items())


def _escaped(value: str) -> str:
    plain = value.encode(errors="replace").decode()
    return plain.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


@contextmanager
def metrics_at(results: Store, where: str) -> Iterator[str]:
    """Give out the metrics while the context lasts; yield where they are.

    where: a PORT of this machine, HOST:PORT, or a file, renewed every RENEWED_S seconds and at the
    end. Raises InputError.
    """
    host, colon, port = where.rpartition(":")
    if port.isdecimal() and (colon or not Path(where).exists()):
        with _served(results, host or HERE, int(port)) as address:
            yield address
    else:
        with _kept(results, Path(where)):
            yield where


class _Server(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Print nothing of a client that leaves."""


@contextmanager
def _served(results: Store, host: str, port: int) -> Iterator[str]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            known = self.path.split("?")[0] == "/metrics"
            status, kind, text = 404, "text/plain", "see /metrics\n"
            try:
                if known:
                    status, kind, text = 200, CONTENT_TYPE, metrics_text(results)
            except InputError as error:
                status, text = 503, f"{error}\n"
            content = text.encode()
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            """Print nothing: the terminal shows the run's progress."""

    try:
        server = _Server((host, port), Handler)
    except (OSError, OverflowError) as error:
        raise InputError(
            f"--metrics {host}:{port}: cannot be listened on ({error}): give another port"
        ) from error
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://{host}:{server.server_address[1]}/metrics"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@contextmanager
def _kept(results: Store, file: Path) -> Iterator[None]:
    """Keep the file up to date; a reader sees the old text or the new one, whole."""

    def renew() -> None:
        try:
            beside = file.with_name(f".{file.name}.new")
            beside.write_text(metrics_text(results), encoding="utf-8")
            beside.replace(file)
        except OSError as error:
            raise InputError(f"--metrics {file}: cannot be written ({error.strerror})") from error

    def renew_always() -> None:
        while not ended.wait(RENEWED_S):
            with suppress(InputError):  # its time shows how old it is; the end tells why
                renew()

    if file.exists() and not file.is_file():
        raise InputError(f"--metrics {file}: is no regular file: give a file, or a port")
    renew()
    ended = threading.Event()
    thread = threading.Thread(target=renew_always, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        renew()
