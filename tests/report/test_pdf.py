"""The PDF: the same content, the same bytes, and one line where it cannot be made."""

from __future__ import annotations

import contextlib
import logging
import re
import shutil
import subprocess
import sys
import zlib
from dataclasses import replace

import numpy as np
import pytest

from tests.support.reported import measured
from tests.support.turning import Scene, swept
from wheelplane.errors import MissingDependencyError
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.quantities import by_name
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.digits import sexagesimal
from wheelplane.report.format.laboratory import Laboratory
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.html.page import ReportOptions, html_report
from wheelplane.report.html.pdf import pdf_report
from wheelplane.report.write import ReportFiles, report_files

LABORATORY = Laboratory("Laboratório 7", ("Rua das Rodas 12",), "", ("Medido por", "Aprovado por"))


def printed(language: str, laboratory: Laboratory) -> bytes:
    dress = ReportOptions(load_translations(language), PAPER, laboratory)
    wanted = ReportFiles(html=False, pdf=True)
    return report_files(measured(1), None, dress, wanted)["report.pdf"]


@pytest.fixture(scope="module")
def made() -> bytes:
    pytest.importorskip("weasyprint")
    return printed("pt", LABORATORY)


@pytest.mark.slow
def test_same_measurement_same_bytes(made):
    assert printed("pt", LABORATORY) == made
    assert made.startswith(b"%PDF-")
    assert b"/CreationDate" not in made
    assert printed("en", replace(LABORATORY, name="Laboratory 7")) != made


@pytest.mark.slow
def test_both_forms_at_once_are_those_of_each_alone(made):
    dress = ReportOptions(load_translations("pt"), PAPER, LABORATORY)
    both = report_files(measured(1), None, dress, ReportFiles(pdf=True))
    assert both["report.pdf"] == made
    assert both["report.html"] == html_report(measured(1), None, dress).encode()


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
        toe = by_name(measured(1))[f"{result.observation.name}.toe"]
        assert sexagesimal(toe.value, toe.expanded).replace(".", ",") in text
    for said in ("Laboratório 7", "Rua das Rodas 12", "Medido por", words("section.signatures"),
                 words("verdict.none"), words("plot.frame_title")[:0]):  # fmt: skip
        assert said in text
    number = re.search(rf"{words('title.end')} (\w+)", text)[1]
    assert text.count(f"{words('head.report')} {number}") >= pages  # at the foot of every page
    assert f"{words('title.page')} {pages} {words('title.of')} {pages}" in text
    assert words("frame.hint") not in text  # of the 3D view, which paper has not


def test_it_is_tagged(made):
    """Structure, language, title and alternative texts, as PDF/UA asks for."""
    text = unpacked(made)
    for entry in ("/StructTreeRoot", "/Marked true", "/DisplayDocTitle true", "/S /Table",
                  "/S /TH", "/S /H2", "/S /Figure", "pdfuaid:part"):  # fmt: skip
        assert entry in text, entry
    assert re.search(r"/Lang \(pt", text)
    assert text.count("/S /Figure") == text.count("/Alt ") > 20


def unpacked(made: bytes) -> str:
    """Return the PDF with its compressed streams laid open."""
    parts = [made]
    for found in re.finditer(rb"stream\n(.*?)\nendstream", made, re.DOTALL):
        with contextlib.suppress(zlib.error):
            parts.append(zlib.decompress(found[1]))
    return b"\n".join(parts).decode("latin-1")


@pytest.fixture(scope="module", params=["en", "pt"])
def pages(request):
    """Ids on each page of a report with limits, a sweep, a run-out, notes and signatures."""
    weasyprint = pytest.importorskip("weasyprint")
    made = Scene(seed=3).references()
    for wheel in ("FL", "FR"):
        swept(made, wheel, 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    noted = replace(made.measure(), notes=tuple(f"Note {i}: {'word ' * 30}" for i in range(4)))
    zone = {"lower_deg": -5.0, "upper_deg": 5.0}
    rear = {"toe": zone, "camber": zone}
    tables = {"front": rear | {"caster": zone, "sai": zone}, "rear": rear}
    judged = assess(noted, Tolerance.model_validate(tables))
    words = load_translations(request.param)
    page = html_report(noted, judged, ReportOptions(words, PAPER, LABORATORY), still=True)
    return [set(one.anchors) for one in weasyprint.HTML(string=page).render().pages]


def test_the_first_page_holds_the_results_and_the_notes_and_no_annex(pages):
    assert {"results", "notes"} <= pages[0]
    assert not any({"results", "notes"} & ids for ids in pages[1:])
    assert "values" in pages[1]


def test_the_last_page_is_no_leftover(pages):
    """The settings, a block of some thirty lines, stay together, with what ends the report."""
    assert {"settings", "signatures"} <= pages[-1]


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


ALONE = """
import ctypes.util, gc, subprocess
from wheelplane.report.html.pdf import pdf_report
started, search, popen = [], ctypes.util.find_library, subprocess.Popen
subprocess.Popen = lambda *given, **named: started.append(given) or popen(*given, **named)
assert pdf_report("<p>x", "x").startswith(b"%PDF")
assert ctypes.util.find_library is search and gc.isenabled()
print(len(started))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="libraries are named otherwise")
def test_no_process_is_started_to_find_a_library_and_all_is_as_before():
    pytest.importorskip("weasyprint")
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=True)
    assert done.stdout == "0\n"


def test_without_weasyprint_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    page = html_report(measured(1), None, ReportOptions(load_translations("en"), PAPER), still=True)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[pdf\]'") as refused:
        pdf_report(page, "x")
    assert "\n" not in str(refused.value)
