"""Settings of a batch: how its captures are measured."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict
from functools import cached_property
from typing import Any

from ... import __version__
from ...capture import CaptureOptions
from ...config import ISSUER, Config
from ...errors import InputError
from ...five_point import Station
from ...measurement import VerticalKind
from ...report.json.measurement import SCHEMA
from ...system import frozen
from ...targets import TargetChoice
from ...units import AngleUnit, Azimuth, Coordinates
from .discover import Kind

DEFAULT, OF_CLOUDS = Config(), CaptureOptions(of_clouds=True)


@frozen
class BatchSettings:
    """All that changes a result apart from the capture itself.

    config: includes the scanner file if `scanner` was given. target: overrides that of a capture.
    options: overrides of capture.toml. vertical: from which camber, caster and SAI are measured.
    coordinates, angle_unit, azimuth, station, radius_m: for five-point files. date_in_name: pattern
    whose group, or groups y, m and d, match the date in a name.
    """

    config: Config = DEFAULT
    scanner: str | None = None
    target: TargetChoice | None = None
    options: CaptureOptions = OF_CLOUDS
    vertical: VerticalKind = "wheels"
    coordinates: Coordinates = "cartesian"
    angle_unit: AngleUnit | None = None
    azimuth: Azimuth = "auto"
    station: Station | None = None
    radius_m: float | None = None
    date_in_name: str | None = None

    def effective(self, kind: Kind) -> dict[str, Any]:
        """Return the settings that apply to captures of a kind, as plain data."""
        stated: dict[str, Any] = {
            "length_unit": self.options.length_unit,
            "date_in_name": self.date_in_name,
        }
        if kind == "five-point":
            station = self.station
            if self.radius_m is not None:
                stated["radius_m"] = self.radius_m
            return stated | {
                "coordinates": self.coordinates,
                "angle_unit": self.angle_unit,
                "azimuth": self.azimuth,
                "station": None if station is None else station.stated.model_dump(),
                "place_m": None if station is None else station.position_m.tolist(),
            }
        if self.vertical != "wheels":
            stated["vertical"] = self.vertical
        return stated | {
            "config": self.config.model_dump(exclude=set(ISSUER)),
            "scanner": self.scanner is not None,
            "target": None if self.target is None else self.target.stated(),
            "told": _stated(self.options),
        }

    def digest(self, kind: Kind) -> str:
        """Return the SHA-256 of the settings that apply to a kind, 64 hexadecimal digits."""
        return self._digests[kind == "five-point"]

    @cached_property
    def _digests(self) -> tuple[str, str]:
        return digest(self.effective("folder")), digest(self.effective("five-point"))

    @property
    def settings_hash(self) -> str:
        """SHA-256 of settings, version and schema; runs of equal hash give the same results."""
        return digest([__version__, SCHEMA, *self._digests])

    def date_of(self, name: str) -> str | None:
        """Return the date in a capture's name, as 2026-11-20; None if there is none.

        Named groups may hold a month and a day of one digit.
        """
        found = re.search(self.date_in_name, name) if self.date_in_name else None
        if found is None:
            return None
        named = found.groupdict()
        parts = [named[k] for k in "ymd"] if named else [found[found.re.groups and 1]]
        return None if None in parts else iso_date("-".join(part.zfill(2) for part in parts))


def _stated(options: CaptureOptions) -> dict[str, Any]:
    """Return the options as plain data; those of reading only where they are stated."""
    told = asdict(options)
    del told["reading"]
    return told | options.reading.stated()


def iso_date(text: str) -> str | None:
    """Return a date, or date and time, in ISO 8601; None if the text is neither."""
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
        raise InputError(
            f"--date-in-name {pattern}: not a regular expression ({error}): check it"
        ) from error
    groups = compiled.groupindex
    if not groups and compiled.groups > 1:
        raise InputError(
            f"--date-in-name {pattern}: it has {compiled.groups} groups: name them y, m and d, or "
            "keep one group around a date such as 2026-11-20"
        )
    if groups and set(groups) != {"y", "m", "d"}:
        raise InputError(
            f"--date-in-name {pattern}: its named groups are {', '.join(groups)}: name the groups "
            "y, m and d, or use one unnamed group around a date such as 2026-11-20"
        )


def digest(value: object) -> str:
    """Return the SHA-256 of plain data, 64 hexadecimal digits."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
