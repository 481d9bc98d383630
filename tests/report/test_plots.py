"""Plots: every mark at the position of its value, as SVG, as PNG and as text."""

from __future__ import annotations

import itertools
import math
import re
import zlib
from dataclasses import replace
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from tests.support.reported import ANGLES, TURNS, lost, many, measured, off_m, renamed, scan
from wheelplane.measurement import by_kind, stated
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.records import Evidence
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.plots.angle_chart import angles_text
from wheelplane.report.plots.angles import angles_drawing, tick_text
from wheelplane.report.plots.budget import (
    BAR,
    COLOURS,
    HEAD,
    SWATCH,
    bars_drawing,
    wheel_budget,
)
from wheelplane.report.plots.drawing import (
    CircleMark,
    Dots,
    Drawing,
    Path,
    Raster,
    Text,
    png_of,
)
from wheelplane.report.plots.drawing_png import ZOOM, drawing_png
from wheelplane.report.plots.files import file_name, plot_files
from wheelplane.report.plots.frame import frame_drawing
from wheelplane.report.plots.residuals import LIMIT, USED, histogram_drawing, profile_drawing
from wheelplane.report.plots.target_face import OUTLINE, SIDE, coarseness, face_drawing
from wheelplane.report.plots.top_view import factor, top_drawing
from wheelplane.report.plots.validation import GREEN, Chart, ticks
from wheelplane.report.scene.scene import scene
from wheelplane.wheel import WheelProfile

EN = load_translations("en")
LIMITS = Tolerance.model_validate(
    {axle: {"toe": {"lower_deg": -0.5, "upper_deg": 0.5}} for axle in ("front", "rear")}
)


def wheel(name):
    return next(w for w in measured(1).wheels if w.observation.name == name)


def outlines(drawing):
    return [np.asarray(m.points) for m in drawing.marks if getattr(m, "stroke", "") == OUTLINE]


def decoded(png: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]


# --- residual maps ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ANGLES)
def test_the_outline_is_that_of_the_board_in_its_in_plane_rotation(name):
    """Up is up: a board rotated by t on the wheel has its corner rotated by t, from outside.

    The plane's own axes have another rotation, which must not matter.
    """
    result, face = wheel(name), wheel(name).observation.evidence.face
    square, *holes = outlines(face_drawing(result, measured(1).frame, EN))
    assert len(holes) == 4
    scale = SIDE / (2.0 * face.half_width_m)
    middle = square.mean(axis=0)
    edges = np.linalg.norm(np.diff(np.vstack([square, square[:1]]), axis=0), axis=1)
    np.testing.assert_allclose(edges, 0.3 * scale, rtol=1e-6)
    corner = (square[2] - middle) * [1.0, -1.0]  # y upwards
    angle = math.atan2(corner[1], corner[0]) - TURNS[name]
    quarter = math.pi / 2.0
    off = (angle - math.pi / 4.0) - quarter * round((angle - math.pi / 4.0) / quarter)
    assert (
        abs(off) < 0.003
    )  # u of the rotation is 0.3 mrad; without the rotation it fails by 0.1 or more


def test_the_raster_lies_under_the_outline():
    """Grey shows what lies behind the holes of the board, and nowhere on the board."""
    result = wheel("FR")
    drawing = face_drawing(result, measured(1).frame, EN)
    image = decoded(drawing_png(drawing)).astype(int)
    square, *holes = (edge * ZOOM for edge in outlines(drawing))
    grey = np.abs(image - 205).max(axis=2) < 4
    for hole in holes:
        x, y = hole.mean(axis=0).astype(int)
        assert grey[y - 8 : y + 9, x - 8 : x + 9].mean() > 0.5
    middle = square.mean(axis=0).astype(int)
    x, y = middle + np.array([60, 60])
    assert grey[y - 20 : y + 21, x - 20 : x + 21].mean() < 0.02


