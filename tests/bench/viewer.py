"""Speed of the 3D view with many points, rendered in software (SwiftShader).

    python -m tests.bench.viewer [POINTS] [--budget N]

Prints the time from the points being in memory to the first picture and to the last point, and the
frames a second while the camera turns without a pause.
"""

from __future__ import annotations

import argparse
import functools
import http.server
import json
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

from tests.support.browser import CHROMIUM, FLAGS

BUNDLE = Path(__file__).parents[2] / "pipeline" / "report" / "static" / "viewer.js"
SIZE = {"width": 1280, "height": 800}
ORIGIN, STEP_M = [1.3, 0.0, 0.5], 1e-4
PAGE = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
<div id="view" style="position:fixed;inset:0"></div><script src="viewer.js"></script>
<script>const view = Wheelplane3D.mount(document.getElementById("view"), %s);</script>"""
LOAD = """async ([origin, step_m]) => {
  const get = async (name) => (await fetch(name)).arrayBuffer();
  const xyz = new Int16Array(await get("xyz.bin")), shade = new Uint8Array(await get("shade.bin"));
  const frame = () => new Promise(requestAnimationFrame);
  const start = performance.now(), block = 250000;
  for (let at = 0; at < shade.length; at += block)
    view.addPoints(xyz.subarray(3 * at, 3 * (at + block)), shade.subarray(at, at + block),
      { origin, step_m });
  await frame(); await frame();
  const first = performance.now() - start;
  while (view.stats().drawn < view.stats().loaded) await frame();
  return { first, last: performance.now() - start };
}"""
TURN = """async (frames) => {
  const canvas = document.querySelector("canvas"), times = [];
  for (let i = 0; i < frames; i++) {
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    times.push(await new Promise(requestAnimationFrame));
  }
  return { times, ...view.stats() };
}"""


def main() -> None:
    """Make the points, show them, turn them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("points", nargs="?", type=lambda text: int(float(text)), default=5_000_000)
    parser.add_argument("--budget", type=int, help="points a frame, where not as the view decides")
    parser.add_argument("--frames", type=int, default=120)
    given = parser.parse_args()
    with served(given.points) as address, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = browser.new_page(viewport=SIZE)
        page.on("pageerror", lambda error: print("error:", error))
        page.goto(address)
        if given.budget:
            page.evaluate("budget => view.setBudget(budget)", given.budget)
        loaded = page.evaluate(LOAD, [ORIGIN, STEP_M])
        turned = page.evaluate(TURN, given.frames)
        browser.close()
    took_ms = np.diff(turned["times"])[given.frames // 4 :]  # the budget has settled by then
    print(f"points                 {given.points:>10,}")
    print(f"first picture          {loaded['first'] / 1e3:>10.2f} s")
    print(f"all points drawn       {loaded['last'] / 1e3:>10.2f} s")
    print(f"frames while turning   {1e3 / took_ms.mean():>10.1f} a second")
    print(f"slowest of twenty      {np.quantile(took_ms, 0.95):>10.0f} ms")
    print(f"points a frame         {turned['drawn']:>10,}")


@contextmanager
def served(count: int) -> Iterator[str]:
    """Address of a page with the viewer, its scene and `count` points."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "viewer.js").write_bytes(BUNDLE.read_bytes())
        (place / "index.html").write_text(PAGE % json.dumps(scene()))
        xyz, shade = points(count)
        (place / "xyz.bin").write_bytes(xyz.tobytes())
        (place / "shade.bin").write_bytes(shade.tobytes())
        handler = functools.partial(Quiet, directory=folder)
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            yield f"http://127.0.0.1:{server.server_port}/"
            server.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files and says nothing."""

    def log_message(self, *_: object) -> None:
        """Nothing."""


def scene() -> dict[str, object]:
    """Four wheels with discs, and the axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    wheels = []
    for name, x, y in (("RR", 0.0, -0.8), ("RL", 0.0, 0.8), ("FR", 2.6, -0.8), ("FL", 2.6, 0.8)):
        ring = np.column_stack([x + 0.125 * np.cos(angle), np.full(64, y), 0.125 * np.sin(angle)])
        wheels.append(
            {"name": name, "role": "reference", "wheel": name, "status": "ok",
             "centre": [x, y, 0.0], "normal": [0.0, float(np.sign(y)), 0.0],
             "outline": [ring.tolist()], "colour_class": "reference",
             "toe_text": "toe +00°07'46\"", "camber_text": "camber -01°15'37\""}
        )  # fmt: skip
    axes = [{"name": name, "layer": "axes", "from": [0, 0, 0], "to": (0.5 * np.eye(3)[i]).tolist()}
            for i, name in enumerate(("front", "left", "up"))]  # fmt: skip
    return {"schema": "wheelplane/scene/1", "wheels": wheels, "lines": axes, "cloud": None}


def points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Of a body and, a third of them, of the wheels, in random order, as the page has them."""
    rng = np.random.default_rng(1)
    turn, x = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(-0.7, 3.2, count)
    height = 0.3 + 0.4 * np.exp(-(((x - 1.2) / 1.1) ** 4))
    places = np.column_stack([x, 0.75 * np.cos(turn), 0.3 + height * np.sin(turn)])
    near = rng.uniform(size=count) < 1.0 / 3.0
    radius = 0.3 * np.sqrt(rng.uniform(size=count))
    wheel = rng.integers(0, 4, count)
    centre = np.column_stack([2.6 * (wheel // 2), 1.6 * (wheel % 2) - 0.8, np.zeros(count)])
    face = np.column_stack(
        [radius * np.cos(turn), rng.normal(0, 1e-3, count), radius * np.sin(turn)]
    )
    places[near] = (centre + face)[near]
    steps = np.clip(np.rint((places - ORIGIN) / STEP_M), -32767, 32767)
    return steps.astype("<i2"), (near & (radius < 0.125)).astype(np.uint8)


if __name__ == "__main__":
    main()
