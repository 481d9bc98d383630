"""The mixed pixels near a rim: against sums over the spot, and its slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.centre.edge.mixed_pixel import TAKEN_FOR, Profile, edge_profile, rounded

# x/s, tau, B, s, T: incidence up to 60 degrees on the wall, plates of 3 to 20 mm.
CASES = [
    (tau, background, spot, thickness)
    for tau in (0.0, 0.05, 0.3, 1.0, 1.7)
    for background in (0.025, 0.08, 0.3)
    for spot in (0.0005, 0.003)
    for thickness in (0.003, 0.01, 0.02)
]


def step_profile(x, tau, background, thickness):
    """Depth that a thin ray meets at x outside the rim: face, wall, background."""
    width = thickness * tau
    on_wall = x / tau if tau > 0 else np.zeros_like(x)
    return np.where(x < 0, 0.0, np.where(x < width, on_wall, background))


def mean_over_disc(x, tau, background, spot, thickness, count=20_000, echo=1.0):
    """Mean depth over a disc: strips of its chord, each exactly as wide as it is counted."""
    u = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    chord = np.sqrt(1.0 - u * u)
    depth = step_profile(x + spot * u, tau, background, thickness)
    weight = np.where(x + spot * u < thickness * tau, 1.0, echo) * chord
    return float(np.sum(depth * weight) / np.sum(weight))


def at(x, tau, background, spot, thickness, echo=1.0):
    full = [np.full(np.shape(x), value, dtype=float) for value in (tau, background, spot)]
    return edge_profile(np.asarray(x, dtype=float), *full, thickness, echo)


def places(tau, spot, thickness):
    """x across the rim and across the foot of the wall, away from the kinks at +-s of both."""
    across = np.linspace(-1.3, 1.37, 17) * spot
    return np.concatenate([across, thickness * tau + across])


@pytest.mark.parametrize(("tau", "background", "spot", "thickness"), CASES)
def test_depth_is_the_mean_of_the_step_over_the_spot(tau, background, spot, thickness):
    x = places(tau, spot, thickness)
    depth = at(x, tau, background, spot, thickness).depth_m
    truth = [mean_over_disc(p, tau, background, spot, thickness) for p in x]
    # One strip of the sum at each jump, B / count wide, and the profile's own table: 4,000 steps
    # of 2/4000, integrated by trapezia, times s / w.
    width = max(thickness * tau, 1e-3 * spot)
    table = thickness * spot / width * 1e-6 if tau > 0 else 0.0
    none = 1e-3 * background if tau == 0 else 0.0  # a wall of 1e-3 s stands for none
    tolerance = background * 2.0 * 2.0 / 20_000 + table + none
    np.testing.assert_allclose(depth, truth, rtol=0, atol=tolerance)
    sharp = step_profile(x, tau, background, thickness)
    assert np.abs(sharp - truth).max() > 20 * tolerance  # a thin ray is no such spot


def test_far_inside_is_face_and_far_outside_is_background():
    inside = at([-0.02, -0.004], 0.5, 0.1, 0.0015, 0.01)
    outside = at([0.0066, 0.02], 0.5, 0.1, 0.0015, 0.01)
    np.testing.assert_allclose(inside.depth_m, 0.0, atol=1e-15)
    np.testing.assert_allclose(inside.background_share, 0.0, atol=1e-15)
    np.testing.assert_allclose(outside.depth_m, 0.1, rtol=1e-6)
    np.testing.assert_allclose(outside.background_share, 1.0, rtol=1e-12)


def test_wall_alone_is_a_ramp_of_slope_one_over_tau():
    x = np.linspace(0.002, 0.008, 7)
    profile = at(x, 0.5, 0.1, 0.001, 0.02)
    np.testing.assert_allclose(profile.depth_m, x / 0.5, rtol=1e-6)
    np.testing.assert_allclose(profile.d_x, 1 / 0.5, rtol=1e-6)


@pytest.mark.parametrize(("tau", "background", "spot", "thickness"), CASES)
def test_slopes_against_central_differences(tau, background, spot, thickness):
    x = places(tau, spot, thickness)
    profile = at(x, tau, background, spot, thickness)
    h = 1e-3
    # The chord has infinite slope at +-s: a difference over h there errs by up to sqrt(h).
    kinks = np.array([-spot, spot, thickness * tau - spot, thickness * tau + spot])
    clear = np.abs(x[:, None] - kinks).min(axis=1) > 0.06 * spot

    def compare(slope, up, down, step):
        difference = (up.depth_m - down.depth_m) / (2 * step)
        largest = np.abs(difference[clear]).max()
        assert largest > 0.0
        np.testing.assert_allclose(slope[clear], difference[clear], rtol=0, atol=0.01 * largest)

    step = h * spot
    compare(
        profile.d_x,
        at(x + step, tau, background, spot, thickness),
        at(x - step, tau, background, spot, thickness),
        step,
    )
    compare(
        profile.d_log_spot,
        at(x, tau, background, spot * np.exp(h), thickness),
        at(x, tau, background, spot * np.exp(-h), thickness),
        h,
    )
    if tau > 0:
        step = h * spot / thickness
        compare(
            profile.d_tau,
            at(x, tau + step, background, spot, thickness),
            at(x, tau - step, background, spot, thickness),
            step,
        )
        step = h * spot / tau
        compare(
            profile.d_thickness,
            at(x, tau, background, spot, thickness + step),
            at(x, tau, background, spot, thickness - step),
            step,
        )


def test_thickness_matters_not_where_the_wall_is_hidden():
    x = places(0.0, 0.0015, 0.01)
    thin, thick = (at(x, 0.0, 0.08, 0.0015, t) for t in (0.003, 0.02))
    np.testing.assert_allclose(thin.depth_m, thick.depth_m, atol=2e-3 * 0.08)


@pytest.mark.parametrize("echo", [0.1, 0.5, 3.0])
@pytest.mark.parametrize("tau", [0.0, 0.05, 0.5])
def test_each_part_of_the_spot_weighs_as_it_shines(tau, echo):
    background, spot, thickness = 0.08, 0.0015, 0.01
    x = places(tau, spot, thickness)
    depth = at(x, tau, background, spot, thickness, echo).depth_m
    truth = [mean_over_disc(p, tau, background, spot, thickness, echo=echo) for p in x]
    # a wall of 1e-3 s stands for none; the slope by x grows with the contrast
    tolerance = max(1.0 / echo, echo) * background * 1.2e-3
    np.testing.assert_allclose(depth, truth, rtol=0, atol=tolerance)
    alike = at(x, tau, background, spot, thickness).depth_m
    assert np.abs(alike - truth).max() > 5 * tolerance


@pytest.mark.parametrize("echo", [0.1, 3.0])
def test_slopes_hold_for_an_echo_too(echo):
    tau, background, spot, thickness = 0.3, 0.08, 0.0015, 0.01
    x = np.array([-0.6, -0.2, 0.3, 0.7, 1.3, 1.7, 2.2, 2.7]) * spot  # clear of -1, 1 and 3
    profile, h = at(x, tau, background, spot, thickness, echo), 1e-3
    slopes = {
        "d_x": (lambda d: at(x + d * spot, tau, background, spot, thickness, echo), spot),
        "d_tau": (lambda d: at(x, tau + d * tau, background, spot, thickness, echo), tau),
        "d_log_spot": (lambda d: at(x, tau, background, spot * np.exp(d), thickness, echo), 1.0),
        "d_thickness": (
            lambda d: at(x, tau, background, spot, thickness * (1 + d), echo),
            thickness,
        ),
        "d_log_ratio": (lambda d: at(x, tau, background, spot, thickness, echo * np.exp(d)), 1.0),
    }
    for name, (moved, unit) in slopes.items():
        difference = (moved(h).depth_m - moved(-h).depth_m) / (2 * h * unit)
        largest = np.abs(difference).max()
        assert largest > 0.0, name
        np.testing.assert_allclose(
            getattr(profile, name), difference, rtol=0, atol=0.01 * largest, err_msg=name
        )


def over_footprint(x, tau, background, spot, thickness, echo, wall, gaussian, slant, count=4000):
    """Mean depth over strips of the footprint, each at its own place beside the beam's axis."""
    u = (np.arange(count) + 0.5) / count * 4.0 - 2.0
    disc, bell = np.sqrt(np.clip(1.0 - u * u, 0.0, None)), np.exp(-2.0 * u * u)
    power = (1.0 - gaussian) * disc / disc.sum() + gaussian * bell / bell.sum()
    there = x + spot * u
    light = np.where(there < 0.0, 1.0, np.where(there < thickness * tau, wall, echo)) * power
    depth = step_profile(there, tau, background, thickness) - slant * spot * u
    return float(np.sum(light * depth) / np.sum(light))


