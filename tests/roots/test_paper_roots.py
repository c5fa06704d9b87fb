"""Root sets that other programs get wrong, and those in the figures of Armah and Yi.

What is known here that is in no table: every disc is counted in ball arithmetic, every branch of
Lambert W is compared. The certified table itself is in test_root_cases.
"""

import math

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from ball_count import BallCounter
from deadtime import QuasiPolynomial, delay, s


def loop_roots(a, T, numbers):
    """Roots of s + a e^(−sT), W_k(−aT)/T, to 30 digits."""
    with mp.workdps(30):
        return [mp.lambertw(-mp.mpf(a) * mp.mpf(T), k) / mp.mpf(T) for k in numbers]


def assert_each_is(found, wanted):
    """One disc for each of the expected roots and no other disc."""
    assert len(found) == len(wanted) == found.counted
    left = sorted(wanted, key=lambda w: (w.imag, w.real))
    order = np.lexsort((found.roots.real, found.roots.imag))
    with mp.workdps(30):
        for k, w in zip(order, left, strict=True):
            assert abs(mp.mpc(found[int(k)]) - w) <= found.radii[k]


def assert_discs_hold_what_they_say(h, found, every=1):
    counter = BallCounter(h.coefficients, h.delays)
    for k in range(0, len(found), every):
        if found.radii[k] > 0:
            assert counter.disc(found[k], found.radii[k].item()) == found.multiplicities[k]
    for k in range(len(found)):
        gaps = np.abs(found.roots - found[k]) - found.radii - found.radii[k]
        assert (np.delete(gaps, k) > 0).all()


# What qpmr 0.1.0 gets wrong


def test_a_delay_of_ten_nanoseconds():
    """The result was empty once."""
    h = QuasiPolynomial([[0, 1], [1e8, 0]], [0, 1e-8])
    found = h.roots(re=(-1e9, 2e8), im=(0, 3e9))
    assert_each_is(found, loop_roots(1e8, 1e-8, range(5)))


@pytest.mark.survey
def test_more_than_three_thousand_roots_of_one_chain():
    """2899 of 3183 roots were returned once, without an error."""
    found = (s + delay(1.0)).roots(re=(-14, 2), im=(0, 20000))
    assert len(found) == 3183
    assert_each_is(found, loop_roots(1, 1, range(3183)))


def test_the_dominant_root_of_a_critically_damped_loop():
    """The double root was lost. With 1/e rounded it is a pair 5e-9 off −1, or two real roots."""
    a = math.exp(-1)
    h = s + a * delay(1.0)
    found = h.roots(re=(-6, 1), im=(-60, 60))
    assert found.multiplicities.tolist() == [2] + [1] * 18 or found.resolved.all()
    with mp.workdps(30):
        # Branches 0 and −1 are the two of the cluster.
        pair = loop_roots(a, 1, (0, -1))
        near = found.multiplicities[np.abs(found.roots + 1) < 1e-3]
        assert near.sum() == 2
        for w in pair:
            distance = [abs(mp.mpc(z) - w) - r for z, r in zip(found, found.radii, strict=True)]
            assert min(distance) <= 0
    others = found.roots[np.abs(found.roots + 1) > 1e-3]
    expected = [complex(w) for k in range(1, 10) for w in loop_roots(a, 1, (k, -1 - k))]
    assert np.allclose(np.sort_complex(others), np.sort_complex(expected), rtol=0, atol=1e-13)
    assert_discs_hold_what_they_say(h, found)


def test_a_double_root_at_the_origin():
    """Both members were lost. s − 1 + e^(−s): roots 1 + W_k(−1/e), twice 0."""
    h = s - 1 + delay(1.0)
    found = h.roots(re=(-6, 1), im=(-60, 60))
    assert found.counted == found.multiplicities.sum() == 20
    at_zero = np.abs(found.roots) <= found.radii
    assert found.multiplicities[at_zero].sum() == 2
    with mp.workdps(30):
        branches = [1 + mp.lambertw(-mp.exp(-1), k) for k in range(-10, 10) if k not in (0, -1)]
        for z, r in zip(found.roots[~at_zero].tolist(), found.radii[~at_zero], strict=True):
            assert min(abs(mp.mpc(z) - w) for w in branches) <= r


