"""Calibration of wheel alignment machines: readings against reference angles."""

from .calibrate import by_series, calibrate, calibrate_file
from .certificate.file import CERTIFICATE_FORM, CertificateFile, load_certificate
from .certificate.issue import Certificate, Missing, issue
from .forms.item import DecisionRule, Item, ItemFile, ItemQuantity, load_item
from .forms.plan_file import PLAN_FORM, Plan, load_plan
from .forms.quantities import QUANTITIES
from .forms.readings import Reading, Readings, State
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
    "ITEM_FORM",
    "PLAN_FORM",
    "QUANTITIES",
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
    "issue",
    "load_certificate",
    "load_item",
    "load_plan",
    "plan_calibration",
    "planned_reference",
    "readings_form",
]