DIM = {"echo": 0.4, "wall": 0.25}


@pytest.mark.parametrize("gaussian", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("slant", [0.0, 0.25])
def test_a_dim_wall_and_a_gaussian_footprint_weigh_by_what_they_return(gaussian, slant):
    tau, background, spot, thickness = 0.27, 0.08, 0.0015, 0.01
    x = places(tau, spot, thickness)
    full = [np.full(x.shape, value) for value in (tau, background, spot)]
    last = (DIM["wall"], gaussian, slant)
    depth = edge_profile(x, *full, thickness, DIM["echo"], *last).depth_m
    args = (tau, background, spot, thickness, DIM["echo"], *last)
    truth = [over_footprint(p, *args) for p in x]
    # Strips at the jumps, 4 / 4000 of the radius wide, and a Gaussian's tail beyond two radii.
    tolerance = background / DIM["echo"] * (4.0 / 4000 + 1e-4)
    np.testing.assert_allclose(depth, truth, rtol=0, atol=tolerance)
    bright = edge_profile(x, *full, thickness, DIM["echo"]).depth_m
    assert np.abs(bright - truth).max() > 20 * tolerance


def test_slopes_by_wall_and_shape_are_those_of_central_differences():
    tau, background, spot, thickness, h = 0.27, 0.08, 0.0015, 0.01, 1e-5
    x = np.array([-0.6, -0.2, 0.3, 0.7, 1.2, 1.7, 2.2, 2.7]) * spot
    full = [np.full(x.shape, value) for value in (tau, background, spot)]

    def depth(wall, shape):
        return edge_profile(x, *full, thickness, 0.4, wall, shape).depth_m

    profile = edge_profile(x, *full, thickness, 0.4, 0.3, 0.6)
    by_wall = (depth(0.3 + h, 0.6) - depth(0.3 - h, 0.6)) / (2 * h)
    by_shape = (depth(0.3, 0.6 + h) - depth(0.3, 0.6 - h)) / (2 * h)
    np.testing.assert_allclose(profile.d_wall, by_wall, atol=1e-5 * np.abs(by_wall).max())
    np.testing.assert_allclose(profile.d_shape, by_shape, atol=1e-5 * np.abs(by_shape).max())
    assert np.abs(by_wall).max() > 1e-4
    assert np.abs(by_shape).max() > 1e-4


@pytest.mark.parametrize("shape", [0.0, 0.4, 1.0])
def test_shares_and_moments_are_integrals_of_one_footprint(shape):
    """Sums over 400,000 strips of a disc of unit radius, of exp(-2 r^2), or of a mixture."""
    t = (np.arange(400_000) + 0.5) / 1e5 - 2.0
    disc, bell = np.sqrt(np.clip(1.0 - t * t, 0.0, None)), np.exp(-2.0 * t * t)
    power = (1.0 - shape) * disc / disc.sum() + shape * bell / bell.sum()
    u = np.array([-2.5, -1.99, -1.2, -0.7, 0.0, 0.3, 0.95, 1.4, 2.0, 3.0])
    footprint = Profile(shape)
    share = np.array([power[t > -place].sum() for place in u])
    np.testing.assert_allclose(footprint.share(u), share, atol=2e-5)
    np.testing.assert_allclose(footprint.at(u).density, np.interp(u, t, power * 1e5), atol=3e-4)
    moment = np.array([(power * t)[t > -place].sum() for place in u])
    np.testing.assert_allclose(footprint.at(u).moment, moment, atol=2e-4)
    integral = np.array([(power * np.clip(t + place, 0.0, None)).sum() for place in u])
    np.testing.assert_allclose(footprint.at(u).integral, integral, atol=2e-5)


@pytest.mark.parametrize("slant", [0.0, 0.25])
@pytest.mark.parametrize("shape", [0.6, 1.0])
def test_all_slopes_of_a_dim_wall_are_those_of_central_differences(shape, slant):
    """A slanted footprint takes those with its parts beside the beam's axis."""
    x = np.array([-0.8, -0.6, -0.25, 0.3, 0.7, 1.23, 1.7, 2.2, 2.77, 4.5]) * 0.0015
    whole = np.ones(len(x))
    here = {
        "x": 0.0, "tau": 0.27, "log_spot": np.log(0.0015), "thickness": 0.01,
        "log_ratio": np.log(0.4), "wall": 0.3, "shape": shape,
    }  # fmt: skip

    def depth(x_off, tau, log_spot, thickness, log_ratio, wall, shape):
        full = tau * whole, 0.08 * whole, np.exp(log_spot) * whole
        rest = np.exp(log_ratio), wall, shape, slant
        return edge_profile(x + x_off, *full, thickness, *rest)

    shown = depth(*here.values())
    for name in here if slant == 0.0 else ("x", "log_ratio", "wall"):
        h = 1e-6 if name in ("x", "thickness") else 1e-5
        ahead, behind = (depth(*(here | {name: here[name] + s * h}).values()) for s in (1.0, -1.0))
        seen = (ahead.depth_m - behind.depth_m) / (2.0 * h)
        limit = 5e-3 * np.abs(seen).max()
        np.testing.assert_allclose(getattr(shown, f"d_{name}"), seen, atol=limit, err_msg=name)
        assert limit > 1e-8
    light = (depth(*here.values()).depth_m, shown.by_background)
    deeper = edge_profile(
        x, 0.27 * whole, 0.08001 * whole, 0.0015 * whole, 0.01, 0.4, 0.3, shape, slant
    )  # fmt: skip
    np.testing.assert_allclose(light[1], (deeper.depth_m - light[0]) / 1e-5, atol=1e-6)


def test_a_wall_without_width_has_no_slope_by_its_width():
    whole = np.ones(5)
    x = np.linspace(-1.0, 1.0, 5) * 0.001
    profile = edge_profile(x, 0.0 * whole, 0.1 * whole, 0.0015 * whole, 0.01, 0.5, 0.3)
    assert not profile.d_tau.any()
    assert np.isfinite(profile.depth_m).all()


@pytest.mark.parametrize("shape", [0.0, 0.6, 1.0])
def test_what_a_slanted_footprint_adds_has_slopes_of_its_own(shape):
    """Differences of two profiles, with and without slant, which the rest would hide."""
    x = np.array([-1.3, -0.6, -0.25, 0.3, 0.7, 1.23, 1.7, 2.2, 2.77]) * 0.0015
    whole = np.ones(len(x))

    def added(name, off_m=0.0, wall=0.3, echo=0.4):
        full = 0.27 * whole, 0.08 * whole, 0.0015 * whole, 0.01
        pair = [edge_profile(x + off_m, *full, echo, wall, shape, slant) for slant in (0.25, 0.0)]
        return getattr(pair[0], name) - getattr(pair[1], name)

    for name, unit in (("d_x", {"off_m": 1e-7}), ("d_wall", {"wall": 1e-6})):
        start = {"off_m": 0.0, "wall": 0.3}
        ahead, behind = (
            added("depth_m", **{key: start[key] + s * h for key, h in unit.items()})
            for s in (1.0, -1.0)
        )
        seen = (ahead - behind) / (2.0 * next(iter(unit.values())))
        np.testing.assert_allclose(added(name), seen, atol=0.01 * np.abs(seen).max(), err_msg=name)
        assert np.abs(seen).max() > 1e-5


def test_nothing_but_the_background_counts_beyond_wall_and_footprint():
    whole = np.ones(3)
    x = np.array([0.0068, 0.01, 0.02])
    profile = edge_profile(
        x, 0.27 * whole, 0.08 * whole, 0.0015 * whole, 0.01, 0.4, 0.3, 0.6, 0.25
    )  # fmt: skip
    np.testing.assert_allclose(profile.depth_m, 0.08, rtol=1e-9)
    for name, values in vars(profile).items():
        if name.startswith("d_"):
            np.testing.assert_allclose(values, 0.0, atol=1e-9, err_msg=name)


def marched(x, tau, background, thickness, chamfer, is_round=False):
    """Depth of thin rays, and what they meet: 0 face, 1 chamfer, 2 wall, 3 background."""
    z = np.linspace(0.0, thickness, 1501)
    left = np.maximum(chamfer - z, 0.0)
    # Of the plate at that depth, across the edge.
    ends = np.sqrt(chamfer**2 - left**2) - chamfer if is_round else -left
    inside = x[:, None] - tau * z <= ends
    first = inside.argmax(axis=1)
    depth = np.where(inside.any(axis=1), z[first] - 0.5 * z[1] * (first > 0), background)
    met = np.where(inside.any(axis=1), np.digitize(depth, [1e-9, chamfer]), 3)
    return depth, met


@pytest.mark.parametrize("chamfer", [3e-4, 1e-3])
@pytest.mark.parametrize("tau", [-1.3, -0.7, -0.2, 0.03, 0.1, 0.4, 1.2])
def test_of_a_chamfer_the_depth_is_that_of_rays_that_march_to_it(tau, chamfer):
    """Each surface of its own brightness, to what the strips leave of a jump to the background."""
    thickness, background, spot = 0.006, 0.05, 0.0015
    echo = np.array([1.0, 0.7, 0.3, 1.6])
    u = (np.arange(12_000) + 0.5) / 6000.0 - 1.0
    x = np.linspace(-0.003, 0.004 + thickness * max(tau, 0.0), 11)
    truth = []
    for place in x:
        depth, met = marched(place + spot * u, tau, background, thickness, chamfer)
        weight = np.sqrt(1.0 - u * u) * echo[met]
        truth.append(np.sum(depth * weight) / np.sum(weight))
    one = np.ones(len(x))

    def depth_of(width):
        edge = (thickness, echo[3], echo[2], 0.0, 0.0, width, echo[1])
        return edge_profile(x, tau * one, background * one, spot * one, *edge).depth_m

    changed = np.abs(depth_of(0.0) - depth_of(chamfer)).max()
    assert changed > 4e-5
    none = 0.0 if tau > 0.0 else 1e-3 * background  # a wall of 1e-3 s stands for none
    np.testing.assert_allclose(depth_of(chamfer), truth, atol=1.2e-5 + none)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [7e-4, 1.5e-3])
