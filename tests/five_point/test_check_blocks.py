"""Wrong digits in five-point files are named, clean files are not, and the rest keeps its values.

The paper's file has blocks of 0.28 mm noise across their planes and 1.8 mm about pentagons.
"""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from tests.support.validation_cars import TM30, Car, stated
from tests.support.wrong_digits import (
    PAPER,
    TEXT,
    angles,
    clean_files,
    file,
    flagged,
    judge,
    paper,
    single_digit_changes,
    u,
)
from wheelplane.cli import cli
from wheelplane.errors import InputError, NotMeasuredError, WheelplaneError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.check_blocks import LEVEL, Misfit, Scatter, check_blocks
from wheelplane.five_point.components import Station
from wheelplane.five_point.file import read_five_point
from wheelplane.five_point.observe import pooled_noise
from wheelplane.library import Alignment
from wheelplane.report.format.earlier import read_earlier
from wheelplane.report.format.view import PAPER as PRINTED
from wheelplane.report.format.writer import NONE
from wheelplane.report.html.provenance import wheel_facts
from wheelplane.report.json.measurement import to_json
from wheelplane.report.plots.drawing import Text
from wheelplane.report.plots.top_view import top_drawing
from wheelplane.report.tables.vehicle import axes_table, vehicle_table
from wheelplane.report.tables.wheels import centres_table
from wheelplane.report.text.plain import plain_writer
from wheelplane.vehicle.frame import build_reference_frame

TRIAL = 5  # block of trial 2, on RL
PHASE = 2 * np.pi * np.arange(5) / 5


def statuses(blocks, station=None, radius_m=None):
    return [check.status for check in check_blocks(blocks, station, radius_m)]


def shares(changes, folder):
    """Number of changes that move an angle by 3 printed u; how many are named, and rightly."""
    harmful = [one for one in judge(changes, folder) if one.printed >= 3.0]
    named = [one for one in harmful if one.named]
    return len(harmful), len(named), sum(one.right for one in named), [one.left for one in named]


def test_a_wrong_digit_that_matters_is_named(tmp_path):
    """Every 37th of 5,292 changes; `tests.bench.digits` shows all. Unchecked none is named."""
    harmful, named, right, left = shares(single_digit_changes()[::37], tmp_path)
    assert harmful > 40
    assert named >= stats.binom.ppf(0.001, harmful, 0.95)
    assert right == named
    assert max(left) < 3.0  # u: four points have some 1.5 times that of five


@pytest.mark.slow
def test_of_wrong_digits_that_matter_95_percent_are_named(tmp_path):
    harmful, named, right, left = shares(single_digit_changes()[::4], tmp_path)
    assert harmful > 500
    assert named >= 0.95 * harmful
    assert right >= 0.99 * named
    assert max(left) < 3.0


def test_clean_files_are_not_flagged():
    assert [flagged(blocks) for blocks in clean_files(200, 1)] == [[]] * 200
    assert statuses(paper()) == ["ok"] * 8


@pytest.mark.slow
def test_no_clean_file_of_thousands_is_flagged():
    assert not any(flagged(blocks) for blocks in clean_files(2500, 2))


@pytest.mark.parametrize("noise_m", [3e-5, 3e-4, 2e-3])
def test_p_values_are_not_too_small_whatever_the_noise(noise_m):
    """Of blocks with Gaussian noise of any size; 17 tests by Bonferroni, so on the safe side."""
    rng, found = np.random.default_rng(3), []
    for _ in range(250):
        ring = 0.088 * np.column_stack([np.cos(PHASE), np.sin(PHASE), np.zeros(5)])
        blocks = (
            ring
            + rng.normal(0.0, noise_m, (6, 5, 3))
            + rng.normal(0.0, 1e-3, (6, 5, 3)) * [1, 1, 0]
        )
        misfits = [Misfit.of(block, None, None) for block in blocks]
        found.append(Scatter.of(misfits[1:]).doubt(misfits[0])[0])
    for level in (0.05, 0.3):
        assert np.mean(np.array(found) < level) < level + 4 * np.sqrt(level / 250)


