"""Kept results, addresses and Back, stored measurements, in a real browser."""

from __future__ import annotations

import json

import pytest

from tests.support.browser import IN_A_BROWSER, Visit, serving, until
from tests.support.layout import check_layout
from tests.support.web_site import PAPER, write_results, write_turned
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.report.json.measurement import to_tree

pytestmark = IN_A_BROWSER
WIDTHS = (390, 1024, 1440)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("allowed")
    for name in ("first.txt", "second.txt"):
        (place / name).write_bytes(PAPER.read_bytes())
    return place


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def address(folder, results, tmp_path_factory):
    with serving(folder, tmp_path_factory.mktemp("scratch"), results=results) as made:
        yield made


def title(page):
    return page.locator("#result-title").inner_text()


def test_back_and_forward_go_through_what_was_seen(visit, folder):
    page = visit.open()
    visit.measure("first.txt")
    first = page.url
    page.get_by_role("button", name="Measure another").click()
    page.wait_for_selector("#load:not([hidden])")
    assert page.locator("#result").is_hidden()
    visit.measure("second.txt")
    assert title(page) == "second.txt"
    page.go_back()
    page.wait_for_selector("#load:not([hidden])")
    page.go_back()
    until(page, "document.querySelector('#result-title')?.innerText === 'first.txt'")
    assert page.url == first
    page.wait_for_selector("#result:not([hidden])")
    page.go_forward()
    page.go_forward()
    until(page, "document.querySelector('#result-title')?.innerText === 'second.txt'")
    page.locator("nav a", has_text="Compare").click()
    page.get_by_role("button", name="Compare").click()
    page.wait_for_selector("#compare .verdict")
    compared = page.url
    page.goto("about:blank")
    page.goto(compared)
    page.wait_for_selector("#compare .verdict")
    page.select_option("#compare select[name=format]", "pdf")
    with page.expect_download() as loaded:
        page.locator("#compare").get_by_role("button", name="Download").click()
    assert loaded.value.suggested_filename == "first - second.pdf"
    assert loaded.value.path().read_bytes().startswith(b"%PDF")
    page.select_option("#compare select[name=format]", "html")
    page.locator("#compare input[name=name]").fill("compared")
    page.get_by_role("button", name="Save in this folder").click()
    page.wait_for_selector("#compare .status.good")
    assert "<svg" in (folder / "compared.html").read_text()
    visit.check_with_axe()
    page.go_back()


def test_a_result_is_found_at_its_address_after_a_restart(browser, folder, results, tmp_path):
    addresses = []
    for scratch in ("one", "other"):
        with serving(folder, tmp_path / scratch, results=results) as address:
            visit = Visit(browser, address)
            page = visit.open()
            page.wait_for_selector("#browser .items")
            if not addresses:
                page.locator("#browser button", has_text="first.txt").click()
                page.wait_for_selector("#result:not([hidden]) table.angles")
                addresses.append(page.url.partition("#")[2])
            else:
                page.wait_for_selector("#before button")
                assert "Kept in the folder" in page.locator("#before").inner_text()
                visit.check_with_axe()
                page.goto(f"{visit.address}#{addresses[0]}")
                page.wait_for_selector("#result:not([hidden]) table.angles")
                assert title(page).startswith("first.txt")
                page.goto(f"{visit.address}#result=20200101_000000_00")
                page.wait_for_selector("#trouble:not([hidden])")
                assert "no longer kept" in page.locator("#trouble").inner_text()
            visit.context.close()
        assert visit.faults == []


