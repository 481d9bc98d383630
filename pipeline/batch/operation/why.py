"""Account of one capture's result: its status, reason, inputs and log."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

from ...errors import InputError, printable
from ..catalogue.catalogue import open_catalogue
from ..catalogue.load_records import json_name
from ..storage.store import Store, open_store
from ..storage.zipped import zip_above

MANIFEST = "run/begun.json"
UNPACKED = "UNPACKED"  # folder that the user names, as DIR


def account(results: str, name: str) -> str:
    """Return why the result of the capture `name` is as it is. Raises InputError if it has none."""
    with open_catalogue(results) as catalogue:
        rows = catalogue.connection.execute("SELECT key FROM captures WHERE name = ?", (name,))
        keys = [key for (key,) in rows]
    if not keys:
        raise InputError(
            f"{name}: {results} has no result of this name: `wheelplane results {results}` lists "
            "the names"
        )
    store = open_store(results)
    return "\n\n".join(account_of(store, key) for key in keys)


def account_of(store: Store, key: str) -> str:
    """Return why the result of a key is as it is. Raises InputError."""
    tree: dict[str, Any] = json.loads(store.read(json_name(key)))
    lines = [*_lines(store, key, tree), "", *_next(store, tree)]
    return "\n".join(map(printable, lines))


def files_of(key: str) -> tuple[str, ...]:
    """Return the names of the files that an account is made of, whether they exist or not."""
    return json_name(key), _log(key), MANIFEST


def _log(key: str) -> str:
    return f"logs/{key}.log"


def _lines(store: Store, key: str, tree: dict[str, Any]) -> list[str]:
    batch, origin = tree["batch"], tree["provenance"]
    where = f" at {batch['stage']}" * bool(batch["stage"])
    lines = [f"{tree['capture']}: {batch['status']}{where}"]
    lines += [f"  {batch['reason']}"] * bool(batch["reason"])
    lines += [f"  result     {json_name(key)}", f"  wheelplane {origin['version']}"]
    for wheel in tree["wheels"]:
        reason = f": {wheel['reason']}" if wheel.get("reason") else ""
        lines.append(f"  wheel      {wheel['name']}: {wheel['status']}{reason}")
    inputs = origin["inputs"].items()
    lines += [f"  input      {file}  {digest}" for file, digest in inputs]
    log = _log(key)
    if store.exists(log):
        text = store.read(log).decode(errors="replace").rstrip()
        lines += ["", f"{log}:", *(f"  {line}" for line in text.split("\n"))]
    return lines


def _next(store: Store, capture: dict[str, Any]) -> list[str]:
    """Return the commands that show a capture's targets, and that measure it again."""
    name = capture["capture"]
    again = ["wheelplane", "batch", "ARCHIVE", "-o", store.url, "--retry", name]
    commands = {"measure it again": shlex.join(again)}
    if store.exists(MANIFEST):
        again[2] = json.loads(store.read(MANIFEST))["archive"]
        commands["measure it again"] = shlex.join(again)
        if "://" not in again[2]:  # of object storage, nothing is measured where it lies
            seen = _alone(Path(again[2]), name, capture["batch"]["kind"])
            commands = {"see its targets": seen} | commands
    return [f"{what}: {command}" for what, command in commands.items()]


def _alone(archive: Path, name: str, kind: str) -> str:
    """Return the command that measures a capture of a folder, unpacked if a zip of many holds it.

    The whole zip is unpacked, since a capture.toml may name files beside its capture's folder.
    """
    command = "five-point" if kind == "five-point" else "measure"
    packed = zip_above(archive, name)
    where = archive / name if packed is None else Path(UNPACKED) / name[len(packed) + 1 :]
    measured = shlex.join(["wheelplane", command, str(where), "--plot", "DIR"])
    if packed is None:
        return measured
    unpacked = shlex.join(["python3", "-m", "zipfile", "-e", str(archive / packed), UNPACKED])
    return f"{unpacked} && {measured}"
