"""Tests of the certificate on paper: its content clause by clause, digits, numbers, same bytes."""

from __future__ import annotations

import datetime
import html
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from tests.support.calibration_bay import TOE, Bay, changed, item_of, machine
from tests.support.certificates import DAY, SENSOR, calibrated, certificate, given
from wheelplane.calibration import DecisionRule, calibrate, issue
from wheelplane.calibration.certificate.issue import REQUIRED
from wheelplane.measurement import Estimate
from wheelplane.report.certificate import certificate_files
from wheelplane.report.format.laboratory import Laboratory
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.format.writer import MINUS, Writer
from wheelplane.report.html.page import ReportOptions
from wheelplane.report.json.calibration import calibration_json
from wheelplane.report.tables.calibration import points_table, reasons, signed, title
from wheelplane.report.tables.certificate import lacking, standards_table, statements
from wheelplane.report.write import ReportFiles

HEAD = Laboratory("Laboratório 7", ("Rua das Rodas 12",), "", ())
EN = load_translations("en")
NUMBER = re.compile(r"[+-]?\d+(?:\.(\d+))?(\"|'|°| mm)")


def files(made=None, language="en", **wanted):
    made = made or certificate()
    options = ReportOptions(load_translations(language), PAPER, HEAD)
    record = calibration_json(made.calibration)
    return certificate_files(made, record, options, ReportFiles(**wanted))


def page(made=None, language="en"):
    return files(made, language)["certificate.html"].decode()


