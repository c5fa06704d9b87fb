"""Stable ranges of a loop's parameters against eigenvalues, proved counts and closed forms."""

import math
import tracemalloc

import deadtime as dtm
import numpy as np
import pytest
from deadtime.roots import QuasiPolynomial
from hypothesis import assume, given, settings, strategies as st

Z, W = 0.1, 2.0


def resonant(factor, sample_time=None):
    """An oscillator whose loop gain is `factor` at its peak."""
    gain = 2.0 * Z * W * W * math.sqrt(1.0 - Z * Z) * factor
    plant = dtm.RationalPlant([1.0], [1.0, 2.0 * Z * W, W * W])
    return dtm.ControlLoop(plant, dtm.P(gain), delay=0.3, sample_time=sample_time)


def first_crossing(factor):
    """(W^2 - x)^2 + (2 Z W)^2 x = K^2 for x = omega^2, and the first delay that turns L to -1."""
    gain = 2.0 * Z * W * W * math.sqrt(1.0 - Z * Z) * factor
    x = np.roots([1.0, (2.0 * Z * W) ** 2 - 2.0 * W * W, W**4 - gain * gain])
    omega = np.sqrt(x)
    delays = (math.pi - np.arctan2(2.0 * Z * W * omega, W * W - omega**2)) / omega
    return delays[delays > 0.3].min()


def radius(loop, **changes):
    return np.abs(np.linalg.eigvals(loop.replace(**changes).transition_matrix())).max()


@pytest.mark.parametrize("factor", [1.003, 1.01, 1.00001, 1.0000001])
def test_a_window_of_instability_ends_the_range_of_the_delay(factor):
    """The search missed it once: 82.67 s, though the loop is unstable from 0.7987 s to 0.9."""
    loop = resonant(factor)
    high = loop.stable_range("delay")[1]
    assert high == pytest.approx(first_crossing(factor), rel=1e-7)
    assert dtm.delay_margin(loop) == pytest.approx(high - 0.3, rel=1e-6)
    within = loop.replace(delay=high * (1.0 + 1e-5 * (factor > 1.001)))
    if factor > 1.001:
        assert within.count(re=(0.0, None)) == 2


def test_no_delay_destabilises_a_resonance_below_one():
    assert resonant(0.999999).stable_range("delay") == (0.0, math.inf)
    assert resonant(0.999, 0.02).stable_range("delay") == (0.0, math.inf)
    assert resonant(0.999, 0.02).margin().delay_margin == math.inf


@pytest.mark.parametrize(("factor", "window"), [(1.003, 1e-3), (1.0004, 1e-5)])
def test_a_sampled_loop_meets_the_same_window(factor, window):
    loop = resonant(factor, 0.02)
    high = loop.stable_range("delay")[1]
    assert high < 0.9
    assert radius(loop, delay=high) == pytest.approx(1.0, abs=1e-9)
    assert radius(loop, delay=high + window) > 1.0
    assert max(radius(loop, delay=delay) for delay in np.linspace(0.0, high, 60)[:-1]) < 1.0
    assert loop.margin().delay_margin == pytest.approx(high - 0.3, rel=1e-12)


def test_delays_of_many_samples():
    """With more than 200 samples the margin was infinite once: the unsafe side."""
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.001)
    high = loop.stable_range("delay")[1]
    assert high - 0.36 == pytest.approx(0.4249, abs=5e-5)
    assert dtm.delay_margin(loop) == pytest.approx(high - 0.36, rel=1e-12)
    assert loop.margin().delay_margin == pytest.approx(high - 0.36, rel=1e-12)
    # (z - 1) z^(m+1) + K ((1 - f) z + f) Ts = 0 on the circle: its modulus, then its argument.
    m, f = divmod(high / 0.001, 1.0)
    angle = np.linspace(1.9e-3, 2.1e-3, 200_001)
    z = np.exp(1j * angle)
    ratio = -2.0 * 0.001 * ((1.0 - f) * z + f) / (z - 1.0)
    place = np.argmin(np.abs(np.abs(ratio) - 1.0))
    assert math.remainder((m + 1.0) * angle[place] - np.angle(ratio[place]), 2.0 * math.pi) == (
        pytest.approx(0.0, abs=1e-6)
    )
    slower = loop.replace(sample_time=0.003)
    high = slower.stable_range("delay")[1]
    assert radius(slower, delay=high - 1e-6) < 1.0 < radius(slower, delay=high + 1e-6)


