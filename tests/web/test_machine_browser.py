"""The calibration of a machine in a real browser: typed, loaded, corrected, saved."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.support.browser import IN_A_BROWSER, until
from tests.support.calibration_bay import CAMBER, TOE, item_of, machine
from tests.support.layout import check_layout
from tests.support.made import write_small_capture
from wheelplane.calibration import item_toml
from wheelplane.commands.batch import batch
from wheelplane.commands.calibrate import calibrate
from wheelplane_synth.machine.forms import readings_csv
from wheelplane_synth.machine.indicate import indicate

TESTED = machine(toe=TOE, camber=CAMBER)
CELLS = "ul.readings .cell input"

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A capture with trials, and the files of a machine that has read them."""
    place = tmp_path_factory.mktemp("allowed")
    write_small_capture(place / "capture", trials=2)
    truth = json.loads((place / "capture" / "truth.json").read_text())
    (place / "item.toml").write_text(item_toml(item_of(TESTED)))
    table = readings_csv(indicate(truth, TESTED, np.random.default_rng(0)))
    (place / "readings.csv").write_text(table)
    write_small_capture(place / "other", trials=2, seed=2)  # other scans: the same files are one
    head, *rows = table.splitlines()
    series = head.split(",").index("series")
    again = [",".join([*row.split(",")[:series], "2", *row.split(",")[series + 1 :]])
             for row in rows]  # fmt: skip
    (place / "two.csv").write_text("\n".join([head, *rows, *again]) + "\n")
    return place


def opened(visit):
    """The page with the panel of the machine, of which nothing is stated yet."""
    visit.open()
    page = visit.measure("capture")
    page.locator("#machine > summary").click()
    return page


def loaded(visit, folder: Path):
    """The panel with item and readings from their files."""
    page = opened(visit)
    page.set_input_files("#machine input[accept='.toml'] >> nth=0", str(folder / "item.toml"))
    page.wait_for_selector(".sheet section")
    page.set_input_files("#machine input[accept='.csv,.xlsx']", str(folder / "readings.csv"))
    page.wait_for_selector(".found .verdict")
    return page


def test_a_machine_is_stated_and_read_by_keyboard_alone(visit, folder):
    page = visit.open()
    visit.measure("capture")
    page.locator("#machine > summary").focus()
    page.keyboard.press("Enter")
    page.locator("#machine input[name=maker]").focus()
    for text in ("Maker", "Model", "7", "1.0", ""):
        page.keyboard.type(text)
        page.keyboard.press("Tab")
    page.keyboard.press("Space")  # toe
    page.locator("#machine input[name=resolution]").fill("0.1'")
    page.locator("#machine input[name=mpe]").fill("6'")
    page.select_option("#machine select[name=positive]", "toe-in")
    said = "document.querySelector('#machine .status.bad').innerText"
    until(page, f"{said}.includes('toe has no axis')")
    page.select_option("#machine select[name=axis]", "rear-axle")
    until(page, f"{said}.includes('no decision rule is named')")
    page.select_option("#machine select[name=rule]", "guarded")
    page.wait_for_selector(".sheet section")
    first = page.locator(CELLS)
    assert first.nth(0).is_disabled()  # until its unit is chosen: nothing is guessed
    page.select_option("select[name=unit_toe]", "min")
    first.nth(0).focus()
    found = page.locator("ul.readings li").nth(0).locator(".found")
    page.keyboard.type("-15.8")
    page.wait_for_selector(".faults li")
    assert "no reading is repeated" in page.locator(".faults").inner_text()
    assert found.inner_text() == ""
    page.keyboard.press("Enter")
    page.keyboard.type("-15.7")
    until(page, "document.querySelector('.found').innerText.startsWith('error')")
    assert "U " in found.inner_text()
    assert page.locator(".found .verdict").count() == 1
    page.keyboard.press("Tab")
    page.keyboard.type("-15x")
    page.keyboard.press("Tab")
    page.wait_for_selector("[aria-invalid]")
    fault = page.locator("ul.readings li").nth(0).locator(".fault")
    assert fault.inner_text().startswith("3: '-15x' is no number: write it as -0.25")
    wrong = page.locator("[aria-invalid]")
    assert wrong.get_attribute("aria-describedby") == fault.get_attribute("id")
    assert page.evaluate("document.activeElement.closest('li').innerText").startswith("RL")
    visit.check_with_axe()


