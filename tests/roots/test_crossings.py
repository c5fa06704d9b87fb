"""Crossings of the imaginary axis by one parameter, and delay margins, against closed forms."""

import math
import pickle

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from hypothesis import given, strategies as st

Kp, Kv, K, T = dtm.parameters("Kp Kv K T")

# A crossing is the quotient of two values with a few ulp each.
CLOSE = 1e-12


def check_by_counts(found):
    """The counts between crossings, each proved alone, change by the directions."""
    assert (np.diff(found.counts)[found.counts[1:] >= 0] == found.direction).all()


def test_gains_of_a_proportional_loop():
    found = dtm.crossings(s + K * delay(0.36), {"K": (-1.0, 100.0)})
    # i w + K e^(-i w T) = 0: w T = pi/2 + n pi, K = (-1)^n w, and K = 0 at w = 0
    expected = [(0.0, 0.0, -1)]
    expected += [((0.5 + n) * math.pi / 0.36,) * 2 + (2,) for n in range(0, 12, 2)]
    values, omega, direction = map(np.array, zip(*expected, strict=True))
    assert found.values == pytest.approx(values, rel=CLOSE, abs=1e-300)
    assert found.omega == pytest.approx(omega, rel=CLOSE, abs=1e-300)
    assert (found.direction == direction).all()
    assert found.counts.tolist() == [1, 0, 2, 4, 6, 8, 10, 12]
    assert found.stable_ranges == ((0.0, found.values[1]),)
    assert found.parameter == "K"
    assert len(found) == 7


def test_delays_of_a_proportional_loop():
    found = dtm.crossings(s + 2.0 * delay(T), {"T": (0.0, 20.0)})
    expected = (0.5 * math.pi + 2.0 * math.pi * np.arange(7)) / 2.0
    assert found.values == pytest.approx(expected[expected <= 20.0], rel=CLOSE)
    assert found.omega == pytest.approx(2.0, rel=CLOSE)
    assert (found.direction == 2).all()
    check_by_counts(found)


@given(st.floats(-0.9, 0.9), st.floats(0.05, 2.0))
def test_proportional_gains_of_a_velocity_loop(velocity, time):
    family = s + (Kp + velocity * s) * delay(time)
    found = dtm.crossings(family, {"Kp": (-10.0 / time, 10.0 / time)})
    # Kp = w sin(w T) and Kv = -cos(w T)
    turn = math.acos(-velocity)
    turns = np.array(sorted(sign * turn + 2.0 * math.pi * n for n in range(9) for sign in (-1, 1)))
    omega = turns[turns > 0.0] / time
    gains = omega * np.sin(omega * time)
    inside = np.abs(gains) < 10.0 / time
    order = np.argsort(np.append(gains[inside], 0.0))
    assert found.values == pytest.approx(np.append(gains[inside], 0.0)[order], rel=1e-10, abs=1e-10)
    assert found.omega == pytest.approx(np.append(omega[inside], 0.0)[order], rel=1e-10, abs=1e-10)
    check_by_counts(found)


@given(st.floats(0.2, 6.0), st.floats(0.05, 2.0))
def test_velocity_gains_of_a_velocity_loop(gain, time):
    found = dtm.crossings(s + (gain / time + Kv * s) * delay(time), {"Kv": (-0.95, 0.95)})
    w = found.omega
    assert w * np.sin(w * time) == pytest.approx(gain / time, rel=1e-10)
    assert found.values == pytest.approx(-np.cos(w * time), rel=1e-9, abs=1e-9)
    check_by_counts(found)


@given(st.floats(0.5, 3.0), st.floats(0.05, 0.9))
def test_windows_of_stability_of_an_oscillator(natural, share):
    # s^2 + w0^2 + K e^(-sT), K < 0: pairs at w0^2 + K and w0^2 - K, directions -2 and +2
    gain = -share * natural**2
    found = dtm.crossings(s**2 + natural**2 + gain * delay(T), {"T": (0.01, 20.0 / natural)})
    high, low = math.sqrt(natural**2 - gain), math.sqrt(natural**2 + gain)
    # w^2 = w0^2 + K cos(w T) and sin(w T) = 0
    n = np.arange(20)
    leaves = (2.0 * n + 1.0) * math.pi / high
    enters = 2.0 * (n + 1.0) * math.pi / low
    values = np.concatenate([leaves, enters])
    signs = np.concatenate([np.full(20, 2), np.full(20, -2)])
    inside = values <= 20.0 / natural
    order = np.argsort(values[inside])
    assert found.values == pytest.approx(values[inside][order], rel=1e-10)
    apart = np.diff(found.values, prepend=0.0, append=np.inf).clip(max=1.0)
    if (apart > 1e-6).all():
        assert (found.direction == signs[inside][order]).all()
        check_by_counts(found)


