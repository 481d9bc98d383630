"""What the results at a place were made of, so that no other run goes on there by mistake."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from ...errors import InputError
from ..storage.store import Store
from .work import Request

FILE = "run/begun.json"


def differences(results: Store, request: Request) -> list[str]:
    """What is otherwise than when these results were begun; nothing while there are none."""
    if not results.exists(FILE) or next(results.list("measurements/"), None) is None:
        return []
    try:
        before = json.loads(results.read(FILE))
    except ValueError as error:
        raise InputError(f"{results.url}/{FILE}: is damaged: remove it") from error
    now = _told(request)
    return [
        f"{name} was {before.get(name)}, is {now.get(name)}"
        for name in sorted(before.keys() | now)
        if before.get(name) != now.get(name)
    ]


def begin(results: Store, request: Request) -> None:
    """Write down what these results are made of."""
    results.write(FILE, (json.dumps(_told(request), indent=1) + "\n").encode())


def _told(request: Request) -> dict[str, str]:
    settings = request.settings
    told = {"archive": request.archive, "version": request.version}
    told |= dict(_flat("", settings.effective("folder")))
    return told | dict(_flat("five-point ", settings.effective("five-point")))


def _flat(above: str, tree: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(f"{above}{key}.", value)
        else:
            yield f"{above}{key}", json.dumps(value)