EIGHT_DELAYS = QuasiPolynomial(
    [
        [0, -1.8, 0.001, 0, 0, -12.8, 0, 1.7, 0.2],
        [29.1, 0, 0, 0, 0, 0, 0, 0, 0],
        [0, 6.7, 0, 0, 0, -1.1, 0, 1, 0],
        [0, 19.3, 2.1, 0, -8.7, 0, 0, 0, 0],
        [7.2, -1.4, 0, 0, 0.1, 0, 0.8, 0, 0],
        [0, 25.2, 0, -0.9, 0.2, 0.15, 0, 0, 0],
        [0, 0, 0, 0.5, 0, 0, 0, 0, 0],
        [1.5, -0.1, 0.04, 0.03, 0, 0, 0, 0, 0],
        [51.7, 0, 0, 0, 0, 0, 0, 0, 0],
    ],
    [0, 4.61, 8.52, 10.33, 13.32, 18.52, 19.9, 23.35, 24.99],
)


def test_every_root_of_eight_delays():
    """It once took more than a hundred seconds. Degree 8, Vyhlídal and Zítek (2009)."""
    found = EIGHT_DELAYS.roots(re=(-4.5, 2.5), im=(-100, 100))
    assert found.counted == found.multiplicities.sum() == 800
    assert found.resolved.all()
    assert_discs_hold_what_they_say(EIGHT_DELAYS, found)


def test_far_to_the_left_of_a_neutral_equation():
    """e^(6.3 · 130) exceeds the range of doubles, and the answer was lost once."""
    h = QuasiPolynomial(
        [
            [2.1, 5, 0, 0.2, 1],
            [0, -2.1, 0, 0, 0.5],
            [0, 0, 3.2, 0, 0.3],
            [0, 0, 1.2, 0, 0],
            [3, 0, 0, 0, 0],
        ],
        [0, 1.5, 2.2, 4.3, 6.3],
    )
    counter = BallCounter(h.coefficients, h.delays)
    for left in (-130.0, -1000.0):
        found = h.roots(re=(left, 2), im=(-50, 50))
        assert (
            found.counted == found.multiplicities.sum() == counter.rectangle((left, 2), (-50, 50))
        )
        assert_discs_hold_what_they_say(h, found)


# What tdcpy 0.0.1 gets wrong


def test_loops_without_an_undelayed_term():
    """Taken for loops without a delay: roots −1 and abscissa −3.

    The decimals are those of the printed problem; W₀(−1.08)/0.36 has more.
    """
    assert_each_is((s + delay(1.0)).roots(re=(-3, 1), im=(0, 20)), loop_roots(1, 1, range(3)))
    h = s + 3.0 * delay(0.36)
    assert abs(h.spectral_abscissa() + 0.734355712507741) < 1e-14
    first = h.rightmost()
    with mp.workdps(30):
        (w,) = loop_roots(3, 0.36, (0,))
        assert abs(mp.mpc(first[0]) - w) <= first.radii[0]


@pytest.mark.parametrize("top", [0.0, 0.1])
def test_four_incommensurate_delays(top):
    """No answer within minutes; retarded, and neutral with the same leading share on each."""
    delays = [0.0, 1.0, math.sqrt(2), math.sqrt(3), math.pi]
    rows = [[0.4, 0.7, 1.0]] + [[0.5, -0.3 + 0.1 * k, top] for k in range(4)]
    h = QuasiPolynomial(rows, delays)
    counter = BallCounter(rows, delays)
    found = h.roots(re=(-2.5, 1.5), im=(-60, 60))
    assert found.counted == found.multiplicities.sum() == counter.rectangle((-2.5, 1.5), (-60, 60))
    assert found.counted > 30
    assert_discs_hold_what_they_say(h, found)
    first = h.rightmost()
    assert counter.right_of(math.nextafter(first[0].real + 2 * first.radii[0], math.inf)) == 0
    assert first[0].real == pytest.approx(found[0].real, abs=1e-12)


@pytest.mark.parametrize("degree", [6, 8, 10, 12])
def test_high_degree_has_no_spurious_roots(degree):
    """A Butterworth filter of cut-off 6 rad/s under delayed feedback: no root but the true ones."""
    angles = math.pi * (2 * np.arange(degree) + degree + 1) / (2 * degree)
    row = np.poly(6 * np.exp(1j * angles)).real[::-1]
    rows = [row, [0.5 * row[0]] + [0.0] * degree]
    h = QuasiPolynomial(rows, [0.0, 0.7])
    counter = BallCounter(rows, [0.0, 0.7])
    found = h.roots(re=(-12, 4), im=(-60, 60))
    assert found.counted == found.multiplicities.sum() == counter.rectangle((-12, 4), (-60, 60))
    assert_discs_hold_what_they_say(h, found)


