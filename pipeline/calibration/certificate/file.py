"""Certificate file (TOML): number, customer, dates and persons of one calibration."""

from __future__ import annotations

import datetime
from itertools import pairwise
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator  # noqa: TID253 - a certificate is a pydantic model

from ...config import (
    Config,
    EnvironmentConfig,
    LaboratoryConfig,
    Section,
    StandardConfig,
    parse_section,
    read_toml,
)
from ...errors import ConfigError

NUMBER = r"^\w([\w ./:+-]{0,58}\w)?$"  # it stands at the foot of each page
CERTIFICATE_FORM = """\
# What the certificate of one calibration states. What is missing makes it a draft.
[certificate]
number = ""            # each certificate its own
customer = ""
customer_address = ""  # and contact; several lines between triple quotes
method = ""            # the laboratory's procedure, with its edition
# received = 2026-01-30          # the item
# performed = 2026-01-31         # the calibration; its last day as performed_until
# issued = 2026-02-01
at = "laboratory"      # or "customer", "other"
place = ""             # if not at that address
condition = ""         # of the item as received
deviations = ""        # from the method
remarks = ""
replaces = ""          # number of the certificate that this one amends ...
reason = ""            # ... and why

# [[certificate.signature]]      # who authorises it
# name = ""
# role = ""

# [environment]                  # of this calibration, in the place of the settings'
# temperature_c = [20.5, 21.5]   # lowest and highest
# temperature_u_c = 0.3          # U of the sensor
# humidity_percent = [45, 55]
# sensors = []                   # names of [[standard]] tables of the settings
"""
Day = datetime.date | None


class Signature(Section):
    """A person who authorises the certificate."""

    name: str = Field(min_length=1)
    role: str = Field(min_length=1)


class CertificateConfig(Section):
    """Data of this certificate alone; all may be missing from a draft.

    customer_address: lines, with contact. performed: the first day, performed_until the last.
    at: at the laboratory, at the customer's or elsewhere; place names it. condition: of the item as
    received. deviations: from the method. replaces: number of the certificate that this amends.
    """

    number: str = Field("", pattern=NUMBER + "|^$", examples=["2026-0117"])
    customer: str = ""
    customer_address: str = ""
    method: str = ""
    received: Day = None
    performed: Day = None
    performed_until: Day = None
    issued: Day = None
    at: Literal["laboratory", "customer", "other"] = "laboratory"
    place: str = ""
    condition: str = ""
    deviations: str = ""
    remarks: str = ""
    replaces: str = Field("", pattern=NUMBER + "|^$", examples=["2026-0117"])
    reason: str = ""
    signature: tuple[Signature, ...] = Field((), strict=False)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        days = [
            (name, day)
            for name in ("received", "performed", "performed_until", "issued")
            if (day := getattr(self, name)) is not None
        ]
        for (before, first), (after, second) in pairwise(days):
            if second < first:
                raise ValueError(
                    f"{after} ({second}) lies before {before} ({first}): correct one of them"
                )
        if self.performed_until is not None and self.performed is None:
            raise ValueError("performed_until without performed: add the first day")
        if self.replaces and self.replaces == self.number:
            raise ValueError(f"replaces is its own number, {self.number}: give it a new number")
        if self.reason and not self.replaces:
            raise ValueError("reason without replaces: name the certificate that this one replaces")
        return self


class CertificateFile(Section):
    """Certificate file; its standards and environment replace those of the settings."""

    certificate: CertificateConfig = CertificateConfig()
    laboratory: LaboratoryConfig = LaboratoryConfig()
    standard: tuple[StandardConfig, ...] = Field((), strict=False)
    environment: EnvironmentConfig = EnvironmentConfig()


def load_certificate(path: Path | None, config: Config) -> CertificateFile:
    """Load a certificate file, completed by the settings. Raises ConfigError."""
    head = {"name": config.report.laboratory, "address": config.report.address}
    settings = CertificateFile(
        laboratory=config.laboratory.model_copy(update=head),
        standard=config.standard,
        environment=config.environment,
    )
    if path is None:
        return settings
    table = read_toml(path)
    if "laboratory" in table:
        raise ConfigError(f"{path}: [laboratory] belongs to the settings: move it to --config")
    given = parse_section(CertificateFile, table, str(path))
    return settings.model_copy(update={name: getattr(given, name) for name in table})