def read(text):
    """Words of a page as they are read."""
    kept = re.sub(r"<(style|script).*?</\1>", " ", text, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", kept)).split())


def test_the_files_of_every_reference_are_named_with_their_digests():
    """Scans of two captures bear the same names."""
    tested, bays = machine(), [Bay(seed=k, trials=0) for k in (1, 2)]
    references, rows = [], []
    for k, bay in enumerate(bays, 1):
        known = bay.reference(str(k))
        origin = replace(
            known.measurement.provenance,
            source=f"bay-{k}",
            inputs={name: f"sha256:{k}{name}" for name in ("rr.ply", "rl.ply")},
        )
        references.append(replace(known, measurement=replace(known.measurement, provenance=origin)))
        rows += [replace(one, series=str(k)) for one in bay.readings(tested).rows]
    readings = replace(bays[0].readings(tested), rows=tuple(rows))
    seen = read(page(issue(calibrate(references, item_of(tested), readings), given())))
    for k in (1, 2):
        for name in ("rr.ply", "rl.ply"):
            assert f"bay-{k}: {name} {k}{name}" in seen


@pytest.mark.parametrize("language", LANGUAGES)
def test_it_states_what_each_clause_asks_for(language):
    """ISO/IEC 17025:2017, 7.8.2.1 a to o, 7.8.4.1 a to e, 7.8.6.2."""
    words = load_translations(language)
    made = certificate(given(deviations="No warm-up."), adjusted=True)
    seen = read(page(made, language))
    left = words("calibration.left").capitalize()
    mpe = words.number(f"±{made.calibration.item.toe.mpe}")
    clauses = {
        "a": words("certificate.title"),
        "b": "Laboratório 7 Rua das Rodas 12",
        "c": f"{words('certificate.place')} Rua das Rodas 12, Lisboa",
        "d": f"{words('certificate.number')} 2026-0142",
        "d, its end": f"{words('certificate.end')} 2026-0142",
        "e": f"{words('certificate.customer')} Oficina Exemplo, Avenida 3, Porto",
        "f": f"{words('certificate.method')} PT-07, edition 3",
        "g": f"{words('certificate.serial')} 7 {words('certificate.software')} 1.0",
        "g, condition": f"{words('certificate.condition')} no visible damage",
        "h": f"{words('certificate.received')} 2026-11-02",
        "i": f"{words('certificate.performed')} 2026-11-03",
        "j": f"{words('certificate.issued')} 2026-11-05",
        "l": words("certificate.only_item"),
        "n": words("certificate.deviations", text="No warm-up."),
        "o": "Ana Silva, technical manager",
        "7.8.4.1 a": words("certificate.uncertainty"),
        "7.8.4.1 b": words.number("20.8 °C"),
        "7.8.4.1 b, sensors": words("certificate.sensors", names="TH-1"),
        "7.8.4.1 c": words("certificate.traceable"),
        "7.8.4.1 c, its own": "Angle by laser tracker.",
        "7.8.4.1 d": words("calibration.adjustments"),
        "7.8.6.2 a": words("certificate.conform_says", state=left),
        "7.8.6.2 b": words("calibration.mpe_of", value=mpe),
        "7.8.6.2 c": words("verdict.rule"),
        "copies": words("certificate.copy"),
        "accreditation": "M0999",
    }  # fmt: skip
    missing = {clause: text for clause, text in clauses.items() if text not in seen}
    assert missing == {}
    for state in ("found", "left"):
        assert words(f"calibration.{state}") in seen
    assert words("certificate.draft") not in seen


def test_standards_stand_with_serials_certificates_and_due_dates():
    rows = standards_table(certificate(), Writer(EN, PAPER)).rows
    assert rows[0] == ["Laser scanner S70 (scanner)", "LS-0815", "C-2026-17",
                       "National institute", "2026-03-01", "2027-03-01"]  # fmt: skip
    assert rows[1][0] == SENSOR.name
    assert all(cell in read(page()) for row in rows for cell in row)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_missing_part_has_words_and_stands_on_the_draft(language):
    words = load_translations(language)
    empty = {"received": None, "performed": None, "issued": None, "signature": ()}
    made = certificate(given(**{key: empty.get(key, "") for key in REQUIRED}))
    lines = lacking(made, words)
    assert len(set(lines)) == len(REQUIRED)
    text = page(made, language)
    assert all(line in read(text) for line in lines)
    assert f'<div class="watermark" aria-hidden="true">{words("certificate.draft")}<' in text
    assert 'class="watermark"' not in page(language=language)
    doubted = replace(made, missing=(), calibration=replace(calibrated(), warnings=("sign",)))
    assert words("certificate.doubted", file="calibration.txt") in read(page(doubted, language))


def test_every_way_to_be_missing_has_words():
    for table, keys in {
        "laboratory": ("name", "address"),
        "certificate": (*REQUIRED, "place", "reason"),
        "standard": ("any", "serial", "certificate", "issuer", "due"),
        "environment": ("temperature_c", "sensors"),
    }.items():
        for key in keys:
            for language in LANGUAGES:
                assert f"certificate.missing_{table}_{key}" in load_translations(language).texts


def test_an_accepted_overdue_standard_is_printed():
    late = given("standard", due=DAY - datetime.timedelta(1))
    text = page(certificate(late, accepted=("scanner",)))
    assert "Laser scanner S70 (scanner) was used past its due date, 2026-11-02" in read(text)
    assert '<tr class="bad">' in text
    assert "past its due date" not in read(page())


def test_an_amendment_names_what_it_replaces_and_why():
    made = certificate(given(number="2026-0142-A", replaces="2026-0142", reason="Wrong serial."))
    seen = read(page(made))
    assert "Calibration certificate (amended)" in seen
    assert "replaces certificate no. 2026-0142, which is withdrawn. Wrong serial." in seen
    assert "End of calibration certificate no. 2026-0142-A" in seen
    assert "withdrawn" not in read(page())


@pytest.mark.parametrize(
    ("mpe", "key"), [(6.0, "conform"), (1.0, "not_conform"), (0.05, "not_conform")]
)
def test_the_statement_of_conformity_is_that_of_the_calibration(mpe, key):
    made = certificate(mpe=mpe)
    assert made.calibration.decision == key.replace("_", " ")
    assert EN(f"certificate.{key}_says", state="As found") in read(page(made))


def test_without_mpe_no_conformity_is_stated():
    bare = replace(calibrated(), rule=None)
    for result in bare.results:
        points = tuple(replace(one, mpe=None, verdict=None) for one in result.points)
        bare = replace(
            bare,
            results=tuple(
                replace(one, points=points) if one is result else one for one in bare.results
            ),
        )
    made = replace(certificate(), calibration=bare)
    assert 'class="word"><span' not in page(made)
    assert EN("calibration.no_rule") in read(page(made))
    assert "conformity" not in dict(statements(made, EN))


def test_no_number_is_finer_than_its_u():
    """Error and U in the same unit, to the same place; reading and reference no finer."""
    for result in calibrated().results:
        table = points_table(result, Writer(EN, PAPER))
        error, u = table.head.index("error"), len(table.head) - 1 - table.head[::-1].index("U")
        for row in table.rows:
            value, size = NUMBER.fullmatch(row[error]), NUMBER.fullmatch(row[u])
            assert (value[1], value[2]) == (size[1], size[2])
            for column in ("reference", "reading"):
                seconds = row[table.head.index(column)].rpartition("'")[2]
                assert ("." in seconds) <= ("." in row[u])


def test_each_table_is_titled_by_quantity_and_state():
    seen = read(page(certificate(adjusted=True)))
    for result in calibrated(adjusted=True).results:
        assert title(result, EN) in seen


def test_what_a_user_writes_is_no_markup():
    made = certificate(given(customer="<b>{{ 7*7 }}</b>", method="a & b\u202e"))
    assert "&lt;b&gt;{{ 7*7 }}&lt;/b&gt;" in page(made)
    assert "\u202e" not in page(made)


def test_same_certificate_same_bytes():
    assert files() == files()
    assert page() != page(language="pt")


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The words of each page of the PDF, of a certificate and of a draft in Portuguese."""
    pytest.importorskip("weasyprint")
    if not shutil.which("pdftotext"):
        pytest.skip("needs poppler")
    folder, found = tmp_path_factory.mktemp("pdf"), []
    for made, language in ((certificate(), "en"), (certificate(given(issued=None)), "pt")):
        content = files(made, language, html=False, pdf=True)["certificate.pdf"]
        (folder / "c.pdf").write_bytes(content)
        run = subprocess.run(
            ["pdftotext", "-raw", folder / "c.pdf", "-"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        found.append((content, [" ".join(one.split()) for one in run.stdout.split("\f")[:-1]]))
    return found


def test_every_page_carries_the_number_and_the_count(printed):
    for (_, pages), language in zip(printed, ("en", "pt"), strict=True):
        words = load_translations(language)
        assert len(pages) >= 3
        for number, text in enumerate(pages, 1):
            assert f"{words('certificate.running')} 2026-0142" in text
            counted = f"{words('title.page')} {number} {words('title.of')} {len(pages)}"
            assert text.endswith(counted)
        assert f"{words('certificate.end')} 2026-0142" in pages[-1]


def test_every_page_of_a_draft_says_so(printed):
    draft = load_translations("pt")("certificate.draft")
    assert all(page.count(draft) >= 2 for page in printed[1][1])  # across it, and at its foot
    assert not any("DRAFT" in page for page in printed[0][1])


def test_the_pdf_of_the_same_certificate_has_the_same_bytes(printed):
    assert files(html=False, pdf=True) == {"certificate.pdf": printed[0][0]}


def test_portuguese_has_one_word_for_the_outcome_of_the_decision_rule():
    """Decisão, as in 'regra de decisão' (JCGM 106, ILAC-G8); and 'não decidido' as one outcome."""
    texts = load_translations("pt").texts
    others = {key for key, text in texts.items() if re.search("(?i)veredi[ct]|indecis", text)}
    assert others == set()
    assert {texts[key] for key in ("verdict.decision", "comparison.verdict", "page.verdict")} == {
        "decisão"
    }


@pytest.mark.parametrize(
    ("rule", "mpe", "said"),
    [
        ("guarded", 0.3, {"en": "the uncertainty is too large for this MPE",
                          "pt": "a incerteza é demasiado grande para este EMA"}),
        ("shared", 0.3, {"en": "MPE/U is 0.", "pt": "EMA/U é 0,"}),
    ],
)  # fmt: skip
def test_points_of_one_reason_stand_together_in_the_language(rule, mpe, said):
    bay, tested = Bay(seed=1, trials=2), machine(toe=changed(TOE, mpe=mpe, zero=0.0))
    item = item_of(tested).model_copy(update={"decision": DecisionRule(rule=rule)})
    (result,) = calibrate((bay.reference(),), item, bay.readings(tested)).results
    undecided = [p for p in result.points if p.verdict.decision == "undecided"]
    assert len(undecided) > 3
    for language, text in said.items():
        found = reasons(result, Writer(load_translations(language), PAPER))
        assert len(found) < len(undecided)
        assert all(f": {text}" in one for one in found)


def test_the_plan_says_which_trials_it_counts():
    parts = {"en": "besides the 4 wheels", "pt": "além das 4 rodas"}
    for language, part in parts.items():
        assert part in load_translations(language)("plan.trials_needed")


@pytest.mark.parametrize("language", LANGUAGES)
def test_negative_numbers_have_a_minus_sign_and_zero_has_none(language):
    seen = read(page(language=language))
    assert "\N{MINUS SIGN}00°" in seen
    assert not re.search(r" -\d", seen)
    writer = Writer(load_translations(language), PAPER, minus=MINUS)
    result = calibrated().results[0]
    assert signed(Estimate(1e-9, 1e-5), replace(result, unit="m"), writer).startswith("0")
    assert signed(Estimate(-2e-5, 1e-5), replace(result, unit="m"), writer)[0] == MINUS


@pytest.mark.parametrize("language", LANGUAGES)
def test_conditions_stand_with_the_uncertainty_of_their_sensors(language):
    words = load_translations(language)
    seen = read(page(certificate(given("environment", temperature_u_c=0.3)), language))
    assert f"21.6 °C (U {words.number('0.3 °C')})".replace("21.6", words.number("21.6")) in seen