@pytest.mark.parametrize("tau", [-0.7, -0.35, -0.1, 0.1, 0.4, 0.7])
def test_of_a_rounded_edge_the_depth_is_that_of_rays_that_march_to_it(tau, radius):
    """Within a sixth of what a chamfer is off, of the width for which it is taken."""
    thickness, background, spot = 0.006, 0.05, 0.0015
    u = (np.arange(12_000) + 0.5) / 6000.0 - 1.0
    x = np.linspace(-0.003, 0.004 + thickness * max(tau, 0.0), 23)
    weight = np.sqrt(1.0 - u * u)
    depths = [marched(at + spot * u, tau, background, thickness, radius, True)[0] for at in x]
    truth = np.array(depths) @ weight / weight.sum()
    one = np.ones(len(x))

    def off_m(roundness):
        width, lean, _ = rounded(tau * one, roundness)
        edge = (thickness, 1.0, 1.0, 0.0, 0.0, width * TAKEN_FOR * radius, 1.0, None, lean)
        depth = edge_profile(x, tau * one, background * one, spot * one, *edge).depth_m
        return float(np.sqrt(np.mean((depth - truth) ** 2)))

    none = 0.0 if tau > 0.0 else 1e-3 * background  # a wall of 1e-3 s stands for none
    assert off_m(1.0) < max(off_m(0.0) / 6.0, 0.012 * radius) + none


