"""A bucket of object storage on this machine."""

from __future__ import annotations

import pytest

from tests.support.object_server import object_server
from wheelplane.batch.storage import remote as store_remote


@pytest.fixture(scope="module")
def server():
    """The address of a server of object storage on this machine, with the bucket `cars`."""
    with object_server() as address:
        yield address


@pytest.fixture
def remote(server, monkeypatch):
    """A RemoteStore on an empty bucket."""
    monkeypatch.setenv("AWS_ENDPOINT_URL", server)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "made-up")
    for name in ("AWS_REQUEST_CHECKSUM_CALCULATION", "AWS_RESPONSE_CHECKSUM_VALIDATION"):
        monkeypatch.setenv(name, "when_required")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setattr(store_remote, "FIRST_WAIT_S", 1e-4)
    store = store_remote.RemoteStore("s3://cars/results")
    if not store._fs.exists("cars"):
        store._fs.call_s3("create_bucket", Bucket="cars")
    for path in store._fs.find("cars"):
        store._fs.rm_file(path)
    return store
