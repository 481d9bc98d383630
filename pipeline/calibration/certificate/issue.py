"""Certificate of a calibration as ISO/IEC 17025:2017, 7.8 asks for it: complete, or a draft."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace

from ...config import EnvironmentConfig, LaboratoryConfig, StandardConfig
from ...errors import ConfigError, InputError
from ...system import frozen
from ..records import Calibration
from .file import CertificateConfig, CertificateFile

# What a certificate must state: ISO/IEC 17025:2017, 7.8.2.1 (b, c, d, e, f, h, i, j, o), 7.8.4.1.
REQUIRED = (
    "number", "customer", "customer_address", "method", "received", "performed", "issued",
    "signature",
)  # fmt: skip
OF_LABORATORY = ("name", "address")
OF_STANDARD = ("serial", "certificate", "issuer", "due")
OF_ENVIRONMENT = ("temperature_c", "sensors")


@frozen
class Missing:
    """Something that the certificate lacks: the key of its table, and of which standard."""

    table: str
    key: str
    name: str = ""


@frozen
class Certificate:
    """A calibration with all that its certificate states.

    missing: what makes it a draft. overdue: standards past their due date on the day of use that
    were accepted by name. doubted: readings that fit another convention, and references in doubt,
    make it a draft as well.
    """

    calibration: Calibration
    stated: CertificateConfig
    laboratory: LaboratoryConfig
    standards: tuple[StandardConfig, ...]
    environment: EnvironmentConfig
    missing: tuple[Missing, ...] = ()
    overdue: tuple[StandardConfig, ...] = ()

    @property
    def doubted(self) -> bool:
        """Whether readings fit another convention far better, or a reference is in doubt."""
        return bool(self.calibration.warnings or self.calibration.doubts)

    @property
    def draft(self) -> bool:
        """Whether anything hinders it from being issued."""
        return bool(self.missing) or self.doubted

    @property
    def performed(self) -> tuple[datetime.date, datetime.date] | None:
        """First and last day of the calibration, if stated."""
        first = self.stated.performed
        return None if first is None else (first, self.stated.performed_until or first)

    @property
    def place(self) -> str:
        """Place of the calibration, one line; empty where it is not stated."""
        given = self.stated.place
        if not given and self.stated.at == "laboratory":
            given = self.laboratory.place or self.laboratory.address
        elif not given and self.stated.at == "customer":
            given = self.stated.customer_address
        return ", ".join(line.strip() for line in given.strip().splitlines())


def issue(found: Calibration, given: CertificateFile, accepted: Sequence[str] = ()) -> Certificate:
    """Return the certificate of a calibration.

    accepted: names of standards that may be past their due date. Raises ConfigError for standards
    that are named twice or not at all, InputError for one past its due date, or calibrated later.
    """
    _check_names(given.standard, given.environment, accepted)
    made = Certificate(
        calibration=found,
        stated=given.certificate,
        laboratory=given.laboratory,
        standards=given.standard,
        environment=given.environment,
    )
    _check_calibrated(made)
    return replace(made, missing=_missing(made), overdue=_overdue(made, accepted))


def _check_names(
    standards: Sequence[StandardConfig], environment: EnvironmentConfig, accepted: Sequence[str]
) -> None:
    names = [one.name for one in standards]
    known = ", ".join(names) or "none"
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"[[standard]] {name}: it stands twice: give each a name of its own")
    for sensor in environment.sensors:
        if sensor not in names:
            raise ConfigError(
                f"[environment] sensors: no [[standard]] is called {sensor!r}: known are {known}"
            )
    for name in accepted:
        if name not in names:
            raise InputError(f"--accept-overdue {name}: no such [[standard]]: known are {known}")
    for key in ("temperature_c", "humidity_percent", "pressure_hpa"):
        ends = getattr(environment, key)
        if ends is not None and ends[0] > ends[1]:
            raise ConfigError(
                f"[environment] {key}: {ends[0]:g} lies above {ends[1]:g}: write the lowest first"
            )


def _check_calibrated(made: Certificate) -> None:
    """Raise InputError for a standard whose own calibration is later than its use, or its due date.

    Its certificate says nothing of the day on which it was used.
    """
    first = _last_day(made) if made.performed is None else made.performed[0]
    for one in made.standards:
        for day, what in ((first, "the day of its use"), (one.due, "its due date")):
            if one.calibrated is not None and day is not None and one.calibrated > day:
                raise InputError(
                    f"[[standard]] {one.name}: it was calibrated on {one.calibrated}, after "
                    f"{what}, {day}: name the certificate that was valid then, or correct the dates"
                )


def _overdue(made: Certificate, accepted: Sequence[str]) -> tuple[StandardConfig, ...]:
    """Return the accepted standards past their due date. Raises InputError for any other."""
    day = _last_day(made)
    late = tuple(
        one for one in made.standards if day is not None and one.due is not None and one.due < day
    )
    for one in late:
        if one.name not in accepted:
            raise InputError(
                f"[[standard]] {one.name}: its calibration was due on {one.due}, before {day}: "
                f"use another standard, or accept it by --accept-overdue {one.name!r}"
            )
    for name in accepted:
        if name not in [one.name for one in late]:
            raise InputError(f"--accept-overdue {name}: it is not past its due date: leave it out")
    return late


def _last_day(made: Certificate) -> datetime.date | None:
    """Return the last day of the calibration; that of the reference where it is not stated."""
    if made.performed is not None:
        return made.performed[1]
    date = made.calibration.date
    try:
        return None if date is None else datetime.date.fromisoformat(date[:10])
    except ValueError:
        return None


def _missing(made: Certificate) -> tuple[Missing, ...]:
    stated, laboratory = made.stated, made.laboratory
    found = [Missing("laboratory", key) for key in OF_LABORATORY if not getattr(laboratory, key)]
    found += [Missing("certificate", key) for key in REQUIRED if not getattr(stated, key)]
    if not made.place and "address" not in [one.key for one in found]:
        found.append(Missing("certificate", "place"))
    if stated.replaces and not stated.reason:
        found.append(Missing("certificate", "reason"))
    if not made.standards:
        found.append(Missing("standard", "any"))
    found += [
        Missing("standard", key, one.name)
        for one in made.standards
        for key in OF_STANDARD
        if not getattr(one, key)
    ]
    found += [
        Missing("environment", key) for key in OF_ENVIRONMENT if not getattr(made.environment, key)
    ]
    return tuple(found)
