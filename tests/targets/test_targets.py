"""Targets as files: what they must say, in which unit, and how they are listed and drawn."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner

from wheelplane.commands.targets import known_targets, targets
from wheelplane.errors import ConfigError, InputError
from wheelplane.report.plots.target import target_svg
from wheelplane.targets.registry import SHAPES, load_target, parse_target, scaled, size_of

WHOLE = {
    "disc": {"shape": "disc", "diameter": 0.25},
    "ring": {"shape": "ring", "diameter": 0.3, "hole_diameter": 0.08},
    "rectangle": {"shape": "rectangle", "width": 0.36, "height": 0.24},
    "square": {"shape": "square", "side": 0.3, "hole_diameter": 0.05, "hole_spacing": 0.18},
    "pattern": {
        "shape": "pattern",
        "kind": "circles",
        "width": 0.3,
        "height": 0.24,
        "rows": 4,
        "columns": 6,
        "pitch": 0.04,
        "circle_diameter": 0.02,
        "offset": [0.01, -0.005],
    },
}
MARKERS = {
    "shape": "pattern",
    "kind": "aruco",
    "diameter": 0.5,
    "rows": 1,
    "columns": 2,
    "pitch": 0.13,
    "marker_size": 0.1,
    "dictionary": "DICT_4X4_50",
}
BY_WHEEL = {**MARKERS, "wheels": {"RR": [0, 1], "FL": [7, 9]}}


@pytest.mark.parametrize("shape", WHOLE)
def test_face_lies_within_its_circle_and_its_area_is_what_chance_finds(shape):
    target = parse_target(WHOLE[shape], "t")
    count, rng = 200_000, np.random.default_rng(0)
    uv = rng.uniform(-target.radius_m, target.radius_m, (count, 2))
    held = target.region.holds(uv)
    share = held.mean()
    u = math.sqrt(share * (1 - share) / count)
    assert share == pytest.approx(target.region.area_m2 / (2 * target.radius_m) ** 2, abs=4 * u)
    assert np.hypot(*uv[held].T).max() > 0.98 * target.radius_m


@pytest.mark.parametrize("shape", WHOLE)
def test_turn_period_leaves_the_face_as_it_is_and_no_smaller_turn_does(shape):
    target = parse_target(WHOLE[shape], "t")
    uv = np.random.default_rng(1).uniform(-target.radius_m, target.radius_m, (20_000, 2))

    def after(turn):
        c, s = math.cos(turn), math.sin(turn)
        return target.region.holds(uv @ np.array([[c, s], [-s, c]]))

    here = target.region.holds(uv)
    np.testing.assert_array_equal(here, after(target.turn_period_rad))
    for part in (2, 3):
        if target.turn_period_rad:
            assert np.any(here != after(target.turn_period_rad / part))
        else:
            np.testing.assert_array_equal(here, after(2.0 / part))


@pytest.mark.parametrize("shape", WHOLE)
@pytest.mark.parametrize("per_metre", [1000.0, 1 / 0.0254])
def test_a_table_in_another_unit_is_the_same_target(shape, per_metre):
    table = WHOLE[shape] | {"thickness": 0.01, "clamp_shift": 0.001, "clamp_tilt_deg": 0.5}
    model = SHAPES[shape]
    written = {
        key: [v * per_metre for v in value]
        if isinstance(value, list)
        else value * per_metre
        if key in model.lengths
        else value
        for key, value in table.items()
    }
    name, size = size_of(written)
    assert size == pytest.approx(table[name] * per_metre)
    again = parse_target(scaled(written, 1 / per_metre), "t").model_dump()
    for key, value in parse_target(table, "t").model_dump().items():
        assert again[key] == (value if isinstance(value, str) else pytest.approx(value))


def test_what_has_no_size_is_left_to_the_parser():
    assert size_of({"shape": "disc", "diameter": True}) is None
    assert size_of({"shape": "what", "diameter": 1}) is None
    assert size_of({}) is None
    assert scaled({"shape": "what", "x": 1}, 0.1) == {"shape": "what", "x": 1}


WRONG = {
    "no shape": ({"diameter": 0.25}, "'shape' is missing"),
    "nearest shape": ({"shape": "rectangel"}, "did you mean 'rectangle'"),
    "shape that is no text": ({"shape": 3}, "shape 3 is not known: known are disc"),
    "misspelt key": (WHOLE["disc"] | {"thicknes": 0.01}, "did you mean 'thickness'"),
    "text for a number": (WHOLE["disc"] | {"diameter": "0.25"}, "diameter"),
    "hole as wide as the plate": (WHOLE["ring"] | {"hole_diameter": 0.3}, "hole_diameter 0.3"),
    "holes over the edge": (WHOLE["square"] | {"hole_spacing": 0.25}, "to the edge"),
    "holes into each other": (WHOLE["square"] | {"hole_spacing": 0.05}, "between the holes"),
    "missing side": ({"shape": "rectangle", "width": 0.3}, "'height' is missing"),
    "board with two outlines": (
        WHOLE["pattern"] | {"diameter": 0.3},
        "outline of the board is missing",
    ),
    "board with half an outline": (
        {k: v for k, v in WHOLE["pattern"].items() if k != "height"},
        "outline of the board is missing",
    ),
    "print over the edge": (WHOLE["pattern"] | {"offset": [0.06, 0.0]}, "beyond the board"),
    "circles that touch": (WHOLE["pattern"] | {"pitch": 0.02}, "no gap between"),
    "circles without a size": (
        {k: v for k, v in WHOLE["pattern"].items() if k != "circle_diameter"},
        "needs circle_diameter",
    ),
    "circles with ids": (WHOLE["pattern"] | {"ids": [1]}, "has no ids"),
    "three circles": (WHOLE["pattern"] | {"rows": 1, "columns": 3}, "too few"),
    "markers without ids": (MARKERS, "needs ids"),
    "markers of no wheel": (MARKERS | {"wheels": {}}, "needs ids"),
    "too few ids": (MARKERS | {"ids": [1]}, "1 markers, rows x columns is 2"),
    "an id twice": (MARKERS | {"ids": [1, 1]}, "is listed twice"),
    "an id of two wheels": (MARKERS | {"wheels": {"RR": [0, 1], "FL": [1, 2]}}, "is listed twice"),
    "an id that is not printed": (MARKERS | {"ids": [1, 50]}, "has the markers 0 to 49"),
    "a text as id": (MARKERS | {"ids": [1, "2"]}, "a whole number is needed"),
    "a wheel that is none": (MARKERS | {"wheels": {"XX": [0, 1]}}, "XX"),
    "a dictionary that is none": (MARKERS | {"ids": [1, 2], "dictionary": "D"}, "dictionary"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_reported_in_one_line(case):
    table, said = WRONG[case]
    with pytest.raises(ConfigError) as error:
        parse_target(table, "plate.toml")
    assert str(error.value).startswith("plate.toml: ")
    assert "\n" not in str(error.value)
    assert said in str(error.value)


def test_markers_tell_the_wheel_where_they_can():
    board = parse_target(BY_WHEEL, "t")
    assert board.wheel_of([0, 1]) == "RR"
    assert board.wheel_of([9]) == "FL"
    assert board.wheel_of([0, 7, 9, 30]) == "FL"
    assert board.wheel_of([0, 7]) is None  # one of each
    assert board.wheel_of([]) is None
    assert board.wheel_of([30]) is None
    assert parse_target(MARKERS | {"ids": [0, 1]}, "t").wheel_of([0, 1]) is None


def test_places_run_along_the_rows_from_the_top_left():
    board = parse_target(WHOLE["pattern"], "t")
    places = board.places_m
    assert len(places) == 24
    np.testing.assert_allclose(places.mean(axis=0), board.offset, atol=1e-15)
    np.testing.assert_allclose(places[1] - places[0], [board.pitch, 0.0], atol=1e-15)
    np.testing.assert_allclose(places[6] - places[0], [0.0, -board.pitch], atol=1e-15)
    turned = parse_target(WHOLE["pattern"] | {"turn_deg": 90.0}, "t").places_m
    np.testing.assert_allclose(turned[1] - turned[0], [0.0, board.pitch], atol=1e-15)


def test_every_shape_is_shipped_and_drawn_to_scale():
    names = known_targets()
    assert {load_target(name).shape for name in names} == set(SHAPES)
    for name in names:
        target = load_target(name)
        root = ElementTree.fromstring(target_svg(name, target))
        box = [float(part) for part in root.attrib["viewBox"].split()]
        assert root.attrib["width"] == f"{box[2]:g}mm"  # a millimetre of it is one of the plate
        text = " ".join(root.itertext())
        half = target.region.half_m
        sizes = half if target.edge.shows_rotation else [target.radius_m]
        for size in sizes:
            assert f"{2e3 * size:g} mm" in text
        assert {"u", "v"} <= set(text.split())
        assert target_svg(name, target) == target_svg(name, target)


def test_targets_command_tells_one_in_full_and_draws_it(tmp_path):
    run = CliRunner().invoke(targets, ["square-300", "-o", str(tmp_path / "drawn")])
    assert run.exit_code == 0
    for said in ("hole_spacing", "180 mm", "a square of 300 mm", "square-300.svg"):
        assert said in run.output
    assert [path.name for path in (tmp_path / "drawn").iterdir()] == ["square-300.svg"]
    (tmp_path / "file").write_text("mine")
    for arguments in (
        ["rign-300"],
        ["ring-300", "-o", str(tmp_path / "file")],
        ["wheel", "-o", str(tmp_path / "wheel")],
    ):
        wrong = CliRunner().invoke(targets, arguments)
        assert isinstance(wrong.exception, ConfigError | InputError)
        assert "\n" not in str(wrong.exception)
    assert (tmp_path / "file").read_text() == "mine"
    assert not (tmp_path / "wheel").exists()
