"""What a batch is told: how to measure its captures, whatever else is in its archive."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from ... import __version__
from ...capture import CaptureOptions
from ...config import Config
from ...errors import InputError
from ...five_point import Station
from ...report.json.measurement import SCHEMA
from ...targets import Target
from ...units import AngleUnit, Azimuth, Coordinates
from .discover import Kind

DEFAULT, OF_CLOUDS = Config(), CaptureOptions(of_clouds=True)


@dataclass(frozen=True)
class Settings:
    """All that changes a result beside the capture itself.

    config: with what the scanner's file states, where `scanner` was named. target: goes before a
    capture's own. coordinates, angle_unit, azimuth, station: of five-point files.
    date_in_name: a pattern whose group, or groups y, m and d, tell a capture's day by its name.
    """

    config: Config = DEFAULT
    scanner: str | None = None
    target: Target | None = None
    told: CaptureOptions = OF_CLOUDS
    coordinates: Coordinates = "cartesian"
    angle_unit: AngleUnit | None = None
    azimuth: Azimuth = "auto"
    station: Station | None = None
    date_in_name: str | None = None

    def effective(self, kind: Kind) -> dict[str, Any]:
        """As plain data, what matters for captures of a kind."""
        stated: dict[str, Any] = {
            "length_unit": self.told.length_unit,
            "date_in_name": self.date_in_name,
        }
        if kind == "five-point":
            station = self.station
            return stated | {
                "coordinates": self.coordinates,
                "angle_unit": self.angle_unit,
                "azimuth": self.azimuth,
                "station": None if station is None else station.stated.model_dump(),
                "place_m": None if station is None else station.position_m.tolist(),
            }
        return stated | {
            "config": self.config.model_dump(exclude={"report"}),
            "scanner": self.scanner is not None,
            "target": None if self.target is None else self.target.model_dump(),
            "told": asdict(self.told),
        }

    def digest(self, kind: Kind) -> str:
        """Of what is effective for a kind, 64 hexadecimal digits."""
        return self._digests[kind == "five-point"]

    @cached_property
    def _digests(self) -> tuple[str, str]:
        return digest(self.effective("folder")), digest(self.effective("five-point"))

    @property
    def mark(self) -> str:
        """Of everything: runs of one mark give the same results."""
        return digest([__version__, SCHEMA, *self._digests])

    def date_of(self, name: str) -> str | None:
        """The day that a capture's name tells, as 2026-11-20; None where it tells none."""
        found = re.search(self.date_in_name, name) if self.date_in_name else None
        if found is None:
            return None
        named = found.groupdict()
        parts = [named[k] for k in "ymd"] if named else [found[found.re.groups and 1]]
        return None if None in parts else iso_date("-".join(parts))


def iso_date(text: str) -> str | None:
    """A date, or a date and time, as ISO 8601 writes it; None where it is none."""
    from datetime import date, datetime

    for kind in (date, datetime):
        try:
            return kind.fromisoformat(text).isoformat()
        except ValueError:
            continue
    return None


def check_date_pattern(pattern: str) -> None:
    """Raise InputError for a pattern that does not compile, names only some of y, m, d, or has
    several groups without names.
    """
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise InputError(f"--date-in-name {pattern}: no regular expression: {error}") from error
    groups = compiled.groupindex
    if not groups and compiled.groups > 1:
        raise InputError(
            f"--date-in-name {pattern}: it has {compiled.groups} groups: name them y, m and d, or "
            "keep one, around a date as 2026-11-20"
        )
    if groups and set(groups) != {"y", "m", "d"}:
        raise InputError(
            f"--date-in-name {pattern}: its named groups are {', '.join(groups)}: name the groups "
            "y, m and d, or none, and one group around a date as 2026-11-20"
        )


def digest(value: object) -> str:
    """The sha256 of plain data, 64 hexadecimal digits."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
