"""Inventory of a bucket in the place of its listing: the same objects, in the same order."""

from __future__ import annotations

import csv
import gzip
import hashlib
import json
import sys
import zipfile
from urllib.parse import quote_plus

import duckdb
import pytest

from tests.support.batches import five_points, run, trees, zip_of_discs
from wheelplane.batch.storage.inventory import objects_of, read_inventory
from wheelplane.batch.storage.remote import RemoteStore
from wheelplane.errors import InputError, MissingDependencyError

URL = "s3://lists/daily/cars/all/2026-11-26T01-00Z/manifest.json"
DATA = "daily/cars/all/data"
NAMES = ["a.txt", "a/b.txt", "a b+c.txt", "Ü/ß €.txt", "z%41,\"'.txt", "d//e.txt", "f/", "車.txt"]
NAMES += [f"{k}/x.ply" for k in range(2500)]
COLUMNS = "Bucket", "Key", "VersionId", "IsLatest", "IsDeleteMarker", "Size", "ETag"


def put_inventory(store, rows, form, tmp_path, **changes):
    """Put the files and the manifest of an inventory of these rows, in no order, two a file."""
    client = store._fs
    if not client.exists("lists"):
        client.mkdir("lists")
    files = []
    for at in range(2):
        some = rows[at::2][::-1]
        path = tmp_path / f"{at}.{form}"
        if form == "CSV":
            with gzip.open(path, "wt", newline="") as text:
                coded = [(row[0], quote_plus(row[1], safe="/"), *row[2:]) for row in some]
                csv.writer(text, quoting=csv.QUOTE_ALL).writerows(coded)
        else:
            types = "VARCHAR", "VARCHAR", "VARCHAR", "BOOLEAN", "BOOLEAN", "BIGINT", "VARCHAR"
            names = [
                "bucket",
                "key",
                "version_id",
                "is_latest",
                "is_delete_marker",
                "size",
                "e_tag",
            ]
            table = ", ".join(map(" ".join, zip(names, types, strict=True)))
            connection = duckdb.connect()
            connection.execute(f"CREATE TABLE t({table})")
            connection.executemany(f"INSERT INTO t VALUES ({', '.join('?' * 7)})", some)
            connection.execute(f"COPY t TO '{path}' (FORMAT parquet)")
        key = f"{DATA}/{at}.{'csv.gz' if form == 'CSV' else 'parquet'}"
        client.pipe_file(f"lists/{key}", path.read_bytes())
        digest = hashlib.md5(path.read_bytes()).hexdigest()
        files.append({"key": key, "size": path.stat().st_size, "MD5checksum": digest})
    schema = ", ".join(COLUMNS) if form == "CSV" else "message s3.inventory {...}"
    tree = {"sourceBucket": "cars", "fileFormat": form, "fileSchema": schema, "files": files}
    client.pipe_file(URL.removeprefix("s3://"), json.dumps(tree | changes).encode())


def rows_of(store):
    """Rows of an inventory of a bucket: former versions and deleted objects as well."""
    bucket = store.url.removeprefix("s3://").partition("/")[0]
    rows = [
        (bucket, path.partition("/")[2], "v2", "true", "false", size, etag)
        for path, size, etag in RemoteStore(f"s3://{bucket}")._listed("")
    ]
    former = [(*row[:2], "v1", "false", "false", 7, "old") for row in rows[::50]]
    deleted = (bucket, "results/gone.txt", "v3", "true", "true", "0", "")
    return [*rows, *former, deleted]


@pytest.mark.parametrize("form", ["CSV", "Parquet"])
def test_an_inventory_lists_what_a_listing_does(remote, tmp_path, form):
    client = remote._fs
    for name in NAMES[:40]:
        client.call_s3("put_object", Bucket="cars", Key=f"results/{name}", Body=name.encode())
    client.pipe_file("cars/resultset.txt", b"1")
    put_inventory(remote, rows_of(remote), form, tmp_path)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    found = list(remote.entries(objects_of(read_inventory(URL), remote.url, scratch)))
    assert found == list(remote.list())
    assert len(found) == 39  # without the empty object of a folder
    everything = RemoteStore("s3://cars")
    found = list(everything.entries(objects_of(read_inventory(URL), "s3://cars", scratch)))
    assert found == list(everything.list())


