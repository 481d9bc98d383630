"""Calibrations of machines with known errors: coverage of U, bias, power, risks of each rule.

.venv/bin/python -m tests.bench.calibration [--calibrations 1000] [--draws 200000] [--seed 0]
    [--study risks|detection|coverage] [--machine TEXT]

Vehicles are drawn from configs/vehicles/saloon.toml, with 8 trials. The reference is the truth with
errors drawn as its covariance states them (10" of every plane, 0.04 mm of every centre); readings
are those of the generator's machine. All goes through `calibrate`, as the command calls it.
"""

from __future__ import annotations

import argparse
import math
import os
from collections import defaultdict

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from scipy import integrate, stats  # noqa: E402

from tests.support.calibration_bay import Bay, item_of, machine  # noqa: E402
from wheelplane.calibration.calibrate import calibrate  # noqa: E402
from wheelplane.calibration.evaluate import _verdict  # noqa: E402
from wheelplane.calibration.forms.item import DecisionRule  # noqa: E402
from wheelplane.calibration.forms.plan_file import Plan, PlannedQuantity  # noqa: E402
from wheelplane.calibration.plan import detections, planned_set  # noqa: E402
from wheelplane.measurement import Estimate  # noqa: E402
from wheelplane_synth.machine.indicate import error, true_values  # noqa: E402
from wheelplane_synth.parameters.machine import Indication, Protocol  # noqa: E402

MINUTE = math.radians(1.0 / 60.0)
PLANTED = {"zero": 1.0, "gain": 0.02, "hysteresis": 1.0}
ANGLE = Indication(positive="toe-in", axis="rear-axle", **PLANTED, repeatability=0.8,
                   resolution=0.1)  # fmt: skip
MACHINES = {
    "one series of 3": ({"series": 1, "repeats": 3}, {}),
    "4 series of 2": ({"series": 4, "repeats": 2}, {"reproducibility": 0.5}),
    "resolution 1', no scatter": (
        {"series": 1, "repeats": 3, "directions": False},
        {"resolution": 1.0, "repeatability": 0.0},
    ),
    "resolution 1', scatter 0 to 1'": (
        {"series": 1, "repeats": 3},
        {"resolution": 1.0, "repeatability": (0.0, 1.0), "hysteresis": (0.0, 2.0)},
    ),
}  # a pair is drawn anew for every calibration
MACHINES |= {
    f"resolution {step:g}', scatter {scatter:g}'": (
        {"series": 1, "repeats": 3},
        {"resolution": step, "repeatability": scatter, "hysteresis": (0.0, 2.0)},
    )
    for step, scatter in ((1.0, 0.0), (1.0, 0.1), (1.0, 0.2), (1.0, 0.5), (1.0, 1.0), (0.1, 0.0),
                          (0.1, 0.1), (0.1, 0.2), (0.1, 0.5), (0.1, 1.0))
}  # fmt: skip
MACHINES["resolution 1', 4 series"] = (
    {"series": 4, "repeats": 2},
    {"resolution": 1.0, "repeatability": (0.0, 1.0), "reproducibility": (0.0, 1.0)},
)
PLANS = 200  # of the calibrations whose power is planned
# Scatter with which the three errors are detected now and then, so that the power can be compared.
HARD = {"zero": 3.0, "gain": 1.0, "hysteresis": 2.5}


def tested(protocol, changes):
    """A machine of all quantities."""
    toe = ANGLE.model_copy(update=changes)
    tables = {
        "toe": toe,
        "camber": toe.model_copy(update={"positive": "top-out", "axis": None}),
        "total_toe": toe.model_copy(update={"axis": None}),
        "thrust_angle": toe.model_copy(update={"positive": "right"}),
        "track": toe.model_copy(update={"positive": "length", "axis": None, "gain": 0.001,
                                        "resolution": 0.2}),
    }  # fmt: skip
    return machine(protocol=Protocol(**({"directions": True} | protocol)), **tables)


def share(hits, total):
    """A share with its 95 % limits."""
    low, high = stats.beta.ppf([0.025, 0.975], [hits, hits + 1], [total - hits + 1, total - hits])
    return f"{hits / total:.1%} ({low:.1%} - {high:.1%})"


