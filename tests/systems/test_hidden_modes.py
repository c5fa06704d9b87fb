"""Common roots of numerator and denominator: no poles, and named."""

import json
import math
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime import TransferFunction, delay, feedback, s

REFERENCE = Path(__file__).parents[1] / "reference" / "delay_expressions.json"
JULIA, WINDOW, PREDICTOR = (row["right"] for row in json.loads(REFERENCE.read_text()))

WINDOWED = (1 - delay(1.0)) / s


def predicted(pole, h, k):
    """Feedback k of the state of exp(-h s)/(s - pole) predicted exactly, in three ways."""
    P, grown = delay(h) / (s - pole), math.exp(pole * h)
    Z = (1 - grown * delay(h)) / (s - pole)
    C = k / (1 + k * Z)
    return feedback(P * C, grown), k * P / (1 + k * Z + k * grown * P), P * C / (1 + P * C * grown)


def test_a_loop_through_a_moving_average_is_stable():
    L = (2 - 2 * delay(1.0)) / (s * (s + 1))
    for T, S in [(L / (1 + L), 1 / (1 + L)), (feedback(L), L.sensitivity())]:
        assert T.is_stable()
        assert S.is_stable()
        assert JULIA["stable"]
        assert S.dcgain() == pytest.approx(JULIA["S0"], rel=1e-14)
        assert T.dcgain() == pytest.approx(JULIA["Tinf"], rel=1e-14)
        for G in (T, S, T.minreal()):
            pole = G.rightmost()[0]
            assert pole == pytest.approx(complex(*JULIA["dominant_pole"]), abs=1e-9)
            assert G.spectral_abscissa() == pole.real
            assert set(G.hidden_modes()) <= {0j}
        settled = T.step_response(np.linspace(0, 60, 61)).outputs[-1]
        assert settled == pytest.approx(JULIA["Tinf"], abs=1e-8)
    assert L.margin().stable
    assert L.margin().hidden.tolist() == [0j]


def test_a_moving_average_has_no_poles():
    assert WINDOWED.is_stable() == WINDOW["stable"]
    assert WINDOWED.dcgain() == WINDOW["dcgain"]
    assert WINDOWED.poles().roots.tolist() == WINDOW["poles"]
    assert WINDOWED.count() == WINDOWED.count(re=(0, None)) == 0
    assert WINDOWED.rightmost().counted == 0
    assert WINDOWED.spectral_abscissa() == -math.inf
    assert WINDOWED.minreal().is_stable()
    assert WINDOWED.step_response().outputs[-1] == pytest.approx(1.0)


def test_a_predictor_has_the_poles_that_it_is_made_for():
    for T in predicted(1.0, 0.5, 2.0):
        assert T.is_stable()
        assert T.rightmost().roots == pytest.approx(PREDICTOR["poles"], abs=1e-8)
        assert T(2j) == pytest.approx(2 * np.exp(-1j) / (2j + 1), rel=1e-12)
        assert set(T.hidden_modes().round(6)) == {1.0}
        assert T.minreal().is_stable()
    assert predicted(1.0, 0.5, 2.0)[0].minreal() == 2 * delay(0.5) / (s + 1)


def random_predictors(number):
    rng = np.random.default_rng(45)
    return zip(rng.uniform(0.05, 3.0, number), rng.uniform(0.05, 1.0, number),
               rng.uniform(1.1, 4.0, number), strict=True)  # fmt: skip


def assert_predictors_are_judged(number):
    for pole, h, factor in random_predictors(number):
        for T in predicted(pole, h, factor * pole)[:2]:
            assert T.is_stable(), (pole, h, factor)
            assert T.spectral_abscissa() == pytest.approx(pole * (1 - factor), rel=1e-6)
        for T in predicted(pole, h, 0.9 * pole)[:2]:
            assert not T.is_stable(), (pole, h)


def test_random_predictors():
    assert_predictors_are_judged(20)


@pytest.mark.survey
def test_many_random_predictors():
    assert_predictors_are_judged(1000)


@pytest.mark.parametrize("error", [1e-9, 1e-12, -1e-12, 3e-14])
def test_a_numerator_that_is_only_small_hides_nothing(error):
    grown = math.exp(0.5) * (1 + error)
    for G in [
        (1 - (1 + error) * delay(1.0)) / s,
        (1 - grown * delay(0.5)) / (s - 1),
        (1 - math.exp(0.5) * delay(0.5 * (1 + error))) / (s - 1),
        (s - 1 - error) / (s - 1) / (s + 1),
    ]:
        assert not G.is_stable()
        assert G.count(re=(-0.5, 2)) == G.den.count(re=(-0.5, 2))
        assert G.hidden_modes().size == 0
    # A double root is moved further by rounding, one of two that coincide is common then.
    assert not ((s - 1 - error) ** 2 / (s - 1) ** 2 / (s + 1)).is_stable()


def random_loops(number):
    rng = np.random.default_rng(6)
    for _ in range(number):
        P = float(rng.normal() * 10 ** rng.uniform(-1, 1)) * delay(float(rng.uniform(0.01, 1)))
        for number in rng.normal(size=rng.integers(1, 5)):
            P = P * (rng.integers(2) * s + 1 - 0.5 * delay(0.3)) / (s - float(number))
        yield float(rng.normal()) * (s + 1) / s * P


