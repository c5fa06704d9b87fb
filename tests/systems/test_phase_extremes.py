"""Frequency responses from 5e-324 to 1.7e308 rad/s are correct, or refused quickly."""

import math

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import delay, s

FREQUENCIES = [
    5e-324,
    1e-308,
    1e-200,
    1e-10,
    1.0,
    1e5,
    1e8,
    1e15,
    1e20,
    1e100,
    1e300,
    1e308,
    1.7e308,
]

# The phase less that of the delay, at zero and at infinity (modulo what still turns there).
LOOPS = [
    (2.0 / s * delay(0.36), 0.36, -0.5 * math.pi, -0.5 * math.pi),
    (2.0 * delay(0.36) / (1 + 0.1 * s), 0.36, 0.0, -0.5 * math.pi),
    (dtm.feedback(2.0 / s * delay(0.36)), 0.36, 0.0, -0.5 * math.pi),
    (1.0 / (s**2 + 4) * delay(0.1), 0.1, 0.0, -math.pi),
    ((1 + 0.5 * delay(1.0) + s) / (s**2 + s * delay(0.3) + 1), 0.0, 0.0, -0.5 * math.pi),
    ((s + 1) / (s * (1 + 0.5 * delay(1.0)) + 1), 0.0, 0.0, 0.0),
    (1 / (s + 1) ** 5, 0.0, 0.0, -2.5 * math.pi),
]


@pytest.mark.parametrize("number", range(len(LOOPS)))
def test_the_phase_at_any_frequency(number):
    # At 1e308 powers overflow and 2^400 intervals were begun; from 1e10 on a neutral loop took
    # as many intervals as its delay has turns.
    G, late, low, high = LOOPS[number]
    phase = G.phase(FREQUENCIES)
    rest = phase + late * np.array(FREQUENCIES)
    assert rest[:3] == pytest.approx(np.full(3, low), abs=1e-9)
    # asin 1/2 is the most that 1 + 0.5 e^(-s) turns; beyond 1e15 a double holds the delay alone.
    assert rest[7] == pytest.approx(high, abs=0.53 + 4.0 * np.spacing(late * 1e15))
    assert np.all(np.abs(rest[8:] - high) <= 0.53 + 4.0 * np.spacing(np.abs(phase[8:]) + 1.0))
    mirrored = G.phase(-np.array(FREQUENCIES))
    assert np.array_equal(mirrored, -phase)


@pytest.mark.parametrize("omega", [0.3, 7.0, 1e3, 1e6])
def test_the_phase_is_the_argument_up_to_whole_turns(omega):
    for G, *_ in LOOPS:
        off = (G.phase([omega])[0] - np.angle(G(1j * omega))) / (2.0 * math.pi)
        assert abs(off - round(off)) < 1e-6


def test_one_frequency_has_the_same_phase_alone_and_among_others():
    for G, *_ in LOOPS:
        many = G.phase(np.geomspace(0.01, 1e4, 400))
        assert G.phase([1e4])[0] == pytest.approx(many[-1], abs=1e-6)


def test_a_phase_that_no_double_holds_is_refused():
    with pytest.raises(ValueError, match="beyond 1e308"):
        (2.0 / s * delay(36.0)).phase([1e308])
    # Neither row outweighs the other, so the turns would have to be followed one by one.
    with pytest.raises(ValueError, match="lower frequencies"):
        ((s + 1) / (s * (1 + 0.7 * delay(1.0) + 0.7 * delay(2.0**0.5)) + 1)).phase([1e9])


@pytest.mark.parametrize("omega", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("ask", ["phase", "frequency_response"])
def test_what_is_no_frequency_is_refused(ask, omega):
    with pytest.raises(ValueError, match="finite frequencies"):
        getattr(LOOPS[0][0], ask)([omega])


@pytest.mark.parametrize("omega", [1e-308, 1e-300, 1e5, 1e300, 1e308])
def test_the_response_at_extremes_is_that_of_exact_numbers(omega):
    # 2/(1e-308 j) was nan + nan j: only its imaginary part is too large.
    found = (2.0 / s * delay(0.36)).frequency_response([omega, -omega])
    with mp.workprec(2200):
        exact = 2 / mp.mpc(0, omega) * mp.exp(-mp.mpc(0, omega) * mp.mpf(0.36))
        parts = [float(exact.real), float(exact.imag)]
    if omega <= 1e5:
        assert found[0].real == pytest.approx(parts[0], rel=1e-9)
        assert found[0].imag == pytest.approx(parts[1], rel=1e-9)
    # Beyond, the product of frequency and delay is rounded: the modulus is left.
    assert math.hypot(*parts) == pytest.approx(abs(found[0]), rel=1e-9)
    assert found[1] == found[0].conjugate()


def test_bode_at_extreme_frequencies():
    plt = pytest.importorskip("matplotlib.pyplot")
    axes = LOOPS[2][0].bode([1e-150, 1.0, 1e150])
    assert len(axes) == 2
    plt.close("all")
