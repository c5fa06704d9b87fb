"""Boxes proved stable, against closed forms, random members and other ways to count."""

import copy
import math
import pickle

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from hypothesis import example, given, settings, strategies as st

Kp, Kv, T, T2 = dtm.parameters("Kp Kv T T2")
VELOCITY = s + (Kp + Kv * s) * delay(0.36)
VELOCITY_T = s + (Kp + Kv * s) * delay(T)


def velocity_by_hand(kp, kv, time=0.36):
    """Unstable roots of s + (Kp + Kv s) exp(-s T) by D-subdivision, see test_stability_map."""
    inside = np.clip(kv, -1 + 1e-15, 1 - 1e-15)
    theta = np.arccos(-inside)
    size = np.abs(kp) * time / np.sin(theta)

    def pairs(first):
        return np.maximum(np.ceil((size - first) / (2 * np.pi)), 0).astype(int)

    finite = np.where(kp > 0, 2 * pairs(theta), 1 + 2 * pairs(2 * np.pi - theta))
    return np.where(np.abs(kv) > 1, -1, finite)


def sampled(boxes, number, seed=0):
    """Random points of the ranges and the counts of the boxes there."""
    rng = np.random.default_rng(seed)
    ends = np.array([boxes.ranges[name] for name in boxes.names])
    points = rng.uniform(ends[:, 0], ends[:, 1], size=(number, len(ends)))
    return points, boxes.count_at(points)


def agrees_with_members(family, boxes, number=300, seed=0):
    """Random members inside proved boxes have the proved count."""
    rng = np.random.default_rng(seed)
    proved = np.flatnonzero(boxes.unstable != -2)
    for index in rng.choice(proved, size=number):
        # Now and then a corner, where a box is tightest.
        share = rng.uniform(size=len(boxes.names))
        if rng.uniform() < 0.5:
            share = np.round(share)
        low, high = boxes.low[index], boxes.high[index]
        point = np.clip(low + share * (high - low), low, high)
        member = family.at(**dict(zip(boxes.names, point.tolist(), strict=True)))
        if boxes.unstable[index] == -1:
            assert member.kind == "advanced" or member.chain_abscissa() > 0.0
        else:
            assert member.count(re=(0, None)) == boxes.unstable[index]


def test_velocity_boxes_are_those_of_d_subdivision():
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)})
    assert boxes.undecided <= 1e-3
    points, counts = sampled(boxes, 100_000)
    known = counts != -2
    assert known.mean() > 0.998
    np.testing.assert_array_equal(counts[known], velocity_by_hand(*points[known].T))
    assert boxes.stable_share == pytest.approx((counts == 0).mean(), abs=0.01)
    agrees_with_members(VELOCITY, boxes)


def test_velocity_boxes_beyond_the_chains():
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (-5, 60), "Kv": (-1.5, 1.5)}, tol=0.02)
    assert set(np.unique(boxes.unstable)) >= {-2, -1, 0, 1, 2, 3, 4}
    points, counts = sampled(boxes, 50_000)
    known = counts != -2
    np.testing.assert_array_equal(counts[known], velocity_by_hand(*points[known].T))


def test_boxes_with_the_delay_as_a_third_parameter():
    boxes = dtm.proved_boxes(
        VELOCITY_T, {"Kp": (0, 6), "Kv": (-0.9, 0.9), "T": (0.2, 0.5)}, tol=0.05
    )
    points, counts = sampled(boxes, 50_000)
    known = counts != -2
    assert known.mean() > 0.94
    np.testing.assert_array_equal(counts[known], velocity_by_hand(*points[known].T))
    agrees_with_members(VELOCITY_T, boxes, 100)


