"""Tests of the certificate by the commands: `calibrate` writes and signs it, `verify` checks it."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.support.calibration_bay import Bay
from tests.support.certificates import CERTIFICATE_TOML, SETTINGS_TOML
from tests.support.paths import CONFIGS
from wheelplane.commands.calibrate import calibrate
from wheelplane.commands.verify import verify
from wheelplane.errors import InputError, MissingDependencyError
from wheelplane_synth.machine.forms import item_toml, readings_csv
from wheelplane_synth.machine.indicate import indicate
from wheelplane_synth.machine.read import read_machine
from wheelplane_synth.output.files import five_point_text

ANGLES = 2.0 * np.pi * np.arange(5) / 5
PENTAGON = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])  # 2 m across: fine without a scan


@pytest.fixture(scope="module")
def bay(tmp_path_factory):
    """Five points, item, readings, settings, certificate file and keys."""
    folder, made, rng = (
        tmp_path_factory.mktemp("bay"),
        Bay(seed=1, trials=2),
        np.random.default_rng(0),
    )
    rows = []
    for normal, centre in zip(made.car.normals, made.car.centres, strict=True):
        across = np.cross(normal, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        points = centre + PENTAGON @ np.stack([across, np.cross(normal, across)])
        rows.append(points + rng.normal(0.0, 1e-5, (5, 3)))
    tested = read_machine(CONFIGS / "machines" / "example.toml", 0)
    texts = {
        "points.txt": five_point_text(np.concatenate(rows)),
        "item.toml": item_toml(tested),
        "readings.csv": readings_csv(indicate(made.truth, tested, rng)),
        "settings.toml": SETTINGS_TOML,
        "late.toml": SETTINGS_TOML.replace("2027-03-01", "2026-11-01"),
        "certificate.toml": CERTIFICATE_TOML,
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module")
def keys(bay):
    """A private key and its public one."""
    ed25519 = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519")
    forms = pytest.importorskip("cryptography.hazmat.primitives.serialization")
    for name in ("own", "other"):
        key = ed25519.Ed25519PrivateKey.generate()
        lock = forms.BestAvailableEncryption(b"open")
        (bay / f"{name}.key").write_bytes(
            key.private_bytes(forms.Encoding.PEM, forms.PrivateFormat.PKCS8, lock)
        )
        (bay / f"{name}.pub").write_bytes(
            key.public_key().public_bytes(
                forms.Encoding.PEM, forms.PublicFormat.SubjectPublicKeyInfo
            )
        )
    return bay


def run(command, *arguments, text=None):
    found = CliRunner().invoke(
        command, list(map(str, arguments)), standalone_mode=False, input=text
    )
    if found.exception and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


def issued(bay: Path, *more, settings="settings.toml", stated=True, text=None):
    own = ("--certificate", bay / "certificate.toml") if stated else ()
    return run(
        calibrate, bay / "points.txt", "--five-point", "--item", bay / "item.toml", "--readings",
        bay / "readings.csv", "--config", bay / settings, *own, *more, text=text,
    )  # fmt: skip


def test_it_is_written_beside_the_results(bay, tmp_path):
    found = issued(bay, "-o", tmp_path, "--dcc", "--language", "pt")
    assert found.return_value == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"calibration.json", "calibration.txt", "certificate.html", "certificate.xml"}
    text = (tmp_path / "certificate.html").read_text()
    assert "Certificado de calibração" in text
    assert "RASCUNHO" not in text
    assert ">pt</dcc:mandatory" in (tmp_path / "certificate.xml").read_text()


def test_without_its_file_it_is_a_draft(bay, tmp_path):
    issued(bay, "-o", tmp_path, stated=False)
    assert "DRAFT" in (tmp_path / "certificate.html").read_text()
    issued(bay, "-o", tmp_path / "none", "--no-html", stated=False)
    assert {path.name for path in (tmp_path / "none").iterdir()} == {
        "calibration.json", "calibration.txt",
    }  # fmt: skip


def test_an_overdue_standard_is_an_error_before_anything_is_written(bay, tmp_path):
    with pytest.raises(InputError, match=r"scanner: its calibration was due on 2026-11-01"):
        issued(bay, "-o", tmp_path / "out", settings="late.toml")
    assert not (tmp_path / "out").exists()
    issued(bay, "-o", tmp_path / "out", "--accept-overdue", "scanner", settings="late.toml")
    assert "past its due date, 2026-11-01" in (tmp_path / "out" / "certificate.html").read_text()


@pytest.mark.parametrize("option", ["--pdf", "--dcc"])
def test_its_options_need_a_folder(bay, option):
    with pytest.raises(InputError, match=f"{option} without -o DIR"):
        issued(bay, option, stated=False)
    with pytest.raises(InputError, match="--certificate without -o DIR"):
        issued(bay, option)


def test_a_draft_is_neither_digital_nor_signed(bay, keys, tmp_path):
    with pytest.raises(InputError, match="--dcc of a draft: the number of the certificate is"):
        issued(bay, "-o", tmp_path / "out", "--dcc", stated=False)
    with pytest.raises(InputError, match="--sign of a draft"):
        issued(bay, "-o", tmp_path / "out", "--sign", keys / "own.key", stated=False)
    assert not (tmp_path / "out").exists()


def test_signed_files_are_verified_and_a_change_is_seen(keys, tmp_path):
    issued(keys, "-o", tmp_path, "--dcc", "--sign", keys / "own.key", text="open\n")
    signed = sorted(path.name for path in tmp_path.glob("*.sig"))
    names = ["calibration.json", "certificate.html", "certificate.xml"]
    assert signed == [f"{name}.sig" for name in names]
    for name in names:
        assert run(verify, tmp_path / name, "--key", keys / "own.pub").return_value == 0
    page = tmp_path / "certificate.html"
    other = run(verify, page, "--key", keys / "other.pub")
    page.write_bytes(page.read_bytes().replace(b"Garage", b"garage"))
    changed = run(verify, page, "--signature", f"{page}.sig", "--key", keys / "own.pub")
    for found in (other, changed):
        assert found.return_value == 1
        assert found.stdout.count("\n") == 1
        assert "the file was changed, or signed by another key" in found.stdout


def test_what_is_signed_is_not_replaced_by_what_is_not(keys, tmp_path):
    """A draft would stand in the place of a certificate, beside a signature that does not fit."""
    signing = ("--sign", keys / "own.key")
    issued(keys, "-o", tmp_path, *signing, text="open\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for stated in (True, False):
        with pytest.raises(InputError, match=r"calibration\.json: is signed, .* --sign; or remove"):
            issued(keys, "-o", tmp_path, stated=stated)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    issued(keys, "-o", tmp_path, "--language", "pt", *signing, text="open\n")
    page = tmp_path / "certificate.html"
    assert page.read_bytes() != before["certificate.html"]
    assert run(verify, page, "--key", keys / "own.pub").return_value == 0
    for signature in tmp_path.glob("*.sig"):
        signature.unlink()
    issued(keys, "-o", tmp_path, stated=False)
    assert "DRAFT" in page.read_text()


def test_no_certificate_of_an_earlier_calibration_stays_beside_another(keys, tmp_path):
    """Signed, it is kept: the command is refused."""
    issued(keys, "-o", tmp_path, "--dcc")
    issued(keys, "-o", tmp_path, "--no-html", stated=False)
    assert not list(tmp_path.glob("certificate.*"))
    signing = ("--sign", keys / "own.key")
    issued(keys, "-o", tmp_path, "--dcc", *signing, text="open\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError, match=r"certificate\.xml: is signed, and would be .* removed"):
        issued(keys, "-o", tmp_path, *signing, text="open\n")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_verify_lists_what_a_schema_does_not_allow(bay, tmp_path):
    pytest.importorskip("lxml")
    (tmp_path / "dcc.xsd").write_text(
        '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"><xs:element name="a" '
        'type="xs:int"/></xs:schema>'
    )
    for text, code, line in (("<a>1</a>", 0, "valid by"), ("<a>x</a>", 1, "not valid by")):
        (tmp_path / "a.xml").write_text(text)
        found = run(verify, tmp_path / "a.xml", "--schema", tmp_path)
        assert found.return_value == code
        assert f"a.xml: {line}" in found.stdout
    assert "line 1: Element 'a'" in found.stdout


def test_verify_needs_something_to_verify_by(bay):
    with pytest.raises(InputError, match="--schema or --key is needed"):
        run(verify, bay / "item.toml")
    with pytest.raises(InputError, match="--signature without --key"):
        run(verify, bay / "item.toml", "--schema", bay, "--signature", bay / "item.toml")
    with pytest.raises(InputError, match="none: no such file"):
        run(verify, bay / "none", "--schema", bay)


def test_a_missing_package_is_one_line(bay, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "lxml", None)
    monkeypatch.setitem(sys.modules, "cryptography.hazmat.primitives", None)
    with pytest.raises(MissingDependencyError, match=r"wheelplane\[dcc\]"):
        issued(bay, "-o", tmp_path / "out", "--dcc")
    with pytest.raises(MissingDependencyError, match=r"wheelplane\[sign\]"):
        issued(bay, "-o", tmp_path / "out", "--sign", bay / "item.toml")
    with pytest.raises(MissingDependencyError, match=r"wheelplane\[sign\]"):
        run(verify, bay / "item.toml", "--key", bay / "item.toml")
    assert not (tmp_path / "out").exists()


def test_the_form_of_it_stands_among_the_others(bay, tmp_path):
    run(calibrate, bay / "points.txt", "--five-point", "--template", tmp_path)
    shutil.copy(tmp_path / "certificate.toml", tmp_path / "mine.toml")
    issued(bay, "-o", tmp_path / "out", "--certificate", tmp_path / "mine.toml", stated=False)
    assert "DRAFT" in (tmp_path / "out" / "certificate.html").read_text()