def test_windows_in_which_delay_helps():
    # Cooke and van den Driessche 1986: switches end after finitely many windows
    family = s**2 + 0.1 * s + 4.0 + 2.0 * delay(T)
    found = dtm.crossings(family, {"T": (0.0, 12.0)})
    check_by_counts(found)
    assert set(found.direction.tolist()) == {-2, 2}
    assert len(found.stable_ranges) >= 2
    low, high = found.stable_ranges[1]
    for value, stable in ((low + 1e-6, True), (high + 1e-6, False)):
        assert family.at(T=value).is_stable() is stable


def test_a_neutral_equation_with_its_delay_free():
    found = dtm.crossings(s + (2.0 + 0.3 * s) * delay(T), {"T": (0.01, 5.0)})
    # w^2 = 4 + 0.09 w^2
    assert found.omega == pytest.approx(2.0 / math.sqrt(0.91), rel=CLOSE)
    check_by_counts(found)


def test_a_pair_that_only_touches_the_axis_has_no_direction():
    # |A|^2 - |B|^2 = (1 - w^2)^2
    found = dtm.crossings(s**2 + 0.5 * s + 1.0 + 0.5 * s * delay(T), {"T": (0.05, 8.0)})
    assert found.values == pytest.approx(math.pi, rel=1e-7)
    assert found.direction.tolist() == [0]
    assert found.counts.tolist() == [0, 0]


def test_several_fixed_delays_beside_the_free_one():
    family = s**2 + 0.7 * s + 1.0 + 0.6 * delay(0.4) + (0.9 - 0.2 * s) * delay(T + 0.3)
    check_by_counts(dtm.crossings(family, {"T": (0.0, 30.0)}))


def test_a_multiple_of_the_delay():
    one = dtm.crossings(s + 2.0 * delay(T), {"T": (0.0, 6.0)})
    two = dtm.crossings(s * delay(0.5 * T) + 2.0 * delay(1.5 * T), {"T": (0.0, 6.0)})
    assert two.values.tolist() == pytest.approx(one.values.tolist())
    assert dtm.crossings(s + 2.0 * delay(2.0 * T), {"T": (0.0, 3.0)}).values == pytest.approx(
        one.values / 2.0
    )


def test_a_loop_and_its_family_cross_alike():
    loop = dtm.ControlLoop(dtm.Integrator(lag=0.05), dtm.PV(2.0, 0.3), delay=0.36)
    family = s * (0.05 * s + 1.0) + (Kp + Kv * s) * delay(T)
    for name, ends in {"Kp": (0.1, 30.0), "Kv": (-3.0, 3.0), "delay": (0.0, 5.0)}.items():
        mine = {"delay": "T"}.get(name, name)
        at = {"Kp": 2.0, "Kv": 0.3, "T": 0.36}
        del at[mine]
        ours = dtm.crossings(loop, {name: ends})
        theirs = dtm.crossings(family, {mine: ends}, at=at)
        assert len(ours)
        assert ours.values == pytest.approx(theirs.values, rel=CLOSE)
        assert (ours.direction == theirs.direction).all()
        check_by_counts(ours)
    high = loop.stable_range("Kp")[1]
    assert high == pytest.approx(dtm.crossings(loop, {"Kp": (2.0, 30.0)}).values[0], rel=1e-10)


def test_a_lag_and_a_gain_of_the_plant_vary_too():
    loop = dtm.ControlLoop(dtm.Integrator(lag=0.5), dtm.P(1.0), delay=0.36)
    for name in ("gain", "lag"):
        check_by_counts(dtm.crossings(loop, {name: (0.01, 20.0)}))
    undecided = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0))
    assert dtm.crossings(undecided, {"delay": (0.0, 1.0)}).values == pytest.approx(math.pi / 4)
    assert len(dtm.crossings(undecided, {"Kp": (1.0, 5.0)}, at={"delay": 0.36})) == 1