FAMILIES = {
    # s^2 - a: falls over without feedback.
    "pendulum": (s**2 - 4.0 + (Kp + Kv * s) * delay(0.1), {"Kp": (0, 40), "Kv": (-1, 12)}),
    "pendulum and delay": (s**2 - 4.0 + (Kp + 3.0 * s) * delay(T), {"Kp": (0, 40), "T": (0, 0.5)}),
    "first order under PI": (
        s * (2.0 * s + 1.0) + (Kp * s + Kv) * delay(0.7),
        {"Kp": (-1, 6), "Kv": (-1, 5)},
    ),
    "two delays": (s + Kp * delay(0.3) + Kv * delay(0.8), {"Kp": (-3, 6), "Kv": (-3, 6)}),
    "both delays": (s + delay(T) + 1.5 * delay(T2), {"T": (0, 2), "T2": (0, 2)}),
    "product of gains": (
        (s + Kp) * (s + Kv) + 2.0 * Kp * Kv**2 * delay(0.5),
        {"Kp": (-2, 3), "Kv": (-2, 3)},
    ),
    "sum of delays": (s + Kp * delay(T + 0.1) + delay(2 * T), {"Kp": (-2, 4), "T": (0, 1)}),
    "two chains": (
        s + 0.5 + Kp * s * delay(0.5) + Kv * s * delay(1.1),
        {"Kp": (-1.5, 1.5), "Kv": (-1.5, 1.5)},
    ),
    "advanced in places": (s + 1.0 + Kp * s**2 * delay(1.0), {"Kp": (-1, 1)}),
    "one gain": (s + Kp * delay(1.0), {"Kp": (-20, 20)}),
    "polynomial": (s**3 + 2 * s**2 + Kp * s + Kv, {"Kp": (-1, 4), "Kv": (-1, 6)}),
}


@pytest.mark.parametrize("name", FAMILIES)
def test_random_members_have_the_count_of_their_box(name):
    family, ranges = FAMILIES[name]
    boxes = dtm.proved_boxes(family, ranges, tol=0.01, max_boxes=100_000)
    assert boxes.undecided <= 0.01
    volume = np.prod(boxes.high - boxes.low, axis=1) / np.prod([b - a for a, b in ranges.values()])
    assert volume.sum() == pytest.approx(1.0, rel=1e-12)
    assert volume[boxes.unstable == -2].sum() == pytest.approx(boxes.undecided, abs=1e-12)
    agrees_with_members(family, boxes)


def test_hurwitz_boundary_of_a_cubic():
    # s^3 + 2 s^2 + Kp s + Kv is stable where 0 < Kv < 2 Kp.
    boxes = dtm.proved_boxes(s**3 + 2 * s**2 + Kp * s + Kv, {"Kp": (-1, 4), "Kv": (-1, 6)}, 1e-3)
    points, counts = sampled(boxes, 20_000)
    known = counts != -2
    np.testing.assert_array_equal(
        counts[known] == 0, (points[known, 1] > 0) & (points[known, 1] < 2 * points[known, 0])
    )


def test_a_loop_is_its_family():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36, limit=1.0)
    ranges = {"Kp": (0, 6), "Kv": (-1, 1)}
    ours, theirs = (dtm.proved_boxes(one, ranges, 0.01) for one in (loop, VELOCITY))
    np.testing.assert_array_equal(ours.low, theirs.low)
    np.testing.assert_array_equal(ours.unstable, theirs.unstable)
    with pytest.raises(ValueError, match="continuous"):
        dtm.proved_boxes(loop.replace(sample_time=0.05), ranges)
    with pytest.raises(ValueError, match="does not depend on this parameter"):
        dtm.proved_boxes(loop, {"Ki": (0, 1)})
    with pytest.raises(ValueError, match="delay of this loop is None"):
        dtm.proved_boxes(loop.replace(delay=None), ranges)
    open_delay = dtm.proved_boxes(loop.replace(delay=None), {"delay": (0.0, 1.0)}, 1e-3)
    assert open_delay.count_at(delay=[0.0, 0.36, 0.9]).tolist() == [0, 0, 2]


def test_the_order_of_names_is_that_of_the_ranges():
    turned = dtm.proved_boxes(VELOCITY_T, {"Kv": (-1, 1), "Kp": (0, 6)}, 0.01, at={"T": 0.36})
    assert turned.names == ("Kv", "Kp")
    plain = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, 0.01)
    np.testing.assert_array_equal(
        turned.count_at(Kv=np.linspace(-1, 1, 41), Kp=np.full(41, 3.0)),
        plain.count_at(Kv=np.linspace(-1, 1, 41), Kp=np.full(41, 3.0)),
    )


