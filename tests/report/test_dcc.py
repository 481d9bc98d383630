"""Tests of the digital certificate: required elements in their order, D-SI numbers, the schema.

Set WHEELPLANE_DCC_SCHEMA to a folder with dcc.xsd 3.3.0, and what it imports, for the last of them.
"""

from __future__ import annotations

import datetime
import math
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.calibration_bay import TOE, Bay, changed, item_of, machine
from tests.support.certificates import DAY, ENVIRONMENT, calibrated, certificate, given
from wheelplane.calibration import calibrate, issue
from wheelplane.errors import InputError
from wheelplane.report.dcc.certificate import dcc_bytes
from wheelplane.report.dcc.conformity import conformity_of, overall
from wheelplane.report.dcc.xml import element, schema_faults, to_bytes
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.format.writer import Writer
from wheelplane.report.tables.calibration import declared, remarks, shown_lines

etree = pytest.importorskip("lxml.etree")
NAMES = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}
SCHEMA = os.environ.get("WHEELPLANE_DCC_SCHEMA", "")
# D-SI 2.2.1: decimalType, kValueType.
DECIMAL = re.compile(r"[-+]?((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?")
FACTOR = re.compile(r"([1-9]\d*\.\d*)|([1-9]\d*)")

# Children in the order of the schema, "?" for those that may be missing.
ORDER = {
    "digitalCalibrationCertificate": "administrativeData measurementResults",
    "administrativeData": "dccSoftware coreData items calibrationLaboratory respPersons customer "
    "statements?",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1 usedLangCodeISO639_1 "
    "mandatoryLangCodeISO639_1 uniqueIdentifier receiptDate beginPerformanceDate "
    "endPerformanceDate performanceLocation issueDate reportAmendedSubstituted?",
    "item": "name installedSoftwares manufacturer model identifications",
    "identification": "issuer value name",
    "calibrationLaboratory": "calibrationLaboratoryCode? contact",
    "contact": "name eMail? phone? location",
    "customer": "name location",
    "respPerson": "person role mainSigner",
    "measuringEquipment": "name identifications",
    "influenceCondition": "name status? data",
    "measurementResult": "name influenceConditions? results",
    "result": "name description? data",
    "statement": "traceable? declaration conformity?",
    "metaData": "declaration conformityXMLList",
    "realListXMLList": "labelXMLList valueXMLList unitXMLList "
    "measurementUncertaintyUnivariateXMLList?",
    "expandedMUXMLList": "valueExpandedMUXMLList coverageFactorXMLList coverageProbabilityXMLList",
    "real": "value unit measurementUncertaintyUnivariate?",
}  # fmt: skip


def tree(made=None, language="en"):
    return etree.fromstring(dcc_bytes(made or certificate(), language))


def every(root, path):
    return root.findall(f".//{path}", NAMES)


def text(root, path):
    return root.find(f".//{path}", NAMES).text


def test_what_the_printed_form_says_of_the_circumstances_stands_in_it():
    """The item's condition, the sensors and the note on them, and a standard past its due date."""
    late = given("standard", due=DAY - datetime.timedelta(1))
    open_doors = ENVIRONMENT.model_copy(update={"note": "The doors were open."})
    noted = late.model_copy(update={"environment": open_doors})
    made = certificate(noted, accepted=("scanner",))
    root = tree(made)
    said = {
        one.get("refType"): {c.get("lang"): c.text for c in every(one, "dcc:content")}
        for one in every(root, "dcc:statement")
    }
    for words in map(load_translations, LANGUAGES):
        of_language = {kind: texts[words.language] for kind, texts in said.items()}
        condition = f"{words('certificate.condition')}: no visible damage"
        assert of_language["wheelplane_condition"] == condition
        sensors = words("certificate.sensors", names="TH-1")
        head = words("certificate.conditions")
        environment = f"{head}: {sensors}; The doors were open."
        assert of_language["wheelplane_environment"] == environment
        name = "Laser scanner S70 (scanner)"
        overdue = words("certificate.overdue", name=name, due="2026-11-02")
        assert of_language["wheelplane_overdue"] == overdue
    assert "wheelplane_overdue" not in {
        one.get("refType") for one in every(tree(), "dcc:statement")
    }