def test_a_slow_integral_costs_no_memory():
    """Memory grew with the margin over the sample time, to 8 GB with Ki = 1e-4."""
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.PI(0.5, 1e-4), delay=0.3, sample_time=0.01)
    tracemalloc.start()
    found = loop.margin()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e8
    # The sample costs half of itself, of a margin of some thousands of seconds.
    assert found.delay_margin == pytest.approx(loop.continuous().margin().delay_margin, rel=1e-4)


@pytest.mark.parametrize(
    ("Kp", "Ki"), [(0.95, 1e-4), pytest.param(0.99, 1e-5, marks=pytest.mark.survey)]
)
def test_turns_of_the_delay_are_followed_only_where_the_gain_reaches_one(Kp, Ki):
    """All turns with a gain above 0.3 were followed: 20 s for this margin, mostly of 0.5."""
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.PI(0.5, 1e-4), delay=0.3, sample_time=0.01)
    slow = loop.replace(Kp=Kp, Ki=Ki)
    smooth = slow.continuous().margin().delay_margin
    assert slow.margin().delay_margin == pytest.approx(smooth, rel=1e-5)


def test_an_ideal_derivative_loses_stability_at_a_whole_number_of_samples():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PD(2.0, 0.6), delay=0.02, sample_time=0.1)
    high = loop.stable_range("delay")[1]
    assert max(radius(loop, delay=delay) for delay in np.linspace(0.0, high * (1 - 1e-9), 50)) < 1.0
    assert radius(loop, delay=high * (1.0 + 1e-9)) > 1.0


def test_sample_times_of_an_ideal_derivative_without_delay():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PD(2.0, 0.6), delay=0.0, sample_time=0.1)
    low, high = loop.stable_range("sample_time")
    assert low == 0.0
    for period in np.linspace(0.001, 0.999, 20) * high:
        assert radius(loop, sample_time=period) < 1.0
    assert radius(loop, sample_time=high * (1.0 + 1e-9)) > 1.0


def test_ranges_of_times_end_where_jury_says():
    """z^2 + (K (Ts - d) - 1) z + K d for an integrator with a delay d within a sample."""
    gain, period, delay = 2.5, 1.0, 0.2
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(gain), delay=delay, sample_time=period)
    ends = (0.5 * period - 1.0 / gain, 1.0 / gain)
    assert loop.stable_range("delay") == pytest.approx(ends, rel=1e-12)
    low, high = loop.stable_range("sample_time")
    assert low == 0.0
    assert high == pytest.approx(2.0 / gain + 2.0 * delay, rel=1e-12)


def test_a_range_needs_polynomials_in_the_number():
    """The range of such a number was searched in steps, with no proof."""
    plant = dtm.ParametricPlant(lambda m: ([1.0], [math.sqrt(m), 1.0, 0.0]), {"m": 0.5})
    loop = dtm.ControlLoop(plant, dtm.P(0.5), delay=0.1, sample_time=0.05)
    assert loop.stable_range("delay")[0] == 0.0
    with pytest.raises(TypeError, match="add, subtract and multiply"):
        loop.stable_range("m")


@pytest.mark.parametrize("name", ["time_constant", "sample_time"])
def test_a_loop_gain_below_one_is_stable_for_all_values(name):
    """Both were refused: nothing beyond a million times the value was ruled out."""
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.P(0.5), delay=0.1, sample_time=0.1)
    assert loop.stable_range(name) == (0.0, math.inf)


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        (dtm.FirstOrder(1.0, 1.0), "time_constant"),
        (dtm.FactoredPlant([0.6, 0.1]), "lag_1"),
        (dtm.FactoredPlant(pole_frequency=18.0, pole_damping=0.8), "pole_damping"),
    ],
)
def test_a_plant_may_be_as_slow_as_it_likes(plant, name):
    """The phase margin tends to zero with the crossover, the delay margin does not."""
    loop = dtm.ControlLoop(plant, dtm.PI(0.6, 0.01), delay=0.1, sample_time=0.05)
    low, high = loop.stable_range(name)
    assert high == math.inf
    value = loop.parameters[name]
    for factor in np.geomspace(1.0, 1e4, 9):
        assert radius(loop, **{name: factor * value}) < 1.0
    assert low == 0.0 or radius(loop, **{name: low}) == pytest.approx(1.0, abs=1e-9)