def test_the_same_boxes_for_any_number_of_threads():
    ranges = {"Kp": (-1, 9), "Kv": (-1, 1), "T": (0.3, 0.4)}
    one, three = (dtm.proved_boxes(VELOCITY_T, ranges, 0.1, threads=n) for n in (1, 3))
    for name in ("low", "high", "unstable"):
        assert getattr(one, name).tobytes() == getattr(three, name).tobytes()


def test_lookup_takes_points_of_any_shape():
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, 0.01)
    grid = np.stack(np.meshgrid([1.0, 2.0, 7.0], [0.0, 0.5], indexing="ij"), axis=-1)
    assert boxes.count_at(grid).tolist() == [[0, 0], [0, 0], [-2, -2]]
    assert boxes.count_at([2.0, 0.3]) == 0
    assert isinstance(boxes.count_at(Kp=2, Kv=0.3), int)
    assert boxes.count_at(np.empty((0, 2))).shape == (0,)
    assert boxes.count_at(Kp=math.nan, Kv=0.0) == -2
    with pytest.raises(TypeError, match="one array"):
        boxes.count_at()
    with pytest.raises(ValueError, match="Kv"):
        boxes.count_at(Kp=1.0)
    with pytest.raises(ValueError, match="T"):
        boxes.count_at(Kp=1.0, Kv=0.0, T=1.0)
    with pytest.raises(ValueError, match="shape"):
        boxes.count_at([1.0, 2.0, 3.0])


def test_degenerate_ranges():
    point = dtm.proved_boxes(VELOCITY, {"Kp": (2, 2)}, at={"Kv": 0.3})
    assert (point.unstable.tolist(), point.undecided) == ([0], 0.0)
    assert point.stable_share == 1.0
    assert point.count_at(Kp=2.0) == 0
    on_the_edge = dtm.proved_boxes(s**2 + Kp, {"Kp": (1, 1)})
    assert (on_the_edge.unstable.tolist(), on_the_edge.undecided) == ([-2], 1.0)
    with pytest.raises(ValueError, match="s = 0 is a root"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 0)}, at={"Kv": 0.3})
    line = dtm.proved_boxes(VELOCITY, {"Kp": (0.5, 6)}, 1e-6, at={"Kv": 0.0})
    edge = line.high[line.unstable == 0].max(axis=0)
    assert edge[0] == pytest.approx(0.5 * math.pi / 0.36, abs=1e-5)
    with pytest.raises(ValueError, match="Kp"):
        dtm.proved_boxes(VELOCITY, {"Kp": (6, 0), "Kv": (-1, 1)})
    for bad in (math.nan, math.inf):
        with pytest.raises(ValueError, match="finite"):
            dtm.proved_boxes(VELOCITY, {"Kp": (0, bad), "Kv": (-1, 1)})
    with pytest.raises(ValueError, match="Kv has no value"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 6)})
    with pytest.raises(ValueError, match="is not a parameter"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (0, 1), "Kd": (0, 1)})
    with pytest.raises(ValueError, match="one to three"):
        dtm.proved_boxes(VELOCITY, {})
    with pytest.raises(TypeError, match="dict"):
        dtm.proved_boxes(VELOCITY, [(0, 6)])
    with pytest.raises(TypeError, match="ControlLoop"):
        dtm.proved_boxes(s + delay(1.0), {"Kp": (0, 6)})
    with pytest.raises(TypeError, match="not a number"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, "6"), "Kv": (-1, 1)})
    with pytest.raises(ValueError, match="only the two ends of the range"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 1, 2), "Kv": (-1, 1)})
    for bad in (-0.1, 1.5, math.nan):
        with pytest.raises(ValueError, match="tol"):
            dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, bad)
    with pytest.raises(ValueError, match="max_boxes"):
        dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, max_boxes=0)
    with pytest.raises(ValueError, match="negative"):
        dtm.proved_boxes(VELOCITY_T, {"Kp": (0, 6), "T": (-0.1, 1)}, at={"Kv": 0.0})
    a, b, c, d = dtm.parameters("a b c d")
    with pytest.raises(ValueError, match="more than 3"):
        dtm.proved_boxes(s + a + b + c + d, dict.fromkeys("abcd", (0, 1)))
    with pytest.raises(ValueError, match="s = 0 is a root"):
        dtm.proved_boxes(s**2 + Kv * s * delay(0.1), {"Kv": (0, 1)})
    with pytest.raises(ValueError, match="s = 0 is a root"):
        dtm.proved_boxes(s + Kp * delay(0.1) - Kp * delay(T), {"Kp": (0, 1)}, at={"T": 0.5})