def test_errors_are_told_by_their_direction():
    """Across the plane 4 mm are seen, 1 mm is not; in it, along a side of the pentagon, 40 mm."""
    normal = np.linalg.svd(paper()[TRIAL] - paper()[TRIAL].mean(axis=0))[2][2]
    for size, direction, status in (
        (6e-3, normal, "block-not-flat"),
        (4e-2, np.cross(normal, [0, 0, 1]), "block-not-regular"),
        (4e-2, [0, 0, -1], "block-not-regular"),
        (1e-3, normal, "ok"),
        (5e-3, [0, 0, 1], "ok"),
    ):
        blocks = paper()
        blocks[TRIAL, 1] += size * np.array(direction)
        assert statuses(blocks)[TRIAL] == status
        assert statuses(blocks).count("ok") == (8 if status == "ok" else 7)


def test_the_suspect_is_where_it_was_moved_and_its_angles_are_those_without_it():
    clean, blocks = measure_five_point(file(paper())), paper()
    blocks[0, 2] += [0.0, 0.03, 0.0]
    blocks[TRIAL, 1] += [0.0, 0.0, -0.06]
    found = measure_five_point(file(blocks))
    assert [w.observation.status for w in found.wheels].count("ok") == 6
    for index, point, off in ((0, 3, [0, 0.03, 0]), (TRIAL, 2, [0, 0, -0.06])):
        wheel = found.wheels[index]
        suspect = wheel.observation.suspect
        assert (suspect.number, suspect.line) == (point, 5 * index + point)
        np.testing.assert_allclose(suspect.off_m, off, atol=8e-3)  # 1.8 mm marks, five of them
        assert wheel.angles is None
        assert wheel.u_toe_rad is None
        rest = np.delete(blocks[index], point - 1, axis=0)
        normal = np.linalg.svd(rest - rest.mean(axis=0))[2][2]
        right = found.frame.left if wheel.wheel == "RL" else -found.frame.left
        normal = normal if normal @ right > 0 else -normal
        toe = np.arctan2(normal @ found.frame.forward, normal @ right)
        assert wheel.provisional.toe_rad == pytest.approx(toe, abs=1e-12)
        assert "without it toe" in wheel.observation.reason
        assert f"line {suspect.line}: point {point} " in wheel.observation.reason
    assert np.abs((angles(found) - angles(clean)) / u(clean)).max() < 3.0
    assert not found.complete


def test_no_output_has_provisional_angles_as_measured_ones(tmp_path):
    """FL and RR have a suspect point: a dash where other wheels have toe and camber."""
    blocks = paper()
    for block in (0, 3):
        blocks[block, 2] += [0.0, 0.03, 0.0]
    found = measure_five_point(file(blocks))
    assert found.provisional == {"RR", "FL"}
    writer = plain_writer(PRINTED)
    toes = [row[3:] for row in axes_table(found, writer).rows]  # FL, FR, RL, RR
    assert [[cell == "-" for cell in row] for row in toes] == [[True, False, False, True]] * 4
    rows = {row[0]: row[1:] for row in vehicle_table(found, writer).rows}
    assert rows["front left toe to the thrust line"] == ["-", "-"]
    assert "-" not in rows["front right toe to the thrust line"]
    texts = [mark.text for mark in top_drawing(found, writer.words, PRINTED).marks
             if isinstance(mark, Text)]  # fmt: skip
    assert texts.count(NONE) == 4  # toe and camber of two wheels
    (tmp_path / "measurement.json").write_text(to_json(found))
    earlier = read_earlier(tmp_path / "measurement.json").values
    assert {"RL.toe", "FR.camber", "rear_total_toe"} < set(earlier)
    assert not [name for name in earlier if name.startswith(("RR.", "FL."))]
    wheels = Alignment(found).wheels
    assert wheels["RL"].toe.value == found.wheels[1].angles.toe_rad
    for name in found.provisional:
        assert repr(wheels[name]).startswith(f"<Wheel {name}: block-not-")
        with pytest.raises(NotMeasuredError, match=f"{name}: line"):
            _ = wheels[name].toe


def test_reports_say_by_how_many_points_each_centre_was_found():
    """In the table of centres, and on the card of each wheel: as many as are on its plane."""
    blocks = paper()
    for block in (0, TRIAL):
        blocks[block, 2] += [0.0, 0.03, 0.0]
    found, writer = measure_five_point(file(blocks)), plain_writer(PRINTED)
    by = [writer.words("method.four_points" if i in (0, TRIAL) else "method.points")
          for i in range(8)]  # fmt: skip
    assert [row[-1] for row in centres_table(found, writer).rows] == by
    for wheel, own in zip(found.wheels, by, strict=True):
        assert (writer.words("wheel.method"), own) in wheel_facts(wheel, writer)