@pytest.mark.parametrize("roundness", [0.0, 0.5, 1.0])
def test_a_round_ends_where_beams_touch_it(roundness):
    """The farthest of its points, as beams of that slope see them from above the face."""
    tau = np.linspace(-1.2, 0.9, 43)
    width, lean, by_tau = rounded(tau, roundness)
    turn = np.linspace(0.0, np.pi / 2.0, 20_001)[:, None]
    out, deep = np.sin(turn) - 1.0, 1.0 - np.cos(turn)
    seen = np.max(out + np.minimum(tau, 0.0) * deep, axis=0)  # of a radius of 1
    chamfer = TAKEN_FOR * tau
    expected = (1.0 - roundness) * chamfer + roundness * seen
    far = tau < 0.0
    np.testing.assert_allclose((TAKEN_FOR * width * lean)[far], expected[far], atol=1e-8)
    np.testing.assert_array_equal(lean[~far], tau[~far])
    slope = (rounded(tau + 1e-6, roundness)[1] - rounded(tau - 1e-6, roundness)[1]) / 2e-6
    inside = np.abs(tau) > 1e-5
    np.testing.assert_allclose((by_tau + 0.0 * tau)[inside], slope[inside], atol=1e-6)


def test_a_round_leaves_as_much_material_as_its_chamfer():
    assert (TAKEN_FOR * rounded(np.zeros(1), 1.0)[0]) ** 2 / 2.0 == pytest.approx(1.0 - np.pi / 4.0)


