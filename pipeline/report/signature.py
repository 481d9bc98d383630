"""Detached signatures of files: Ed25519 (RFC 8032) by the library `cryptography`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, MissingDependencyError, fact_of, remedy_of

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

SIZE = 64  # bytes of a signature
TO_MAKE = "make one by openssl genpkey -algorithm ed25519"
TO_VERIFY = "name the one that belongs to the signature"


def read_private_key(path: Path, passphrase: Callable[[], str]) -> Ed25519PrivateKey:
    """Read a private key (PEM). Raises InputError, MissingDependencyError.

    passphrase: called where the key is encrypted.
    """
    load = _serialization().load_pem_private_key
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    data = _read(path)
    try:
        key = load(data, passphrase().encode() if b"ENCRYPTED" in data else None)
    except UnsupportedAlgorithm as error:
        raise InputError(f"{path}: no Ed25519 key ({fact_of(error)}): {TO_MAKE}") from error
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: no private key, or another passphrase: check both") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"{path}: no Ed25519 key: {TO_MAKE}")
    return key


def signature_of(content: bytes, key: Ed25519PrivateKey) -> bytes:
    """Return the signature of a content, 64 bytes."""
    return key.sign(content)


def is_signed(path: Path, signature: Path, public_key: Path) -> bool:
    """Return whether the signature is of this file and of this key's owner.

    Raises InputError for files that are no key or signature, MissingDependencyError.
    """
    load = _serialization().load_pem_public_key
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        key = load(_read(public_key))
    except UnsupportedAlgorithm as error:
        raise InputError(f"{public_key}: no Ed25519 key ({fact_of(error)}): {TO_VERIFY}") from error
    except ValueError as error:
        raise InputError(f"{public_key}: no public key (PEM): check the file") from error
    if not isinstance(key, Ed25519PublicKey):
        raise InputError(f"{public_key}: no Ed25519 key: {TO_VERIFY}")
    mark = _read(signature)
    if len(mark) != SIZE:
        raise InputError(f"{signature}: {len(mark)} bytes, a signature has {SIZE}: check the file")
    try:
        key.verify(mark, _read(path))
    except InvalidSignature:
        return False
    return True


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}): {remedy_of(error)}"
        ) from error


def _serialization() -> Any:
    try:
        from cryptography.hazmat.primitives import serialization
    except ImportError as error:
        raise MissingDependencyError(
            "signatures need the library cryptography: pip install 'wheelplane[sign]'"
        ) from error
    return serialization