def test_a_lag_of_a_slow_continuous_loop_may_have_any_value():
    # With K T < 1, lag s^2 + s + K e^(-sT) has no root on the axis for any lag above zero.
    lagging = dtm.ControlLoop(dtm.Integrator(1.0, 0.3), dtm.P(1.2), delay=0.25)
    assert lagging.stable_range("lag") == (0.0, math.inf)


#: A plant with modes at 3.4 and 80.7 rad/s of damping 0.016 and 0.008.
LIGHT = dtm.RationalPlant(
    [
        0.8213817349038446,
        12.131365493346397,
        5372.449419536702,
        2343.109560512082,
        58446.7334396002,
    ],
    [
        *(0.9985107278409586, 2.2288848136446697, 6528.206343212537),
        *(8451.560730231227, 72968.33689424809, 71156.60229094612),
    ],
)


@pytest.mark.survey
@pytest.mark.long
def test_a_window_of_sample_times_between_the_turns_of_a_light_mode_ends_the_range():
    """A step went over it: (0, 1.4525), where the loop is unstable at 1.4423 s."""
    smooth = dtm.DerivativeFilter(20.01349987358118, 0.2231690239012105, "hold")
    controller = dtm.PID(1.9769053972681796, 0.009655493191092606, 0.08109112368455505, smooth)
    loop = dtm.ControlLoop(LIGHT, controller, delay=0.0, sample_time=0.8)
    low, high = loop.stable_range("sample_time")
    assert low == 0.0
    assert high < 1.4423328
    assert radius(loop, sample_time=high) == pytest.approx(1.0, abs=1e-7)
    for period in np.linspace(low, high, 300)[1:-1]:
        assert radius(loop, sample_time=period) < 1.0 + 1e-12


@pytest.mark.parametrize("smooth", [None, dtm.DerivativeFilter(20.0)])
@pytest.mark.parametrize("plant", [dtm.Integrator(1.0, 0.05), dtm.FirstOrder(1.2, 0.4)])
def test_the_derivative_of_a_controller_with_an_integral_has_a_range(plant, smooth):
    """Every one was refused: the derivative's zero and the integral's pole cancel at z = 1."""
    loop = dtm.ControlLoop(plant, dtm.PID(0.6, 0.05, 0.02, smooth), delay=0.1, sample_time=0.02)
    low, high = loop.stable_range("Kd")
    for end in (low, high):
        assert radius(loop, Kd=end) == pytest.approx(1.0, abs=1e-9)
        assert radius(loop, Kd=end + 1e-6 * math.copysign(1.0, end)) > 1.0
    for Kd in np.linspace(low, high, 40)[1:-1]:
        assert radius(loop, Kd=Kd) < 1.0


def test_the_damping_of_a_filter_in_samples_changes_stability():
    """It was taken for a number without effect: (0, inf), where the loop is unstable at 0.068."""
    plant = dtm.RationalPlant([1.0], [0.516, 1.513, 0.0])
    smooth = dtm.DerivativeFilter(5.39, 0.837, "hold")
    loop = dtm.ControlLoop(
        plant, dtm.PID(0.11, 0.0123, 0.48, smooth), delay=0.152, sample_time=0.0566
    )
    low, _ = loop.stable_range("damping")
    assert low > 0.068
    assert radius(loop, damping=low) == pytest.approx(1.0, abs=1e-9)


