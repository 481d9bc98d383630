"""The PDF: the same content, the same bytes, and one line where it cannot be made."""

from __future__ import annotations

import logging
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

from tests.support.reported import measured
from wheelplane.errors import MissingDependencyError
from wheelplane.report.format.laboratory import Laboratory
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.html.page import ReportOptions, html_report
from wheelplane.report.html.pdf import pdf_report
from wheelplane.report.write import pdf_bytes
from wheelplane.vehicle.angles import deg_min_sec

LABORATORY = Laboratory("Laboratório 7", ("Rua das Rodas 12",), "", ("Medido por", "Aprovado por"))


@pytest.fixture(scope="module")
def made() -> bytes:
    pytest.importorskip("weasyprint")
    return pdf_bytes(measured(1), None, ReportOptions(load_translations("pt"), PAPER, LABORATORY))


def test_same_measurement_same_bytes(made):
    again = pdf_bytes(measured(1), None, ReportOptions(load_translations("pt"), PAPER, LABORATORY))
    assert again == made
    assert made.startswith(b"%PDF-")
    assert b"/CreationDate" not in made
    dress = ReportOptions(load_translations("en"), PAPER, replace(LABORATORY, name="Laboratory 7"))
    assert pdf_bytes(measured(1), None, dress) != made


@pytest.mark.skipif(not shutil.which("pdftotext"), reason="needs poppler")
def test_it_holds_what_the_page_holds(made, tmp_path):
    (tmp_path / "r.pdf").write_bytes(made)
    run = subprocess.run(
        ["pdftotext", "-layout", tmp_path / "r.pdf", "-"],
        capture_output=True,
        text=True,
        check=True,
    )
    pages, text = run.stdout.count("\f"), " ".join(run.stdout.split())
    words = load_translations("pt")
    for result in measured(1).wheels:
        assert deg_min_sec(result.angles.toe_rad).replace(".", ",") in text
    for said in ("Laboratório 7", "Rua das Rodas 12", "Medido por", words("section.signatures"),
                 words("verdict.none"), words("plot.frame_title")[:0]):  # fmt: skip
        assert said in text
    number = re.search(rf"{words('title.end')} (\w+)", text)[1]
    assert text.count(f"{words('head.report')} {number}") >= pages  # at the foot of every page
    assert f"{words('title.page')} {pages} {words('title.of')} {pages}" in text
    assert words("frame.hint") not in text  # of the 3D view, which paper has not


def test_nothing_is_fetched(caplog, tmp_path):
    """Neither from the network nor from the disk: only what the page holds itself."""
    pytest.importorskip("weasyprint")
    (tmp_path / "x.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    addresses = ("http://127.0.0.1:9/x.png", (tmp_path / "x.svg").as_uri())
    page = "".join(f'<p>x<img src="{address}"></p>' for address in addresses)
    with caplog.at_level(logging.WARNING, logger="weasyprint"):
        pdf_report(f"<!DOCTYPE html><html><body>{page}</body></html>", "x")
    for address in addresses:
        assert any(address in r.getMessage() and "disallowed" in r.getMessage()
                   for r in caplog.records)  # fmt: skip


def test_without_weasyprint_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    page = html_report(measured(1), None, ReportOptions(load_translations("en"), PAPER), still=True)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[pdf\]'") as refused:
        pdf_report(page, "x")
    assert "\n" not in str(refused.value)