def test_points_in_front_are_red_and_points_behind_are_blue():
    result = wheel("RR")
    evidence = result.observation.evidence
    for sign, colour in ((1.0, 0), (-1.0, 2)):
        residual = np.full_like(evidence.face.residual_m, sign * 1.0)
        face = replace(evidence.face, residual_m=residual)
        observation = replace(result.observation, evidence=replace(evidence, face=face))
        drawing = face_drawing(replace(result, observation=observation), measured(1).frame, EN)
        raster = next(m for m in drawing.marks if isinstance(m, Raster))
        n = len(raster.pixels)
        assert raster.palette[raster.pixels[n // 2, n // 2]][colour] == 255
        assert raster.palette[raster.pixels[n // 2, n // 2]].sum() == 255


def test_without_a_target_there_is_no_picture():
    trial = lost().wheels[-1]
    assert face_drawing(trial, lost().frame, EN) is None
    assert histogram_drawing(trial, EN) is None


def test_pictures_get_coarser_the_more_there_are():
    sizes = [pictures * (240 // coarseness(pictures)) ** 2 for pictures in (1, 40, 41, 200, 1000)]
    assert coarseness(40) == 1
    assert max(sizes) <= 40 * 240**2
    assert [coarseness(n) for n in (1, 41, 200, 1000)] == sorted({1, 2, 3, 6})


# --- scales -------------------------------------------------------------------------------------


def test_dots_and_limits_are_at_their_values():
    """Toe -0.5 and +0.5 degrees set the scale; every dot by its share of the way between."""
    judged = assess(measured(1), LIMITS)
    drawing = angles_drawing(measured(1), judged, EN, "rear-axle")
    paths = [m for m in drawing.marks if isinstance(m, Path)]
    limits = sorted({round(p.points[0][0], 3) for p in paths if p.stroke == "#009E73"})
    assert len(limits) == 2
    dots = [(m.x, m.y) for m in drawing.marks if isinstance(m, CircleMark)]
    toes = dots[: len(ANGLES)]
    for dot, result in zip(toes, measured(1).wheels, strict=True):
        share = (math.degrees(result.angles.toe_rad) + 0.5) / 1.0
        assert dot[0] == pytest.approx(limits[0] + share * (limits[1] - limits[0]), abs=0.05)
    assert len(dots) == 2 * len(ANGLES)


@pytest.mark.parametrize(
    ("degrees", "text"),
    [
        (0, "0"),
        (1, "+1°"),
        (-1.5, "\N{MINUS SIGN}1°30'"),
        (1 / 60, "+1'"),
        (-0.005, "\N{MINUS SIGN}0.3'"),
    ],
)
def test_ticks_are_short(degrees, text):
    assert tick_text(math.radians(degrees)) == text


def test_the_text_plot_shows_value_interval_and_limits():
    text = angles_text(measured(1), assess(measured(1), LIMITS), EN, PAPER)
    rows = [line for line in text.split("\n") if "●" in line][: len(ANGLES)]
    start = min(row.index("[") for row in rows)
    wide = rows[0].index("]") - start
    for row, result in zip(rows, measured(1).wheels, strict=True):
        share = (math.degrees(result.angles.toe_rad) + 0.5) / 1.0
        assert abs(row.index("●") - start - share * wide) <= 1.0
        assert row.split()[0] == result.observation.name


@pytest.mark.parametrize("language", LANGUAGES)
def test_rows_that_are_left_out_are_counted(language):
    """A chart of some of the trials does not pass for one of all."""
    words = load_translations(language)
    titles = {44: words("plot.angles_title"), 60: words("plot.angles_first", shown=48, count=64)}
    for trials, title in titles.items():
        found = many(trials)
        text = angles_text(found, None, words, PAPER)
        assert angles_drawing(found, None, words, "rear-axle").title == title
        assert (title in text.split("\n")) == (trials == 60)
        assert text.count("●") == 2 * 48 + 1


def test_the_top_view_rotates_wheels_by_their_toe():
    """Times a round factor; from above, toe-in of a left wheel is clockwise."""
    drawing = top_drawing(measured(1), EN, PAPER)
    note = next(m.text for m in drawing.marks if isinstance(m, Text) and "times" in m.text)
    times = int(re.search(r"(\d+) times", note)[1])
    tyres = [np.asarray(m.points) for m in drawing.marks if getattr(m, "fill", "") == "#dfe5ea"][:4]
    for corners, name in zip(tyres, ("RR", "RL", "FR", "FL"), strict=True):
        way = corners[0] + corners[1] - corners[2] - corners[3]  # to the front
        clockwise = math.atan2(way[0], -way[1])
        side = 1.0 if name[1] == "L" else -1.0
        assert clockwise == pytest.approx(side * times * wheel(name).angles.toe_rad, abs=1e-9)


def test_the_factor_is_round_and_keeps_angles_small():
    for degrees in (0.001, 0.03, 0.4, 2.0, 9.0, 40.0):
        k = factor([math.radians(degrees), 0.0])
        assert k in (1, 2, 5, 10, 20, 50, 100, 200)
        assert k == 1 or k * degrees <= 14.0
        assert k == 200 or 2.5 * k * degrees > 14.0


def test_budget_bars_are_as_long_as_their_shares():
    made = measured(1)
    known = by_kind(stated(made), "rear-axle")
    angles = [known["FL", kind] for kind in ("toe", "camber")]
    drawing = wheel_budget(angles, made.uncertainty.components, EN)
    bars = [np.asarray(m.points) for m in drawing.marks
            if isinstance(m, Path) and m.fill != "none"]  # fmt: skip
    rows: dict[float, float] = {}
    for bar in bars:
        low, high = bar.min(axis=0), bar.max(axis=0)
        if high[1] - low[1] == pytest.approx(16.0):
            rows[low[1]] = rows.get(low[1], 0.0) + high[0] - low[0]
    assert len(rows) == 2
    for length in rows.values():
        assert length == pytest.approx(BAR)


def test_points_of_a_chart_lie_where_the_ticks_say():
    """A point at two ticks' values lies on the crossing of their grid lines."""
    chart = Chart("t", "s", "x", "y", (-0.3, 1.1), (20.0, 47.0), EN)
    for x in ticks(*chart.x_range):
        chart.point(x, ticks(*chart.y_range)[1])
    marks = chart.drawing.marks
    grid = [np.asarray(m.points) for m in marks if isinstance(m, Path) and m.opacity == 0.12]
    upright = [line[0, 0] for line in grid if line[0, 0] == line[1, 0]]
    level = [line[0, 1] for line in grid if line[0, 1] == line[1, 1]]
    assert [m.x for m in marks if isinstance(m, CircleMark)] == pytest.approx(upright)
    assert {m.y for m in marks if isinstance(m, CircleMark)} == {level[1]}
    assert upright == sorted(upright)
    assert level == sorted(level, reverse=True)  # y grows downwards


def profile(**changed):
    ring = np.arange(0.1, 0.3, 0.002)
    seen = WheelProfile(
        radius_m=ring,
        height_m=np.where(ring < 0.15, np.nan, 0.1 * (ring - 0.23)),
        used=(ring > 0.201) & (ring < 0.231),
        ring_m=np.array([0.23, 0.0]),
        method="flange",
        points_m=np.column_stack([ring, np.zeros(len(ring))]),
        kept_m=np.column_stack([ring, np.where(np.arange(len(ring)) % 2, 5e-4, -5e-4)]),
        rejected_m=np.array([[0.21, 1.5e-3], [0.22, 0.5]]),
    )
    evidence = Evidence(wheel("RR").observation.evidence.target, profile=replace(seen, **changed))
    return replace(wheel("RR"), observation=replace(wheel("RR").observation, evidence=evidence))


def test_the_profile_marks_the_ring_of_the_centre_and_the_rings_of_the_axis():
    drawing = profile_drawing(profile(), EN)
    dashed = [m for m in drawing.marks if isinstance(m, Path) and m.dash]
    used = next(np.asarray(m.points) for m in drawing.marks if getattr(m, "stroke", "") == USED)
    texts = {m.text: m for m in drawing.marks if isinstance(m, Text)}
    assert len({x for m in dashed for x, _ in m.points}) == 1
    shown = [(float(text), m.x) for text, m in texts.items() if text.isdecimal() and len(text) == 3]
    at = np.polyval(np.polyfit(*np.transpose(shown), 1), [230.0, 202.0])
    assert dashed[0].points[0][0] == pytest.approx(at[0])
    assert used[:, 0].min() == pytest.approx(at[1])
    assert used[:, 0].max() == pytest.approx(at[0])
    assert texts["edge of the flange, 230.0 mm"].x == pytest.approx(at[0])
    assert "rms 0.500 mm" in next(text for text in texts if "rms" in text)
    rejected = [m for m in drawing.marks if isinstance(m, Dots) and m.colour == LIMIT]
    assert len(rejected[0].points) == 1  # the other lies beyond the range


def test_a_tyre_s_profile_says_so_in_both_languages_and_a_target_has_none():
    for language in LANGUAGES:
        words = load_translations(language)
        drawing = profile_drawing(profile(method="tyre"), words)
        expected = words("plot.profile_tyre", radius=words.number("230.0"))
        assert expected in [m.text for m in drawing.marks if isinstance(m, Text)]
    assert profile_drawing(wheel("RR"), EN) is None


# --- files --------------------------------------------------------------------------------------


def test_all_plots_as_svg_and_png_the_same_every_time():
    files = plot_files(measured(1), None, EN, PAPER)
    stems = {"angles", "top", "frame", "budget"}
    stems |= {f"{kind}-{name}" for kind in ("residuals", "histogram") for name in ANGLES}
    assert set(files) == {f"{s}.{end}" for s in stems for end in ("svg", "png")} | {"angles.txt"}
    for name, content in files.items():
        if name.endswith("svg"):
            root = ElementTree.fromstring(content)
            assert root.find("{http://www.w3.org/2000/svg}title").text
            assert b"nan" not in content
        elif name.endswith("png"):
            image = decoded(content)
            svg = ElementTree.fromstring(files[name.replace("png", "svg")])
            assert image.shape[1] == round(ZOOM * float(svg.get("width")))
            assert 0.002 < np.mean(image.min(axis=2) < 200) < 0.9
    assert plot_files(measured(1), None, EN, PAPER) == files


def test_names_of_files_are_safe_and_keep_apart():
    taken: list[str] = []
    for name in ("a/b", "a b", "A/B", "x" * 300, "x" * 301, "../..", ""):
        taken.append(file_name(f"residuals-{name}", "svg", taken))
    assert len({name.casefold() for name in taken}) == len(taken)
    assert all(re.fullmatch(r"[\w-]+\.svg", name) and len(name) < 70 for name in taken)


def test_names_are_inert_in_svg():
    files = plot_files(renamed("x", "y", "<b>&\x07\u202e"), None, EN, PAPER)
    for name, content in files.items():
        if name.endswith("svg"):
            ElementTree.fromstring(content)
            assert b"<b>" not in content
            assert "\u202e" not in content.decode()


def test_png_of_few_colours_comes_back():
    rng = np.random.default_rng(0)
    palette = rng.integers(0, 256, (35, 3)).astype(np.uint8)
    pixels = rng.integers(0, 35, (31, 47)).astype(np.uint8)
    png = png_of(pixels, palette)
    np.testing.assert_array_equal(decoded(png), palette[pixels])
    assert zlib.crc32(png) == zlib.crc32(png_of(pixels, palette))


def test_a_drawing_is_the_same_in_both_forms():
    """A square and a dashed line have their given coordinates, twice as large in the PNG.

    Its dashes have round ends, so that they are longer by half the line's width at either.
    """
    square = Path([(10, 20), (50, 20), (50, 60), (10, 60)], fill="#ff0000", closed=True)
    line = Path([(5, 90), (95, 90)], stroke="#0000ff", width=2.0, dash=(10.0, 10.0))
    image = decoded(drawing_png(Drawing(100, 100, "x", [square, line])))
    red = np.argwhere((image == [255, 0, 0]).all(axis=2))
    np.testing.assert_allclose(red.min(axis=0), [40, 20], atol=1)
    np.testing.assert_allclose(red.max(axis=0), [120, 100], atol=1)
    row = (image[180] == [0, 0, 255]).all(axis=1)
    assert 0.5 <= row[10:190].mean() <= 0.7
    assert np.count_nonzero(np.diff(row.astype(int)) == 1) == 5


def test_a_circle_is_the_same_in_both_forms():
    """The PNG holds the circle's centre and, within a pixel, its radius with half the line."""
    drawing = Drawing(100, 80, "x", [CircleMark(40.0, 30.0, 20.0, "#ff0000", "#0000ff", 4.0)])
    image = decoded(drawing_png(drawing)).astype(int)
    inside = image[:, :, 1] < 128  # neither red nor blue has green
    np.testing.assert_allclose(np.argwhere(inside).mean(axis=0), [60, 80], atol=0.3)
    assert math.sqrt(inside.sum() / np.pi) == pytest.approx(22.0 * ZOOM, abs=1.0)
    assert (image[60, 80] == [255, 0, 0]).all()
    assert (image[60, 80 + 40] == [0, 0, 255]).all()
    circle = ElementTree.fromstring(drawing.svg).find("{http://www.w3.org/2000/svg}circle")
    assert [float(circle.get(name)) for name in ("cx", "cy", "r")] == [40.0, 30.0, 20.0]


def test_crisp_areas_side_by_side_have_no_seam():
    """Two halves that share an edge between pixels: smoothed, the background shines through."""

    def columns(crisp):
        halves = [
            Path([(a, 5), (b, 5), (b, 15), (a, 15)], fill="#000000", closed=True, crisp=crisp)
            for a, b in ((5.0, 10.3), (10.3, 15.0))
        ]
        return decoded(drawing_png(Drawing(20, 20, "x", halves)))[20, 12:28].max(axis=1)

    assert columns(crisp=True).max() == 0


def test_a_halo_parts_text_from_a_dark_ground():
    """White pixels surround the text; without a halo there are none."""
    ground = Path([(0, 0), (60, 0), (60, 40), (0, 40)], fill="#000000", closed=True)
    for halo, least, most in ((0.0, 0, 0), (3.0, 50, 1000)):
        text = Text(20, 25, "u", 20.0, colour="#000000", halo=halo)
        drawing = Drawing(60, 40, "x", [ground, text])
        image = decoded(drawing_png(drawing))
        assert least <= np.count_nonzero(image.min(axis=2) > 250) <= most
        assert ("paint-order" in drawing.svg) == (halo > 0.0)


def test_the_true_board_lies_in_its_scan():
    """A premise of the other tests: the target's points are flat in its own axes."""
    one = scan("FL", 0)
    local = off_m(one.cloud.points_m[one.cloud.on_face], one)
    assert np.abs(local[:, 2]).max() < 0.006
    assert np.abs(local[:, :2]).max() < 0.151


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_names_of_the_axes_stand_clear_of_all_lines(language):
    """Estimated boxes of the texts, against the lines of the frame and the edges of the targets."""
    words = load_translations(language)
    drawing = frame_drawing(scene(measured(1), words=words), words)
    names = {words(f"scene.{way}") for way in ("forward", "left", "up")}
    texts = [m for m in drawing.marks if isinstance(m, Text) and m.text in names]
    lines = [np.asarray(m.points) for m in drawing.marks if isinstance(m, Path)]
    assert len(texts) == 3
    for text in texts:
        wide = 0.5 * text.size * len(text.text)
        left = {"start": text.x, "middle": text.x - wide / 2, "end": text.x - wide}[text.anchor]
        for line in lines:
            along = np.linspace(0.0, 1.0, 200)[:, None]
            for start, end in itertools.pairwise(line):
                x, y = (start + along * (end - start)).T
                within = (x > left) & (x < left + wide) & (y > text.y - 0.7 * text.size)
                assert not np.any(within & (y < text.y)), (text.text, start, end)


@pytest.mark.parametrize("slope", [0.2, 1.0, 1.7, 5.0, -3.0])
def test_a_line_of_a_chart_stays_within_its_axes(slope):
    chart = Chart("", "", "", "", (-1.0, 1.0), (-1.0, 1.0), EN)
    chart.line((-1.0, -slope + 0.1), (1.0, slope + 0.1), GREEN)
    ((start, end),) = (np.asarray(mark.points) for mark in chart.marks)
    corners = np.array([chart.at(-1.0, 1.0), chart.at(1.0, -1.0)])
    for point in (start, end):
        assert np.all(point >= corners[0] - 1e-9)
        assert np.all(point <= corners[1] + 1e-9)
    # still on the line: pixels back to its coordinates
    zero, unit = np.array(chart.at(0.0, 0.0)), np.array(chart.at(1.0, 1.0))
    x, y = (np.stack([start, end]) - zero).T / (unit - zero)[:, None]
    np.testing.assert_allclose(y, slope * x + 0.1, atol=1e-9)


def test_a_line_beyond_the_axes_is_not_drawn():
    chart = Chart("", "", "", "", (-1.0, 1.0), (-1.0, 1.0), EN)
    chart.line((-1.0, 2.0), (1.0, 3.0), GREEN)
    chart.line((0.0, 2.0), (0.0, 3.0), GREEN)
    assert chart.marks == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_text_of_a_budgets_legend_runs_into_the_next(language):
    words, font = load_translations(language), cv2.FontFace("sans")
    drawing = bars_drawing((), tuple(COLOURS), words, "")
    named = {words.known("cause", component) for component in COLOURS}
    texts = [m for m in drawing.marks if isinstance(m, Text) and m.text in named and m.y >= HEAD]
    assert len(texts) == len(COLOURS)
    for one, after in itertools.pairwise([*texts, texts[0]]):
        width = cv2.getTextSize((0, 0), one.text, (0, 0), font, 12, 400)[2]
        ends = after.x - SWATCH if after.y == one.y else drawing.width
        assert one.x + width < ends