def test_a_parameter_without_influence_is_never_divided():
    family = s + Kp * delay(0.36) + 0.0 * Kv + (Kv - Kv) * s
    boxes = dtm.proved_boxes(family, {"Kp": (0, 6), "Kv": (-1, 1)}, 1e-3)
    assert boxes.undecided <= 1e-3
    assert (boxes.low[:, 1] == -1).all()
    assert (boxes.high[:, 1] == 1).all()
    none = dtm.proved_boxes(s + 1.0 + 0.0 * Kv, {"Kv": (-1, 1)})
    assert none.unstable.tolist() == [0]
    always = dtm.proved_boxes(s**2 + 1.0 + 0.0 * Kv, {"Kv": (-1, 1)}, max_boxes=1000)
    assert always.undecided == 1.0
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
    assert dtm.proved_boxes(loop, {"lag": (0, 0.1)}, 0.1).undecided <= 0.1


def test_advanced_families_are_unstable_throughout():
    boxes = dtm.proved_boxes(s + Kp + s**2 * delay(1.0), {"Kp": (-1, 1)})
    assert boxes.unstable.tolist() == [-1]
    boxes = dtm.proved_boxes(s + 1.0 + Kp * s * delay(T), {"Kp": (2, 3), "T": (0.1, 1)})
    assert boxes.unstable.tolist() == [-1]


def test_the_number_of_boxes_is_limited():
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, 0.0, max_boxes=500)
    assert len(boxes.unstable) == 500
    assert 0.0 < boxes.undecided < 0.2
    assert "% undecided" in repr(boxes)


def test_boxes_are_read_only_also_as_copies():
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, 0.1)
    for one in (boxes, copy.deepcopy(boxes), pickle.loads(pickle.dumps(boxes))):
        assert one.count_at(Kp=2.0, Kv=0.3) == 0
        for array in (one.low, one.high, one.unstable):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


@st.composite
def small_families(draw):
    """A few terms with one or two parameters, delays among them now and then."""
    number = st.floats(-3, 3).map(lambda x: round(x, 2))
    time = st.sampled_from([0.0, 0.1, 0.5, 1.0, 1.3])
    family = s ** draw(st.integers(1, 3)) + 0.0 * Kp + 0.0 * Kv
    for _ in range(draw(st.integers(1, 4))):
        gain = draw(st.sampled_from([1.0, Kp, Kv, Kp * Kv, Kp**2]))
        late = draw(st.sampled_from([delay(draw(time)), delay(draw(time)), delay(T + draw(time))]))
        family = family + draw(number) * gain * s ** draw(st.integers(0, 2)) * late
    return family + draw(number) + 0.0 * delay(T) * Kp


@given(small_families(), st.integers(0, 10**6))
@example(s + 0.0 * Kp + 0.0 * Kv - 2.0 * Kp * s * delay(T) + 1.0, 1)
@settings(max_examples=60, deadline=None)
def test_random_families(family, seed):
    rng = np.random.default_rng(seed)
    ranges = {"Kp": (-1.0, 2.0), "Kv": (-1.5, 1.5), "T": (0.2, 0.9)}
    ranges[rng.choice(list(ranges))] = (0.5, 0.5)
    ranges = {name: ranges[name] for name in family.names}
    try:
        boxes = dtm.proved_boxes(family, ranges, 0.05, max_boxes=3000)
    except ValueError as error:
        assert "s = 0 is a root" in str(error)  # noqa: PT017 the only reason to refuse these
        return
    if (boxes.unstable != -2).any():
        agrees_with_members(family, boxes, 20, seed)