def test_a_table_that_would_lose_readings_is_refused_and_a_later_one_resets_the_form(visit, folder):
    """Repeats and directions of the form are those of the last table that was loaded."""
    page = loaded(visit, folder)
    lines = (folder / "readings.csv").read_text().splitlines()
    assert page.locator("#machine input[name=directions]").is_checked()
    (folder / "twice.csv").write_text("\n".join([*lines, lines[5]]))
    visit.refusal = 400
    page.set_input_files("#machine input[accept='.csv,.xlsx']", str(folder / "twice.csv"))
    until(page, "document.querySelector('.faults').innerText.includes('already: number each')")
    assert f"twice.csv: row {len(lines) + 1}, column repeat" in page.locator(".faults").inner_text()
    assert page.locator(".found .verdict").count() == 12  # those before stay
    head = lines[0].split(",")
    repeat, direction = head.index("repeat"), head.index("direction")
    rows = [line.split(",") for line in lines[1:] if line.split(",")[direction] == "up"]
    more = [[*rows[0][:repeat], "7", *rows[0][repeat + 1 :]]]
    plain = [[*row[:direction], "", *row[direction + 1 :]] for row in rows]
    for name, table in (("more.csv", rows + more), ("plain.csv", plain)):
        (folder / name).write_text("\n".join(map(",".join, [head, *table])))
    page.set_input_files("#machine input[accept='.csv,.xlsx']", str(folder / "more.csv"))
    until(page, "document.querySelector('#machine input[name=repeats]').value === '7'")
    assert page.locator("#machine input[name=directions]").is_checked()
    page.set_input_files("#machine input[accept='.csv,.xlsx']", str(folder / "plain.csv"))
    until(page, "document.querySelector('#machine input[name=repeats]').value === '3'")
    assert not page.locator("#machine input[name=directions]").is_checked()


def test_readings_are_loaded_corrected_and_saved(visit, folder):
    page = loaded(visit, folder)
    assert page.locator(".found .verdict").count() == 12  # toe and camber of 6 targets
    assert page.locator("#machine table.figures").count() == 2
    page.locator("#machine input[name=name]").fill("machine 7")
    page.locator("#machine form.save button").click()
    page.wait_for_selector("#machine .status.good a")
    files = {path.name for path in (folder / "machine 7").iterdir()}
    assert files == {"item.toml", "readings.csv", "calibration.json", "calibration.txt",
                     "certificate.html"}  # fmt: skip
    with visit.context.expect_page() as shown:
        page.locator("#machine .status.good a").click()
    certificate = shown.value
    certificate.wait_for_selector("table")
    assert "DRAFT" in certificate.content()
    certificate.close()
    page.locator(CELLS).nth(0).fill("99999")
    page.wait_for_selector("[aria-invalid]")
    visit.refusal = 400
    page.locator("#machine input[name=name]").fill("machine 8")
    page.locator("#machine form.save button").click()
    page.wait_for_selector("#machine form.save + div .status.bad")
    assert "no plausible toe" in page.locator("#machine form.save + div .status").inner_text()
    assert not (folder / "machine 8").exists()


def test_what_was_typed_outlives_a_change_of_language(visit, folder):
    page = loaded(visit, folder)
    page.locator(CELLS).nth(0).fill("-12.3")
    until(page, "JSON.stringify({...sessionStorage}).includes('-12.3')")
    page.select_option("#language", "pt")
    page.wait_for_selector("text=Calibrar um equipamento")
    page.wait_for_selector(".found .verdict")
    assert page.locator(".cell input").nth(0).input_value() == "-12.3"
    assert page.locator(".found").nth(0).inner_text().startswith("erro")