# Armah and Yi, Analysis of time delays in quadrotor systems and design of control (2017). Numbers
# printed in the text have the digits given; those read off a figure are marked so.


def test_figure_3_right_stability_ends_between_15_and_16():
    """Td = 0.1 s, unit integrator. Text and caption say 16 and 15: the limit is π/(2 Td)."""
    limit = math.pi / (2 * 0.1)
    for gain in (*range(1, 16), limit * (1 - 1e-12)):
        assert (s + gain * delay(0.1)).is_stable()
    for gain in (limit * (1 + 1e-12), 16.0, 18.0, 19.0):
        h = s + gain * delay(0.1)
        assert not h.is_stable()
        assert h.count(re=(0, None)) == 2
    for gain in (15.0, 16.0):
        found = (s + gain * delay(0.1)).roots(re=(-45, 10), im=(-400, 400))
        wanted = loop_roots(gain, 0.1, range(-9, 9))
        assert_each_is(found, [w for w in wanted if -45 < w.real < 10 and abs(w.imag) < 400])


@pytest.mark.parametrize(("gain", "rightmost"), [(4.0, -0.1715 + 4.2513j), (5.0, 0.2700 + 4.5288j)])
def test_figure_9_right_the_measured_delay(gain, rightmost):
    """Td = 0.36 s: the figure shows gain 4 stable and 5 not; four decimals by Lambert W."""
    h = s + gain * delay(0.36)
    assert abs(h.rightmost()[0] - rightmost) < 5e-5 * math.sqrt(2)
    assert h.is_stable() == (gain < math.pi / (2 * 0.36)) == (gain == 4.0)
    found = h.roots(re=(-12, 2), im=(-200, 200))
    wanted = loop_roots(gain, 0.36, range(-15, 15))
    assert_each_is(found, [w for w in wanted if -12 < w.real < 2 and abs(w.imag) < 200])


def pv(Kv):
    return s + (2.0 + Kv * s) * delay(0.36)


@pytest.mark.parametrize("Kv", [round(0.1 * k, 1) for k in range(1, 10)])
def test_figure_10_root_sets(Kv):
    """Kp = 2, Td = 0.36 s: the whole set of each gain of the figure, and its chain."""
    h = pv(Kv)
    assert h.chain_abscissa() == pytest.approx(math.log(Kv) / 0.36, rel=1e-14)
    found = h.roots(re=(-12, 2), im=(-150, 150))
    counter = BallCounter(h.coefficients, h.delays)
    assert found.counted == found.multiplicities.sum() == counter.rectangle((-12, 2), (-150, 150))
    assert_discs_hold_what_they_say(h, found)
    high = found.roots[np.abs(found.roots.imag) > 100]
    assert len(high) > 4
    # The roots tend to the chain as Kp/(Kv |s|).
    assert np.abs(high.real - h.chain_abscissa()).max() < (2 / Kv) ** 2 / 100**2 / 0.36 + 1e-3
    assert h.is_stable()


def test_figure_10_numbers():
    """Kv = 0.3: the figure prints −3.323 at a marker and the text −3.32; to the text's digits.

    The marker's third decimal belongs to a delay of 0.36045 s.
    """
    assert round(pv(0.3).rightmost()[0].real, 2) == -3.32
    at_marker = s + (2.0 + 0.3 * s) * delay(0.36045)
    assert abs(at_marker.rightmost()[0] + 3.323) < 1e-3
    assert abs(pv(0.2).spectral_abscissa() + 3.292) < 5e-4
    abscissas = {Kv: pv(Kv).spectral_abscissa() for Kv in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)}
    assert min(abscissas, key=abscissas.__getitem__) == 0.3
    fine = {Kv: pv(Kv).spectral_abscissa() for Kv in np.linspace(0.2, 0.3, 201).tolist()}
    best = min(fine, key=fine.__getitem__)
    assert best == pytest.approx(0.2415, abs=5e-4)
    assert fine[best] == pytest.approx(-3.684, abs=1e-3)
    # "Unstable beyond 0.97", printed.
    assert pv(0.968).is_stable()
    assert not pv(0.97).is_stable()


def test_figure_10_with_the_filter_of_the_flights():
    """The derivative through 38 rad/s, damping 1: another best gain, computed, not printed."""
    template = dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(2.0, 0.3, dtm.DerivativeFilter(38.0)), delay=0.36
    )
    h = template.characteristic()
    first = h.rightmost()
    assert abs(first[0] - (-2.197 + 5.578j)) < 1e-3
    assert BallCounter(h.coefficients, h.delays).right_of(first[0].real + 1e-9) == 0
