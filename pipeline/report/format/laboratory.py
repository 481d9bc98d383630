"""Who issues a report: the section [report] of the config, its logo read in."""

from __future__ import annotations

import base64
from pathlib import Path

from ...config import ReportConfig
from ...errors import ConfigError
from ...system import frozen

KINDS = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpeg", b"GIF8": "gif"}
MOST_BYTES = 1_000_000


@frozen
class Laboratory:
    """logo: as a data URI, '' for none. address: its lines. signatures: a line for each."""

    name: str = ""
    address: tuple[str, ...] = ()
    logo: str = ""
    signatures: tuple[str, ...] = ()


NOBODY = Laboratory()


def read_laboratory(config: ReportConfig) -> Laboratory:
    """Read the section and its logo. Raises ConfigError for a logo that cannot be used."""
    address = tuple(line.strip() for line in config.address.strip().splitlines())
    logo = "" if config.logo is None else _logo(Path(config.logo))
    return Laboratory(config.laboratory, address, logo, config.signatures)


def _logo(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"[report] logo {path}: cannot be read ({error.strerror}): check its path, which "
            "counts from the config's folder"
        ) from error
    if len(data) > MOST_BYTES:
        raise ConfigError(
            f"[report] logo {path}: {len(data)} bytes: make it smaller than {MOST_BYTES}"
        )
    kind = next((kind for mark, kind in KINDS.items() if data.startswith(mark)), None)
    if kind is None and b"<svg" in data[:2000]:
        kind = "svg+xml"
    if kind is None:
        raise ConfigError(f"[report] logo {path}: no PNG, JPEG, GIF or SVG: name one")
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