def coverage(count, seed, named):
    """U of every error covers the true one; zero, sensitivity and hysteresis likewise; biases."""
    print(f"\nCoverage of U (95 %), {count} calibrations\n")
    print("| machine | what | covered | bias / its standard error |\n|---|---|---|---|")
    for name, (protocol, changes) in MACHINES.items():
        if named not in name:
            continue
        found = defaultdict(list)
        for index in range(count):
            rng = np.random.default_rng((seed, index, 1))
            drawn = {
                key: rng.uniform(*value) if isinstance(value, tuple) else value
                for key, value in changes.items()
            }
            known = tested(protocol, drawn)
            bay = Bay((seed, index))
            done = calibrate([bay.reference()], item_of(known), bay.readings(known))
            for result in done.results:
                for what, value in of_result(result, bay, known).items():
                    found[what].append(value)
        for what, rows in found.items():
            hits = np.array([np.mean([abs(d) <= u for d, u in row]) for row in rows])
            off = np.array([np.mean([d for d, _ in row]) for row in rows])
            t = off.mean() / (off.std(ddof=1) / math.sqrt(len(off)))
            spread = 1.96 * hits.std(ddof=1) / math.sqrt(len(hits))
            text = f"| {name} | {what} | {hits.mean():.1%} +- {spread:.1%} | {t:+.1f} |"
            print(text, flush=True)


def of_result(result, bay, known):
    """By what: pairs of the deviation from the truth, and U; radians, metres, or a number."""
    table = known.quantities()[result.quantity]
    unit = 1e-3 if result.unit == "m" else MINUTE
    true = true_values(bay.truth, table, result.quantity)
    kind = result.quantity.replace("_", " ")
    pairs = [(p.error.value - error(table, true[p.point]) * unit, p.error.expanded)
             for p in result.points]  # fmt: skip
    line, hysteresis = result.characteristic, result.hysteresis
    found = {kind: pairs}
    if hysteresis is not None:
        found[f"{kind}: hysteresis"] = [
            (hysteresis.value - table.hysteresis * unit, hysteresis.expanded)
        ]
    if line.sensitivity is not None:
        found[f"{kind}: zero"] = [(line.zero.value - table.zero * unit, line.zero.expanded)]
        found[f"{kind}: sensitivity"] = [
            (line.sensitivity.value - 1.0 - table.gain, line.sensitivity.expanded)
        ]
    return found


def detection(count, seed):
    """Rates at which planted errors exceed their U, and the power that the plan states."""
    print(f"\nDetection of zero 1', gain 2 %, hysteresis 1' in toe, {count} calibrations\n")
    print("| error | scatter | series | detected | planned power |\n|---|---|---|---|---|")
    for name, scatter in HARD.items():
        for series in (1, 3):
            hits, planned = 0, []
            for index in range(count):
                hit, power = detected(name, scatter, series, (seed, index, series), index < PLANS)
                hits += hit
                planned += power
            found = f"{share(hits, count)} | {np.mean(planned):.1%} |"
            print(f"| {name} | {scatter}' | {series} | {found}", flush=True)


def detected(name, scatter, series, seed, planned):
    """Whether a planted error exceeds its U in one calibration; its power by a plan, if wanted."""
    toe = ANGLE.model_copy(update={"repeatability": scatter})
    known = machine(protocol=Protocol(series=series, repeats=3), toe=toe)
    bay, item = Bay(seed), item_of(known)
    (result,) = calibrate([bay.reference()], item, bay.readings(known)).results
    line = result.characteristic
    estimate, null = {
        "zero": (line.zero, 0.0),
        "gain": (line.sensitivity, 1.0),
        "hysteresis": (result.hysteresis, 0.0),
    }[name]
    hit = estimate is not None and estimate.value - null > estimate.expanded
    if not planned:
        return hit, []
    table = PlannedQuantity(repeatability=f"{scatter}'", zero="1'", gain=0.02, hysteresis="1'")
    plan = Plan(trials=8, repeats=3, series=series, directions=True, toe=table)
    set_ = planned_set("toe", plan, item.item, bay.reference(noisy=False))
    return hit, [d.power for d in detections("toe", plan, item.item, set_) if d.name == name]


