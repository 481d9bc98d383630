"""Output folder, written completely or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import SynthError


def check_seed(seed: int) -> None:
    """Raise SynthError for a negative seed."""
    if seed < 0:
        raise SynthError(f"--seed {seed}: negative; give a whole number from 0")


def check_free(out: Path) -> None:
    """Raise SynthError unless `out` is an empty folder or does not exist.

    It is renamed to its name when it is complete: . and .. are none.
    """
    if out.name in ("", ".."):
        raise SynthError(f"{out}: no name of a folder to make; give one, such as {out / 'capture'}")
    if out.is_dir() and any(out.iterdir()):
        raise SynthError(f"{out}: the folder is not empty; name a new one")
    if out.exists() and not out.is_dir():
        raise SynthError(f"{out}: a file of that name exists; name a new folder")


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a folder beside `out`; rename it to `out` on success, delete it otherwise."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as scratch:
            folder = Path(scratch) / out.name
            folder.mkdir()
            yield folder
            folder.replace(out)
    except OSError as error:
        raise SynthError(f"{out}: {error.strerror}; name a folder that can be written") from error


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 with LF line ends on every system."""
    path.write_text(text, encoding="utf-8", newline="\n")