@pytest.mark.parametrize("leaning", [False, True])
@pytest.mark.parametrize("chamfer", [-2e-4, 0.0, 4e-4])
def test_slopes_of_a_chamfer_are_those_of_central_differences(chamfer, leaning):
    """Below 0 as well, where the depth goes on smoothly; also where it leans as no beam does."""
    rng, count = np.random.default_rng(0), 2000
    state = {
        "x_m": rng.uniform(-0.004, 0.008, count),
        "tau": rng.uniform(-1.3, 1.3, count),
        "background_m": rng.uniform(0.03, 0.2, count),
        "spot_m": rng.uniform(0.0012, 0.002, count),
        "thickness_m": 0.01,
        "reflectance_ratio": rng.uniform(0.5, 2.0, count),
        "wall": rng.uniform(0.1, 1.0, count),
        "shape": 0.4,
        "chamfer_m": chamfer,
        "bevel": rng.uniform(0.2, 1.2, count),
    }
    by_tau, by_lean = 0.0, {}
    if leaning:
        state["lean"] = state["tau"] + rng.uniform(-0.3, 0.3, count)
    profile = edge_profile(**state)
    if leaning:
        by_lean = {"lean": (profile.d_lean, 1e-5)}
    else:
        by_tau = profile.d_lean
    shown = by_lean | {
        "x_m": (profile.d_x, 1e-6),
        "tau": (np.where(state["tau"] > 0.0, profile.d_tau, 0.0) + by_tau, 1e-5),
        "thickness_m": (profile.d_thickness, 1e-6),
        "wall": (profile.d_wall, 1e-5),
        "shape": (profile.d_shape, 1e-5),
        "chamfer_m": (profile.d_chamfer, 1e-6),
        "bevel": (profile.d_bevel, 1e-5),
    }
    for name, (slope, step) in shown.items():
        ahead, behind = (
            edge_profile(**(state | {name: state[name] + way * step})).depth_m for way in (1, -1)
        )
        seen = (ahead - behind) / (2.0 * step)
        largest = np.abs(seen).max()
        assert largest > 0.0 or (name in ("bevel", "lean") and chamfer == 0.0)
        assert np.quantile(np.abs(seen - slope), 0.99) <= 2e-3 * largest, name