@pytest.mark.parametrize("width", WIDTHS)
def test_a_kept_measurement_is_removed_once_that_is_confirmed(browser, folder, tmp_path, width):
    results = tmp_path / "results"
    results.mkdir()
    with serving(folder, tmp_path / "scratch", results=results) as address:
        visit = Visit(browser, address, viewport={"width": width, "height": 844})
        page = visit.open()
        for name in ("first.txt", "second.txt"):
            visit.measure(name)
            page.get_by_role("button", name="Measure another").click()
        kept = {path.name for path in results.iterdir()}
        page.get_by_role("button", name="Remove first.txt").focus()
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.textContent") == "Remove it"
        check_layout(page, "#before")
        visit.check_with_axe()
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")  # keep it
        assert {path.name for path in results.iterdir()} == kept
        page.get_by_role("button", name="Remove first.txt").click()
        page.get_by_role("button", name="Remove it").click()
        until(page, "document.querySelectorAll('#before li').length === 1")
        assert "second.txt" in page.locator("#before").inner_text()
        (left,) = results.iterdir()
        assert json.loads((left / "result.json").read_text())["name"] == "second.txt"
        page.get_by_role("button", name="Remove second.txt").click()
        page.get_by_role("button", name="Remove it").click()
        until(page, "document.querySelectorAll('#before li').length === 0")
        assert list(results.iterdir()) == []
        visit.context.close()
    assert visit.faults == []


@pytest.mark.parametrize(
    "visit", [{"viewport": {"width": width, "height": 844}} for width in WIDTHS], indirect=True
)
def test_a_stored_measurement_is_opened(visit, folder):
    page = visit.open()
    visit.measure("second.txt")
    with page.expect_download() as loaded:
        page.select_option(".save select[name=format]", "json")
        page.get_by_role("button", name="Download").click()
    data = loaded.value.path().read_bytes()
    (folder / "stored.json").write_bytes(data)
    page = visit.open()
    page.wait_for_selector("#browser .items")
    page.locator("#browser button", has_text="stored.json").click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert page.url.endswith("#open=0/stored.json")
    assert page.locator("table.angles tbody tr").count() == 8
    page.reload()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    visit.check_with_axe()
    page.get_by_role("button", name="Measure another").click()
    upload = {"name": "mine.json", "mimeType": "application/json", "buffer": data}
    page.set_input_files("#files", upload)
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert "#result=" in page.url


@pytest.fixture(scope="module")
def archive(folder):
    """An archive of 28 days, whose RR toe rises day by day."""
    place = folder / "archive"
    for path in write_turned(place, 28).rglob("*.json"):
        tree = json.loads(path.read_text())
        day = int(tree["capture"].rpartition("-")[2])
        tree["batch"]["date"] = tree["date"] = f"2026-01-{day + 1:02d}"
        path.write_text(json.dumps(tree))
    return place


@pytest.mark.parametrize(
    "visit", [{"viewport": {"width": width, "height": 844}} for width in WIDTHS], indirect=True
)
def test_a_control_chart_is_read_by_pointer_and_keyboard(visit, archive):
    page = visit.open("archive=0/archive?part=charts&quantity=RR+toe")
    page.wait_for_selector(".chart svg")
    reading = page.locator(".reading")
    assert "Rule 2: nine in a row" in page.locator("#archive table").inner_text()
    slider = page.get_by_label("Point", exact=True)
    slider.focus()
    page.keyboard.press("Home")
    first = reading.inner_text()
    assert first.startswith("2026-01-01 2026/car-00")
    page.keyboard.press("ArrowRight")
    assert reading.inner_text() != first
    assert slider.get_attribute("aria-valuetext").startswith("2026-01-02 2026/car-01")
    box = page.locator(".chart svg").bounding_box()
    page.mouse.move(box["x"] + box["width"] - 20, box["y"] + 100)
    assert "car-26" in reading.inner_text()
    visit.check_with_axe()
    width = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert width[0] <= width[1]
    page.get_by_role("button", name="Open this capture").click()
    page.wait_for_selector("#archive h2")
    assert page.locator("#archive h2").inner_text() == "2026/car-26"
    page.go_back()
    page.wait_for_selector(".chart svg")
    page.select_option("select[name=quantity]", "thrust_angle")
    until(page, "document.querySelector('#archive h2')?.innerText.includes('thrust angle')")
    page.select_option("#archive select[name=vehicle]", "AA-01")
    page.get_by_role("button", name="Show").click()
    until(page, "document.querySelectorAll('.chart .curve').length === 2")
    page.go_back()
    page.go_back()
    until(page, "document.querySelector('#archive h2')?.innerText.includes('RR toe')")


