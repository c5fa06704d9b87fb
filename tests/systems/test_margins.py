"""Margins of loops: closed forms, and loss of stability exactly there."""

import math
import pickle

import numpy as np
import pytest
from deadtime import TransferFunction, delay, feedback, s
from hypothesis import assume, given, settings, strategies as st
from transfers import LOOPS, quasi_polynomials, times


@settings(max_examples=30)
@given(st.floats(0.1, 10), st.floats(0.01, 0.99))
def test_margins_of_an_integrator_in_closed_form(K, part):
    T = part * math.pi / (2 * K)
    found = (K / s * delay(T)).margin()
    assert found.stable
    assert found.gain_margin == pytest.approx(math.pi / (2 * K * T), rel=1e-12)
    assert found.gain_margin_omega == pytest.approx(math.pi / (2 * T), rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(K * T), rel=1e-10)
    assert found.delay_margin == pytest.approx(math.pi / (2 * K) - T, rel=1e-10)
    assert found.delay_margin_omega == pytest.approx(K, rel=1e-14)
    assert found.gain_reduction == 0.0


def test_margins_of_a_first_order_lag_in_closed_form():
    K, a, T = 3.0, 0.7, 0.4
    found = (K / (s + a) * delay(T)).margin()
    omega = math.sqrt(K * K - a * a)
    assert found.gain_crossovers.tolist() == [pytest.approx(omega, rel=1e-14)]
    assert found.delay_margin == pytest.approx((math.pi - math.atan(omega / a)) / omega - T)


def test_an_unstable_plant_has_a_least_gain():
    found = (2.0 * delay(0.1) / (s - 1)).margin()
    assert found.stable
    assert found.gain_reduction == pytest.approx(0.5, rel=1e-14)
    assert found.gain_reduction_omega == 0.0
    for factor, stable in ((0.501, True), (0.499, False)):
        assert feedback(factor * 2.0 * delay(0.1) / (s - 1)).is_stable() is stable


@pytest.mark.parametrize("G", LOOPS)
def test_margins_are_where_stability_is_lost(G):
    found = G.margin()
    if not found.stable:
        pytest.fail(f"{G} is no example")
    lost = found.delay_margin
    if math.isfinite(lost) and lost > 0.0:
        assert (G.den + G.num * delay(0.9999 * lost)).is_stable()
        assert not (G.den + G.num * delay(1.0001 * lost)).is_stable()
        for part in (0.2, 0.5, 0.8):
            assert (G.den + G.num * delay(part * lost)).is_stable()
    else:
        assert all((G.den + G.num * delay(T)).is_stable() for T in (0.01, 1.0, 20.0))
    for factor, inside, outside in (
        (found.gain_margin, 0.9999, 1.0001),
        (found.gain_reduction, 1.0001, 0.9999),
    ):
        if 0.0 < factor < math.inf:
            assert (G.den + factor * inside * G.num).is_stable()
            assert not (G.den + factor * outside * G.num).is_stable()


def test_the_delay_margin_is_not_always_at_the_last_or_first_crossing():
    G = LOOPS[-1]
    found = G.margin()
    assert len(found.gain_crossovers) == 3
    assert found.delay_margin == found.delay_margins.min()
    assert found.delay_margin_omega == found.gain_crossovers[np.argmin(found.delay_margins)]


@settings(max_examples=40)
@given(quasi_polynomials(), quasi_polynomials(degree=3))
def test_no_crossing_is_missed(n, d):
    assume(n.coefficients.any())
    # The highest power of the denominator without delay: no neutral or advanced loops here.
    d = d + (5 * s**4)
    G = TransferFunction(n, d)
    found = G.margin()
    assert found.searched[0] == math.inf
    w = np.linspace(1e-3, 20, 20001)
    values = G.frequency_response(w)
    size = np.log(np.abs(values))
    # A gain of one within rounding errors, far from a crossing, may have either sign.
    told = np.maximum(np.abs(size[:-1]), np.abs(size[1:])) > 1e-12
    changes = np.flatnonzero((size[:-1] * size[1:] < 0) & told)
    for low, high in zip(w[changes], w[changes + 1], strict=True):
        assert ((found.gain_crossovers >= low) & (found.gain_crossovers <= high)).sum() == 1
    real = (values.imag[:-1] * values.imag[1:] < 0) & (values.real[:-1] < 0)
    real &= (values.real[1:] < 0) & (w[1:] < found.searched[1])
    for at in np.flatnonzero(real):
        inside = (found.phase_crossovers >= w[at]) & (found.phase_crossovers <= w[at + 1])
        assert inside.sum() == 1
    for omega in found.gain_crossovers:
        assert abs(n(1j * omega)) == pytest.approx(abs(d(1j * omega)), rel=1e-6)
    below = found.gain_margins[found.gain_margins > 1.0]
    if found.stable and below.size and found.searched[1] < math.inf:
        far = np.geomspace(found.searched[1], 1e3 * found.searched[1], 2001)
        assert (np.abs(G.frequency_response(far)) < 1.0 / below.min()).all()


