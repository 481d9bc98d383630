"""Public files of other projects: counts and bounds as independent readers find them, or refusals.

They are not part of this repository. With a folder in the environment variable WHEELPLANE_CORPUS,
each file of corpus.toml is judged that lies there as OWNER/NAME/PATH, as after

    git clone https://github.com/OWNER/NAME $WHEELPLANE_CORPUS/OWNER/NAME
    git -C $WHEELPLANE_CORPUS/OWNER/NAME checkout COMMIT
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from wheelplane.errors import InputError
from wheelplane.readers import READERS, read_scan, scan_suffix

CORPUS = os.environ.get("WHEELPLANE_CORPUS")
SOURCES = tomllib.loads(Path(__file__).with_name("corpus.toml").read_text("utf-8"))["source"]
FILES = [(source["name"], entry) for source in SOURCES for entry in source["files"]]
FIELDS = {"path", "sha256", "points", "invalid", "length_unit", "low", "high", "refused"}


def named(value: object) -> str | None:
    return value["path"] if isinstance(value, dict) else None


@pytest.mark.parametrize(("source", "entry"), FILES if CORPUS else [], ids=named)
def test_a_public_file_is_read_as_others_read_it(source, entry):
    path = Path(str(CORPUS)) / source / entry["path"]
    if not path.is_file() or sha(path) != entry["sha256"]:
        pytest.skip(f"{path} is not there, or another version of it")
    if path.suffix.lower() == ".3mf" and not importlib.util.find_spec("lxml"):
        pytest.skip("3MF needs lxml")
    if "refused" in entry:
        with pytest.raises(InputError, match=re.escape(entry["refused"])) as caught:
            read_scan(path)
        assert len(str(caught.value).splitlines()) == 1
        return
    scan = read_scan(path, entry.get("length_unit", "m"))
    assert len(scan.points_m) == entry["points"]
    assert scan.invalid_points == entry.get("invalid", 0)
    # Other readers hold some coordinates as float32.
    for found, expected in ((scan.points_m.min(0), "low"), (scan.points_m.max(0), "high")):
        np.testing.assert_allclose(found, entry[expected], rtol=1e-6, atol=1e-9)


def sha(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def test_the_list_is_in_order():
    """What it says of a file is a count with bounds, or a refusal; each file stands there once."""
    assert len({(source, entry["path"]) for source, entry in FILES}) == len(FILES)
    for source in SOURCES:
        assert re.fullmatch(r"[\w.-]+/[\w.-]+", source["name"])
        assert re.fullmatch(r"[0-9a-f]{40}", source["commit"])
    for _, entry in FILES:
        assert set(entry) <= FIELDS
        assert scan_suffix(entry["path"]) in READERS
        assert ("refused" in entry) != ({"points", "low", "high"} <= set(entry))
        if "points" in entry:
            assert entry["points"] > 0
            assert all(a <= b for a, b in zip(entry["low"], entry["high"], strict=True))


def test_the_list_has_every_kind_of_file_that_is_public():
    suffixes = {scan_suffix(entry["path"]) for _, entry in FILES if "points" in entry}
    made_by_tests_alone = {".asc", ".csv", ".ptx"}
    assert suffixes >= set(READERS) - made_by_tests_alone