def test_a_time_constant_that_ends_next_to_zero():
    """Refused for too many crossings: 1e-6 of the value was searched at once."""
    gain, delay = 1.6, 0.1
    loop = dtm.ControlLoop(dtm.FirstOrder(gain, 1.4), dtm.P(2.5), delay=delay)
    low, high = loop.stable_range("time_constant")
    # T s + 1 + k e^(-s delay): cos(omega delay) = -1/k and T omega = k sin(omega delay).
    k = 2.5 * gain
    turn = math.acos(-1.0 / k)
    assert low == pytest.approx(k * math.sin(turn) * delay / turn, rel=1e-12)
    assert high == math.inf


plants = st.one_of(
    st.builds(dtm.Integrator, st.floats(0.3, 2.0), st.sampled_from([0.0, 0.1, 0.4])),
    st.builds(dtm.FirstOrder, st.floats(0.3, 2.0), st.floats(0.2, 2.0)),
    st.builds(
        lambda w, z: dtm.RationalPlant([w * w], [1.0, 2.0 * z * w, w * w]),
        st.floats(0.8, 6.0),
        st.sampled_from([0.02, 0.1, 0.5]),
    ),
)
controllers = st.one_of(
    st.builds(dtm.P, st.floats(0.1, 1.5)),
    st.builds(dtm.PI, st.floats(0.1, 1.0), st.sampled_from([1e-3, 0.05, 0.3])),
    st.builds(
        dtm.PV, st.floats(0.2, 1.5), st.floats(-0.1, 0.3), st.just(dtm.DerivativeFilter(30.0))
    ),
)


def choose(draw, sample_time):
    loop = dtm.ControlLoop(
        draw(plants), draw(controllers), delay=draw(st.floats(0.01, 0.5)), sample_time=sample_time
    )
    name = draw(st.sampled_from(["delay", "gain", *loop.controller.gains]))
    return loop, name


def inside(low, high, value):
    """Points of a range, denser towards its ends."""
    low, high = max(low, -9.0 * abs(value) - 1.0), min(high, 9.0 * abs(value) + 1.0)
    share = np.concatenate([np.linspace(0.01, 0.99, 25), np.geomspace(1e-5, 0.01, 4)])
    return np.concatenate([low + share * (high - low), high - np.geomspace(1e-5, 0.01, 4)])


@settings(max_examples=8, deadline=None)
@given(st.data(), st.sampled_from([0.05, 0.12]))
def test_sampled_ranges_are_stable_to_their_ends_by_eigenvalues(data, period):
    loop, name = choose(data.draw, period)
    assume(radius(loop) < 1.0 - 1e-5)
    low, high = loop.stable_range(name)
    value = loop.parameters[name]
    for point in inside(low, high, value):
        if low < point < high and point != 0.0:
            assert radius(loop, **{name: point}) < 1.0 + 1e-10
    for end in (low, high):
        if math.isfinite(end) and end != 0.0 and end < 60.0 * period:
            assert radius(loop, **{name: end}) == pytest.approx(1.0, abs=1e-8)
    if name == "gain":
        found = loop.margin()
        assert high == pytest.approx(value * found.gain_margin, rel=1e-8)


@settings(max_examples=12, deadline=None)
@given(st.data())
def test_continuous_ranges_have_no_unstable_root_by_proved_counts(data):
    loop, name = choose(data.draw, None)
    assume(loop.spectral_abscissa() < -1e-5)
    low, high = loop.stable_range(name)
    value = loop.parameters[name]

    def unstable(point):
        changed = loop.specification.kernel_at({name: point}).characteristic()
        return QuasiPolynomial._wrap(changed).count(re=(0.0, None))

    for point in inside(low, high, value):
        if low < point < high:
            assert unstable(point) == 0
    found = loop.margin()
    if name == "delay":
        assert high - value == pytest.approx(found.delay_margin, rel=1e-9)
    if name == "gain":
        assert high == pytest.approx(value * found.gain_margin, rel=1e-9)
    if math.isfinite(high):
        ends = (0.5 * (value + high), high + 0.1 * (high - value))
        listed = dtm.crossings(loop, {name: ends}).values
        assert listed.size == 0 or listed.min() == pytest.approx(high, rel=1e-9)