def test_bad_blocks_neither_hide_each_other_nor_add_to_the_noise():
    blocks = paper()
    for index, size in ((0, 0.01), (3, 0.012), (TRIAL, 0.2), (7, 0.3)):
        blocks[index, index % 5, 1] += size
    assert flagged(blocks) == [0, 3, TRIAL, 7]
    left = np.delete(paper(), [0, 3, TRIAL, 7], axis=0)
    found, clean = (measure_five_point(file(each)) for each in (blocks, paper()))
    scale = pooled_noise(left, None).sigma_m / pooled_noise(paper(), None).sigma_m
    assert u(found)[2, 0] == pytest.approx(scale * u(clean)[2, 0], rel=0.05)
    assert pooled_noise(blocks, None).sigma_m > 30 * pooled_noise(left, None).sigma_m


@pytest.mark.parametrize("pair", [(0, 1), (1, 3)])
def test_two_of_four_blocks_are_named(pair):
    blocks = paper()[:4]
    for index in pair:
        blocks[index, 2, 1] += 0.1
    assert flagged(blocks) == list(pair)


def test_the_frame_takes_the_centre_of_the_other_four():
    """A point moved by 0.3 m in its plane would turn the frame by 0.06/1.37."""
    clean, blocks = measure_five_point(file(paper())), paper()
    along = np.cross(build_reference_frame(paper()[:4].mean(axis=1)).left, [0, 0, 1])
    blocks[1, 0] += 0.3 * along
    found = measure_five_point(file(blocks))
    plain = measure_five_point(file(blocks), check=False)
    turned = [np.degrees(np.arccos(m.frame.forward @ clean.frame.forward)) for m in (found, plain)]
    assert turned[0] < 3 * np.degrees(2e-3 / 1.37)
    assert turned[1] > 2.0
    (note,) = found.notes
    assert note.startswith("RL stands in the frame and in the vehicle's quantities without")
    assert "line 6 " in note
    centre = [m.wheels[1].observation.fitted.centre_covariance_m2 for m in (found, clean)]
    assert np.trace(centre[0]) > 4 * np.trace(centre[1])


def test_two_wrong_points_of_a_block_leave_nothing_of_it():
    blocks = paper()
    blocks[TRIAL, 1, 2] -= 0.06
    blocks[TRIAL, 3, 0] += 0.3
    wheel = measure_five_point(file(blocks)).wheels[TRIAL]
    assert (wheel.angles, wheel.provisional) == (None, None)
    assert wheel.observation.status == "block-not-regular"
    assert "lines 26-30" in wheel.observation.reason
    assert "no single one" in wheel.observation.reason
    blocks[[0, TRIAL]] = blocks[[TRIAL, 0]]
    with pytest.raises(InputError, match=r"five.txt: lines 1-5: RR was not measured \(block-not-r"):
        measure_five_point(file(blocks))


def test_a_stated_radius_is_that_of_every_block():
    blocks = paper()
    other = blocks.copy()
    middle = other[2].mean(axis=0)
    other[2] = middle + 1.3 * (other[2] - middle)
    assert flagged(other) == []
    assert flagged(other, radius_m=0.088) == [2]
    assert flagged(blocks, radius_m=0.088) == []
    with pytest.raises(InputError, match=r"five.txt: .* circles of 88.\d mm radius, not 120 mm"):
        measure_five_point(file(blocks), radius_m=0.12)


def test_a_stated_station_is_believed_if_it_explains_the_other_blocks():
    """With a noise of 0.05 mm stated an error of 1 mm is seen, without a statement it is not."""
    fine = TM30.model_copy(update={"range_sigma_m": 5e-5, "aiming_sigma_m": 0.0})
    car = Car(4, 0)
    blocks, place = car.blocks(fine)
    wrong = blocks.copy()
    wrong[1, 2] += 1e-3 * car.normals[1]
    known = Station(stated(fine), place)
    assert statuses(wrong, station=known) == ["ok", "block-not-flat", "ok", "ok"]
    assert flagged(blocks, station=known) == flagged(wrong) == []
    rough = car.blocks(TM30.model_copy(update={"aiming_sigma_m": 0.0}))[0]
    assert flagged(rough, station=known) == []  # twelve times the statement, in every block