def test_largest_box_of_the_velocity_loop():
    ranges = {"Kp": (0, 6), "Kv": (-1, 1)}
    box = dtm.largest_stable_box(VELOCITY, ranges)
    (a, b), (c, d) = box["Kp"], box["Kv"]
    # The best one by the closed form: from 0 to the boundary at both ends of Kv.
    kv = np.linspace(-0.999, 0.999, 1000)
    edge = np.arccos(-kv) * np.sqrt(1 - kv**2) / 0.36
    best = max(
        (high - low) * min(x, y)
        for low, x in zip(kv[::10], edge[::10], strict=True)
        for high, y in zip(kv[::10], edge[::10], strict=True)
        if high > low
    )
    assert (b - a) * (d - c) > 0.98 * best
    assert (velocity_by_hand(*np.meshgrid([a, b], [c, d])) == 0).all()
    proof = dtm.proved_boxes(VELOCITY, box, 0.0, max_boxes=100_000)
    assert proof.unstable.max() == 0
    assert proof.undecided == 0.0
    held = dtm.largest_stable_box(VELOCITY, ranges, around={"Kp": 4.9, "Kv": 0.45})
    assert held["Kp"][0] <= 4.9 <= held["Kp"][1]
    assert held["Kv"][0] <= 0.45 <= held["Kv"][1]
    with pytest.raises(ValueError, match="no stable box"):
        dtm.largest_stable_box(VELOCITY, ranges, around={"Kp": 5.5, "Kv": 0.0})
    with pytest.raises(ValueError, match="no stable box"):
        dtm.largest_stable_box(VELOCITY, {"Kp": (-6, -1), "Kv": (-1, 1)})
    with pytest.raises(ValueError, match="outside"):
        dtm.largest_stable_box(VELOCITY, ranges, around={"Kp": 7.0, "Kv": 0.0})


def test_largest_box_of_one_and_three_parameters():
    box = dtm.largest_stable_box(s + Kp * delay(0.36), {"Kp": (-3, 9)}, tol=1e-5)
    assert box["Kp"] == pytest.approx((0.0, 0.5 * math.pi / 0.36), abs=1e-3)
    box = dtm.largest_stable_box(VELOCITY_T, {"Kp": (0, 6), "Kv": (-0.9, 0.9), "T": (0.3, 0.4)})
    assert all(low < high for low, high in box.values())
    corners = np.meshgrid(*box.values())
    assert (velocity_by_hand(*corners) == 0).all()


def test_radius_of_an_integrator_is_that_of_the_closed_form():
    family = s + Kp * delay(T)
    found = dtm.stability_radius(family, {"Kp": 2.0, "T": 0.36})
    truth = math.sqrt(0.5 * math.pi / 0.72) - 1.0
    assert found.radius <= truth <= found.upper <= found.radius * 1.002
    assert family.at(**found.witness).count(re=(0, None)) == 2
    gain = dtm.stability_radius(family, {"Kp": 2.0}, {"Kp": 1.0}, at={"T": 0.36})
    assert gain.radius == pytest.approx(2.0, rel=1e-3)
    assert list(gain.ranges) == ["Kp"]
    # The delay ends at 0, and no gain below 0.5 pi / 0.36 matters to it.
    time = dtm.stability_radius(family, {"T": 0.36}, {"T": 1.0}, at={"Kp": 2.0})
    assert time.radius == pytest.approx(0.25 * math.pi - 0.36, rel=2e-3)
    assert time.ranges["T"][0] == 0.0


def test_radius_of_a_loop_of_three_numbers():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36)
    found = dtm.stability_radius(loop, {"Kp": 2.0, "Kv": 0.3, "delay": 0.36})
    assert found.radius <= found.upper <= 1.002 * found.radius
    box = np.array(list(found.ranges.values()))
    points = np.random.default_rng(3).uniform(box[:, 0], box[:, 1], (20_000, 3))
    points = np.vstack([points, np.stack(np.meshgrid(*box), axis=-1).reshape(-1, 3)])
    assert (velocity_by_hand(*points.T) == 0).all()
    assert velocity_by_hand(*found.witness.values()) > 0


def test_radius_of_what_is_always_stable():
    found = dtm.stability_radius(s + 1.0 + 0.5 * delay(T), {"T": 1.0})
    assert found.radius > 1e4
    assert found.upper == math.inf
    assert found.witness is None


