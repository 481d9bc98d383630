"""Rates of 'agree' and 'disagree' against their nominal values, and detectable errors.

.venv/bin/python -m tests.bench.validation [--vehicles 200] [--repeats 200] [--scanned 0] [--seed 0]

Vehicles are drawn from configs/vehicles/saloon.toml. The five points are observed by the
generator's total station (synth/output/five_point.py) at the noise named; the dense method gives
the truth with errors drawn as it states them: 10" of every plane, 0.04 mm of every centre, as
`tests.bench.intervals` finds them for disc-250. --scanned makes that many vehicles whose wheels are
scanned (tests/support/scenes.py), and goes from files to verdicts, five points and virtual ones.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402

from tests.support.validation_cars import TM30, Car, stated, write_capture  # noqa: E402
from wheelplane.capture.open_capture import open_capture  # noqa: E402
from wheelplane.config import Config  # noqa: E402
from wheelplane.five_point import Station  # noqa: E402
from wheelplane.validation.five_point import FivePointOptions  # noqa: E402
from wheelplane.validation.request import Request  # noqa: E402
from wheelplane.validation.study import ComparisonStudy, Row  # noqa: E402
from wheelplane.validation.validate_capture import validate_capture  # noqa: E402
from wheelplane_synth.parameters.parameters import TotalStation  # noqa: E402

ERROR = np.radians(0.1)
STATIONS = {
    "0.6 mm, aiming 2 mm": TM30,
    "0.1 mm, aiming 0.2 mm": TM30.model_copy(
        update={"range_sigma_m": 1e-4, "aiming_sigma_m": 2e-4}
    ),
    "0.03 mm, aiming 0.05 mm": TM30.model_copy(
        update={"range_sigma_m": 3e-5, "aiming_sigma_m": 5e-5}
    ),
}
PLANTED = {"one toe": np.array([0.0, 0.0, ERROR, 0.0]), "all toes": np.full(4, ERROR)}


def cars(count: int, seed: int, station: TotalStation, **options: object) -> list:
    """That many comparisons."""
    return [
        replace(Car((seed, index)).compare(station=station, **options), vehicle=str(index))
        for index in range(count)
    ]


def share(hits: int, total: int) -> str:
    """A share with its 95 % limits."""
    low, high = stats.beta.ppf([0.025, 0.975], [hits, hits + 1], [total - hits + 1, total - hits])
    low, high = (0.0 if hits == 0 else low), (1.0 if hits == total else high)
    return f"{hits / total:.2%} ({low:.2%} - {high:.2%})"


def of_single_captures(count: int, seed: int) -> None:
    """Agree where both are right; disagree where 0.1 degrees are planted; what is seen."""
    print(f"\nSingle captures, {count} vehicles each\n")
    print("| total station | its noise | agree, both right | 0.1° in one toe caught "
          "| in all toes | detectable in one angle | in all toes |")  # fmt: skip
    print("|---|---|---|---|---|---|---|")
    for name, station in STATIONS.items():
        for known in (True, False):
            right = cars(count, seed, station, known=known)
            caught = [
                sum(not one.joint.agrees
                    for one in cars(count, seed + 1, station, known=known, toe_error=error))
                for error in PLANTED.values()
            ]  # fmt: skip
            seen = [
                np.degrees(np.median([f(one) for one in right[:20]]))
                for f in (
                    lambda c: c.detectable_in_one_rad,
                    lambda c: c.detectable_in_all_rad("toe"),
                )
            ]
            shown = "stated" if known else "from scatter, --aiming"
            print(f"| {name} | {shown} | {share(sum(c.joint.agrees for c in right), count)} "
                  f"| {share(caught[0], count)} | {share(caught[1], count)} "
                  f"| {seen[0]:.3f}° | {seen[1]:.3f}° |", flush=True)  # fmt: skip


def of_archives(count: int, repeats: int, seed: int) -> None:
    """The verdict of a whole archive, and how many captures settle 0.1 degrees."""
    print("\nArchives, 0.6 mm station stated\n")
    whole = survey(count, seed + 1, None)
    toe = whole.agreements[0]
    needed = max(one.units_for(ERROR) for one in whole.agreements)
    biased = survey(count, seed + 2, PLANTED["all toes"])
    print(f"- {count} captures, both right: {whole.verdict}; 0.1° in all toes: {biased.verdict}")
    print(f"- they would see {np.degrees(toe.detectable):.4f}°; 0.1° takes {needed} captures")
    for name, error in (("both right", None), ("0.1° in all toes", PLANTED["all toes"])):
        found = [survey(needed, (seed, index), error) for index in range(repeats)]
        agreed = sum(one.verdict == "agree" for one in found)
        ends = [one.agreements[0].bias for one in found]
        seen = sum(not end.low <= 0.0 <= end.high for end in ends)
        text = f"- {repeats} archives of {needed}, {name}: 'agree' in {share(agreed, repeats)}, "
        print(f"{text}limits of toe's bias leave out 0 in {share(seen, repeats)}", flush=True)


def survey(count: int, seed: object, error: np.ndarray | None) -> ComparisonStudy:
    """An archive of that many captures."""
    found = cars(count, np.random.default_rng(seed).integers(2**40), TM30, toe_error=error)
    return ComparisonStudy("", tuple(Row(one.vehicle, one) for one in found), None)


def of_scans(count: int, seed: int) -> None:
    """From files to verdicts: scanned wheels, five points of the 0.6 mm station, virtual ones."""
    print(f"\nScanned vehicles, {count}: from files to verdicts\n")
    requests = {
        "five points, station stated": None,
        "five points, noise from scatter, --aiming 2": Request(
            "five-point", Path("five-point.txt"), FivePointOptions(aiming_m=0.002)
        ),
        "virtual five points": Request("virtual"),
        "truth": Request("truth"),
    }
    found: dict[str, list] = {name: [] for name in requests}
    for index in range(count):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "capture"
            _, place = write_capture(folder, seed * 100_000 + index, TM30, trials=0)
            known = FivePointOptions(station=Station(stated(TM30), place))
            for name, request in requests.items():
                asked = request or Request("five-point", Path("five-point.txt"), known)
                with open_capture(folder) as capture:
                    found[name].append(validate_capture(capture, Config(), asked))
    print("| against | agree | mean d'V^-1 d an angle |\n|---|---|---|")
    for name, each in found.items():
        agreed = sum(one.joint.agrees for one in each)
        mean = np.mean([one.joint.chi_square for one in each]) / 8
        print(f"| {name} | {share(agreed, count)} | {mean:.3f} |", flush=True)


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--scanned", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    of_single_captures(options.vehicles, options.seed)
    if options.repeats:
        of_archives(options.vehicles, options.repeats, options.seed)
    if options.scanned:
        of_scans(options.scanned, options.seed)


if __name__ == "__main__":
    main()