@pytest.mark.parametrize("adjusted", [False, True])
def test_elements_stand_in_the_order_of_the_schema(adjusted):
    root = tree(certificate(given(replaces="1", reason="Wrong serial."), adjusted))
    assert root.get("schemaVersion") == "3.3.0"
    seen = set()
    for node in root.iter():
        name = etree.QName(node).localname
        if name in ORDER:
            words = ORDER[name].split()
            pattern = "".join(f"({w[:-1]} )?" if w.endswith("?") else f"{w} " for w in words)
            found = "".join(f"{etree.QName(child).localname} " for child in node)
            assert re.fullmatch(pattern, found), (name, found)
            seen.add(name)
    assert seen == set(ORDER)
    assert not [node for node in root.iter() if len(node) == 0 and not (node.text or "").strip()]


def test_it_says_what_the_certificate_says():
    root = tree(language="pt")
    core = {
        "dcc:uniqueIdentifier": "2026-0142", "dcc:countryCodeISO3166_1": "PT",
        "dcc:mandatoryLangCodeISO639_1": "pt", "dcc:receiptDate": "2026-11-02",
        "dcc:beginPerformanceDate": "2026-11-03", "dcc:endPerformanceDate": "2026-11-03",
        "dcc:performanceLocation": "laboratory", "dcc:issueDate": "2026-11-05",
        "dcc:calibrationLaboratoryCode": "M0999", "dcc:model": "Bay", "dcc:role":
        "technical manager", "dcc:respPerson//dcc:content": "Ana Silva",
        "dcc:customer//dcc:content": "Oficina Exemplo",
    }  # fmt: skip
    assert {path: text(root, path) for path in core} == core
    assert [node.text for node in every(root, "dcc:usedLangCodeISO639_1")] == ["en", "pt"]
    values = {node.text for node in every(root, "dcc:measuringEquipment//dcc:value")}
    assert {"LS-0815", "C-2026-17", "National institute", "2027-03-01", "4711"} <= values


def test_it_says_in_which_sense_and_from_which_axis_values_count():
    """Numbers alone cannot be read: what the item declares stands with each result."""
    root = tree()
    for path, words in (("en", "toe-in"), ("pt", "convergente")):
        said = [
            node.text
            for node in every(root, "dcc:result/dcc:description/dcc:content")
            if node.get("lang") == path
        ]
        assert len(said) == len(every(root, "dcc:measurementResult"))
        assert any(words in text for text in said), said
    assert any("normal of the rear axle" in (node.text or "") for node in root.iter())


def test_an_amendment_names_what_it_replaces():
    root = tree(certificate(given(replaces="2026-0100", reason="Wrong serial.")))
    assert text(root, "dcc:typeOfChange") == "amended"
    assert text(root, "dcc:replacedUniqueIdentifier") == "2026-0100"
    assert every(tree(), "dcc:reportAmendedSubstituted") == []


def test_values_are_those_of_the_calibration_to_the_place_of_u():
    root = tree()
    results = every(root, "dcc:measurementResult")
    assert len(results) == len(calibrated().results)
    for node, result in zip(results, calibrated().results, strict=True):
        lists = {
            one.get("refType"): one.find("si:realListXMLList", NAMES)
            for one in every(node, "dcc:list/dcc:quantity")
        }
        assert {text(one, "si:unitXMLList") for one in lists.values()} == {r"\degree"}
        errors = lists["basic_measurementError"]
        assert text(errors, "si:labelXMLList").split() == [one.point for one in result.points]
        numbers = text(errors, "si:valueXMLList").split()
        sizes = text(errors, "si:valueExpandedMUXMLList").split()
        factors = text(errors, "si:coverageFactorXMLList").split()
        for point, number, size, factor in zip(result.points, numbers, sizes, factors, strict=True):
            assert len(number.partition(".")[2]) == len(size.partition(".")[2])
            half = 0.5 * 10.0 ** -len(size.partition(".")[2])
            assert abs(float(number) - math.degrees(point.error.value)) <= half * 1.0001
            assert abs(float(size) - math.degrees(point.error.expanded)) <= half * 1.0001
            assert abs(float(factor) - point.error.expanded / point.error.u) <= 0.00501
        indicated = text(lists["basic_measuredValue"], "si:valueXMLList").split()
        known = text(lists["basic_referenceValue"], "si:valueXMLList").split()
        for number, size, reading, reference in zip(numbers, sizes, indicated, known, strict=True):
            step = 10.0 ** -len(size.partition(".")[2])
            assert abs(float(reading) - float(reference) - float(number)) <= 1.5 * step