def assert_algebra_changes_no_verdict(number):
    stable = 0
    for L in random_loops(number):
        wanted = feedback(L).is_stable()
        assert (L / (1 + L)).is_stable() == (1 / (1 + L)).is_stable() == wanted, L
        assert L.margin().stable == wanted
        stable += wanted
    assert 0 < stable < number


def test_algebra_changes_no_verdict():
    assert_algebra_changes_no_verdict(60)


@pytest.mark.survey
def test_algebra_changes_no_verdict_of_many_loops():
    assert_algebra_changes_no_verdict(2000)


def test_what_rounding_of_the_numbers_hides_is_hidden():
    for rounded in [np.nextafter(math.exp(0.5), 0), math.exp(0.5), np.nextafter(math.exp(0.5), 9)]:
        assert ((1 - rounded * delay(0.5)) / (s - 1)).is_stable()
    for late in [np.nextafter(0.5, 0), np.nextafter(0.5, 1)]:
        assert ((1 - math.exp(0.5) * delay(late)) / (s - 1)).is_stable()


def test_a_pole_of_higher_multiplicity_stays():
    G = (1 - delay(1.0)) / s**2
    assert G.poles().roots.tolist() == [0] == G.hidden_modes().tolist()
    assert G.poles().multiplicities.tolist() == [1]
    assert not G.is_stable()
    assert ((s - 1 + delay(1.0)) / s**2).is_stable()
    assert not (WINDOWED / (s - 2)).is_stable()
    assert (WINDOWED / (s - 2)).count(re=(0, None)) == 1
    double = (s - 0.3) ** 2 / ((s - 0.3) ** 2 * (s + 1))
    assert double.is_stable()
    assert double.hidden_modes() == pytest.approx([0.3, 0.3], abs=1e-6)
    assert not ((s - 0.3) / ((s - 0.3) ** 2 * (s + 1))).is_stable()


def test_a_hidden_mode_is_named_in_one_line():
    L = 3 / (s - 1) * delay(0.1)
    T = L / (1 + L)
    assert T.is_stable()
    (line,) = (line for line in repr(T.rightmost()).splitlines() if "hidden" in line)
    assert line.strip() == "hidden, as the numerator is zero there too: 1 + 0i"
    assert T.hidden_modes().tolist() == [1.0]
    assert feedback(L).hidden_modes().size == 0
    cancelled = 3 / (s - 1) * delay(0.1) * ((s - 1) / (s + 1))
    assert "hidden modes at 1+0j" in repr(cancelled.margin())
    assert cancelled.margin().stable == feedback(cancelled).is_stable()
    assert not feedback(cancelled).den.is_stable()


def test_a_system_and_a_loop_count_hidden_modes():
    system = dtm.DelaySystem([[1.0, 0.0], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 1.0]])
    assert not system.is_stable()
    # The zero of the controller, -1/Ti, is the unstable pole of the plant.
    plant = TransferFunction([4.0], [1.0, 1.0, -2.0])
    loop = dtm.ControlLoop(plant, dtm.PI(1.0, -1.0), delay=0.1)
    gain = loop.open_loop()
    assert gain.hidden_modes().tolist() == [1.0]
    assert not loop.is_stable()
    assert not loop.margin().stable
    assert feedback(gain).is_stable() == gain.margin().stable


def test_infinitely_many_common_roots():
    h = s + 5.0 * delay(0.36)
    assert (h / h).is_stable()
    assert not h.is_stable()
    assert (h / (h * (s + 1))).rightmost().counted == 1
    with pytest.raises(ValueError, match="roots of the numerator as well"):
        (h / h).spectral_abscissa()


def test_strong_stability_is_that_of_the_denominator():
    h = 1 - 1.1 * delay(1.0)
    G = TransferFunction((1 - delay(0.5)) * s, s * (s * h + 1))
    assert not G.is_stable()
    assert G.chain_abscissa() == G.den.chain_abscissa() > 0


@pytest.mark.parametrize("seed", range(4))
def test_minreal_divides_exactly(seed):
    rng = np.random.default_rng(seed)

    def polynomial(degree):
        return sum((float(c) * s**k for k, c in enumerate(rng.integers(1, 9, degree + 1))), 0 * s)

    n, d = (polynomial(2) + polynomial(1) * delay(h) for h in (0.5, 0.3))
    factor = polynomial(3)
    G, plain = TransferFunction(n * factor, d * factor).minreal(), TransferFunction(n, d).minreal()
    places = np.array([0.3, 1 + 2j, -0.2 + 1j])
    np.testing.assert_allclose(G(places), plain(places), rtol=1e-13)
    assert (G.num.degree, G.den.degree) == (plain.num.degree, plain.den.degree)


def test_minreal_keeps_what_does_not_divide_exactly():
    G = (s - 0.1) * (s + 0.3) / ((s - 0.1) * (s + 0.7))
    assert G.minreal() == G
    assert G.is_stable()
    assert (3 * s / (s * (s + 1))).minreal() == 3 / (s + 1)


def test_a_response_that_rounding_hides_is_refused():
    Z = (1 - math.exp(0.5) * delay(0.5)) / (s - 1)
    assert Z.step_response([0, 5.0]).outputs[-1] == pytest.approx(math.exp(0.5) - 1, abs=1e-12)
    with pytest.raises(ValueError, match="hide the output before the end of this run of 60 s"):
        Z.step_response([0, 60.0])
    T = predicted(1.0, 0.5, 2.0)[0]
    assert T.step_response([0, 60.0]).outputs[-1] == pytest.approx(2.0, rel=1e-12)
