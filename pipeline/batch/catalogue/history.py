"""Results of earlier runs: failed, superseded, or of captures removed from the archive."""

from __future__ import annotations

import json
from collections.abc import Sequence

from ...errors import InputError
from ..storage.store import Store
from .catalogue import open_catalogue, update
from .load_records import json_name
from .rows import FAILED, STATUSES, CaptureRow
from .schema import identity

ANY_FAILURE = "failed"  # of --retry: failed, quarantined or damaged
REMOVED = "gone.json"  # name of a file that users hold


def holds_results(results: Store) -> bool:
    """Return whether there is any result, of any run."""
    return next(results.names("measurements/"), None) is not None


def retried(results: Store, retry: str) -> list[str]:
    """Return the keys of the results that `--retry` measures again.

    Raises InputError if `retry` is neither a status nor the name of a capture, nor the key of a
    result, by which a damaged one is listed.
    """
    if not holds_results(results):
        return []
    update(results)
    question = (
        "SELECT key FROM captures WHERE status IN (SELECT value FROM json_each(?)) OR name = ? "
        "OR (id = ? AND key = ?)"
    )
    status = json.dumps(FAILED if retry == ANY_FAILURE else [retry])
    with open_catalogue(results.url) as catalogue:
        rows = catalogue.connection.execute(question, (status, retry, *identity(retry)))
        keys = [key for (key,) in rows]
    if not keys and retry not in STATUSES:
        raise InputError(
            f"--retry {retry}: {results.url} has no result of this name: give failed, a status, or "
            "a name as `wheelplane results` lists it"
        )
    return keys


def is_retried(row: CaptureRow, retry: str) -> bool:
    """Return whether `--retry` measures a capture again: all that failed, a status, name or key."""
    status = FAILED if retry == ANY_FAILURE else (retry,)
    return retry in (row.name, row.key) or row.status in status


def supersede(results: Store, key: str) -> None:
    """Move a result to superseded/, outside the catalogue; no error if it is there already."""
    try:
        data = results.read(json_name(key))
    except InputError:
        if results.exists(json_name(key)):
            raise
        return
    results.write(f"superseded/{key}.json", data)
    results.remove(json_name(key))


def write_removed(results: Store, names: Sequence[str]) -> None:
    """Record which captures have results but were removed from the archive."""
    if names or results.exists(REMOVED):
        text = json.dumps({"gone": names}, indent=1, ensure_ascii=False)
        results.write(REMOVED, f"{text}\n".encode())


def read_removed(results: Store) -> list[str]:
    """Return the names recorded by the last run. Raises InputError."""
    if not results.exists(REMOVED):
        return []
    try:
        return [str(name) for name in json.loads(results.read(REMOVED))["gone"]]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(
            f"{results.url}/{REMOVED}: damaged: run the batch again, which rewrites it"
        ) from error
