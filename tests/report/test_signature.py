"""Tests of detached signatures: the right key, another one, a changed file, and bad files."""

from __future__ import annotations

import base64
import shutil
import subprocess

import pytest

from wheelplane.errors import InputError
from wheelplane.report.signature import is_signed, read_private_key, signature_of

ed25519 = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519")
serialization = pytest.importorskip("cryptography.hazmat.primitives.serialization")
# RFC 8032, 7.1, test 2: secret key, public key, message, signature.
SECRET = bytes.fromhex("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb")
PUBLIC = bytes.fromhex("3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c")
MESSAGE = bytes.fromhex("72")
SIGNATURE = bytes.fromhex(
    "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da"
    "085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00"
)
# Object identifiers of curves, as DER has them.
P_256, SM2 = bytes.fromhex("2a8648ce3d030107"), bytes.fromhex("2a811ccf5501822d")
PEM, PKCS8 = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8


def refuse():
    raise AssertionError("no passphrase is needed")


@pytest.fixture
def folder(tmp_path):
    key = ed25519.Ed25519PrivateKey.from_private_bytes(SECRET)
    spki = serialization.PublicFormat.SubjectPublicKeyInfo
    (tmp_path / "key").write_bytes(key.private_bytes(PEM, PKCS8, serialization.NoEncryption()))
    locked = serialization.BestAvailableEncryption(b"open")
    (tmp_path / "locked").write_bytes(key.private_bytes(PEM, PKCS8, locked))
    (tmp_path / "pub").write_bytes(key.public_key().public_bytes(PEM, spki))
    other = ed25519.Ed25519PrivateKey.from_private_bytes(bytes(32)).public_key()
    (tmp_path / "other").write_bytes(other.public_bytes(PEM, spki))
    (tmp_path / "file").write_bytes(MESSAGE)
    (tmp_path / "file.sig").write_bytes(SIGNATURE)
    return tmp_path


def test_the_signature_is_that_of_the_rfc(folder):
    for name, passphrase in (("key", refuse), ("locked", lambda: "open")):
        key = read_private_key(folder / name, passphrase)
        assert signature_of(MESSAGE, key) == SIGNATURE
    assert is_signed(folder / "file", folder / "file.sig", folder / "pub")


def test_another_key_or_a_changed_file_does_not_fit(folder):
    assert not is_signed(folder / "file", folder / "file.sig", folder / "other")
    (folder / "file").write_bytes(MESSAGE + b"\n")
    assert not is_signed(folder / "file", folder / "file.sig", folder / "pub")


def test_unusable_files_are_named(folder):
    with pytest.raises(InputError, match="pub: no private key"):
        read_private_key(folder / "pub", refuse)
    with pytest.raises(InputError, match="locked: no private key, or another passphrase"):
        read_private_key(folder / "locked", lambda: "shut")
    with pytest.raises(InputError, match="key: no public key"):
        is_signed(folder / "file", folder / "file.sig", folder / "key")
    with pytest.raises(InputError, match="file: 1 bytes, a signature has 64"):
        is_signed(folder / "file", folder / "file", folder / "pub")
    with pytest.raises(InputError, match="none: cannot be read"):
        is_signed(folder / "none", folder / "file.sig", folder / "pub")
    rsa = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ec")
    other = rsa.generate_private_key(rsa.SECP256R1())
    (folder / "ec").write_bytes(other.private_bytes(PEM, PKCS8, serialization.NoEncryption()))
    with pytest.raises(InputError, match="no Ed25519 key"):
        read_private_key(folder / "ec", refuse)


def test_keys_of_a_curve_that_the_library_does_not_know_are_named(folder):
    """A key of P-256 under the name of SM2: the library raises an exception of its own."""
    ec = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ec")
    key, der = ec.generate_private_key(ec.SECP256R1()), serialization.Encoding.DER
    spki = serialization.PublicFormat.SubjectPublicKeyInfo
    of_files = {
        "PRIVATE": key.private_bytes(der, PKCS8, serialization.NoEncryption()),
        "PUBLIC": key.public_key().public_bytes(der, spki),
    }
    for kind, content in of_files.items():
        assert content.count(P_256) == 1
        text = base64.b64encode(content.replace(P_256, SM2)).decode()
        (folder / kind).write_text(
            f"-----BEGIN {kind} KEY-----\n{text}\n-----END {kind} KEY-----\n"
        )
    with pytest.raises(InputError, match=r"PRIVATE: no Ed25519 key .*: make one"):
        read_private_key(folder / "PRIVATE", refuse)
    with pytest.raises(InputError, match=r"PUBLIC: no Ed25519 key .*: name the one"):
        is_signed(folder / "file", folder / "file.sig", folder / "PUBLIC")


@pytest.mark.skipif(not shutil.which("openssl"), reason="needs openssl")
def test_openssl_verifies_it_as_well(folder):
    run = subprocess.run(
        ["openssl", "pkeyutl", "-verify", "-pubin", "-inkey", "pub", "-rawin", "-in", "file",
         "-sigfile", "file.sig"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Signature Verified Successfully" in run.stdout
