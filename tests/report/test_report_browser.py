"""The page in a browser: it works from the file alone, and is accessible."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.support.layout import check_layout
from tests.support.reported import lost
from tests.support.turning import Scene, rolled, swept
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.earlier import read_earlier
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.html.page import VIEWER, ReportOptions, html_report
from wheelplane.report.json.measurement import to_json

CHROMIUM = shutil.which("chromium")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--disable-background-networking"]  # fmt: skip
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
pytest.importorskip("playwright")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
]


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    """A report with a verdict, and a trial that was not measured."""
    zone = {"camber": {"lower_deg": -5.0, "upper_deg": 5.0}}
    judged = assess(lost(), Tolerance.model_validate({"front": zone, "rear": zone}))
    path = tmp_path_factory.mktemp("page") / "report.html"
    text = html_report(lost(), judged, ReportOptions(load_translations("pt"), PAPER))
    path.write_text(text, encoding="utf-8")
    return path


def opened(browser, file, width, height, **context):
    """Return the page, with its errors and its requests over the network."""
    page = browser.new_page(viewport={"width": width, "height": height}, **context)
    faults: list[str] = []
    page.on(
        "console", lambda message: faults.append(message.text) if message.type == "error" else None
    )
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: faults.append(request.url)
            if request.url.split(":")[0] not in ("file", "data", "blob") else None)  # fmt: skip
    page.goto(file.as_uri())
    return page, faults


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (820, 1180), (390, 844)])
def test_it_fits_and_asks_for_nothing(browser, file, width, height):
    page, faults = opened(browser, file, width, height)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert faults == []
    page.close()


@pytest.fixture(scope="module", params=["en", "pt"])
def turned(request, tmp_path_factory) -> Path:
    """A report of wheels with long names, limits, a sweep, a run-out and what was before."""
    made = Scene(seed=3).references()
    for wheel in ("FL", "FR"):
        swept(made, wheel, 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    rolled(made, "RR", np.radians([0.0, 180.0]))
    measurement = made.measure()
    folder = tmp_path_factory.mktemp("turned")
    (folder / "before.json").write_text(to_json(measurement), encoding="utf-8")
    zone = {"lower_deg": -5.0, "upper_deg": 5.0}
    rear = {"toe": zone, "camber": zone}
    limits = {"front": rear | {"caster": zone, "sai": zone}, "rear": rear}
    judged = assess(measurement, Tolerance.model_validate(limits))
    words = load_translations(request.param)
    for name, before in (("plain", None), ("changed", read_earlier(folder / "before.json"))):
        text = html_report(measurement, judged, ReportOptions(words, PAPER, before=before))
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["plain", "changed"])
@pytest.mark.parametrize("width", [390, 1024, 1440])
def test_results_are_whole_on_every_screen(browser, turned, name, width):
    page, faults = opened(browser, turned / f"{name}.html", width, 844)
    check_layout(page, "table.front, #values .scroll:first-of-type table")
    assert faults == []
    page.close()


def test_it_can_be_read_by_all(browser, file):
    from axe_playwright_python.sync_playwright import Axe

    page, _ = opened(browser, file, 1280, 800)
    page.wait_for_timeout(500)
    found = Axe().run(page, options={"runOnly": WCAG}).response["violations"]
    assert [(rule["id"], rule["nodes"][0]["html"]) for rule in found] == []
    page.close()


@pytest.mark.skipif(not VIEWER.is_file(), reason="the viewer is not built")
def test_the_view_is_there_and_paper_has_the_still_picture(browser, file):
    page, _ = opened(browser, file, 1280, 800)
    page.wait_for_selector("#stage canvas")
    assert page.locator(".still").is_hidden()
    page.emulate_media(media="print")
    assert page.locator(".still").is_visible()
    assert page.locator("#stage").is_hidden()
    page.close()


def test_without_scripts_the_still_picture_stands_in(browser, file):
    page, faults = opened(browser, file, 1280, 800, java_script_enabled=False)
    assert page.locator(".still").is_visible()
    assert page.locator(".view3d").is_hidden()
    assert faults == []
    page.close()
