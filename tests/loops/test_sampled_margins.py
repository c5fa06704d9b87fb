"""Margins of sampled loops, held against the eigenvalues of their transition matrices."""

import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

SMOOTH = dtm.DerivativeFilter(38.0)
TUSTIN = dtm.DerivativeFilter(38.0, discretisation="tustin")
PERIOD = 0.065


def sampled(plant, controller, delay, period=PERIOD):
    return dtm.ControlLoop(plant, controller, delay=delay, sample_time=period)


LOOPS = [
    sampled(dtm.Integrator(), dtm.P(0.6), 0.0),
    sampled(dtm.Integrator(), dtm.P(0.6), 0.02),
    sampled(dtm.Integrator(), dtm.P(0.6), 0.065),
    sampled(dtm.Integrator(), dtm.P(0.6), 1.3),
    sampled(dtm.Integrator(), dtm.PV(2.0, 0.2), 0.36),
    sampled(dtm.Integrator(0.85, 0.1), dtm.PV(2.0, 0.2, SMOOTH), 0.36),
    sampled(dtm.Integrator(), dtm.PV(2.0, 0.2, TUSTIN), 0.36),
    sampled(dtm.Integrator(0.85, 0.1), dtm.PID(2.0, 0.2, 0.1, SMOOTH), 0.3),
    sampled(dtm.FirstOrder(2.0, -1.0), dtm.P(-1.2), 0.2),
    sampled(dtm.FirstOrder(2.0, 0.5), dtm.PI(0.4, 0.8), 0.2),
    sampled(dtm.RationalPlant([4.0], [1.0, 0.4, 4.0]), dtm.PI(0.05, 0.2), 0.36),
]


def cut(loop):
    """Transition matrix with the loop opened at the command, and its input and output vectors."""
    model = loop.specification.model
    matrices = [
        model._replace(K=np.zeros_like(model.K), L=direct)
        .native(loop.delay, loop.sample_time)
        .transition_matrix()
        for direct in (0.0, 1.0)
    ]
    whole = loop.transition_matrix()
    return matrices[0], (matrices[1] - matrices[0])[:, -1], whole[len(model.B)]


def radius(loop, factor):
    matrix, into, out = cut(loop)
    return np.abs(np.linalg.eigvals(matrix + factor * np.outer(into, out))).max()


@pytest.mark.parametrize("loop", LOOPS)
def test_margins_are_where_an_eigenvalue_reaches_the_circle(loop):
    found = loop.margin()
    assert found.stable
    for factor, inside in ((found.gain_margin, 1 - 1e-6), (found.gain_reduction, 1 + 1e-6)):
        if 0.0 < factor < math.inf:
            assert radius(loop, factor) == pytest.approx(1.0, abs=1e-9)
            assert radius(loop, inside * factor) < 1.0
    for factor in np.linspace(max(found.gain_reduction, 0.05), min(found.gain_margin, 9.0), 40)[
        1:-1
    ]:
        assert radius(loop, factor) < 1.0
    turn = math.radians(found.phase_margin)
    assert radius(loop, np.exp(1j * turn)) == pytest.approx(1.0, abs=1e-9)
    for part in np.linspace(-0.999, 0.999, 21):
        assert radius(loop, np.exp(1j * part * turn)) < 1.0


@pytest.mark.parametrize("loop", LOOPS)
def test_the_delay_margin_is_where_the_loop_loses_stability(loop):
    found = loop.margin()
    lost = loop.delay + found.delay_margin
    assert lost == pytest.approx(loop.stable_range("delay")[1], rel=1e-9)
    for part in np.linspace(0.0, 0.999, 30):
        assert loop.replace(delay=loop.delay + part * found.delay_margin).is_stable()
    assert not loop.replace(delay=lost + 1e-4 * loop.sample_time).is_stable()


@pytest.mark.parametrize("loop", LOOPS)
def test_the_loop_gain_is_what_closes_to_the_poles(loop):
    # 1 + L = det(z - closed) / det(z - open)
    matrix, _, _ = cut(loop)
    omega = np.linspace(0.2, np.pi / loop.sample_time, 9)
    z = np.exp(1j * omega * loop.sample_time)
    closed, opened = np.linalg.eigvals(loop.transition_matrix()), np.linalg.eigvals(matrix)
    ratio = np.prod(z[:, None] - closed, axis=1) / np.prod(z[:, None] - opened, axis=1)
    np.testing.assert_allclose(1.0 + loop.frequency_response(omega), ratio, rtol=1e-6, atol=1e-9)
    turned = np.exp(1j * loop.phase(omega))
    expected = loop.frequency_response(omega)
    np.testing.assert_allclose(turned, expected / np.abs(expected), atol=2e-3)