def test_a_late_answer_of_a_view_that_was_left_is_not_shown(visit, archive):
    page = visit.open("archive=0/archive?part=charts&quantity=RR+toe")
    page.wait_for_selector(".chart svg")
    held = []
    page.route("**/archive/chart/**thrust_angle*", lambda route: held.append(route))
    page.select_option("select[name=quantity]", "thrust_angle")
    until(page, "document.querySelector('#archive select[name=quantity]').value === 'thrust_angle'")
    page.select_option("select[name=quantity]", "FL camber")
    until(page, "document.querySelector('#archive h2')?.innerText.includes('FL camber')")
    with page.expect_response("**/archive/chart/**thrust_angle*"):
        held.pop().continue_()
    page.wait_for_timeout(200)
    assert "FL camber" in page.locator("#archive h2").inner_text()

    page.route("**/archive/overview/**", lambda route: held.append(route))
    page.evaluate("location.hash = '#archive=0/archive/2026?part=captures'")
    page.wait_for_timeout(100)
    page.evaluate("location.hash = '#archive=0/archive?part=captures'")
    until(page, "document.querySelectorAll('#archive table tbody tr').length > 0")
    count = page.locator("#archive .tile b").first.inner_text()
    assert held
    assert count == "28"


def test_before_and_after_of_a_vehicle(visit, archive):
    page = visit.open("archive=0/archive?part=captures&text=car-0")
    page.wait_for_selector("#archive table")
    names = page.locator("#archive thead").inner_text()
    for name in ("RR toe", "FL camber", "rear total toe", "thrust angle"):
        assert name in names
    for name in ("car-00", "car-03"):
        page.get_by_role("button", name=name).click()
        page.wait_for_selector(f"#archive h2:has-text('{name}')")
        page.get_by_role("link", name="Open with 3D view and report").click()
        page.wait_for_selector(f"#result-title:has-text('{name}')")
        page.wait_for_selector("#result:not([hidden]) table.angles")
        page.go_back()
        page.wait_for_selector("#archive h2")
    page.go_forward()
    page.wait_for_selector("#change-title")
    earlier = page.locator("#result select[name=earlier]")
    earlier.select_option(index=1)
    page.wait_for_selector("section[aria-labelledby=change-title] table")
    shown = page.locator("section[aria-labelledby=change-title]").inner_text()
    assert "by the same scans: what differs is the evaluation" in shown  # all are of one file
    visit.check_with_axe()
    page.select_option(".save select[name=format]", "txt")
    with page.expect_download() as loaded:
        page.locator("#result").get_by_role("button", name="Download").click()
    assert "before" in loaded.value.path().read_text().lower()


def test_unlike_verticals_are_named_and_one_is_chosen(visit, folder):
    place = folder / "verticals"
    write_results(place, to_tree(measure_five_point(read_five_point(PAPER))), 6)
    for path in place.rglob("*.json"):
        tree = json.loads(path.read_text())
        if tree["capture"].endswith(("0", "2")):
            path.write_text(json.dumps(tree | {"vertical_in_use": "floor"}))
    page = visit.open("archive=0/verticals")
    page.wait_for_selector("#archive table")
    note = page.locator("#archive .note")
    assert "floor: 2" in note.inner_text()
    visit.check_with_axe()
    page.select_option("#archive select[name=vertical]", "floor")
    page.get_by_role("button", name="Show").click()
    until(page, "document.querySelectorAll('#archive tbody tr').length === 2")
    assert note.count() == 0
    page.locator("[data-part=charts]").click()
    page.wait_for_selector("#archive select[name=quantity]")
    assert note.count() == 0
