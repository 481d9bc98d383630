"""Run manifest: archive, version and settings of the results, which a later run must match."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from ...errors import InputError
from ..storage.store import Store
from .work import RunRequest

FILE = "run/begun.json"  # name of a file that users hold
OPTIONS = "run/options.json"


def differences(results: Store, request: RunRequest) -> list[str]:
    """Return the differences between this request and the manifest; none while without results."""
    if not results.exists(FILE) or next(results.list("measurements/"), None) is None:
        return []
    try:
        before = dict(json.loads(results.read(FILE)))
    except (ValueError, TypeError) as error:
        raise InputError(f"{results.url}/{FILE}: damaged: remove it") from error
    now = _manifest(request)
    return [
        f"{name} was {before.get(name)}, is {now.get(name)}"
        for name in sorted(before.keys() | now)
        if before.get(name) != now.get(name)
    ]


def write_run_manifest(results: Store, request: RunRequest) -> None:
    """Write the manifest of these results."""
    results.write(FILE, (json.dumps(_manifest(request), indent=1) + "\n").encode())


def write_options(results: Store, options: dict[str, str]) -> None:
    """Write the options of measuring that the user gave, by which `--why` names its commands."""
    results.write(OPTIONS, (json.dumps(options, indent=1, ensure_ascii=False) + "\n").encode())


def _manifest(request: RunRequest) -> dict[str, str]:
    settings = request.settings
    manifest = {"archive": request.archive, "version": request.version}
    manifest |= dict(_flat("", settings.effective("folder")))
    return manifest | dict(_flat("five-point ", settings.effective("five-point")))


def _flat(above: str, tree: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(f"{above}{key}.", value)
        else:
            yield f"{above}{key}", json.dumps(value)
