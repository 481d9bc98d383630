"""The words of a report, one file a language, and its numbers as that language writes them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...system import frozen

FOLDER = Path(__file__).parent / "words"
LANGUAGES = tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))
DECIMAL = re.compile(r'^decimal = "(.)"$', re.MULTILINE)  # of "number.decimal"
POINT = re.compile(r"(?<=\d)\.(?=\d)")


@frozen
class Translations:
    """All texts of one of LANGUAGES, which are read when one of them is first asked for."""

    language: str

    @cached_property
    def texts(self) -> Mapping[str, str]:
        """All texts by section and key, such as `scene.forward`."""
        return dict(_flat(tomllib.loads(self._file)))

    @cached_property
    def decimal(self) -> str:
        """Decimal sign, sought alone: JSON has numbers in words, and no other text."""
        return str(DECIMAL.findall(self._file)[0])

    @cached_property
    def _file(self) -> str:
        return (FOLDER / f"{self.language}.toml").read_text(encoding="utf-8")

    def __call__(self, key: str, **parts: object) -> str:
        """Return the text `key` with its {parts} filled in."""
        return self.texts[key].format(**parts)

    def known(self, section: str, key: str, **parts: object) -> str:
        """Return the text of a name that the program uses, or the name itself."""
        name = f"{section}.{key.replace(' ', '_').replace('-', '_')}"
        return self(name, **parts) if name in self.texts else key.replace("_", " ")

    def wheel(self, name: str) -> str:
        """Return RR, RL, FR, FL in this language; any other name as it is."""
        return self.texts.get(f"wheel_name.{name}", name)

    def section(self, name: str) -> dict[str, str]:
        """Return all texts of a section by their keys."""
        within = f"{name}."
        return {k.removeprefix(within): v for k, v in self.texts.items() if k.startswith(within)}

    def count(self, count: int) -> str:
        """Write a whole number, its digits in threes."""
        return f"{count:,}".replace(",", "\u00a0")

    def number(self, text: str) -> str:
        """Write numbers with this language's decimal sign."""
        return POINT.sub(self.decimal, text)


@cache
def load_translations(language: str) -> Translations:
    """Return the texts of one of LANGUAGES. Raises InputError that lists them."""
    if language not in LANGUAGES:
        raise InputError(f"language {language!r}: known are {', '.join(LANGUAGES)}")
    return Translations(language)


def _flat(table: Mapping[str, Any], before: str = "") -> list[tuple[str, str]]:
    found = []
    for key, value in table.items():
        if isinstance(value, dict):
            found += _flat(value, f"{before}{key}.")
        else:
            found.append((f"{before}{key}", str(value)))
    return found