def test_another_series_is_another_sheet(visit, folder):
    page = loaded(visit, folder)
    page.locator("#machine input[name=series]").fill("2")
    page.keyboard.press("Tab")
    until(page, "document.querySelector('.cell input').value === ''")
    page.locator(CELLS).nth(0).fill("-15")
    until(page, "document.querySelector('.faults').innerText.includes('series 2, down')")
    page.get_by_role("button", name="as found, Series 1").click()
    until(page, "document.querySelector('.cell input').value !== ''")


def test_each_series_has_its_selector_of_a_reference(visit, folder):
    """One selector more than references are named; each offers the other measurements."""
    page = loaded(visit, folder)
    others = page.locator(
        "select[name=before]"
    ).count()  # of earlier measurements, if there are any
    assert page.locator("select[name=reference-2]").count() == others
    page.get_by_role("button", name="Measure another").click()
    visit.measure("other")
    page.locator("#machine > summary").click()
    selector = page.locator("select[name^=reference-]")
    until(page, "document.querySelectorAll('select[name^=reference-]').length === 1")
    offered = selector.locator("option").all_inner_texts()
    assert len(offered) >= 2
    assert all(name.startswith("capture") for name in offered[1:])
    page.set_input_files("#machine input[accept='.toml'] >> nth=0", str(folder / "item.toml"))
    page.wait_for_selector(".sheet section")
    page.set_input_files("#machine input[accept='.csv,.xlsx']", str(folder / "two.csv"))
    page.wait_for_selector(".found .verdict")
    selector.nth(0).select_option(index=1)
    until(page, "document.querySelectorAll('select[name^=reference-]').length === 2")
    assert page.locator("select[name=reference-3]").input_value() == ""
    page.wait_for_selector(".found .verdict")
    page.locator("#machine input[name=name]").fill("two references")
    page.locator("#machine form.save button").click()
    page.wait_for_selector("#machine .status.good a")
    tree = json.loads((folder / "two references" / "calibration.json").read_text())
    assert [one["series"] for one in tree["references"]] == ["1", "2"]
    assert tree["references"][0]["source"] != tree["references"][1]["source"]
    page.locator("select[name=reference-2]").select_option("")
    until(page, "document.querySelectorAll('select[name^=reference-]').length === 1")
    visit.check_with_axe()


def test_the_archive_opens_the_certificate(visit, folder):
    bay = shutil.copytree(folder / "capture", folder / "bays" / "one")
    for name in ("item.toml", "readings.csv"):
        shutil.copy(folder / name, bay / name)
    (bay / "five-point.txt").unlink(missing_ok=True)
    results, files = folder / "archive", ("--item", "item.toml", "--readings", "readings.csv")
    for command, arguments in (
        (batch, (folder / "bays", "-o", results)),
        (calibrate, (bay, *(bay / f if f[0] != "-" else f for f in files),
                     "-o", results / "certificates" / "1")),
    ):  # fmt: skip
        command.main(list(map(str, arguments)), standalone_mode=False)
    page = visit.open()
    page.locator("nav a", has_text="Archive").click()
    page.locator("#archive .items button", has_text="archive").click()
    page.get_by_role("button", name="Calibrations").click()
    page.locator("#archive tbody button").first.click()
    link = page.get_by_role("link", name="Open the certificate")
    with visit.context.expect_page() as shown:
        link.click()
    shown.value.wait_for_selector("table")
    assert "DRAFT" in shown.value.content()
    shown.value.close()
    visit.check_with_axe()


@pytest.mark.parametrize(
    "visit",
    [
        {"viewport": {"width": width, "height": 844}, "locale": language, "color_scheme": scheme}
        for width, language, scheme in (
            (390, "en-GB", "light"), (390, "pt-PT", "dark"), (1024, "pt-PT", "light"),
            (1440, "en-GB", "dark"),
        )
    ],
    indirect=True,
)  # fmt: skip
def test_it_fits_on_every_screen(visit, folder):
    page = loaded(visit, folder)
    page.locator(CELLS).nth(0).fill("x")
    page.wait_for_selector("[aria-invalid]")
    check_layout(page, "ul.readings, .readings li > div, #machine fieldset")
    visit.check_with_axe()
