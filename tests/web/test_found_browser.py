"""A failed measurement in a real browser: what was found is seen, and the target chosen."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from tests.support.browser import IN_A_BROWSER, serving
from tests.support.layout import check_layout
from tests.support.made import as_one_cloud, with_second_target, write_small_capture
from wheelplane.capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture

WHEELS = ("RR", "RL", "FR", "FL")

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def centres(tmp_path_factory, folder):
    with open_capture(folder / "car") as capture:
        found = measure_capture(capture, Config())
    return {one.observation.name: one.observation.fitted.centre_m for one in found.wheels}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("allowed")
    write_small_capture(place / "car", trials=0)
    return place


@pytest.fixture(scope="module")
def address(folder, centres, tmp_path_factory):
    as_one_cloud(folder / "car", folder / "single.ply")
    with_second_target(folder / "car", centres["FL"], 0.55)
    as_one_cloud(folder / "car", folder / "whole.ply")
    with serving(folder, tmp_path_factory.mktemp("scratch")) as made:
        yield made


def found(visit, name, **fields):
    """The page with what was found in a capture that cannot be measured."""
    page = visit.open()
    page.wait_for_selector("#browser .items")
    if fields:
        page.locator(".options summary").click()
        for field, value in fields.items():
            page.locator(f"#fields [name={field}]").select_option(value)
    page.locator("#browser button", has_text=name).first.click()
    page.locator("#why").click()
    page.wait_for_selector(".looked .picture img")
    page.wait_for_load_state("networkidle")
    return page


@pytest.mark.parametrize(
    "visit",
    [{"viewport": {"width": width, "height": 844}} for width in (390, 1024, 1440)],
    indirect=True,
)
def test_the_candidates_are_seen_on_every_screen(visit, request):
    page = found(visit, "doubled")
    assert "ambiguous-target" in page.locator("#trouble").inner_text()
    assert page.locator(".looked > article.scan").count() == 1
    assert page.locator(".looked details article.scan").count() == 3
    check_layout(page, "#trouble")
    visit.check_with_axe()


def test_a_target_is_chosen_in_the_picture_and_measured(visit):
    page = found(visit, "doubled")
    page.locator("#again").click()
    assert "Choose a candidate first" in page.locator(".looked [role=status]").inner_text()
    page.locator(".looked > article .spot").nth(1).click()
    assert page.locator("#found-FL-2").is_checked()
    page.locator(".looked > article .spot").nth(0).click()
    page.locator("#again").click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert "The operator chose the target" in page.locator("#result").inner_text()


def test_a_target_is_chosen_by_keyboard(visit):
    page = found(visit, "doubled")
    page.locator("#found-FL-1").focus()
    page.keyboard.press("Space")
    page.locator("#again").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector("#result:not([hidden]) table.angles")


def drag(page, picture, start, end):
    """Drag from one place of a picture to another; shares of its width and height."""
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    (x0, y0), (x1, y1) = ((box["x"] + x * box["width"], box["y"] + y * box["height"])
                          for x, y in (start, end))  # fmt: skip
    page.mouse.move(x0, y0)
    page.mouse.down()
    page.mouse.move((x0 + x1) / 2.0, (y0 + y1) / 2.0)
    page.mouse.move(x1, y1)
    page.mouse.up()


def tree_of(page):
    """The explanation that the page shows."""
    return page.evaluate(
        "async () => (await fetch(document.querySelector('.looked img').src.replace(/[^/]+$/, "
        "'explanation.json'))).json()"
    )


def around(place, reach=0.17):
    x, y = place
    return (x - reach, y - reach), (x + reach, y + reach)


def test_a_region_is_drawn_and_measured(visit, centres, folder, tmp_path):
    page = found(visit, "doubled")
    scan = next(one for one in tree_of(page)["scans"] if one["name"] == "FL")
    chosen = min(scan["candidates"][:2], key=lambda one: one["centre_m"][2])
    picture = page.locator(".looked > article .picture")
    page.locator("#found-FL-2").check()
    page.get_by_role("button", name="Draw the region of the target").first.click()
    visit.check_with_axe()
    drag(page, picture, *around(chosen["in_picture"]))
    assert page.locator(".looked .drawn").first.is_visible()
    assert not page.locator("#found-FL-2").is_checked()
    page.locator(".looked details", has_text="For capture.toml").locator("summary").click()
    lines = page.locator(".looked details pre").inner_text()
    page.locator("#again").click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert "The operator chose the region with corners" in page.locator("#result").inner_text()
    car = shutil.copytree(folder / "doubled", tmp_path / "car")
    (car / "capture.toml").write_text((car / "capture.toml").read_text() + f"\n{lines}\n")
    with open_capture(car) as capture:
        repeated = measure_capture(capture, Config())
    shown = page.evaluate(
        "async () => (await fetch(`/api/jobs/${location.hash.slice(8)}/measurement.json`)).json()"
    )
    (front_left,) = (one for one in repeated.wheels if one.observation.name == "FL")
    np.testing.assert_allclose(front_left.observation.fitted.centre_m, centres["FL"], atol=1e-3)
    (wheel,) = (one for one in shown["wheels"] if one["name"] == "FL")
    np.testing.assert_array_equal(wheel["centre_m"], front_left.observation.fitted.centre_m)
    (hint,) = shown["provenance"]["config"]["hints"].values()
    assert len(hint["region_m"]) == 4


def test_a_region_is_entered_by_keyboard_and_a_wrong_one_is_refused(visit):
    page = found(visit, "doubled")
    page.get_by_role("button", name="Draw the region of the target").first.focus()
    page.keyboard.press("Enter")
    for text in ("0", "0.1", "0", "0.1"):  # a corner of the picture
        page.keyboard.press("Tab")
        page.keyboard.type(text)
    assert page.locator(".looked .drawn").first.is_visible()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # no region
    assert not page.locator(".looked .drawn").first.is_visible()
    for _ in range(4):
        page.keyboard.press("Shift+Tab")
    for text in ("0", "0.1", "0", "0.1"):
        page.keyboard.type(text)
        page.keyboard.press("Tab")
    page.locator("#again").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector("#trouble:not([hidden]) #why")
    text = page.locator("#trouble").inner_text()
    assert "The operator chose the region" in text
    page.locator("#why").click()
    page.wait_for_selector(".looked .picture img")
    assert page.locator(".looked > article tbody tr").count() >= 2  # to choose from, still


def test_the_wheels_of_a_cloud_are_named(visit, centres):
    page = found(visit, "whole.ply", target="disc-250")
    (scan,) = tree_of(page)["scans"]
    page.locator("#again").click()
    assert "all four wheels" in page.locator(".looked [role=status]").inner_text()
    for name, centre in centres.items():
        near = min(
            scan["candidates"],
            key=lambda one: sum((a - b) ** 2 for a, b in zip(one["centre_m"], centre, strict=True)),
        )
        page.locator(f"#found-vehicle-{near['number']}").select_option(name)
    page.locator("#again").click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    rows = page.locator("table.angles tbody tr")
    assert [rows.nth(i).locator("th").inner_text() for i in range(4)] == list(WHEELS)


def test_the_front_of_a_cloud_is_chosen_in_its_picture(visit, centres):
    """The side of the picture on which the front wheels lie, by which no other choice is needed."""
    page = found(visit, "single.ply", target="disc-250")
    (scan,) = tree_of(page)["scans"]
    ahead = (centres["FR"] + centres["FL"] - centres["RR"] - centres["RL"]) / 2.0
    right, up = (float(np.dot(axis, ahead)) for axis in scan["picture_axes"])
    sides = {"right": right, "left": -right, "top": up, "bottom": -up}
    front = max(sides, key=sides.get)
    visit.check_with_axe()
    page.locator(".looked").get_by_role("button", name=front, exact=True).click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert [page.locator("table.angles tbody tr").nth(i).locator("th").inner_text()
            for i in range(4)] == list(WHEELS)  # fmt: skip


def test_a_failure_names_the_field_of_the_page_and_opens_it(visit):
    page = visit.open()
    page.wait_for_selector("#browser .items")
    page.locator("#browser button", has_text="whole.ply").click()
    page.wait_for_selector("#retry")
    text = page.locator("#trouble").inner_text()
    assert "add “Target”" in text
    assert "--target" not in text.split("for example")[0]
    assert page.evaluate("document.activeElement.name") == "target"
    page.locator("#fields [name=target]").select_option("disc-250")
    page.locator("#fields [name=front]").fill("0,0,1")
    page.locator("#retry").click()
    page.wait_for_selector("#why")  # the next thing that is missing, or wrong
    assert "Forward direction" in page.locator("#trouble").inner_text()
    assert page.evaluate("document.activeElement.name") == "front"
    visit.check_with_axe()


@pytest.mark.parametrize("visit", [{"locale": "pt-PT"}], indirect=True)
def test_an_english_failure_has_no_field_of_another_language_in_it(visit):
    """A sentence in the language of the page names the fields, after that of the program."""
    page = visit.open()
    page.wait_for_selector("#browser .items")
    page.locator("#browser button", has_text="whole.ply").click()
    page.wait_for_selector("#retry")
    sentence, _, fields = page.locator("#trouble p").first.inner_text().partition(" Nesta página, ")
    assert "add --target" in sentence
    assert "“" not in sentence
    assert "--target: “Alvo”" in fields
    assert page.evaluate("document.activeElement.name") == "target"


def test_a_result_is_at_its_address_after_a_reload(visit):
    visit.open()
    page = visit.measure("car")
    address = page.evaluate("location.hash")
    assert address.startswith("#result=")
    page.reload()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert page.evaluate("location.hash") == address
    page.get_by_role("button", name="Measure another").click()
    assert page.evaluate("location.hash") == "#measure"
    assert page.locator("#load").is_visible()


def test_a_reload_finds_the_running_measurement_again(visit):
    page = visit.open()
    page.wait_for_selector("#browser .items")
    page.locator("#browser button", has_text="car").first.click()
    page.locator("#busy-text", has_text="Measuring").wait_for()
    page.reload()
    page.wait_for_selector("#busy:not([hidden])")
    assert page.locator("#busy-name").inner_text() == "car"
    page.wait_for_selector("#result:not([hidden]) table.angles")
