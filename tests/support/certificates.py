"""A calibration of a machine, and all that its certificate needs."""

from __future__ import annotations

import datetime
from functools import cache

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine
from wheelplane.calibration import Calibration, Certificate, CertificateFile, calibrate, issue
from wheelplane.calibration.certificate.file import CertificateConfig, Signature
from wheelplane.config import (
    Config,
    EnvironmentConfig,
    LaboratoryConfig,
    ReportConfig,
    StandardConfig,
)

DAY = datetime.date(2026, 11, 3)
LABORATORY = LaboratoryConfig(
    name="Laboratório 7", address="Rua das Rodas 12\nLisboa", email="lab@example.org",
    phone="+351 210 000 000", code="M0999", country="PT", traceability="Angle by laser tracker.",
)  # fmt: skip
SCANNER = StandardConfig(
    name="scanner", description="Laser scanner S70", serial="LS-0815", certificate="C-2026-17",
    issuer="National institute", calibrated=datetime.date(2026, 3, 1),
    due=datetime.date(2027, 3, 1),
)  # fmt: skip
SENSOR = StandardConfig(
    name="TH-1", serial="4711", certificate="TH-3", issuer="Laboratory T", due=DAY
)
ENVIRONMENT = EnvironmentConfig(
    temperature_c=(20.8, 21.6), humidity_percent=(48.0, 53.0), sensors=("TH-1",)
)
STATED = CertificateConfig(
    number="2026-0142", customer="Oficina Exemplo", customer_address="Avenida 3\nPorto",
    method="PT-07, edition 3", received=datetime.date(2026, 11, 2), performed=DAY,
    issued=datetime.date(2026, 11, 5), condition="no visible damage",
    signature=(Signature(name="Ana Silva", role="technical manager"),),
)  # fmt: skip
SETTINGS = Config(
    report=ReportConfig(laboratory=LABORATORY.name, address=LABORATORY.address),
    laboratory=LABORATORY,
    standard=(SCANNER, SENSOR),
    environment=ENVIRONMENT,
)
GIVEN = CertificateFile(
    certificate=STATED, laboratory=LABORATORY, standard=(SCANNER, SENSOR), environment=ENVIRONMENT
)

# The same for the commands and the page, as files.
SETTINGS_TOML = """\
[laboratory]
name = "Laboratory 7"
address = "Road 12"
country = "PT"
[[standard]]
name = "scanner"
serial = "LS-0815"
certificate = "C-17"
issuer = "National institute"
due = 2027-03-01
[environment]
temperature_c = [20.8, 21]
sensors = ["scanner"]
"""
CERTIFICATE_TOML = """\
[certificate]
number = "2026-0142"
customer = "Garage"
customer_address = "Avenue 3"
method = "PT-07"
received = 2026-11-02
performed = 2026-11-03
issued = 2026-11-05
[[certificate.signature]]
name = "Ana"
role = "manager"
"""


def given(table: str = "certificate", **values: object) -> CertificateFile:
    """A certificate file, complete but for the changed values of one of its tables."""
    if table == "standard":
        return GIVEN.model_copy(update={"standard": (SCANNER.model_copy(update=values), SENSOR)})
    section = getattr(GIVEN, table).model_copy(update=values)
    return GIVEN.model_copy(update={table: section})


@cache
def calibrated(adjusted: bool = False, mpe: float = 6.0, trials: int = 12) -> Calibration:
    """A calibration of 12 trials: toe and camber; as found, or as found and as left."""
    bay = Bay(seed=1, trials=trials)
    tested = machine(toe=changed(TOE, mpe=mpe), camber=CAMBER)
    readings = bay.readings(tested)
    if adjusted:
        left = bay.readings(machine(toe=changed(TOE, zero=0.0), camber=CAMBER), state="as left")
        readings = type(readings)(readings.source, "", readings.rows + left.rows)
    return calibrate((bay.reference(),), item_of(tested), readings)


def certificate(
    file: CertificateFile = GIVEN,
    adjusted: bool = False,
    mpe: float = 6.0,
    accepted: tuple[str, ...] = (),
) -> Certificate:
    """Its certificate."""
    return issue(calibrated(adjusted, mpe), file, accepted)
