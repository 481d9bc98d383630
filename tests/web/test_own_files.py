"""Own targets, scanners and tolerances in the page: offered, used, checked at the start."""

from __future__ import annotations

import json
import re

import pytest

from tests.support.made import write_small_capture
from tests.support.web_site import Site
from wheelplane.commands.view import check_own, settings_of
from wheelplane.errors import WheelplaneError
from wheelplane.web.content.choices import checked, known
from wheelplane.web.security import RefusedError

PLATE = 'shape = "disc"\ndiameter = 0.25\n'


@pytest.fixture
def own(tmp_path):
    folder = tmp_path / "own"
    for kind in ("targets", "scanners", "tolerances"):
        (folder / kind).mkdir(parents=True)
    (folder / "targets" / "plate-7.toml").write_text(PLATE)
    (folder / "targets" / "disc-250.toml").write_text(PLATE.replace("0.25", "0.4"))
    (folder / "settings.toml").write_text('[report]\nlaboratory = "Lab of the gate"\n')
    return folder


def test_own_names_come_first_and_stand_for_shipped_ones(own):
    names = known(own)["targets"]
    assert names[:2] == ["disc-250", "plate-7"]
    assert names.count("disc-250") == 1
    assert set(names) == {*known()["targets"], "plate-7"}
    assert checked({"target": "plate-7"}, own) == {"target": str(own / "targets" / "plate-7.toml")}
    assert checked({"target": "disc-250"}, own)["target"].endswith("own/targets/disc-250.toml")
    assert checked({"target": "square-300"}, own) == {"target": "square-300"}


@pytest.mark.parametrize("name", ["../own/targets/plate-7", "plate-7.toml", "settings"])
def test_paths_are_no_names(own, name):
    with pytest.raises(RefusedError, match="not an available choice"):
        checked({"target": name}, own)
    with pytest.raises(RefusedError, match="not an available choice"):
        checked({"target": "plate-7"})


def test_a_capture_is_measured_by_the_own_target(own, tmp_path):
    site = Site(tmp_path / "site", own=own)
    write_small_capture(site.allowed / "car", trials=0)
    assert re.search(r'<option value="plate-7">', site.get("/").text)
    asked = {"root": 0, "path": "car", "options": {"target": "plate-7"}}
    job = site.ended(site.post("/api/measure", asked).json["id"])
    assert job["state"] == "done"
    tree = json.loads(site.get(f"/api/jobs/{job['id']}/measurement.json").text)
    assert tree["provenance"]["config"]["target"]["diameter"] == 0.25
    asked["options"]["target"] = "disc-250"  # the user's, of another size
    job = site.ended(site.post("/api/measure", asked).json["id"])
    assert job["state"] == "failed"
    site.close()


def test_the_folder_is_checked_before_the_page_opens(own, tmp_path):
    check_own(own)
    check_own(None)
    assert settings_of(own) == own / "settings.toml"
    assert settings_of(tmp_path) is None
    with pytest.raises(WheelplaneError, match=r"holds none of targets/\*.toml"):
        check_own(tmp_path / "own" / "targets")
    (own / "targets" / "plate-7.toml").write_text('shape = "disk"\n')
    with pytest.raises(WheelplaneError, match=r"plate-7.toml: target shape 'disk' is not known"):
        check_own(own)
