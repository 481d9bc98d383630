"""Measurement results of a digital certificate: methods, equipment, conditions, values with U."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...calibration import Certificate, QuantityResult
from ...config import StandardConfig
from ...measurement import Estimate
from ...vehicle import Unit
from ..format.digits import place_of, rounded
from ..format.view import PAPER
from ..format.writer import Writer
from ..tables.calibration import declared, remarks, rule_words, title
from .conformity import conformity_of
from .texts import both, own, term
from .xml import Element, element

# Scale from radians or metres, and the D-SI name of the unit.
UNITS: dict[Unit, tuple[float, str]] = {
    "rad": (math.degrees(1.0), r"\degree"),
    "m": (1e3, r"\milli\metre"),
}
FINEST = -9  # power of ten of a number whose U is not known
CONDITIONS = (
    ("temperature_c", "temperature_u_c", r"\degreecelsius", "basic_temperature"),
    ("humidity_percent", "humidity_u_percent", r"\percent", "basic_humidityRelative"),
    ("pressure_hpa", "pressure_u_hpa", r"\hecto\pascal", "basic_pressureAir"),
)
CONDITION_FACTOR = "2"  # coverage factor of 95 % in certificates of sensors (EA-4/02 M, 5.1)


def measurement_results(made: Certificate) -> Element:
    """Return the second ring of the certificate."""
    results = made.calibration.results
    adjusted = {one.quantity for one in results if one.state == "as left"}
    return element(
        "dcc:measurementResults",
        _methods(made),
        element("dcc:measuringEquipments", *(_equipment(one) for one in made.standards)),
        _conditions(made),
        *(_result(one, one.quantity in adjusted) for one in results),
    )


def _methods(made: Certificate) -> Element:
    method = element(
        "dcc:usedMethod", own("dcc:name", made.stated.method), refType="basic_calibrationMethod"
    )
    rule = element(
        "dcc:usedMethod",
        term("dcc:name", "verdict.rule"),
        both("dcc:description", lambda words: rule_words(made.calibration, words)),
        refType="basic_conformity",
    )
    return element("dcc:usedMethods", method, rule if made.calibration.rule else None)


def _equipment(one: StandardConfig) -> Element:
    assert one.due is not None
    numbers = [
        ("manufacturer", one.serial, "certificate.standard_serial", "basic_serialNumber"),
        ("calibrationLaboratory", one.certificate, "certificate.standard_certificate", ""),
        ("other", one.issuer, "certificate.standard_issuer", ""),
        ("other", one.due.isoformat(), "certificate.standard_due", ""),
    ]
    identifications = [
        element(
            "dcc:identification",
            element("dcc:issuer", issuer),
            element("dcc:value", value),
            term("dcc:name", key),
            **({"refType": kind} if kind else {}),
        )
        for issuer, value, key, kind in numbers
    ]
    name = f"{one.description} ({one.name})" if one.description else one.name
    return element(
        "dcc:measuringEquipment",
        own("dcc:name", name),
        element("dcc:identifications", *identifications),
        refType="basic_measurementStandard",
    )


def _conditions(made: Certificate) -> Element:
    found = []
    for key, key_u, unit, kind in CONDITIONS:
        ends, expanded = getattr(made.environment, key), getattr(made.environment, key_u)
        if ends is None:
            continue
        values = [
            element(
                "dcc:quantity",
                element(
                    "si:real",
                    element("si:value", f"{value:.10g}"),
                    element("si:unit", unit),
                    _univariate(f"{expanded:.10g}", CONDITION_FACTOR) if expanded else None,
                ),
                refType=f"{kind}{end}",
            )
            for end, value in zip(("Min", "Max"), ends, strict=True)
        ]
        found.append(
            element(
                "dcc:influenceCondition",
                term("dcc:name", f"certificate.{key}_name"),
                element("dcc:data", *values),
                refType=kind,
            )
        )  # fmt: skip
    return element("dcc:influenceConditions", *found)


def _result(result: QuantityResult, adjusted: bool) -> Element:
    """Return the results of one quantity in one state."""
    return element(
        "dcc:measurementResult",
        both("dcc:name", lambda words: title(result, words)),
        _state(result) if adjusted else None,
        element("dcc:results", _points(result), _characteristic(result)),
    )


def _state(result: QuantityResult) -> Element:
    found = result.state == "as found"
    key = "calibration.found" if found else "calibration.left"
    condition = element(
        "dcc:influenceCondition",
        term("dcc:name", key),
        element("dcc:status", "beforeAdjustment" if found else "afterAdjustment"),
        element("dcc:data", term("dcc:text", key)),
    )
    return element("dcc:influenceConditions", condition)


def _points(result: QuantityResult) -> Element:
    """Return reference, reading and error of every point, with the verdicts."""
    points = result.points
    labels = [point.point for point in points]
    readings = [Estimate(point.reading, 0.0) for point in points]
    places = [_place(point.error, result.unit) for point in points]
    data = element(
        "dcc:list",
        _quantity("reference", "basic_referenceValue", labels,
                  [point.reference for point in points], result.unit),
        _quantity("reading", "basic_measuredValue", labels, readings, result.unit, places),
        _quantity("error", "basic_measurementError", labels, [point.error for point in points],
                  result.unit, meta=_verdicts(result)),
        refType="basic_tableIndex0",
    )  # fmt: skip
    return element(
        "dcc:result",
        term("dcc:name", "calibration.points"),
        both("dcc:description", lambda words: _circumstances(result, Writer(words, PAPER))),
        element("dcc:data", data),
    )


def _circumstances(result: QuantityResult, writer: Writer) -> str:
    """Return in words what the item declares, and what of it and of the points differs."""
    return " ".join(f"{text}." for text in (declared(result, writer), *remarks(result, writer)))


def _quantity(
    key: str,
    kind: str,
    labels: Sequence[str],
    values: Sequence[Estimate],
    unit: Unit,
    places: Sequence[int] | None = None,
    meta: Element | None = None,
) -> Element:
    """Return a list of values; with U and k where places, those of the values, are not given."""
    scale, name = UNITS[unit]
    own_places = places or [_place(value, unit) for value in values]
    numbers = [
        rounded(value.value * scale, place, "")
        for value, place in zip(values, own_places, strict=True)
    ]
    listed = element(
        "si:realListXMLList",
        element("si:labelXMLList", " ".join("_".join(label.split()) for label in labels)),
        element("si:valueXMLList", " ".join(numbers)),
        element("si:unitXMLList", name),
        _expanded(values, own_places, unit) if places is None else None,
    )
    return element(
        "dcc:quantity", term("dcc:name", f"calibration.{key}"), listed, meta, refType=kind
    )


def _expanded(values: Sequence[Estimate], places: Sequence[int], unit: Unit) -> Element | None:
    if not all(value.u > 0.0 for value in values):
        return None
    scale = UNITS[unit][0]
    sizes = [
        rounded(value.expanded * scale, place, "")
        for value, place in zip(values, places, strict=True)
    ]
    factors = [f"{value.expanded / value.u:.2f}" for value in values]
    inner = element(
        "si:expandedMUXMLList",
        element("si:valueExpandedMUXMLList", " ".join(sizes)),
        element("si:coverageFactorXMLList", " ".join(factors)),
        element("si:coverageProbabilityXMLList", "0.95"),
    )
    return element("si:measurementUncertaintyUnivariateXMLList", inner)


def _verdicts(result: QuantityResult) -> Element | None:
    if any(point.verdict is None for point in result.points):
        return None
    words = " ".join(conformity_of(point) for point in result.points)
    mpe = result.declared.mpe
    data = element(
        "dcc:metaData",
        both(
            "dcc:declaration",
            lambda words: words("calibration.mpe_of", value=words.number(f"±{mpe}")),
        ),
        element("dcc:conformityXMLList", words),
        refType="basic_conformity",
    )
    return element("dcc:measurementMetaData", data)


def _characteristic(result: QuantityResult) -> Element:
    """Return zero error, sensitivity, linearity and hysteresis."""
    line, (scale, unit) = result.characteristic, UNITS[result.unit]
    parts = (("zero_error", line.zero, scale, unit), ("slope", line.sensitivity, 1.0, r"\one"),
             ("linearity_error", line.linearity, scale, unit),
             ("hysteresis_mean", result.hysteresis, scale, unit))  # fmt: skip
    quantities = [
        _real(key, value, size, name) for key, value, size, name in parts if value is not None
    ]
    return element(
        "dcc:result",
        term("dcc:name", "certificate.characteristic"),
        element("dcc:data", *quantities),
    )


def _real(key: str, value: Estimate, scale: float, unit: str) -> Element:
    place = place_of(value.expanded * scale)
    at = FINEST if place is None else place
    size = rounded(value.expanded * scale, at, "")
    real = element(
        "si:real",
        element("si:value", rounded(value.value * scale, at, "")),
        element("si:unit", unit),
        _univariate(size, f"{value.expanded / value.u:.2f}") if value.u else None,
    )
    return element(
        "dcc:quantity",
        term("dcc:name", f"certificate.{key}"),
        real,
        refType=f"wheelplane_{key}",
    )


def _univariate(expanded: str, factor: str) -> Element:
    """Return the expanded uncertainty (95 %) of one number."""
    inner = element(
        "si:expandedMU",
        element("si:valueExpandedMU", expanded),
        element("si:coverageFactor", factor),
        element("si:coverageProbability", "0.95"),
    )
    return element("si:measurementUncertaintyUnivariate", inner)


def _place(value: Estimate, unit: Unit) -> int:
    place = place_of(value.expanded * UNITS[unit][0])
    return FINEST if place is None else place
