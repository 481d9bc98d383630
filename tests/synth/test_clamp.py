"""Targets clamped before real wheels: planted mountings, and what is written."""

import json
import tomllib

import numpy as np
import pytest

from tests.support.bare_wheels import draw_bay
from tests.support.made import IDEAL, changed, read_ply
from tests.support.mixed import BARE, DISC, WHEEL, disc_file, write_mixed
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.wheel.clamp import draw_clamped
from wheelplane_synth.wheel.scan import rim_axis


def test_the_mounting_is_that_of_the_targets_file(tmp_path):
    target = read_target(disc_file(tmp_path))
    rng = np.random.default_rng(1)
    drawn = [draw_clamped(target, rng) for _ in range(2000)]
    tilts = np.degrees([one.mount.tilt_rad for one in drawn])
    off = np.array([one.stand_off_m for one in drawn]) - 0.085
    assert abs(tilts.std() / 0.1 - 1.0) < 0.1
    assert abs(off.std() / 0.001 - 1.0) < 0.1
    assert abs(off.mean()) < 0.0001


def test_the_target_stands_off_the_flange_along_the_rims_own_axis(tmp_path):
    bay = draw_bay(3, rim_runout_m=0.001)
    exact = disc_file(tmp_path, clamp_tilt_deg=0.0, clamp_shift=0.0, stand_off_u=0.0)
    clamped = draw_clamped(read_target(exact), np.random.default_rng(1))
    pose, axis = clamped.mounted(bay.wheel, bay.drawn).pose, rim_axis(bay.drawn, bay.wheel)
    assert np.allclose(pose.normal_vehicle, axis.direction, atol=1e-12)
    before = axis.centre_m + 0.085 * axis.direction
    assert np.allclose(pose.centre_vehicle_m, before, atol=1e-12)


def test_a_stand_off_without_room_for_the_clamp_is_refused(tmp_path):
    target = read_target(disc_file(tmp_path, stand_off=0.02, stand_off_u=0.0))
    with pytest.raises(SynthError, match="raise stand_off or thin the target"):
        draw_clamped(target, np.random.default_rng(1))


@pytest.mark.slow
def test_what_is_written_names_the_targets_and_their_truth(tmp_path):
    truth = write_mixed(tmp_path / "car", {"RL": disc_file(tmp_path), "FR": DISC}, spacing_m=0.01)
    declared = tomllib.loads((tmp_path / "car" / "capture.toml").read_text(encoding="utf-8"))
    assert declared["target"] == {"shape": "wheel"}
    assert set(declared["targets"]) == {"RL", "FR"}
    assert declared["targets"]["RL"]["stand_off"] == 0.085
    shown = {wheel["name"]: wheel.get("clamped_target") for wheel in truth["wheels"]}
    assert shown["RR"] is None
    assert shown["FL"] is None
    for wheel in truth["wheels"]:
        held = shown[wheel["name"]]
        if held:
            apart = np.subtract(held["centre_m"], wheel["rim_centre_m"])
            assert apart @ wheel["rim_normal"] == pytest.approx(held["stand_off_m"], abs=1e-9)
            across = np.linalg.norm(np.cross(held["normal"], wheel["rim_normal"]))
            assert across == pytest.approx(np.hypot(*np.radians(held["tilt_deg"])), rel=1e-6)
    assert truth["used"]["targets"]["FR"]["shape"] == "disc"


@pytest.mark.slow
def test_a_board_hides_its_share_of_a_target_before_a_real_wheel(tmp_path, monkeypatch):
    for ring in ("tyre", "rim"):  # coarse
        monkeypatch.setattr(f"wheelplane_synth.wheel.{ring}.SECTIONS", 60)
    on_target = {}
    for hidden in (0.0, 0.4):
        values = {"grid.spacing_m": 0.003, "grid.half_width_m": 0.2}
        values |= {"scene": {"occluded_fraction": hidden}}
        files = {"vehicle": BARE, "scanner": changed(IDEAL, tmp_path, values), "target": WHEEL}
        targets = {"RR": DISC, "FL": disc_file(tmp_path, stand_off=0.2)}
        write_capture(tmp_path / f"{hidden}", seed=1, trials=0, targets=targets, **files)
        truth = json.loads((tmp_path / f"{hidden}" / "truth.json").read_text(encoding="utf-8"))
        on_target[hidden] = [scan["points_on_target"] for scan in truth["used"]["scans"]]
    for scan in (0, 3):
        assert on_target[0.4][scan] / on_target[0.0][scan] == pytest.approx(0.6, abs=0.015)


def test_targets_of_single_wheels_need_a_bare_wheel_among_them(tmp_path):
    from tests.support.made import DEFAULT
    from wheelplane_synth.output.archive import write_capture

    with pytest.raises(SynthError, match="none of which is a bare wheel"):
        write_capture(
            tmp_path / "car", seed=1, vehicle=BARE, scanner=DEFAULT, target=DISC,
            targets={"RR": disc_file(tmp_path)},
        )  # fmt: skip


@pytest.mark.slow
def test_one_cloud_shows_the_targets_of_single_wheels_where_the_wheel_scans_do(tmp_path):
    targets = {"RL": disc_file(tmp_path), "FR": DISC}
    alone = write_mixed(tmp_path / "car", targets, spacing_m=0.02)
    write_whole(tmp_path / "whole", seed=1, vehicle=BARE, scanner=IDEAL, target=WHEEL,
                targets=targets, points=300_000)  # fmt: skip
    truth = json.loads((tmp_path / "whole" / "truth.json").read_text(encoding="utf-8"))
    assert truth["wheels"] == alone["wheels"]
    assert truth["used"]["targets"] == alone["used"]["targets"]
    points, _ = read_ply(tmp_path / "whole" / "vehicle.ply")
    for wheel, scan in zip(truth["wheels"], truth["used"]["scans"], strict=True):
        name = wheel["name"]
        assert (scan["points_on_target"][name] > 0) == (name in targets)
        if name in targets:
            shown = wheel["clamped_target"]
            off = points - shown["centre_m"]
            near = off[np.linalg.norm(off, axis=1) < 0.1]
            on_face = np.abs(near @ shown["normal"]) < 1e-6
            seen = sum(one["points_on_target"][name] for one in truth["used"]["scans"])
            assert 0.4 * seen < np.count_nonzero(on_face) < 0.9 * seen