RULES = {
    "guarded": DecisionRule(rule="guarded"),
    "simple": DecisionRule(rule="simple"),
    "shared": DecisionRule(rule="shared", ratio=3.0),
}
MPE, U_STANDARD = 4.0 * MINUTE, 0.6 * MINUTE


def risks(draws, seed):
    """False acceptance and rejection over a grid of true errors, and by a prior, of each rule."""
    rng = np.random.default_rng(seed)
    print(f"\nRisks at MPE 4', u = 0.6', {draws} draws each; integrals of JCGM 106, clause 9\n")
    print("| rule | true error / MPE | accepted | integral | rejected | integral |")
    print("|---|---|---|---|---|---|")
    worst = 0.0
    for name, rule in RULES.items():
        accept, reject = limits(rule)
        for true in np.linspace(0.0, 1.5, 13) * MPE:
            seen = true + U_STANDARD * rng.standard_normal(draws)
            shares = (np.mean(np.abs(seen) <= accept), np.mean(np.abs(seen) > reject))
            known = (inside(true, accept), 1.0 - inside(true, reject))
            for found, expected in zip(shares, known, strict=True):
                u = math.sqrt(max(expected * (1.0 - expected), 1.0 / draws) / draws)
                worst = max(worst, abs(found - expected) / u)
            print(f"| {name} | {true / MPE:.3f} | {shares[0]:.4f} | {known[0]:.4f} "
                  f"| {shares[1]:.4f} | {known[1]:.4f} |")  # fmt: skip
    print(f"\nlargest deviation: {worst:.1f} standard errors of the draws")
    print("\n| rule | false acceptance | integral | false rejection | integral |")
    print("|---|---|---|---|---|")
    prior = 2.0 * MINUTE
    true = prior * rng.standard_normal(draws)
    seen = true + U_STANDARD * rng.standard_normal(draws)
    for name, rule in RULES.items():
        accept, reject = limits(rule)
        bad = np.abs(true) > MPE
        shares = (np.mean(bad & (np.abs(seen) <= accept)), np.mean(~bad & (np.abs(seen) > reject)))
        known = global_risks(prior, accept, reject)
        print(f"| {name} | {shares[0]:.5f} | {known[0]:.5f} | {shares[1]:.5f} | {known[1]:.5f} |")


def limits(rule):
    """Largest accepted and least rejected error, found by asking the calibration's own decision."""
    return tuple(
        edge(lambda x, d=decision, r=rule: (decided(x, r) == d) == (d == "conform"))
        for decision in ("conform", "not conform")
    )


def decided(value, rule):
    """The calibration's decision on one error."""
    return _verdict("toe", "1", Estimate(value, U_STANDARD), MPE, rule).decision


def edge(below):
    """The value up to which `below` holds."""
    low, high = 0.0, 3.0 * MPE
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if below(middle) else (low, middle)
    return low


def inside(true, limit):
    """Probability that a measured error lies within a limit: JCGM 106, 9.4."""
    return float(
        stats.norm.cdf((limit - true) / U_STANDARD) - stats.norm.cdf((-limit - true) / U_STANDARD)
    )


def global_risks(prior, accept, reject):
    """Global consumer's and producer's risk of a normal prior: JCGM 106, equations 17 and 19."""
    density = stats.norm(scale=prior).pdf
    outside = integrate.quad(lambda x: density(x) * inside(x, accept), MPE, 8.0 * prior, limit=500)
    within = integrate.quad(lambda x: density(x) * (1.0 - inside(x, reject)), -MPE, MPE, limit=500)
    return 2.0 * outside[0], within[0]


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calibrations", type=int, default=1000)
    parser.add_argument("--draws", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=0)
    studies = ["all", "risks", "detection", "coverage"]
    parser.add_argument("--study", choices=studies, default="all")
    parser.add_argument("--machine", default="", help="coverage: those with this in their name")
    options = parser.parse_args()
    if options.study in ("all", "risks"):
        risks(options.draws, options.seed)
    if options.study in ("all", "detection"):
        detection(options.calibrations, options.seed)
    if options.study in ("all", "coverage"):
        coverage(options.calibrations, options.seed, options.machine)


if __name__ == "__main__":
    main()
