"""`wheelplane measure` beside Open3D's reader and segment_plane, on the same eight scans.

    .venv/bin/python -m tests.bench.speed [--runs 5] [--folder DIR]

Whole processes in turn, A B A B ...; wall time and peak memory as the system accounts them.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WHEELPLANE = [sys.executable, "-m", "wheelplane"]
SPACING_M = 0.00053  # gives scans of 1.8 million points

OPEN3D = """
import ctypes, sys
try:
    import libusb_package
    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
except ImportError:
    pass
import open3d
for file in sys.argv[1:]:
    cloud = open3d.io.read_point_cloud(file)
    cloud.segment_plane(distance_threshold=0.0024, ransac_n=3, num_iterations=1000)
"""


def make_capture(folder: Path, trials: int = 4) -> None:
    """Four wheels and trials, one scan each, unless they are there already."""
    if (folder / "capture.toml").is_file():
        return
    text = (Path(__file__).parents[2] / "configs/scanners/default.toml").read_text()
    scanner = folder.parent / "fine.toml"
    scanner.write_text(text.replace("spacing_m = 0.0009", f"spacing_m = {SPACING_M}"))
    command = [*WHEELPLANE, "synth", str(folder), "--seed", "7", "--trials", str(trials)]
    subprocess.run([*command, "--scanner", str(scanner)], check=True)


def run(command: list[str]) -> tuple[float, float]:
    """Wall seconds and peak resident megabytes of one whole process."""
    start = time.perf_counter()
    process = os.posix_spawn(
        command[0],
        command,
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    _, status, usage = os.wait4(process, 0)
    seconds = time.perf_counter() - start
    if status:
        sys.exit(f"{command[:4]} ended with status {status}")
    return seconds, usage.ru_maxrss / 1024.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.folder or Path(scratch)) / "capture"
        folder.parent.mkdir(parents=True, exist_ok=True)
        make_capture(folder)
        files = sorted(str(path) for path in folder.glob("*.ply"))
        ours = [*WHEELPLANE, "measure", str(folder), "--json"]
        theirs = [sys.executable, "-c", OPEN3D, *files]
        run(ours)
        pairs = [(run(ours), run(theirs)) for _ in range(options.runs)]
    sizes = [Path(file).stat().st_size for file in files] if options.folder else []
    for name, index in (("wheelplane measure", 0), ("Open3D read + segment_plane", 1)):
        wall = [pair[index][0] for pair in pairs]
        peak = max(pair[index][1] for pair in pairs)
        print(
            f"{name:28s} {statistics.median(wall):7.2f} s ({min(wall):.2f} to {max(wall):.2f}), "
            f"peak {peak:.0f} MB"
        )
    ratios = [theirs[0] / ours[0] for ours, theirs in pairs]
    print(f"ratio {statistics.median(ratios):.1f} ({min(ratios):.1f} to {max(ratios):.1f})")
    if sizes:
        print(f"files of {max(sizes) / 1e6:.1f} MB at most")


if __name__ == "__main__":
    main()