def test_the_phase_of_a_sampled_loop_is_that_of_the_continuous_one_but_for_the_hold():
    # Past an undamped mode it drops by half a turn, as past one that is hardly damped.
    undamped = dtm.RationalPlant([1.0], [1.0, 0.0, 4.0])
    light = dtm.RationalPlant([1.0], [1.0, 1e-7, 4.0])
    omega = np.array([0.1, 1.9, 2.1, 60.0])
    found = [sampled(plant, dtm.P(0.5), 0.1, 0.05).phase(omega) for plant in (undamped, light)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-5)
    # At zero frequency minus a quarter turn for each integrator, whatever the delay.
    for loop, integrators in ((LOOPS[3], 1), (LOOPS[7], 2), (LOOPS[9], 1)):
        assert loop.phase(0.0) == pytest.approx(-integrators * math.pi / 2, abs=1e-12)
    # The hold is late by half a sample at low frequencies.
    slow = np.array([1e-3, 1e-2])
    for loop in LOOPS[3:8]:
        late = loop.continuous().phase(slow) - loop.phase(slow)
        np.testing.assert_allclose(late, 0.5 * slow * PERIOD, rtol=0.2)


@pytest.mark.parametrize(
    "controller", [dtm.P(1.5), dtm.PV(2.0, 0.2, SMOOTH), dtm.PI(1.0, 0.2), dtm.PV(2.0, 0.2)]
)
def test_fast_samples_have_the_margins_of_the_continuous_loop(controller):
    loop = dtm.ControlLoop(dtm.Integrator(0.85, 0.1), controller, delay=0.3603)
    exact, off = loop.margin(), []
    for period in (0.004, 0.001):
        found = loop.replace(sample_time=period).margin()
        off.append(
            [
                found.gain_margin / exact.gain_margin - 1.0,
                (found.phase_margin - exact.phase_margin) / exact.phase_margin,
                (found.delay_margin - exact.delay_margin) / exact.delay_margin,
            ]
        )
    # of first order in the sample time: the hold is late by half of it
    np.testing.assert_allclose(np.array(off[1]) * 4.0, off[0], rtol=0.1)
    assert np.abs(off[1]).max() < 5e-3
    omega = np.geomspace(0.1, 20.0, 7)
    np.testing.assert_allclose(
        loop.replace(sample_time=1e-5).frequency_response(omega),
        loop.frequency_response(omega),
        rtol=2e-4,
    )
    np.testing.assert_allclose(
        loop.replace(sample_time=1e-3).phase(omega), loop.phase(omega), atol=2e-2
    )


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.1, 3.0),
    st.floats(-0.1, 0.4),
    st.floats(0.0, 0.5),
    st.floats(0.02, 0.2),
    st.floats(0.01, 0.3),
)
def test_no_gain_below_the_margin_is_unstable(Kp, Kv, delay, period, lag):
    loop = sampled(dtm.Integrator(0.85, lag), dtm.PV(Kp, Kv, SMOOTH), delay, period)
    assume(loop.spectral_abscissa() < -1e-3)
    found = loop.margin()
    assert radius(loop, found.gain_margin) == pytest.approx(1.0, abs=1e-7)
    for factor in np.linspace(1.0, found.gain_margin, 15)[:-1]:
        assert radius(loop, factor) < 1.0
    for part in np.linspace(-0.99, 0.99, 9):
        assert radius(loop, np.exp(1j * part * math.radians(found.phase_margin))) < 1.0


def test_a_delay_margin_of_more_than_two_hundred_samples():
    loop = sampled(dtm.Integrator(), dtm.P(1.5), 0.36, 0.005)
    found = loop.margin().delay_margin
    lost = loop.delay + found
    assert loop.replace(delay=lost - 1e-4).is_stable()
    assert not loop.replace(delay=lost + 1e-4).is_stable()


def response(loop, omega, delay):
    """The loop gain with another delay in 60 digits, from the equations of the loop."""
    import mpmath as mp

    with mp.workdps(60):
        model, period = loop.specification.model, mp.mpf(loop.sample_time)
        n, exact = len(model.B), mp.mpf(delay)
        whole = mp.floor(exact / period)
        early = exact - whole * period
        joined = mp.zeros(n + 1)
        for i in range(n):
            for j in range(n):
                joined[i, j] = mp.mpf(float(model.A[i, j]))
            joined[i, n] = mp.mpf(float(model.B[i]))
        late, first = (mp.expm(joined * time) for time in (period - early, early))
        moves = late[:n, :n] * first[:n, :n]
        older, newer = late[:n, :n] * first[:n, n], late[:n, n]
        z = mp.expj(mp.mpf(omega) * period)
        states = mp.lu_solve(z * mp.eye(n) - moves, older / z + newer)
        back = sum(mp.mpf(float(k)) * x for k, x in zip(model.K, states, strict=True))
        return complex(-(back + mp.mpf(float(model.L)) / z) * z**-whole)


