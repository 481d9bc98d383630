"""Files that exist, but may not be read: each way says whose permissions are to be changed."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from wheelplane.capture.folder import check_path
from wheelplane.config import load_config
from wheelplane.errors import WheelplaneError
from wheelplane.files import open_archive
from wheelplane.five_point import read_five_point
from wheelplane.report.format.earlier import read_earlier
from wheelplane.report.signature import read_private_key
from wheelplane.uncertainty.field_tests import evaluate_tests

WAYS = {
    "five points": read_five_point,
    "configuration": load_config,
    "archive": lambda path: open_archive(path, path.name, path.parent).__enter__(),
    "measurement": read_earlier,
    "key": lambda path: read_private_key(path, str),
    "field tests": lambda path: evaluate_tests([path]),
    "capture": lambda path: check_path(path, lambda: bool(path.open())),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_the_advice_is_to_change_permissions(way, tmp_path, monkeypatch):
    """Modes of files do not stop the superuser, whom tests may run as."""
    path = tmp_path / "file.zip"
    path.write_bytes(b"PK")

    def denied(*_args: object, **_options: object) -> None:
        raise PermissionError(13, "Permission denied", path.name)

    for place, name in ((Path, "open"), (Path, "read_bytes"), (io, "open"), (io, "FileIO")):
        monkeypatch.setattr(place, name, denied)
    with pytest.raises(WheelplaneError, match=r"^.*file\.zip: .*Permission denied") as caught:
        way(path)
    assert "change its permissions" in str(caught.value)
    assert "check the path" not in str(caught.value)
