"""Account of one capture's result: its status, reason, inputs and log."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

from ...errors import InputError, printable
from ..catalogue.catalogue import open_catalogue
from ..catalogue.load_records import json_name
from ..catalogue.rows import DAMAGED, CaptureRow, read_record
from ..catalogue.schema import identity
from ..storage.store import Store, open_store
from ..storage.zipped import zip_above

MANIFEST, OPTIONS = "run/begun.json", "run/options.json"
WRITTEN_BYTE = re.compile(r"\\x([89a-f][0-9a-f])")  # as `legible` writes one that is not UTF-8
COPY, UNPACKED = "COPY", "UNPACKED"  # folders that the user names, as DIR
FETCH = (
    "import sys, fsspec; fs, path = fsspec.url_to_fs(sys.argv[1]); "
    "fs.get(path, sys.argv[2], recursive=True)"
)
TAKEN = {  # of the options of `batch`, by the command that measures one capture
    "measure": (
        *("--target", "--length-unit", "--columns", "--pitch", "--front", "--front-point"),
        *("--up", "--config", "--scanner", "--vertical"),
    ),
    "five-point": (
        *("--length-unit", "--coordinates", "--angle-unit", "--azimuth", "--total-station"),
        *("--total-station-position", "--radius"),
    ),
}


def account(results: str, name: str) -> str:
    """Return why the result of the capture `name` is as it is. Raises InputError if it has none.

    A damaged result, which names no capture, is called by its key.
    """
    with open_catalogue(results) as catalogue:
        question = "SELECT key FROM captures WHERE name = ? OR (id = ? AND key = ?)"
        rows = catalogue.connection.execute(question, (name, *identity(name)))
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
    data = store.read(json_name(key))
    row = read_record(key, data).capture
    if row.status == DAMAGED:
        lines = [*_damaged(store, row), "", *_next(store, DAMAGED, "")]
    else:
        tree: dict[str, Any] = json.loads(data)
        lines = [*_lines(store, key, tree), "", *_next(store, row.name, row.kind)]
    return "\n".join(map(printable, lines))


def files_of(key: str) -> tuple[str, ...]:
    """Return the names of the files that an account is made of, whether they exist or not."""
    return json_name(key), _log(key), MANIFEST, OPTIONS


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
    return lines + _log_lines(store, key)


def _damaged(store: Store, row: CaptureRow) -> list[str]:
    """Return what is known of a result that cannot be read."""
    lines = [f"{row.key}: {row.status}", f"  {row.reason}", f"  result     {json_name(row.key)}"]
    return lines + _log_lines(store, row.key)


def _log_lines(store: Store, key: str) -> list[str]:
    log = _log(key)
    if not store.exists(log):
        return []
    text = store.read(log).decode(errors="replace").rstrip()
    return ["", f"{log}:", *(f"  {line}" for line in text.split("\n"))]


def _next(store: Store, name: str, kind: str) -> list[str]:
    """Return the commands that show a capture's targets, and that measure it again.

    name: of the capture, or a status of `--retry`; kind: empty of a status.
    """
    given, known = (_stated(store, file) for file in (OPTIONS, MANIFEST))
    archive = known.get("archive", "ARCHIVE")
    lines = []
    if known and kind:
        command = "five-point" if kind == "five-point" else "measure"
        taken = {option: text for option, text in given.items() if option in TAKEN[command]}
        alone = _alone(archive, name, ["wheelplane", command], _flat(taken))
        lines.append(f"see its targets: {alone}")
    again = ["wheelplane", "batch", archive, "-o", store.url, "--retry", name, *_flat(given)]
    return [*lines, f"measure it again: {_pasted(again)}"]


def _stated(store: Store, file: str) -> dict[str, str]:
    """Return what a file of a run states; nothing where it is missing or damaged."""
    try:
        tree = json.loads(store.read(file)) if store.exists(file) else {}
    except ValueError:
        return {}
    return tree if isinstance(tree, dict) else {}


def _flat(options: dict[str, str]) -> list[str]:
    return [part for option in options.items() for part in option]


def _alone(archive: str, name: str, command: list[str], options: list[str]) -> str:
    """Return the command that measures a capture of an archive outside it.

    Copied first from object storage, and unpacked if a zip of many holds it: the whole zip, since
    a capture.toml may name files beside its capture's folder.
    """
    steps: list[list[str]] = []
    is_remote = "://" in archive
    name = name if is_remote else _on_disk(archive, name)
    packed = _zip_of(archive, name)
    source = packed or name
    at = archive.rstrip("/") + f"/{source}" if is_remote else str(Path(archive) / source)
    if is_remote:
        copy = f"{COPY}/{source}"
        steps.append(["python3", "-c", FETCH, at, copy])
        at = copy
    if packed is not None:
        steps.append(["python3", "-m", "zipfile", "-e", at, UNPACKED])
        at = f"{UNPACKED}/{name[len(packed) + 1 :]}"
    shown = "--explain" if command[-1] == "measure" else "--plot"
    steps.append([*command, at, shown, "DIR", *options])
    return " && ".join(map(_pasted, steps))


def _on_disk(archive: str, name: str) -> str:
    r"""Return a name of the results as the system holds it: \xeb may stand for that byte."""
    as_bytes = WRITTEN_BYTE.sub(lambda found: chr(0xDC00 + int(found[1], 16)), name)
    is_there = (Path(archive) / as_bytes).exists() or _zip_of(archive, as_bytes) is not None
    return as_bytes if is_there else name


def _pasted(command: list[str]) -> str:
    """Return a command as a shell takes it, in printable signs alone."""
    return " ".join(map(_quoted, command))


def _quoted(word: str) -> str:
    if word.isprintable():
        return shlex.quote(word)
    signs = (sign if sign.isprintable() else _as_bytes(sign) for sign in word.replace("\\", r"\\"))
    return "$'" + "".join(signs).replace("'", r"\'") + "'"


def _as_bytes(sign: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in sign.encode(errors="surrogateescape"))


def _zip_of(archive: str, name: str) -> str | None:
    """Return the name of the zip that holds the capture ZIP/PATH, if any.

    Of object storage by the name alone, without a request: the page asks as well.
    """
    is_remote = "://" in archive
    return zip_above(lambda one: is_remote or (Path(archive) / one).is_file(), name)