@pytest.mark.parametrize("chamfer", [0.0, 4e-4])
def test_slopes_of_a_target_alone_are_those_of_central_differences(chamfer):
    """The slope by the footprint was wrong by its own size, without what lies beside the axis."""
    rng, count = np.random.default_rng(0), 2000
    tau = rng.uniform(-0.6, 0.6, count)
    state = {
        "x_m": rng.uniform(-0.003, 0.001, count),
        "tau": tau,
        "background_m": np.zeros(count),
        "spot_m": rng.uniform(0.0012, 0.002, count),
        "thickness_m": 0.01,
        "reflectance_ratio": 1e-9,
        "wall": rng.uniform(0.1, 1.0, count),
        "shape": 0.6,
        "slant": 0.9 * tau,
        "chamfer_m": chamfer,
        "bevel": rng.uniform(0.2, 1.2, count),
        "lean": tau,
        "alone": True,
    }
    profile = edge_profile(**state)
    for name, slope, step in (
        ("x_m", profile.d_x, 1e-8),
        ("spot_m", profile.d_log_spot / state["spot_m"], 1e-8),
        ("tau", np.where(tau > 0.0, profile.d_tau, 0.0), 1e-6),
        ("lean", profile.d_lean, 1e-6),
        ("slant", profile.d_slant, 1e-5),
        ("thickness_m", profile.d_thickness, 1e-7),
        ("wall", profile.d_wall, 1e-5),
        ("shape", profile.d_shape, 1e-5),
        ("chamfer_m", profile.d_chamfer, 1e-8),
        ("bevel", profile.d_bevel, 1e-5),
    ):
        ahead, behind = (
            edge_profile(**(state | {name: state[name] + way * step})).depth_m for way in (1, -1)
        )
        seen = (ahead - behind) / (2.0 * step)
        largest = np.abs(seen).max()
        assert largest > 1e-6 or (name in ("bevel", "lean") and chamfer == 0.0)
        assert np.quantile(np.abs(seen - slope), 0.99) <= 5e-3 * largest + 1e-12, name
