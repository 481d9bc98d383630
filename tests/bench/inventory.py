"""A million objects of a bucket, listed and by its inventory: requests, CPU, memory of the reader.

    .venv/bin/python -m tests.bench.inventory DIR [--count 1000000]

A server of object storage of its own, in another process, answers with pages of a listing of so
many five-point files, and with the files of their inventory, which DIR takes (some 60 MB). Each way
is read in a process of its own, and the captures found in it.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import hashlib
import json
import multiprocessing
import os
import pickle
import random
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar
from urllib.parse import parse_qs, quote_plus, urlsplit
from urllib.request import urlopen

import duckdb
import numpy as np

from tests.support.object_server import KEYS
from wheelplane.batch.plan.discover import discover
from wheelplane.batch.storage.entry import Entry
from wheelplane.batch.storage.inventory import objects_of, read_inventory
from wheelplane.batch.storage.zipped import ZippedRemoteStore

PAGE, A_FILE = 1000, 100_000
FORMS = {"CSV": "csv.gz", "Parquet": "parquet"}


def key_of(i: int) -> str:
    """Key of the i-th object."""
    return f"{i // A_FILE:03d}/car-{i:07d}.txt"


def row_of(i: int) -> tuple[str, str, int, str]:
    """Row of the i-th object in an inventory."""
    return "cars", key_of(i), 800 + i % 50, hashlib.md5(str(i).encode()).hexdigest()


class Server(BaseHTTPRequestHandler):
    """Pages of a listing, and files of an inventory; /asked answers how much was asked for."""

    protocol_version = "HTTP/1.1"
    asked: ClassVar[Counter[str]] = Counter()
    folder, count = Path(), 0

    def do_GET(self) -> None:
        """Answer."""
        parts = urlsplit(self.path)
        if parts.path == "/asked":
            self.send(json.dumps(self.asked).encode())
            self.asked.clear()
        elif "list-type" in parts.query:
            self.asked["LIST"] += 1
            self.send(self.page(parse_qs(parts.query)))
        else:
            self.asked["GET"] += 1
            self.send(self.file().read_bytes())

    def do_HEAD(self) -> None:
        """Answer without the content."""
        self.asked["HEAD"] += 1
        self.send(b"", self.file().stat().st_size)

    def file(self) -> Path:
        """Return the file of a key."""
        return self.folder / urlsplit(self.path).path.removeprefix("/lists/")

    def page(self, query: dict[str, list[str]]) -> bytes:
        """Return a page of the listing."""
        start = int(query.get("continuation-token", ["0"])[0])
        end = min(self.count, start + PAGE)
        rows = "".join(
            f"<Contents><Key>{key}</Key><LastModified>2026-11-26T00:00:00.000Z</LastModified>"
            f"<ETag>&quot;{etag}&quot;</ETag><Size>{size}</Size></Contents>"
            for _, key, size, etag in map(row_of, range(start, end))
        )
        more = f"<NextContinuationToken>{end}</NextContinuationToken>" if end < self.count else ""
        return f"<ListBucketResult><Name>cars</Name>{rows}{more}</ListBucketResult>".encode()

    def send(self, content: bytes, length: int | None = None) -> None:
        """Send an answer."""
        self.send_response(200)
        self.send_header("Content-Length", str(len(content) if length is None else length))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Keep quiet."""


def serve(folder: Path, count: int, port: multiprocessing.Queue[int]) -> None:
    """Serve for ever."""
    Server.folder, Server.count = folder, count
    server = ThreadingHTTPServer(("127.0.0.1", 0), Server)
    server.daemon_threads = True
    port.put(server.server_port)
    server.serve_forever()


def make_inventory(folder: Path, form: str, count: int) -> None:
    """Write an inventory, its rows in no order."""
    folder.mkdir(parents=True, exist_ok=True)
    numbers = list(range(count))
    random.Random(1).shuffle(numbers)
    files = []
    for at in range(0, count, A_FILE):
        path = folder / f"{at // A_FILE}.{FORMS[form]}"
        plain = folder / "plain.csv"
        rows = map(row_of, numbers[at : at + A_FILE])
        coded = ((row[0], quote_plus(row[1], safe="/"), *row[2:]) for row in rows)
        with plain.open("w", newline="") as text:
            csv.writer(text, quoting=csv.QUOTE_ALL).writerows(coded)
        if form == "CSV":
            path.write_bytes(gzip.compress(plain.read_bytes(), 6))
        else:
            names = "{'bucket': 'VARCHAR', 'key': 'VARCHAR', 'size': 'BIGINT', 'e_tag': 'VARCHAR'}"
            table = f"read_csv('{plain}', columns = {names}, auto_detect = false, quote = '\"')"
            duckdb.execute(f"COPY (FROM {table}) TO '{path}' (FORMAT parquet)")
        digest = hashlib.md5(path.read_bytes()).hexdigest()
        files.append({"key": f"{form}/{path.name}", "MD5checksum": digest})
    plain.unlink()
    tree = {"sourceBucket": "cars", "fileFormat": form, "files": files}
    tree["fileSchema"] = "Bucket, Key, Size, ETag" if form == "CSV" else "message s3.inventory {}"
    (folder / "manifest.json").write_text(json.dumps(tree))


def read(form: str, answer: multiprocessing.Queue[dict[str, float]]) -> None:
    """Read the objects in one way, find the captures in them, and answer with what it took."""
    store = ZippedRemoteStore("s3://cars")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "copied"
        folder.mkdir()
        times = [time.process_time()]
        if form == "listing":
            entries = store.list()
        else:
            inventory = read_inventory(f"s3://lists/{form}/manifest.json")
            entries = store.entries(objects_of(inventory, store.url, folder))
        held = Path(scratch) / "entries"
        with held.open("wb") as file:
            for entry in entries:
                pickle.dump(entry, file)
        times.append(time.process_time())
        found = sum(1 for _ in discover(loaded(held), Path(scratch) / "spool", store.url))
        times.append(time.process_time())
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    reading_s, finding_s = np.diff(times).tolist()
    answer.put({"found": found, "reading_s": reading_s, "finding_s": finding_s, "MB": memory_mb})


def loaded(path: Path) -> Iterator[Entry]:
    """Yield pickled entries."""
    with path.open("rb") as file, suppress(EOFError):
        while True:
            yield pickle.load(file)


def main() -> None:
    """Make, serve, read, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=1_000_000)
    chosen = parser.parse_args()
    for form in FORMS:
        if not (chosen.folder / form).is_dir():
            make_inventory(chosen.folder / form, form, chosen.count)
    context = multiprocessing.get_context("spawn")
    port = context.Queue()
    server = context.Process(target=serve, args=(chosen.folder, chosen.count, port), daemon=True)
    server.start()
    address = f"http://127.0.0.1:{port.get()}"
    os.environ |= KEYS | {"AWS_ENDPOINT_URL": address}
    for form in ("listing", *FORMS):
        answer = context.Queue()
        reader = context.Process(target=read, args=(form, answer))
        reader.start()
        took = answer.get()
        reader.join()
        asked = json.loads(urlopen(f"{address}/asked").read())
        print(form, {name: round(value, 2) for name, value in took.items()}, asked, flush=True)
    server.terminate()


if __name__ == "__main__":
    main()
