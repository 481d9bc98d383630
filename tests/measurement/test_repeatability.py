"""Repeat scans: pooled as the covariance says, scatter judged, drift found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.uncertainty.test_propagation import WHEELS, car
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import InstrumentConfig
from wheelplane.errors import InputError
from wheelplane.measurement.assumptions import notes_of_assumptions
from wheelplane.measurement.evaluate import align
from wheelplane.measurement.records import Evidence, Observation, Provenance
from wheelplane.measurement.repeatability import pool, pool_repeats
from wheelplane.targets.registry import load_target
from wheelplane.uncertainty.components import (
    UncertaintyComponent,
    flatness_component,
    mounting_component,
)

NOWHERE = Provenance("test", None, "0", {}, {}, 0)


def test_pooling_is_least_squares_weighed_by_the_covariance():
    rng = np.random.default_rng(0)
    for count in (2, 5):
        root = rng.normal(size=(count, count)) + 2 * np.eye(count)
        V = 1e-10 * (root @ root.T + 3.0)  # with a part that all share
        values = 0.01 + rng.multivariate_normal(np.zeros(count), V)
        inverse, one = np.linalg.inv(V), np.ones(count)
        pooled = pool("toe", values, V)
        weight = inverse @ one / (one @ inverse @ one)
        assert pooled.pooled == pytest.approx(weight @ values, abs=1e-12)
        assert pooled.u == pytest.approx((one @ inverse @ one) ** -0.5, rel=1e-6)
        left = values - pooled.pooled
        assert pooled.chi_square == pytest.approx(left @ inverse @ left, rel=1e-6)
        assert pooled.probability == pytest.approx(stats.chi2.sf(pooled.chi_square, count - 1))


def drawn(scale, drift=0.0, count=6, runs=300):
    """Pooled results of values drawn with `scale` times the stated deviation, and a drift."""
    rng = np.random.default_rng(1)
    V = 1e-10 * (np.eye(count) + 5.0)
    shape = np.linalg.cholesky(1e-10 * np.eye(count))
    return [
        pool(
            "toe",
            1e-5 * rng.normal() + scale * shape @ rng.normal(size=count) + drift * np.arange(count),
            V,
        )
        for _ in range(runs)
    ]


def test_scatter_is_judged_by_its_chance():
    honest = drawn(1.0)
    for status in ("larger", "smaller"):
        wrong = sum(found.status == status for found in honest)
        assert wrong <= stats.binom.ppf(0.999, len(honest), 0.01)
    assert np.mean([found.chi_square / found.dof for found in honest]) == pytest.approx(
        1.0, abs=4.5 * np.sqrt(2 / 5 / len(honest))
    )
    assert np.mean([found.status == "larger" for found in drawn(4.0)]) > 0.9
    assert np.mean([found.status == "smaller" for found in drawn(0.1)]) > 0.9


def test_scatter_beyond_u_widens_the_pooled_value():
    """Where it is larger than predicted; the true value is 0, all scans share one error."""
    rng, count, runs = np.random.default_rng(4), 4, 400
    own, shared, beyond = 1e-5, 2e-5, 2e-4
    V = own**2 * np.eye(count) + shared**2
    found = []
    for _ in range(runs):
        values = shared * rng.normal() + np.hypot(own, beyond) * rng.normal(size=count)
        found.append(pool("toe", values, V))
    larger = [one for one in found if one.status == "larger"]
    assert len(larger) > 0.95 * runs
    for one in larger[:20]:
        assert pool("toe", one.values, V + one.scatter**2 * np.eye(count)).chi_square == (
            pytest.approx(count - 1, rel=1e-6)
        )
    error = np.array([one.pooled / one.u for one in larger])
    outside = np.count_nonzero(np.abs(error) > stats.t.ppf(0.975, count - 1))
    assert stats.binom.cdf(outside, len(larger), 0.05) > 0.001
    assert stats.binom.sf(outside - 1, len(larger), 0.05) > 0.001
    drift = np.array([one.drift / one.u_drift for one in larger])
    assert np.mean(np.abs(drift) > stats.t.ppf(0.975, count - 1)) < 0.1
    for one in found + drawn(1.0):
        assert (one.scatter > 0.0) == (one.status == "larger")


def test_drift_is_found_with_its_uncertainty():
    still = np.array([(found.drift, found.u_drift) for found in drawn(1.0)])
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(still)) / len(still)
    assert low < np.mean((still[:, 0] / still[:, 1]) ** 2) < high
    moving = np.array([found.drift for found in drawn(1.0, drift=5e-5)])
    assert moving.mean() == pytest.approx(5e-5, rel=0.02)
    assert pool("toe", np.array([0.0, 1e-5]), 1e-10 * np.eye(2)).drift is None


def measurement(plate=True, moved=(5e-5, -5e-5), runouts=()):
    """A car whose RR was scanned three times; what comes with the plate is large.

    runouts: of its tyre as each scan shows it, radians.
    """
    targets = car(11)
    rear = targets[0]
    if plate:
        extra = (
            flatness_component(1e-3, 0.125, rear.normal),
            mounting_component(1e-3, 0.0, rear.normal),
        )
        rear = replace(rear, components=(*rear.components, *extra))
    axis = np.cross(rear.normal, [0.3, 0.5, 0.8])
    again = [
        replace(rear, normal=(n := rear.normal + turn * axis) / np.linalg.norm(n)) for turn in moved
    ]
    tilts = [(UncertaintyComponent("tyre run-out", np.eye(6, 3) * u, dof=4.0),) for u in runouts]
    rear, *again = (
        replace(seen, components=(*seen.components, *tilt))
        for seen, tilt in zip((rear, *again), tilts or [()] * 3, strict=True)
    )
    named = [(w, "reference", w, None) for w in WHEELS[:4]]
    named += [("b", "trial", "RR", "RR"), ("c", "trial", "RR", "RR")]
    seen = [
        Observation(name, role, wheel, f"{name}.ply", "", 1, 0, repeats, Evidence(target))
        for (name, role, wheel, repeats), target in zip(
            named, [rear, *targets[1:4], *again], strict=True
        )
    ]
    return align(seen, NOWHERE)


def test_what_comes_with_the_plate_cancels_between_its_scans():
    result = measurement()
    (group,) = pool_repeats(result)
    assert (group.of, group.scans) == ("RR", ("RR", "b", "c"))
    toe = group.angles[0]
    alone = pool_repeats(measurement(plate=False))[0].angles[0]
    # The scatter is judged without the plate, the pooled value has it.
    assert toe.u_drift == pytest.approx(alone.u_drift, rel=1e-3)
    assert toe.u > 10 * alone.u
    assert result.wheels[0].u_toe_rad > 20 * alone.u_drift


def test_run_out_of_a_tyre_is_in_all_its_scans_alike_however_large_each_shows_it():
    """Repeat scans do not lessen it, nor is it extrapolated away by its unlike sizes."""
    alone = pool_repeats(measurement(plate=False))[0].angles[0]
    result = measurement(plate=False, runouts=(2e-3, 1.8e-3, 2.1e-3))
    toe = pool_repeats(result)[0].angles[0]
    assert toe.u == pytest.approx(np.hypot(2e-3, alone.u), rel=1e-2)
    assert toe.pooled == pytest.approx(alone.pooled, abs=0.1 * alone.u)
    assert toe.u_drift == pytest.approx(alone.u_drift, rel=1e-2)
    assert toe.chi_square == pytest.approx(alone.chi_square, rel=1e-2)


def test_a_scan_that_moved_is_reported():
    assert pool_repeats(measurement())[0].angles[0].status != "larger"
    assert pool_repeats(measurement(moved=(0.0, 2e-3)))[0].angles[0].status == "larger"
    noted = [
        [note for note in notes_of_assumptions(each, load_target("disc-250"), InstrumentConfig())
         if note.startswith("Repeat scans of RR scatter")]
        for each in (measurement(), measurement(moved=(0.0, 2e-3)))
    ]  # fmt: skip
    assert (len(noted[0]), len(noted[1])) == (0, 1)
    toe = pool_repeats(measurement(moved=(0.0, 2e-3)))[0].angles[0]
    assert toe.scatter == pytest.approx(np.std(toe.values, ddof=1), rel=0.02)
    assert f"toe {np.degrees(toe.scatter) * 60:.1f}'" in noted[1][0]


@pytest.mark.parametrize(
    ("moved", "pooled"),
    [((0.0, 0.0), ()), ((0.0, 5e-5), ("RR", "c")), ((5e-5, 5e-5), ("RR", "b"))],
)
def test_copies_are_not_pooled(moved, pooled):
    """A copy of RR, pooled as a scan of its own, had 0.7 of its u, and "less scatter" besides."""
    groups = pool_repeats(measurement(moved=moved))
    assert tuple(name for group in groups for name in group.scans) == pooled


def test_no_repeats_no_groups():
    targets = car(12)
    seen = [
        Observation(w, "reference", w, "", "", 1, 0, None, Evidence(t))
        for w, t in zip(WHEELS[:4], targets[:4], strict=True)
    ]
    assert pool_repeats(align(seen, NOWHERE)) == ()


TOML = """
target = "disc-250"
[reference]
RR = "rr.xyz"
RL = "rl.xyz"
FR = "fr.xyz"
FL = "fl.xyz"
[[trial]]
name = "again"
file = "b.xyz"
repeats = {}
[[trial]]
name = "third"
file = "c.xyz"
repeats = {}
"""


def opened(folder, first, second, extra=""):
    for name in ("rr", "rl", "fr", "fl", "b", "c"):
        (folder / f"{name}.xyz").write_text("0 0 0\n")
    (folder / "capture.toml").write_text(TOML.format(first, second) + extra)
    with open_capture(folder) as capture:
        return capture.entries


def test_capture_names_what_is_repeated(tmp_path):
    entries = opened(tmp_path, '"FL"', '"RR"')
    assert [(e.name, e.wheel, e.repeats) for e in entries[4:]] == [
        ("again", "FL", "FL"),
        ("third", "RR", "RR"),
    ]
    assert entries[0].repeats is None


@pytest.mark.parametrize(
    ("first", "second", "extra", "said"),
    [
        ('"XX"', '"RR"', "", "repeats 'XX'"),
        ('"again"', '"RR"', "", "repeats 'again'"),
        ('"RR"', '"again"', "", "repeats no other"),
        ('"RR"', '"FL"', 'wheel = "FR"\n', "leave its wheel out"),
    ],
)
def test_a_repeat_of_nothing_is_refused(tmp_path, first, second, extra, said):
    with pytest.raises(InputError, match=said) as error:
        opened(tmp_path, first, second, extra)
    assert "\n" not in str(error.value)
