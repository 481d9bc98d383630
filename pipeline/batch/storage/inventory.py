"""Inventory of a bucket: its objects in files that Amazon S3 writes each day or week.

Layout: https://docs.aws.amazon.com/AmazonS3/latest/userguide/storage-inventory-location.html
"""

from __future__ import annotations

import hashlib
import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...errors import InputError, MissingDependencyError, fact_of
from ...system import frozen
from .store import Store, open_store

MEMORY = "100MB"  # for sorting; what is beyond goes to disk
AT_ONCE = 10_000  # rows
NAMES = re.compile(r"\w+")
OBJECTS = """
SELECT {key} AS name, CAST({size} AS BIGINT), {etag} FROM {files}
WHERE {bucket} = $bucket AND starts_with(name, $prefix) AND {current} ORDER BY name
"""


@frozen
class Inventory:
    """Inventory of the bucket `source`. files: keys of its files in `store`, with their MD5."""

    url: str
    store: Store
    source: str
    columns: tuple[str, ...]
    files: tuple[tuple[str, str], ...]


def read_inventory(url: str) -> Inventory:
    """Read the manifest of an inventory. Raises InputError."""
    scheme, _, rest = url.partition("://")
    bucket, _, name = rest.partition("/")
    if scheme not in ("s3", "s3a") or not name.endswith("manifest.json"):
        raise InputError(f"--inventory {url}: give the s3:// URL of a manifest.json")
    store = open_store(f"{scheme}://{bucket}")
    try:
        tree = json.loads(store.read(name))
        files = tuple((file["key"], file["MD5checksum"]) for file in tree["files"])
        form, schema = tree["fileFormat"], tree["fileSchema"]
        source = tree["sourceBucket"]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        fact = f"not the manifest of an inventory ({fact_of(error)})"
        raise InputError(f"{url}: {fact}: give its manifest.json") from error
    if form not in ("CSV", "Parquet"):
        raise InputError(f"{url}: its files are {form}: set the inventory's format to Parquet")
    columns = tuple(NAMES.findall(schema)) if form == "CSV" else ()
    return Inventory(url, store, source, columns, files)


def objects_of(inventory: Inventory, archive: str, scratch: Path) -> Iterator[tuple[str, int, str]]:
    """Yield BUCKET/KEY, size and ETag of the objects below a URL, by DuckDB, sorted by the key.

    scratch: existing folder that takes a copy of the inventory, and what of it is being sorted.
    Raises InputError, MissingDependencyError.
    """
    bucket, _, prefix = archive.partition("://")[2].strip("/").partition("/")
    if bucket != inventory.source:
        fact = f"of the bucket {inventory.source}, not of {bucket}"
        raise InputError(f"{inventory.url}: {fact}: give an inventory of {bucket}")
    try:
        duckdb: Any = importlib.import_module("duckdb")
    except ImportError as error:
        need = "--inventory needs duckdb: run pip install 'wheelplane[tables]'"
        raise MissingDependencyError(need) from error
    files = [str(_copied(inventory, key, md5, scratch)) for key, md5 in inventory.files]
    if not files:
        return
    given = {"bucket": bucket, "prefix": f"{prefix}/" if prefix else ""}
    limits: dict[str, Any] = {"threads": 1, "memory_limit": MEMORY, "temp_directory": str(scratch)}
    limits["preserve_insertion_order"] = False  # which takes memory
    try:
        with duckdb.connect(config=limits) as connection:
            rows = connection.execute(_question(connection, inventory, files), given)
            while some := rows.fetchmany(AT_ONCE):
                for key, size, etag in some:
                    yield f"{bucket}/{key}", size, etag
    except duckdb.Error as error:
        fact = " ".join(str(error).split())[:200]
        raise InputError(f"{inventory.url}: its files cannot be read ({fact})") from error


def _copied(inventory: Inventory, key: str, md5: str, scratch: Path) -> Path:
    """Copy a file of the inventory to a folder, and compare its checksum."""
    path = inventory.store.fetch(key, scratch)
    with path.open("rb") as stream:
        found = hashlib.file_digest(stream, "md5").hexdigest()
    if found != md5:
        fact = f"{key} is not the file that it names"
        raise InputError(f"{inventory.url}: {fact}: wait until a later inventory is complete")
    return path


def _question(connection: Any, inventory: Inventory, files: list[str]) -> str:
    """Return the question for the current objects. Raises InputError for a missing column.

    Keys in CSV are those of a URL's query, with "+" for a space.
    """
    listed = ", ".join(f"'{file.replace(chr(39), 2 * chr(39))}'" for file in files)
    if is_csv := bool(inventory.columns):
        there = inventory.columns
        types = ", ".join(f"'{name}': 'VARCHAR'" for name in there)
        form = "buffer_size = 4194304, max_line_size = 65536, "
        form += """auto_detect = false, header = false, delim = ',', quote = '"', escape = '"'"""
        source = f"read_csv([{listed}], columns = {{{types}}}, {form})"
    else:
        source = f"read_parquet([{listed}])"
        described = connection.execute(f"DESCRIBE SELECT * FROM {source}")  # noqa: S608
        there = tuple(name for name, *_ in described.fetchall())
    columns = {name.replace("_", "").lower(): f'"{name}"' for name in there}
    lacking = [name for name in ("Bucket", "Key", "Size", "ETag") if name.lower() not in columns]
    if lacking:
        fact = f"it has no {', '.join(lacking)}"
        raise InputError(f"{inventory.url}: {fact}: add it to the inventory's optional fields")
    key = columns["key"]
    current = [f"CAST({columns['islatest']} AS BOOLEAN)"] if "islatest" in columns else []
    if "isdeletemarker" in columns:
        current.append(f"NOT CAST({columns['isdeletemarker']} AS BOOLEAN)")
    return OBJECTS.format(
        key=f"url_decode(replace({key}, '+', ' '))" if is_csv else key,
        size=columns["size"],
        etag=columns["etag"],
        bucket=columns["bucket"],
        files=source,
        current=" AND ".join(current) or "true",
    )
