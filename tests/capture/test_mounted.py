"""Targets of a capture: one for all scans, and those of single wheels, trials and run-outs."""

import pytest

from wheelplane.capture import files_of, open_capture, read_capture_file
from wheelplane.capture.mounted import targets_of
from wheelplane.errors import ConfigError, InputError
from wheelplane.targets import TargetChoice, load_target

REFERENCE = '[reference]\nRR = "rr.ply"\nRL = "rl.ply"\nFR = "fr.ply"\nFL = "fl.ply"\n'
TRIALS = (
    '[[trial]]\nname = "1"\nfile = "1.ply"\nwheel = "FL"\n'
    '[[trial]]\nname = "2"\nfile = "2.ply"\n'
    '[[trial]]\nname = "3"\nfile = "3.ply"\nrepeats = "1"\n'
)


def write(folder, head, more=""):
    for name in ("rr", "rl", "fr", "fl", "1", "2", "3", "car"):
        (folder / f"{name}.ply").write_text("", encoding="utf-8")
    (folder / "capture.toml").write_text(head + more, encoding="utf-8")
    return folder


def shapes(folder, target=None):
    with open_capture(folder, target) as capture:
        return {entry.name: capture.target_of(entry).shape for entry in capture.entries}


def test_a_wheels_own_target_is_that_of_its_trials_too(tmp_path):
    head = 'target = "disc-250"\n[targets]\nFL = "wheel"\n'
    found = shapes(write(tmp_path, head, REFERENCE + TRIALS))
    assert found == {"RR": "disc", "RL": "disc", "FR": "disc", "FL": "wheel",
                     "1": "wheel", "2": "disc", "3": "wheel"}  # fmt: skip


def test_a_trial_has_its_own_and_so_has_what_repeats_it(tmp_path):
    head = 'target = "wheel"\n[targets]\nFL = "ring-300"\n1 = "disc-250"\n'
    found = shapes(write(tmp_path, head, REFERENCE + TRIALS))
    assert (found["FL"], found["1"], found["3"]) == ("ring", "disc", "disc")


def test_tables_and_files_are_targets_in_the_unit_of_the_capture(tmp_path):
    (tmp_path / "own.toml").write_text('shape = "disc"\ndiameter = 0.3\n', encoding="utf-8")
    head = (
        'length_unit = "mm"\ntarget = "wheel"\n[targets]\nRR = "own.toml"\n'
        'RL = { shape = "disc", diameter = 250.0, stand_off = 80.0, stand_off_u = 0.5 }\n'
    )
    folder = write(tmp_path, head, REFERENCE)
    with open_capture(folder) as capture:
        assert capture.targets["RR"].diameter == 0.3
        assert capture.targets["RL"].diameter == 0.25
        assert capture.targets["RL"].stand_off == pytest.approx(0.08)
        assert capture.targets["RL"].stand_off_u == pytest.approx(0.0005)
    declared = read_capture_file(folder / "capture.toml", "capture.toml")
    assert "own.toml" in files_of(declared)


def test_an_option_replaces_all_or_only_the_wheels_that_it_names(tmp_path):
    head = 'target = "disc-250"\n[targets]\nFL = "wheel"\n'
    folder = write(tmp_path, head, REFERENCE)
    assert set(shapes(folder, "ring-300").values()) == {"ring"}
    assert shapes(folder, "RR=ring-300") == {"RR": "ring", "RL": "disc", "FR": "disc",
                                             "FL": "wheel"}  # fmt: skip
    both = shapes(folder, "wheel,RR=ring-300")
    assert both == {"RR": "ring", "RL": "wheel", "FR": "wheel", "FL": "wheel"}


def test_no_common_target_is_needed_where_every_scan_has_its_own(tmp_path):
    head = '[targets]\nRR = "wheel"\nRL = "wheel"\nFR = "disc-250"\nFL = "disc-250"\n'
    assert shapes(write(tmp_path, head, REFERENCE))["FR"] == "disc"
    with pytest.raises(InputError, match="no target is named for 2: add --target"):
        shapes(write(tmp_path, head, REFERENCE + TRIALS))


def test_a_scan_that_is_none_is_refused(tmp_path):
    head = 'target = "disc-250"\n[targets]\nLF = "wheel"\n'
    with pytest.raises(InputError, match=r"\[targets\] LF: there is no such scan: name one of RR"):
        shapes(write(tmp_path, head, REFERENCE))


def test_a_target_that_is_no_name_is_refused(tmp_path):
    head = 'target = "disc-250"\n[targets]\nFL = 3\n'
    with pytest.raises(ConfigError, match=r"\[targets\] FL: target is 3: name one"):
        shapes(write(tmp_path, head, REFERENCE))


def test_one_cloud_shows_the_target_of_each_wheel(tmp_path):
    head = 'cloud = "car.ply"\ntarget = "disc-250"\n[targets]\nFL = "wheel"\n'
    with open_capture(write(tmp_path, head), "FR=ring-300") as capture:
        found = {wheel: one.shape for wheel, one in capture.of_wheels.items()}
    assert found == {"RR": "disc", "RL": "disc", "FR": "ring", "FL": "wheel"}
    with pytest.raises(InputError, match=r"no target is named for RL: add --target"):
        shapes(write(tmp_path, 'cloud = "car.ply"\n[targets]\nRR = "wheel"\n'))


def test_a_file_of_five_points_is_said_to_be_of_another_command(tmp_path):
    file = tmp_path / "five-point.txt"
    file.write_text("0.0 0.0 0.0\n" * 20)
    with pytest.raises(InputError, match=r"disc-250; a file of five points .* five-point`"):
        shapes(file)


def test_targets_of_names_the_choice_before_the_file(tmp_path):
    folder = write(tmp_path, 'target = "disc-250"\n', REFERENCE)
    with open_capture(folder) as capture:
        scans = capture.entries
    declared = read_capture_file(folder / "capture.toml", "x")
    choice = TargetChoice(None, {"FL": load_target("wheel")})
    common, own = targets_of(declared, choice, scans, folder, "x")
    assert common.shape == "disc"
    assert {name: one.shape for name, one in own.items()} == {"FL": "wheel"}
