"""A page to be tested: its application on a folder of samples, and a client that is its browser."""

from __future__ import annotations

import copy
import hashlib
import json
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import FivePointFile, read_five_point
from wheelplane.report.json.measurement import to_tree
from wheelplane.web.app import create_app
from wheelplane.web.security import KEY_HEADER, Guard
from wheelplane.web.settings import PageSettings

PORT = 8765
HERE = f"127.0.0.1:{PORT}"
PAPER = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
OF_RECORD = ("capture", "vehicle_name", "batch")  # what a batch adds to a measurement


class Site:
    """An application whose folder is `allowed`, with the cookie and the key that a page has."""

    def __init__(self, place: Path, port: int = PORT, **limits: Any) -> None:
        self.allowed = place / "allowed"
        scratch = place / "scratch"
        for folder in (self.allowed, scratch):
            folder.mkdir(parents=True, exist_ok=True)
        self.guard = Guard(port)
        settings = PageSettings(folders=(self.allowed,), scratch=scratch, **limits)
        self.app = create_app(settings, self.guard)
        self.client = self.app.test_client()
        for name in ("127.0.0.1", "localhost"):
            self.client.set_cookie(self.guard.cookie, self.guard.session, domain=name)

    def as_a_stranger(self) -> None:
        """Forget the cookie, as the browser of another user of this machine has none."""
        for name in ("127.0.0.1", "localhost"):
            self.client.delete_cookie(self.guard.cookie, domain=name)

    def close(self) -> None:
        self.app.config["state"].jobs.close()

    def ask(self, method: str, path: str, headers: dict[str, str] | None = None, **rest):
        own = {"Host": f"127.0.0.1:{self.guard.port}", KEY_HEADER: self.guard.key}
        given = {k: v for k, v in (own | (headers or {})).items() if v is not None}
        return self.client.open(path, method=method, headers=given, buffered=True, **rest)

    def get(self, path: str, **rest):
        return self.ask("GET", path, **rest)

    def post(self, path: str, tree: object, **rest):
        return self.ask("POST", path, json=tree, **rest)

    def put(self, path: str, data: bytes, **rest):
        return self.ask("PUT", path, data=data, **rest)

    def send(self, **files: bytes) -> str:
        """An upload of these files; `__` in a name stands for a dot."""
        name = self.post("/api/uploads", {}).json["upload"]
        for file, data in files.items():
            answer = self.put(f"/api/uploads/{name}/{file.replace('__', '.')}", data)
            assert answer.status_code == 200, answer.json
        return name

    def measure(self, given: dict[str, object]) -> dict[str, object]:
        """Measure, and wait for the end."""
        answer = self.post("/api/measure", given)
        assert answer.status_code == 200, answer.json
        return self.ended(answer.json["id"])

    def ended(self, job: str) -> dict[str, object]:
        for _ in range(1200):
            state = self.get(f"/api/jobs/{job}").json
            if state["state"] in ("done", "failed", "cancelled"):
                return state
            time.sleep(0.05)
        raise AssertionError(f"job {job} does not end: {state}")

    def copy(self, source: Path, name: str) -> Path:
        place = self.allowed / name
        if source.is_dir():
            shutil.copytree(source, place)
        else:
            shutil.copy(source, place)
        return place


def write_results(folder: Path, measurement: dict, count: int = 12) -> Path:
    """A batch's results: one measurement `count` times, RR toe rising by 0.01 degrees a month."""
    for i in range(count):
        tree = copy.deepcopy(measurement)
        failed = i == count - 1
        key = hashlib.sha256(str(i).encode()).hexdigest()
        tree |= {"capture": f"2026/car-{i:02d}", "vehicle_name": f"AA-{i % 3:02d}"}
        tree["wheels"][0]["toe_deg"] += 0.01 * i
        tree.setdefault("provenance", {})["inputs"] = {"file": f"sha256:{key}"}
        if failed:
            tree |= {"wheels": [], "frame": None, "vehicle": {}}
        tree["batch"] = {
            "key": key,
            "kind": "folder",
            "date": f"2026-{i % 12 + 1:02d}-01",
            "status": "failed" if failed else "ok",
            "stage": "read" if failed else "",
            "reason": "rr.ply: it ends at point 12: <b>copy it again</b>" if failed else "",
            "config_sha256": "",
        }
        place = folder / "measurements" / key[:2] / f"{key}.json"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(tree))
    return folder


def write_turned(folder: Path, count: int = 12) -> Path:
    """The same of planes whose poses show it, which the page can compare."""
    measured = [to_tree(measure_five_point(turned(0.01 * i))) for i in range(count)]
    write_results(folder, measured[0], count)
    for path in folder.rglob("*.json"):
        tree = json.loads(path.read_text())
        if tree["wheels"]:
            known = measured[int(tree["capture"].rpartition("-")[2])]
            path.write_text(json.dumps(known | {key: tree[key] for key in OF_RECORD}))
    return folder


def turned(angle_deg: float) -> FivePointFile:
    """The paper's vehicle with its RR target turned about the vertical, so that RR toe rises."""
    file = read_five_point(PAPER)
    up = measure_five_point(file).frame.up
    centre = file.blocks_m[0].mean(axis=0)
    turn = Rotation.from_rotvec(np.radians(angle_deg) * up)
    file.blocks_m[0] = turn.apply(file.blocks_m[0] - centre) + centre
    return file