def run(*arguments):
    done = CliRunner().invoke(cli, [str(a) for a in arguments], standalone_mode=False)
    if done.exception is not None and not isinstance(done.exception, WheelplaneError):
        raise done.exception
    return done


@pytest.fixture
def wrong(tmp_path):
    """The paper's file with y of line 3, on RR, too large by 9 mm."""
    path = tmp_path / "wrong.txt"
    path.write_text(TEXT.replace("95.247,97.902", "95.247,97.911"))
    return path


def test_five_point_prints_status_point_and_angles_without_it(wrong, tmp_path):
    done = run("five-point", wrong, "--html", tmp_path / "page.html", "-o", tmp_path / "report.txt")
    assert done.return_value == 1
    row = next(line for line in done.stdout.split("\n") if line.startswith("  RR "))
    assert re.search(r"RR +RR( +-){5} +block-not-flat: line 3: point 3 .* without it toe -00°", row)
    assert "RR stands in the frame" in done.stdout
    assert "line 3: point 3" in (tmp_path / "page.html").read_text("utf-8")
    tree = json.loads(run("five-point", wrong, "--json").stdout)
    first, second = tree["wheels"][:2]
    assert (first["status"], first["toe_deg"], first["normal"]) == ("block-not-flat", None, None)
    assert (first["suspect"]["point"], first["suspect"]["line"]) == (3, 3)
    assert first["suspect"]["toe_without_deg"] == pytest.approx(-0.33, abs=0.35)
    assert (second["status"], second["suspect"]) == ("ok", None)
    assert second["toe_deg"] == pytest.approx(0.4195, abs=0.02)
    assert re.search(r"rear +toe +\+00°\S+ +- +total", done.stdout)
    page = (tmp_path / "page.html").read_text("utf-8")
    assert re.search(r"toe, right</th>\s*<td[^>]*>\u2013<", page)
    clean = run("five-point", PAPER, "--digits", "full")
    assert clean.return_value == 0
    assert '-00°19\'40.7"  419.4"' in clean.stdout


def test_the_estimator_of_2013_prints_as_before_and_names_the_block(wrong):
    done = run("five-point", wrong, "--method", "tcgc-2013")
    assert done.return_value == 1
    assert "lines 1-5: block-not-flat" in done.stderr
    assert "block" not in done.stdout
    assert run("five-point", PAPER, "--method", "tcgc-2013").return_value == 0


def test_radius_is_an_option(tmp_path):
    assert run("five-point", PAPER, "--radius", 88).return_value == 0
    for method in ("tls", "tcgc-2013"):
        done = run("five-point", PAPER, "--radius", 60, "--method", method)
        assert "mm radius, not 60 mm: check --radius" in str(done.exception)
        assert done.stdout == ""
    blocks = paper()
    blocks[4] = blocks[4].mean(axis=0) + 1.3 * (blocks[4] - blocks[4].mean(axis=0))
    path = tmp_path / "five.txt"
    np.savetxt(path, blocks.reshape(-1, 3), fmt="%.6f")
    assert run("five-point", path).return_value == 0
    done = run("five-point", path, "--radius", 88)
    assert done.return_value == 1
    assert "block-not-regular" in done.stdout


def test_batch_gives_the_same(wrong, tmp_path):
    archive = tmp_path / "archive"
    archive.mkdir()
    wrong.rename(archive / "wrong.txt")
    (archive / "clean.txt").write_text(TEXT)
    assert run("batch", archive, "-o", tmp_path / "results", "--workers", 1).return_value == 1
    trees = [
        json.loads(p.read_text()) for p in (tmp_path / "results" / "measurements").rglob("*.json")
    ]
    by_name = {tree["capture"]: tree for tree in trees}
    assert by_name["wrong.txt"]["batch"]["status"] == "part"
    assert by_name["wrong.txt"]["wheels"][0]["status"] == "block-not-flat"
    assert by_name["clean.txt"]["batch"]["status"] == "ok"


def test_a_point_far_from_the_others_is_named(tmp_path):
    path = tmp_path / "far.txt"
    path.write_text(TEXT.replace("95.247,97.902", "95.247,87.902"))
    with pytest.raises(InputError, match=r"lines 1-5: block 1: its point 3 lies 10.0\d m from"):
        read_five_point(path)


def test_the_level_is_that_of_thousands_of_files():
    assert 8 * LEVEL * 10_000 < 0.2