def test_numbers_are_as_d_si_writes_them():
    root = tree(certificate(adjusted=True))
    for node in root.iter():
        name = etree.QName(node).localname
        named = name.startswith(("valueXML", "valueExpandedMU")) or name == "value"
        if named and etree.QName(node).namespace == NAMES["si"]:
            assert all(DECIMAL.fullmatch(one) for one in node.text.split())
        if name.startswith("coverageFactor"):
            assert all(FACTOR.fullmatch(one) for one in node.text.split())


@pytest.mark.parametrize("mpe", [6.0, 1.5, 0.05])
def test_verdicts_are_words_of_the_schema(mpe):
    made = certificate(mpe=mpe)
    found = text(tree(made), "dcc:conformityXMLList").split()
    points = made.calibration.results[0].points
    assert found == [conformity_of(point) for point in points]
    simple = {"conform": {"pass"}, "not conform": {"fail"},
              "undecided": {"conditionalPass", "conditionalFail"}}  # fmt: skip
    for word, point in zip(found, points, strict=True):
        assert word in simple[point.verdict.decision]
    assert text(tree(made), "dcc:statement/dcc:conformity") == overall(made.calibration)
    assert (overall(made.calibration) == "pass") == (made.calibration.decision == "conform")


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_coarser_step_and_points_without_reading_stand_in_it_as_on_paper(language):
    """The declared resolution alone would contradict the uncertainty beside it."""
    bay = Bay(seed=1, trials=8)
    tested = machine(toe=changed(TOE, repeatability=0.0))
    readings = bay.readings(tested)
    minute = math.radians(1.0 / 60.0)
    rows = tuple(
        replace(one, value=round(one.value / minute) * minute)
        for one in readings.rows
        if one.point != "FL"
    )
    done = calibrate((bay.reference(),), item_of(tested), replace(readings, rows=rows))
    (result,) = done.results
    writer = Writer(load_translations(language), PAPER)
    shown = remarks(result, writer)
    assert len(shown) == 2
    assert set(shown) <= set(shown_lines(result, writer))
    root = tree(issue(done, given()))
    said = {
        one.get("lang"): one.text for one in every(root, "dcc:result/dcc:description/dcc:content")
    }
    assert said[language] == " ".join(f"{text}." for text in (declared(result, writer), *shown))


def test_states_before_and_after_adjustment_are_named():
    states = [one.text for one in every(tree(certificate(adjusted=True)), "dcc:status")]
    assert states == ["beforeAdjustment", "afterAdjustment"] * 2
    assert every(tree(), "dcc:status") == []


@pytest.mark.parametrize(
    ("found", "states"),
    [(("RR", "RL"), ["beforeAdjustment", "afterAdjustment"]), ((), ["afterAdjustment"])],
)
def test_states_are_named_where_no_point_was_read_in_both(found, states):
    bay, tested = Bay(seed=1, trials=2), machine()
    readings = bay.readings(tested)
    rows = tuple(
        one if one.point in found else replace(one, state="as left") for one in readings.rows
    )
    done = calibrate((bay.reference(),), item_of(tested), replace(readings, rows=rows))
    assert [one.text for one in every(tree(issue(done, given())), "dcc:status")] == states


def test_a_draft_has_no_digital_form():
    with pytest.raises(InputError, match=r"number of the certificate is missing .*, and 1 more"):
        tree(certificate(given(number="", method="")))
    with pytest.raises(InputError, match="country"):
        tree(certificate(given("laboratory", country="")))


def test_same_certificate_same_bytes_and_no_markup_of_a_user():
    assert dcc_bytes(certificate(), "en") == dcc_bytes(certificate(), "en")
    made = replace(certificate(), stated=given(customer="<x>&\x01\u202e y").certificate)
    assert text(tree(made), "dcc:customer//dcc:content") == "<x>& y"
    assert to_bytes(element("dcc:a", "x", refType="y")).endswith(b'refType="y">x</dcc:a>\n')


