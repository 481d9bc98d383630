"""Results of earlier runs: which failed, which another one replaces, whose captures are gone."""

from __future__ import annotations

import json
from collections.abc import Sequence

from ...errors import InputError
from ..storage.store import Store
from .catalogue import open_catalogue, update
from .gather import name_of
from .rows import FAILED

GONE = "gone.json"


def holds_results(results: Store) -> bool:
    """Whether there is any result by now, of whichever run."""
    return next(results.list("measurements/"), None) is not None


def failures(results: Store) -> list[str]:
    """The keys of the results that `--retry` is to have anew."""
    if not holds_results(results):
        return []
    update(results)
    question = "SELECT key FROM captures WHERE status IN (SELECT value FROM json_each(?))"
    with open_catalogue(results.url) as catalogue:
        rows = catalogue.connection.execute(question, (json.dumps(FAILED),))
        return [key for (key,) in rows]


def put_aside(results: Store, key: str) -> None:
    """Move a result to where no catalogue looks; no error if another process was faster."""
    try:
        data = results.read(name_of(key))
    except InputError:
        if results.exists(name_of(key)):
            raise
        return
    results.write(f"superseded/{key}.json", data)
    results.remove(name_of(key))


def write_gone(results: Store, names: Sequence[str]) -> None:
    """Write down which captures have results but are no longer in the archive."""
    if names or results.exists(GONE):
        text = json.dumps({"gone": names}, indent=1, ensure_ascii=False)
        results.write(GONE, f"{text}\n".encode())


def read_gone(results: Store) -> list[str]:
    """Their names, as the last run found them. Raises InputError."""
    if not results.exists(GONE):
        return []
    try:
        return [str(name) for name in json.loads(results.read(GONE))["gone"]]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"{results.url}/{GONE}: is damaged: the next batch mends it") from error