@given(
    st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=3),
    st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=2),
    st.floats(0.0, 2.0),
    st.floats(0.05, 2.0),
)
def test_counts_step_by_the_directions_of_gains(fixed, varied, early, late):
    family = s ** len(fixed) + K * sum(c * s**k for k, c in enumerate(varied)) * delay(late)
    family = family + sum(c * s**k for k, c in enumerate(fixed)) * delay(early)
    try:
        found = dtm.crossings(family, {"K": (-4.0, 4.0)})
    except ValueError as error:
        if "stays" not in str(error) and "double precision cannot find" not in str(error):
            raise
        return
    if (np.diff(found.values) > 1e-6).all() and (found.direction != 0).all():
        known = found.counts >= 0
        steps = np.diff(found.counts)
        assert (steps == found.direction)[known[1:] & known[:-1]].all()
    for value, omega in zip(found.values, found.omega, strict=True):
        h = family.at(K=value)
        size = sum(
            np.abs(c) * max(omega, 1.0) ** k for k, c in enumerate(np.abs(h.coefficients).sum(0))
        )
        assert abs(h(1j * omega)) <= 1e-7 * size


@given(st.floats(0.1, 5.0), st.floats(0.0, 2.0), st.floats(-4.0, 4.0), st.floats(-0.8, 0.8))
def test_counts_step_by_the_directions_of_delays(c, d, a, b):
    family = s**2 + d * s + c + (a + b * s) * delay(T)
    try:
        found = dtm.crossings(family, {"T": (0.05, 8.0)})
    except ValueError as error:
        if "stays" not in str(error):
            raise
        return
    if (np.diff(found.values) > 1e-6).all() and (found.direction != 0).all():
        known = found.counts >= 0
        assert (np.diff(found.counts) == found.direction)[known[1:] & known[:-1]].all()


def test_results_do_not_change_and_survive_pickling():
    found = dtm.crossings(s + K * delay(1.0), {"K": (-1, 10)})
    for copy in (found, pickle.loads(pickle.dumps(found))):
        assert copy.counts.tolist() == [1, 0, 2, 4]
        for array in (copy.values, copy.omega, copy.direction, copy.counts):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1
    assert repr(found).startswith("<Crossings of K -1 to 10: 0 (-1 at 0 rad/s), 1.5708 (+2 at")
    assert repr(dtm.crossings(s + K, {"K": (1, 2)})) == "<Crossings of K 1 to 2: none>"


REFUSED = [
    (s + K * delay(1.0), {"Kp": (0, 1)}, None, "Kp is not a parameter"),
    (s + K * delay(T), {"K": (0, 1)}, None, "T has no value"),
    (s + K * delay(T), {"K": (0, 1)}, {"K": 1.0, "T": 1.0}, "has a range, and also a value"),
    (s + K * delay(1.0), {"K": (1, 1)}, None, "below its high end"),
    (s + K * delay(1.0), {}, None, "crossings need a range of exactly one"),
    (s + T * delay(T), {"T": (0, 1)}, None, "both a factor and a delay"),
    (s + K**2 * delay(1.0), {"K": (0, 1)}, None, "only as a factor"),
    (s + delay(T) + delay(7 * T), {"T": (0, 1)}, None, "several delays"),
    (s + 1.0 + 2.0 * s * delay(T), {"T": (0, 1)}, None, "chains"),
    (s * delay(T) + 1.0, {"T": (0, 1)}, None, "not causal"),
    (s + Kp * s * delay(0.3) + 1.0, {"Kp": (1, 2)}, None, "chains"),
    (s * (s + K * delay(1.0)), {"K": (0, 1)}, None, "stays at s = 0 for all values"),
    (s - 1.0 + delay(T), {"T": (0, 2)}, None, "stays at s = 0 for all values"),
    ((s**2 + 1.0) * (s + delay(T)), {"T": (0, 2)}, None, "stays at omega = 1 "),
    (s + delay(T), {"T": (-1, 2)}, None, "delays must not be negative"),
    (s + delay(1.0 - T), {"T": (0, 2)}, None, "a delay is -1 s at T=2"),
]


@pytest.mark.parametrize(("family", "ranges", "at", "told"), REFUSED)
def test_what_is_not_covered_is_refused(family, ranges, at, told):
    with pytest.raises(ValueError, match=told):
        dtm.crossings(family, ranges, at=at)