#: Loops with a pole or a zero of the loop gain next to z = 1, and delay margins up to 1e12 samples.
SLOW = [
    *(sampled(dtm.FirstOrder(1.0, 1.0), dtm.PI(0.5, Ki), 0.1, 0.01) for Ki in (1e-10, 1e-8, 1e-5)),
    *(sampled(dtm.Integrator(), dtm.P(Kp), 0.36) for Kp in (1e-10, 1e-4)),
    sampled(dtm.FirstOrder(1.0, 1e7), dtm.P(3.0), 0.1, 0.01),
    sampled(dtm.FirstOrder(1.0, 1e5), dtm.PI(0.5, 1e-7), 0.1, 0.01),
    sampled(dtm.Integrator(1.0, 0.02), dtm.PID(1e-5, 1e-11, 1e-6, SMOOTH), 0.1, 0.05),
    sampled(dtm.Integrator(), dtm.PV(1e-6, 0.2), 0.36),
]


@pytest.mark.parametrize("loop", SLOW)
def test_a_margin_takes_no_more_work_next_to_one(loop):
    """Work grew with one over Ki: 1.5 s at 1e-4, no end at 1e-5, and refused at 1e-10."""
    pytest.importorskip("mpmath")
    found = loop.margin()
    assert found.stable
    lost = loop.delay + found.delay_margin
    assert abs(1.0 + response(loop, found.delay_margin_omega, lost)) < 1e-6
    # No other crossover, which could turn to -1 earlier, and not a whole turn too late.
    omega = np.geomspace(1e-3 * found.delay_margin_omega, np.pi / loop.sample_time, 3000)
    above = np.abs(loop.frequency_response(omega)) > 1.0
    assert np.count_nonzero(np.diff(above)) == 1
    assert 0.0 < found.delay_margin * found.delay_margin_omega < 2.0 * math.pi


def test_a_gain_margin_of_light_modes_with_few_digits():
    """It was 961: the interval of the first crossing held zero, and so it was taken for that."""
    plant = dtm.RationalPlant(
        [2.838486838890161, 141.00499244570625, 34049.42923715788, 860824.0, 17721193.0],
        [0.1334594903976515, 1.4141317837907716, 1594.0989301208474, 13288.57, 843457.7, 6243183.0],
        0.001,
    )
    smooth = dtm.DerivativeFilter(57.2255121643435, 0.23802857142396533, "tustin")
    loop = sampled(plant, dtm.PID(1.57637695, 0.00171426145, 0.07085253802, smooth), 0.0, 0.169357)
    found = loop.margin().gain_margin
    assert radius(loop, 1.001 * found) > 1.0 > radius(loop, 0.999 * found)
    for factor in np.linspace(0.1, 0.99, 20) * found:
        assert radius(loop, factor) < 1.0


def test_an_unstable_sampled_loop_has_no_margins_but_crossings():
    found = sampled(dtm.Integrator(), dtm.P(9.0), 0.36).margin()
    assert not found.stable
    assert math.isnan(found.gain_margin)
    assert math.isnan(found.phase_margin)
    assert math.isnan(found.delay_margin)
    assert found.gain_crossovers.size
    assert "not stable" in repr(found)


def test_a_pole_among_the_frequencies_leaves_the_others_as_they_are():
    found = LOOPS[0].frequency_response([0.0, 1.0])
    assert np.isinf(found[0])
    assert found[1] == pytest.approx(LOOPS[0].frequency_response(1.0), rel=1e-12)


def test_frequencies_beyond_half_the_sampling_rate_are_refused():
    for omega in (50.0, -1.0, [-1.0, 50.0]):
        with pytest.raises(ValueError, match=r"from 0 to 48\.3"):
            LOOPS[0].frequency_response(omega)
    with pytest.raises(ValueError, match="None"):
        LOOPS[0].replace(delay=None).margin()


def test_a_bode_plot_of_a_sampled_loop():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    upper, lower = LOOPS[5].bode()
    assert "gain margin 2.17" in upper.get_title()
    assert lower.get_xlim()[1] == pytest.approx(np.pi / PERIOD)
    pyplot.close("all")
    upper, _ = LOOPS[5].continuous().bode()
    assert "gain margin" in upper.get_title()
    pyplot.close("all")