@pytest.mark.slow
def test_a_run_by_inventory_is_that_by_listing_and_reports_nothing_as_gone(remote, tmp_path):
    """An inventory is a day old: what was added since waits, what was deleted has vanished."""
    client = remote._fs
    for k in range(3):
        data = five_points(tmp_path / "x.txt", k).read_bytes()
        client.pipe_file(f"cars/archive/{k} x.txt", data)
    client.put_file(zip_of_discs(tmp_path / "one.zip", 1), "cars/archive/one.zip")
    with zipfile.ZipFile(tmp_path / "many.zip", "w") as packed:
        for name in ("a.txt", "b.txt"):
            packed.write(tmp_path / "x.txt", name)
    client.put_file(tmp_path / "many.zip", "cars/archive/many.zip")
    put_inventory(remote, rows_of(remote), "Parquet", tmp_path)
    places, options = ("s3://cars/archive", tmp_path / "listed"), ("--workers", "1")
    assert run(*places, *options).returncode == 0
    by_inventory = "--inventory", URL, *options
    done = run("s3://cars/archive", tmp_path / "by-inventory", *by_inventory)
    assert done.returncode == 0, done.stderr
    assert trees(tmp_path / "by-inventory") == trees(tmp_path / "listed")
    assert len(trees(tmp_path / "listed")) == 6
    assert "6 done before, 0 to do" in run(*places, *by_inventory).stderr
    client.pipe_file("cars/archive/new.txt", five_points(tmp_path / "x.txt", 9).read_bytes())
    assert "now: 1 ok" in run(*places, *options).stdout
    client.rm_file("cars/archive/0 x.txt")
    again = run(*places, *by_inventory)
    assert "6 done before, 0 to do" in again.stderr
    assert "no longer in the archive" not in again.stdout
    assert "1 vanished" in run("s3://cars/archive", tmp_path / "later", *by_inventory).stdout


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"sourceBucket": "bikes"}, "of the bucket bikes, not of cars: give an inventory of cars"),
        ({"fileFormat": "ORC"}, "its files are ORC: set the inventory's format to Parquet"),
        ({"fileSchema": "Bucket, Key, A, B, C, D, E"}, "has no Size, ETag: add it to .* optional"),
        ({"files": [{"size": 1}]}, "not the manifest of an inventory"),
        (
            {"files": [{"key": "daily/cars/all/data/0.csv.gz", "MD5checksum": "0"}]},
            "is not the file",
        ),
        ({"files": [{"key": "none.csv.gz", "MD5checksum": "0"}]}, "no such object"),
        ({"fileSchema": "Bucket, Key, A, B, C, ETag, Size"}, "its files cannot be read .*onver"),
    ],
)
def test_an_inventory_that_cannot_be_used_is_one_line(remote, tmp_path, changes, text):
    remote.write("a.txt", b"1 2 3")
    put_inventory(remote, rows_of(remote), "CSV", tmp_path, **changes)
    with pytest.raises(InputError, match=text) as caught:
        list(objects_of(read_inventory(URL), remote.url, tmp_path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("url", ["s3://lists/x.csv", "manifest.json", "s3://lists", "http://a/b"])
def test_what_is_no_manifest_is_refused_by_its_name(url):
    with pytest.raises(InputError, match=r"--inventory .*: give the s3:// URL of a manifest"):
        read_inventory(url)


def test_an_inventory_of_a_folder_is_refused(remote, tmp_path):
    five_points(tmp_path / "archive" / "a.txt", 1)
    put_inventory(remote, [], "CSV", tmp_path)
    done = run(tmp_path / "archive", tmp_path / "results", "--inventory", URL)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--inventory is of a bucket: leave it out" in done.stderr


def test_without_duckdb_one_line_says_what_to_install(remote, tmp_path, monkeypatch):
    put_inventory(remote, [], "CSV", tmp_path)
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[tables\]'"):
        list(objects_of(read_inventory(URL), remote.url, tmp_path))
