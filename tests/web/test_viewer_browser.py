"""The 3D view in a real browser: what a user clicks, and what he then sees."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from tests.support.browser import IN_A_BROWSER, when_done
from tests.support.made import with_dense_tyre, write_small_capture

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("allowed")
    with_dense_tyre(write_small_capture(place / "car"), 30)
    return place


def shown(visit):
    """The page with the measured capture and all its points."""
    visit.open()
    page = visit.measure("car")
    settled(page)
    page.wait_for_timeout(700)
    return page


def counts(page):
    """Numbers of points: shown, in view, at the vehicle, in the scans; two of a sample."""
    text = page.locator(".w3d-count").inner_text()
    return [int(number(part)) for part in re.findall(r"[\d,]+", text)]


def settled(page):
    """Wait until all points are there, and as many are shown as the view takes."""
    page.wait_for_selector(".w3d-count:not([hidden])")
    before, same = None, 0
    for _ in range(600):
        now = counts(page)
        same = same + 1 if now == before and len(now) == 4 else 0
        if same == 8:
            return now
        before = now
        page.wait_for_timeout(100)
    raise AssertionError(f"it does not settle: {now}")


def scene_of(page):
    return page.evaluate(
        "async () => (await fetch(`/api/jobs/${location.hash.split('=')[1]}/scene-en.json`)).json()"
    )


def colours(page):
    """Number of pixels of each colour of the picture, in steps of 32."""
    import io

    from PIL import Image

    page.wait_for_timeout(500)
    picture = Image.open(io.BytesIO(page.locator(".w3d canvas").screenshot())).convert("RGB")
    steps, counts = np.unique(np.asarray(picture).reshape(-1, 3) // 32, axis=0, return_counts=True)
    return {tuple(int(x) for x in step): int(n) for step, n in zip(steps, counts, strict=True)}


def eventually(page, seen, wanted):
    """Wait until seen() is that; software draws slowly."""
    for _ in range(100):
        if seen() == wanted:
            return
        page.wait_for_timeout(100)
    assert seen() == wanted


def labels_of(page):
    return lambda: sorted(page.locator("button.w3d-label:visible b").all_inner_texts())


def apart(one, other):
    """Number of pixels whose colour is another."""
    return sum(abs(one.get(c, 0) - other.get(c, 0)) for c in {*one, *other})


def number(text):
    return float(text.replace(",", "").replace("\u2212", "-"))


@pytest.mark.parametrize(
    "visit",
    [{"viewport": {"width": w, "height": h}} for w, h in ((390, 844), (1024, 768), (1440, 900))],
    indirect=True,
)
def test_every_tool_fits_on_every_screen(visit):
    page = shown(visit)
    page.get_by_role("button", name="tools").click()
    page.locator("select[name=colour]").select_option("residual")
    page.locator("select[name=section]").select_option("y")
    width = page.viewport_size["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    stage = page.locator(".w3d").bounding_box()
    panel = page.locator(".w3d-panel").bounding_box()
    assert panel["x"] >= stage["x"]
    assert panel["x"] + panel["width"] <= stage["x"] + stage["width"]
    assert panel["y"] + panel["height"] <= stage["y"] + stage["height"]
    for name in ("colour", "section", "ruler-from", "ruler-vertex"):
        page.locator(f"select[name={name}]").focus()
        box = page.locator(f"select[name={name}]").bounding_box()
        assert box["y"] + box["height"] <= stage["y"] + stage["height"] + 1, name
    visit.check_with_axe()


@pytest.mark.parametrize("visit", [{"viewport": {"width": 1440, "height": 900}}], indirect=True)
def test_the_stage_and_the_angles_are_above_the_fold(visit):
    page = shown(visit)
    for place in (".w3d", "table.angles"):
        box = page.locator(place).bounding_box()
        assert box["y"] >= 0
        assert box["y"] + box["height"] <= 900, place


def test_it_says_how_many_of_how_many_points(visit):
    page = shown(visit)
    found = counts(page)
    assert 100_000 < found[0] <= found[1] <= found[2] <= found[3]
    page.select_option("#language", "pt")
    eventually(page, lambda: "junto ao veículo" in page.locator(".w3d-count").inner_text(), True)


def measured_anew(page):
    page.locator("#browser button", has_text="car").first.click()
    page.wait_for_selector(".w3d-count:not([hidden])")


def test_a_sample_is_shown_at_once_and_all_points_when_they_are_sorted(visit):
    """The measuring process says so; the sample stays where it cannot."""
    states = iter(["ready"] * 3)

    def hold(_):
        progress = {"done": 40, "total": 100, "text": "points"}
        return {"state": next(states, "done"), "progress": progress}

    visit.context.route("**/api/jobs/*", when_done(hold))
    page = visit.open()
    measured_anew(page)
    sample, total = counts(page)
    assert 0 < sample <= 100_000 < total
    said = page.locator(".look .small")
    eventually(page, lambda: "are being sorted: 40 %" in said.inner_text(), True)
    found = settled(page)
    assert sample < found[0]
    assert found[3] == total
    assert said.inner_text() == ""
    visit.check_with_axe()


def test_sorting_can_be_cancelled_and_the_sample_stays(visit):
    asked = []

    def hold(_):
        cancelled = any(url.endswith("/cancel") for url in asked)
        return {"note": "cancelled"} if cancelled else {"state": "ready"}

    visit.context.route("**/api/jobs/*", when_done(hold))
    page = visit.open()
    page.on("request", lambda request: asked.append(request.url))
    measured_anew(page)
    page.locator(".look .small button", has_text="Cancel").click()
    said = page.locator(".look .small")
    eventually(page, said.inner_text, "The 3D view shows a sample of the points: cancelled")
    assert len(counts(page)) == 2
    assert not any("points." in url for url in asked)


def test_zooming_onto_a_wheel_shows_every_point_there(visit):
    """Nodes are loaded as the view needs them: all of a wheel near by, not all from afar."""
    visit.open()
    page = visit.measure("dense")
    settled(page)
    page.locator(".w3d canvas").focus()
    for _ in range(10):
        page.keyboard.press("-")
    far = settled(page)
    assert far[0] < far[1] == far[2]
    page.locator("table.angles tbody tr").nth(3).locator("button").click()
    page.locator(".evidence button", has_text="3D view").click()
    eventually(page, lambda: counts(page)[1] < far[1], True)
    eventually(page, lambda: len(set(counts(page)[:2])), 1)
    near = settled(page)
    assert near[0] == near[1] < far[1]
    assert near[0] > 0.1 * near[2]
    assert far[2:] == near[2:]


def test_points_are_coloured_with_a_scale(visit):
    page = shown(visit)
    page.get_by_role("button", name="tools").click()
    scale = page.locator(".w3d-scale")
    assert not scale.is_visible()
    page.get_by_label("labels", exact=True).uncheck()
    seen = {}
    for colour, said in (
        ("kind", None),
        ("residual", "Distance from the target's plane, mm: -2.50, 0.00, 2.50"),
        ("intensity", "Intensity, as the file states it: "),
        ("scan", None),
        ("height", "Height above the rear centres, m: -"),
    ):
        page.locator("select[name=colour]").select_option(colour)
        seen[colour] = colours(page)
        assert scale.is_visible() == (said is not None)
        if said:
            assert scale.get_attribute("aria-label").startswith(said)
    for one in seen:
        for other in seen:
            if one < other:
                assert apart(seen[one], seen[other]) > 1500, (one, other)


def test_a_scan_is_hidden_by_its_tick(visit):
    page = shown(visit)
    page.get_by_role("button", name="tools").click()
    ticks = page.locator(".w3d-panel fieldset").first.locator("input")
    assert ticks.count() == 5
    whole = colours(page)
    ticks.nth(3).focus()
    page.keyboard.press("Space")
    hidden = colours(page)
    assert apart(whole, hidden) > 1500
    page.keyboard.press("Space")
    eventually(page, lambda: apart(colours(page), whole) < 0.2 * apart(hidden, whole), True)


def test_maps_of_the_targets_are_switched_on(visit):
    page = shown(visit)
    page.locator("table.angles tbody tr").nth(3).locator("button").click()
    page.locator(".evidence button", has_text="3D view").click()
    page.get_by_label("labels", exact=True).uncheck()
    page.get_by_label("normals").uncheck()
    page.wait_for_timeout(600)
    before = colours(page)
    page.get_by_label("deviation maps").check()
    after = colours(page)
    assert apart(before, after) > 5000
    label = page.locator(".w3d-scale").get_attribute("aria-label")
    said = re.fullmatch(
        r"Deviation from the plane, mm \(mean over (\d+) mm, u = ([\d.]+) mm\): .*", label
    )
    assert 10 <= number(said[1]) <= 38
    assert 0 < number(said[2]) < 0.1
    page.get_by_label("deviation maps").uncheck()
    assert not page.locator(".w3d-scale").is_visible()


def test_a_section_leaves_out_what_lies_beyond_it(visit):
    page = shown(visit)
    page.get_by_role("button", name="tools").click()
    labels = labels_of(page)
    eventually(page, labels, ["FL", "RL"])
    page.locator("select[name=section]").select_option("x")
    eventually(page, labels, ["RL"])
    page.get_by_label("other side").check()
    eventually(page, labels, ["FL"])
    slider = page.get_by_label("Position of the section")
    slider.focus()
    where = number(page.locator(".w3d-panel output").inner_text().removesuffix(" m"))
    page.keyboard.press("ArrowRight")
    moved = number(page.locator(".w3d-panel output").inner_text().removesuffix(" m"))
    assert 0.0 < moved - where < 0.03
    page.keyboard.press("Home")
    eventually(page, labels, ["FL", "RL"])


def said(page):
    return page.locator(".w3d-said").inner_text()


def test_distances_and_angles_by_keyboard(visit):
    """Against centres and normals of the scene, which its own tests hold to the truth."""
    page = shown(visit)
    wheels = {wheel["name"]: wheel for wheel in scene_of(page)["wheels"]}
    page.get_by_role("button", name="tools").focus()
    page.keyboard.press("Enter")
    first, second, vertex = (
        page.locator(f"select[name=ruler-{name}]") for name in ("from", "to", "vertex")
    )
    first.focus()
    page.keyboard.press("ArrowDown")  # the centre of RR
    assert first.input_value() == "centre-RR"
    second.select_option("centre-FL")
    way = np.subtract(wheels["FL"]["centre"], wheels["RR"]["centre"])
    text = said(page)
    assert f"Distance: {1e3 * np.linalg.norm(way):,.2f} mm" in text
    assert f"x {1e3 * way[0]:,.2f} mm" in text
    second.select_option("plane-FL")
    off = abs(way @ wheels["FL"]["normal"])
    assert said(page) == f"Distance from the plane: {1e3 * off:,.2f} mm"
    first.select_option("frame-y")
    _, y, _ = np.abs(wheels["FL"]["normal"]) / np.linalg.norm(wheels["FL"]["normal"])
    assert f"({math.degrees(math.acos(y)):.4f}°)" in said(page)
    first.select_option("centre-RL")
    second.select_option("centre-FL")
    vertex.select_option("centre-RR")
    one, other = (np.subtract(wheels[n]["centre"], wheels["RR"]["centre"]) for n in ("RL", "FL"))
    angle = math.degrees(math.atan2(np.linalg.norm(np.cross(one, other)), one @ other))
    assert f"({angle:.4f}°)" in said(page)


def test_the_pointer_takes_centres_planes_and_points(visit):
    page = shown(visit)
    page.locator("table.angles tbody tr").nth(3).locator("button").click()
    page.locator(".evidence button", has_text="3D view").click()
    page.wait_for_timeout(900)
    page.get_by_role("button", name="tools").click()
    page.get_by_label("labels", exact=True).uncheck()
    box = page.locator(".w3d canvas").bounding_box()
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    first, second = (page.locator(f"select[name=ruler-{name}]") for name in ("from", "to"))
    page.mouse.click(*middle)
    assert first.input_value() == "centre-FL"
    assert page.locator(".evidence h2").inner_text() == "Details of FL"
    metre = box["height"] / 2 / math.tan(math.radians(17.5)) / 1.6 / 1.01  # pixels, at the target
    page.mouse.click(middle[0] - 0.08 * metre, middle[1])
    assert second.input_value() == "plane-FL"
    assert said(page) == "Distance from the plane: 0.00 mm"
    for dx in (-0.19, -0.21, -0.23, -0.25):  # the wheel beside the target
        page.mouse.click(middle[0] + dx * metre, middle[1])
    assert {first.input_value(), second.input_value()} == {"point-0", "point-1"}
    between = number(re.search(r"Distance: ([\d,.]+) mm", said(page))[1])
    assert 5.0 < between < 200.0


OVERLAPS = """() => {
  const boxOf = (places) => {
    const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
    const [left, right] = [Math.min(...xs), Math.max(...xs)];
    return { left, right, top: Math.min(...ys), bottom: Math.max(...ys) };
  };
  const { left, top } = document.getElementById("bare").getBoundingClientRect();
  const labels = [...document.querySelectorAll("#bare .w3d-label")].filter((one) => !one.hidden)
    .map((one) => ({ name: one.textContent, box: one.getBoundingClientRect() }));
  return labels.flatMap(({ name, box }) => window.scene.wheels.filter((wheel) => {
    const plate = boxOf(wheel.outline[0].map((place) => window.bare.screenOf(place)));
    return box.left - left < plate.right - 2 && box.right - left > plate.left + 2
      && box.top - top < plate.bottom - 2 && box.bottom - top > plate.top + 2;
  }).map((wheel) => `${name} covers ${wheel.name}`));
}"""


def test_labels_lie_beside_targets_and_not_behind_them(visit):
    page = visit.open()
    visit.measure("car")
    mount = """scene => {
      const place = Object.assign(document.createElement("div"), { id: "bare" });
      place.style.height = "480px";
      document.querySelector("main").prepend(place);
      document.getElementById("result").hidden = true;
      const wheels = scene.wheels.filter((one) => one.role === "reference");
      window.scene = { ...scene, cloud: null, wheels };
      window.bare = Wheelplane3D.mount(place, window.scene);
    }"""
    page.evaluate(mount, scene_of(page))
    seen = lambda: sorted(page.locator("#bare button.w3d-label:visible b").all_inner_texts())  # noqa: E731
    views = {"right": ["FR", "RR"], "left": ["FL", "RL"], "iso": ["FL", "RL"]}
    for view, names in views.items():
        page.evaluate(f"window.bare.look('{view}')")
        eventually(page, seen, names)
        page.wait_for_timeout(800)
        assert page.evaluate(OVERLAPS) == [], view


def test_the_view_fills_the_screen(visit):
    page = shown(visit)
    button = page.get_by_role("button", name="full screen")
    button.click()
    pressed = lambda: button.get_attribute("aria-pressed")  # noqa: E731
    eventually(page, pressed, "true")
    assert page.evaluate("document.fullscreenElement?.className") == "w3d"
    button.focus()
    page.keyboard.press("Enter")
    eventually(page, pressed, "false")
    assert page.evaluate("document.fullscreenElement") is None