SMALL = """<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:si="https://ptb.de/si"
 targetNamespace="https://ptb.de/dcc" elementFormDefault="qualified">
 <xs:import namespace="https://ptb.de/si" schemaLocation="https://ptb.de/si/v2/SI_Format.xsd"/>
 <xs:element name="a"><xs:complexType><xs:sequence><xs:element ref="si:b"/></xs:sequence>
 </xs:complexType></xs:element></xs:schema>"""
IMPORTED = """<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"
 targetNamespace="https://ptb.de/si"><xs:element name="b" type="xs:int"/></xs:schema>"""


def test_a_schema_is_read_with_what_it_imports_from_beside_it(tmp_path):
    (tmp_path / "dcc.xsd").write_text(SMALL)
    (tmp_path / "a.xml").write_bytes(to_bytes(element("dcc:a", element("si:b", "1"))))
    (tmp_path / "b.xml").write_bytes(to_bytes(element("dcc:a", element("si:b", "x"))))
    with pytest.raises(InputError, match=r"dcc.xsd: .* imports https://ptb.de/si/v2/SI_Format.xsd"):
        schema_faults(tmp_path / "a.xml", tmp_path)
    (tmp_path / "si").mkdir()
    (tmp_path / "si" / "si_format.xsd").write_text(IMPORTED)
    assert schema_faults(tmp_path / "a.xml", tmp_path) == []
    assert schema_faults(tmp_path / "a.xml", tmp_path / "dcc.xsd") == []
    (fault,) = schema_faults(tmp_path / "b.xml", tmp_path)
    assert fault.startswith("line 3: Element 'si:b'")


def test_unusable_files_are_named(tmp_path):
    (tmp_path / "dcc.xsd").write_text("<nothing")
    (tmp_path / "a.xml").write_text("<a/>")
    with pytest.raises(InputError, match=r"dcc\.xsd: no well-formed XML"):
        schema_faults(tmp_path / "a.xml", tmp_path)
    with pytest.raises(InputError, match="no such file"):
        schema_faults(tmp_path / "a.xml", tmp_path / "other.xsd")
    (tmp_path / "dcc.xsd").write_text("<a/>")
    with pytest.raises(InputError, match="no usable schema"):
        schema_faults(tmp_path / "a.xml", tmp_path)


@pytest.mark.skipif(not SCHEMA, reason="WHEELPLANE_DCC_SCHEMA names no folder with dcc.xsd")
@pytest.mark.parametrize("adjusted", [False, True])
def test_it_is_valid_by_the_published_schema(adjusted, tmp_path):
    made = certificate(given(replaces="1", reason="Wrong serial."), adjusted, mpe=1.5)
    path = tmp_path / "certificate.xml"
    path.write_bytes(dcc_bytes(made, "pt"))
    assert schema_faults(path, Path(SCHEMA)) == []
    path.write_text(path.read_text().replace("<dcc:issueDate>2026-11-05</dcc:issueDate>",
                                             "<dcc:issueDate>soon</dcc:issueDate>"))  # fmt: skip
    assert len(schema_faults(path, Path(SCHEMA))) == 1


@pytest.mark.parametrize(
    ("key", "u_key", "ends", "expanded"),
    [
        ("temperature_c", "temperature_u_c", (20.5, 21.6), 0.3),
        ("humidity_percent", "humidity_u_percent", (48.0, 53.0), 2.5),
        ("pressure_hpa", "pressure_u_hpa", (1013.25, 1014.5), 0.0012),
    ],
)
def test_conditions_have_the_uncertainty_of_their_sensors(key, u_key, ends, expanded):
    """Both ends of each, as the page prints them; without a stated U there is none."""
    path = "dcc:influenceCondition/dcc:data/dcc:quantity/si:real"
    found = {}
    for u in (expanded, None):
        made = certificate(given("environment", **{key: ends, u_key: u}))
        reals = every(tree(made), path)
        found[u] = [
            [one.text for one in real.iter() if one.tag.endswith("valueExpandedMU")]
            for real in reals
            if float(real.find("si:value", NAMES).text) in ends
        ]
        kinds = [child.tag.partition("}")[2] for real in reals for child in real]
        assert kinds[:2] == ["value", "unit"]
    assert [[float(text) for text in texts] for texts in found[expanded]] == [[expanded]] * 2
    assert found[None] == [[]] * 2