def test_radius_refuses_what_has_none():
    family = s + Kp * delay(T)
    with pytest.raises(ValueError, match="not stable"):
        dtm.stability_radius(family, {"Kp": 6.0, "T": 0.36})
    with pytest.raises(ValueError, match="scales="):
        dtm.stability_radius(family, {"Kp": 2.0, "T": 0.0})
    for scale in (0, -1):
        with pytest.raises(ValueError, match="above zero"):
            dtm.stability_radius(family, {"Kp": 2.0, "T": 0.1}, {"Kp": scale})
    with pytest.raises(ValueError, match="scales contains K"):
        dtm.stability_radius(family, {"Kp": 2.0, "T": 0.1}, {"K": 1})
    with pytest.raises(TypeError, match="dict"):
        dtm.stability_radius(family, 2.0)
    with pytest.raises(ValueError, match="tol"):
        dtm.stability_radius(family, {"Kp": 2.0, "T": 0.1}, tol=0.0)
    with pytest.raises(ValueError, match="T has no value"):
        dtm.stability_radius(family, {"Kp": 2.0})


def test_robust_map_is_that_of_the_worst_delay():
    chart = dtm.robust_map(
        VELOCITY_T, {"Kp": (-1, 8), "Kv": (-0.95, 0.95)}, {"T": (0.2, 0.45)}, shape=(40, 31)
    )
    kp, kv = np.meshgrid(*chart.axes.values(), indexing="ij")
    # Roots only move to the right as T grows.
    worst = velocity_by_hand(kp, kv, 0.45)
    np.testing.assert_array_equal(chart.stable, worst == 0)
    np.testing.assert_array_equal(chart.unstable, worst)
    assert "for all T 0.2 to 0.45" in repr(chart)


def test_robust_map_includes_delays_between_the_ends():
    # An undamped oscillator under late feedback is stable and unstable by turns as T grows.
    family = s**2 + 0.05 * s + 4.0 + Kp * delay(T) + 0.0 * Kv
    axes = {"Kp": [0.5], "Kv": [0.0]}
    ends = dtm.robust_map(family, axes, {"T": (1.8, 4.95)})
    inner = dtm.robust_map(family, axes, {"T": (1.8, 1.9)})
    assert inner.unstable.tolist() == [[0]]
    assert [family.at(Kp=0.5, Kv=0, T=t).is_stable() for t in (1.8, 3.375, 4.95)] == [
        True,
        False,
        True,
    ]
    assert ends.unstable[0, 0] > 0


def test_robust_map_refuses_what_makes_no_sense():
    ranges = {"Kp": (0, 6), "Kv": (-1, 1)}
    with pytest.raises(ValueError, match="an axis and an interval"):
        dtm.robust_map(VELOCITY, ranges, {"Kp": (0, 1)})
    with pytest.raises(ValueError, match="one to three"):
        dtm.robust_map(VELOCITY, ranges, {})
    with pytest.raises(ValueError, match="negative"):
        dtm.robust_map(VELOCITY_T, ranges, {"T": (-1, 1)})
    with pytest.raises(ValueError, match="low end"):
        dtm.robust_map(VELOCITY_T, ranges, {"T": (0.4, 0.3)})
    point = dtm.robust_map(VELOCITY_T, ranges, {"T": (0.36, 0.36)}, shape=(7, 5))
    maps = dtm.stability_map(VELOCITY, ranges, shape=(7, 5), abscissa=False)
    np.testing.assert_array_equal(point.unstable, maps.unstable)


def test_plots():
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    boxes = dtm.proved_boxes(VELOCITY, {"Kp": (0, 6), "Kv": (-1, 1)}, 0.05)
    assert boxes.plot(ax) is ax
    assert ax.get_xlim() == (0.0, 6.0)
    chart = dtm.robust_map(
        VELOCITY_T, {"Kp": (0, 6), "Kv": (-1, 1)}, {"T": (0.3, 0.4)}, shape=(6, 5)
    )
    assert chart.plot(Figure().subplots()).get_ylabel() == "Kv"
    with pytest.raises(ValueError, match="two"):
        dtm.proved_boxes(s + Kp * delay(1.0), {"Kp": (0, 1)}, 0.1).plot(Figure().subplots())
