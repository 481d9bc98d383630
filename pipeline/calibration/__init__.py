"""Calibration of wheel alignment machines: readings against reference angles."""

from .calibrate import by_series, calibrate, calibrate_file, calibrate_unfinished
from .certificate.file import CERTIFICATE_FORM, CertificateFile, load_certificate
from .certificate.issue import Certificate, Missing, issue
from .forms.fault import Fault
from .forms.item import DecisionRule, Item, ItemFile, ItemQuantity, item_toml, load_item
from .forms.plan_file import PLAN_FORM, Plan, load_plan
from .forms.quantities import QUANTITIES, units_of
from .forms.readings import COLUMNS, DIRECTIONS, STATES, Reading, Readings, State, read_texts
from .forms.table_file import FaultyTableError
from .forms.template import ITEM_FORM, readings_form
from .gauge_rr import AnovaRow, GaugeRR
from .plan import CalibrationPlan, Detection, QuantityPlan, plan_calibration
from .planned_bay import planned_reference
from .records import (
    Adjustment,
    Calibration,
    CalibrationPoint,
    Characteristic,
    Contribution,
    DirectionMean,
    QuantityResult,
    ReferenceRecord,
)
from .reference import Reference

__all__ = [
    "CERTIFICATE_FORM",
    "COLUMNS",
    "DIRECTIONS",
    "ITEM_FORM",
    "PLAN_FORM",
    "QUANTITIES",
    "STATES",
    "Adjustment",
    "AnovaRow",
    "Calibration",
    "CalibrationPlan",
    "CalibrationPoint",
    "Certificate",
    "CertificateFile",
    "Characteristic",
    "Contribution",
    "DecisionRule",
    "Detection",
    "DirectionMean",
    "Fault",
    "FaultyTableError",
    "GaugeRR",
    "Item",
    "ItemFile",
    "ItemQuantity",
    "Missing",
    "Plan",
    "QuantityPlan",
    "QuantityResult",
    "Reading",
    "Readings",
    "Reference",
    "ReferenceRecord",
    "State",
    "by_series",
    "calibrate",
    "calibrate_file",
    "calibrate_unfinished",
    "issue",
    "item_toml",
    "load_certificate",
    "load_item",
    "load_plan",
    "plan_calibration",
    "planned_reference",
    "read_texts",
    "readings_form",
    "units_of",
]
