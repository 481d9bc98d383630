"""Paths of the checkout that tests use: its root, its configuration, the tests' data."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = ROOT / "configs"
DATA = ROOT / "tests" / "data"
FORMATS = DATA / "formats"
FIGURE_4 = DATA / "paper" / "figure-4.txt"
CERTIFIED = ROOT / "pipeline" / "diagnostics" / "certified"
