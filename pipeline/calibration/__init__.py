"""Calibration of wheel alignment machines: readings against reference angles."""

from .calibrate import by_series, calibrate, calibrate_file
from .forms.item import DecisionRule, Item, ItemFile, ItemQuantity, load_item
from .forms.quantities import QUANTITIES
from .forms.readings import Reading, Readings, State
from .forms.table_file import FaultyTableError
from .forms.template import ITEM_FORM, readings_form
from .gauge_rr import AnovaRow, GaugeRR
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
    "ITEM_FORM",
    "QUANTITIES",
    "Adjustment",
    "AnovaRow",
    "Calibration",
    "CalibrationPoint",
    "Characteristic",
    "Contribution",
    "DecisionRule",
    "DirectionMean",
    "FaultyTableError",
    "GaugeRR",
    "Item",
    "ItemFile",
    "ItemQuantity",
    "QuantityResult",
    "Reading",
    "Readings",
    "Reference",
    "ReferenceRecord",
    "State",
    "by_series",
    "calibrate",
    "calibrate_file",
    "load_item",
    "readings_form",
]
