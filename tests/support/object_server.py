"""A server of object storage on this machine."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

KEYS = {
    "AWS_ACCESS_KEY_ID": "k",
    "AWS_SECRET_ACCESS_KEY": "s",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_REQUEST_CHECKSUM_CALCULATION": "when_required",
}


@contextmanager
def object_server() -> Iterator[str]:
    """Its address, while it runs; it begins without a bucket."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        yield f"http://{host}:{port}"
    finally:
        server.stop()


@contextmanager
def stored_archive(archive: Path) -> Iterator[tuple[str, Any]]:
    """Address of a server with `archive` as cars/archive, and its files, as s3fs shows them."""
    import s3fs

    os.environ |= KEYS
    with object_server() as address:
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        files = s3fs.S3FileSystem(endpoint_url=address, skip_instance_cache=True)
        files.mkdir("cars")
        files.put(str(archive), "cars/archive", recursive=True)
        yield address, files
