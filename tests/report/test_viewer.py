"""The bundle of the 3D view: built from its sources, without other dependencies."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VIEWER = ROOT / "pipeline" / "web" / "viewer"
STATIC = ROOT / "pipeline" / "report" / "static"
BUNDLE = (STATIC / "viewer.js").read_text(encoding="utf-8")


def digest_of(folder: Path) -> str:
    """Return the digest of build.mjs: names and bytes of the sources, in the order of the names."""
    names = ["build.mjs", "package-lock.json"]
    names += [f"src/{path.name}" for path in (folder / "src").iterdir()]
    digest = hashlib.sha256()
    for name in sorted(names):
        digest.update(f"{name}\0".encode() + (folder / name).read_bytes() + b"\0")
    return digest.hexdigest()


def test_the_bundle_is_that_of_its_sources():
    found = re.search(r"sources sha256:([0-9a-f]{64})", BUNDLE)
    assert found
    assert found[1] == digest_of(VIEWER), "run `npm ci && npm run build` in pipeline/web/viewer"


def test_a_changed_source_is_detected(tmp_path):
    (tmp_path / "src").mkdir()
    for path in [*VIEWER.glob("*.*"), *(VIEWER / "src").iterdir()]:
        (tmp_path / path.relative_to(VIEWER)).write_bytes(path.read_bytes())
    assert digest_of(tmp_path) == digest_of(VIEWER)
    with (tmp_path / "src" / "pace.js").open("a") as stream:
        stream.write("\n")
    assert digest_of(tmp_path) != digest_of(VIEWER)


def test_the_bundle_stands_alone_in_a_page_of_any_encoding():
    assert BUNDLE.isascii()
    assert "var Wheelplane3D=" in BUNDLE
    assert "</script" not in BUNDLE
    for gone in ("eval(", "new Function(", "importScripts", "XMLHttpRequest", "WebSocket("):
        assert gone not in BUNDLE, gone
    assert not re.search(r"\bimport\s*\(", BUNDLE)


def test_the_licence_of_what_it_holds_lies_beside_it():
    assert "three.js authors" in (STATIC / "LICENSE-three.txt").read_text()
    assert "Permission is hereby granted" in (STATIC / "LICENSE-three.txt").read_text()
    assert "SPDX-License-Identifier: MIT" in BUNDLE


def test_the_bundle_carries_the_permission_notice_of_what_it_holds():
    notice = (
        (STATIC / "LICENSE-three.txt")
        .read_text(encoding="utf-8")
        .replace("\N{COPYRIGHT SIGN}", "(c)")
    )
    assert notice.strip() in BUNDLE.partition("*/")[0]
    held = re.findall(r"Copyright[^\n]*", BUNDLE)
    assert held
    assert all("three.js authors" in line.lower() for line in held)  # there is no other library


def test_what_it_is_built_from_is_pinned():
    package = json.loads((VIEWER / "package.json").read_text())
    for name, version in package["devDependencies"].items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version), name
    lock = json.loads((VIEWER / "package-lock.json").read_text())
    pinned = [part for place, part in lock["packages"].items() if place]
    assert pinned
    assert all(part["integrity"].startswith("sha512-") for part in pinned)
