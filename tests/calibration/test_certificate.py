"""Tests of what a certificate needs: missing parts, due dates, amendments, and its file."""

from __future__ import annotations

import datetime
from dataclasses import replace

import pytest

from tests.support.certificates import (
    DAY,
    ENVIRONMENT,
    GIVEN,
    LABORATORY,
    SCANNER,
    SENSOR,
    SETTINGS,
    calibrated,
    certificate,
    given,
)
from wheelplane.calibration.certificate.file import CERTIFICATE_FORM, load_certificate
from wheelplane.calibration.certificate.issue import REQUIRED, issue
from wheelplane.config import Config, load_config
from wheelplane.errors import ConfigError, InputError

EMPTY = {"received": None, "performed": None, "issued": None, "signature": ()}


def test_a_complete_certificate_is_no_draft():
    made = certificate()
    assert not made.draft
    assert made.missing == ()
    assert made.performed == (DAY, DAY)
    assert made.place == "Rua das Rodas 12, Lisboa"


@pytest.mark.parametrize("key", REQUIRED)
def test_each_missing_part_makes_a_draft_and_is_named(key):
    made = certificate(given(**{key: EMPTY.get(key, "")}))
    assert made.draft
    assert [(one.table, one.key) for one in made.missing] == [("certificate", key)]


@pytest.mark.parametrize(
    ("table", "key", "empty"),
    [
        ("laboratory", "name", ""),
        ("laboratory", "address", ""),
        ("standard", "serial", ""),
        ("standard", "certificate", ""),
        ("standard", "issuer", ""),
        ("standard", "due", None),
        ("environment", "temperature_c", None),
        ("environment", "sensors", ()),
    ],
)
def test_so_does_each_of_laboratory_standard_and_environment(table, key, empty):
    made = certificate(given(table, **{key: empty}))
    assert made.draft
    assert [(one.table, one.key) for one in made.missing] == [(table, key)]


def test_nothing_at_all_lists_everything_once():
    made = issue(calibrated(), load_certificate(None, Config()))
    found = [(one.table, one.key) for one in made.missing]
    assert len(found) == len(set(found))
    assert {("certificate", key) for key in REQUIRED} < set(found)
    assert ("standard", "any") in found


def test_a_place_is_asked_for_where_neither_address_is_its_own():
    made = certificate(given(at="other"))
    assert [one.key for one in made.missing] == ["place"]
    assert certificate(given(at="other", place="Bay 2")).place == "Bay 2"
    assert certificate(given(at="customer")).place == "Avenida 3, Porto"


def test_an_amendment_needs_its_reason():
    made = certificate(given(replaces="2026-0100"))
    assert [one.key for one in made.missing] == ["reason"]
    assert not certificate(given(replaces="2026-0100", reason="Wrong serial.")).draft


def test_doubted_readings_make_a_draft():
    made = replace(certificate(), calibration=replace(calibrated(), warnings=("the sign",)))
    assert made.draft
    assert not made.missing


def test_a_standard_past_its_due_date_is_an_error_unless_accepted_by_name():
    late = given("standard", due=DAY - datetime.timedelta(1))
    with pytest.raises(InputError, match=r"scanner: its calibration was due on 2026-11-02"):
        certificate(late)
    made = certificate(late, accepted=("scanner",))
    assert [one.name for one in made.overdue] == ["scanner"]
    assert not made.draft
    assert certificate(given("standard", due=DAY)).overdue == ()  # good to the end of the day


def test_a_standard_calibrated_after_its_use_is_an_error():
    """Its certificate says nothing of the day of the calibration that rests on it."""
    later = given("standard", calibrated=DAY + datetime.timedelta(1))
    text = "scanner: it was calibrated on 2026-11-04, after the day of its use, 2026-11-03: name"
    with pytest.raises(InputError, match=text):
        certificate(later)
    with pytest.raises(InputError, match=text):
        certificate(later, accepted=("scanner",))
    assert not certificate(given("standard", calibrated=DAY)).draft
    draft = given("standard", calibrated=DAY + datetime.timedelta(9), due=DAY).model_copy(
        update={"certificate": GIVEN.certificate.model_copy(update={"performed": None})}
    )
    with pytest.raises(InputError, match="after its due date, 2026-11-03: name the certificate"):
        certificate(draft)