def test_wrong_types_are_refused():
    with pytest.raises(TypeError, match="family is of type int"):
        dtm.crossings(3, {"K": (0, 1)})
    with pytest.raises(TypeError, match="give a dict"):
        dtm.crossings(s + K, ("K", 0, 1))
    with pytest.raises(TypeError, match="give a range"):
        dtm.crossings(s + K, {"K": 1.0})
    sampled = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    with pytest.raises(ValueError, match=r"sample_time=0\.065"):
        dtm.crossings(sampled, {"Kp": (0, 1)})
    with pytest.raises(ValueError, match="does not depend on this parameter"):
        dtm.crossings(sampled.continuous(), {"Kd": (0, 1)})


@given(st.floats(0.1, 20.0), st.floats(0.001, 0.99))
def test_delay_margin_of_a_proportional_loop(gain, share):
    limit = 0.5 * math.pi / gain
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(gain), delay=share * limit)
    ways = (
        dtm.delay_margin(loop),
        dtm.delay_margin(loop.open_loop()),
        dtm.delay_margin(s + K * delay(T), at={"K": gain, "T": share * limit}),
    )
    assert ways == pytest.approx((limit - share * limit,) * 3, rel=1e-9)


def test_delay_margin_of_a_sampled_loop_is_that_of_its_range():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    assert dtm.delay_margin(loop) == loop.stable_range("delay")[1] - 0.36
    assert dtm.delay_margin(loop) < dtm.delay_margin(loop.continuous())


def test_delay_margins_without_end_and_without_beginning():
    assert dtm.delay_margin(s + 2.0 + delay(T), at={"T": 1.0}) == math.inf
    # neutral: 1 < 1.5 for any delay, while at T = 0 the equation is 2.5 s + 2
    assert dtm.delay_margin(s + 1.0 + (1.5 * s + 1.0) * delay(T), at={"T": 0.0}) == 0.0


def test_delay_margin_inside_a_later_window():
    family = s**2 + 0.1 * s + 4.0 + 2.0 * delay(T)
    low, high = dtm.crossings(family, {"T": (0.0, 12.0)}).stable_ranges[1]
    middle = 0.5 * (low + high)
    assert dtm.delay_margin(family, at={"T": middle}) == pytest.approx(high - middle, rel=1e-10)


def test_an_unstable_loop_has_no_delay_margin():
    unstable = dtm.ControlLoop(dtm.Integrator(), dtm.P(20.0), delay=0.36)
    for loop, at in (
        (unstable, None),
        (unstable.replace(sample_time=0.065), None),
        (unstable.open_loop(), None),
        (s + 20.0 * delay(T), {"T": 0.36}),
    ):
        with pytest.raises(ValueError, match="not stable"):
            dtm.delay_margin(loop, at=at)
    with pytest.raises(ValueError, match="exactly one delay as a parameter"):
        dtm.delay_margin(s + K, at={"K": 1.0})
    with pytest.raises(TypeError, match="have values already"):
        dtm.delay_margin(unstable, at={"Kp": 1.0})
    with pytest.raises(TypeError, match="loop is of type float"):
        dtm.delay_margin(1.0)


@pytest.mark.parametrize(
    ("key", "name", "start", "lost"),
    [
        ("wright1955", "a", 0.1, math.pi / 2.0),
        ("armah2017", "Kp", 0.1, math.pi / 2.0 / 0.36),
        ("armah2017", "Td", 0.1, math.pi / 4.0),
        ("mackey1977", "tau", 0.1, math.acos(-0.25) / math.sqrt(15.0)),
    ],
)
def test_published_ends_of_stability(key, name, start, lost):
    """The first crossing is where the source of the problem says that stability ends."""
    problem = dtm.gallery.problem(key)
    others = {other: value for other, value in problem.values.items() if other != name}
    found = dtm.crossings(problem.family, {name: (start, 1.1 * lost)}, at=others)
    assert found.values[0] == pytest.approx(lost, rel=1e-12)
    assert found.counts[:2].tolist() == [0, 2]
    if name in ("tau", "Td"):
        margin = dtm.delay_margin(problem.family, at={**others, name: start})
        assert start + margin == pytest.approx(lost, rel=1e-12)