@settings(max_examples=30)
@given(quasi_polynomials(rows=2, degree=1), times)
def test_random_delay_margins_are_where_stability_is_lost(n, tau):
    assume(n.coefficients.any())
    G = n * delay(tau) / (s**2 + 3 * s + 2)
    found = G.margin()
    assume(found.stable)
    lost = found.delay_margin
    if lost == 0.0 or lost > 50.0:
        return
    assume(lost > 1e-3)
    assert (G.den + G.num * delay(0.999 * lost)).is_stable()
    assert not (G.den + G.num * delay(1.001 * lost)).is_stable()


def test_a_gain_that_only_touches_one_is_listed():
    # |s^2 + a s + b|^2 = (omega^2 - 1)^2 + 1, but for rounding.
    d = s**2 + math.sqrt(2 * math.sqrt(2) - 2) * s + math.sqrt(2)
    found = (1 / d).margin()
    assert found.gain_crossovers.size in (1, 2)
    np.testing.assert_allclose(found.gain_crossovers, 1.0, atol=1e-6)


@pytest.mark.parametrize(
    "G",
    [
        delay(1.0) / (5 * s**4 + delay(1.0)),
        0.5 * delay(0.3) * (1 + 0.3 * s + 0.045 * s**2 + 0.0045 * s**3) / (1 - s**4),
        1 / (s + 1),
        (1 + 0.3 * s) * delay(0.3) / (s**2 + 1),
    ],
)
def test_crossings_of_high_order_at_zero_frequency_hide_no_others(G):
    found = G.margin()
    w = np.geomspace(1e-6, 30.0, 60001)
    values = G.frequency_response(w)
    crossed = (values.imag[1:] * values.imag[:-1] < 0) & (values.real[1:] < 0)
    crossed &= (values.real[:-1] < 0) & (w[1:] < found.searched[1]) & (w[:-1] > 1e-2)
    assert crossed.sum() == ((found.phase_crossovers > 1e-2) & (found.phase_crossovers < 30)).sum()


def test_unstable_loops_have_no_margins_but_crossings():
    found = (9.0 / s * delay(0.36)).margin()
    assert not found.stable
    assert math.isnan(found.gain_margin)
    assert math.isnan(found.delay_margin)
    assert math.isnan(found.phase_margin_omega)
    assert found.gain_crossovers.tolist() == [pytest.approx(9.0)]
    assert "not stable" in repr(found)
    assert not found.gain_crossovers.flags.writeable
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)


def test_neutral_loops_lose_strong_stability():
    # A delay of any length splits what a lead without delay kept together.
    G = 1.5 * (s + 1) / (s + 2)
    found = G.margin()
    assert found.stable
    assert found.delay_margin == 0.0
    assert found.delay_margin_omega == math.inf
    assert not (G.den + G.num * delay(1e-4)).is_stable()
    # With a high-frequency gain of 0.3 a factor of 10/3 is one that no neutral loop stands.
    found = (0.3 * (s + 1) * delay(0.1) / (s + 2)).margin()
    assert found.gain_margin == pytest.approx(1 / 0.3, rel=1e-14)
    assert found.gain_margin_omega == math.inf
    assert found.delay_margin > 0.0
    # Two delays in the lead: their coefficients add up in the worst case.
    found = ((1 + 0.2 * s) * (delay(0.1) + delay(0.1732)) / (s * (1 + 0.3 * delay(0.2)))).margin()
    assert found.gain_margin <= 0.7 / 0.4 * (1 + 1e-14)


@pytest.mark.parametrize(
    ("G", "message"),
    [
        (TransferFunction(s * delay(0.1)), "grows with frequency"),
        (1 / (s * delay(0.5)), "not causal"),
        (1 / (1 + s * delay(0.5)), "not causal"),
    ],
)
def test_loops_without_margins_are_refused(G, message):
    with pytest.raises(ValueError, match=message):
        G.margin()


def test_margins_with_long_and_short_delays():
    found = (2 / s * delay(1e-6)).margin()
    assert found.gain_margin == pytest.approx(math.pi / 4e-6, rel=1e-9)
    found = (1e-4 / s * delay(1e4)).margin()
    assert found.gain_margin == pytest.approx(math.pi / 2, rel=1e-12)
    assert found.delay_margin == pytest.approx(1e4 * (math.pi / 2 - 1), rel=1e-9)