def test_the_last_day_counts_for_the_due_date():
    last = given("certificate", performed_until=datetime.date(2026, 11, 4))
    with pytest.raises(InputError, match=r"TH-1: its calibration was due on 2026-11-03"):
        certificate(last)


def test_without_a_day_that_of_the_reference_counts():
    late = given("standard", due=DAY).model_copy(
        update={"certificate": given(performed=None).certificate}
    )
    assert certificate(late).overdue == ()  # no date is known
    found = calibrated()
    made = replace(found.references[0].provenance, date="2026-11-09T10:00:00")
    known = replace(found, references=(replace(found.references[0], provenance=made),))
    with pytest.raises(InputError, match="before 2026-11-09"):
        issue(known, late)


@pytest.mark.parametrize("name", ["TH-1", "nobody"])
def test_accepting_what_is_not_overdue_is_an_error(name):
    with pytest.raises(InputError, match=f"--accept-overdue {name}"):
        certificate(accepted=(name,))


def test_names_that_contradict_each_other_are_errors():
    twice = GIVEN.model_copy(update={"standard": (SCANNER, SENSOR, SCANNER)})
    with pytest.raises(ConfigError, match="scanner: it stands twice"):
        certificate(twice)
    with pytest.raises(ConfigError, match="no \\[\\[standard\\]\\] is called 'TH-2'"):
        certificate(given("environment", sensors=("TH-2",)))
    with pytest.raises(ConfigError, match=r"21\.6 lies above 20\.8"):
        certificate(given("environment", temperature_c=(21.6, 20.8)))


FILE = """
[certificate]
number = "7"
customer = "Oficina"
received = 2026-11-02
performed = 2026-11-03
[[certificate.signature]]
name = "Ana"
role = "manager"
"""


def test_a_file_is_completed_by_the_settings(tmp_path):
    path = tmp_path / "certificate.toml"
    path.write_text(FILE)
    read = load_certificate(path, SETTINGS)
    assert (read.certificate.number, read.certificate.performed) == ("7", DAY)
    assert (read.laboratory, read.standard, read.environment) == (
        LABORATORY, (SCANNER, SENSOR), ENVIRONMENT,
    )  # fmt: skip
    path.write_text(FILE + "[environment]\ntemperature_c = [20, 21.5]\nsensors = ['TH-1']\n")
    assert load_certificate(path, SETTINGS).environment.temperature_c == (20.0, 21.5)


def test_the_form_is_a_certificate_file_that_lacks_everything(tmp_path):
    path = tmp_path / "certificate.toml"
    path.write_text(CERTIFICATE_FORM)
    made = issue(calibrated(), load_certificate(path, SETTINGS))
    assert [one.key for one in made.missing] == list(REQUIRED)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[certificate]\nnumer = '7'", "did you mean 'number'"),
        ("[certificate]\nnumber = '7\"}'", "certificate.number"),
        ("[certificate]\nissued = 2026-11-01\nreceived = 2026-11-02", "issued .* lies before rec"),
        ("[certificate]\nperformed_until = 2026-11-01", "add the first day"),
        ("[certificate]\nnumber = '7'\nreplaces = '7'", "replaces is its own number"),
        ("[certificate]\nreason = 'wrong'", "reason without replaces"),
        ("[certificate]\nissued = 'today'", "certificate.issued: a date is needed, as 2026-11-03"),
        ("[laboratory]\nname = 'L'", "belongs to the settings"),
    ],
)
def test_faults_of_the_file_are_one_line(tmp_path, text, message):
    path = tmp_path / "certificate.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        load_certificate(path, SETTINGS)
    assert str(path) in str(caught.value)


def test_the_laboratory_heads_every_report(tmp_path):
    path = tmp_path / "lab.toml"
    path.write_text("[report]\naddress = 'Old road'\n[laboratory]\nname = 'L'\nlogo = 'l.png'\n")
    read = load_config(path)
    assert (read.report.laboratory, read.report.address) == ("L", "Old road")
    assert read.report.logo == str(tmp_path / "l.png")
    made = load_certificate(None, read).laboratory
    assert (made.name, made.address) == ("L", "Old road")
