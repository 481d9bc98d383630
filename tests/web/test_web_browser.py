"""The page in a real browser: every path of a user, by mouse and by keyboard.

Of every page: no error on the console, no request beyond 127.0.0.1, and no fault that axe finds.
The tests share one server, which keeps the measurements of those before: choose them by name.
"""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from tests.support.browser import IN_A_BROWSER, SMALL, TARGET_PX, Visit, serving, until, when_done
from tests.support.layout import check_layout
from tests.support.made import write_small_capture
from tests.support.web_site import PAPER, write_results, write_turned
from wheelplane.batch.operation.run_state import RunState, write_state
from wheelplane.batch.storage.store import open_store
from wheelplane.web.server import write_opening

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the page may open: a capture, five points, results of a batch, and hostile names."""
    place = tmp_path_factory.mktemp("allowed")
    write_small_capture(place / "capture")
    (place / "coarse.toml").unlink()
    (place / "figure-4.txt").write_bytes(PAPER.read_bytes())
    (place / "survey.txt").write_bytes((place / "capture" / "five-point.txt").read_bytes())
    rows = PAPER.read_text().splitlines()
    rows[16] = "1.0 2.0 <img src=x onerror=alert(1)>"
    (place / "bad.txt").write_text("\n".join(rows))
    (place / "<img src=x onerror=alert(1)>.txt").write_bytes(PAPER.read_bytes())
    return place


@pytest.mark.parametrize(
    "visit",
    [
        {"viewport": {"width": width, "height": 844}, "locale": language}
        for width in (390, 1024, 1440)
        for language in ("en-GB", "pt-PT")
    ],
    indirect=True,
)
def test_angles_are_whole_on_every_screen(visit):
    visit.open()
    page = visit.measure("capture")
    page.wait_for_timeout(300)
    check_layout(page, "table.angles")


def test_the_watch_sees_errors_and_foreign_requests(browser, address):
    """So that the absence of faults elsewhere means something."""
    visit = Visit(browser, address)
    page = visit.open()
    page.evaluate("fetch('http://127.0.0.2:9/').catch(() => 0)")
    page.evaluate("setTimeout(() => { throw new Error('made') })")
    page.evaluate("console.error('told')")
    page.wait_for_timeout(300)
    text = "\n".join(visit.faults)
    for part in ("error: made", "error: told", "Content Security Policy"):
        assert part in text
    visit.context.close()


def test_without_the_token_the_page_is_shut(visit):
    visit.refusal = 403
    page = visit.page
    for address in (visit.address, visit.printed.partition("#")[0], f"{visit.printed}x"):
        page.goto("about:blank")
        page.goto(address)
        page.wait_for_selector("#shut:not([hidden])")
        assert "the complete address" in page.locator("#shut").inner_text()
        assert page.evaluate("location.hash") == ""
        assert visit.context.cookies() == []
        visit.check_with_axe()
    page.evaluate("token => { location.hash = token }", visit.printed.partition("#")[2])
    page.wait_for_selector(".items")  # pasted into the shut page
    assert page.url == visit.address


def test_the_token_is_exchanged_for_a_cookie_and_seen_no_more(visit):
    page = visit.open("open=0/figure-4.txt")
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert page.url.startswith(f"{visit.address}#result=")
    (cookie,) = (c for c in visit.context.cookies() if c["name"] != "wheelplane-language")
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
    assert cookie["value"] not in visit.printed
    page.goto(visit.address)
    page.wait_for_selector(".items")
    assert visit.printed.partition("token=")[2].partition("&")[0] not in page.content()


def test_the_file_that_the_browser_opens_leads_to_the_page(browser, address, tmp_path):
    opening = write_opening(tmp_path, f"{address}&open=0/figure-4.txt")
    visit = Visit(browser, address)
    visit.known = ("file://", *visit.known)
    visit.page.goto(opening.as_uri())
    visit.page.wait_for_selector("#result:not([hidden]) table.angles")
    visit.context.close()
    assert visit.faults == []


@pytest.mark.parametrize(
    "visit",
    [{"viewport": {"width": 1280, "height": 800}}, {"viewport": {"width": 820, "height": 1180}}],
    indirect=True,
)
def test_load_look_and_save(visit, folder):
    page = visit.open()
    page.wait_for_selector(".items")
    visit.check_with_axe()
    visit.measure("capture")
    assert page.locator("#steps [aria-current]").inner_text().split() == ["2", "View"]
    rows = page.locator("table.angles tbody tr")
    assert rows.count() == 5
    assert rows.nth(0).inner_text().startswith("RR")
    assert "°" in rows.nth(0).inner_text()

    until(page, "/^[0-9,]+ of .* points/.test(document.querySelector('.w3d-count').textContent)")
    rows.nth(2).locator("button").click()
    assert page.locator(".evidence h2").inner_text() == "Details of FR"
    until(page, "[...document.querySelectorAll('.evidence img')].every(i => i.complete)")
    assert page.evaluate("document.querySelectorAll('.evidence img').length") == 3
    assert page.evaluate(
        "[...document.querySelectorAll('.evidence img')].every(i => i.naturalWidth)"
    )
    visit.check_with_axe()

    label = page.locator("button.w3d-label").first  # of RR, in the picture
    assert "'" in label.text_content()
    page.select_option("select[name=style]", "deg")
    assert page.locator("table.angles tbody tr").nth(0).inner_text().count("°") == 7
    in_degrees = label.text_content()
    assert in_degrees.startswith("RR")
    assert (in_degrees.count("°"), "'" in in_degrees) == (2, False)
    axis = page.locator("select[name=axis]")
    page.select_option("select[name=convention]", "iso-8855")
    assert axis.input_value() == "centreline"
    page.select_option("select[name=axis]", "thrust-line")
    assert label.text_content() != in_degrees
    page.select_option("select[name=convention]", "german-workshop")
    assert axis.input_value() == "thrust-line"
    assert "Fahrachswinkel" in page.locator("#result").inner_text()

    name = f"report {page.viewport_size['width']}"
    page.fill(".save input[name=name]", name)
    page.get_by_role("button", name="Save in this folder").click()
    page.wait_for_selector(".status.good")
    saved = (folder / f"{name}.html").read_text()
    assert "Wheelplane3D" in saved
    visit.refusal = 409
    page.get_by_role("button", name="Save in this folder").click()
    page.wait_for_selector(".status.bad")
    assert "choose another name" in page.locator(".save + .status").inner_text()
    assert page.locator("#steps [aria-current]").inner_text().split() == ["3", "Save"]


def test_the_report_opens_and_downloads(visit):
    page = visit.open()
    visit.measure("figure-4.txt")
    with visit.context.expect_page() as opened:
        page.get_by_role("button", name="Open the report").click()
    report = opened.value
    report.wait_for_selector("canvas")
    report.close()
    page.select_option(".save select[name=format]", "txt")
    with page.expect_download() as loaded:
        page.get_by_role("button", name="Download").click()
    assert loaded.value.suggested_filename == "figure-4.txt"
    assert Path(loaded.value.path()).read_bytes().startswith(b"wheelplane ")


def test_the_picture_answers_mouse_keys_and_wheel(visit):
    page = visit.open()
    visit.measure("figure-4.txt")
    canvas = page.locator(".w3d canvas")
    before = canvas.screenshot()
    page.get_by_role("button", name="above").click()
    page.wait_for_timeout(700)
    above = canvas.screenshot()
    assert above != before
    canvas.focus()
    for key in ("ArrowLeft", "ArrowUp", "+", "-", "+"):
        page.keyboard.press(key)
    page.wait_for_timeout(300)
    turned = canvas.screenshot()
    assert turned != above
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 240, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert canvas.screenshot() != turned
    canvas.focus()
    page.keyboard.press("Home")
    page.wait_for_timeout(700)
    page.get_by_label("labels").uncheck()
    assert page.locator(".w3d-label:visible").count() == 0
    page.get_by_label("labels").check()
    page.locator("button.w3d-label", has_text="FL").click()
    assert page.locator(".evidence h2").inner_text() == "Details of FL"
    assert page.locator("table.angles tr.chosen").inner_text().startswith("FL")


def crowd():
    """A scene of twenty scans of four wheels, as of wheels that were steered and turned."""
    corners = {"RR": (0, -0.8), "RL": (0, 0.8), "FR": (2.7, -0.8), "FL": (2.7, 0.8)}
    scans = [(wheel, wheel, "reference") for wheel in corners]
    scans += [(f"{wheel} steered {i}", wheel, "trial") for wheel in ("FR", "FL") for i in range(5)]
    scans += [(str(i), "RL", "trial") for i in range(6)]
    wheels = []
    for i, (name, wheel, role) in enumerate(scans):
        x, y = corners[wheel]
        reported = {
            "name": name,
            "role": role,
            "wheel": wheel,
            "status": "ok",
            "colour_class": role,
        }
        reported |= {"centre": [x, y + 1e-4 * i, 0.3], "normal": [0, 1 if y > 0 else -1, 0]}
        wheels.append(
            reported | {"outline": [], "toe_text": "+0° 10' 0\"", "camber_text": "-0° 30' 0\""}
        )
    ends = {"forward": [0.5, 0, 0], "left": [0, 0.5, 0], "up": [0, 0, 0.5]}
    axes = [{"name": n, "layer": "axes", "from": [0, 0, 0], "to": to} for n, to in ends.items()]
    return {"schema": "wheelplane/scene/1", "wheels": wheels, "lines": axes, "cloud": None}


BOXES = """() => {
  const box = ({ left, top, right, bottom }) => [left, top, right, bottom];
  const all = (name) => [...document.querySelectorAll(`#crowd ${name}`)];
  return Object.fromEntries(["button.w3d-label", "span.w3d-label", ".w3d-bar", ".w3d"]
    .map((name) => [name, all(name).filter((one) => !one.hidden)
      .map((one) => box(one.getBoundingClientRect()))]));
}"""


def covered(found):
    """Pairs of labels and bars that lie on one another."""
    taken = [*found["button.w3d-label"], *found["span.w3d-label"], *found[".w3d-bar"]]
    return [
        (one, other)
        for i, one in enumerate(taken)
        for other in taken[:i]
        if all(min(one[a + 2], other[a + 2]) > max(one[a], other[a]) for a in (0, 1))
    ]


@pytest.mark.parametrize(
    "visit", [{"viewport": SMALL}, {"viewport": {"width": 480, "height": 900}}], indirect=True
)
def test_labels_of_many_scans_leave_one_another_room(visit):
    page = visit.open()
    page.wait_for_selector(".items")
    mount = """scene => {
      const place = Object.assign(document.createElement("div"), { id: "crowd" });
      place.style.height = "480px";
      document.querySelector("main").prepend(place);
      window.crowd = Wheelplane3D.mount(place, scene);
    }"""
    page.evaluate(mount, crowd())
    left = 13  # of 20: labels of targets that are seen from behind are hidden
    acts = {"look('iso')": left, "mark('FL steered 2')": left, "look('left')": left}
    acts |= {"look('front')": 20, "mark('RR')": 20}
    for act, most in acts.items():
        page.evaluate(f"window.crowd.{act}")
        for _ in range(100):  # software draws slowly
            page.wait_for_timeout(100)
            found = page.evaluate(BOXES)
            counted = len(found["button.w3d-label"]) == most or page.viewport_size != SMALL
            if counted and not covered(found):
                break
        assert counted, (act, len(found["button.w3d-label"]))
        assert covered(found) == [], act
        buttons, (whole,) = found["button.w3d-label"], found[".w3d"]
        assert len(buttons) >= 10
        for left, top, right, bottom in buttons:
            assert min(right - left, bottom - top) >= TARGET_PX
            assert left >= whole[0]
            assert top >= whole[1]
            assert right <= whole[2]
            assert bottom <= whole[3]
    visit.check_with_axe()


def test_a_wheel_is_chosen_in_the_picture(visit):
    """A click at the middle of the picture, once the view faces that wheel."""
    page = visit.open()
    visit.measure("figure-4.txt")
    page.locator("table.angles tbody tr").nth(1).locator("button").click()
    page.locator(".evidence button", has_text="3D view").click()
    page.wait_for_timeout(800)
    page.locator("table.angles tbody tr").nth(0).locator("button").click()
    page.get_by_label("labels").uncheck()
    box = page.locator(".w3d canvas").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2 + 25)
    chosen = page.locator(".evidence h2").inner_text().removeprefix("Details of ")
    assert chosen in ("RL", "1", "2")  # the trials stand on RL


def test_a_structure_error_is_shown_at_its_line(visit):
    page = visit.open()
    page.locator("#browser button", has_text="bad.txt").click()
    page.wait_for_selector("#trouble:not([hidden])")
    text = page.locator("#trouble").inner_text()
    assert "line 17" in text
    assert page.locator("#trouble tr.wrong").inner_text() == (
        "17\t1.0 2.0 <img src=x onerror=alert(1)>"
    )
    assert page.evaluate("document.activeElement.id") == "trouble"
    assert page.locator("#load").is_visible()  # to try again at once
    visit.check_with_axe()


def test_names_that_hold_script_stay_text(visit):
    page = visit.open()
    visit.measure("<img src=x")
    assert page.locator("#result-title").inner_text() == "<img src=x onerror=alert(1)>.txt"
    assert page.locator("#result img[src=x]").count() == 0
    with visit.context.expect_page() as opened:
        page.get_by_role("button", name="Open the report").click()
    opened.value.wait_for_selector("canvas")
    opened.value.close()


def test_files_are_chosen_or_dropped(visit, folder):
    page = visit.open()
    page.set_input_files("#files", str(PAPER))
    page.wait_for_selector("#result:not([hidden])")
    assert page.locator("table.angles tbody tr").count() == 8
    page.get_by_role("button", name="Measure another").click()
    scans = [p for p in (folder / "capture").iterdir() if p.suffix in (".ply", ".toml")]
    files = [[path.name, path.read_bytes().hex()] for path in scans]
    page.evaluate(
        """files => {
          const held = new DataTransfer();
          for (const [name, hex] of files) {
            const bytes = Uint8Array.from(hex.match(/../g) ?? [], (pair) => parseInt(pair, 16));
            held.items.add(new File([bytes], name));
          }
          for (const type of ["dragover", "drop"])
            window.dispatchEvent(new DragEvent(type, { dataTransfer: held, cancelable: true }));
        }""",
        files,
    )
    page.wait_for_selector("#result:not([hidden])")
    assert page.locator("table.angles tbody tr").count() == 5
    page.get_by_role("button", name="Measure another").click()
    page.set_input_files("#files", {"name": "a.exe", "mimeType": "x/y", "buffer": b"MZ"})
    page.wait_for_selector("#trouble:not([hidden])")


SLOW_START = """const own = fetch;
window.fetch = async (...given) => {
  if (given[0] === "/api/measure") await new Promise((resolve) => setTimeout(resolve, 700));
  return own(...given);
};"""


@pytest.mark.parametrize("script", ["", SLOW_START], ids=["running", "not yet begun"])
def test_measuring_can_be_cancelled(visit, script):
    visit.context.add_init_script(script)
    page = visit.open()
    page.locator("#browser button", has_text="capture").first.click()
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_selector("#trouble:not([hidden])")
    assert page.locator("#trouble").inner_text() == "Cancelled; nothing was saved."
    assert "trouble" not in page.locator("#trouble").get_attribute("class").split()


def test_options_are_asked_before_a_long_upload(visit, tmp_path):
    large = tmp_path / "large.ply"
    with large.open("wb") as stream:
        stream.truncate(60_000_000)
    page = visit.open()
    page.wait_for_selector("#browser .items")
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.set_input_files("#files", str(large))
    page.wait_for_selector("#ask")
    assert "large.ply, 60 MB" in page.locator("#ask").inner_text()
    assert page.evaluate("document.activeElement.name") == "target"
    visit.check_with_axe()
    assert not any("uploads" in url for url in asked)
    page.locator("#ask button", has_text="Upload").click()
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_selector("#trouble:not([hidden])")
    assert "Cancelled" in page.locator("#trouble").inner_text()
    assert any("uploads" in url for url in asked)


def test_a_name_that_is_used_twice_gets_its_time(visit):
    page = visit.open()
    for _ in range(2):
        page.wait_for_selector("#browser .items")
        page.locator("#browser button", has_text="survey.txt").click()
        page.wait_for_selector("#result:not([hidden]) table.angles")
        page.get_by_role("button", name="Measure another").click()
    names = page.locator("#before button .name", has_text="survey.txt").all_inner_texts()
    assert len(names) == len(set(names)) >= 2
    assert all(re.fullmatch(r"survey.txt, \d\d:\d\d:\d\d", name) for name in names)


def test_a_capture_is_compared_with_its_five_points(visit):
    page = visit.open()
    visit.measure("capture")
    page.get_by_role("button", name="Measure another").click()
    visit.measure("survey.txt")
    page.locator("nav a", has_text="Compare").click()
    for which, name in (("first", "capture"), ("second", "survey.txt")):  # others may be later
        menu = f"#compare select[name={which}]"
        option = page.locator(f"{menu} option", has_text=name).first
        page.select_option(menu, option.get_attribute("value"))
    page.get_by_role("button", name="Compare").click()
    page.wait_for_selector("#compare .verdict")
    assert page.locator("#compare .verdict").inner_text() == "They agree within their uncertainties"
    assert page.locator("table.compared tbody tr").count() == 10
    visit.check_with_axe()


def test_an_archive_is_browsed(visit, folder):
    write_turned(folder / "results")
    page = visit.open()
    page.locator("nav a", has_text="Archive").click()
    page.locator("#archive .items button", has_text="results").click()
    page.wait_for_selector("#archive table")
    assert page.locator("#archive tbody tr").count() == 12
    visit.check_with_axe()
    page.fill("#archive input[name=text]", "car-03")
    page.get_by_role("button", name="Show").click()
    until(page, "document.querySelectorAll('#archive tbody tr').length === 1")
    page.get_by_role("button", name="2026/car-03").click()
    page.wait_for_selector("#archive h2")
    until(page, "document.querySelectorAll('#archive table').length === 4")  # and what changed
    assert "car-00" in page.locator("#archive select[name=earlier]").inner_text()
    visit.check_with_axe()
    page.get_by_role("link", name="Open with 3D view and report").click()
    page.wait_for_selector("#result:not([hidden]) table.angles")
    assert page.locator(".w3d canvas").is_visible()
    page.go_back()
    page.wait_for_selector("#archive h2")
    page.fill("#archive input[name=text]", "")
    page.get_by_role("button", name="Show").click()
    page.get_by_role("button", name="Failures").click()
    until(page, "document.querySelector('#archive table').innerText.includes('<b>')")
    page.get_by_role("button", name="Trends").click()
    page.get_by_role("button", name="RR toe").click()
    until(page, "document.querySelector('img.trend')?.naturalWidth > 0")
    visit.check_with_axe()
    store, now_s = open_store(str(folder / "results")), time.time()
    state = RunState("node1, process 7", "1/1", now_s - 100.0, now_s, 0, 12)
    state.done, state.failures = {"failed": 1}, {"failed, read: no points": 1}
    write_state(store, "a", state)
    page.get_by_role("button", name="Runs").click()
    until(page, "document.querySelector('.run.up')?.innerText.includes('11')")
    visit.check_with_axe()
    state.done = {"failed": 1, "ok": 4}
    write_state(store, "a", state)
    until(page, "document.querySelector('.run.up').innerText.includes('4 measured')")  # by itself
    page.locator(".run tbody button").click()
    until(page, "document.querySelectorAll('#archive tbody tr').length === 1")
    assert page.locator("#archive select[name=status]").input_value() == "failed"
    page.locator("#archive tbody button").click()
    page.wait_for_selector("#archive .facts")
    visit.check_with_axe()


def test_a_folder_that_is_allowed_is_itself_opened(browser, folder, tmp_path):
    with serving(folder / "capture", tmp_path) as address:
        visit = Visit(browser, address)
        page = visit.open("open=0/")
        page.wait_for_selector("#result:not([hidden]) table.angles")
        assert page.locator("#result-title").inner_text() == "capture"
        tree = page.evaluate("fetch('/api/jobs').then(a => a.json())")["jobs"][0]
        assert tree["name"] == "capture"
        record = f"/api/jobs/{tree['id']}/measurement.json"
        results = write_results(
            tmp_path / "results", page.evaluate(f"fetch('{record}').then(a => a.json())")
        )
        visit.context.close()
    assert visit.faults == []
    with serving(results, tmp_path) as address:
        visit = Visit(browser, address)
        page = visit.open("archive=0/")
        page.wait_for_selector("#archive table")
        assert page.locator("#archive tbody tr").count() == 12
        visit.context.close()
    assert visit.faults == []


def test_while_too_many_wait_the_page_asks_again(visit):
    visit.refusal, asked = 503, []

    def refuse_once(route):
        asked.append(route.request.post_data)
        if len(asked) > 1:
            route.continue_()
        else:
            route.fulfill(status=503, json={"error": "2 jobs are waiting: wait for one to end"})

    visit.context.route("**/api/measure", refuse_once)
    page = visit.open()
    visit.measure("figure-4.txt")
    assert page.locator("#trouble").is_hidden()
    assert asked == asked[:1] * 2


def test_angles_whose_points_are_lost_are_shown_with_the_reason(visit):
    reported = []

    def lose_points(job):
        reported.append(job)
        return {"state": "ready"} if len(reported) == 1 else {"note": "rr.ply: it is gone"}

    visit.context.route("**/api/jobs/*", when_done(lose_points))
    page = visit.open()
    page.wait_for_selector("#browser .items")
    page.locator("#browser button", has_text="capture").first.click()
    until(
        page, "document.querySelector('.look .small')?.textContent.includes('rr.ply: it is gone')"
    )
    assert page.locator("table.angles tbody tr").count() == 5
    assert page.locator(".look .small").inner_text().startswith("The 3D view shows a sample")
    assert " points of the scans" in page.locator(".w3d-count").inner_text()


def test_the_manual_opens(visit):
    page = visit.open()
    with visit.context.expect_page() as opened:
        page.locator("nav a", has_text="Manual").click()
    manual = opened.value
    manual.wait_for_selector("h1")
    assert manual.url == f"{visit.address}manual/"
    manual.close()


def test_the_language_is_switched_and_kept(visit):
    page = visit.open()
    visit.measure("figure-4.txt")
    page.select_option("#language", "pt")
    page.wait_for_selector("text=Carregar")
    page.wait_for_selector("#result:not([hidden])")  # which stays
    assert page.evaluate("document.documentElement.lang") == "pt"
    assert "sopé" in page.locator("table.angles thead").inner_text()
    assert "sopé" in page.locator(".w3d-labels").inner_text()
    visit.check_with_axe()


def test_everything_is_reached_by_keyboard(visit):
    page = visit.open()
    page.wait_for_selector(".items")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    seen = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reported = page.evaluate("document.activeElement.innerText || document.activeElement.id")
        seen.add(reported.split("\n")[0])
        if reported.startswith("figure-4.txt"):
            page.keyboard.press("Enter")
            break
    assert {"Measure", "Compare", "Archive", "Manual", "Choose files …"} <= seen
    page.wait_for_selector("#result:not([hidden])")
    assert page.evaluate("document.activeElement.id") == "result-title"
    for _ in range(30):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.innerText") == "FR":
            break
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline == "solid"  # where one is can be seen
    page.keyboard.press("Enter")
    assert page.locator(".evidence h2").inner_text() == "Details of FR"


def test_a_server_that_is_gone_is_reported(browser, address):
    visit = Visit(browser, address)
    page = visit.open()
    page.wait_for_selector(".items")
    visit.context.set_offline(True)
    page.locator("#browser button", has_text="figure-4.txt").click()
    page.wait_for_selector("#trouble:not([hidden])")
    assert "does not respond" in page.locator("#trouble").inner_text()
    visit.context.close()


def test_without_webgl_a_sentence_stands_in_its_place(browser, address):
    visit = Visit(browser, address)
    visit.context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = visit.open()
    visit.measure("figure-4.txt")
    assert "needs WebGL" in page.locator(".stage").inner_text()
    page.locator("table.angles tbody tr").nth(0).locator("button").click()
    assert page.locator(".evidence h2").inner_text() == "Details of RR"
    visit.context.close()
    assert visit.faults == []
